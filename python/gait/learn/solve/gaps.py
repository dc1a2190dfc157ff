"""Short gaps in measured positions, filled before angles are taken of them.

An angle needs up to five joints and is missing if one coordinate of one of them is: of the angles of a file
in which 10 % of the cells are empty, most would be.  A curve through the samples to both sides is good where
these are near, by the rule that decides which entries of a cycle count as observed
(`gait.learn.cycles.cycles`).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.interpolate import Akima1DInterpolator

from gait.learn.cycles.cycles import BRACKET, INTERVALS, NEXT

Floats = npt.NDArray[np.float64]

STRIDE = 1.1  # seconds: usual, since the recording's own is not known yet
FEWEST = 4  # samples a curve is laid through


def bridged(places: Floats, fps: float) -> Floats:
    """Fill short gaps of a joint's coordinates.

    Parameters
    ----------
    places : (T, 3)
        NaN where missing.
    fps : float
        Frames per second.

    Returns
    -------
    (T, 3)
        As given, but with values in gaps whose middle is within reach of samples on both sides: 0.05 s,
        and the next frame at least.  Rows in which a coordinate stays missing are missing.
    """
    reach = max(BRACKET / INTERVALS * STRIDE * fps, NEXT)
    result, frames = places.copy(), np.arange(len(places))
    for column in result.T:
        seen = np.flatnonzero(np.isfinite(column))
        if not FEWEST <= len(seen) < len(column):
            continue
        after = np.searchsorted(seen, frames)
        left, right = seen[np.maximum(after - 1, 0)], seen[np.minimum(after, len(seen) - 1)]
        near = (left < frames) & (frames < right) & (right - left <= 2 * reach)
        column[near] = Akima1DInterpolator(seen, column[seen])(frames[near])
    return np.where(np.isfinite(result).all(axis=1, keepdims=True), result, np.nan)
