"""Options of lifting keypoints."""

from __future__ import annotations

from dataclasses import dataclass

FLOOR_HEIGHT_SD_M = 0.03  # metres, of the floor's height
METHODS = ("smooth", "blend", "segment", "likelihood")


@dataclass(frozen=True)
class Options:
    """How to lift.

    Attributes
    ----------
    method : one of METHODS
    stature : float or None
        Metres; None: unknown.
    pixel_sd : float
        Noise of points at full confidence.
    floor_sd : float
        Standard deviation of the floor's height about z = 0 in the camera's world, metres.
    contact, bones : bool
        Soft constraints: feet on the floor do not slide; bones keep their length.
    balance : bool
        Soft constraint: the ground's force acts where feet stand; needs `contact`.
    covariance : bool
        Also compute the covariances of each frame's joints, which takes time.
    """

    method: str = "smooth"
    stature: float | None = None
    pixel_sd: float = 3.0
    floor_sd: float = FLOOR_HEIGHT_SD_M
    contact: bool = True
    bones: bool = True
    balance: bool = False
    covariance: bool = False
