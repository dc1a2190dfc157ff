"""Area of the picture that a person covers, drawn from their joints."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.io.video import Image

Array = NDArray[np.float64]

_HEIGHTS = 1.28  # height of a person over the distance from shoulder to ankle
_HEAD_CIRCLE = (0.115, 0.085)  # heights: centre of the head above the shoulders, and its radius
_TRUNK = ("l_shoulder", "r_shoulder", "r_hip", "l_hip")
_TRUNK_EDGE = 0.06  # heights by which clothes reach beyond shoulders and hips
_LIMB_WIDTHS = {
    ("shoulder", "elbow"): 0.075, ("elbow", "wrist"): 0.065, ("hip", "knee"): 0.115, ("knee", "ankle"): 0.09,
    ("ankle", "toe"): 0.07, ("ankle", "heel"): 0.07,
}  # fmt: skip
"""Width of a limb with clothes, heights."""
_UNKNOWN = np.full(2, np.nan)
ANKLES = ("l_ankle", "r_ankle")


def draw_person(canvas: Image, at: Mapping[str, Array], value: int) -> None:
    """Set the pixels that a person covers, in place.

    Parameters
    ----------
    canvas : image
        (h, w) uint8.
    at : mapping of str to ndarray of shape (2,)
        Pixels of the joints by name; shoulders, hips and ankles are needed, others may be absent or NaN.
    value : int
    """
    shoulders, hips = (0.5 * (at[f"l_{name}"] + at[f"r_{name}"]) for name in ("shoulder", "hip"))
    ankle = max((at[name] for name in ANKLES), key=lambda one: float(one[1]))
    tall = _HEIGHTS * float(np.hypot(*(shoulders - ankle)))
    trunk = cv2.convexHull(np.rint([at[name] for name in _TRUNK]).astype(np.int32))
    cv2.fillConvexPoly(canvas, trunk, value)
    cv2.polylines(canvas, [trunk], True, value, _pixels(2 * _TRUNK_EDGE * tall))
    up = (shoulders - hips) / max(float(np.hypot(*(shoulders - hips))), 1e-6)
    head = _point(shoulders + _HEAD_CIRCLE[0] * tall * up)
    cv2.circle(canvas, head, _pixels(_HEAD_CIRCLE[1] * tall), value, -1)
    for (upper, lower), width in _LIMB_WIDTHS.items():
        for side in "lr":
            ends = at.get(f"{side}_{upper}", _UNKNOWN), at.get(f"{side}_{lower}", _UNKNOWN)
            if np.isfinite(ends).all():
                cv2.line(canvas, _point(ends[0]), _point(ends[1]), value, _pixels(width * tall))


def _point(at: Array) -> tuple[int, int]:
    x, y = (round(min(max(value, -32000.0), 32000.0)) for value in at.tolist())
    return x, y


def _pixels(length: float) -> int:
    return min(max(round(length), 1), 255)
