"""Prepare 2-D keypoints for lifting: noise, spikes, swaps of left and right, changes of person."""
