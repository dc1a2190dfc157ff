"""Options of lifting keypoints."""

from __future__ import annotations

from dataclasses import dataclass

FLOOR_SD = 0.03  # metres, of the floor's height
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
        Noise of points seen with full confidence.
    floor_sd : float
        How well the ground of the camera's world is where the person stands, metres.
    contact, bones : bool
        Feet stay put; bones keep their length.
    balance : bool
        The ground pushes where feet stand; needs `contact`.
    covariance : bool
        Give the covariances of each frame's joints too, which takes time.
    """

    method: str = "smooth"
    stature: float | None = None
    pixel_sd: float = 3.0
    floor_sd: float = FLOOR_SD
    contact: bool = True
    bones: bool = True
    balance: bool = False
    covariance: bool = False
