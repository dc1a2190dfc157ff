"""Known and tracked motion: its files, footfalls and parameters, and its errors against the truth."""
