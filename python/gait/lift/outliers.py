"""Noise of 2-D tracks: points that a detector put elsewhere for a frame or two, and how much all shake."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gait.io.keypoints_file import Tracks

Array = NDArray[np.float64]

LIMIT = 8.0  # deviations from the line between neighbours beyond which a point is no noise
SPREAD = 1.4826  # median absolute deviation to standard deviation, normal noise
FEWEST = 5  # sights of a point that tell
QUICK = 0.051  # seconds from frame to frame (20 a second): with longer steps motion looks like noise
PAIR = np.sqrt(1.5)  # sd of a point against the middle of its neighbours, over that of one point


def without_jumps(tracks: Tracks, sd: float) -> tuple[Tracks, list[tuple[int, str]]]:
    """Take out points that lie far off the line between the same point's neighbours in time.

    The measure of a point is the larger of the noise `sd` (pixels) and the median of its own distances from
    that line, which holds its acceleration.  The furthest goes first, because it bends its neighbours' lines.

    Returns
    -------
    tracks : Tracks
        With these points not seen.
    jumps : list of (frame, name)
        In the order of time.
    """
    uv = tracks.uv.copy()
    gone: list[tuple[int, str]] = []
    for j, name in enumerate(tracks.names):
        gone += [(int(tracks.frame[t]), name) for t in _clear(tracks.time, uv[:, j], sd)]
    return replace(tracks, uv=uv), sorted(gone)


def shake(tracks: Tracks) -> float:
    """Noise at full confidence that no motion explains, pixels; NaN where too few frames follow soon.

    By third differences: white noise's are sqrt(20) times as large, and a walk's at `QUICK` a pixel.
    """
    third = np.abs(np.diff(tracks.uv, 3, axis=0))
    seen = third[np.isfinite(third)]
    if not seen.size or np.median(np.diff(tracks.time)) > QUICK:
        return np.nan
    return float(SPREAD * np.median(seen) / np.sqrt(20) * np.median(tracks.confidence[tracks.seen]))


def _clear(time: Array, uv: Array, sd: float) -> list[int]:
    """Set the jumps of one point (T, 2) to NaN; returns their rows."""
    gone: list[int] = []
    seen = np.flatnonzero(np.isfinite(uv).all(axis=1))
    distance = _off_line(time[seen], uv[seen])
    while seen.size >= FEWEST:
        scale = max(PAIR * sd, SPREAD * float(np.median(distance)))
        worst = int(distance.argmax())
        if distance[worst] <= LIMIT * scale:
            break
        gone.append(int(seen[worst]))
        uv[seen[worst]] = np.nan
        seen, distance = np.delete(seen, worst), np.delete(distance, worst)
        for beside in (worst - 1, worst):  # whose lines have changed
            rows = seen[max(beside - 1, 0) : beside + 2]
            distance[beside] = _off_line(time[rows], uv[rows])[1] if rows.size == 3 else 0.0
    return gone


def _off_line(time: Array, uv: Array) -> Array:
    """Distance of each place (n, 2) from the line between its neighbours at its time; the ends: 0."""
    if len(uv) < 3:
        return np.zeros(len(uv))
    share = ((time[1:-1] - time[:-2]) / (time[2:] - time[:-2]))[:, None]
    inner = uv[1:-1] - (1 - share) * uv[:-2] - share * uv[2:]
    return np.pad(np.hypot(*inner.T), 1)
