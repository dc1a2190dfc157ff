"""Following a walker through frames: automatic start, particle filter, smoothing."""
