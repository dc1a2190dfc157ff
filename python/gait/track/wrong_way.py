"""Whether an estimate is, or may be, the wrong way round: the person faces, or moves, against it.

The last second of a track decides.  A detector confuses front and back in single frames, and the place of a
person seen from the front is uncertain, so less evidence only indicates it.

Seen from the front or from behind, a person who walks backwards looks like one who walks ahead while the
detector confuses front and back throughout.  Both are rare, so unless people who walk backwards are expected
the estimate may be the wrong way round until the track has shown that it is not: while the person walked
ahead, or in a view from the side.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from gait.bindings.abi import TrackStatus
from gait.bindings.estimate import Estimate
from gait.camera.camera import Camera
from gait.io.video import Frame
from gait.track.person_keypoints import PersonKeypoints
from gait.track.person_shapes import PersonShapes

_TURNED_S = 0.5  # of the last second, in which keypoints show the trunk facing the other way
_NOT_TURNED_S = 0.25  # of it, up to which they no longer do
_FRAME_S = 0.1  # for which one frame of them counts at most
_AGAINST = 0.3  # metres in the last second by which the path leads against the strides, also on a treadmill
_SURELY = 3.0  # standard deviations of the place along the strides that it must be as well
_INDICATES = 0.05  # metres of it that already indicate it
_STRIDES = 0.2  # metres; shorter strides have no direction
_ACROSS = 0.3  # least sine of the angle between heading and line of sight in a view from the side
_SHOWN_S = 0.5  # for which the track must have shown which way the person faces
_LONGEST_S = 2.0  # for which frames wait if anything indicates it
_TURNED = "the detected joints show the person facing the other way"
#: Reason of an estimate that is `ambiguous`, as that of people who walk backwards.
AGAINST_STRIDES = "the path leads against the direction of the strides"
_FRONT_OR_BACK = "from the front or from behind, walking backwards looks like walking ahead"


class WrongWay:
    """What the last second shows, frame by frame.

    Parameters
    ----------
    keypoints : PersonKeypoints or PersonShapes
    directions : mapping of str to int
        `Model.directions`.
    cameras : sequence of Camera
        Of them only the first may move.
    backwards : bool
        Whether people who walk backwards are expected.

    Attributes
    ----------
    reason : str
        Why the last estimate is, or may be, the wrong way round; empty if it is not.
    indicated : bool
        Whether anything in the last second indicates it.
    """

    def __init__(
        self,
        keypoints: PersonKeypoints | PersonShapes,
        directions: Mapping[str, int],
        cameras: Sequence[Camera],
        backwards: bool,
    ) -> None:
        self._keypoints, self._directions, self._cameras = keypoints, directions, cameras
        self._expected = backwards
        self._second: deque[tuple[float, ...]] = deque()  # times, places, velocities, seconds turned
        self.restart()

    def restart(self) -> None:
        """Forget the last second, since the track starts again elsewhere."""
        self._second.clear()
        self._shown = 0.0  # seconds in which the track showed which way the person faces
        self.reason, self.indicated = "", False

    def add(self, frame: Frame, estimate: Estimate) -> None:
        """Add an estimate; the frames' times may decrease."""
        since = abs(frame.time - self._second[-1][0]) if self._second else 0.0
        turned = min(since, _FRAME_S) if self._keypoints.faces(frame, estimate) is False else 0.0
        heading = estimate.mean.heading
        speed = self._directions[estimate.motion_class] * estimate.speed
        velocity = speed * np.cos(heading), speed * np.sin(heading)
        self._second.append((frame.time, *estimate.mean.pelvis[:2], *velocity, turned))
        while abs(frame.time - self._second[0][0]) > 1.0:
            self._second.popleft()
        mirrored = sum(row[-1] for row in self._second)
        moved, strides = self.path()
        length, along = float(np.hypot(*strides)), float(moved @ strides)
        if mirrored > (_NOT_TURNED_S if self.reason == _TURNED else _TURNED_S):
            self.reason = _TURNED
        else:
            least = max(_AGAINST * length, _SURELY * float(np.hypot(*(estimate.sd.pelvis[:2] * strides))))
            self.reason = AGAINST_STRIDES if length > _STRIDES and along < -least else ""
        if not self.reason and not self._expected:
            self._add_front_back(frame, estimate, min(since, _FRAME_S))
        self.indicated = mirrored > 0.0 or along < -_INDICATES * length

    def _add_front_back(self, frame: Frame, estimate: Estimate, seconds: float) -> None:
        """Add what an estimate that nothing contradicts shows of the direction in which the person faces."""
        direction, across = self._directions[estimate.motion_class], self._across(frame, estimate)
        if estimate.status == TrackStatus.TRACKING and (direction > 0 or across):
            self._shown += seconds
        if direction < 0 and not across and self._shown < _SHOWN_S:
            self.reason = _FRONT_OR_BACK

    def _across(self, frame: Frame, estimate: Estimate) -> bool:
        """Whether a camera sees the person from the side."""
        heading = estimate.mean.heading
        for camera in (frame.camera(self._cameras[0]), *self._cameras[1:]):
            x, y = estimate.mean.pelvis[:2] - camera.centre[:2]
            if abs(np.cos(heading) * y - np.sin(heading) * x) > _ACROSS * np.hypot(x, y):
                return True
        return False

    def path(self) -> tuple[np.ndarray, np.ndarray]:
        """Return how far the pelvis moved in the last second, and how far strides lead, (2,) metres."""
        rows = np.array(self._second)
        times, places, velocities = rows[:, 0], rows[:, 1:3], rows[:, 3:5]
        return places[-1] - places[0], (velocities[1:] * np.diff(times)[:, None]).sum(axis=0)


def known_later(
    found: Iterable[tuple[Frame, Estimate]], wrong_way: WrongWay, before: float
) -> Iterator[tuple[Frame, Estimate]]:
    """Yield the frames of a track in order; those that led to the wrong way round are `ambiguous` too.

    These are the frames since anything indicated it, and those up to `before` seconds earlier, but not more
    than `_LONGEST_S` seconds.  Frames wait for so long.
    """
    held: deque[tuple[Frame, Estimate]] = deque()
    backwards = False
    for frame, estimate in found:
        before_start, backwards = backwards, estimate.frame < 0
        if estimate.frame == 0 or backwards != before_start:  # another track begins
            yield from held
            held.clear()
            wrong_way.restart()
        wrong_way.add(frame, estimate)
        held.append((frame, estimate))
        if wrong_way.reason:
            held = deque((one, as_ambiguous(now, wrong_way.reason)) for one, now in held)
        wait = _LONGEST_S if wrong_way.indicated else before
        while held and frame.time - held[0][0].time >= wait:
            yield held.popleft()
    yield from held


def as_ambiguous(estimate: Estimate, reason: str) -> Estimate:
    """Return an estimate that is `tracking` as `ambiguous`, others as they are."""
    if estimate.status != TrackStatus.TRACKING:
        return estimate
    return replace(estimate, status=TrackStatus.AMBIGUOUS, reason=reason)
