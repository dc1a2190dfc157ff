"""Heel strikes and walking direction of a known motion, and the phase they define."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import find_peaks

from gait.io.fields import Fields, read_json
from gait.io.track_file import Joints

Array = NDArray[np.float64]

STRIDE = 1.1  # seconds, where the true one is not known
_APART = 0.5  # seconds between strikes of one foot, at least
_REACH = 0.1  # metres that a foot swings past the pelvis, at least


@dataclass(frozen=True)
class Strikes:
    """Heel strikes as fractional frame numbers, increasing."""

    right: Array
    left: Array

    def phase(self, frames: ArrayLike) -> Array | None:
        """Phase [0, 1) at frame numbers (n,): linear between strikes; None if fewer than two are known.

        Right strikes are phase 0.  Left strikes, near but not at 0.5, serve only if right ones are too few.
        """
        cycles = self.cycles(frames)
        return None if cycles is None else cycles % 1.0

    def cycles(self, frames: ArrayLike) -> Array | None:
        """Return phase without wrapping, in strides; beyond the first and last strike the rate goes on."""
        at: Array = self.right
        count: Array = np.arange(len(self.right), dtype=float)
        if len(at) < 2:
            at, count = self._both()
        if len(at) < 2:
            return None
        frames = np.asarray(frames, float)
        piece = np.clip(np.searchsorted(at, frames, side="right") - 1, 0, len(at) - 2)
        share = (frames - at[piece]) / (at[piece + 1] - at[piece])
        return np.asarray(count[piece] + share * (count[piece + 1] - count[piece]))

    def _both(self) -> tuple[Array, Array]:
        """Strikes of both feet, half a stride from one to the next."""
        at = np.concatenate([self.right, self.left])
        order = np.argsort(at)
        is_left = np.concatenate([np.zeros(len(self.right), bool), np.ones(len(self.left), bool)])[order]
        first = 0.5 if len(at) and is_left[0] else 0.0
        return at[order], first + 0.5 * np.arange(len(at), dtype=float)


def strikes_of(truth: Joints, meta: Path) -> Strikes:
    """Strikes that the file `meta` lists, if it is there and lists any, else those found in the truth."""
    known = strikes_from_meta(meta) if meta.is_file() else None
    return known or strikes_by_zeni(truth)


def strikes_from_meta(path: str | os.PathLike[str]) -> Strikes | None:
    """Strikes from the ``events_video_frames`` of a clip's meta.json; None if it has none."""
    events = read_json(path, "meta").table("events_video_frames", "give lists of heel strikes")
    if "r_heel_strike" not in events or "l_heel_strike" not in events:
        return None
    return Strikes(_times(events, "r_heel_strike"), _times(events, "l_heel_strike"))


def strikes_by_zeni(truth: Joints) -> Strikes:
    """Strikes where a heel is furthest ahead of the pelvis along the walking direction (Zeni et al. 2008).

    Where the truth has no heels the ankles serve.
    """
    ahead = walking_direction(truth)
    pelvis = truth.places["pelvis"]
    right, left = (
        _strikes(truth, np.sum((_foot(truth, side) - pelvis) * ahead, axis=1)) for side in ("r", "l")
    )
    return Strikes(right, left)


def walking_direction(truth: Joints, stride: float = STRIDE) -> Array:
    """Return the unit direction of travel along the ground at each frame, shape (n, 3).

    It is the way of the pelvis over one stride of `stride` seconds around the frame, over which the sway of
    the pelvis cancels; near the ends, over the first and last stride.
    """
    time, pelvis = truth.time, truth.places["pelvis"][:, :2]
    early = np.clip(time - stride / 2, time[0], max(time[0], time[-1] - stride))
    late = np.minimum(early + stride, time[-1])
    way = np.zeros((len(time), 3))
    for axis in range(2):
        way[:, axis] = np.interp(late, time, pelvis[:, axis]) - np.interp(early, time, pelvis[:, axis])
    return np.asarray(way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12))


def _foot(truth: Joints, side: str) -> Array:
    return truth.places.get(f"{side}_heel", truth.places[f"{side}_ankle"])


def furthest(time: Array, reach: Array) -> Array:
    """Return the times of the maxima of `reach`, refined by the parabola through three frames.

    Parameters
    ----------
    time : ndarray of shape (n,)
    reach : ndarray of shape (n,)
        Metres that a foot is ahead of the pelvis (or behind it, to find toe-offs).
    """
    step = float(np.median(np.diff(time)))
    peaks, _ = find_peaks(reach, height=_REACH, distance=max(1, round(_APART / step)))
    before, top, after = reach[peaks - 1], reach[peaks], reach[peaks + 1]
    bend = before - 2 * top + after
    shift = np.where(bend < 0, 0.5 * (before - after) / np.where(bend < 0, bend, 1), 0.0)
    return np.interp(peaks + shift, np.arange(len(reach)), time)


def _strikes(truth: Joints, reach: Array) -> Array:
    """Fractional frame numbers of the strikes of a foot that is `reach` (n,) metres ahead."""
    return np.interp(furthest(truth.time, reach), truth.time, truth.frame.astype(float))


def _times(events: Fields, key: str) -> Array:
    """Increasing strike times of one foot."""
    remedy = "give a list of increasing frame numbers"
    times = events.array(key, (events.count(key, remedy),), remedy)
    if (np.diff(times) <= 0).any():
        raise events.fail(key, "does not increase", remedy)
    return times
