"""Find people with the detector and follow them from frame to frame, each with an id.

A person's crop is predicted from the landmarks of earlier frames, at constant speed.  The person network
scans the whole picture at the start, when a person is lost, and every second to find new people.  Once it has
found someone new it stops, and goes on with smaller parts of the picture a little later.  If everyone is
wanted, it searches small parts too, and beside people found, but once a second only, even while one is lost.

People who meet in the picture are distinguished by their courses and the colours of their clothes: while two
are near each other, landmarks off a person's course belong to another person, and the person counts as
hidden. A person who comes back gets the old id if position and colours agree. If, after two people met, the
colours and feet of each agree better with the other for some frames, their ids are swapped.

If the empty scene is known, the landmarks of people who overlap are found one by one, without the others
(`gait.detect.overlaps`), and a person hidden by another is looked for in every frame.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gait.counts import count_of
from gait.detect import profile
from gait.detect.clothes import Colours, alike, colours_of
from gait.detect.networks import (
    LANDMARK_JOINTS,
    LEAST_SCORE,
    Crop,
    LandmarkNetwork,
    Person,
    PersonNetwork,
    whole_picture,
)
from gait.detect.overlaps import Mask, Overlaps, distinct, nearness, overlap, same_joints
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.io.video import Frame, Image, Video

Array = NDArray[np.float64]

_SCAN_PERIOD = 1.0  # seconds between scans of the whole picture
_RETRY = 0.2  # the same while a person is lost or none has been found, and after one was found
_FORGET = 60.0  # seconds after which a person who comes back gets a new id
_SAME_CROP = 0.25  # crop sides between the centres of crops around the same person
#: Crop sides per second by which a lost person may leave their course, in addition to `_SAME_CROP`.
_CROP_SPEED = 0.8
_BESIDE = 0.33  # crop sides from a person to the next of a group
_OVERLAPPING = 0.15  # the same if they overlap
_MAY_HIDE = 0.5  # crop sides from a person within which they may hide another
_LONGEST_HIDDEN = 2.0  # seconds for which a hidden person is looked for in every frame
_CLEAR = 0.7  # share of a person's area that others leave in view, with which they are on their own course
_FRONT = 0.95  # the same of a person in front of the others
_COURSE = 0.3  # seconds from which the speed on a course is computed
_CONTACT = 0.35  # crop sides; people closer than this may be mistaken for each other
_LONG_CONTACT = 1.0  # seconds, after which people walk together and their courses are computed afresh
_OFF_COURSE = (
    0.12,
    0.15,
)  # crop sides, and crop sides per second in contact, that a person may be off their course
#: Overlap of the colours of one person; 5 % of the frames of a film in sun and shade have less.
_COLOUR_OVERLAP = 0.6
_CLEAR_OVERLAP_GAIN = 0.1  # by which the overlap with another person's colours must be larger
_TRUNKS_APART = 0.1  # crop sides from which the trunks of two people do not overlap
_STANCE = 0.25  # seconds within which a foot is on the ground
_FEET = 3.0  # weight of a difference of feet in crop sides, beside that of overlaps of colours
_MOST_GAIN = 0.4  # by one frame, of what swapping two ids gains
#: Seconds since the last frame from which a frame counts in full, less if it is sooner: errors of clothes and
#: feet last longer than that.
_GAIN_TIME = 0.04
_SURELY_SWAPPED = 1.0  # sum of gains from which ids are swapped
_MOST_PEOPLE = 8  # people
_LEAST_FRAMES = 3  # frames in which a person must be found
_LEAST_FEET = 0.3  # seconds for which both ankles must be in view where feet are needed
_SAMPLE = 5  # frames between samples of colours


@dataclass
class Followed:
    """A person in the frames so far."""

    id: int
    frames: list[int] = field(default_factory=list)
    """Numbers of the frames in which the person was found."""
    times: list[float] = field(default_factory=list)
    """Their times, seconds."""
    keypoints: list[Person] = field(default_factory=list)
    """Keypoints in these frames."""
    colours: Colours | None = None
    """Mean over samples."""
    samples: int = 0
    """Number of samples of the colours."""
    count: int = 0
    """Number of frames in which the person was found, also of those left out by `forget`."""
    free: int = 0
    """Index of the last frame in which no other person was near, or hid them."""
    lost: bool = False
    foot: float | None = None
    """The same as `foot_of_late` before another person met this one."""

    def expected(self, time: float) -> Crop:
        """Predict the crop at a time from the speed of the last two frames, or, if lost, of the course."""
        last = self.keypoints[-1].crop
        if self.lost:
            return last._replace(centre=self.on_course(time))
        if len(self.keypoints) < 2:
            return last
        step = (last.centre - self.keypoints[-2].crop.centre) / (self.times[-1] - self.times[-2])
        return last._replace(centre=last.centre + (time - self.times[-1]) * step)

    def on_course(self, time: float) -> Array:
        """Predict the crop's centre at a time from the person's course before others were near."""
        free, begin = self.free, self._course_begin()
        centre, since = self.keypoints[free].crop.centre, self.keypoints[begin].crop.centre
        if not self.course_is_known():
            return centre
        speed = (centre - since) / (self.times[free] - self.times[begin])
        return np.asarray(centre + (time - self.times[free]) * speed)

    def foot_of_late(self) -> float:
        """Row of the lowest foot within the last stance, pixels."""
        latest_first = zip(reversed(self.times), reversed(self.keypoints), strict=True)
        stance = itertools.takewhile(lambda row: self.times[-1] - row[0] <= _STANCE, latest_first)
        return max(nearness(person.uv)[0] for _, person in stance)

    def _course_begin(self) -> int:
        """Index of the first frame from which the speed on the course is computed."""
        begin = self.free
        while begin > 0 and self.times[self.free] - self.times[begin - 1] <= _COURSE:
            begin -= 1
        return begin

    def joints_in(self, crop: Crop) -> Array:
        """Predict the landmarks (16, 2) in a crop: those last found, moved with it."""
        last = self.keypoints[-1]
        return np.asarray(last.uv + crop.centre - last.crop.centre)

    def course_is_known(self) -> bool:
        """Whether there is a speed on the course."""
        return self.times[self.free] - self.times[self._course_begin()] >= _COURSE / 2

    def forget(self) -> None:
        """Leave out frames that `expected` and `on_course` do not need any more."""
        begin = max(0, min(self._course_begin(), len(self.frames) - 2))
        for values in (self.frames, self.times, self.keypoints):
            del values[:begin]
        self.free -= begin

    def leaves_course(self, time: float, person: Person) -> bool:
        """Whether a detected person is too far from the course."""
        contact = time - self.times[self.free]
        return self.off_course(time, person) > _OFF_COURSE[0] + _OFF_COURSE[1] * contact

    def off_course(self, time: float, person: Person) -> float:
        """Distance of a detected person from the course, crop sides."""
        return float(np.hypot(*(person.crop.centre - self.on_course(time))) / person.crop.side)


class PeopleDetector:
    """Finds people and their 2-D joints in the frames of one camera, and follows them.

    ``gait detect --fetch`` downloads the networks.

    Parameters
    ----------
    network : str
        Landmark network: ``full``, ``lite`` or ``heavy``.
    most : int
        Most people followed at a time.
    everyone : bool
        Search the whole picture for small people even if larger ones were found.
    live : bool
        Keep only what later frames need, for a stream without end: `people` then lacks earlier frames, and
        people whose id will not come back; `keypoints` cannot be used.
    empty : image, optional
        The empty scene of a static camera, BGR, for finding people who overlap one by one.

    Attributes
    ----------
    people : list of Followed
        Everyone found so far, in order of their ids, which begin at 1.

    Raises
    ------
    UserError
        If the weights are missing or damaged.
    """

    def __init__(
        self,
        network: str = "full",
        most: int = _MOST_PEOPLE,
        everyone: bool = False,
        live: bool = False,
        empty: Image | None = None,
    ) -> None:
        self._network = network
        self._find = PersonNetwork()
        self._landmarks = LandmarkNetwork(network)
        self._overlaps = None if empty is None else Overlaps(empty, self._landmarks)
        self._most, self._everyone, self._live = most, everyone, live
        self._ids = itertools.count(1)
        self._scanned = self._scanned_for_all = -np.inf
        self._latest = -np.inf  # time of the last frame
        self._searched = 0  # sizes of parts that the last scan had searched when it found someone new
        #: Of two people near each other who may be swapped since a frame, the frame and how sure it is.
        self._met: dict[frozenset[int], tuple[int, float]] = {}
        self.people: list[Followed] = []

    def step(self, frame: Frame) -> list[tuple[Followed, Person]]:
        """Find the people of the next frame; people not returned were not found in it.

        Parameters
        ----------
        frame : Frame
            A frame as from `gait.Video`; number and time must increase.

        Returns
        -------
        list of (Followed, Person)
            The person, with an `id`, and the detector's joints in this frame: `uv` (16, 2), pixels, and
            `confidence` (16,), in the order of the names of `keypoints`.
        """
        if self._overlaps is not None:
            self._overlaps.see(frame.image)
        found: list[tuple[Followed, Person]] = []
        near = {one.id: self._others_near(one, frame.time) for one in self.people if not one.lost}
        located = self._located(frame)
        for one, person, hidden in sorted(located, key=lambda at: at[0].off_course(frame.time, at[1])):
            same = any(self._same(person, p) for _, p in found)  # two people at the same position are one
            strange = self._strange(one, frame, person, near[one.id], hidden)
            one.lost = person.score < LEAST_SCORE or same or strange
            if not one.lost:
                self._add(one, frame, person, near[one.id], hidden)
                found.append((one, person))
        self._add_new(frame, found, self._hidden_behind(found, frame.time))
        since = frame.time - self._scanned
        missing = not found or self._searched or any(self._just_lost(p, frame.time) for p in self.people)
        missing = missing or bool(self._hidden_behind(found, frame.time))
        if since >= (_RETRY if missing else _SCAN_PERIOD):
            self._scanned = frame.time
            self._searched = self._scan(frame, found)
        self._undo_swaps(frame, found)
        self._latest = frame.time
        if self._live:
            for one, _ in found:
                one.forget()
            self.people = [one for one in self.people if frame.time - one.times[-1] <= _FORGET]
            ids = {one.id for one in self.people}
            self._met = {pair: swapped for pair, swapped in self._met.items() if pair <= ids}
        return found

    def keypoints(self, times: Mapping[int, float] | Array, correct: bool = True) -> dict[int, Keypoints]:
        """Return the keypoints of everyone found so far.

        Parameters
        ----------
        times : mapping of int to float, or ndarray
            Seconds of each frame by its number, such as ``Video.times``.
        correct : bool
            Convert the detector's joints to the model's, and add their errors (`gait.detect.profile`).

        Returns
        -------
        people : dict of int to Keypoints
            Keypoints by id, from each person's first to last frame, NaN where not found; without people found
            in fewer than three frames.
        """
        people = {one.id: _keypoints(one, times) for one in self.people if len(one.frames) >= _LEAST_FRAMES}
        if not correct:
            return people
        return {id: profile.corrected(found, self._network) for id, found in people.items()}

    def _undo_swaps(self, frame: Frame, found: list[tuple[Followed, Person]]) -> None:
        """Swap the ids of two people who met, if clothes and feet show for some frames that they are wrong.

        This begins after the last frame in which both were found and nothing showed it.
        """
        meet: set[int] = set()
        share = min((frame.time - self._latest) / _GAIN_TIME, 1.0)
        for i, j in itertools.combinations(range(len(found)), 2):
            (one, a), (other, b) = found[i], found[j]
            pair, apart = _pair(one, other), _apart(a.crop, b.crop)
            if apart >= _CONTACT:
                self._met.pop(pair, None)
            elif apart < _TRUNKS_APART or pair in self._met:
                meet |= pair
                since, sure = self._met.get(pair, (frame.number, 0.0))
                if apart >= _TRUNKS_APART:
                    sure = max(sure + share * self._swap_gain(frame, found[i], found[j]), 0.0)
                self._met[pair] = (since if sure > 0 else frame.number, sure)
                if sure >= _SURELY_SWAPPED:
                    _swap(one, other, since)
                    found[i], found[j] = (one, b), (other, a)
                    self._met[pair] = (frame.number, 0.0)
        for one, _ in found:
            lost = [other for other in self._others_near(one, frame.time) if other.lost]
            for other in lost:
                self._met.setdefault(_pair(one, other), (other.frames[-1], 0.0))
            if not lost and one.id not in meet:
                one.foot = one.foot_of_late()

    @staticmethod
    def _swap_gain(frame: Frame, first: tuple[Followed, Person], second: tuple[Followed, Person]) -> float:
        """How much better the clothes and feet of two people in a frame agree with swapped ids."""
        (one, a), (other, b) = first, second
        gain = 0.0
        if one.colours is not None and other.colours is not None:
            of_a, of_b = colours_of(frame.image, a, None), colours_of(frame.image, b, None)
            gain += alike(of_a, other.colours) - alike(of_a, one.colours)
            gain += alike(of_b, one.colours) - alike(of_b, other.colours)
        if one.foot is not None and other.foot is not None:
            known, seen = one.foot - other.foot, nearness(a.uv)[0] - nearness(b.uv)[0]
            gain += _FEET * (abs(seen - known) - abs(seen + known)) / min(a.crop.side, b.crop.side)
        return float(np.clip(gain, -_MOST_GAIN, _MOST_GAIN))

    def _located(self, frame: Frame) -> list[tuple[Followed, Person, Mask | None]]:
        """Find the landmarks of everyone who is followed, and where others hide them.

        If the empty scene is known, the nearest people are found first.
        """
        followed = [one for one in self.people if not one.lost]
        crops = {one.id: one.expected(frame.time) for one in followed}
        if self._overlaps is None:
            return [(one, self._landmarks(frame.image, crops[one.id]), None) for one in followed]
        joints = {one.id: one.joints_in(crops[one.id]) for one in followed}
        located = []
        for one in sorted(followed, key=lambda one: nearness(joints[one.id]), reverse=True):
            beside = [
                joints[other.id]
                for other in followed
                if other is not one and overlap(crops[one.id], crops[other.id])
            ]
            person, hidden = self._overlaps.find(crops[one.id], joints[one.id], beside)
            if person.score >= LEAST_SCORE:
                joints[one.id] = person.uv
            located.append((one, person, hidden))
        return located

    def _hidden_behind(self, found: list[tuple[Followed, Person]], time: float) -> list[Crop]:
        """Predict the crops of people hidden by those found, if the empty scene is known."""
        if self._overlaps is None:
            return []
        return [one.expected(time) for one in self.people if self._is_behind(one, found, time)]

    @staticmethod
    def _is_behind(one: Followed, found: list[tuple[Followed, Person]], time: float) -> bool:
        """Whether a person lost of late may be hidden by those found."""
        if not one.lost or time - one.times[-1] >= _LONGEST_HIDDEN:
            return False
        crop = one.expected(time)
        return any(_apart(crop, p.crop) < _MAY_HIDE for _, p in found)

    def _same(self, a: Person, b: Person) -> bool:
        """Whether two sets of landmarks are of the same person; those of two who overlap differ in joints."""
        if self._overlaps is None and _apart(a.crop, b.crop) < _SAME_CROP / 2:
            return True
        return same_joints(a, b)

    def _others_near(self, one: Followed, time: float) -> list[Followed]:
        """List other people, in view or briefly hidden, who may be mistaken for a person."""
        place = one.expected(time)
        return [
            other
            for other in self.people
            if other is not one
            and time - other.times[-1] < _LONG_CONTACT
            and _apart(place, other.expected(time)) < _CONTACT
        ]

    def _strange(
        self, one: Followed, frame: Frame, person: Person, near: list[Followed], hidden: Mask | None
    ) -> bool:
        """Whether the person found in a crop is not the one that the crop was made for."""
        off = one.leaves_course(frame.time, person)
        if not (off or near):
            return False
        if near and self._in_view(person, hidden) > _FRONT:
            return off  # someone who comes out from behind may show on the trunk
        colours = colours_of(frame.image, person, hidden)
        own = alike(colours, one.colours)
        if near and self._overlaps is not None and hidden is None and own >= _COLOUR_OVERLAP:
            return off  # the others near are lost, and their clothes may be similar
        if near:
            known = [other.colours for other in near if other.colours is not None]
            return off or any(alike(colours, other) > own + _CLEAR_OVERLAP_GAIN for other in known)
        return own < _COLOUR_OVERLAP

    def _scan(self, frame: Frame, found: list[tuple[Followed, Person]]) -> int:
        """Search for people who are not followed, where people were hidden and in the picture.

        Parts of the picture are searched, then all of it as one crop, until landmarks confirm a person; if
        everyone is wanted, once a second, all parts and also beside people found, where the person network
        merges boxes of a group.  Returns how many sizes of parts it had searched by then, which the next scan
        leaves out, unless everyone is lost; 0: all.
        """
        time, searched = frame.time, self._searched if found else 0
        hidden = self._hidden_behind(found, time)
        everyone = self._everyone and time - self._scanned_for_all >= _SCAN_PERIOD
        if everyone:
            self._scanned_for_all, searched = time, 0
        self._add_new(frame, found, [p.expected(time) for p in self.people if self._just_lost(p, time)])
        near = [p for _, p in found if any(_apart(crop, p.crop) < _MAY_HIDE for crop in hidden)]
        self._add_new(frame, found, self._beside(near))
        parts = self._find(frame.image, small=everyone or not found)
        for size, crops in enumerate(parts, 1):
            if size <= searched:
                continue
            if self._add_new(frame, found, crops) and not everyone:
                return size
        if not found:
            self._add_new(frame, found, [whole_picture(frame.image)])
        if everyone:
            count = 0
            while count < len(found):  # also beside people found there
                count = len(found)
                self._add_new(frame, found, self._beside([one for _, one in found]))
        return 0

    def _beside(self, people: list[Person]) -> list[Crop]:
        """Make crops on either side of people."""
        shifts = (_BESIDE,) if self._overlaps is None else (_BESIDE, _OVERLAPPING)
        return [crop for one in people for shift in shifts for crop in _beside(one.crop, shift)]

    def _add_new(self, frame: Frame, found: list[tuple[Followed, Person]], crops: list[Crop]) -> bool:
        """Add people in crops who have not been found yet; return whether there is one."""
        count = len(found)
        for crop in crops:
            if len(found) >= self._most:
                break
            more = self._new(frame, found, crop)
            if more is None:
                continue
            again, new = more
            hidden = self._hidden_by(again, new)
            one = self._who(frame, new, hidden, found)
            if one is None:
                continue
            self._add(one, frame, new, [], hidden)
            found.append((one, new))
            self._replace(frame, found, again)
        return len(found) > count

    def _new(
        self, frame: Frame, found: list[tuple[Followed, Person]], crop: Crop
    ) -> tuple[list[Person], Person] | None:
        """Find a person in a crop who has not been found yet; also return those found.

        People who overlap the new person are found again, if the empty scene is known, unless that would take
        them off their course.
        """
        before = [p for _, p in found]
        if self._overlaps is not None:
            more = self._overlaps.find_one_more(before, crop)
            if more is None:
                return None
            again = [
                old if one.course_is_known() and one.leaves_course(frame.time, better) else better
                for (one, old), better in zip(found, more[0], strict=True)
            ]
            return (again, more[1]) if distinct([*again, more[1]]) else None
        if any(_apart(crop, p.crop) < _SAME_CROP / 2 for p in before):
            return None
        person = self._landmarks(frame.image, crop)
        if person.score < LEAST_SCORE or any(self._same(person, p) for p in before):
            return None
        person = self._landmarks(frame.image, person.crop)  # again, with a better crop
        if person.score < LEAST_SCORE or any(self._same(person, p) for p in before):
            return None
        return before, person

    def _replace(self, frame: Frame, found: list[tuple[Followed, Person]], again: list[Person]) -> None:
        """Replace the first people's observations in a frame by better ones, and new people's colours."""
        changed = [k for k, person in enumerate(again) if person is not found[k][1]]
        for k in changed:
            one = found[k][0]
            found[k], one.keypoints[-1] = (one, again[k]), again[k]
        for one, person in (found[k] for k in changed):
            if one.count == 1:
                one.colours, one.samples = None, 0
                hidden = self._hidden_by([p for _, p in found], person)
                self._sample_colours(one, frame, person, hidden)

    def _in_view(self, person: Person, hidden: Mask | None) -> float:
        """Share of a person that others leave in view; 0 if it is not known."""
        if self._overlaps is None or hidden is None:
            return 0.0
        return self._overlaps.part(person.uv, hidden)

    def _hidden_by(self, found: list[Person], person: Person) -> Mask | None:
        """Find where people found hide another; None if the empty scene is not known."""
        if self._overlaps is None:
            return None
        return self._overlaps.hidden(person.uv, [p.uv for p in found if p is not person])

    @staticmethod
    def _just_lost(one: Followed, time: float) -> bool:
        return one.lost and time - one.times[-1] < _SCAN_PERIOD

    def _who(
        self, frame: Frame, person: Person, hidden: Mask | None, found: list[tuple[Followed, Person]]
    ) -> Followed | None:
        """Find the lost person whose position and colours match, or create a new one.

        None if someone hidden by those found is expected there, in other colours: the joints may be of both.
        """
        colours = colours_of(frame.image, person, hidden)
        best, least, expected = None, np.inf, False
        for one in self.people:
            gap, agreement = frame.time - one.times[-1], alike(colours, one.colours)
            if not one.lost or gap > _FORGET:
                continue
            reach = _SAME_CROP + _CROP_SPEED * gap
            stayed = _apart(person.crop, one.keypoints[-1].crop) / reach
            off = min(one.off_course(frame.time, person) / reach, 0.5 + 0.5 * stayed)  # few people stop
            known = colours is not None and one.colours is not None
            if off < 1 and agreement >= _COLOUR_OVERLAP and (known or gap <= _LONGEST_HIDDEN):
                if off - agreement < least:
                    best, least = one, off - agreement
            elif off < 1 and self._is_behind(one, found, frame.time):
                expected = True
        if best is None and expected:
            return None
        if best is None:
            best = Followed(next(self._ids))
            self.people.append(best)
        best.lost = False
        return best

    def _add(
        self, one: Followed, frame: Frame, person: Person, near: list[Followed], hidden: Mask | None
    ) -> None:
        """Append a person's observation in a frame."""
        one.frames.append(frame.number)
        one.times.append(frame.time)
        one.keypoints.append(person)
        one.count += 1
        free = not near or frame.time - one.times[one.free] > _LONG_CONTACT
        if self._overlaps is not None and not free:
            free = self._in_view(person, hidden) >= _CLEAR or not one.course_is_known()
        if free:
            one.free = len(one.frames) - 1
        if one.colours is None or (not near and one.count % _SAMPLE == 0):
            self._sample_colours(one, frame, person, hidden)

    @staticmethod
    def _sample_colours(one: Followed, frame: Frame, person: Person, hidden: Mask | None) -> None:
        """Add a sample to the mean of a person's colours, if their trunk is in view."""
        colours = colours_of(frame.image, person, hidden)
        if colours is None:
            return
        one.samples += 1
        if one.colours is None:
            one.colours = colours
        else:
            one.colours = one.colours + (colours - one.colours) / np.float32(one.samples)


