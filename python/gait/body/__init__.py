"""The skeleton and a model's curves in numpy, in double precision and without the C library."""
