"""Objects of the C library in Python: model, state, start, observations, estimate, lifter."""
