"""The skeleton and a model's curves in numpy: the twins of what the C library computes."""
