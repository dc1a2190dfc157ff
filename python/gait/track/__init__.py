"""Track people through frames: automatic start, particle filter, smoothing."""
