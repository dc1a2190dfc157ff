"""3-D motion from 2-D keypoints by a prior over short segments of motion (Leventon and Freeman 1998).

- `keypoints`: noise, spikes and swaps of left and right in 2-D keypoints.
- `segment`: single segments, by the C library, and the views they are seen in.
- `smooth`: a whole sequence as one Gaussian, or as blended segments.
- `video`: lifting from a video, with corrections by hand.
- `report`: figures.
- `run`: a file of keypoints from reading to warnings.
"""
