"""Find people in a picture by their shape, without a network and without the empty scene.

OpenCV's HOG detector (Dalal and Triggs, CVPR 2005) computes from the gradients in a window a score for a
person. A window counts if a person who stands on the ground and fills it would have a plausible stature.  A
coarse search of the whole picture proposes people.  Around each of them the picture is searched again,
enlarged so that the person is larger than the smallest window, because windows around smaller people extend
too far beyond head and feet.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.bindings.start_fit import Box
from gait.io.video import Image
from gait.reproducible import one_opencv_thread

Array = NDArray[np.float64]
Stature = Callable[[Box], float]
"""Computes the stature of the person in a box, metres; NaN if the feet are not on the floor."""

SEARCHED_SIDES_PX = (420, 760)  # pixels; longer sides of the pictures searched, in this order
LEAST_PERSON_PX = 96  # pixels; smallest height of a person in the largest of them
_BORDER = 0.2  # of the picture's height, added above and below, as a window is larger than the person
_SIDE_MARGIN_PX = 16  # pixels added at the sides
_MOST_PEOPLE = 4  # most people proposed
_TALL = 120  # pixels; height of a person in the second search
_SEARCH_AREA = (0.75, 0.95)  # area searched around a person's middle, in heights: to each side, up and down
_THRESHOLD = -0.5  # least score of a window; many weak ones count too
_SHARP = 3.0  # nats per unit of the score
_HEAD_HEIGHT, _FOOT_HEIGHT = (
    0.125,
    0.86,
)  # position of crown and soles in a window, as fractions of its height
_STATURE, _RELATIVE_STATURE_SD = 1.68, 0.12  # metres
_LEAST_WINDOW_SCORE = 0.5  # least score of the best window around a person
_ENOUGH_NEAR = 0.0  # the same for a person who is expected there
_SAME_PERSON_FEET = 0.3  # heights between the feet in windows around the same person
_WINDOW_SD = 0.015  # heights; sd of a mean of windows from frame to frame
PLAUSIBLE = (1.2, 2.4)  #: metres; apparent statures of people, which shadows lengthen
_FLAT = 2.0  # grey levels; standard deviation below which a picture shows nothing


@functools.cache
def hog_detector() -> cv2.HOGDescriptor:
    """Return the detector of upright people, which is created once."""
    hog = cv2.HOGDescriptor()
    hog.setSVMDetector(np.array(cv2.HOGDescriptor.getDefaultPeopleDetector()))
    return hog


def find_people(image: Image, stature: Stature) -> list[Box]:
    """Find people who stand on the ground.

    Parameters
    ----------
    image : Image
    stature : Stature

    Returns
    -------
    people : list of Box
        The most certain first; people smaller than `LEAST_PERSON_PX` pixels are missed.
    """
    if image[::8, ::8].std() < _FLAT:
        return []
    larger = max(image.shape[:2])
    for side in SEARCHED_SIDES_PX:
        proposed = _groups(_search(image, np.zeros(2), image.shape[1::-1], min(1.0, side / larger), stature))
        near = (_nearby(image, box, stature, _LEAST_WINDOW_SCORE) for _, box in proposed[:_MOST_PEOPLE])
        found = sorted((one for one in near if one is not None), key=lambda one: -one[0])
        if found or side >= larger:
            return [box for n, (_, box) in enumerate(found) if not _known(box, found[:n])]
    return []


def _known(box: Box, found: list[tuple[float, Box]]) -> bool:
    """Whether a person is among those found already."""
    return any(np.hypot(*(box.foot - other.foot)) < _SAME_PERSON_FEET * box.tall for _, other in found)


def find_near(image: Image, box: Box, stature: Stature) -> Box | None:
    """Find the person whose box is near this one; None if no person stands there."""
    found = _nearby(image, box, stature, _ENOUGH_NEAR)
    return None if found is None else found[1]


def _nearby(image: Image, box: Box, stature: Stature, least: float) -> tuple[float, Box] | None:
    """Search the picture around a box again; return score and box of the person there, or None."""
    middle, reach = (box.foot + box.head) / 2, np.array(_SEARCH_AREA) * box.tall
    corner = middle - reach
    groups = _groups(_search(image, corner, tuple(2 * reach), _TALL / box.tall, stature))
    return groups[0] if groups and groups[0][0] >= least else None


def _search(
    image: Image, corner: Array, size: tuple[float, ...], scale: float, stature: Stature
) -> list[tuple[float, float, Box]]:
    """Find windows around people in a part of the picture at a scale: score, weight, person."""
    part, offset = _part(image, corner, size, scale)
    if np.any(np.array(part.shape[1::-1]) < hog_detector().winSize):  # OpenCV would read out of bounds
        return []
    with one_opencv_thread():
        windows, votes = hog_detector().detectMultiScale(
            part, hitThreshold=_THRESHOLD, winStride=(8, 8), scale=1.06, groupThreshold=0
        )
    found = []
    for window, vote in zip(windows, np.ravel(votes).tolist(), strict=True):
        place = np.array(window) / scale
        box = _box(place[0] + offset[0], place[1] + offset[1], place[2], place[3])
        tall = stature(box)
        if PLAUSIBLE[0] <= tall <= PLAUSIBLE[1]:
            off = (tall - _STATURE) / _RELATIVE_STATURE_SD
            found.append((vote, float(np.exp(_SHARP * vote - 0.5 * off * off)), box))
    return found


def _part(image: Image, corner: Array, size: tuple[float, ...], scale: float) -> tuple[Image, Array]:
    """Cut out and scale a part of a picture, with repeated pixels above and below; also return its corner."""
    height, width = image.shape[:2]
    x0, y0 = (max(0, int(c)) for c in corner)
    x1, y1 = min(width, int(corner[0] + size[0]) + 1), min(height, int(corner[1] + size[1]) + 1)
    offset = np.array([x0 - _SIDE_MARGIN_PX / scale, y0])
    if min(scale * (x1 - x0), scale * (y1 - y0)) < 1:
        return image[:0, :0], offset
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    small = cv2.resize(image[y0:y1, x0:x1], None, fx=scale, fy=scale, interpolation=how)
    border = round(_BORDER * small.shape[0])
    small = cv2.copyMakeBorder(small, border, border, _SIDE_MARGIN_PX, _SIDE_MARGIN_PX, cv2.BORDER_REPLICATE)
    return np.asarray(small, np.uint8), offset - np.array([0, border / scale])


def _box(x: float, y: float, width: float, height: float) -> Box:
    """Return the box of the person in a window."""
    middle = x + width / 2
    foot, head = np.array([middle, y + _FOOT_HEIGHT * height]), np.array([middle, y + _HEAD_HEIGHT * height])
    return Box(foot, head, _WINDOW_SD * height)


def _groups(windows: list[tuple[float, float, Box]]) -> list[tuple[float, Box]]:
    """Merge windows at the same position into one box with the largest score, greatest weight first."""
    left = sorted(windows, key=lambda window: -window[1])
    found = []
    while left:
        first = left[0][2]
        near = [one for one in left if np.hypot(*(one[2].foot - first.foot)) < _SAME_PERSON_FEET * first.tall]
        left = [one for one in left if np.hypot(*(one[2].foot - first.foot)) > first.tall]
        found.append((max(vote for vote, _, _ in near), _mean(near)))
    return found


def _mean(near: list[tuple[float, float, Box]]) -> Box:
    """Weighted mean of the boxes of windows."""
    weights = np.array([weight for _, weight, _ in near])
    foot = np.average([box.foot for _, _, box in near], axis=0, weights=weights)
    head = np.average([box.head for _, _, box in near], axis=0, weights=weights)
    return Box(foot, head, _WINDOW_SD * float(np.hypot(*(foot - head))))
