"""Joints where the keypoints of several cameras are, not only where the model's body has them.

The tracker reports the joints of the model's body.  A person's are elsewhere, because of their proportions,
their posture, and curves of a stride that never fit exactly; the standard deviations of an estimate contain
this (setting `joint_sd_model`).  With one camera the difference stays unknown in depth.  Several cameras
measure it, so each joint of each frame becomes the mean of a posterior:

    prior       the tracker's joint, with its standard deviations
    likelihood  keypoints in all cameras, with the standard deviations of one frame and Student's t, as in the
                keypoint term; averaged over the frames around, where one without keypoints shows nothing

The pelvis moves with the hips.  Joints without keypoints, such as those of the head, stay.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gait.bindings.abi import TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.frame import FrameKeypoints
from gait.body.skeleton import mistaken_sides, other_sides
from gait.camera.camera import Camera
from gait.io.video import Frame
from gait.track.person_keypoints import PersonKeypoints
from gait.track.standing import Estimated

Array = NDArray[np.float64]

STUDENT_DEGREES = 4.0  # of freedom, of a keypoint's errors
_ROUNDS = 4  # of robust weights and linearisation
_HIPS = ("l_hip", "r_hip")
_LEAST_VIEWS = 2
#: Seconds, sd of the weights over time: half as long as a detector's errors last.
_SMOOTHING_S = 0.07
_WINDOW_S = 0.2  # seconds before and after a frame that count for it


@dataclass(frozen=True)
class _Held:
    """A frame that waits for the following ones."""

    frame: Frame
    estimate: Estimate
    precision: Array  #: (J, 3, 3) of the move from the tracker's joint to the person's, 1 / metres^2
    pull: Array  #: (J, 3) that precision times the move; both 0 where nothing was measured


class MeasuredJoints:
    """Moves the joints of estimates to where several cameras see them.

    Parameters
    ----------
    cameras : sequence of Camera
        The first one's and the further ones'.
    keypoints : PersonKeypoints
        Keypoints in all of them.
    """

    def __init__(self, cameras: Sequence[Camera], keypoints: PersonKeypoints) -> None:
        self._cameras, self._keypoints = cameras, keypoints

    def moved(self, found: Iterable[Estimated]) -> Iterator[Estimated]:
        """Yield the frames in order, each once those up to `_WINDOW_S` later are known."""
        held: deque[_Held] = deque()
        waiting: deque[_Held] = deque()
        for frame, estimate in found:
            one = self._measured(frame, estimate)
            held.append(one)
            waiting.append(one)
            while frame.time - waiting[0].frame.time > _WINDOW_S:
                yield self._smoothed(waiting.popleft(), held)
            while held[0].frame.time < waiting[0].frame.time - _WINDOW_S:
                held.popleft()
        while waiting:
            yield self._smoothed(waiting.popleft(), held)

    @staticmethod
    def _smoothed(one: _Held, around: Iterable[_Held]) -> Estimated:
        """Move the joints of a frame by what it and those around it show of the moves."""
        frame, estimate = one.frame, one.estimate
        near = [other for other in around if other.estimate.status != TrackStatus.LOST]
        if estimate.status == TrackStatus.LOST or not any(other.precision.any() for other in near):
            return frame, estimate
        apart = np.array([other.frame.time - frame.time for other in near]) / _SMOOTHING_S
        precision, pull = (
            np.average(values, axis=0, weights=np.exp(-0.5 * apart**2))
            for values in ([other.precision for other in near], [other.pull for other in near])
        )
        moves, joint_sd = posterior(estimate.joint_sd, precision, pull)
        names = list(estimate.joint_names)
        if set(names) >= {"pelvis", *_HIPS}:
            hips, pelvis = [names.index(name) for name in _HIPS], names.index("pelvis")
            moves[pelvis] = moves[hips].mean(axis=0)
            joint_sd[pelvis] = joint_sd[hips].mean(axis=0)
        return frame, replace(estimate, joints=estimate.joints + moves, joint_sd=joint_sd)

    def _measured(self, frame: Frame, estimate: Estimate) -> _Held:
        """Measure the joints in one frame."""
        names, joints = list(estimate.joint_names), estimate.joints
        nothing = _Held(frame, estimate, np.zeros((*joints.shape, 3)), np.zeros(joints.shape))
        if estimate.status == TrackStatus.LOST:
            return nothing
        views = []
        found = self._keypoints.of_cameras(frame, estimate)
        for view, camera, points in zip((frame, *frame.others), self._cameras, found, strict=True):
            if view is None or points is None:
                continue
            now = view.camera(camera)
            expected = now.project(joints)
            uv, sd = _columns(points, names)
            if mistaken_sides(uv, expected, names, np.ptp(expected[:, 1])):
                uv, sd = uv[other_sides(names)], sd[other_sides(names)]
            views.append((now, uv, sd))
        if len(views) < _LEAST_VIEWS:
            return nothing
        return _Held(frame, estimate, *likelihood(joints, estimate.joint_sd, views))


def _columns(points: FrameKeypoints, names: list[str]) -> tuple[Array, Array]:
    """Order keypoints (J, 2), NaN where there are none, and their standard deviations (J,) by `names`."""
    uv, sd = np.full((len(names), 2), np.nan), np.ones(len(names))
    known = [k for k, name in enumerate(points.names) if name in names]
    columns = [names.index(points.names[k]) for k in known]
    uv[columns] = np.asarray(points.uv, float)[known]
    sd[columns] = np.broadcast_to(points.sd, len(points.names))[known]
    return uv, sd


def likelihood(joints: Array, sd: Array, views: Sequence[tuple[Camera, Array, Array]]) -> tuple[Array, Array]:
    """Precision (J, 3, 3) of the moves of joints in the world that keypoints show, and it times these (J, 3).

    Parameters
    ----------
    joints, sd : (J, 3)
        Those of the prior, metres.
    views : sequence of (Camera, (J, 2), (J,))
        Camera, keypoints (NaN where not found) and their standard deviations, pixels.
    """
    moves = np.zeros(joints.shape)
    for _ in range(_ROUNDS):
        precision, pull = np.zeros((*joints.shape, 3)), np.zeros(joints.shape)
        for camera, uv, error in views:
            off, by_place = uv - camera.project(joints + moves), camera.linearised(joints + moves)[1]
            square = (off**2).sum(axis=1) / error**2
            weight = np.nan_to_num((STUDENT_DEGREES + 2.0) / (STUDENT_DEGREES + square) / error**2)
            off = np.nan_to_num(off) + np.einsum("jax,jx->ja", by_place, moves)
            precision += np.einsum("j,jax,jay->jxy", weight, by_place, by_place)
            pull += np.einsum("j,jax,ja->jx", weight, by_place, off)
        moves, _ = posterior(sd, precision, pull)
    return precision, pull


def posterior(sd: Array, precision: Array, pull: Array) -> tuple[Array, Array]:
    """Means and standard deviations (J, 3) of moves with a prior's `sd` (J, 3) and a `likelihood`, metres."""
    whole = np.eye(3) / np.maximum(sd, 1e-6)[:, :, None] ** 2 + precision
    moves = np.linalg.solve(whole, pull[..., None])[..., 0]
    return moves, np.sqrt(np.linalg.inv(whole).diagonal(axis1=1, axis2=2))
