"""What knowing nothing of the images would reach: a standing mean pose, and a mean cycle running free."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.body import skeleton
from gait.body.skeleton import EVAL15
from gait.io.blob import unpack_names
from gait.io.track_file import Joints
from gait.motion.events import STRIDE, Strikes, walking_direction

Array = NDArray[np.float64]

_HIPS = [EVAL15.index("l_hip"), EVAL15.index("r_hip")]
_PHASES = np.arange(64) / 64
_BONES = [(f"{s}_{a}", f"{s}_{b}") for s in "lr" for a, b in (("hip", "knee"), ("knee", "ankle"))]
_BONES += [(f"{s}_{a}", f"{s}_{b}") for s in "lr" for a, b in (("shoulder", "elbow"), ("elbow", "wrist"))]


def static_pose(model: dict[str, Any], truth: Joints) -> Array:
    """Mean pose of the model at the true hip midpoint and walking direction, EVAL15 (n, 15, 3).

    Parameters
    ----------
    model : dict
        Sections of the blob.
    truth : Joints
        Gives place, direction and the stature that fits its limbs.
    """
    joints = _poses(model, _PHASES, stature(model, truth)).mean(axis=0)
    joints -= joints[_HIPS].mean(axis=0)
    turned = np.einsum("nij,pj->npi", _turns(truth), joints)
    return np.asarray(turned + _hip_midpoint(truth)[:, None])


def free_run(model: dict[str, Any], truth: Joints, strikes: Strikes, first: int) -> Array | None:
    """Mean cycle running on from the true state at row `first` of the truth, EVAL15 (n, 15, 3).

    Place, direction, phase and stride rate are the truth's at that row, then nothing is looked at.
    None if the phase is unknown.
    """
    cycles = strikes.cycles(np.append(truth.frame[first], truth.frame[first] + 1))
    if cycles is None:
        return None
    advance = (truth.frame - truth.frame[first]) * (cycles[1] - cycles[0])
    size = stature(model, truth)
    stride = (truth.time[-1] - truth.time[0]) / (advance[-1] - advance[0])
    joints = _poses(model, cycles[0] + advance, size, 1 / stride)
    joints += size * root_path(model, cycles[0] + advance, 1 / stride)[:, None]
    joints = np.einsum("ij,npj->npi", _turns(truth, stride)[first], joints)
    return np.asarray(joints - joints[first, _HIPS].mean(axis=0) + _hip_midpoint(truth)[first])


def stature(model: dict[str, Any], truth: Joints) -> float:
    """Stature in metres at which the model's limbs are as long together as the truth's."""
    joints = dict(zip(EVAL15, np.moveaxis(_poses(model, _PHASES[:1], 1.0), 1, 0), strict=True))
    lengths = [
        sum(float(np.median(np.linalg.norm(at[a] - at[b], axis=1))) for a, b in _BONES)
        for at in (truth.places, joints)
    ]
    return lengths[0] / lengths[1]


def _poses(model: dict[str, Any], phase: Array, size: float, rate: float = 0.0) -> Array:
    """EVAL15 (n, 15, 3) of the mean cycle heading along x with the pelvis at the origin."""
    joints, _ = skeleton.pose(model, phase, np.zeros(0), size, 0.0, 0.0, 0.0, np.zeros(3), stride_hz=rate)
    names = unpack_names(model["PTNM"])
    return joints[:, [names.index(name) for name in EVAL15]]


def root_path(model: dict[str, Any], cycles: Array, rate: float = 0.0) -> Array:
    """Pelvis (n, 3) of the mean cycle in statures against phase in strides, wherever it began.

    rate : strides per second, which the mean cycle follows; 0: the mean rate.
    """
    names = unpack_names(model["CHNM"])
    columns = [names.index(f"root_{name}") for name in ("forward", "sway", "height")]
    fine = np.linspace(cycles.min(), cycles.max(), 64 * int(np.ptp(cycles) + 2))
    speed, sway, height = skeleton.curves(model, fine, np.zeros((len(fine), 0)), rate)[:, columns].T
    steps = np.diff(fine) * 0.5 * (speed[1:] + speed[:-1])
    forward = np.concatenate([[0.0], np.cumsum(steps)])
    return np.stack([np.interp(cycles, fine, path) for path in (forward, sway, height)], axis=1)


def _turns(truth: Joints, stride: float = STRIDE) -> Array:
    """Rotations (n, 3, 3) from x forward, y left, z up to the world."""
    forward = walking_direction(truth, stride)
    up = np.broadcast_to([0.0, 0.0, 1.0], forward.shape)
    return np.stack([forward, np.cross(up, forward), up], axis=2)


def _hip_midpoint(truth: Joints) -> Array:
    return 0.5 * (truth.places["l_hip"] + truth.places["r_hip"])
