"""Joints of a track from one camera, half-way to those that its keypoints are lifted to.

The tracker reports the joints of the model's body.  The lift knows no body: its segments of motion vary with
the person, and it explains the keypoints of the whole clip together.  Both err by about as much, partly
independently, so their mean is nearer to the person.  It contains part of the person's proportions and
posture, as far as one view shows them; the rest stays with the model and the prior of the segments.

Each frame's lifted body is first moved along the line of sight to the depth of the tracker's, which also
knows its size from the images.  Where the two disagree about the pose, as about left and right or when a
person does not walk, the tracker's joints stay.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gait.bindings.abi import TrackStatus
from gait.bindings.segment_prior import SegmentPrior
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.lift.run import Request, lift_keypoints
from gait.lift.segment.view import Perspective
from gait.lift.smooth.motion import Motion
from gait.lift.smooth.options import Options
from gait.track.options import ClipOptions
from gait.track.scene import Scene
from gait.track.standing import Estimated, Moved

Array = NDArray[np.float64]

_HALF = 0.5  # weight of a lifted joint
#: Metres: median distance of the joints, with the hips aligned, up to which the weight is whole, and from
#: which it is zero.  Errors of both make up 0.02 to 0.05.
_AGREE, _DISAGREE = 0.08, 0.16
_HIPS = ("l_hip", "r_hip")


class TrackedAndLifted:
    """Moves the joints of estimates half-way to lifted ones.

    Parameters
    ----------
    camera : Camera
        One that stands still.
    frames : (T,)
        Numbers of the lifted frames, ascending.
    lifted : Motion
        Their joints.
    """

    def __init__(self, camera: Camera, frames: NDArray[np.int64], lifted: Motion) -> None:
        self._camera, self._lifted = camera, lifted
        self._row = {number: row for row, number in enumerate(frames.tolist())}

    def moved(self, found: Iterable[Estimated]) -> Iterator[Estimated]:
        """Yield the frames in order; lost and not lifted ones unchanged."""
        for frame, estimate in found:
            row = self._row.get(frame.number)
            if row is not None and estimate.status != TrackStatus.LOST:
                joints = self._mean(estimate.joints, list(estimate.joint_names), self._lifted.places[row])
                estimate = replace(estimate, joints=joints)
            yield frame, estimate

    def _mean(self, joints: Array, names: list[str], lifted: Array) -> Array:
        """Mean of the joints (J, 3) of an estimate and those of the lift, metres."""
        common = [name for name in self._lifted.names if name in names]
        ours = [names.index(name) for name in common]
        theirs = lifted[[self._lifted.names.index(name) for name in common]]
        hips = [common.index(name) for name in _HIPS]
        middle, other = joints[ours][hips].mean(axis=0), theirs[hips].mean(axis=0)
        apart = float(np.median(np.linalg.norm(joints[ours] - middle - theirs + other, axis=1)))
        weight = _HALF * float(np.clip((_DISAGREE - apart) / (_DISAGREE - _AGREE), 0.0, 1.0))
        way = other - self._camera.centre
        depth, wanted = self._camera.depth(np.array([other, middle]))
        if not (np.isfinite(apart) and depth > 0):
            return joints
        out = joints.copy()
        out[ours] += weight * (theirs + way * (wanted / depth - 1.0) - joints[ours])
        return out


def half_lifted(options: ClipOptions, scene: Scene) -> Moved:
    """Lift the keypoints of the person in a scene with one camera; return what moves the joints of a track.

    Raises
    ------
    UserError
        If the camera moves, there are no keypoints of the person, or they cannot be lifted.
    """
    if scene.poses:
        raise _refusal(options, "with one film the camera must stand still")
    if scene.person not in scene.people:
        raise _refusal(options, "no person is detected")
    request = Request(
        Options(stature=options.height), view=Perspective(scene.camera), stabilised=True, hints=False
    )
    try:
        lifted = lift_keypoints(
            options.video,
            scene.people[scene.person],
            _prior(options.model),
            request,
            lambda _: None,
            options.quiet,
        )
    except UserError as error:
        raise UserError(f"{error}; or leave out --body auto") from None
    return TrackedAndLifted(scene.camera, lifted.keypoints.frame, lifted.motion).moved


def _prior(model: str | None) -> SegmentPrior:
    """Load the segment prior of a model or, if it has none, the package's."""
    try:
        return SegmentPrior.load(model)
    except UserError:
        return SegmentPrior.load()


def _refusal(options: ClipOptions, words: str) -> UserError:
    return UserError(f"{options.video}: --body auto: {words}; leave it out")
