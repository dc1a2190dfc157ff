"""Keypoints of everyone in a clip, and which of them are of the person who is tracked.

Of the people found in a frame, the one counts who is where the tracker has the person, in that size.
Keypoints of someone else, or of a detector that jumped, are left out.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gait.bindings.abi import TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.frame import Joints
from gait.camera.camera import Camera

_GATE = (
    0.25  # person's heights from the estimated joints up to which keypoints are the person's, by the median
)
_AGREE = 0.08  # person's heights up to which knees and ankles agree with the estimate, on average
_LEGS = ("l_knee", "r_knee", "l_ankle", "r_ankle")


class PersonKeypoints:
    """Keypoints of everyone in a clip.

    Parameters
    ----------
    camera : Camera
    joints : mapping of int to mapping of int to Joints
        By id of the person and number of the frame.
    person : int
        Id of the person to track.
    """

    def __init__(self, camera: Camera, joints: Mapping[int, Mapping[int, Joints]], person: int) -> None:
        self._camera, self._joints, self._person = camera, joints, person

    def choose(self, frame: int, last: Estimate | None) -> Joints | None:
        """Keypoints of the person in a frame after the last estimate; None if there are none.

        As long as there is no estimate of the person, they are those of the person to track.
        """
        if last is None or last.status == TrackStatus.LOST:
            return self._own(frame)
        near = [(self._distance(last, joints), joints) for joints in self._found(frame)]
        distance, joints = min(near, key=lambda pair: pair[0], default=(np.inf, None))
        return joints if distance < _GATE else None

    def contradict(self, frame: int, estimate: Estimate) -> bool:
        """Whether the person to track was found in a frame, and no person where the estimate is."""
        return self._own(frame) is not None and all(
            self._distance(estimate, joints) > _GATE for joints in self._found(frame)
        )

    def agree(self, frame: int, estimate: Estimate) -> bool | None:
        """Whether the keypoints in a frame agree with the estimate, legs included; None if there are none."""
        if not self._found(frame):
            return None
        joints = self.choose(frame, estimate)
        if joints is None:
            return False
        legs = self._apart(estimate, joints, _LEGS)
        return not len(legs) or bool(legs.mean() < _AGREE)

    def _own(self, frame: int) -> Joints | None:
        joints = self._joints.get(self._person, {}).get(frame)
        return joints if joints is not None and np.isfinite(joints.uv).any() else None

    def _found(self, frame: int) -> list[Joints]:
        people = (joints[frame] for joints in self._joints.values() if frame in joints)
        return [joints for joints in people if np.isfinite(joints.uv).any()]

    def _distance(self, estimate: Estimate, joints: Joints) -> float:
        """Median distance from the estimated joints."""
        apart = self._apart(estimate, joints, tuple(joints.names))
        return float(np.median(apart)) if len(apart) else np.inf

    def _apart(self, estimate: Estimate, joints: Joints, names: tuple[str, ...]) -> NDArray[np.float64]:
        """Distances of the keypoints found from the estimated joints, person's heights."""
        expected = self._camera.project(estimate.joints)
        if np.isnan(expected).any():  # behind the camera
            return np.full(len(names), np.inf)
        common = [name for name in names if name in joints.names and name in estimate.joint_names]
        ours = expected[[estimate.joint_names.index(name) for name in common]]
        theirs = np.asarray(joints.uv, float)[[list(joints.names).index(name) for name in common]]
        off = np.hypot(*(ours - theirs).T) / np.ptp(expected[:, 1])
        return np.asarray(off[np.isfinite(off)])
