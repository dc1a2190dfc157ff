"""Tracking a person through frames: automatic start, particle filter, smoothing."""
