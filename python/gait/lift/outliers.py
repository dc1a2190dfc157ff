"""Noise of 2-D tracks: points that a detector put elsewhere for a frame or two, and how much all shake."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gait.bindings.lifter import remove_spikes
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
    kept = remove_spikes(tracks.time, tracks.uv, np.full(tracks.uv.shape[:2], sd))
    spikes = tracks.seen & (kept < 0)
    named = [(int(tracks.frame[t]), tracks.names[j]) for t, j in np.argwhere(spikes)]
    return replace(tracks, uv=np.where(spikes[..., None], np.nan, tracks.uv)), named


def shake(tracks: Tracks) -> float:
    """Noise at full confidence that no motion explains, pixels; NaN where too few frames follow soon.

    By third differences: white noise's are sqrt(20) times as large, and a walk's at `QUICK` a pixel.
    """
    third = np.abs(np.diff(tracks.uv, 3, axis=0))
    seen = third[np.isfinite(third)]
    if not seen.size or np.median(np.diff(tracks.time)) > QUICK:
        return np.nan
    return float(SPREAD * np.median(seen) / np.sqrt(20) * np.median(tracks.confidence[tracks.seen]))
