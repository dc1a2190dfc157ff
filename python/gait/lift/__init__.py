"""3-D motion from 2-D tracks: a Gaussian prior over short segments of motion (Leventon and Freeman, 1998)."""
