"""How much faster than the mean somebody walks, which the mean cycle of a model follows (section PACE)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

MOST = 2.0
"""Standard deviations between people: as far from the mean rate as is learnt (kinematics.h)."""


def pace(statistics: npt.ArrayLike, stride_hz: npt.ArrayLike) -> Floats:
    """Stride rates (...) as standard deviations between people from the mean, at most `MOST`.

    Parameters
    ----------
    statistics : (2, ...)
        Mean and standard deviation of the stride rate, as section GAIT begins.
    stride_hz : (...)
        0: not known, as if it were the mean.
    """
    mean, sd = np.asarray(statistics, float)[:2]
    rate = np.asarray(stride_hz, float)
    if not sd > 0:
        return np.zeros(rate.shape)
    return np.where(rate > 0, np.clip((rate - mean) / sd, -MOST, MOST), 0.0)
