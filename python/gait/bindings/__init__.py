"""The C library's objects in Python: model, state, start, observations, estimate, lifter."""
