"""Lifting from a video: gradient sensors, corrections by hand, a figure of cylinders."""
