"""The body of a subject by points on it in some frames: stretches, true places of the points, poses together.

Levenberg-Marquardt on all of them; the poses are eliminated by their Schur complement.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.learn.solve import articulated, pose_fit
from gait.learn.solve.articulated import Pose
from gait.learn.solve.pose_fit import BETTER, DAMPING, GAIN, LEAST_DAMPING, MOST_DAMPING, ROUNDS, WORSE
from gait.learn.solve.stretch_information import GOAL, SD, STATURE, Information

Floats = npt.NDArray[np.float64]

OUTLIERS = (30.0, 10.0, 3.0)  # residuals beyond this many NOISE lose weight: first rounds to last
EFFECTIVE = 5.0  # frames that all of them count for: neighbours share their errors
STRETCHES = len(SD)


@dataclass(frozen=True)
class Marked:
    """Some frames of a subject, and what is known of the points on it.

    Attributes
    ----------
    data : pose_fit.Data
        K frames of M points.
    at, sd : (M, 3), (M,)
        Places in the segments' axes and how far the points may be from there, statures.
    """

    data: pose_fit.Data
    at: Floats
    sd: Floats

    @property
    def share(self) -> float:
        """How many times the errors of these frames are counted."""
        return len(self.data.weight) / EFFECTIVE

    def places(self, shape: Floats) -> Floats:
        """Places (M, 3) of the points, metres; shape (S + 3 M,): stretches, then shifts of the points."""
        scale = articulated.scales(shape[:STRETCHES])[self.data.segment]
        return scale * self.at + shape[STRETCHES:].reshape(-1, 3)

    def prior(self) -> tuple[Floats, Floats]:
        """Means and standard deviations of the shape."""
        goal = np.concatenate([GOAL, np.zeros(self.at.size)])
        return goal, np.concatenate([SD, np.repeat(self.sd, 3) * STATURE])


@dataclass(frozen=True)
class Subject:
    """Shape (S + 3 M,) of a subject with its points, and its poses in the frames."""

    marked: Marked
    shape: Floats
    pose: Pose

    @property
    def stretch(self) -> Floats:
        """The stretches (S,)."""
        return self.shape[:STRETCHES]

    @property
    def local(self) -> Floats:
        """Places (M, 3) of the points in their segments, metres."""
        return self.marked.places(self.shape)


def fit(marked: Marked, stretch: Floats, pose: Pose, held: bool = False) -> Subject:
    """Find the subject from a start; stretches (S,) that are held stay as they are."""
    goal, sd = marked.prior()
    shape = np.concatenate([stretch, np.zeros(marked.at.size)])
    weight, free = marked.share / sd**2, slice(STRETCHES if held else 0, None)

    def loss(shape: Floats, pose: Pose, outlier: float) -> float:
        body = articulated.posed(pose, articulated.origins(shape[:STRETCHES]))
        world = body.points(marked.places(shape), marked.data.segment)
        data = pose_fit.residuals(world, marked.data, outlier)[2] + pose_fit.prior_loss(pose.angles)
        return float(data.sum() + marked.share * (((shape - goal) / sd) ** 2).sum())

    for outlier in OUTLIERS:
        damping, cost = DAMPING, loss(shape, pose, outlier)
        for _ in range(ROUNDS):
            equations = _reduced(Subject(marked, shape, pose), outlier, damping, (weight, goal))
            step, steps = equations.steps(free)
            trial, moved = shape + step, pose.moved(steps)
            tried = loss(trial, moved, outlier)
            if tried < cost:
                gain, cost, shape, pose = cost - tried, tried, trial, moved
                damping = max(BETTER * damping, LEAST_DAMPING)
                if gain < GAIN * cost:
                    break
            else:
                damping *= WORSE
                if damping > MOST_DAMPING:
                    break
    return Subject(marked, shape, pose)


def information(subject: Subject) -> Information:
    """Find what the frames alone tell of the stretches, wherever the points are and whatever the poses.

    It is quadratic about the subject found (Gauss-Newton).
    """
    goal, sd = subject.marked.prior()
    share = subject.marked.share
    weight = share / sd**2
    weight[:STRETCHES] = 0  # what is known of people is no observation
    equations = _reduced(subject, OUTLIERS[-1], 0.0, (weight, goal))
    matrix, slope = equations.matrix, equations.slope
    solved = np.linalg.solve(
        matrix[STRETCHES:, STRETCHES:], np.c_[matrix[STRETCHES:, :STRETCHES], slope[STRETCHES:]]
    )
    across = matrix[:STRETCHES, STRETCHES:]
    told = (matrix[:STRETCHES, :STRETCHES] - across @ solved[:, :-1]) / share
    left = (slope[:STRETCHES] - across @ solved[:, -1]) / share
    told = (told + told.T) / 2
    return Information(told, told @ subject.stretch - left)


@dataclass(frozen=True)
class _Equations:
    """Normal equations of the shape, (S + 3 M) square, without the poses; `solved` gives these back."""

    matrix: Floats
    slope: Floats
    solved: Floats

    def steps(self, free: slice) -> tuple[Floats, Floats]:
        """Solve for the steps of the shape, of which only some is free, and of the poses (K, 30)."""
        step = np.zeros(len(self.slope))
        step[free] = -np.linalg.solve(self.matrix[free, free], self.slope[free])
        return step, -(self.solved[..., :-1] @ step + self.solved[..., -1])


def _reduced(s: Subject, outlier: float, damping: float, prior: tuple[Floats, Floats]) -> _Equations:
    """Set up the normal equations about a subject; prior: inverse variances and means of the shape."""
    few, pose = s.marked.data, s.pose
    body = articulated.posed(pose, articulated.origins(s.stretch))
    world = body.points(s.local, few.segment)
    residual, weight, _ = pose_fit.residuals(world, few, outlier)
    by_pose = pose_fit.rows(body.by_pose(world, few.segment) / pose_fit.NOISE)
    by_shape = np.zeros((*world.shape, len(s.shape)))
    by_shape[..., :STRETCHES] = body.by_stretch(s.stretch, s.marked.at, few.segment)
    for m, segment in enumerate(few.segment):
        first = STRETCHES + 3 * m
        by_shape[:, m, :, first : first + 3] = body.turns[:, segment]
    by_shape = pose_fit.rows(by_shape / pose_fit.NOISE)
    rest, heavy = pose_fit.rows(residual[..., None]), np.repeat(weight, 3, axis=1)[..., None]
    left = np.swapaxes(by_pose * heavy, 1, 2)
    inner, mixed, pose_slope = left @ by_pose, left @ by_shape, left @ rest
    pose_fit.add_prior(inner, pose_slope[..., 0], pose.angles)
    flat, weighted = by_shape.reshape(-1, len(s.shape)), (by_shape * heavy).reshape(-1, len(s.shape))
    outer = weighted.T @ flat + np.diag(prior[0])
    shape_slope = weighted.T @ rest.reshape(-1) + prior[0] * (s.shape - prior[1])
    np.einsum("tii->ti", inner)[:] *= 1 + damping
    np.einsum("ii->i", outer)[:] *= 1 + damping
    solved = np.linalg.solve(inner, np.concatenate([mixed, pose_slope], axis=2))
    crossed = np.swapaxes(mixed, 1, 2)
    return _Equations(
        outer - (crossed @ solved[..., :-1]).sum(axis=0),
        shape_slope - (crossed @ solved[..., -1:]).sum(axis=0)[:, 0],
        solved,
    )
