"""2-D keypoints of people in pictures by a landmark network with public weights (BlazePose, Apache-2.0)."""
