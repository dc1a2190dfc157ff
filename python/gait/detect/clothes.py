"""Colours of clothes, by which people who met are distinguished."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.detect.networks import LANDMARK_JOINTS, Person
from gait.detect.overlaps import Mask
from gait.io.video import Image

Colours = NDArray[np.float32]
"""Histogram of lightness and hue of the clothes on the trunk, shape `_BINS`, sum 1."""

_LEAST_TRUNK = 0.3  # share of the trunk that must be in view to know its colours
_BINS = (6, 12, 12)  # of L, a and b
_RANGES = (0, 256, 80, 176, 80, 176)
_BLUR = [0.5 * np.eye(n) + 0.25 * (np.eye(n, k=1) + np.eye(n, k=-1)) for n in _BINS]
_TORSO = [list(LANDMARK_JOINTS).index(name) for name in ("l_shoulder", "r_shoulder", "r_hip", "l_hip")]


def colours_of(image: Image, person: Person, hidden: Mask | None) -> Colours | None:
    """Histogram of the colours of the clothes on the trunk, blurred by one bin; None if it is hidden."""
    hull = cv2.convexHull(person.uv[_TORSO].astype(np.int32))
    x, y, width, height = cv2.boundingRect(hull)
    top, left = max(y, 0), max(x, 0)
    part = image[top : max(y + height, 0), left : max(x + width, 0)]
    if not part.size:
        return np.full(_BINS, 1 / np.prod(_BINS), np.float32)
    rows, columns = part.shape[:2]
    mask = np.zeros((rows, columns), np.uint8)
    cv2.fillConvexPoly(mask, hull - (left, top), 255)
    if hidden is not None:
        whole = np.count_nonzero(mask)
        mask[hidden[top : top + rows, left : left + columns]] = 0
        if np.count_nonzero(mask) < _LEAST_TRUNK * whole:
            return None
    lab = cv2.cvtColor(part, cv2.COLOR_BGR2LAB)
    lab[..., 1:] = np.clip(lab[..., 1:], _RANGES[2], _RANGES[3] - 1)
    counts = cv2.calcHist([lab], [0, 1, 2], mask, list(_BINS), list(_RANGES))
    blurred = np.einsum("lab,Ll,Aa,Bb->LAB", counts, *_BLUR, optimize=True)
    return np.asarray(blurred / max(float(blurred.sum()), 1e-9), np.float32)


def alike(a: Colours | None, b: Colours | None) -> float:
    """Overlap of two histograms (Bhattacharyya), 0 to 1; 1 if one is unknown."""
    return 1.0 if a is None or b is None else float(np.sqrt(a * b).sum())
