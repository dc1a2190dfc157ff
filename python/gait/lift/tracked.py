"""Joints of a track from one camera, half-way to those that its keypoints are lifted to.

The tracker reports the joints of the model's body.  The lift knows no body: its segments of motion vary with
the person, and it explains the keypoints of the whole clip together.  Both err by about as much, partly
independently, so their mean is nearer to the person.  It contains part of the person's proportions and
posture, as far as one view shows them; the rest stays with the model and the prior of the segments.

Each frame's lifted body is first moved along the line of sight to the depth of the tracker's, which also
knows its size from the images.  The segments are learnt from people who walk straight on, so the joints of
other motion classes, of people who turn, and where the two disagree about the pose, as about left and right,
are those of the tracker alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.bindings.abi import TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.segment_prior import SegmentPrior
from gait.body.motion_classes import WALKING
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.lift.run import Request, lift_keypoints
from gait.lift.segment.view import Perspective
from gait.lift.smooth.motion import Motion
from gait.lift.smooth.options import Options
from gait.progress import warning
from gait.track.options import ClipOptions
from gait.track.scene import Scene
from gait.track.standing import Estimated, Moved

Array = NDArray[np.float64]

_HALF = 0.5  # weight of a lifted joint
#: Metres: median distance of the joints, with the hips aligned, up to which the weight is whole, and from
#: which it is zero.  Errors of both make up 0.02 to 0.05.
_AGREE, _DISAGREE = 0.08, 0.16
#: Seconds from the nearest frame with keypoints, in the same way.
_VISIBLE_S, _HIDDEN_S = 0.1, 0.3
#: Turn rates, rad/s, in the same way.
_STRAIGHT, _TURNS = 0.2, 0.4
_MARGIN_S = 1.0  # before and after the frames to track, of keypoints that are lifted too
_HIPS = ("l_hip", "r_hip")


class TrackedAndLifted:
    """Moves the joints of estimates half-way to lifted ones.

    Parameters
    ----------
    camera : Camera
        One that stands still.
    keypoints : Keypoints
        Those that were lifted.
    lifted : Motion
        The joints in their frames.
    classes : sequence of str
        Motion classes of the tracker's model.
    """

    def __init__(
        self, camera: Camera, keypoints: Keypoints, lifted: Motion, classes: Sequence[str] = (WALKING,)
    ) -> None:
        self._camera, self._lifted = camera, lifted
        self._walking = classes.index(WALKING) if WALKING in classes else None
        self._row = {number: row for row, number in enumerate(keypoints.frame.tolist())}
        time, visible = keypoints.time, keypoints.time[keypoints.visible.any(axis=1)]
        bounds = np.concatenate([[-np.inf], visible, [np.inf]])
        after = np.searchsorted(bounds, time)
        away = np.minimum(bounds[after] - time, time - bounds[after - 1])
        self._visible = _below(away, _VISIBLE_S, _HIDDEN_S)

    def moved(self, found: Iterable[Estimated]) -> Iterator[Estimated]:
        """Yield the frames in order; lost and not lifted ones unchanged."""
        for frame, estimate in found:
            row = self._row.get(frame.number)
            if row is not None and estimate.status != TrackStatus.LOST:
                estimate = replace(estimate, joints=self._mean(estimate, row))
            yield frame, estimate

    def _mean(self, estimate: Estimate, row: int) -> Array:
        """Mean of the joints (J, 3) of an estimate and those of a row of the lift, metres."""
        joints, names, lifted = estimate.joints, list(estimate.joint_names), self._lifted.places[row]
        common = [name for name in self._lifted.names if name in names]
        ours = [names.index(name) for name in common]
        theirs = lifted[[self._lifted.names.index(name) for name in common]]
        hips = [common.index(name) for name in _HIPS]
        middle, other = joints[ours][hips].mean(axis=0), theirs[hips].mean(axis=0)
        apart = float(np.median(np.linalg.norm(joints[ours] - middle - theirs + other, axis=1)))
        weight = _HALF * self._visible[row] * _below(apart, _AGREE, _DISAGREE)
        weight *= _below(abs(estimate.mean.turn_rate), _STRAIGHT, _TURNS)
        weight *= 0.0 if self._walking is None else estimate.class_probability[self._walking]
        way = other - self._camera.centre
        depth, wanted = self._camera.depth(np.array([other, middle]))
        if not (np.isfinite(apart) and depth > 0):
            return joints
        out = joints.copy()
        out[ours] += weight * (theirs + way * (wanted / depth - 1.0) - joints[ours])
        return out


def _below(values: Array | float, whole: float, none: float) -> Array:
    """1 for values up to `whole`, 0 from `none` on, linear in between."""
    return np.asarray(np.clip((none - np.asarray(values)) / (none - whole), 0.0, 1.0))


def half_lifted(options: ClipOptions, scene: Scene) -> Moved:
    """Lift the keypoints of the person in a scene with one camera; return what moves the joints of a track.

    A lift that does not fit the prior moves none, and a warning states that.

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

    def warn(words: str) -> None:
        warning(f"--body auto: {words}", options.quiet)

    try:
        keypoints = every_frame(scene.people[scene.person], scene.frames, scene.video.times)
        prior = _prior(options.model)
        lifted = lift_keypoints(options.video, keypoints, prior, request, warn, options.quiet)
    except UserError as error:
        raise UserError(f"{error}; or leave out --body auto") from None
    if lifted.motion.unlike:
        warn("the motion is unlike those that lifts are learnt from; the joints are the tracker's alone")
        return iter
    return TrackedAndLifted(scene.camera, lifted.keypoints, lifted.motion, scene.model.classes).moved


def every_frame(keypoints: Keypoints, frames: range, times: Array) -> Keypoints:
    """Return keypoints in every frame of a film that is to be tracked; those in between show nothing.

    Parameters
    ----------
    keypoints : Keypoints
    frames : range
        Frames to track.
    times : (N,)
        Times of all frames of the film, seconds.
    """
    near = times[[frames.start, frames.stop - 1]] + np.array([-_MARGIN_S, _MARGIN_S])
    first, stop = np.searchsorted(times, near, side="right").tolist()
    number = np.arange(first, stop)
    rows = keypoints.frame - first
    used = (rows >= 0) & (rows < len(number))
    columns: dict[str, Any] = {"frame": number, "time": times[number]}
    for name in ("uv", "confidence", "sd", "lasting_sd", "frame_sd", "by_hand"):
        if (values := getattr(keypoints, name)) is not None:
            columns[name] = np.full((len(number), *values.shape[1:]), np.nan)
            columns[name][rows[used]] = values[used]
    columns["confidence"] = np.nan_to_num(columns["confidence"], nan=1.0)
    return replace(keypoints, **columns)


def _prior(model: str | None) -> SegmentPrior:
    """Load the segment prior of a model or, if it has none, the package's."""
    try:
        return SegmentPrior.load(model)
    except UserError:
        return SegmentPrior.load()


def _refusal(options: ClipOptions, words: str) -> UserError:
    return UserError(f"{options.video}: --body auto: {words}; leave it out")
