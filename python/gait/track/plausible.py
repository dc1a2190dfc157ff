"""Decide which estimates are `tracking`: those with matching keypoints or, without any, a plausible walk."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from gait.bindings.abi import Flag, TrackStatus
from gait.bindings.estimate import Estimate
from gait.camera.camera import Camera
from gait.io.video import Frame
from gait.track.person_keypoints import PersonKeypoints
from gait.track.person_shapes import PersonShapes
from gait.track.wrong_way import WrongWay, as_ambiguous, known_later

_DEPARTURE = 0.6  # metres in one second by which the pelvis may depart from the path of strides and heading
_BEYOND = 4.0  # standard deviations from which a stature is implausible
_BEFORE_S = 1.0  # seconds of a smoothed track before anything indicates the wrong way round
_LEAST_SD = 0.05  # metres; least standard deviation of a stature
_ELSEWHERE = "the person detected in the image does not match"
_NO_WALK = "the path does not match the strides, or the stature is unusual"
_UNSEEN = "the images hardly show the person"
_OTHERS_FIT = "another direction, side or phase fits the image as well"
_FOLLOWED = TrackStatus.TRACKING, TrackStatus.AMBIGUOUS


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
    cameras : sequence of Camera
        Of them only the first may move.
    backwards : bool
        Whether people who walk backwards are expected.

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
        cameras: Sequence[Camera],
        backwards: bool = True,
    ) -> None:
        self._keypoints = keypoints
        self._stature, self._stature_sd = stature, max(stature_sd, _LEAST_SD)
        self.directions, self._travel = directions, 1.0 - belt
        self._cameras, self._backwards = cameras, backwards
        self._wrong_way = self._new_wrong_way(backwards=True)  # an open direction must not undo a start

    def _new_wrong_way(self, backwards: bool) -> WrongWay:
        return WrongWay(self._keypoints, self.directions, self._cameras, backwards)

    def restart(self) -> None:
        """Forget the last second, since the track starts again elsewhere."""
        self._wrong_way.restart()
        self._keypoints.restart()

    def judged(self, frame: Frame, estimate: Estimate) -> Estimate:
        """Change `tracking` to `ambiguous` unless keypoints or, without any, images and walk support it.

        It also becomes `ambiguous` while it is the `WrongWay` round.  The reason of an estimate that is
        `ambiguous` already is added, unless only left and right are open.
        """
        self._wrong_way.add(frame, estimate)
        walks = self._walks(estimate)
        agree = self._keypoints.agree(frame, estimate)
        supported = not estimate.flags & Flag.UNSUPPORTED
        if (wrong := self._wrong_way.reason) and estimate.status in _FOLLOWED:
            return replace(estimate, status=TrackStatus.AMBIGUOUS, reason=wrong)
        if estimate.status == TrackStatus.AMBIGUOUS and estimate.flags & Flag.OTHERS_FIT:
            return replace(estimate, reason=_OTHERS_FIT)
        if agree or (agree is None and walks and supported):
            return estimate
        return as_ambiguous(estimate, _ELSEWHERE if agree is not None else _NO_WALK if supported else _UNSEEN)

    def known_later(self, found: Iterable[tuple[Frame, Estimate]]) -> Iterator[tuple[Frame, Estimate]]:
        """Yield judged estimates in order; those that led to the wrong way round become `ambiguous`."""
        return known_later(found, self._new_wrong_way(self._backwards), 0.0)

    def judged_later(self, found: Iterable[tuple[Frame, Estimate]]) -> Iterator[tuple[Frame, Estimate]]:
        """Judge the estimates of a smoothed track, in order, and those that led to the wrong way round.

        In such a track the second before anything indicates it is the wrong way round as well.
        """
        return known_later(self._anew(found), self._new_wrong_way(self._backwards), _BEFORE_S)

    def _anew(self, found: Iterable[tuple[Frame, Estimate]]) -> Iterator[tuple[Frame, Estimate]]:
        """Judge the estimates of a track again."""
        self.restart()
        for frame, estimate in found:
            if estimate.frame == 0:  # a start
                self.restart()
            yield frame, self.judged(frame, estimate)

    def _walks(self, estimate: Estimate) -> bool:
        """Whether the stature is plausible and the last second's path agrees with strides and heading."""
        moved, strides = self._wrong_way.path()
        departure = float(np.hypot(*(moved - self._travel * strides)))
        usual = abs(estimate.mean.stature - self._stature) < _BEYOND * self._stature_sd
        return usual and departure < _DEPARTURE