def detect(
    video: Video,
    network: str = "full",
    most: int = _MOST_PEOPLE,
    *,
    first: int = 0,
    stop: int | None = None,
    update: Callable[[int], None] | None = None,
    correct: bool = True,
    everyone: bool = False,
    empty: Image | None = None,
) -> dict[int, Keypoints]:
    """Find the keypoints of everyone in a video.

    Parameters
    ----------
    video : Video
    network : str
        ``full``, ``lite`` or ``heavy``.
    most : int
        Most people followed at a time.
    first, stop : int
        Frames to use.
    update : callable, optional
        Called with the number of frames done.
    correct : bool
        As in `PeopleDetector.keypoints`.
    everyone : bool
        Search the whole picture for small people even if larger ones were found.
    empty : image, optional
        As in `PeopleDetector`.

    Returns
    -------
    people : dict of int to Keypoints
        As from `PeopleDetector.keypoints`.

    Raises
    ------
    UserError
        If the weights are missing or damaged, or the video cannot be read.
    """
    detector = PeopleDetector(network, most, everyone, empty=empty)
    times = {}
    for frame in video.frames(first, stop):
        detector.step(frame)
        times[frame.number] = frame.time
        if update is not None:
            update(frame.number - first + 1)
    return detector.keypoints(times, correct)


