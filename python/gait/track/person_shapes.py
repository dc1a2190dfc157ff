"""Check whether a person's shape is found at the estimate, for clips without keypoints.

An estimate in about the right place may still be wrong if it is supported by edges of the scene, or by a
median background with people in it; the shape then shows feet or head elsewhere.
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

_SELDOM = 0.09  # least seconds between searches
_HIDDEN_AFTER_S = 0.5  # seconds without the person's shape after which the person is not visible
_PELVIS = 0.48  # height of the pelvis over that of the box
_SD = (0.03, 0.04, 0.04)  # person's heights: crown, pelvis, lowest point (build, clothes, shadows)
_LOW = 0.01  # heights by which the soles of a shape are too low
_MEDIAN_OF = 5  # searches whose median is judged
_HEAD_DIFFERENCE = 0.07  # heights; largest difference of the crown
_SOLES = (-0.085, 0.035)  # heights; range of the difference of the soles, positive downwards


class PersonShapes:
    """Searches frames for a person near the last estimate, and turns the shape found into three keypoints.

    Parameters
    ----------
    camera : Camera
    stature : callable
        Computes the stature of the person in a box, metres.
    place : callable, optional
        Sets the pose of a moving camera for `stature`.
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
        """Forget all shapes, since the track starts again."""
        self._searched: Frame | None = None
        self._found: Box | None = None
        self._last: float | None = None  # time at which a shape was last found, seconds
        self._off: deque[Array] = deque(maxlen=_MEDIAN_OF)

    def of_cameras(self, frame: Frame, last: Estimate | None) -> list[FrameKeypoints | None]:
        """Return what `choose` finds in the picture of the first camera."""
        return [self.choose(frame, last)]

    def choose(self, frame: Frame, last: Estimate | None) -> FrameKeypoints | None:
        """Find crown, pelvis and lowest point of the shape near the last estimate; None if none or too soon.

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
        lowest = int(np.argmax(expected[:, 1]))  # of the standing foot, which hardly moves
        sole = np.array([expected[lowest, 0], foot[1] - _LOW * tall])
        uv = np.array([head, _PELVIS * head + (1 - _PELVIS) * foot, sole])
        return FrameKeypoints(("head_top", "pelvis", last.joint_names[lowest]), uv, np.array(_SD) * tall)

    def agree(self, frame: Frame, estimate: Estimate) -> bool | None:
        """Return False if shapes contradict an estimate, else None: they do not show whether legs agree."""
        if self._searched is frame and self._found is not None:
            self._off.append(_difference(self._box(frame, estimate), self._found))
        missing = self._last is not None and abs(frame.time - self._last) > _HIDDEN_AFTER_S
        return False if not self._fits() or missing else None

    def near(self, frame: Frame, estimate: Estimate) -> bool:
        """Whether shapes do not contradict the estimate just judged."""
        return self.agree(frame, estimate) is not False

    def faces(self, frame: Frame, estimate: Estimate) -> None:
        """Return None: a shape looks the same from the front and from behind."""

    def _box(self, frame: Frame, estimate: Estimate) -> Box | None:
        """Return the box of the estimated body; None if part of it is behind the camera."""
        expected = frame.camera(self._camera).project(estimate.joints)
        if np.isnan(expected).any():
            return None
        crown = expected[estimate.joint_names.index("head_top")]
        middle = expected[estimate.joint_names.index("pelvis"), 0]
        foot = np.array([2 * middle - crown[0], expected[:, 1].max()])
        return Box(foot, crown, 1.0) if foot[1] > crown[1] else None

    def _fits(self) -> bool:
        """Whether recent estimates were where the shapes were."""
        if not self._off:
            return True
        x, crown, soles = np.median(self._off, axis=0)
        return bool(np.hypot(x, crown) < _HEAD_DIFFERENCE and _SOLES[0] < soles < _SOLES[1])


def _difference(box: Box | None, shape: Box) -> Array:
    """Crown (x, y) and soles (y) of an estimate minus those of the shape, in heights of the shape."""
    if box is None:
        return np.full(3, np.inf)
    return np.array([*(box.head - shape.head), box.foot[1] - shape.foot[1]]) / shape.tall
