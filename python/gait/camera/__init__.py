"""Cameras: files, calibration, placement and paths."""
