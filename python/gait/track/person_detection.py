"""Detect people in a frame: by change against the empty scene, or without one by their shape (HOG).

Changed pixels give blobs of a person's size, with a place on the ground and a stature.  The HOG detector of
OpenCV (Dalal and Triggs, CVPR 2005) lets gradients of a window vote for a person.  Many windows do, among
them smaller ones about the upper half of a body, so the picture is searched first at a size at which only
whole people fill a window.  Windows count if a person on the ground between their ends would have a
plausible stature; the votes of windows about one place are averaged.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.io.video import Image

Array = NDArray[np.float64]

STATURE = (1.2, 2.4)  # metres by foot and head ray alone, so with a margin for shadows
_GREY_STEP = 14.0  # least difference from the plate that counts, grey levels
_NOISE_STEPS = 5.0  # and in robust standard deviations of the picture's noise
_ANOTHER = 18.0  # grey levels by which half of a picture differs from the plate of another scene, at least
_COLOUR = 4.0  # grey levels between the channels of half of a picture in colour, at least
_FILL = 0.15  # a standing person covers at least this share of the box round it


@dataclass(frozen=True)
class Detection:
    """A person, or something like one, standing on the ground.

    Attributes
    ----------
    foot, head : ndarray of shape (2,)
        Lowest and highest point on the middle line, pixels.
    place : ndarray of shape (3,)
        Where the ray of `foot` meets the ground, metres.
    stature : float
        Height of the head ray over `place`, metres.
    strength : float
        Pixels of a blob, or votes of the HOG detector.
    sd : float
        Standard deviation of `foot` and `head` beyond a pixel or two, as a share of the person's height.
    """

    foot: Array
    head: Array
    place: Array
    stature: float
    strength: float
    sd: float = 0.0

    @property
    def tall(self) -> float:
        """Height in the picture, pixels."""
        return float(self.foot[1] - self.head[1])


def _change(image: Image, plate: Image) -> Array:
    """Largest difference (h, w) of the channels of two BGR pictures, without exposure, in grey levels."""
    step = image.astype(np.float32) - plate
    step -= np.median(step[::4, ::4], axis=(0, 1))  # exposure: most of the picture is background
    return np.asarray(cv2.GaussianBlur(np.abs(step).max(axis=2), (0, 0), 1.2), np.float64)


def another_scene(image: Image, plate: Image) -> bool:
    """Whether half of a picture differs from the plate: another scene, or the camera has moved."""
    return bool(np.median(_change(image, plate)[::4, ::4]) > _ANOTHER)


def one_is_grey(image: Image, plate: Image) -> bool:
    """Whether one of two BGR pictures is grey throughout and the other in colour."""
    colour = [float(np.median(np.ptp(one[::4, ::4], axis=2))) for one in (image, plate)]
    return min(colour) == 0 and max(colour) > _COLOUR


def foreground(image: Image, plate: Image) -> NDArray[np.uint8]:
    """Mask (h, w), 255 where a BGR picture differs from the plate by more than noise and exposure explain."""
    change = _change(image, plate)
    noise = 1.4826 * float(np.median(change[::4, ::4]))
    mask = (change > max(_GREY_STEP, _NOISE_STEPS * noise)).astype(np.uint8) * 255
    reach = max(3, image.shape[0] // 90) | 1  # joins what low contrast tears apart, mostly at neck and knees
    opened = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    return np.asarray(
        cv2.morphologyEx(opened, cv2.MORPH_CLOSE, np.ones((3 * reach, reach), np.uint8)), np.uint8
    )


def detect_change(
    image: Image, plate: Image, camera: Camera, misplaced: list[float] | None = None
) -> list[Detection]:
    """Find blobs of a person's size that stand on the ground in full view, largest first.

    If the camera gives blobs of a person's shape an implausible stature, that of the largest is appended to
    `misplaced`.
    """
    mask = foreground(image, plate)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    found, others = [], []
    for i in range(1, count):
        x, y, width, height, area = (int(value) for value in stats[i])
        inside = x > 1 and y > 1 and x + width < camera.width - 1 and y + height < camera.height - 1
        if inside and height > 30 and height > width and area > _FILL * width * height:
            blob = labels[y : y + height, x : x + width] == i
            foot, head = _ends(blob, x, y)
            one = person_between(foot, head, camera, area)
            if one is not None:
                found.append(one)
            else:
                others.append((area, _stature(foot, head, camera)))
    if misplaced is not None and others:
        misplaced.append(max(others)[1])
    return sorted(found, key=lambda one: -one.strength)


def _ends(blob: NDArray[np.bool_], x: int, y: int) -> tuple[Array, Array]:
    """Pixels of foot and head of a blob whose box begins at (x, y)."""
    height = len(blob)
    columns = np.nonzero(blob)[1]
    middle = x + float(np.median(columns))
    crown = np.nonzero(blob[: max(1, height // 10)])[1]
    foot = np.array([middle, y + height - 0.5])
    head = np.array([x + float(np.median(crown)), y - 0.5])
    return foot, head


def person_between(
    foot: Array, head: Array, camera: Camera, strength: float, sd: float = 0.0
) -> Detection | None:
    """Person between two pixels; None if no person of plausible stature can stand there."""
    stature = _stature(foot, head, camera)
    if not STATURE[0] <= stature <= STATURE[1]:
        return None
    return Detection(foot, head, camera.on_plane(foot), stature, strength, sd)


def _stature(foot: Array, head: Array, camera: Camera) -> float:
    """Stature of a person who stands between two pixels, metres; NaN if there is no ground under the foot."""
    place = camera.on_plane(foot)
    if not np.isfinite(place).all():
        return float("nan")
    return height_over(camera, head, float(np.hypot(*(place - camera.centre)[:2])))


def height_over(camera: Camera, pixel: Array, distance: float) -> float:
    """Height over ground of a pixel's ray at a horizontal distance from the camera, metres."""
    ray = camera.rays(pixel)
    return float(camera.centre[2] + distance * ray[2] / np.hypot(ray[0], ray[1]))


