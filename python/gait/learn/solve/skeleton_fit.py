"""Least-squares fit of the default skeleton to points on a body: lengths of the subject, poses of all frames.

The points are fixed to segments at roughly known positions; they may be skin markers or joints.  First the
subject's length scales and the points' true positions are estimated together with the poses of some frames
(Levenberg-Marquardt, eliminating the poses by the Schur complement), then the poses of all frames.  The loss
is robust (Cauchy).  Weak priors fix what the points do not determine, which the covariance shows.

Recordings of one person are combined through `LengthInformation`, their information about the length scales,
which is additive.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gait.body.skeleton import ANGLES
from gait.learn.arrays import Floats, Indices, Mask
from gait.learn.solve.kinematics import (
    FREEDOMS,
    ORIGINS,
    ROOT,
    SCALE_SD,
    SEGMENTS,
    Pose,
    pose_skeleton,
    segment_origins,
    segment_scales,
)

START_STATURE_M = (0.5, 2.5)  # metres of stature to start from
SUBJECT_FRAMES = 60  # frames from which the subject is estimated
FEWEST_POINTS = 3  # fewest points in a frame that is fitted
#: Share of the largest number of points that frames for estimating the subject must have.
LEAST_VISIBLE_SHARE = 0.7
BAD = 4  # multiple of the median loss per point from which a frame may be in a wrong minimum
SOLVED_AT_ONCE = 128  # frames solved at once
MARKER_SD_M = 0.01  # metres: skin over bone, and motion that 24 angles cannot reproduce
ANGLE_SD = 1.5  # radians about the rest pose; only matters for what the points do not determine
LIMIT_SD = 0.05  # radians beyond a limit that count as one sd
ROOT_SD = 100.0  # metres and radians; fixes a pelvis that no point determines
OUTLIERS = (30.0, 10.0, 3.0)  # residuals beyond this many MARKER_SD_M lose weight, in first to last rounds
EFFECTIVE = 5.0  # number of independent frames that all frames are worth, as neighbours share errors
GENERIC_STATURE_M = 1.7  # metres, of the generic body
#: Levenberg-Marquardt: most rounds, first damping, least, most, and its factors after a better or worse step.
MOST_FIT_STEPS, FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING, DAMPING_DECREASE, DAMPING_INCREASE = (
    30,
    1e-3,
    1e-7,
    1e4,
    0.2,
    10.0,
)
LEAST_FIT_GAIN = 1e-4  # relative gain of the loss; a step that gains less is the last
_RANGES = {
    "neck": (-80, 80), "shoulder_flexion": (-120, 190), "shoulder_abduction": (-60, 120),
    "shoulder_rotation": (-120, 120), "elbow": (-5, 160), "hip_flexion": (-60, 140),
    "hip_abduction": (-50, 70), "hip_rotation": (-60, 60), "knee": (-5, 165), "torso": (-60, 90),
    "ankle": (-80, 50),
}  # fmt: skip
#: Least and largest values (2, 24) of the angles of a living body, radians.
ANGLE_LIMITS = np.radians(
    [[next(r[k] for part, r in _RANGES.items() if part in name) for name in ANGLES] for k in (0, 1)]
)
#: Weights of the segments' points in the rigid alignment, as limbs move relative to the trunk.
ALIGNMENT_WEIGHTS = np.array([1.0 if name in ("pelvis", "torso") else 0.05 for name in SEGMENTS])
SCALE_COUNT = len(SCALE_SD)
_PRIOR_MEAN = np.array(
    [np.log(GENERIC_STATURE_M)] + [0.0] * (SCALE_COUNT - 1)
)  # log length scales of the generic body


@dataclass(frozen=True)
class LengthInformation:
    """Gaussian over log length scales (S,) in information form, in which independent sources add."""

    matrix: Floats  #: (S, S) inverse covariance; singular where nothing is known
    vector: Floats  #: (S,) the matrix times the mean

    def __add__(self, other: LengthInformation) -> LengthInformation:
        return LengthInformation(self.matrix + other.matrix, self.vector + other.vector)

    def mean(self) -> Floats:
        """Return the most probable log length scales (S,)."""
        return np.asarray(np.linalg.solve(self.matrix, self.vector), float)


LENGTHS_OF_PEOPLE = LengthInformation(np.diag(SCALE_SD**-2), SCALE_SD**-2 * _PRIOR_MEAN)  #: people in general
NO_INFORMATION = LengthInformation(np.zeros((SCALE_COUNT, SCALE_COUNT)), np.zeros(SCALE_COUNT))


def log_bayes_factor(one: LengthInformation, other: LengthInformation) -> float:
    """Return the log Bayes factor of one body against two bodies, given two measurements."""
    return _evidence(one + other) + _evidence(NO_INFORMATION) - _evidence(one) - _evidence(other)


def _evidence(found: LengthInformation) -> float:
    """Log probability of measurements of one person, up to a constant of these."""
    known = LENGTHS_OF_PEOPLE + found
    return float(known.vector @ known.mean() - np.linalg.slogdet(known.matrix)[1]) / 2


@dataclass(frozen=True)
class Points:
    """M points fixed to segments."""

    segment: Indices  #: (M,) indices into `kinematics.SEGMENTS`
    at: Floats  #: (M, 3) positions in the segments' axes, statures
    sd: Floats  #: (M,) standard deviations of these positions, statures


@dataclass
class Fit:
    """Result of `fit`: T frames, M points, S length scales."""

    log_scales: Floats  #: (S,) of the subject, in the order of `kinematics.SCALES`
    local: Floats  #: (M, 3) positions of the points in their segments, metres
    pose: Pose
    residual: Floats  #: (T, M) distance from the observed points, metres; NaN where missing
    covariance: Floats  #: (T, 30, 30) of the poses, metres and radians


def fit(observed: Floats, points: Points, log_scales: Floats | None = None) -> Fit:
    """Fit subject and poses to observed points (T, M, 3).

    Points are metres in any right-handed axes, NaN where missing.  If log length scales (S,) are given, they
    are fixed, and only positions of points and poses are estimated.  ValueError if no frame has three points.
    """
    data = _observations(observed, points)
    picked = _frames_with_most(data.weight > 0)
    subject = _fit_subject(data[picked], points, log_scales)
    pose = _fit_all_frames(data, subject, picked)
    return _with_covariance(data, subject, pose)


def length_information(observed: Floats, points: Points) -> tuple[LengthInformation, float]:
    """Return what points show of their subject's length scales, and `usual_rms` of its body, metres.

    Parameters and errors are those of `fit`.
    """
    data = _observations(observed, points)
    few = data[_frames_with_most(data.weight > 0)]
    subject = _fit_subject(few, points, None)
    body = pose_skeleton(subject.pose, segment_origins(subject.log_scales))
    apart = np.linalg.norm(body.points(subject.local, few.segment) - few.observed, axis=2)
    return _information(subject), usual_rms(np.where(few.weight > 0, apart, np.nan))


def usual_rms(residual: Floats) -> float:
    """Return the median over frames of the rms distance of their points (T, M), metres; NaN without any.

    A few frames with wrong points therefore have no influence.
    """
    squares, count = np.nansum(residual**2, axis=1), np.isfinite(residual).sum(axis=1)
    known = count > 0
    return float(np.median(np.sqrt(squares[known] / count[known]))) if known.any() else float("nan")


def pelvis_rotations(angles: Floats, points: Points, observed: Floats) -> Floats:
    """Return the pelvis rotations (T, 3, 3) that align bodies with given angles (T, 24) with points.

    `observed` is as for `fit`; NaN where fewer than three points or not all angles are known.
    """
    data = _observations(observed, points)
    known = (data.weight.sum(axis=1) >= FEWEST_POINTS) & np.isfinite(angles).all(axis=1)
    pose = _at_rest(len(angles))
    pose.angles[known] = angles[known]
    rotation = _aligned(pose, points.at, ORIGINS, data)[0].rotation
    return np.where(known[:, None, None], rotation, np.nan)


def has_enough(observed: Floats) -> bool:
    """Whether any frame has enough points (T, M, 3) to be fitted."""
    return bool((np.isfinite(observed).all(axis=2).sum(axis=1) >= FEWEST_POINTS).any())


@dataclass
class _Observations:
    observed: Floats  # (T, M, 3), 0 where missing
    weight: Floats  # (T, M)
    segment: Indices  # (M,)

    def __getitem__(self, frames: Indices) -> _Observations:
        return _Observations(self.observed[frames], self.weight[frames], self.segment)


def _observations(observed: Floats, points: Points) -> _Observations:
    visible = np.asarray(np.isfinite(observed).all(axis=2))
    return _Observations(np.where(visible[..., None], observed, 0.0), visible.astype(float), points.segment)


@dataclass(frozen=True)
class _Subject:
    """Some frames of a subject, with its shape and its poses in them."""

    data: _Observations
    points: Points
    shape: Floats  # (S + 3 M,) log length scales, then shifts of points from expected positions, metres
    pose: Pose

    @property
    def log_scales(self) -> Floats:
        return self.shape[:SCALE_COUNT]

    @property
    def share(self) -> float:
        """Weight of the errors of these frames."""
        return len(self.data.weight) / EFFECTIVE

    @property
    def local(self) -> Floats:
        """Positions (M, 3) of the points in their segments, metres."""
        scale = segment_scales(self.log_scales)[self.points.segment]
        return scale * self.points.at + self.shape[SCALE_COUNT:].reshape(-1, 3)

    def prior(self) -> tuple[Floats, Floats]:
        """Means and standard deviations of the shape."""
        mean = np.concatenate([_PRIOR_MEAN, np.zeros(self.points.at.size)])
        return mean, np.concatenate([SCALE_SD, np.repeat(self.points.sd, 3) * GENERIC_STATURE_M])


def _frames_with_most(visible: Mask) -> Indices:
    """Pick frames spread over the recording in which many points are seen."""
    count = visible.sum(axis=1)
    if not (count >= FEWEST_POINTS).any():
        raise ValueError("no frame has three points")
    good = np.flatnonzero(count >= max(FEWEST_POINTS, LEAST_VISIBLE_SHARE * count.max()))
    bins = np.array_split(good, min(SUBJECT_FRAMES, len(good)))
    return np.array([frames[np.argmax(count[frames])] for frames in bins])


def _fit_subject(few: _Observations, points: Points, known: Floats | None) -> _Subject:
    """Estimate a subject from some frames: first its size, then poses, then everything together."""
    start = _at_rest(len(few.weight))
    if known is None:
        size = np.median(_aligned(start, points.at, ORIGINS, few)[1])
        log_scales = np.zeros(SCALE_COUNT)
        log_scales[0] = np.log(np.clip(size, *START_STATURE_M))
    else:
        log_scales = known
    local = segment_scales(log_scales)[points.segment] * points.at
    origins = segment_origins(log_scales)
    aligned = _aligned(start, local, origins, few)[0]
    pose = _fit_poses(few, local, origins, aligned, OUTLIERS[0])[0]
    shape = np.concatenate([log_scales, np.zeros(points.at.size)])
    return _refine(_Subject(few, points, shape, pose), fixed=known is not None)


def _refine(start: _Subject, fixed: bool) -> _Subject:
    """Optimise shape and poses together from a start; `fixed` log scales are not changed."""
    mean, sd = start.prior()
    weight, free = start.share / sd**2, slice(SCALE_COUNT if fixed else 0, None)

    def objective(s: _Subject, outlier: float) -> float:
        body = pose_skeleton(s.pose, segment_origins(s.log_scales))
        world = body.points(s.local, s.data.segment)
        data = _residuals(world, s.data, outlier)[2] + _prior_cost(s.pose.angles)
        return float(data.sum() + s.share * (((s.shape - mean) / sd) ** 2).sum())

    subject = start
    for outlier in OUTLIERS:
        damping, cost = FIRST_DAMPING, objective(subject, outlier)
        for _ in range(MOST_FIT_STEPS):
            matrix, slope, solved = _reduced(subject, outlier, damping, (weight, mean))
            step = np.zeros(len(slope))
            step[free] = -np.linalg.solve(matrix[free, free], slope[free])
            steps = -(solved[..., :-1] @ step + solved[..., -1])
            trial = replace(subject, shape=subject.shape + step, pose=subject.pose.moved(steps))
            tried = objective(trial, outlier)
            if tried < cost:
                gain, cost, subject = cost - tried, tried, trial
                damping = max(DAMPING_DECREASE * damping, LEAST_DAMPING)
                if gain < LEAST_FIT_GAIN * cost:
                    break
            else:
                damping *= DAMPING_INCREASE
                if damping > MOST_DAMPING:
                    break
    return subject


def _information(subject: _Subject) -> LengthInformation:
    """Return the frames' information about the length scales, with points and poses marginalised out.

    It is a quadratic approximation at the subject found (Gauss-Newton).
    """
    mean, sd = subject.prior()
    share = subject.share
    weight = share / sd**2
    weight[:SCALE_COUNT] = 0  # the prior is not an observation
    matrix, slope, _ = _reduced(subject, OUTLIERS[-1], 0.0, (weight, mean))
    solved = np.linalg.solve(
        matrix[SCALE_COUNT:, SCALE_COUNT:], np.c_[matrix[SCALE_COUNT:, :SCALE_COUNT], slope[SCALE_COUNT:]]
    )
    across = matrix[:SCALE_COUNT, SCALE_COUNT:]
    found = (matrix[:SCALE_COUNT, :SCALE_COUNT] - across @ solved[:, :-1]) / share
    left = (slope[:SCALE_COUNT] - across @ solved[:, -1]) / share
    found = (found + found.T) / 2
    return LengthInformation(found, found @ subject.log_scales - left)


def _reduced(
    s: _Subject, outlier: float, damping: float, prior: tuple[Floats, Floats]
) -> tuple[Floats, Floats, Floats]:
    """Set up the normal equations of the shape about a subject, with poses eliminated.

    `prior`: inverse variances and means of the shape.  Returns the matrix (S + 3 M, S + 3 M), the slope, and
    an array (K, 30, S + 3 M + 1) from which the steps of the poses follow.
    """
    few, pose = s.data, s.pose
    body = pose_skeleton(pose, segment_origins(s.log_scales))
    world = body.points(s.local, few.segment)
    residual, weight, _ = _residuals(world, few, outlier)
    by_pose = _rows(body.by_pose(world, few.segment) / MARKER_SD_M)
    by_shape = np.zeros((*world.shape, len(s.shape)))
    by_shape[..., :SCALE_COUNT] = body.by_scales(s.log_scales, s.points.at, few.segment)
    for m, segment in enumerate(few.segment):
        first = SCALE_COUNT + 3 * m
        by_shape[:, m, :, first : first + 3] = body.rotations[:, segment]
    by_shape = _rows(by_shape / MARKER_SD_M)
    rest, heavy = _rows(residual[..., None]), np.repeat(weight, 3, axis=1)[..., None]
    left = np.swapaxes(by_pose * heavy, 1, 2)
    inner, mixed, pose_slope = left @ by_pose, left @ by_shape, left @ rest
    _add_prior(inner, pose_slope[..., 0], pose.angles)
    flat, weighted = by_shape.reshape(-1, len(s.shape)), (by_shape * heavy).reshape(-1, len(s.shape))
    outer = weighted.T @ flat + np.diag(prior[0])
    shape_slope = weighted.T @ rest.reshape(-1) + prior[0] * (s.shape - prior[1])
    np.einsum("tii->ti", inner)[:] *= 1 + damping
    np.einsum("ii->i", outer)[:] *= 1 + damping
    solved = np.linalg.solve(inner, np.concatenate([mixed, pose_slope], axis=2))
    crossed = np.swapaxes(mixed, 1, 2)
    return (
        outer - (crossed @ solved[..., :-1]).sum(axis=0),
        shape_slope - (crossed @ solved[..., -1:]).sum(axis=0)[:, 0],
        solved,
    )


def _fit_all_frames(data: _Observations, subject: _Subject, picked: Indices) -> Pose:
    """Fit all frames, each from the nearest picked one, and bad ones again from good neighbours."""
    local, origins = subject.local, segment_origins(subject.log_scales)
    frames = np.arange(len(data.weight))
    nearest = np.argmin(np.abs(frames[:, None] - picked[None]), axis=1)
    start = _aligned(subject.pose[nearest], local, origins, data)[0]
    pose, cost = _fit_poses(data, local, origins, start, OUTLIERS[-1])
    count = (data.weight > 0).sum(axis=1)
    mean = cost / np.maximum(count, 1)
    good = (mean <= BAD * np.median(mean[count >= FEWEST_POINTS])) & (count >= FEWEST_POINTS)
    bad = np.flatnonzero(~good & (count >= FEWEST_POINTS))
    if good.any() and len(bad):
        closest = np.flatnonzero(good)[np.argmin(np.abs(bad[:, None] - np.flatnonzero(good)[None]), axis=1)]
        start = _aligned(pose[closest], local, origins, data[bad])[0]
        again, cheaper = _fit_poses(data[bad], local, origins, start, OUTLIERS[-1])
        won = np.flatnonzero(cheaper < cost[bad])
        pose[bad[won]] = again[won]
    return pose


def _with_covariance(data: _Observations, subject: _Subject, pose: Pose) -> Fit:
    """Add residuals and covariances."""
    local, origins = subject.local, segment_origins(subject.log_scales)
    covariance = np.empty((len(pose), FREEDOMS, FREEDOMS))
    residual = np.empty(data.weight.shape)
    for first in range(0, len(pose), SOLVED_AT_ONCE):
        chunk = np.arange(first, min(first + SOLVED_AT_ONCE, len(pose)))
        world = pose_skeleton(pose[chunk], origins).points(local, data.segment)
        residual[chunk] = np.linalg.norm(world - data.observed[chunk], axis=2)
        hessian = _normal_equations(pose[chunk], local, origins, data[chunk], OUTLIERS[-1])[0]
        covariance[chunk] = np.linalg.inv(hessian)
    return Fit(subject.log_scales, local, pose, np.where(data.weight > 0, residual, np.nan), covariance)


def _at_rest(frames: int) -> Pose:
    """Return poses with the pelvis at the origin and all angles zero."""
    return Pose(np.zeros((frames, 3)), np.tile(np.eye(3), (frames, 1, 1)), np.zeros((frames, len(ANGLES))))


def _aligned(pose: Pose, local: Floats, origins: Floats, data: _Observations) -> tuple[Pose, Floats]:
    """Align bodies with given angles rigidly with the points, trunk first; also return size ratios (T,)."""
    still = _at_rest(len(pose))
    still.angles = pose.angles
    model = pose_skeleton(still, origins).points(local, data.segment)
    w = (data.weight * ALIGNMENT_WEIGHTS[data.segment])[..., None] + 1e-12 * data.weight[..., None]
    total = np.maximum(w.sum(axis=1), 1e-30)
    middle, goal = (w * model).sum(axis=1) / total, (w * data.observed).sum(axis=1) / total
    a, b = (model - middle[:, None]) * np.sqrt(w), (data.observed - goal[:, None]) * np.sqrt(w)
    u, s, vt = np.linalg.svd(np.swapaxes(b, 1, 2) @ a)
    side = np.sign(np.linalg.det(u @ vt))  # a rotation, not a mirror image
    s[:, 2] *= side
    u[:, :, 2] *= side[:, None]
    turn = u @ vt
    ratio = s.sum(axis=1) / np.maximum((a**2).sum(axis=(1, 2)), 1e-30)
    position = goal - np.einsum("tij,tj->ti", turn, middle)
    return Pose(position, turn, pose.angles.copy()), ratio


def _fit_poses(
    data: _Observations, local: Floats, origins: Floats, start: Pose, outlier: float
) -> tuple[Pose, Floats]:
    """Find the poses of all frames from a start; return poses and losses (T,)."""
    pose, cost = start[:], np.empty(len(start))
    for first in range(0, len(start), SOLVED_AT_ONCE):
        chunk = np.arange(first, min(first + SOLVED_AT_ONCE, len(start)))
        pose[chunk], cost[chunk] = _descend(pose[chunk], data[chunk], local, origins, outlier)
    return pose, cost


def _descend(
    pose: Pose, data: _Observations, local: Floats, origins: Floats, outlier: float
) -> tuple[Pose, Floats]:
    """Levenberg-Marquardt on independent frames, each with its own damping."""

    def objective(pose: Pose, some: _Observations) -> Floats:
        world = pose_skeleton(pose, origins).points(local, data.segment)
        return _residuals(world, some, outlier)[2] + _prior_cost(pose.angles)

    cost, damping = objective(pose, data), np.full(len(pose), FIRST_DAMPING)
    active = np.arange(len(pose))
    for _ in range(MOST_FIT_STEPS):
        hessian, gradient = _normal_equations(pose[active], local, origins, data[active], outlier)
        diagonal = np.einsum("tii->ti", hessian)
        diagonal *= 1 + damping[active, None]
        step = -np.asarray(np.linalg.solve(hessian, gradient[..., None])[..., 0], float)
        moved = pose[active].moved(step)
        tried = objective(moved, data[active])
        better = np.asarray(tried < cost[active])
        gain = (cost[active] - tried) / np.maximum(cost[active], 1e-9)
        won = active[better]
        pose[won], cost[won] = moved[np.flatnonzero(better)], tried[better]
        damping[active] = np.maximum(
            damping[active] * np.where(better, DAMPING_DECREASE, DAMPING_INCREASE), LEAST_DAMPING
        )
        active = active[(better & (gain > LEAST_FIT_GAIN)) | (~better & (damping[active] < MOST_DAMPING))]
        if not len(active):
            break
    return pose, cost


def _normal_equations(
    pose: Pose, local: Floats, origins: Floats, data: _Observations, outlier: float
) -> tuple[Floats, Floats]:
    """Gauss-Newton matrices (T, 30, 30) and gradients (T, 30) of the poses."""
    body = pose_skeleton(pose, origins)
    world = body.points(local, data.segment)
    residual, weight, _ = _residuals(world, data, outlier)
    slope = _rows(body.by_pose(world, data.segment) / MARKER_SD_M)
    weighted = np.swapaxes(slope * np.repeat(weight, 3, axis=1)[..., None], 1, 2)
    hessian, gradient = weighted @ slope, (weighted @ _rows(residual[..., None]))[..., 0]
    _add_prior(hessian, gradient, pose.angles)
    return hessian, gradient


def _residuals(world: Floats, data: _Observations, outlier: float) -> tuple[Floats, Floats, Floats]:
    """Residuals (T, M, 3) in units of MARKER_SD_M, robust weights (T, M) and loss (T,)."""
    residual = (world - data.observed) / MARKER_SD_M
    square = (residual**2).sum(axis=2) / outlier**2
    return residual, data.weight / (1 + square), (data.weight * outlier**2 * np.log1p(square)).sum(axis=1)


def _prior_cost(angles: Floats) -> Floats:
    """Loss (T,) of the priors on the angles."""
    return ((angles / ANGLE_SD) ** 2 + (_beyond(angles) / LIMIT_SD) ** 2).sum(axis=1)


def _add_prior(hessian: Floats, gradient: Floats, angles: Floats) -> None:
    """Add the priors to the normal equations of the poses, in place."""
    beyond, k = _beyond(angles), np.arange(ROOT, FREEDOMS)
    hessian[:, k, k] += ANGLE_SD**-2 + (beyond != 0) * LIMIT_SD**-2
    gradient[:, k] += angles / ANGLE_SD**2 + beyond / LIMIT_SD**2
    hessian[:, range(ROOT), range(ROOT)] += ROOT_SD**-2


def _beyond(angles: Floats) -> Floats:
    """Amount by which angles exceed their limits, radians."""
    return np.asarray(angles - np.clip(angles, *ANGLE_LIMITS))


def _rows(table: Floats) -> Floats:
    """Join the axes of points and of x, y, z: (T, M, 3, n) to (T, 3 M, n)."""
    return table.reshape(len(table), -1, table.shape[-1])
