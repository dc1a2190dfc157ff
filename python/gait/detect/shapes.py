"""Find people in a picture by their shape, without a network and without the empty scene.

The HOG detector of OpenCV (Dalal and Triggs, CVPR 2005) lets gradients of a window vote for a person.  Many
windows do, among them smaller ones about the upper half of a body, so the picture is searched first at a size
at which only whole people fill a window.  Windows count if a person on the ground between their ends would
have a plausible stature; the votes of windows about one place are averaged.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.bindings.start_fit import Box
from gait.io.video import Image

Array = NDArray[np.float64]
Stature = Callable[[Box], float]
"""Stature of the person in a box, metres; NaN where there is no floor."""

SIDES = (420, 570, 760)  # pixels, the larger side of the pictures looked at, in this order
LEAST = 96  # pixels that a person must be tall in the largest
_THRESHOLD = -0.5  # of a window's vote: weak ones count in numbers
_MARGIN = 0.125  # of the window above the head and below the feet, as the detector was trained
_STATURE, _STATURE_SD = 1.68, 0.12  # metres
_ENOUGH = 3.0  # votes in all for a person
_SAME = 0.3  # heights between the feet of windows about one person
_WINDOW_SD = 0.015  # of a mean of windows, heights, from frame to frame
PLAUSIBLE = (1.2, 2.4)  #: metres: apparent statures of people, which shadows lengthen
_FLAT = 2.0  # grey levels: standard deviation of a picture that shows nothing


@functools.cache
def _detector() -> cv2.HOGDescriptor:
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
        The most certain first; people under `LEAST` pixels are missed.
    """
    if image[::8, ::8].std() < _FLAT:
        return []
    for side in SIDES:
        found = _find_at_scale(image, min(1.0, side / max(image.shape[:2])), stature)
        if found or side >= max(image.shape[:2]):
            return found
    return []


def _find_at_scale(image: Image, scale: float, stature: Stature) -> list[Box]:
    """People about as large as the detector's window in a picture at a scale, the most certain first."""
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1 else image
    windows, votes = _detector().detectMultiScale(
        small, hitThreshold=_THRESHOLD, winStride=(4, 4), padding=(16, 16), scale=1.025, groupThreshold=0
    )
    pairs = zip(windows, np.ravel(votes), strict=True)
    each = [_box(np.array(window) / scale, float(vote), stature) for window, vote in pairs]
    left = sorted(((vote, box) for vote, box in each if vote > 0), key=lambda item: -item[0])
    found = []
    while left:
        first = left[0][1]
        near = [item for item in left if np.hypot(*(item[1].foot - first.foot)) < _SAME * first.tall]
        left = [item for item in left if np.hypot(*(item[1].foot - first.foot)) > first.tall]
        found.append(_mean(near))
    sure = sorted((item for item in found if item[0] >= _ENOUGH), key=lambda item: -item[0])
    return [box for _, box in sure]


def _box(window: Array, vote: float, stature: Stature) -> tuple[float, Box]:
    """Person in a window (x, y, width, height), and the vote for them, weighted by a plausible stature."""
    x, y, width, height = window
    foot = np.array([x + width / 2, y + (1 - _MARGIN) * height])
    head = np.array([x + width / 2, y + (_MARGIN - 0.02) * height])
    box = Box(foot, head, _WINDOW_SD * height)
    tall = stature(box)
    if not PLAUSIBLE[0] <= tall <= PLAUSIBLE[1]:
        return 0.0, box
    off = (tall - _STATURE) / _STATURE_SD
    return float(np.exp(min(vote, 3.0) - 0.5 * off * off)), box


def _mean(near: list[tuple[float, Box]]) -> tuple[float, Box]:
    """Mean of the boxes about one person, weighted by their votes, and the votes in all."""
    share = np.array([vote for vote, _ in near])
    foot = np.average([box.foot for _, box in near], axis=0, weights=share)
    head = np.average([box.head for _, box in near], axis=0, weights=share)
    return float(share.sum()), Box(foot, head, _WINDOW_SD * float(np.hypot(*(foot - head))))
