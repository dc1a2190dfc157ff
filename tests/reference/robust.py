"""Spikes and outliers of 2-D points in numpy: the independent reference of `gait_lift_remove_spikes` and
`gait_lift_weight_outliers`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

SPIKE, FAR, FAR_MEDIAN = 8.0, 4.0, 3.0  # standard deviations; times the median of a frame
LINE_VARIANCE = 1.5  # of a point off the middle of its neighbours, over its own
MEDIAN_SD = 1.4826  # standard deviation over median distance
FEWEST = 5  # observations of a point


def spikes(time: Floats, uv: Floats, sd: Floats) -> list[int]:
    """Frames (T,) in which one point (T, 2) is a spike, in the order in which they are removed."""
    gone: list[int] = []
    while True:
        rows = np.array([t for t in range(len(time)) if np.isfinite(uv[t]).all() and t not in gone])
        if len(rows) < FEWEST:
            return gone
        apart = _distances(time[rows], uv[rows])
        far = int(apart.argmax())
        at = _culprit(apart, far)
        usual = np.sort(apart**2)[len(rows) // 2] * MEDIAN_SD**2
        if apart[far] ** 2 <= SPIKE**2 * max(usual, LINE_VARIANCE * sd[rows[at]] ** 2):
            return gone
        gone.append(int(rows[at]))


def _distances(time: Floats, uv: Floats) -> Floats:
    """Distances of each place from the line through two others, as half way between two neighbours."""
    count = len(time)
    step = (time[-1] - time[0]) / (count - 1)
    before = np.array([2, *range(count - 1)])
    after = np.array([*range(1, count), count - 3])
    span = time[after] - time[before]
    share = (time - time[before]) / span
    off = uv - uv[before] - share[:, None] * (uv[after] - uv[before])
    lever = share * (1 - share) * span**2 / step**2
    noise = (1 + share**2 + (1 - share) ** 2) / LINE_VARIANCE
    return np.asarray(np.sqrt((off**2).sum(axis=1) / np.maximum(lever**2, noise)))


def _culprit(apart: Floats, far: int) -> int:
    """Of the two points at an end, the inner one is a spike only if the third is off too, by at most half."""
    count, limit = len(apart), apart[far] / 4
    if far < 2:
        return int(apart[2] > limit)
    if far > count - 3:
        return count - 1 - int(apart[count - 3] > limit)
    return far


def weighted(square: Floats, sd: Floats) -> Floats:
    """Standard deviations (P,) of a frame's points at squared distances (P,) from their predictions."""
    limit = max(FAR**2, FAR_MEDIAN**2 * np.sort(square)[len(square) // 2])
    return np.asarray(sd * np.maximum(square / limit, 1))