SIDES = (420, 570, 760)  # pixels, the larger side of the pictures looked at, in this order
LEAST = 96  # pixels that a person must be tall in the largest
_THRESHOLD = -0.5  # of a window's vote: weak ones count in numbers
_MARGIN = 0.125  # of the window above the head and below the feet, as the detector was trained
_STATURE, _STATURE_SD = 1.68, 0.12  # metres
_ENOUGH = 3.0  # votes in all for a person
_SAME = 0.3  # heights between the feet of windows about one person
_WINDOW_SD = 0.04  # of a mean of windows, heights, found on walking people of known place


@functools.cache
def _detector() -> cv2.HOGDescriptor:
    hog = cv2.HOGDescriptor()
    hog.setSVMDetector(np.array(cv2.HOGDescriptor.getDefaultPeopleDetector()))
    return hog


def detect_shape(image: Image, camera: Camera) -> list[Detection]:
    """Find people who stand on the ground, strongest first; people under `LEAST` pixels are missed."""
    for side in SIDES:
        found = _detect_at_scale(image, min(1.0, side / max(image.shape[:2])), camera)
        if found or side >= max(image.shape[:2]):
            return found
    return []


def _detect_at_scale(image: Image, scale: float, camera: Camera) -> list[Detection]:
    """People about as large as the detector's window in a picture at a scale, strongest first."""
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1 else image
    boxes, votes = _detector().detectMultiScale(
        small, hitThreshold=_THRESHOLD, winStride=(4, 4), padding=(16, 16), scale=1.025, groupThreshold=0
    )
    pairs = zip(boxes, np.ravel(votes), strict=True)
    each = [_window(np.array(box) / scale, float(vote), camera) for box, vote in pairs]
    left = sorted((one for one in each if one is not None), key=lambda one: -one.strength)
    found = []
    while left:
        first = left[0]
        near = [one for one in left if np.hypot(*(one.foot - first.foot)) < _SAME * first.tall]
        left = [one for one in left if np.hypot(*(one.foot - first.foot)) > first.tall]
        found.append(_mean_window(near, camera))
    sure = [one for one in found if one is not None and one.strength >= _ENOUGH]
    return sorted(sure, key=lambda one: -one.strength)


def _window(box: Array, vote: float, camera: Camera) -> Detection | None:
    """Person in a window (x, y, width, height); its vote and the stature give the strength."""
    x, y, width, height = box
    foot = np.array([x + width / 2, y + (1 - _MARGIN) * height])
    head = np.array([x + width / 2, y + (_MARGIN - 0.02) * height])
    one = person_between(foot, head, camera, 1.0, _WINDOW_SD)
    if one is None:
        return None
    off = (one.stature - _STATURE) / _STATURE_SD
    strength = float(np.exp(min(vote, 3.0) - 0.5 * off * off))
    return replace(one, strength=strength)


def _mean_window(near: list[Detection], camera: Camera) -> Detection | None:
    share = np.array([one.strength for one in near])
    foot = np.average([one.foot for one in near], axis=0, weights=share)
    head = np.average([one.head for one in near], axis=0, weights=share)
    return person_between(foot, head, camera, float(share.sum()), _WINDOW_SD)
