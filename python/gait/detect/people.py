"""Find people and follow them from frame to frame by the detector, each with an id.

A person's crop comes from the landmarks of the frame before, extrapolated at their speed.  The person network
scans the whole picture at the start, when a person is lost, and every second to find new people.  A person
who comes back gets the old id if place and colours agree.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.detect import profile
from gait.detect.networks import JOINTS, Crop, LandmarkNetwork, Person, PersonNetwork, whole_picture
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.io.video import Frame, Image, Video

Array = NDArray[np.float64]

_LEAST_SCORE = 0.5  # of a person in a crop
_SCAN_PERIOD = 1.0  # seconds between two scans of the whole picture
_RETRY = 0.2  # the same while a person is lost or none was found
_FORGET = 10.0  # seconds after which a person who comes back gets a new id
_SAME = 0.25  # of a crop's side between the centres of crops about one person
_REACH = 0.5  # crop sides per second that a lost person may have moved, in addition to `_SAME`
_ALIKE = 0.5  # correlation of colours of one person
_MOST = 8  # people
_LEAST_FRAMES = 3  # in which a person must be found
_BINS = (16, 8)  # of hue and saturation
_TORSO = [list(JOINTS).index(name) for name in ("l_shoulder", "r_shoulder", "r_hip", "l_hip")]


@dataclass
class Followed:
    """A person over the frames so far."""

    id: int
    frames: list[int] = field(default_factory=list)
    """Numbers of the frames in which the person was found."""
    times: list[float] = field(default_factory=list)
    """Their times, seconds."""
    keypoints: list[Person] = field(default_factory=list)
    """Keypoints in these frames."""
    colours: NDArray[np.float32] | None = None
    """Histogram of the clothes on the trunk."""
    lost: bool = False

    def expected(self, time: float) -> Crop:
        """Crop at a time, moved on at the speed of the last two frames."""
        last = self.keypoints[-1].crop
        if len(self.keypoints) < 2 or self.lost:
            return last
        step = (last.centre - self.keypoints[-2].crop.centre) / (self.times[-1] - self.times[-2])
        return last._replace(centre=last.centre + (time - self.times[-1]) * step)


class PeopleDetector:
    """Finds and follows people in the frames of one camera.

    Parameters
    ----------
    network : str
        Landmark network: ``full``, ``lite`` or ``heavy``.
    most : int
        People followed at a time.

    Attributes
    ----------
    people : list of Followed
        Everyone found so far, in the order of their ids, which begin at 1.

    Raises
    ------
    UserError
        If the weights are absent or damaged.
    """

    def __init__(self, network: str = "full", most: int = _MOST) -> None:
        self._find = PersonNetwork()
        self._landmarks = LandmarkNetwork(network)
        self._most = most
        self._scanned = -np.inf
        self.people: list[Followed] = []

    def step(self, frame: Frame) -> list[tuple[Followed, Person]]:
        """Find the people of the next frame; people not returned were not found in it."""
        found: list[tuple[Followed, Person]] = []
        for one in self.people:
            if not one.lost:
                self._follow(one, frame, found)
        since = frame.time - self._scanned
        missing = not found or any(p.lost and frame.time - p.times[-1] < _SCAN_PERIOD for p in self.people)
        if since >= (_RETRY if missing else _SCAN_PERIOD):
            self._scanned = frame.time
            self._scan(frame, found)
        return found

    def _follow(self, one: Followed, frame: Frame, found: list[tuple[Followed, Person]]) -> None:
        """Find a person near the expected place; two people at one place are one."""
        person = self._landmarks(frame.image, one.expected(frame.time))
        one.lost = person.score < _LEAST_SCORE or any(_near(person.crop, p.crop) for _, p in found)
        if not one.lost:
            self._add(one, frame, person, found)

    def _scan(self, frame: Frame, found: list[tuple[Followed, Person]]) -> None:
        """Search the whole picture for people who are not followed."""
        crops = self._find(frame.image) or ([] if found else [whole_picture(frame.image)])
        for crop in crops:
            if len(found) >= self._most or any(_near(crop, p.crop) for _, p in found):
                continue
            person = self._landmarks(frame.image, crop)
            if person.score < _LEAST_SCORE or any(_near(person.crop, p.crop) for _, p in found):
                continue
            person = self._landmarks(frame.image, person.crop)  # once more, from a better crop
            if person.score >= _LEAST_SCORE:
                self._add(self._who(frame, person), frame, person, found)

    def _who(self, frame: Frame, person: Person) -> Followed:
        """Match a lost person by place and colours, or start a new one."""
        colours = _colours(frame.image, person)
        for one in sorted((p for p in self.people if p.lost), key=lambda p: -p.times[-1]):
            gap = frame.time - one.times[-1]
            off = np.hypot(*(person.crop.centre - one.keypoints[-1].crop.centre)) / person.crop.side
            if gap < _FORGET and off < _SAME + _REACH * gap and _alike(colours, one.colours):
                one.lost = False
                return one
        self.people.append(Followed(len(self.people) + 1))
        return self.people[-1]

    def _add(self, one: Followed, frame: Frame, person: Person, found: list[tuple[Followed, Person]]) -> None:
        """Add a person found in a frame to their track and to those found."""
        one.frames.append(frame.number)
        one.times.append(frame.time)
        one.keypoints.append(person)
        if one.colours is None or len(one.frames) % 10 == 0:
            one.colours = _colours(frame.image, person)
        found.append((one, person))


def detect(
    video: Video,
    network: str = "full",
    most: int = _MOST,
    *,
    first: int = 0,
    stop: int | None = None,
    update: Callable[[int], None] | None = None,
    correct: bool = True,
) -> dict[int, Keypoints]:
    """Find the keypoints of everyone in a video.

    Parameters
    ----------
    video : Video
    network : str
        ``full``, ``lite`` or ``heavy``.
    most : int
        People followed at a time.
    first, stop : int
        Frames to use.
    update : callable, optional
        Called with the number of frames done.
    correct : bool
        Move the joints to where the model has them, and give their errors (`gait.detect.profile`).

    Returns
    -------
    people : dict of int to Keypoints
        Keypoints by id, from the first to the last frame of each person; people found in fewer than three
        frames are left out.

    Raises
    ------
    UserError
        If the weights are absent or damaged, or the video cannot be read.
    """
    detector = PeopleDetector(network, most)
    times = {}
    for frame in video.frames(first, stop):
        detector.step(frame)
        times[frame.number] = frame.time
        if update is not None:
            update(frame.number - first + 1)
    people = {one.id: _keypoints(one, times) for one in detector.people if len(one.frames) >= _LEAST_FRAMES}
    return {id: profile.corrected(found, network) for id, found in people.items()} if correct else people


def _keypoints(one: Followed, times: dict[int, float]) -> Keypoints:
    """Keypoints of a person, NaN in frames where the person was not found."""
    frames = np.arange(one.frames[0], one.frames[-1] + 1)
    uv = np.full((len(frames), len(JOINTS), 2), np.nan)
    confidence = np.zeros(uv.shape[:2])
    rows = np.array(one.frames) - frames[0]
    uv[rows] = [person.uv for person in one.keypoints]
    confidence[rows] = [person.confidence for person in one.keypoints]
    time = np.array([times[int(n)] for n in frames])
    return Keypoints(frames, time, tuple(JOINTS), uv, confidence)


def height(keypoints: Keypoints) -> float:
    """Median height of a person in the picture, from shoulder to foot, pixels."""
    v = keypoints.uv[np.isfinite(keypoints.uv).all(axis=(1, 2)), :, 1]
    return float(np.median(np.ptp(v, axis=1)))


def require_length(video: Video) -> None:
    """Refuse a picture, or a video too short to find people in."""
    if video.count < _LEAST_FRAMES:
        frames = "1 frame" if video.count == 1 else f"{video.count} frames"
        raise UserError(f"{video.path}: has only {frames}; give a video of a second or more")


def require_person(people: dict[int, Keypoints], video: Video) -> None:
    """Refuse a video in which no person was found."""
    if not people:
        raise UserError(
            f"{video.path}: no person found; the whole body should be in view, 80 pixels or taller"
        )


def main_person(people: dict[int, Keypoints]) -> int:
    """Choose the main person of a clip: the one in view longest and tallest."""
    return max(people, key=lambda n: np.isfinite(people[n].uv[:, 0, 0]).sum() * height(people[n]))


def _near(a: Crop, b: Crop) -> bool:
    """Whether two crops lie about the same person."""
    return bool(np.hypot(*(a.centre - b.centre)) < _SAME * 0.5 * min(a.side, b.side))


def _colours(image: Image, person: Person) -> NDArray[np.float32]:
    """Histogram of hue and saturation on the trunk."""
    mask = np.zeros(image.shape[:2], np.uint8)
    cv2.fillConvexPoly(mask, cv2.convexHull(person.uv[_TORSO].astype(np.int32)), 255)
    hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
    histogram = cv2.calcHist([hsv], [0, 1], mask, list(_BINS), [0, 180, 0, 256])
    return np.asarray(histogram / max(float(histogram.sum()), 1.0), np.float32)


def _alike(a: NDArray[np.float32], b: NDArray[np.float32] | None) -> bool:
    """Whether two histograms may be of one person; True if one is unknown."""
    return b is None or cv2.compareHist(a, b, cv2.HISTCMP_CORREL) > _ALIKE
