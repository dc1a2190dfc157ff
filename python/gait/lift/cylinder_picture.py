"""Draw the cylinder figure, its sticks and the user's springs into a frame."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from gait.body.skeleton import JOINTS
from gait.report.drawing import draw_bones, tinted
from gait.io.video import Image
from gait.lift.cylinder import LIMBS
from gait.lift.corrections import Correction
from gait.lift.views import View

Floats = npt.NDArray[np.float64]

_DARK = (30, 30, 30)
_SPRING = (90, 240, 255)  # BGR
_BITS = 3  # of fraction in OpenCV's drawing coordinates


def draw_figure(
    image: Image,
    view: View,
    surfaces: Floats,
    joints: Floats,
    springs: Sequence[tuple[Correction, Floats]] = (),
) -> Image:
    """Return a BGR picture with limbs, sticks and springs.

    Parameters
    ----------
    image : (h, w) or (h, w, 3)
    view : View
    surfaces : (L, P, 3)
        Points whose hulls are the limbs, metres.
    joints : (19, 3)
        `gait.body.skeleton.JOINTS`.
    springs : sequence of (Correction, (3,))
        Corrections of this frame and where their markers are, metres.
    """
    canvas = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image.copy()
    if not view.visible(surfaces):
        return np.asarray(canvas, np.uint8)
    size = max(0.3, 1.7 * view.scale(joints[JOINTS.index("pelvis")]) / 400)
    width = max(1, round(1.5 * size))
    canvas = tinted(np.asarray(canvas, np.uint8), _limb_ids(canvas.shape[:2], view, surfaces), LIMBS, width)
    uv = dict(zip(JOINTS, view.project(joints)[0], strict=True))
    draw_bones(canvas, uv, width + 2, _DARK)
    draw_bones(canvas, uv, width)
    for correction, place in springs:
        _draw_spring(canvas, np.asarray(correction.uv), view.project(place[None])[0][0], width)
    return canvas


def _limb_ids(size: tuple[int, ...], view: View, surfaces: Floats) -> npt.NDArray[np.uint8]:
    """Limb index + 1 of every pixel, 0 for none; the nearest limbs are painted last."""
    ids = np.zeros(size, np.uint8)
    uv, _ = view.project(surfaces)
    for limb in np.argsort(-view.depth(surfaces).mean(axis=1)):
        outline = cv2.convexHull(np.clip(uv[limb], -1e6, 1e6).astype(np.float32))
        fixed = np.rint(outline * (1 << _BITS)).astype(np.int32)
        cv2.fillConvexPoly(ids, fixed, int(limb) + 1, cv2.LINE_8, _BITS)
    return ids


def _draw_spring(canvas: Image, wanted: Floats, found: Floats, width: int) -> None:
    """Draw a line from where the user wants a marker, a circle, to where it is."""
    near, far = (tuple(np.clip(np.rint(p), -1e6, 1e6).astype(int).tolist()) for p in (wanted, found))
    cv2.line(canvas, near, far, _SPRING, width, cv2.LINE_AA)
    cv2.circle(canvas, near, 3 + 2 * width, _DARK, width + 2, cv2.LINE_AA)
    cv2.circle(canvas, near, 3 + 2 * width, _SPRING, width, cv2.LINE_AA)
