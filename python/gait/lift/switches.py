"""Where 2-D tracks change from one person to another: most points jump alike from one frame to the next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gait.io.keypoints_file import Tracks

Array = NDArray[np.float64]

FEWEST = 4  # points seen before and after
FAR = 0.25  # of the person's extent in the picture: nobody moves so much more than in the frames around
AROUND = 5  # frames before and after that tell how the points move
SOON = 2.0  # times the usual step of time: later, somebody may be anywhere


def switches(tracks: Tracks) -> list[tuple[int, int | None]]:
    """Find stretches on somebody else: first and last frame; None where the track stays there."""
    if len(tracks.time) < 2:
        return []
    jumps = np.flatnonzero(_jumps(tracks)).tolist()
    begins, ends = jumps[::2], jumps[1::2]
    last = [int(tracks.frame[t]) for t in ends]
    return list(zip([int(tracks.frame[t + 1]) for t in begins], [*last, None], strict=False))


def _jumps(tracks: Tracks) -> NDArray[np.bool_]:
    """Whether most points jump alike after each frame but the last, (T - 1,)."""
    moves, step = np.diff(tracks.uv, axis=0), np.diff(tracks.time)
    excess = moves - _around(moves)
    jumped = np.zeros(len(moves), bool)
    for t in np.flatnonzero(step <= SOON * np.median(step)):
        both = np.isfinite(excess[t]).all(axis=1)
        if both.sum() < FEWEST:
            continue
        extent = float(np.ptp(tracks.uv[t, both], axis=0).max())
        shift = np.median(excess[t, both], axis=0)
        length = float(np.linalg.norm(shift))
        alike = np.linalg.norm(excess[t, both] - shift, axis=1) < length / 2
        jumped[t] = length > FAR * extent and alike.mean() > 0.5
    return jumped


def _around(moves: Array) -> Array:
    """Median of each point's moves (T, J, 2) in the frames around; its own where there are no others."""
    padded = np.pad(moves, ((AROUND, AROUND), (0, 0), (0, 0)), constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * AROUND + 1, axis=0)
    known = np.where(np.isfinite(windows), windows, np.inf)
    ordered, count = np.sort(known, axis=-1), np.isfinite(windows).sum(axis=-1)
    middle = np.maximum(count - 1, 0)[..., None] // 2
    median = np.take_along_axis(ordered, middle, axis=-1)[..., 0]
    return np.where(np.isfinite(median), median, moves)
