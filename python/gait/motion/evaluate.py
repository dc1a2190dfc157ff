"""Errors of a track against the truth: joints, phase, picture, intervals, and two baselines without images.

The baselines are a standing mean pose, and a mean cycle that continues from the true start.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, ndtr

from gait.body import skeleton
from gait.body.model_curves import curves
from gait.body.skeleton import EVAL15
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.blob import unpack_names
from gait.io.track_file import STATUSES, Joints, Track
from gait.motion.footfalls import ASSUMED_STRIDE_S, Strikes, walking_direction

Array = NDArray[np.float64]

HIP_COLUMNS = [EVAL15.index("l_hip"), EVAL15.index("r_hip")]
_PHASES = np.arange(64) / 64
_BONES = [(f"{s}_{a}", f"{s}_{b}") for s in "lr" for a, b in (("hip", "knee"), ("knee", "ankle"))]
_BONES += [(f"{s}_{a}", f"{s}_{b}") for s in "lr" for a, b in (("shoulder", "elbow"), ("elbow", "wrist"))]


def static_pose(model: dict[str, Any], truth: Joints, names: Sequence[str] = EVAL15) -> Array:
    """Mean pose of the model at the true hip midpoint and walking direction, joints `names` (n, P, 3).

    `model`: sections of the blob; `truth`: provides position, direction and a stature that fits its limbs;
    `names`: P joints, beginning with those of EVAL15.
    """
    joints = _poses(model, _PHASES, stature(model, truth), names=names).mean(axis=0)
    joints -= joints[HIP_COLUMNS].mean(axis=0)
    turned = np.einsum("nij,pj->npi", body_axes(truth), joints)
    return np.asarray(turned + _hip_midpoint(truth)[:, None])


def free_run(
    model: dict[str, Any], truth: Joints, strikes: Strikes, first: int, names: Sequence[str] = EVAL15
) -> Array | None:
    """Mean cycle that continues from the true state at row `first` of the truth, joints `names` (n, P, 3).

    Position, direction, phase and stride rate are the truth's at that row; later rows are not used.
    None if the phase is unknown.
    """
    cycles = strikes.cycles(np.append(truth.frame[first], truth.frame[first] + 1))
    if cycles is None or np.isnan(cycles).any():
        return None
    advance = (truth.frame - truth.frame[first]) * (cycles[1] - cycles[0])
    size = stature(model, truth)
    stride = (truth.time[-1] - truth.time[0]) / (advance[-1] - advance[0])
    joints = _poses(model, cycles[0] + advance, size, 1 / stride, names)
    joints += size * root_path(model, cycles[0] + advance, 1 / stride)[:, None]
    joints = np.einsum("ij,npj->npi", body_axes(truth, stride)[first], joints)
    return np.asarray(joints - joints[first, HIP_COLUMNS].mean(axis=0) + _hip_midpoint(truth)[first])


def stature(model: dict[str, Any], truth: Joints) -> float:
    """Stature in metres at which the model's limbs have the same total length as the truth's."""
    joints = dict(zip(EVAL15, np.moveaxis(_poses(model, _PHASES[:1], 1.0), 1, 0), strict=True))
    lengths = [
        sum(float(np.median(np.linalg.norm(at[a] - at[b], axis=1))) for a, b in _BONES)
        for at in (truth.places, joints)
    ]
    return lengths[0] / lengths[1]


def _poses(
    model: dict[str, Any], phase: Array, size: float, rate: float = 0.0, names: Sequence[str] = EVAL15
) -> Array:
    """Joints `names` (n, P, 3) of the mean cycle, heading along x, with the pelvis at the origin."""
    joints, _ = skeleton.pose(model, phase, np.zeros(0), size, 0.0, 0.0, 0.0, np.zeros(3), stride_hz=rate)
    known = unpack_names(model["PTNM"])
    return joints[:, [known.index(name) for name in names]]


def root_path(model: dict[str, Any], cycles: Array, rate: float = 0.0) -> Array:
    """Pelvis (n, 3) of the mean cycle, in statures, at phases in strides; the origin is arbitrary.

    rate : strides per second, on which the mean cycle depends; 0: the average rate.
    """
    names = unpack_names(model["CHNM"])
    columns = [names.index(f"root_{name}") for name in ("forward", "sway", "height")]
    fine = np.linspace(cycles.min(), cycles.max(), 64 * int(np.ptp(cycles) + 2))
    speed, sway, height = curves(model, fine, np.zeros((len(fine), 0)), rate)[:, columns].T
    steps = np.diff(fine) * 0.5 * (speed[1:] + speed[:-1])
    forward = np.concatenate([[0.0], np.cumsum(steps)])
    return np.stack([np.interp(cycles, fine, path) for path in (forward, sway, height)], axis=1)


def body_axes(truth: Joints, stride: float = ASSUMED_STRIDE_S) -> Array:
    """Return rotations (n, 3, 3) from body axes (x forward, y left, z up) to the world."""
    forward = walking_direction(truth, stride)
    up = np.broadcast_to([0.0, 0.0, 1.0], forward.shape)
    return np.stack([forward, np.cross(up, forward), up], axis=2)


def _hip_midpoint(truth: Joints) -> Array:
    return 0.5 * (truth.places["l_hip"] + truth.places["r_hip"])


INDEPENDENT_FRAMES = 15  # frames after which errors count as independent
_BINS = 10
_HALF = {"50": 0.6744898, "90": 1.6448536}  # half-widths of normal intervals, standard deviations
_TINY = 1e-9  # metres; smallest standard deviation


def coverage(found: Array, sd: Array, true: Array) -> dict[str, float]:
    """Share of the coordinates within the normal 50 % and 90 % intervals.

    `found`, `sd`, `true`: estimate, its standard deviation, truth.
    """
    off = np.abs(found - true)
    return {level: float((off <= half * sd).mean()) for level, half in _HALF.items()}


def calibration(found: Array, sd: Array, true: Array) -> dict[str, Any]:
    """Measure how well standard deviations describe the errors, beyond the coverage of intervals.

    `found`, `sd`, `true` (n, 15, 3): EVAL15 in metres, for consecutive frames. Returns ``pit``: shares of 10
    equal bins of the probability integral transform over frames `INDEPENDENT_FRAMES` apart, ``pit_chi2``
    their chi-square statistic against a flat distribution and ``pit_p`` its p-value as if coordinates
    were independent (they are not, so use it only for ranking); ``z2``: mean squared error in variances,
    1 if the standard deviations are right; ``crps_mm``: continuous ranked probability score of a normal
    distribution (Gneiting and Raftery 2007), lower is better; ``width_mm``: mean width of the 90 %
    intervals.
    """
    z = (true - found) / np.maximum(sd, _TINY)
    counts, _ = np.histogram(ndtr(z[::INDEPENDENT_FRAMES]), _BINS, (0.0, 1.0))
    chi2 = float(np.sum((counts - counts.mean()) ** 2) / counts.mean())  # against equal bins
    return {
        "pit": (counts / counts.sum()).tolist(),
        "pit_chi2": chi2,
        "pit_p": float(chdtrc(len(counts) - 1, chi2)),
        "z2": float(np.mean(z**2)),
        "crps_mm": 1000 * float(crps(z, sd).mean()),
        "width_mm": 1000 * float(2 * _HALF["90"] * sd.mean()),
    }


def crps(z: Array, sd: Array) -> Array:
    """Continuous ranked probability score of normals of standard deviation `sd`, for errors `z` * `sd`."""
    density = np.exp(-0.5 * z**2) / np.sqrt(2 * np.pi)
    return np.asarray(sd * (z * (2 * ndtr(z) - 1) + 2 * density - 1 / np.sqrt(np.pi)))


Measures = dict[str, Any]

LOST_MM = 150.0
BODY_COLUMNS = [i for i, name in enumerate(EVAL15) if name != "pelvis"]
LIMB_COLUMNS = [i for i, name in enumerate(EVAL15) if name not in ("pelvis", "neck", "head_top")]


def evaluate(
    track: Track,
    truth: Joints,
    *,
    strikes: Strikes,
    model: dict[str, Any],
    camera: Camera | None = None,
    phase: Array | None = None,
) -> Measures:
    """Compare the frames that a track and the truth have in common.

    `strikes`: heel strikes of the truth; `model`: sections of the model blob, for the baselines; `camera`:
    for distances in the picture; `phase`: true phase (n,) of each frame of the truth, as from
    `read_true_phase`, if it is not to be taken from the strikes. Returns ``frames``; ``abs``, ``root`` (mm)
    and ``px``, each as ``median``, ``mean``, ``p90``; ``lost`` (share); ``phase`` (cycles; see
    `phase_errors`); ``coverage`` (share) of the ``50`` and ``90`` % intervals; ``static`` and ``free``: the
    baselines; ``root12``: like ``root``, over shoulders, elbows, wrists, hips, knees and ankles, the joints
    that 2-D pose networks have; ``proc``: after the best rotation, scale and shift of each frame, only for
    comparison with the literature; ``status``, ``trust`` (see `trust`); ``calibration`` (see `calibration`).
    ``phase`` is None if no frame has both a true and an estimated one, ``px`` if the camera is unknown.
    UserError if they have no frame in common.
    """
    common, ours, theirs = np.intersect1d(track.frame, truth.frame, return_indices=True)
    if len(common) == 0:
        raise UserError(f"track: frames {_span(track)} and the truth's {_span(truth)} have none in common")
    found, true = track.eval15()[ours], truth.eval15()[theirs]
    status = np.array(track.status)[ours]
    given_up = status == "lost"
    true_phase = strikes.phase(common) if phase is None else phase[theirs]
    still = static_pose(model, truth)[theirs]
    free = free_run(model, truth, strikes, first=int(theirs[0]))
    return {
        "frames": len(common),
        **pose_errors(found, true, given_up),
        "phase": None if true_phase is None else phase_errors(track.phase[ours], true_phase),
        "px": None if camera is None else picture_errors(found, true, camera),
        "coverage": coverage(found, track.eval15_sd()[ours], true),
        "static": pose_errors(still, true),
        "free": None if free is None else pose_errors(free[theirs], true),
        "root12": summary(root_errors(found, true, LIMB_COLUMNS)),
        "proc": summary(procrustes_errors(found, true)),
        "status": {word: float((status == word).mean()) for word in STATUSES},
        "trust": trust(root_errors(found, true), status),
        "calibration": calibration(found, track.eval15_sd()[ours], true),
    }


def summary(values: Array) -> dict[str, float]:
    """Median, mean and 90th percentile over frames."""
    return {
        "median": float(np.median(values)),
        "mean": float(np.mean(values)),
        "p90": float(np.percentile(values, 90)),
    }


def pose_errors(found: Array, true: Array, given_up: NDArray[np.bool_] | None = None) -> Measures:
    """Compute ``abs`` and ``root`` in mm and the share ``lost``, for EVAL15 (n, 15, 3) in metres."""
    absolute = 1000 * np.linalg.norm(found - true, axis=2).mean(axis=1)
    root = root_errors(found, true)
    lost = root > LOST_MM if given_up is None else (root > LOST_MM) | given_up
    return {"abs": summary(absolute), "root": summary(root), "lost": float(lost.mean())}


def root_errors(found: Array, true: Array, joints: list[int] = BODY_COLUMNS) -> Array:
    """Mean distance (n,) in mm of `joints` (by default all but the pelvis), after aligning hip midpoints."""
    found = found - found[:, HIP_COLUMNS].mean(axis=1, keepdims=True)
    true = true - true[:, HIP_COLUMNS].mean(axis=1, keepdims=True)
    return np.asarray(1000 * np.linalg.norm(found - true, axis=2)[:, joints].mean(axis=1))


def procrustes_errors(found: Array, true: Array) -> Array:
    """Mean distance (n,) in mm of EVAL15, after a least-squares similarity in each frame (Umeyama 1991)."""
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
    """Measure how far the status can be trusted, as shares of all frames.

    ``wrong_tracking``: frames more than `LOST_MM` off with status ``tracking``; ``weighted_lost``: frames
    that far off or with status ``lost``, counting those wrongly ``tracking`` twice.
    """
    off = root > LOST_MM
    silent = off & (status == "tracking")
    lost = off | (status == "lost")
    return {"wrong_tracking": float(silent.mean()), "weighted_lost": float((lost + 1.0 * silent).mean())}


def phase_errors(found: Array, true: Array) -> dict[str, float] | None:
    """Errors of the phase in cycles; None if no frame counts.

    A frame is flipped if its phase is nearer to half a cycle from the truth than to the truth: ``flips`` is
    the share of such frames.  The other figures are without that half cycle: ``median``, ``mean`` and ``p90``
    of the absolute error, and ``bias``, the mean error.  Frames count that have a phase both in the track
    and in the truth, where it exists only within a gait cycle (`Strikes.cycles`), not in a stand.
    """
    known = np.isfinite(found) & np.isfinite(true)
    if not known.any():
        return None
    error = (found[known] - true[known] + 0.5) % 1.0 - 0.5
    flipped = np.abs(error) > 0.25
    error = np.where(flipped, error - np.copysign(0.5, error), error)
    return {**summary(np.abs(error)), "bias": float(error.mean()), "flips": float(flipped.mean())}


def picture_errors(found: Array, true: Array, camera: Camera) -> dict[str, float] | None:
    """Distance in pixels between the projections of EVAL15; None if nothing is in front of the camera."""
    distance = np.linalg.norm(camera.project(found) - camera.project(true), axis=2)
    visible = np.isfinite(distance)
    frames = visible.any(axis=1)
    if not frames.any():
        return None
    return summary(np.nanmean(np.where(visible, distance, np.nan)[frames], axis=1))


def _span(joints: Joints) -> str:
    return f"{joints.frame[0]}-{joints.frame[-1]}"
