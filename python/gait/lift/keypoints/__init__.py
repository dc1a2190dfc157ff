"""2-D keypoints before lifting: noise, spikes, swaps of left and right, changes of person."""
