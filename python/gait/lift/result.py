"""How tracks are lifted, and what comes of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.lift.explain import Uncertain

Floats = npt.NDArray[np.float64]

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
    """

    method: str = "smooth"
    stature: float | None = None
    pixel_sd: float = 3.0
    floor_sd: float = FLOOR_SD
    contact: bool = True
    bones: bool = True


@dataclass(frozen=True)
class Motion:
    """Lifted tracks.

    Attributes
    ----------
    names : tuple of str
        The J markers.
    places, sd : (T, J, 3)
        Metres, and posterior standard deviations.
    rooted_sd : (T, J, 3)
        Deviations of the places about the middle of the hips.
    error : (T, P)
        Distance in the picture from what was seen, pixels; NaN where nothing was.
    stature : float
        Metres; of segments alone what was believed.
    steps : int
        Iterations over the whole sequence; 0 for segments alone.
    settled : bool
    log_volume_ratio : float
        Logarithm to base 10 of the posterior's volume over the prior's; of segments alone, their mean.
    uncertain : Uncertain
        What its segments, each alone, leave open.
    evidence : float
        Logarithm of the density of what is seen, but for a constant; NaN for segments alone.
    misfit : float
        Squared deviations per number seen, about 1; NaN for segments alone.
    wider : float
        Factor of the prior's deviations that the tracks asked for; 1 for motions like those learnt.
    resized : float
        Factor by which the fit's size was changed to that of a person; 1 for motions like those learnt.
    alone : bool
        Whether the motion was so unlike those learnt that its segments were estimated alone instead.
    doubted : (T, P)
        Points that lost their say because they are far from where the rest has them; none are told of
        segments alone.
    """

    names: tuple[str, ...]
    places: Floats
    sd: Floats
    rooted_sd: Floats
    error: Floats
    stature: float
    steps: int
    settled: bool
    log_volume_ratio: float
    uncertain: Uncertain
    evidence: float = float("nan")
    misfit: float = float("nan")
    wider: float = 1.0
    resized: float = 1.0
    alone: bool = False
    doubted: npt.NDArray[np.bool_] | None = None