def _keypoints(one: Followed, times: Mapping[int, float] | Array) -> Keypoints:
    """Make the keypoints of a person, NaN in frames where the person was not found."""
    frames = np.arange(one.frames[0], one.frames[-1] + 1)
    uv = np.full((len(frames), len(LANDMARK_JOINTS), 2), np.nan)
    confidence = np.zeros(uv.shape[:2])
    rows = np.array(one.frames) - frames[0]
    uv[rows] = [person.uv for person in one.keypoints]
    confidence[rows] = [person.confidence for person in one.keypoints]
    time = np.array([times[int(n)] for n in frames])
    return Keypoints(frames, time, tuple(LANDMARK_JOINTS), uv, confidence)


def height(keypoints: Keypoints) -> float:
    """Median height of a person in the picture, from shoulder to foot, pixels."""
    v = keypoints.uv[np.isfinite(keypoints.uv).all(axis=(1, 2)), :, 1]
    return float(np.median(np.ptp(v, axis=1)))


def require_length(video: Video, frames: range) -> None:
    """Raise UserError for a picture, or if too few frames of a video are used to find people."""
    if len(frames) >= _LEAST_FRAMES:
        return
    few = count_of(len(frames), "frame")
    if len(frames) < video.count:
        of = f"only {few} of {video.count} left, from {frames.start} on"
        raise UserError(f"{video.path}: {of}; give at least a second by --start and --stop")
    raise UserError(f"{video.path}: has only {few}; give a video of at least a second")


