"""Least-squares fit of the default skeleton to points on a body: lengths of the subject, poses of all frames.

The points are attached to segments at places known roughly; they may be markers on the skin or joints.  First
the subject's stretches and the points' true places are found together with the poses of some frames
(Levenberg-Marquardt, the poses eliminated by their Schur complement), then the poses of all frames at once.
The loss is robust (Cauchy).  What the points do not determine is left to weak priors; the covariance says so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.learn.solve import articulated, pose_fit, subject_fit
from gait.learn.solve.articulated import FREEDOMS, Indices, Pose
from gait.learn.solve.pose_fit import CHUNK
from gait.learn.solve.stretch_information import Information
from gait.learn.solve.subject_fit import OUTLIERS, STRETCHES, Marked, Subject

Floats = npt.NDArray[np.float64]

SIZES = (0.5, 2.5)  # metres of stature to start from
SUBJECT_FRAMES = 60
FEWEST = 3  # points seen in a frame that is fitted
MANY = 0.7  # of the most points seen in a frame: so many tell of the subject
BAD = 4  # times the median loss per point: a frame that may have come to rest elsewhere


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
    data = _data(observed, points)
    known = (data.weight.sum(axis=1) >= FEWEST) & np.isfinite(angles).all(axis=1)
    pose = pose_fit.at_rest(len(angles))
    pose.angles[known] = angles[known]
    turn = pose_fit.rooted(pose, points.at, articulated.ORIGINS, data)[0].turn
    return np.where(known[:, None, None], turn, np.nan)


def fit(observed: Floats, points: Points, stretch: Floats | None = None) -> Fit:
    """Fit subject and poses to points.

    Parameters
    ----------
    observed : (T, M, 3)
        Metres, in any right-handed axes; NaN where missing.
    points : Points
    stretch : (S,), optional
        The subject's stretches if they are known; then only the places of the points and the poses are found.

    Raises
    ------
    ValueError
        If no frame has three points.
    """
    data = _data(observed, points)
    picked = _spread(data.weight > 0)
    subject = _subject(data[picked], points, stretch)
    pose = _all_poses(data, subject, picked)
    return _finished(data, subject, pose)


def information(observed: Floats, points: Points) -> tuple[Information, float]:
    """Find what points tell of their subject's stretches, and their rms distance from its body, metres.

    Parameters and errors are those of `fit`.
    """
    data = _data(observed, points)
    few = data[_spread(data.weight > 0)]
    subject = _subject(few, points, None)
    body = articulated.posed(subject.pose, articulated.origins(subject.stretch))
    apart = np.linalg.norm(body.points(subject.local, few.segment) - few.observed, axis=2)
    rms = float(np.sqrt(np.mean(apart[few.weight > 0] ** 2)))
    return subject_fit.information(subject), rms


def enough(observed: Floats) -> bool:
    """Whether any frame has points (T, M, 3) enough to be fitted."""
    return bool((np.isfinite(observed).all(axis=2).sum(axis=1) >= FEWEST).any())


def _data(observed: Floats, points: Points) -> pose_fit.Data:
    """Points as the fit takes them."""
    seen = np.asarray(np.isfinite(observed).all(axis=2))
    return pose_fit.Data(np.where(seen[..., None], observed, 0.0), seen.astype(float), points.segment)


def _subject(few: pose_fit.Data, points: Points, known: Floats | None) -> Subject:
    """Subject by some frames, from the pelvis up: size, poses, then everything together."""
    start = pose_fit.at_rest(len(few.weight))
    if known is None:
        size = np.median(pose_fit.rooted(start, points.at, articulated.ORIGINS, few)[1])
        stretch = np.zeros(STRETCHES)
        stretch[0] = np.log(np.clip(size, *SIZES))
    else:
        stretch = known
    local = articulated.scales(stretch)[points.segment] * points.at
    offsets = articulated.origins(stretch)
    rooted = pose_fit.rooted(start, local, offsets, few)[0]
    pose = pose_fit.solve(few, local, offsets, rooted, OUTLIERS[0])[0]
    return subject_fit.fit(Marked(few, points.at, points.sd), stretch, pose, held=known is not None)


def _spread(seen: npt.NDArray[np.bool_]) -> Indices:
    """Frames spread over the recording in which many points are seen."""
    count = seen.sum(axis=1)
    if not (count >= FEWEST).any():
        raise ValueError("no frame has three points")
    good = np.flatnonzero(count >= max(FEWEST, MANY * count.max()))
    bins = np.array_split(good, min(SUBJECT_FRAMES, len(good)))
    return np.array([frames[np.argmax(count[frames])] for frames in bins])


def _all_poses(data: pose_fit.Data, subject: Subject, picked: Indices) -> Pose:
    """Poses of all frames, each started from the nearest picked one; bad ones again from good neighbours."""
    local, offsets = subject.local, articulated.origins(subject.stretch)
    frames = np.arange(len(data.weight))
    nearest = np.argmin(np.abs(frames[:, None] - picked[None]), axis=1)
    start = pose_fit.rooted(subject.pose[nearest], local, offsets, data)[0]
    pose, cost = pose_fit.solve(data, local, offsets, start, OUTLIERS[-1])
    count = (data.weight > 0).sum(axis=1)
    mean = cost / np.maximum(count, 1)
    good = (mean <= BAD * np.median(mean[count >= FEWEST])) & (count >= FEWEST)
    bad = np.flatnonzero(~good & (count >= FEWEST))
    if good.any() and len(bad):
        closest = np.flatnonzero(good)[np.argmin(np.abs(bad[:, None] - np.flatnonzero(good)[None]), axis=1)]
        start = pose_fit.rooted(pose[closest], local, offsets, data[bad])[0]
        again, cheaper = pose_fit.solve(data[bad], local, offsets, start, OUTLIERS[-1])
        won = np.flatnonzero(cheaper < cost[bad])
        pose[bad[won]] = again[won]
    return pose


def _finished(data: pose_fit.Data, subject: Subject, pose: Pose) -> Fit:
    """Add residuals and covariances."""
    local, offsets = subject.local, articulated.origins(subject.stretch)
    covariance = np.empty((len(pose), FREEDOMS, FREEDOMS))
    residual = np.empty(data.weight.shape)
    for first in range(0, len(pose), CHUNK):
        chunk = np.arange(first, min(first + CHUNK, len(pose)))
        world = articulated.posed(pose[chunk], offsets).points(local, data.segment)
        residual[chunk] = np.linalg.norm(world - data.observed[chunk], axis=2)
        hessian = pose_fit.normal_equations(pose[chunk], local, offsets, data[chunk], OUTLIERS[-1])[0]
        covariance[chunk] = np.linalg.inv(hessian)
    return Fit(subject.stretch, local, pose, np.where(data.weight > 0, residual, np.nan), covariance)
