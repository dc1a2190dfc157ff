"""Measures of a run beyond those of `gait eval`."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from gait import Camera, Model, State
from gait.bindings.estimate import Estimate
from gait.body.skeleton import EVAL15
from gait.io.track_file import STATUSES, Joints, Track, read_truth
from gait.motion.evaluate import INDEPENDENT_FRAMES, LOST_MM, root_errors
from gait.motion.footfalls import Strikes, strikes_by_zeni

LOCK_AFTER = (1.0, 1.5)  # seconds after the start in which the phase must be right
LOCK = 0.05  # cycles; largest error that still counts as locked
#: A run is wrong if more than this share of the frames after the first second is flipped while `tracking`.
WRONG = 0.05
WITHIN = 2.0  # frames by which a heel strike may be off
_DRAWS = 256  # particles whose poses give the covariance
_SHRINK = 0.1  # shrinks the covariance towards its diagonal: limbs are rigid, so it is nearly singular


def shares(track: Track) -> dict[str, float]:
    """Share of the frames with each status."""
    status = np.array(track.status)
    return {word: float((status == word).mean()) for word in STATUSES}


def against_truth(track: Track, truth: Joints, camera: Camera) -> dict[str, np.ndarray]:
    """Errors frame by frame; NaN in frames that the truth lacks."""
    _, ours, theirs = np.intersect1d(track.frame, truth.frame, return_indices=True)
    found, true = track.eval15()[ours], truth.eval15()[theirs]
    pixels = np.linalg.norm(camera.project(found) - camera.project(true), axis=2)
    hips = [EVAL15.index("l_hip"), EVAL15.index("r_hip")]
    relative = [at - at[:, hips].mean(axis=1, keepdims=True) for at in (found, true)]
    measured = {
        "root": root_errors(found, true),
        "abs": 1000 * np.linalg.norm(found - true, axis=2).mean(axis=1),
        "px": np.nanmean(pixels, axis=1),
        "joints": 1000 * np.linalg.norm(relative[0] - relative[1], axis=2),
        "true_path": truth.places["pelvis"][theirs, :2],
        "offset": 1000 * (found - true)[:, hips].mean(axis=1) @ camera.R.T,
    }
    return {name: _expanded(values, ours, len(track.frame)) for name, values in measured.items()}


def _expanded(values: np.ndarray, rows: np.ndarray, count: int) -> np.ndarray:
    out = np.full((count, *values.shape[1:]), np.nan)
    out[rows] = values
    return out


def phase_difference(found: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Found minus true phase in [-0.5, 0.5) cycles."""
    return (found - true + 0.5) % 1.0 - 0.5


def phase_interval(series: dict[str, np.ndarray], sd: np.ndarray) -> dict[str, float]:
    """Share of the frames whose 90 % interval of the phase contains the truth."""
    if "true_phase" not in series:
        return {}
    off = np.abs(phase_difference(series["phase"], series["true_phase"]))
    return {"phase90": float((off <= 1.6448536 * sd).mean())}


def start_quality(track: Track, true_phase: np.ndarray) -> dict[str, Any]:
    """Is the phase locked (modulo half a cycle) a second after the start, and which leg is which after?

    ``side`` is ``wrong`` if more than `WRONG` of the later frames are half a cycle off while the status is
    ``tracking``, else ``right`` if at least half of them are ``tracking``, ``open`` if at least half are that
    or ``ambiguous``, else ``lost``.  Frames without a phase, in which the person stands, do not count.
    """
    since = track.time - track.time[0]
    error = phase_difference(track.phase, true_phase)
    flipped = np.abs(error) > 0.25
    left = np.abs(np.where(flipped, np.abs(error) - 0.5, error))
    later = (since >= LOCK_AFTER[0]) & np.isfinite(error)
    window = later & (since <= LOCK_AFTER[1])
    if not window.any():
        return {"locked": None, "side": None}
    status = np.array(track.status)[later]
    silent = float((flipped[later] & (status == "tracking")).mean())
    return {
        "locked": bool(np.median(left[window]) <= LOCK),
        "side": _side(status, silent),
        "flipped_silently": silent,
    }


