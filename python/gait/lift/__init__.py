"""3-D motion from 2-D keypoints with a prior over short segments of motion (Leventon and Freeman 1998).

- `keypoints`: noise, spikes and swaps of left and right in 2-D keypoints.
- `segment`: single segments, with the C library, and the views in which they are observed.
- `smooth`: a whole sequence as one Gaussian, or as blended segments.
- `video`: lifting from a video's images, with corrections by hand.
- `report`: figures.
- `run`: lifting a file of keypoints, from reading to warnings.
"""
