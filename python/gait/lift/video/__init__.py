"""Lift a video's images: gradient sensors, corrections by hand, a figure of cylinders."""