def require_person(people: dict[int, Keypoints], video: Video) -> None:
    """Raise UserError if no person was found in a video."""
    if not people:
        raise UserError(
            f"{video.path}: no person found; the whole body should be in view, 80 pixels or taller"
        )


def require_feet(keypoints: Keypoints, video: Video) -> None:
    """Raise UserError if a person's feet are not visible long enough for a start or a camera."""
    ankles = keypoints.uv[:, [j for j, name in enumerate(keypoints.names) if name.endswith("_ankle")]]
    inside = ((ankles >= 0) & (ankles <= np.array(video.size) - 1)).all(axis=(1, 2))
    if inside.sum() < _LEAST_FEET * video.fps:
        raise UserError(
            f"{video.path}: the person's feet are not in view for {_LEAST_FEET} s; film the whole person, "
            "feet included, for at least a second"
        )


def by_size(people: dict[int, Keypoints]) -> list[int]:
    """Sort the people of a clip by frames in view times height in the picture, the largest first."""
    return sorted(people, key=lambda n: -np.isfinite(people[n].uv[:, 0, 0]).sum() * height(people[n]))


def main_person(people: dict[int, Keypoints]) -> int:
    """Choose the main person of a clip: the first in `by_size`."""
    return by_size(people)[0]


def _apart(a: Crop, b: Crop) -> float:
    """Distance between the centres of two crops, in sides of the smaller one."""
    return float(np.hypot(*(a.centre - b.centre)) / min(a.side, b.side))


def _pair(one: Followed, other: Followed) -> frozenset[int]:
    return frozenset((one.id, other.id))


def _swap(one: Followed, other: Followed, since: int) -> None:
    """Swap the observations of two people after a frame."""
    first, second = (sum(number <= since for number in who.frames) for who in (one, other))
    one.frames[first:], other.frames[second:] = other.frames[second:], one.frames[first:]
    one.times[first:], other.times[second:] = other.times[second:], one.times[first:]
    one.keypoints[first:], other.keypoints[second:] = other.keypoints[second:], one.keypoints[first:]
    one.free, other.free = len(one.frames) - 1, len(other.frames) - 1


def _beside(crop: Crop, shift: float) -> list[Crop]:
    """Make the crops of two people of the same size who walk to the left and to the right of one."""
    aside = np.array([shift * crop.side, 0.0])
    return [crop._replace(centre=crop.centre + shift) for shift in (-aside, aside)]
