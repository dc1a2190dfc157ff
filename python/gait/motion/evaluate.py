"""Errors of a track against the truth."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.body.skeleton import EVAL15
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.track_file import STATUSES, Joints, Track
from gait.motion.baselines import free_run, static_pose
from gait.motion.events import Strikes
from gait.motion.interval_coverage import calibration, coverage

Array = NDArray[np.float64]
Measures = dict[str, Any]

LOST_MM = 150.0
HIPS = [EVAL15.index("l_hip"), EVAL15.index("r_hip")]
BODY = [i for i, name in enumerate(EVAL15) if name != "pelvis"]
LIMBS = [i for i, name in enumerate(EVAL15) if name not in ("pelvis", "neck", "head_top")]


def evaluate(
    track: Track,
    truth: Joints,
    *,
    strikes: Strikes,
    model: dict[str, Any],
    camera: Camera | None = None,
) -> Measures:
    """Compare the frames that both have.

    Parameters
    ----------
    track, truth
    strikes : Strikes
        Heel strikes of the truth.
    model : dict
        Sections of the model blob, for the baselines.
    camera : Camera, optional
        For the distance in the picture.

    Returns
    -------
    dict
        ``frames``; ``abs``, ``root`` (mm) and ``px`` each as ``median``, ``mean``, ``p90``; ``lost`` (share);
        ``phase`` (cycles; see `phase_errors`) and ``px`` are None where they, strikes or camera are unknown;
        ``coverage`` (share) of the ``50`` and ``90`` % intervals; ``static`` and ``free``: the baselines;
        ``root12``: as ``root`` over shoulders, elbows, wrists, hips, knees and ankles, the joints that 2-D
        pose networks have; ``proc``: after the best rotation, scale and shift of every frame, to compare
        with literature only; ``status``, ``trust`` (see `trust`); ``calibration`` (see
        `gait.motion.interval_coverage`).

    Raises
    ------
    UserError
        If they have no frame in common.
    """
    common, ours, theirs = np.intersect1d(track.frame, truth.frame, return_indices=True)
    if len(common) == 0:
        raise UserError(f"track: frames {_span(track)} and the truth's {_span(truth)} have none in common")
    found, true = track.eval15()[ours], truth.eval15()[theirs]
    status = np.array(track.status)[ours]
    given_up = status == "lost"
    phase, true_phase = track.phase[ours], strikes.phase(common)
    still = static_pose(model, truth)[theirs]
    free = free_run(model, truth, strikes, first=int(theirs[0]))
    return {
        "frames": len(common),
        **pose_errors(found, true, given_up),
        "phase": None if true_phase is None or np.isnan(phase).all() else phase_errors(phase, true_phase),
        "px": None if camera is None else picture_errors(found, true, camera),
        "coverage": coverage(found, track.eval15_sd()[ours], true),
        "static": pose_errors(still, true),
        "free": None if free is None else pose_errors(free[theirs], true),
        "root12": spread(root_errors(found, true, LIMBS)),
        "proc": spread(procrustes_errors(found, true)),
        "status": {word: float((status == word).mean()) for word in STATUSES},
        "trust": trust(root_errors(found, true), status),
        "calibration": calibration(found, track.eval15_sd()[ours], true),
    }


def spread(values: Array) -> dict[str, float]:
    """Median, mean and 90th percentile over frames."""
    return {
        "median": float(np.median(values)),
        "mean": float(np.mean(values)),
        "p90": float(np.percentile(values, 90)),
    }


def pose_errors(found: Array, true: Array, given_up: NDArray[np.bool_] | None = None) -> Measures:
    """``abs``, ``root`` in mm and the share ``lost`` of EVAL15 positions (n, 15, 3) in metres."""
    absolute = 1000 * np.linalg.norm(found - true, axis=2).mean(axis=1)
    root = root_errors(found, true)
    lost = root > LOST_MM if given_up is None else (root > LOST_MM) | given_up
    return {"abs": spread(absolute), "root": spread(root), "lost": float(lost.mean())}


def root_errors(found: Array, true: Array, joints: list[int] = BODY) -> Array:
    """Mean distance (n,) in mm of `joints` (the 14 other than the pelvis), hip midpoints laid together."""
    found = found - found[:, HIPS].mean(axis=1, keepdims=True)
    true = true - true[:, HIPS].mean(axis=1, keepdims=True)
    return np.asarray(1000 * np.linalg.norm(found - true, axis=2)[:, joints].mean(axis=1))


def procrustes_errors(found: Array, true: Array) -> Array:
    """Mean distance (n,) in mm of EVAL15 after the least-squares similarity of every frame (Umeyama 1991)."""
    found = found - found.mean(axis=1, keepdims=True)
    true = true - true.mean(axis=1, keepdims=True)
    u, s, vt = np.linalg.svd(np.einsum("nji,njk->nik", true, found))
    mirror = np.ones_like(s)
    mirror[:, 2] = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    turn = np.einsum("nij,nj,njk->nik", u, mirror, vt)
    scale = (s * mirror).sum(axis=1) / np.maximum((found**2).sum(axis=(1, 2)), 1e-12)
    fitted = scale[:, None, None] * np.einsum("nij,nkj->nki", turn, found)
    return np.asarray(1000 * np.linalg.norm(fitted - true, axis=2).mean(axis=1))


def trust(root: Array, status: NDArray[np.str_]) -> dict[str, float]:
    """How far the status can be believed, shares of all frames.

    ``wrong_tracking``: off by more than `LOST_MM` while it says ``tracking``; ``weighted_lost``: frames lost,
    those counted twice.
    """
    off = root > LOST_MM
    silent = off & (status == "tracking")
    lost = off | (status == "lost")
    return {"wrong_tracking": float(silent.mean()), "weighted_lost": float((lost + 1.0 * silent).mean())}


def phase_errors(found: Array, true: Array) -> dict[str, float]:
    """Errors of the phase in cycles.

    A frame is flipped when it is nearer to half a cycle away than to the truth: ``flips`` is their share.
    The rest measures what is left after taking the half cycle off: ``median``, ``mean``, ``p90`` of its
    absolute value, ``bias`` its signed mean.
    """
    error = (found - true + 0.5) % 1.0 - 0.5
    flipped = np.abs(error) > 0.25
    error = np.where(flipped, error - np.copysign(0.5, error), error)
    return {**spread(np.abs(error)), "bias": float(error.mean()), "flips": float(flipped.mean())}


def picture_errors(found: Array, true: Array, camera: Camera) -> dict[str, float] | None:
    """Distance in pixels between the projections of EVAL15; None if nothing is before the camera."""
    distance = np.linalg.norm(camera.project(found) - camera.project(true), axis=2)
    seen = np.isfinite(distance)
    frames = seen.any(axis=1)
    if not frames.any():
        return None
    return spread(np.nanmean(np.where(seen, distance, np.nan)[frames], axis=1))


def _span(joints: Joints) -> str:
    return f"{joints.frame[0]}-{joints.frame[-1]}"
