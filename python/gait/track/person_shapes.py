"""Check whether a person's shape is found at the estimate, for clips without keypoints.

A figure in about the right place may still be a wrong one, when edges of the scene or a median background
with people in it support it; the shape then shows its feet or head elsewhere.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gait.bindings.abi import TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.frame import FrameKeypoints
from gait.bindings.start_fit import Box
from gait.camera.camera import Camera
from gait.camera.path import CameraPose
from gait.detect.shapes import find_near
from gait.io.video import Frame

Array = NDArray[np.float64]

_SELDOM = 0.09  # seconds, at least, from one search to the next
_PATIENCE = 0.5  # seconds without the person's shape after which they are not seen
_PELVIS = 0.48  # height of the pelvis in a box, of the box's
_SD = (0.03, 0.04, 0.04)  # person's heights, of crown, pelvis and lowest point: build, clothes, shadows
_LOW = 0.01  # heights by which the soles of a shape are too low
_MEDIAN_OF = 5  # searches whose median is judged
_HEAD = 0.07  # heights by which the crown may be off
_SOLES = (-0.085, 0.035)  # the same of the soles, downwards


class PersonShapes:
    """Searches frames for a person about the last estimate; what it finds becomes three keypoints.

    Parameters
    ----------
    camera : Camera
    stature : callable
        Of the person in a box, metres.
    place : callable, optional
        Gives `stature` the pose of a camera that moves.
    """

    def __init__(
        self,
        camera: Camera,
        stature: Callable[[Box], float],
        place: Callable[[CameraPose], None] = lambda pose: None,
    ) -> None:
        self._camera, self._stature, self._place = camera, stature, place
        self.restart()

    def restart(self) -> None:
        """Forget what was seen: the track starts anew."""
        self._searched: Frame | None = None
        self._found: Box | None = None
        self._last: float | None = None  # seconds, when a shape was found
        self._off: deque[Array] = deque(maxlen=_MEDIAN_OF)

    def of_cameras(self, frame: Frame, last: Estimate | None) -> list[FrameKeypoints | None]:
        """Give what `choose` finds in the picture of the first camera."""
        return [self.choose(frame, last)]

    def choose(self, frame: Frame, last: Estimate | None) -> FrameKeypoints | None:
        """Crown, pelvis and lowest point of the shape near the last estimate; None if unseen, or too soon.

        The frames' times may increase or decrease.
        """
        if last is None or last.status == TrackStatus.LOST:
            return None
        if self._searched is not None and abs(frame.time - self._searched.time) < _SELDOM:
            return None
        self._last = frame.time if self._last is None else self._last
        if frame.pose is not None:
            self._place(frame.pose)
        camera, box = frame.camera(self._camera), self._box(frame, last)
        self._searched = frame
        self._found = None if box is None else find_near(frame.image, box, self._stature)
        if self._found is None:
            return None
        self._last = frame.time
        head, foot, tall = self._found.head, self._found.foot, self._found.tall
        expected = camera.project(last.joints)
        lowest = int(np.argmax(expected[:, 1]))  # it hardly moves, as the person stands on it
        sole = np.array([expected[lowest, 0], foot[1] - _LOW * tall])
        uv = np.array([head, _PELVIS * head + (1 - _PELVIS) * foot, sole])
        return FrameKeypoints(("head_top", "pelvis", last.joint_names[lowest]), uv, np.array(_SD) * tall)

    def agree(self, frame: Frame, estimate: Estimate) -> bool | None:
        """Whether shapes object to an estimate (False); a shape does not show the legs, so never True."""
        if self._searched is frame and self._found is not None:
            self._off.append(_difference(self._box(frame, estimate), self._found))
        missing = self._last is not None and abs(frame.time - self._last) > _PATIENCE
        return False if not self._fits() or missing else None

    def near(self, frame: Frame, estimate: Estimate) -> bool:
        """Whether the person is not seen elsewhere than in the estimate just judged."""
        return self.agree(frame, estimate) is not False

    def _box(self, frame: Frame, estimate: Estimate) -> Box | None:
        """Box of the estimated body; None if part of it is behind the camera."""
        expected = frame.camera(self._camera).project(estimate.joints)
        if np.isnan(expected).any():
            return None
        crown = expected[estimate.joint_names.index("head_top")]
        middle = expected[estimate.joint_names.index("pelvis"), 0]
        foot = np.array([2 * middle - crown[0], expected[:, 1].max()])
        return Box(foot, crown, 1.0) if foot[1] > crown[1] else None

    def _fits(self) -> bool:
        """Whether estimates have lately been where the shape is."""
        if not self._off:
            return True
        x, crown, soles = np.median(self._off, axis=0)
        return bool(np.hypot(x, crown) < _HEAD and _SOLES[0] < soles < _SOLES[1])


def _difference(box: Box | None, shape: Box) -> Array:
    """Crown (x, y) and soles (y) of an estimate less those of the shape, the shape's heights."""
    if box is None:
        return np.full(3, np.inf)
    return np.array([*(box.head - shape.head), box.foot[1] - shape.foot[1]]) / shape.tall
