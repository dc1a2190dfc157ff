"""Poses of the default skeleton that lay points fixed to its segments onto observed ones, frame by frame.

Levenberg-Marquardt with a robust loss (Cauchy); what the points do not determine is left to weak priors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import ANGLES
from gait.learn.solve import articulated
from gait.learn.solve.articulated import FREEDOMS, ROOT, Indices, Pose

Floats = npt.NDArray[np.float64]

NOISE = 0.01  # metres: skin over bone and what 24 angles cannot do
ANGLE_SD = 1.5  # radians about the rest pose: only counts for what is not seen
LIMIT_SD = 0.05  # radians beyond a limit that count as one sd
ROOT_SD = 100.0  # metres and radians: hardly anything, but a pelvis that no point ties stays in place
ROUNDS = 30  # at most
CHUNK = 128  # frames solved at once
#: Levenberg-Marquardt: first damping, least, most, and its factors after a step that was better or worse.
DAMPING, LEAST_DAMPING, MOST_DAMPING, BETTER, WORSE = 1e-3, 1e-7, 1e4, 0.2, 10.0
GAIN = 1e-4  # of the loss: a step that gains less is the last
_RANGES = {
    "neck": (-80, 80), "shoulder_flexion": (-120, 190), "shoulder_abduction": (-60, 120),
    "shoulder_rotation": (-120, 120), "elbow": (-5, 160), "hip_flexion": (-60, 140),
    "hip_abduction": (-50, 70), "hip_rotation": (-60, 60), "knee": (-5, 165), "torso": (-60, 90),
    "ankle": (-80, 50),
}  # fmt: skip
#: Least and largest values (2, 24) of the angles of a living body, radians.
LIMITS = np.radians(
    [[next(r[k] for part, r in _RANGES.items() if part in name) for name in ANGLES] for k in (0, 1)]
)


#: Weights of the segments' points where the whole body is laid onto them: limbs move, the trunk hardly.
TRUNK = np.array([1.0 if name in ("pelvis", "torso") else 0.05 for name in articulated.SEGMENTS])


@dataclass
class Data:
    """Observed points (T, M, 3), 0 where missing, their weights (T, M), and segments (M,)."""

    observed: Floats
    weight: Floats
    segment: Indices

    def __getitem__(self, frames: Indices) -> Data:
        return Data(self.observed[frames], self.weight[frames], self.segment)


def at_rest(frames: int) -> Pose:
    """Make poses with the pelvis at the origin and all angles zero."""
    return Pose(np.zeros((frames, 3)), np.tile(np.eye(3), (frames, 1, 1)), np.zeros((frames, len(ANGLES))))


def rooted(pose: Pose, local: Floats, offsets: Floats, data: Data) -> tuple[Pose, Floats]:
    """Turn and move bodies of given angles onto the points, trunk first; the ratios of their sizes (T,)."""
    still = at_rest(len(pose))
    still.angles = pose.angles
    model = articulated.posed(still, offsets).points(local, data.segment)
    w = (data.weight * TRUNK[data.segment])[..., None] + 1e-12 * data.weight[..., None]
    total = np.maximum(w.sum(axis=1), 1e-30)
    middle, goal = (w * model).sum(axis=1) / total, (w * data.observed).sum(axis=1) / total
    a, b = (model - middle[:, None]) * np.sqrt(w), (data.observed - goal[:, None]) * np.sqrt(w)
    u, s, vt = np.linalg.svd(np.swapaxes(b, 1, 2) @ a)
    side = np.sign(np.linalg.det(u @ vt))  # a rotation, not a mirror image
    s[:, 2] *= side
    u[:, :, 2] *= side[:, None]
    turn = u @ vt
    ratio = s.sum(axis=1) / np.maximum((a**2).sum(axis=(1, 2)), 1e-30)
    place = goal - np.einsum("tij,tj->ti", turn, middle)
    return Pose(place, turn, pose.angles.copy()), ratio


def _beyond(angles: Floats) -> Floats:
    """How far angles are beyond the limits, radians."""
    return np.asarray(angles - np.clip(angles, *LIMITS))


def residuals(world: Floats, data: Data, outlier: float) -> tuple[Floats, Floats, Floats]:
    """Residuals (T, M, 3) in units of NOISE, robust weights (T, M) and loss (T,)."""
    residual = (world - data.observed) / NOISE
    square = (residual**2).sum(axis=2) / outlier**2
    return residual, data.weight / (1 + square), (data.weight * outlier**2 * np.log1p(square)).sum(axis=1)


def prior_loss(angles: Floats) -> Floats:
    """Loss (T,) of the priors on the angles."""
    return ((angles / ANGLE_SD) ** 2 + (_beyond(angles) / LIMIT_SD) ** 2).sum(axis=1)


def add_prior(hessian: Floats, gradient: Floats, angles: Floats) -> None:
    """Add the priors to the normal equations of the poses, in place."""
    beyond, k = _beyond(angles), np.arange(ROOT, FREEDOMS)
    hessian[:, k, k] += ANGLE_SD**-2 + (beyond != 0) * LIMIT_SD**-2
    gradient[:, k] += angles / ANGLE_SD**2 + beyond / LIMIT_SD**2
    hessian[:, range(ROOT), range(ROOT)] += ROOT_SD**-2


def normal_equations(
    pose: Pose, local: Floats, offsets: Floats, data: Data, outlier: float
) -> tuple[Floats, Floats]:
    """Gauss-Newton matrices (T, 30, 30) and gradients (T, 30) of the poses."""
    body = articulated.posed(pose, offsets)
    world = body.points(local, data.segment)
    residual, weight, _ = residuals(world, data, outlier)
    slope = rows(body.by_pose(world, data.segment) / NOISE)
    weighted = np.swapaxes(slope * np.repeat(weight, 3, axis=1)[..., None], 1, 2)
    hessian, gradient = weighted @ slope, (weighted @ rows(residual[..., None]))[..., 0]
    add_prior(hessian, gradient, pose.angles)
    return hessian, gradient


def rows(table: Floats) -> Floats:
    """Join the axes of points and of x, y, z: (T, M, 3, n) to (T, 3 M, n)."""
    return table.reshape(len(table), -1, table.shape[-1])


def solve(data: Data, local: Floats, offsets: Floats, start: Pose, outlier: float) -> tuple[Pose, Floats]:
    """Find the poses of all frames from a start; poses and losses (T,)."""

    def loss(pose: Pose, some: Data) -> Floats:
        world = articulated.posed(pose, offsets).points(local, data.segment)
        return residuals(world, some, outlier)[2] + prior_loss(pose.angles)

    pose, cost = start[:], np.empty(len(start))
    for first in range(0, len(start), CHUNK):
        chunk = np.arange(first, min(first + CHUNK, len(start)))
        pose[chunk], cost[chunk] = _descend(
            pose[chunk],
            data[chunk],
            lambda p, d: normal_equations(p, local, offsets, d, outlier),
            loss,
        )
    return pose, cost


def _descend(
    pose: Pose,
    data: Data,
    normal: Callable[[Pose, Data], tuple[Floats, Floats]],
    loss: Callable[[Pose, Data], Floats],
) -> tuple[Pose, Floats]:
    """Levenberg-Marquardt on frames that do not depend on each other, each with its own damping."""
    cost, damping = loss(pose, data), np.full(len(pose), DAMPING)
    active = np.arange(len(pose))
    for _ in range(ROUNDS):
        hessian, gradient = normal(pose[active], data[active])
        diagonal = np.einsum("tii->ti", hessian)
        diagonal *= 1 + damping[active, None]
        step = -np.asarray(np.linalg.solve(hessian, gradient[..., None])[..., 0], float)
        moved = pose[active].moved(step)
        tried = loss(moved, data[active])
        better = np.asarray(tried < cost[active])
        gain = (cost[active] - tried) / np.maximum(cost[active], 1e-9)
        won = active[better]
        pose[won], cost[won] = moved[np.flatnonzero(better)], tried[better]
        damping[active] = np.maximum(damping[active] * np.where(better, BETTER, WORSE), LEAST_DAMPING)
        active = active[(better & (gain > GAIN)) | (~better & (damping[active] < MOST_DAMPING))]
        if not len(active):
            break
    return pose, cost
