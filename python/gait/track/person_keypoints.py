"""Keypoints of everyone in a clip, and which of them belong to the tracked person.

In each frame the keypoints nearest to the estimated joints are used, if they are near enough.  This excludes
other people's keypoints, and the detector's jumps.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gait.bindings.abi import TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.frame import FrameKeypoints
from gait.body.skeleton import other_sides
from gait.camera.camera import Camera
from gait.io.video import Frame

_GATE = 0.25  # person's heights; keypoints with a larger median distance are not the person's
_SUPPORTING_DISTANCE = 0.15  # person's heights; up to this distance they support the estimate
_AGREE = 0.08  # person's heights; mean distance up to which knees and ankles agree with the estimate
_STANDS = 0.05  # the same for each leg of a person who stands; of one who steps a leg is further away
_LEGS = ("l_knee", "l_ankle"), ("r_knee", "r_ankle")
_TRUNK_PAIRS = (("l_shoulder", "r_shoulder"), ("l_hip", "r_hip"))
_APART = 3.0  # sds of their distance by which left and right are apart in a view that shows the direction


class PersonKeypoints:
    """Keypoints of everyone in a clip.

    Parameters
    ----------
    camera : Camera
    keypoints : mapping of int to mapping of int to FrameKeypoints
        Keypoints by person's id and frame number.
    person : int
        Id of the person to track.
    apart : mapping, optional
        Like `keypoints`, of people who have their own tracks.
    further : sequence of PersonKeypoints
        The same person in the films of further cameras.

    Attributes
    ----------
    ids : list of int
        Ids of the person: the one given, and those with which they came back.
    """

    def __init__(
        self,
        camera: Camera,
        keypoints: Mapping[int, Mapping[int, FrameKeypoints]],
        person: int,
        apart: Mapping[int, Mapping[int, FrameKeypoints]] | None = None,
        further: Sequence[PersonKeypoints] = (),
    ) -> None:
        self._camera, self._keypoints, self._apart, self.ids = camera, keypoints, apart or {}, [person]
        self._further = further
        self._asked: tuple[Frame, NDArray[np.float64]] | None = None
        self._expected = np.empty((0, 2))  # that estimate's joints in the picture
        self._known: dict[int, tuple[FrameKeypoints, float]] = {}  # distances from that estimate
        self._behind = False  # whether one of its joints is behind the camera
        self._listed: tuple[int, list[FrameKeypoints]] = -1, []  # a frame, and everyone's keypoints in it

    def add(self, id: int) -> None:
        """Add an id of this person."""
        if id not in self.ids:
            self.ids.append(id)

    def restart(self) -> None:
        """Do nothing: nothing is remembered from frame to frame."""

    def of_cameras(self, frame: Frame, last: Estimate | None) -> list[FrameKeypoints | None]:
        """Choose the person's keypoints in the picture of each camera, as `choose` does."""
        views = zip(self._further, frame.others, strict=False)
        return [
            self.choose(frame, last),
            *(None if view is None else one.choose(view, last) for one, view in views),
        ]

    def choose(self, frame: Frame, last: Estimate | None) -> FrameKeypoints | None:
        """Choose the person's keypoints in a frame, given the last estimate; None if there are none.

        Without an estimate, or if the person is lost, these are the keypoints with the person's ids.
        """
        if last is None or last.status == TrackStatus.LOST:
            return self._own(frame.number)
        near = [
            (self._distance(frame, last, keypoints), keypoints) for keypoints in self._found(frame.number)
        ]
        distance, keypoints = min(near, key=lambda pair: pair[0], default=(np.inf, None))
        return keypoints if distance < _GATE else None

    def near(self, frame: Frame, estimate: Estimate) -> bool | None:
        """Whether a person was found near the estimate; None if the person to track was not found at all.

        Also False if the only one found there has their own track.  The majority of cameras decides.
        """
        views = [one.near(view, estimate) for one, view in self._views(frame)]
        return _most([self._near(frame, estimate), *views])

    def _near(self, frame: Frame, estimate: Estimate) -> bool | None:
        """Answer the same for the first camera."""
        if any(
            self._distance(frame, estimate, keypoints) < _SUPPORTING_DISTANCE
            for keypoints in self._found(frame.number)
        ):
            return True
        return None if self._own(frame.number) is None and not self._taken(frame, estimate) else False

    def agree(self, frame: Frame, estimate: Estimate) -> bool | None:
        """Whether the keypoints in a frame, including the legs, agree with the estimate; None if none."""
        return _most(
            [self._agree(frame, estimate), *(one.agree(view, estimate) for one, view in self._views(frame))]
        )

    def _agree(self, frame: Frame, estimate: Estimate) -> bool | None:
        """Answer the same for the first camera."""
        if not self._found(frame.number):
            return False if self._taken(frame, estimate) else None
        keypoints = self.choose(frame, estimate)
        if keypoints is None:
            return False
        # the tracker judges left and right; a detector confuses them in single frames
        names = tuple(keypoints.names)
        swapped = replace(keypoints, names=tuple(names[k] for k in other_sides(names)))
        legs, most = (_LEGS, _STANDS) if not estimate.takes_strides else ((_LEGS[0] + _LEGS[1],), _AGREE)
        return any(
            all(
                not len(apart) or apart.mean() < most
                for apart in (self._distances(frame, estimate, one, leg) for leg in legs)
            )
            for one in (keypoints, swapped)
        )

    def faces(self, frame: Frame, estimate: Estimate) -> bool | None:
        """Whether the trunk in the keypoints faces as the estimate does; None if the view does not show it.

        False if left and right are swapped at shoulders and hips together.
        """
        return _most(
            [self._faces(frame, estimate), *(one.faces(view, estimate) for one, view in self._views(frame))]
        )

    def _faces(self, frame: Frame, estimate: Estimate) -> bool | None:
        """Answer the same for the first camera."""
        keypoints = self.choose(frame, estimate)
        if keypoints is None:
            return None
        theirs, ours = tuple(keypoints.names), estimate.joint_names
        expected = self.joints_in(frame, estimate)
        uv, sd = np.asarray(keypoints.uv, float), np.broadcast_to(keypoints.sd, len(theirs))
        same = []
        for pair in _TRUNK_PAIRS:
            if not (set(pair) <= set(theirs) and set(pair) <= set(ours)):
                return None
            (a, b), (c, d) = ([names.index(name) for name in pair] for names in (theirs, ours))
            found, wanted = uv[a] - uv[b], expected[c] - expected[d]
            if not (np.isfinite(found).all() and np.hypot(*wanted) > _APART * np.hypot(sd[a], sd[b])):
                return None
            same.append(float(found @ wanted) > 0)
        return any(same)

    def _views(self, frame: Frame) -> Iterator[tuple[PersonKeypoints, Frame]]:
        """Yield the views of further cameras at the time of a frame."""
        for one, view in zip(self._further, frame.others, strict=False):
            if view is not None:
                yield one, view

    def _taken(self, frame: Frame, estimate: Estimate) -> bool:
        """Whether a person who has their own track was found near the estimate."""
        there = (one[frame.number] for one in self._apart.values() if frame.number in one)
        return any(self._distance(frame, estimate, keypoints) < _SUPPORTING_DISTANCE for keypoints in there)

    def _own(self, frame: int) -> FrameKeypoints | None:
        """List the keypoints with the person's ids in a frame."""
        for id in self.ids:
            keypoints = self._keypoints.get(id, {}).get(frame)
            if keypoints is not None and np.isfinite(keypoints.uv).any():
                return keypoints
        return None

    def _found(self, frame: int) -> list[FrameKeypoints]:
        """List the keypoints of everyone in a frame."""
        if self._listed[0] != frame:
            people = (keypoints[frame] for keypoints in self._keypoints.values() if frame in keypoints)
            self._listed = frame, [keypoints for keypoints in people if np.isfinite(keypoints.uv).any()]
        return self._listed[1]

    def _distance(self, frame: Frame, estimate: Estimate, keypoints: FrameKeypoints) -> float:
        """Median distance from the estimated joints, person's heights; infinite if no joint was found."""
        self.joints_in(frame, estimate)
        if id(keypoints) not in self._known:
            apart = self._distances(frame, estimate, keypoints, tuple(keypoints.names))
            self._known[id(keypoints)] = keypoints, _median(apart) if len(apart) else np.inf
        return self._known[id(keypoints)][1]

    def joints_in(self, frame: Frame, estimate: Estimate) -> NDArray[np.float64]:
        """Project the estimated joints into a frame of the first camera, (J, 2) pixels; the last is kept."""
        asked = self._asked
        if asked is None or asked[1] is not estimate.joints or not _same_camera(asked[0], frame):
            self._asked, self._known = (frame, estimate.joints), {}
            self._expected = frame.camera(self._camera).project(estimate.joints)
            self._behind = bool(np.isnan(self._expected).any())
        return self._expected

    def _distances(
        self, frame: Frame, estimate: Estimate, keypoints: FrameKeypoints, names: tuple[str, ...]
    ) -> NDArray[np.float64]:
        """Distances (K,) of the named keypoints, where found, from the estimated joints, person's heights."""
        expected = self.joints_in(frame, estimate)
        if self._behind:
            return np.full(len(names), np.inf)
        of_ours, of_theirs = _in_common(names, estimate.joint_names, tuple(keypoints.names))
        ours, theirs = expected[of_ours], np.asarray(keypoints.uv, float)[of_theirs]
        found = np.isfinite(theirs).all(axis=1)
        if not found.all():
            ours, theirs = ours[found], theirs[found]
        if not len(ours):
            return np.empty(0)
        extent = [np.hypot(*(joints.max(axis=0) - joints.min(axis=0))) for joints in (ours, theirs)]
        # scaled, so that an estimate that is too large is not nearer than one of the right size
        tall = expected[:, 1].max() - expected[:, 1].min()
        height = tall * min(extent[1] / max(extent[0], 1e-9), 1.0)
        return np.asarray(np.hypot(*(ours - theirs).T) / max(height, 1.0))


@lru_cache
def _in_common(
    names: tuple[str, ...], ours: tuple[str, ...], theirs: tuple[str, ...]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return where those of `names` that both have are in `ours` and in `theirs`."""
    common = [name for name in names if name in theirs and name in ours]
    places = ([all_names.index(name) for name in common] for all_names in (ours, theirs))
    first, second = (np.array(place, np.intp) for place in places)
    return first, second


def _same_camera(one: Frame, other: Frame) -> bool:
    """Whether two frames certainly show the scene from the same place."""
    return one is other or (one.pose is None and other.pose is None)


def _median(values: NDArray[np.float64]) -> float:
    """Median of at least one number, as `numpy.median`, which takes longer for few."""
    ordered = sorted(values.tolist())
    middle = len(ordered) // 2
    return ordered[middle] if len(ordered) % 2 else (ordered[middle - 1] + ordered[middle]) / 2


def _most(answers: Sequence[bool | None]) -> bool | None:
    """Answer of at least half of the cameras that have one; None if none has."""
    known = [answer for answer in answers if answer is not None]
    return 2 * sum(known) >= len(known) if known else None
