"""Cameras, video, and people seen in pictures without a model of walking."""
