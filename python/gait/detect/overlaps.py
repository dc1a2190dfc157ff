"""Landmarks of people who overlap in the picture of a static camera whose empty scene is known.

A landmark network that sees one person beside another finds joints of both.  Before it looks for a person,
the empty scene is put in place of the others, where these are nearer.  People whose boxes are one, and those
who come out from behind another, are found in what then remains in front of the empty scene.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.detect.networks import LANDMARK_JOINTS, LEAST_SCORE, Crop, Person
from gait.detect.outline import draw_person
from gait.errors import UserError
from gait.io.video import Image

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
"""Pixels of the picture (h, w) in which others hide a person."""

_LEAST_DIFFERENCE = 20  # grey levels by which the foreground differs from the empty scene in some channel
_LEAST_PART = 0.2  # of a person's area that must not be hidden
_LEAST_FOREGROUND = 0.4  # share of that part that must be foreground
_LEAST_GAIN = 0.3  # share of a new person's area that is foreground and that no one else covers
_LEAST_REMAINS = 0.12  # share of the middle of a crop that must be foreground of no one found so far
_ROUNDS = 2  # in which a new person and those beside them are found in turn
_REACH = 1.0  # crop sides; people further apart do not overlap
_SAME_JOINTS = 1 / 16  # crop sides; median distance of joints up to which two people are one


class Overlaps:
    """Finds landmarks of people, each without the others.

    Parameters
    ----------
    empty : image
        The empty scene, BGR.
    landmarks : callable
        Finds the person in a crop of a picture, as `LandmarkNetwork` does.

    Raises
    ------
    UserError
        If the empty scene is not in colour.
    """

    def __init__(self, empty: Image, landmarks: Callable[[Image, Crop], Person]) -> None:
        if empty.ndim != 3 or empty.shape[2] != 3:
            raise UserError(f"the empty scene must be a BGR picture (h, w, 3), not {empty.shape}")
        self._empty, self._landmarks = empty, landmarks
        self._smooth = cv2.blur(empty, (3, 3))
        self._image = empty
        self._foreground: Mask = np.zeros(empty.shape[:2], bool)
        self._outlines: dict[bytes, Mask] = {}  # of people in this picture, by their joints

    def see(self, image: Image) -> None:
        """Go on to the next picture.

        Raises
        ------
        UserError
            If it has another size than the empty scene.
        """
        if image.shape != self._empty.shape:
            raise UserError(
                "the empty scene and the pictures differ in size; give a background of this camera"
            )
        self._image = image
        self._outlines.clear()
        blue, green, red = cv2.split(cv2.absdiff(cv2.blur(image, (3, 3)), self._smooth))
        self._foreground = cv2.max(cv2.max(blue, green), red) > _LEAST_DIFFERENCE

    def find(self, crop: Crop, own: Array | None, others: Sequence[Array]) -> tuple[Person, Mask | None]:
        """Find the landmarks of the person in a crop, and where others hide them.

        A person who is hardly visible, or not in front of the empty scene, has score 0.

        Parameters
        ----------
        crop : Crop
        own : ndarray of shape (16, 2), optional
            Expected joints; by default the person is taken to be behind the others.
        others : sequence of ndarray of shape (16, 2)
            Joints of people who may hide them.
        """
        if not others:
            return self._landmarks(self._image, crop), None
        hidden = self.hidden(own, others)
        picture = self._image.copy()
        cv2.copyTo(self._empty, hidden.view(np.uint8), picture)
        person = self._landmarks(picture, crop)
        if own is not None:
            hidden = self.hidden(person.uv, others)
        area = self._area([person.uv])
        visible = area & ~hidden
        shown = np.count_nonzero(visible)
        foreground = np.count_nonzero(visible & self._foreground)
        if shown < _LEAST_PART * np.count_nonzero(area) or foreground < _LEAST_FOREGROUND * shown:
            person = person._replace(score=0.0)
        return person, hidden

    def find_one_more(self, people: Sequence[Person], crop: Crop) -> tuple[list[Person], Person] | None:
        """Find another person in a crop, and find those beside them again; None if there is no one else.

        Returns
        -------
        people : list of Person
            As given, those beside the new person without them.
        person : Person
            The new one.
        """
        joints = [one.uv for one in people]
        if people and not self._remains(joints, crop):
            if any(overlap(one.crop, crop) for one in people):
                return None
            joints = []  # perhaps someone who is in the empty scene, and not hidden
        new, _ = self.find(crop, None, joints)
        if new.score < LEAST_SCORE:
            return None
        near = [k for k, one in enumerate(people) if overlap(one.crop, new.crop)]
        found = [*(people[k] for k in near), new]
        for _ in range(_ROUNDS if near else 1):
            for k in sorted(range(len(found)), key=lambda k: nearness(found[k].uv), reverse=True):
                others = [one.uv for j, one in enumerate(found) if j != k]
                found[k], _ = self.find(found[k].crop, found[k].uv, others)
                if found[k].score < LEAST_SCORE:
                    return None
        new = found.pop()
        again = list(people)
        for k, one in zip(near, found, strict=True):
            again[k] = one
        if not distinct([*again, new]):
            return None
        before = self._area([people[k].uv for k in near])
        after = self._area([one.uv for one in (*found, new)])
        gain = int((after & self._foreground).sum()) - int((before & self._foreground).sum())
        if near and gain < _LEAST_GAIN * self._area([new.uv]).sum():
            return None
        return again, new

    def hidden(self, own: Array | None, others: Sequence[Array]) -> Mask:
        """Find the pixels (h, w) in which one of the others is nearer than a person with joints `own`.

        On level ground nearer feet are lower in the picture.
        """
        if own is None:
            return self._area(others)
        behind = [uv for uv in others if nearness(uv) < nearness(own)]
        nearer = [uv for uv in others if nearness(uv) >= nearness(own)]
        return self._area(behind) & ~self._area([own]) | self._area(nearer)

    def part(self, uv: Array, hidden: Mask) -> float:
        """Return the share of a person's area that is not hidden."""
        area = self._area([uv])
        return float((area & ~hidden).sum() / max(int(area.sum()), 1))

    def _area(self, people: Sequence[Array]) -> Mask:
        """Find the pixels (h, w) that people with these joints cover."""
        area = np.zeros(self._foreground.shape, bool)
        for uv in people:
            area |= self._outline(uv)
        return area

    def _outline(self, uv: Array) -> Mask:
        """Find the pixels (h, w) that a person with these joints covers."""
        key = uv.tobytes()
        if key not in self._outlines:
            canvas = np.zeros(self._foreground.shape, np.uint8)
            draw_person(canvas, dict(zip(LANDMARK_JOINTS, uv, strict=True)), 1)
            self._outlines[key] = canvas.view(bool)
        return self._outlines[key]

    def _remains(self, people: Sequence[Array], crop: Crop) -> bool:
        """Whether enough of a crop's middle in the picture is foreground that no one covers."""
        left, top = (max(int(at - crop.side / 4), 0) for at in crop.centre)
        right, bottom = (max(int(at + crop.side / 4), 0) for at in crop.centre)
        middle = (slice(top, bottom), slice(left, right))
        remains = self._foreground[middle] & ~self._area(people)[middle]
        return bool(remains.sum() > _LEAST_REMAINS * remains.size)


def overlap(a: Crop, b: Crop) -> bool:
    """Whether the people in two crops may overlap."""
    return bool(np.hypot(*(a.centre - b.centre)) < _REACH * min(a.side, b.side))


def same_joints(a: Person, b: Person) -> bool:
    """Whether the landmarks of two people are at the same place."""
    off = np.median(np.hypot(*(a.uv - b.uv).T))
    return bool(off < _SAME_JOINTS * min(a.crop.side, b.crop.side))


def distinct(people: Sequence[Person]) -> bool:
    """Whether no two of these people are at the same place."""
    return not any(same_joints(a, b) for a, b in combinations(people, 2))


def nearness(uv: Array) -> tuple[float, float]:
    """Row of the lowest joint of a person (16, 2), then the mean column, which decides between equal rows."""
    return float(uv[:, 1].max()), float(uv[:, 0].mean())
