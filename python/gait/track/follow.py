"""Follow one person through a clip, also backwards from the start, and again after a loss."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gait.ahead import ahead
from gait.bindings.abi import Flag, TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.initial import DEFAULT_SD, Start
from gait.io.video import Frame, Image, Video
from gait.track.box_start import BoxStart
from gait.track.person_keypoints import PersonKeypoints
from gait.track.person_shapes import PersonShapes
from gait.track.plausible import Plausibility
from gait.track.tracker import Tracker

_LONGEST_GAP = 1.0  # seconds for which a lost person is still tracked backwards
_LEAST_BEFORE = 0.5  # seconds before a track that are worth searching for an earlier start
_CONTRADICTED = 0.5  # seconds of keypoints elsewhere after which the person is lost
_OPEN_PHASE = 0.2  # strides; sd of the phase from which a start does not determine left and right
_SETTLED_S = 0.2  # seconds of status `tracking` after which they are known
_SETTLES = 4.0  # seconds after a start within which that must happen
_DRAWS = 3  # draws of particles that must agree, if the phase is open
_SAME_SIDE = 0.2  # strides between phases that agree
_DISAGREE = "repeated starts disagree about left and right"

FindAgain = Callable[[int, int, float], Start | None]
"""Finds the first start in frames first <= number < stop, of a person with a stature [m]; None if none."""


class Decided(NamedTuple):
    """Where a draw of particles has decided left and right.

    Attributes
    ----------
    start : Start
        There.
    phase : float
        Where the draw began, by its rates in between, strides.
    """

    start: Start
    phase: float


class _Support:
    """The last frame, since a track's start, that supports it.

    Frames without keypoints support a track that is not contradicted, since the images decide there.  After a
    lasting contradiction only keypoints near the estimate do.
    """

    def __init__(self, frame: Frame) -> None:
        self.frame, self._time = frame.number, frame.time

    def contradicted(self, frame: Frame, near: bool | None) -> bool:
        """Add whether there are keypoints near the estimate; return whether there have long been none."""
        if near or (near is None and abs(frame.time - self._time) <= _CONTRADICTED):
            self.frame, self._time = frame.number, frame.time
        return abs(frame.time - self._time) > _CONTRADICTED


class Follower:
    """Follows one person through a video.

    Parameters
    ----------
    tracker : Tracker
    video : Video
        Video of the tracker's first camera; its frames contain those of the others.
    keypoints : PersonKeypoints or PersonShapes
    plausibility : Plausibility
        Judges the estimates.
    find_again : FindAgain
        Finds the person again after a loss, and in earlier frames.
    auto_start : BoxStart, optional
        Finds a lost person in the pictures.
    one_pass : bool
        Whether all estimates come from one forward pass, as the smoother needs; tracking backwards then only
        finds an earlier start.
    nearest_of : callable
        Returns who is nearest in each pixel of a frame, as `gait.track.other_people` numbers them.

    Attributes
    ----------
    step_seconds : list of float
        Time that each step spent in the C library, including steps of searches and backwards.
    """

    def __init__(
        self,
        tracker: Tracker,
        video: Video,
        keypoints: PersonKeypoints | PersonShapes,
        plausibility: Plausibility,
        find_again: FindAgain,
        auto_start: BoxStart | None = None,
        *,
        one_pass: bool = False,
        nearest_of: Callable[[Frame], Image | None] = lambda _: None,
    ) -> None:
        self._tracker, self._video, self._keypoints = tracker, video, keypoints
        self._plausibility = plausibility
        self._find_again, self._auto_start, self._one_pass = find_again, auto_start, one_pass
        self._nearest_of = nearest_of
        self._uncertain = False  # about left and right
        self.step_seconds: list[float] = []

    def follow(self, start: Start, frames: range) -> Iterator[tuple[Frame, Estimate]]:
        """Yield the frames in order, from the first in which the person is visible, each with its estimate.

        Estimates of frames before a start come from the tracker running backwards from it.
        """
        start = self._settled(start, frames)
        given, before = self._earlier(start, frames, frames.stop)
        first, before = self._first(given, before, frames)
        following: Start | None = first
        now: Estimate | None = None
        lost = True
        for frame in ahead(self._video.frames(min([first.frame, *before]), frames.stop)):
            if following is not None and frame.number == following.frame:
                if now is None or lost or following is given or not self._keypoints.near(frame, now):
                    self._start(self._tracker, following, frame.utime)
                    now, lost, support = None, False, _Support(frame)
                following = given if frame.number < given.frame else None
            elif now is None and lost:
                yield frame, before[frame.number]
                continue
            now = self._step(self._tracker, frame, frame.utime, now)
            contradicted = support.contradicted(frame, self._keypoints.near(frame, now))
            was_lost, lost = lost, contradicted or now.status == TrackStatus.LOST
            if lost and not was_lost:
                stop = frames.stop if following is None else following.frame
                found = self._find_again(frame.number + 1, stop, now.mean.stature)
                if found is not None:
                    following, more = self._earlier(found, range(frame.number + 1, frames.stop), stop)
                    before |= more
                self._plausibility.restart()  # it has judged another track, if one was found
            estimate = replace(now, status=TrackStatus.LOST) if lost else now
            yield frame, before.get(frame.number, estimate) if lost else estimate
            anew = self._auto_start.find_lost(frame, estimate.status) if self._auto_start else None
            if anew is not None:
                self._start(self._tracker, anew, frame.utime)
                now, lost, support = None, False, _Support(frame)

    def _settled(self, start: Start, frames: range) -> Start:
        """If a start leaves the phase open, move it to a frame where left and right are known.

        Several draws of particles decide; unless they agree, left and right stay uncertain throughout.
        """
        if start.sd.phase < _OPEN_PHASE:
            return start
        draws = [self._draw(start, frames, draw) for draw in range(_DRAWS)]
        found = [one for one in draws if one is not None]
        agreeing = [sum(_apart(one.phase, other.phase) < _SAME_SIDE for other in found) for one in found]
        self._uncertain = bool(found) and (len(found) < 2 or min(agreeing) < len(found))
        return found[int(np.argmax(agreeing))].start if found else start

    def _sided(self, start: Start, frames: range, stop: int) -> Start:
        """Decide left and right of a start with a known phase that was found in the clip.

        Its keypoints may be swapped throughout the second from which it was found, so the tracker leaves the
        sides open; one draw of particles decides.  The start is before frame `stop`.
        """
        if not start.hypotheses or start.sd.phase >= _OPEN_PHASE:
            return start
        decided = self._draw(start, frames, 0)
        found = start if decided is None else _with_side(start, decided)
        return found if found.frame < stop else start

    def _draw(self, start: Start, frames: range, draw: int) -> Decided | None:
        """Return where one draw of particles has decided; None if it does not soon."""
        config = self._tracker.config.replace(seed=self._tracker.config.seed ^ draw)
        later = ((frame, frame.utime) for frame in self._video.frames(start.frame, frames.stop))
        found = self._decided(self._tracker.like(config), start, later)
        if found is None and start.frame > frames.start:
            back = self._video.backwards(start.frame + 1, frames.start)
            earlier = ((frame, -frame.utime) for frame in back)
            found = self._decided(self._tracker.like(config.replace(reverse=1.0)), start, earlier)
        return found

    def _decided(self, tracker: Tracker, start: Start, frames: Iterator[tuple[Frame, int]]) -> Decided | None:
        """Return where a tracker has been `tracking` strides for a while; None if it is not soon.

        Standing shows neither the phase nor which leg is the right one.
        `frames`: with the tracker's time of each, microseconds.
        """
        now: Estimate | None = None
        since = begun = before = strides = 0.0
        for frame, utime in frames:
            if now is None:
                self._start(tracker, start, utime)
                since = begun = before = frame.time
            now = self._step(tracker, frame, utime, now)
            if now.takes_strides:
                direction = self._plausibility.directions[now.motion_class]
                strides += direction * now.mean.stride_hz * (frame.time - before)
            before = frame.time
            if now.status != TrackStatus.TRACKING or not now.takes_strides:
                since = frame.time
            if abs(frame.time - since) >= _SETTLED_S:
                return Decided(_start_from(now, frame.number, start), now.mean.phase - strides)
            if abs(frame.time - begun) > _SETTLES:
                break
        return None

    def _first(
        self, start: Start, before: dict[int, Estimate], frames: range
    ) -> tuple[Start, dict[int, Estimate]]:
        """Find an earlier start, if the person was in view earlier and then absent, or keep this one.

        `before`: estimates up to the start; `frames`: frames to track.
        """
        stop = min(before, default=start.frame)
        if stop - frames.start < _LEAST_BEFORE * self._video.fps:
            return start, before
        found = self._find_again(frames.start, stop, start.mean.stature)
        if found is None:
            return start, before
        found, more = self._earlier(found, frames, stop)
        return found, before | more

    def _step(self, tracker: Tracker, frame: Frame, utime: int, last: Estimate | None) -> Estimate:
        """Step with the person's keypoints, and judge the estimate."""
        joints = self._keypoints.of_cameras(frame, last)
        images = [frame.image, *(None if view is None else view.image for view in frame.others)]
        found = tracker.step(
            images, utime, joints, poses=frame.pose, backgrounds=frame.plate, people=self._nearest_of(frame)
        )
        now = self._plausibility.judged(frame, found)
        self.step_seconds.append(tracker.step_seconds)
        sure = now.status != TrackStatus.TRACKING or not self._uncertain
        return now if sure else replace(now, status=TrackStatus.AMBIGUOUS, reason=_DISAGREE)

    def _start(self, tracker: Tracker, start: Start, utime: int) -> None:
        if start.hypotheses:
            tracker.start_hypotheses(start.hypotheses, utime)
        else:
            tracker.start(start.mean, start.sd, utime)
        self._plausibility.restart()

    def _earlier(self, start: Start, frames: range, stop: int) -> tuple[Start, dict[int, Estimate]]:
        """Return where to start, before frame `stop`, and estimates from the first of `frames` to there."""
        start = self._sided(start, frames, stop)
        before = self._backwards(start, frames.start) if frames.start < start.frame else {}
        if not self._one_pass:
            return start, before
        sure = [number for number, now in before.items() if now.status == TrackStatus.TRACKING]
        return (_start_from(before[min(sure)], min(sure), start) if sure else start), {}

    def _backwards(self, start: Start, first: int) -> dict[int, Estimate]:
        """Track backwards from a start to `first`; return estimates by frame, while the person is visible."""
        config = self._tracker.config.replace(reverse=1.0)
        tracker = self._tracker.like(config)
        found: dict[int, Estimate] = {}
        keypoints = self._keypoints if isinstance(self._keypoints, PersonKeypoints) else None
        last, visible, earliest = None, np.inf, start.frame
        for frame in self._video.backwards(start.frame + 1, first):
            if last is None:
                self._start(tracker, start, -frame.utime)
                support = _Support(frame)
            last = self._step(tracker, frame, -frame.utime, last)
            found[frame.number] = replace(last, utime=frame.utime, frame=frame.number - start.frame)
            if keypoints is not None and support.contradicted(frame, keypoints.near(frame, last)):
                earliest = max(earliest, support.frame)  # before it the person is elsewhere
                break
            if last.status != TrackStatus.LOST and not last.flags & Flag.UNSUPPORTED:
                visible, earliest = frame.time, frame.number
            elif visible - frame.time > _LONGEST_GAP:
                break
        return {n: now for n, now in sorted(found.items()) if earliest <= n < start.frame}


