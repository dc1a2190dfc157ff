"""Standing people take no strides: phase, stride rate and speed stay undefined until strides begin.

A model with only walking follows a person who stands, or takes half a step, with a phase that advances
slowly. A person stands if for `_STILL_S` seconds neither ankle moves relative to the hips in the picture, and
the pelvis certainly covers only a small part of the strides' path.  As a stride is from strike to strike of
one foot, there is none after that until both feet have struck.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gait.bindings.estimate import Estimate
from gait.io.video import Frame
from gait.track.person_keypoints import PersonKeypoints

Estimated = tuple[Frame, Estimate]
Sink = Callable[[Frame, Estimate], None]
Moved = Callable[[Iterable[Estimated]], Iterator[Estimated]]

_STILL_S = 0.3  # seconds; longer than both feet are on the floor in a step
_LEAST_ANKLE_SD = 0.01  # person's heights; least standard deviation of the position of a moving ankle
_WAY = 0.5  # share of the strides' path; a person who stands moves less
_WITHIN = 1.645  # standard deviations of a 90 % interval, which must not hold the whole path
_HIPS, _ANKLES = ("l_hip", "r_hip"), ("l_ankle", "r_ankle")


@dataclass
class _Held:
    """A frame that waits for the following ones."""

    frame: Frame
    estimate: Estimate
    ankles: NDArray[np.float64]  #: (2, 2) relative to the hips, person's heights; NaN where not found
    stands: bool = False


class Standing:
    """Removes phase, rate and speed where there are no strides.

    Parameters
    ----------
    keypoints : PersonKeypoints
    directions : mapping of str to int
        `Model.directions`.
    """

    def __init__(self, keypoints: PersonKeypoints, directions: Mapping[str, int]) -> None:
        self._keypoints, self._directions = keypoints, directions
        self._held: deque[_Held] = deque()
        self._strikes = 2  # since the person stood last
        self._half = 0  # half strides of the last phase

    def decided(self, found: Iterable[Estimated]) -> Iterator[Estimated]:
        """Yield the frames in order, each as soon as it is decided."""
        for frame, estimate in found:
            self._held.append(_Held(frame, estimate, self._ankles(frame, estimate)))
            while len(self._held) > 1 and frame.time - self._held[1].frame.time >= _STILL_S:
                yield self._next()
            if frame.time - self._held[0].frame.time >= _STILL_S and self._still():
                for held in self._held:
                    held.stands = True
        while self._held:
            yield self._next()

    def _ankles(self, frame: Frame, estimate: Estimate) -> NDArray[np.float64]:
        found = self._keypoints.choose(frame, estimate)
        if found is None or any(name not in found.names for name in _HIPS + _ANKLES):
            return np.full((2, 2), np.nan)
        uv = np.asarray(found.uv, float)
        hips, ankles = (uv[[list(found.names).index(name) for name in names]] for names in (_HIPS, _ANKLES))
        height = np.ptp(self._keypoints.joints_in(frame, estimate)[:, 1])
        return np.asarray((ankles - hips.mean(axis=0)) / height)

    def _still(self) -> bool:
        """Whether the person stands in all waiting frames."""
        sd = np.std([held.ankles for held in self._held], axis=0)
        if not np.hypot(*sd.T).max() < _LEAST_ANKLE_SD:  # also false if any is NaN
            return False
        heading = [held.estimate.mean.heading for held in self._held]
        speed = [self._directions[held.estimate.motion_class] * held.estimate.speed for held in self._held]
        place = [held.estimate.mean.pelvis[:2] for held in self._held]
        seconds = self._held[-1].frame.time - self._held[0].frame.time
        way = np.mean(speed * np.array([np.cos(heading), np.sin(heading)]), axis=1) * seconds
        moved, whole = (place[-1] - place[0]) @ way, way @ way
        unsure = np.linalg.norm(self._held[-1].estimate.sd.pelvis[:2] * way)  # sd along the way, times it
        return bool(moved < _WAY * whole and moved + _WITHIN * unsure < whole)

    def _next(self) -> Estimated:
        held = self._held.popleft()
        half = int(2 * held.estimate.mean.phase)
        if held.stands:
            self._strikes = 0
        elif half != self._half:
            self._strikes += 1
        self._half = half
        return held.frame, held.estimate if self._strikes >= 2 else _without_stride(held.estimate)


def _without_stride(estimate: Estimate) -> Estimate:
    nan = float("nan")
    mean, sd = (replace(state, phase=nan, stride_hz=nan) for state in (estimate.mean, estimate.sd))
    return replace(estimate, mean=mean, sd=sd, speed=nan)
