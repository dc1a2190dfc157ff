"""Objects of the C library as Python's: model, state, start, what is observed, estimate, lifter."""
