"""Noise of 2-D keypoints: spikes that last a frame or two, jitter, and switches to another person.

At a switch, most points jump in the same way from one frame to the next.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gait.bindings.lifter import remove_spikes
from gait.io.keypoints_file import Keypoints

Array = NDArray[np.float64]

SPREAD = 1.4826  # median absolute deviation to standard deviation, normal noise
QUICK = 0.051  # seconds from frame to frame (20 per second); with longer steps motion looks like noise


def without_spikes(keypoints: Keypoints, sd: float) -> tuple[Keypoints, list[tuple[int, str]]]:
    """Remove points that are far from the line through the same point in neighbouring frames.

    Distances are relative to the larger of the noise `sd` (pixels) and the median of the point's own
    distances, which contains its acceleration.  The furthest point is removed first, since it bends its
    neighbours' lines.

    Returns
    -------
    keypoints : Keypoints
        Without the removed points.
    jumps : list of (frame, name)
        The removed points, in order of time.
    """
    kept = remove_spikes(keypoints.time, keypoints.uv, np.full(keypoints.uv.shape[:2], sd))
    spikes = keypoints.visible & (kept < 0)
    named = [(int(keypoints.frame[t]), keypoints.names[j]) for t, j in np.argwhere(spikes)]
    return replace(keypoints, uv=np.where(spikes[..., None], np.nan, keypoints.uv)), named


def shake(keypoints: Keypoints) -> float:
    """Measure the noise at full confidence that no motion explains, pixels; NaN if too few frames are close.

    Uses third differences: those of white noise are sqrt(20) times the noise, those of a walk, at `QUICK`, a
    pixel.
    """
    third = np.abs(np.diff(keypoints.uv, 3, axis=0))
    observed = third[np.isfinite(third)]
    if not observed.size or np.median(np.diff(keypoints.time)) > QUICK:
        return np.nan
    return float(
        SPREAD * np.median(observed) / np.sqrt(20) * np.median(keypoints.confidence[keypoints.visible])
    )


FEWEST_COMMON_POINTS = 4  # fewest points seen in both frames
#: Of the person's extent in the picture; no person moves this much more than in the frames around.
FAR_OF_EXTENT = 0.25
FRAMES_AROUND = 5  # frames before and after that show how the points move
SOON = 2.0  # times the usual frame time; after a longer step a person may be anywhere


def person_changes(keypoints: Keypoints) -> list[tuple[int, int | None]]:
    """Find intervals with another person: first and last frame, or None if the keypoints stay there."""
    if len(keypoints.time) < 2:
        return []
    changes = np.flatnonzero(_changes(keypoints)).tolist()
    begins, ends = changes[::2], changes[1::2]
    last = [int(keypoints.frame[t]) for t in ends]
    return list(zip([int(keypoints.frame[t + 1]) for t in begins], [*last, None], strict=False))


def _changes(keypoints: Keypoints) -> NDArray[np.bool_]:
    """Whether most points jump in the same way after each frame but the last, (T - 1,)."""
    moves, step = np.diff(keypoints.uv, axis=0), np.diff(keypoints.time)
    excess = moves - _around(moves)
    jumped = np.zeros(len(moves), bool)
    for t in np.flatnonzero(step <= SOON * np.median(step)):
        both = np.isfinite(excess[t]).all(axis=1)
        if both.sum() < FEWEST_COMMON_POINTS:
            continue
        extent = float(np.ptp(keypoints.uv[t, both], axis=0).max())
        shift = np.median(excess[t, both], axis=0)
        length = float(np.linalg.norm(shift))
        alike = np.linalg.norm(excess[t, both] - shift, axis=1) < length / 2
        jumped[t] = length > FAR_OF_EXTENT * extent and alike.mean() > 0.5
    return jumped


def _around(moves: Array) -> Array:
    """Median of each point's moves (T, J, 2) in the frames around, or its own move if there are none."""
    padded = np.pad(moves, ((FRAMES_AROUND, FRAMES_AROUND), (0, 0), (0, 0)), constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * FRAMES_AROUND + 1, axis=0)
    known = np.where(np.isfinite(windows), windows, np.inf)
    ordered, count = np.sort(known, axis=-1), np.isfinite(windows).sum(axis=-1)
    middle = np.maximum(count - 1, 0)[..., None] // 2
    median = np.take_along_axis(ordered, middle, axis=-1)[..., 0]
    return np.where(np.isfinite(median), median, moves)