def _apart(one: float, other: float) -> float:
    """Strides between two phases, 0 to 0.5."""
    return abs((other - one + 0.5) % 1 - 0.5)


def _with_side(start: Start, decided: Decided) -> Start:
    """Choose the most probable hypothesis of a start for a decided walk, with the decided side.

    Where no hypothesis walks in that direction and class at that phase or half a stride later, the start is
    where the walk was decided.
    """
    mean = decided.start.mean
    for one in start.hypotheses:
        same = one.in_place == start.in_place and one.mean.motion_class == mean.motion_class
        off = _apart(one.mean.phase, decided.phase)
        if same and np.cos(one.mean.heading - mean.heading) > 0 and abs(off - 0.25) > 0.25 - _SAME_SIDE:
            phase = one.mean.phase if off < 0.25 else (one.mean.phase + 0.5) % 1
            return replace(start, mean=replace(one.mean, phase=phase), sd=one.sd, hypotheses=())
    return decided.start


def _start_from(now: Estimate, frame: int, start: Start) -> Start:
    """Make a start from an estimate, with standard deviations at least those of a start given by a user."""
    sd = replace(
        now.sd,
        phase=max(now.sd.phase, DEFAULT_SD["phase"]),
        heading=max(now.sd.heading, DEFAULT_SD["heading_rad"]),
        stride_hz=max(now.sd.stride_hz, DEFAULT_SD["stride_hz"]),
        stature=max(now.sd.stature, DEFAULT_SD["stature_m"]),
        pelvis=np.maximum(now.sd.pelvis, DEFAULT_SD["pelvis"]),
    )
    return replace(start, frame=frame, mean=now.mean, sd=sd, hypotheses=())
