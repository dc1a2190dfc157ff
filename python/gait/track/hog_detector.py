"""See people without a background: OpenCV's detector of upright people, held against the camera.

Gradients of a window vote for a person (Dalal and Triggs, CVPR 2005).  Many windows do, among them smaller
ones about the upper half of a body.  So the picture is looked at first so small that only whole people fill a
window; of the windows those count between whose ends somebody on the ground would have a person's stature,
and the votes of those about one place are averaged.
"""

from __future__ import annotations

import functools
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.io.video import Image
from gait.track.person_detection import Sighting, standing

Array = NDArray[np.float64]

SIDES = (420, 570, 760)  # pixels, the larger side of the pictures looked at, in this order
LEAST = 96  # pixels that a person must be tall in the largest
_THRESHOLD = -0.5  # of a window's vote: weak ones count in numbers
_MARGIN = 0.125  # of the window above the head and below the feet, as the detector was trained
_STATURE, _STATURE_SD = 1.68, 0.12  # metres
_ENOUGH = 3.0  # votes in all for a person
_SAME = 0.3  # heights between the feet of windows about one person
_SPREAD = 0.04  # of a mean of windows, heights, found on walkers of known place


@functools.cache
def _detector() -> cv2.HOGDescriptor:
    hog = cv2.HOGDescriptor()
    hog.setSVMDetector(np.array(cv2.HOGDescriptor.getDefaultPeopleDetector()))
    return hog


def people(image: Image, camera: Camera) -> list[Sighting]:
    """Find people standing on the ground, the strongest first; those under `LEAST` pixels are not seen."""
    for side in SIDES:
        found = _people(image, min(1.0, side / max(image.shape[:2])), camera)
        if found or side >= max(image.shape[:2]):
            return found
    return []


def _people(image: Image, scale: float, camera: Camera) -> list[Sighting]:
    """People about as large as the detector's window in a picture at a scale, the strongest first."""
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1 else image
    boxes, votes = _detector().detectMultiScale(
        small, hitThreshold=_THRESHOLD, winStride=(4, 4), padding=(16, 16), scale=1.025, groupThreshold=0
    )
    pairs = zip(boxes, np.ravel(votes), strict=True)
    each = [_sighting(np.array(box) / scale, float(vote), camera) for box, vote in pairs]
    left = sorted((seen for seen in each if seen is not None), key=lambda seen: -seen.strength)
    found = []
    while left:
        first = left[0]
        near = [seen for seen in left if np.hypot(*(seen.foot - first.foot)) < _SAME * first.tall]
        left = [seen for seen in left if np.hypot(*(seen.foot - first.foot)) > first.tall]
        found.append(_mean(near, camera))
    sure = [seen for seen in found if seen is not None and seen.strength >= _ENOUGH]
    return sorted(sure, key=lambda seen: -seen.strength)


def _sighting(box: Array, vote: float, camera: Camera) -> Sighting | None:
    """One window (x, y, width, height); the strength says how likely it is by its vote and by the stature."""
    x, y, width, height = box
    foot = np.array([x + width / 2, y + (1 - _MARGIN) * height])
    head = np.array([x + width / 2, y + (_MARGIN - 0.02) * height])
    seen = standing(foot, head, camera, 1.0, _SPREAD)
    if seen is None:
        return None
    off = (seen.stature - _STATURE) / _STATURE_SD
    strength = float(np.exp(min(vote, 3.0) - 0.5 * off * off))
    return replace(seen, strength=strength)


def _mean(near: list[Sighting], camera: Camera) -> Sighting | None:
    share = np.array([seen.strength for seen in near])
    foot = np.average([seen.foot for seen in near], axis=0, weights=share)
    head = np.average([seen.head for seen in near], axis=0, weights=share)
    return standing(foot, head, camera, float(share.sum()), _SPREAD)
