"""3-D motion from 2-D keypoints: a Gaussian prior over short segments of motion (Leventon and Freeman, 1998)."""
