"""True and tracked motion: footfalls and parameters, and errors against the truth."""