def _side(status: np.ndarray, silent: float) -> str:
    tracked = float((status == "tracking").mean())
    if silent > WRONG:
        return "wrong"
    if tracked >= 0.5:
        return "right"
    return "open" if tracked + float((status == "ambiguous").mean()) >= 0.5 else "lost"


def strike_errors(track: Track, strikes: Strikes) -> dict[str, Any]:
    """Heel strikes of the track's joints compared with the known ones inside the frames tracked.

    ``within``: share of the known strikes that are matched within `WITHIN` frames; ``worst`` (frames);
    ``stride`` relative error of the mean stride time.  Strikes in the first and last 3 frames are not
    required.
    """
    found = strikes_by_zeni(track)
    low, high = track.frame[0] + 3, track.frame[-1] - 3
    off, strides = [], []
    for side in ("right", "left"):
        known = getattr(strikes, side)
        known = known[(known >= low) & (known <= high)]
        mine = getattr(found, side)
        if not len(mine):
            off += [float("inf")] * len(known)
            continue
        nearest = mine[np.abs(mine[None] - known[:, None]).argmin(axis=1)]
        off += np.abs(nearest - known).tolist()
        if len(known) > 1:
            strides.append((np.diff(known).mean(), np.diff(nearest).mean()))
    if not off:
        return {"asked": 0, "within": None, "worst": None, "stride": None}
    true, mine = np.mean(strides, axis=0) if strides else (np.nan, np.nan)
    return {
        "asked": len(off),
        "within": float((np.array(off) <= WITHIN).mean()),
        "worst": float(max(off)),
        "stride": float(abs(mine - true) / true) if strides else None,
    }


def lost_at_end(series: dict[str, np.ndarray]) -> bool:
    """Is the person lost over the last 20 frames, or over more than half of all?"""
    lost = series["status"] == "lost"
    if "root" in series:
        lost = lost | (series["root"] > LOST_MM)
    if "marked_px" in series:
        lost = lost | (np.nan_to_num(series["marked_px"]) > series["limit_px"][0])
    return bool(lost.mean() > 0.5 or lost[-20:].all())


class Uncertainty:
    """NEES (Bar-Shalom et al. 2001) of all joints together, with the particles' own covariance."""

    def __init__(self, truth: Path | None, model: Model) -> None:
        self._truth = read_truth(truth) if truth else None
        self._rows = {} if self._truth is None else {int(n): i for i, n in enumerate(self._truth.frame)}
        self._true = None if self._truth is None else self._truth.eval15()
        self._model = model
        self._joints = [model.joint_names.index(name) for name in EVAL15]
        self._next = INDEPENDENT_FRAMES  # the start determines the first frames

    def wants(self, frame: int) -> bool:
        """Is this one of the frames, far enough apart, that are measured?"""
        if frame not in self._rows or frame < self._next:
            return False
        self._next = frame + INDEPENDENT_FRAMES
        return True

    def nees(self, frame: int, estimate: Estimate, states: np.ndarray, weights: np.ndarray) -> float:
        """Squared error per dimension in units of the covariance; 1 if the covariance is right."""
        picked = np.searchsorted(np.cumsum(weights), (np.arange(_DRAWS) + 0.5) / _DRAWS * weights.sum())
        picked = np.minimum(picked, len(weights) - 1)
        poses = np.array([self._model.pose(_state(states[i]))[0][self._joints].ravel() for i in picked])
        covariance = np.cov(poses.T)
        diagonal = np.diag(covariance)
        shrunk = (1 - _SHRINK) * covariance + np.diag(_SHRINK * diagonal + 1e-6)  # at least 1 mm
        error = estimate.joints[self._joints].ravel() - self._true[self._rows[frame]].ravel()
        return float(error @ np.linalg.solve(shrunk, error) / len(error))


def _state(record: np.void) -> State:
    values = {item.name: record[item.name] for item in fields(State)}
    return State(**{name: v.item() if v.ndim == 0 else np.array(v, float) for name, v in values.items()})
