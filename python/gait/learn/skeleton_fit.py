"""Least-squares fit of the default skeleton to points on a body: lengths of the subject, poses of all frames.

The points are attached to segments at places known roughly; they may be markers on the skin or joints.  First
the subject's stretches and the points' true places are found together with the poses of some frames
(Levenberg-Marquardt, the poses eliminated by their Schur complement), then the poses of all frames at once.
The loss is robust (Cauchy).  What the points do not determine is left to weak priors; the covariance says so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.learn import articulated
from gait.learn.articulated import FREEDOMS, ROOT, Indices, Pose
from gait.skeleton import ANGLES

Floats = npt.NDArray[np.float64]

NOISE = 0.01  # metres: skin over bone and what 24 angles cannot do
ANGLE_SD = 1.5  # radians about the rest pose: only counts for what is not seen
STATURE = 1.7  # metres
SIZES = (0.5, 2.5)  # metres of stature to start from
LIMIT_SD = 0.05  # radians beyond a limit that count as one sd
OUTLIERS = (30.0, 10.0, 3.0)  # residuals beyond this many NOISE lose weight: first rounds to last
SUBJECT_FRAMES = 60
EFFECTIVE = 5.0  # frames that these count for: neighbours share their errors
ROUNDS = 30
CHUNK = 128  # frames solved at once
FEWEST = 3  # points seen in a frame that is fitted
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


@dataclass(frozen=True)
class Points:
    """Points fixed to segments.

    Attributes
    ----------
    segment : (M,) indices into `articulated.SEGMENTS`
    at : (M, 3)
        Places in the segments' axes, statures.
    sd : (M,)
        How far they may be from there, statures.
    """

    segment: Indices
    at: Floats
    sd: Floats


@dataclass
class Fit:
    """Result of `fit`.

    Attributes
    ----------
    stretch : (S,)
        Logarithms of the subject's stretches, in the order of `articulated.STRETCHES`.
    local : (M, 3)
        Places of the points in their segments, metres.
    pose : Pose
    residual : (T, M)
        Distance from the points observed, metres; NaN where missing.
    covariance : (T, 30, 30)
        Of the poses, metres and radians.
    """

    stretch: Floats
    local: Floats
    pose: Pose
    residual: Floats
    covariance: Floats


def turned(angles: Floats, points: Points, observed: Floats) -> Floats:
    """Find the turns (T, 3, 3) of the pelvis that lay bodies of given angles (T, 24) onto points.

    `observed` is as for `fit`; turns are NaN where fewer than three points or not all angles are known.
    """
    seen = np.asarray(np.isfinite(observed).all(axis=2))
    known = (seen.sum(axis=1) >= FEWEST) & np.isfinite(angles).all(axis=1)
    pose = _rest(len(angles))
    pose.angles[known] = angles[known]
    data = _Data(np.where(seen[..., None], observed, 0.0), seen.astype(float), points.segment)
    turn = _rooted(pose, points.at, articulated.ORIGINS, data)[0].turn
    return np.where(known[:, None, None], turn, np.nan)


@dataclass
class _Data:
    """Observed points (T, M, 3), 0 where missing, their weights (T, M), and segments (M,)."""

    observed: Floats
    weight: Floats
    segment: Indices

    def __getitem__(self, frames: Indices) -> _Data:
        return _Data(self.observed[frames], self.weight[frames], self.segment)


def fit(observed: Floats, points: Points, weights: Floats | None = None) -> Fit:
    """Fit subject and poses to points.

    Parameters
    ----------
    observed : (T, M, 3)
        Metres, in any right-handed axes; NaN where missing.
    points : Points
    weights : (M,), optional
        Relative to a residual of `NOISE`; 1 by default.

    Raises
    ------
    ValueError
        If no frame has three points.
    """
    seen = np.asarray(np.isfinite(observed).all(axis=2))
    weight = seen * (np.ones(len(points.at)) if weights is None else weights)
    data = _Data(np.where(seen[..., None], observed, 0.0), weight, points.segment)
    if not (seen.sum(axis=1) >= FEWEST).any():
        raise ValueError("no frame has three points")
    picked = _spread(seen)
    few = data[picked]
    stretch = np.zeros(articulated.STRETCH.shape[2])
    start = _rest(len(picked))
    size = np.median(_rooted(start, points.at, articulated.ORIGINS, few)[1])
    stretch[0] = np.log(np.clip(size, *SIZES))
    local = articulated.scales(stretch)[points.segment] * points.at
    offsets = articulated.origins(stretch)
    pose = solve(few, local, offsets, _rooted(start, local, offsets, few)[0], OUTLIERS[0])[0]
    stretch, local, pose = _subject(few, points, stretch, pose)
    pose = _all_poses(data, local, articulated.origins(stretch), pose, picked)
    return _finished(data, seen, stretch, local, pose)


def _spread(seen: npt.NDArray[np.bool_]) -> Indices:
    """Frames spread over the recording in which many points are seen."""
    count = seen.sum(axis=1)
    good = np.flatnonzero(count >= max(FEWEST, 0.7 * count.max()))
    bins = np.array_split(good, min(SUBJECT_FRAMES, len(good)))
    return np.array([frames[np.argmax(count[frames])] for frames in bins])


def _rest(frames: int) -> Pose:
    return Pose(np.zeros((frames, 3)), np.tile(np.eye(3), (frames, 1, 1)), np.zeros((frames, len(ANGLES))))


TRUNK = np.array([1.0 if name in ("pelvis", "torso") else 0.05 for name in articulated.SEGMENTS])


def _rooted(pose: Pose, local: Floats, offsets: Floats, data: _Data) -> tuple[Pose, Floats]:
    """Turn and move bodies of given angles onto the points, trunk first; the ratios of their sizes (T,)."""
    still = Pose(*(part for part in (np.zeros_like(pose.place), _rest(len(pose)).turn, pose.angles)))
    model = articulated.posed(still, offsets).points(local, data.segment)
    w = (data.weight * TRUNK[data.segment])[..., None] + 1e-12 * data.weight[..., None]
    total = np.maximum(w.sum(axis=1), 1e-30)
    middle, goal = (w * model).sum(axis=1) / total, (w * data.observed).sum(axis=1) / total
    a, b = (model - middle[:, None]) * np.sqrt(w), (data.observed - goal[:, None]) * np.sqrt(w)
    u, s, vt = np.linalg.svd(np.swapaxes(b, 1, 2) @ a)
    s[:, 2] *= np.sign(np.linalg.det(u @ vt))
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
    turn = u @ vt
    ratio = s.sum(axis=1) / np.maximum((a**2).sum(axis=(1, 2)), 1e-30)
    place = goal - np.einsum("tij,tj->ti", turn, middle)
    return Pose(place, turn, pose.angles.copy()), ratio


def _beyond(angles: Floats) -> Floats:
    """How far angles are beyond the limits, radians."""
    return np.asarray(angles - np.clip(angles, *LIMITS))


def _residuals(world: Floats, data: _Data, outlier: float) -> tuple[Floats, Floats, Floats]:
    """Residuals (T, M, 3) in units of NOISE, robust weights (T, M) and loss (T,)."""
    residual = (world - data.observed) / NOISE
    square = (residual**2).sum(axis=2) / outlier**2
    return residual, data.weight / (1 + square), (data.weight * outlier**2 * np.log1p(square)).sum(axis=1)


def _prior(angles: Floats) -> Floats:
    """Loss (T,) of the priors on the angles."""
    return ((angles / ANGLE_SD) ** 2 + (_beyond(angles) / LIMIT_SD) ** 2).sum(axis=1)


def _add_prior(hessian: Floats, gradient: Floats, angles: Floats) -> None:
    """Add the priors to the normal equations of the poses, in place."""
    beyond, k = _beyond(angles), np.arange(ROOT, FREEDOMS)
    hessian[:, k, k] += ANGLE_SD**-2 + (beyond != 0) * LIMIT_SD**-2
    gradient[:, k] += angles / ANGLE_SD**2 + beyond / LIMIT_SD**2
    hessian[:, range(ROOT), range(ROOT)] += 1e-4


def _normal(pose: Pose, local: Floats, offsets: Floats, data: _Data, outlier: float) -> tuple[Floats, Floats]:
    """Gauss-Newton matrices (T, 30, 30) and gradients (T, 30) of the poses."""
    body = articulated.posed(pose, offsets)
    world = body.points(local, data.segment)
    residual, weight, _ = _residuals(world, data, outlier)
    slope = _rows(body.by_pose(world, data.segment) / NOISE)
    weighted = np.swapaxes(slope * np.repeat(weight, 3, axis=1)[..., None], 1, 2)
    hessian, gradient = weighted @ slope, (weighted @ _rows(residual[..., None]))[..., 0]
    _add_prior(hessian, gradient, pose.angles)
    return hessian, gradient


def _rows(table: Floats) -> Floats:
    """Join the axes of points and of x, y, z: (T, M, 3, n) to (T, 3 M, n)."""
    return table.reshape(len(table), -1, table.shape[-1])


def solve(data: _Data, local: Floats, offsets: Floats, start: Pose, outlier: float) -> tuple[Pose, Floats]:
    """Find the poses of all frames from a start; poses and losses (T,)."""

    def loss(pose: Pose, some: _Data) -> Floats:
        world = articulated.posed(pose, offsets).points(local, data.segment)
        return _residuals(world, some, outlier)[2] + _prior(pose.angles)

    pose, cost = start[:], np.empty(len(start))
    for first in range(0, len(start), CHUNK):
        chunk = np.arange(first, min(first + CHUNK, len(start)))
        pose[chunk], cost[chunk] = _descend(
            pose[chunk],
            data[chunk],
            lambda p, d: _normal(p, local, offsets, d, outlier),
            loss,
        )
    return pose, cost


def _descend(
    pose: Pose,
    data: _Data,
    normal: Callable[[Pose, _Data], tuple[Floats, Floats]],
    loss: Callable[[Pose, _Data], Floats],
) -> tuple[Pose, Floats]:
    """Levenberg-Marquardt on frames that do not depend on each other, each with its own damping."""
    cost, damping = loss(pose, data), np.full(len(pose), 1e-3)
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
        damping[active] = np.clip(damping[active] * np.where(better, 0.2, 10.0), 1e-7, 1e7)
        active = active[(better & (gain > 1e-4)) | (~better & (damping[active] < 1e4))]
        if not len(active):
            break
    return pose, cost


def _subject(few: _Data, points: Points, stretch: Floats, pose: Pose) -> tuple[Floats, Floats, Pose]:
    """Stretches (S,), places of the points (M, 3) and poses, together."""
    count, share = len(stretch), len(pose) / EFFECTIVE
    sd = np.concatenate([articulated.STRETCH_SD, np.repeat(points.sd, 3) * STATURE])
    goal = np.zeros(len(sd))
    goal[0] = np.log(STATURE)
    shape = np.concatenate([stretch, np.zeros(3 * len(points.at))])

    def places(shape: Floats) -> Floats:
        scale = articulated.scales(shape[:count])[points.segment]
        return scale * points.at + shape[count:].reshape(-1, 3)

    def loss(shape: Floats, pose: Pose, outlier: float) -> float:
        world = articulated.posed(pose, articulated.origins(shape[:count])).points(places(shape), few.segment)
        data = _residuals(world, few, outlier)[2] + _prior(pose.angles)
        return float(data.sum() + share * (((shape - goal) / sd) ** 2).sum())

    for outlier in OUTLIERS:
        damping, cost = 1e-3, loss(shape, pose, outlier)
        for _ in range(ROUNDS):
            step, steps = _subject_step(
                few, points, shape, places(shape), pose, outlier, damping, (share / sd**2, goal)
            )
            trial, moved = shape + step, pose.moved(steps)
            tried = loss(trial, moved, outlier)
            if tried < cost:
                gain, cost, shape, pose = cost - tried, tried, trial, moved
                damping = max(0.2 * damping, 1e-7)
                if gain < 1e-4 * cost:
                    break
            else:
                damping *= 10
                if damping > 1e4:
                    break
    return shape[:count], places(shape), pose


def _subject_step(
    few: _Data,
    points: Points,
    shape: Floats,
    local: Floats,
    pose: Pose,
    outlier: float,
    damping: float,
    prior: tuple[Floats, Floats],
) -> tuple[Floats, Floats]:
    """Find the steps of the shape (S + 3 M,) and of the poses (K, 30); prior: inverse variances and means."""
    count, marks = articulated.STRETCH.shape[2], len(local)
    body = articulated.posed(pose, articulated.origins(shape[:count]))
    world = body.points(local, few.segment)
    residual, weight, _ = _residuals(world, few, outlier)
    by_pose = _rows(body.by_pose(world, few.segment) / NOISE)
    by_shape = np.zeros((len(pose), marks, 3, count + 3 * marks))
    by_shape[..., :count] = body.by_stretch(shape[:count], points.at, few.segment)
    for m in range(marks):
        by_shape[:, m, :, count + 3 * m : count + 3 * m + 3] = body.turns[:, few.segment[m]]
    by_shape = _rows(by_shape / NOISE)
    rest, heavy = _rows(residual[..., None]), np.repeat(weight, 3, axis=1)[..., None]
    left = np.swapaxes(by_pose * heavy, 1, 2)
    inner, mixed, pose_slope = left @ by_pose, left @ by_shape, left @ rest
    _add_prior(inner, pose_slope[..., 0], pose.angles)
    flat, weighted = by_shape.reshape(-1, len(shape)), (by_shape * heavy).reshape(-1, len(shape))
    outer = weighted.T @ flat + np.diag(prior[0])
    shape_slope = weighted.T @ rest.reshape(-1) + prior[0] * (shape - prior[1])
    np.einsum("tii->ti", inner)[:] *= 1 + damping
    np.einsum("ii->i", outer)[:] *= 1 + damping
    solved = np.linalg.solve(inner, np.concatenate([mixed, pose_slope], axis=2))
    crossed = np.swapaxes(mixed, 1, 2)
    reduced = outer - (crossed @ solved[..., :-1]).sum(axis=0)
    step = -np.linalg.solve(reduced, shape_slope - (crossed @ solved[..., -1:]).sum(axis=0)[:, 0])
    return step, -(solved[..., :-1] @ step + solved[..., -1])


def _all_poses(data: _Data, local: Floats, offsets: Floats, known: Pose, picked: Indices) -> Pose:
    """Poses of all frames, each started from the nearest known one; bad ones again from good neighbours."""
    frames = np.arange(len(data.weight))
    nearest = np.argmin(np.abs(frames[:, None] - picked[None]), axis=1)
    pose, cost = solve(data, local, offsets, _rooted(known[nearest], local, offsets, data)[0], OUTLIERS[-1])
    count = (data.weight > 0).sum(axis=1)
    mean = cost / np.maximum(count, 1)
    good = (mean <= 4 * np.median(mean[count >= FEWEST])) & (count >= FEWEST)
    bad = np.flatnonzero(~good & (count >= FEWEST))
    if good.any() and len(bad):
        closest = np.flatnonzero(good)[np.argmin(np.abs(bad[:, None] - np.flatnonzero(good)[None]), axis=1)]
        start = _rooted(pose[closest], local, offsets, data[bad])[0]
        again, cheaper = solve(data[bad], local, offsets, start, OUTLIERS[-1])
        won = np.flatnonzero(cheaper < cost[bad])
        pose[bad[won]] = again[won]
    return pose


def _finished(data: _Data, seen: npt.NDArray[np.bool_], stretch: Floats, local: Floats, pose: Pose) -> Fit:
    """Add residuals and covariances."""
    offsets = articulated.origins(stretch)
    covariance = np.empty((len(pose), FREEDOMS, FREEDOMS))
    residual = np.empty(seen.shape)
    for first in range(0, len(pose), CHUNK):
        chunk = np.arange(first, min(first + CHUNK, len(pose)))
        world = articulated.posed(pose[chunk], offsets).points(local, data.segment)
        residual[chunk] = np.linalg.norm(world - data.observed[chunk], axis=2)
        covariance[chunk] = np.linalg.inv(_normal(pose[chunk], local, offsets, data[chunk], OUTLIERS[-1])[0])
    return Fit(stretch, local, pose, np.where(seen, residual, np.nan), covariance)
