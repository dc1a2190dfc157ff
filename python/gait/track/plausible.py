"""Decide which estimates are `tracking`: those with matching keypoints or, without any, a plausible walk."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gait.bindings.abi import Flag, TrackStatus
from gait.bindings.estimate import Estimate
from gait.io.video import Frame
from gait.track.person_keypoints import PersonKeypoints
from gait.track.person_shapes import PersonShapes

_DEPARTURE = 0.6  # metres in one second by which the pelvis may depart from the path of strides and heading
_BEYOND = 4.0  # standard deviations from which a stature is implausible
_TURNED_S = 0.5  # of the last second, in which keypoints show the trunk facing the other way
_NOT_TURNED_S = 0.25  # of it, up to which they no longer do
_FRAME_S = 0.1  # for which one frame of them counts at most
_LEAST_SD = 0.05  # metres; least standard deviation of a stature
_ELSEWHERE = "the person detected in the image does not match"
_NO_WALK = "the path does not match the strides, or the stature is unusual"
_UNSEEN = "the images hardly show the person"
_OTHERS_FIT = "another direction, side or phase fits the image as well"
_TURNED = "the detected joints show the person facing the other way"


class Plausibility:
    """Judges the estimates of one track, frame by frame.

    Parameters
    ----------
    keypoints : PersonKeypoints or PersonShapes
    stature, stature_sd : float
        Expected stature of the person, and its standard deviation, metres.
    belt : float
        Share of each stride that a treadmill's belt moves the person back.
    directions : mapping of str to int
        `Model.directions`.

    Attributes
    ----------
    directions : mapping of str to int
    """

    def __init__(
        self,
        keypoints: PersonKeypoints | PersonShapes,
        stature: float,
        stature_sd: float,
        belt: float,
        directions: Mapping[str, int],
    ) -> None:
        self._keypoints = keypoints
        self._stature, self._stature_sd = stature, max(stature_sd, _LEAST_SD)
        self.directions, self._travel = directions, 1.0 - belt
        self._second: deque[tuple[float, ...]] = deque()  # times, places, velocities, seconds turned
        self._turned = False

    def restart(self) -> None:
        """Forget the last second, since the track starts again elsewhere."""
        self._second.clear()
        self._turned = False
        self._keypoints.restart()

    def judged(self, frame: Frame, estimate: Estimate) -> Estimate:
        """Change `tracking` to `ambiguous` unless keypoints or, without any, images and walk support it.

        It also becomes `ambiguous` while the person seems to face the other way.  The reason of an estimate
        that is `ambiguous` already is added, unless only left and right are open.
        """
        self._add(frame, estimate)
        walks = self._walks(estimate)
        agree = self._keypoints.agree(frame, estimate)
        supported = not estimate.flags & Flag.UNSUPPORTED
        bound = _NOT_TURNED_S if self._turned else _TURNED_S
        self._turned = self._mirrored() > bound
        if self._turned and estimate.status in (TrackStatus.TRACKING, TrackStatus.AMBIGUOUS):
            return replace(estimate, status=TrackStatus.AMBIGUOUS, reason=_TURNED)
        if estimate.status == TrackStatus.AMBIGUOUS and estimate.flags & Flag.OTHERS_FIT:
            return replace(estimate, reason=_OTHERS_FIT)
        if estimate.status != TrackStatus.TRACKING or agree or (agree is None and walks and supported):
            return estimate
        reason = _ELSEWHERE if agree is not None else _NO_WALK if supported else _UNSEEN
        return replace(estimate, status=TrackStatus.AMBIGUOUS, reason=reason)

    def judged_later(self, found: Sequence[tuple[Frame, Estimate]]) -> list[Estimate]:
        """Judge the estimates of a whole track, in order.

        Where the person seems to face the other way, the second before, which led to it, is `ambiguous` too,
        and so are earlier seconds in which some trunks were mirrored.
        """
        self.restart()
        judged: list[Estimate] = []
        mirrored: list[float] = []
        for frame, estimate in found:
            if estimate.frame == 0:  # a start
                self.restart()
            judged.append(self.judged(frame, estimate))
            mirrored.append(self._mirrored())
        turned = np.inf  # time of the next such frame
        for i in reversed(range(len(judged))):
            time, now = found[i][0].time, judged[i]
            if now.reason == _TURNED or (np.isfinite(turned) and mirrored[i] > _NOT_TURNED_S):
                turned = time
            if now.status == TrackStatus.TRACKING and turned - time <= 1.0:
                judged[i] = replace(now, status=TrackStatus.AMBIGUOUS, reason=_TURNED)
            turned = np.inf if now.frame == 0 else turned
        return judged

    def _add(self, frame: Frame, estimate: Estimate) -> None:
        """Add an estimate to the last second; the frames' times may decrease."""
        since = abs(frame.time - self._second[-1][0]) if self._second else 0.0
        turned = min(since, _FRAME_S) if self._keypoints.faces(frame, estimate) is False else 0.0
        heading = estimate.mean.heading
        speed = self.directions[estimate.motion_class] * estimate.speed * self._travel
        velocity = speed * np.cos(heading), speed * np.sin(heading)
        self._second.append((frame.time, *estimate.mean.pelvis[:2], *velocity, turned))
        while abs(frame.time - self._second[0][0]) > 1.0:
            self._second.popleft()

    def _mirrored(self) -> float:
        """Return the seconds of the last one in which the trunk is mirrored."""
        return sum(row[-1] for row in self._second)

    def _walks(self, estimate: Estimate) -> bool:
        """Whether the stature is plausible and the last second's path agrees with strides and heading."""
        path = np.array(self._second)
        times, places, velocities = path[:, 0], path[:, 1:3], path[:, 3:5]
        walked = (velocities[1:] * (times[1:] - times[:-1])[:, None]).sum(axis=0)
        departure = float(np.hypot(*(places[-1] - places[0] - walked)))
        usual = abs(estimate.mean.stature - self._stature) < _BEYOND * self._stature_sd
        return usual and departure < _DEPARTURE
