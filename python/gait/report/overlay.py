"""Draw an estimate into its frame: body, skeleton, how sure it is, and a small instrument panel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.bindings.estimate import Estimate
from gait.bindings.model import Model
from gait.bindings.state import State
from gait.body.skeleton import BONES
from gait.camera.camera import Camera
from gait.io.video import Image
from gait.report.colours import OVER_PICTURES, side_of
from gait.report.panel import draw_panel

Array = NDArray[np.float64]
Colour = tuple[int, int, int]

ENDS = ("l_wrist", "r_wrist", "l_ankle", "r_ankle")
_DARK: Colour = (30, 30, 30)
_FILL = 0.28  # opacity of the body
_ELLIPSE = 2.146  # standard deviations of the 90 % ellipse of a normal in the plane
_SUBPIXEL = 4  # bits of fraction in OpenCV's drawing coordinates


def side_colour(name: str) -> Colour:
    """Colour of a joint or limb by its side."""
    return OVER_PICTURES[side_of(name)]


class Overlay:
    """Draws into the frames of one camera.

    Parameters
    ----------
    model : Model
    camera : Camera
        Its lens distortion is applied to what is drawn.
    """

    def __init__(self, model: Model, camera: Camera) -> None:
        self.model, self.camera = model, camera
        self._scale = max(0.6, min(camera.width, camera.height) / 540)
        self._lens = _lens_map(camera) if camera.distortion.any() else None

    def draw(self, image: Image, estimate: Estimate, frame: int) -> Image:
        """Return a BGR picture: frame, body of the dominant mode, mean joints, 90 % ellipses, panel."""
        canvas = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image.copy()
        canvas = self.body(np.asarray(canvas, np.uint8), estimate.mean)
        self.skeleton(canvas, estimate.joints)
        self._ellipses(canvas, estimate)
        draw_panel(canvas, estimate, frame, self._scale)
        return canvas

    def figure(self, canvas: Image, state: State) -> Image:
        """Return `canvas` with body and skeleton of one hypothesis."""
        canvas = self.body(canvas, state)
        self.skeleton(canvas, self.model.pose(state)[0])
        return canvas

    def body(self, canvas: Image, state: State) -> Image:
        """Tint the limbs and outline each where it shows."""
        ids = self.model.render(self.camera, state)
        if self._lens is not None:
            ids = np.asarray(cv2.remap(ids, *self._lens, cv2.INTER_NEAREST), np.uint8)
        return tinted(canvas, ids, self.model.limb_names, max(1, round(1.5 * self._size(state.pelvis))))

    def skeleton(self, canvas: Image, joints: Array) -> None:
        """Draw bones and joints (P, 3) in place; what is behind the camera is left out."""
        size = self._size(joints[self.model.joint_names.index("pelvis")])
        thick = max(1, round(2 * size))
        self.sticks(
            canvas, joints, thick + max(1, round(size)), _DARK
        )  # a dark seam keeps lines readable on any clothes
        self.sticks(canvas, joints, thick)
        for name, at in zip(self.model.joint_names, self.camera.project(joints), strict=True):
            if np.isfinite(at).all():
                _dot(canvas, at, 3.6 * size, _DARK)
                _dot(canvas, at, 2.4 * size, _brighter(side_colour(name)))

    def sticks(self, canvas: Image, joints: Array, thick: int, colour: Colour | None = None) -> None:
        """Draw bones as lines of `thick` pixels in place, in one colour or that of their side."""
        uv = dict(zip(self.model.joint_names, self.camera.project(joints), strict=True))
        draw_bones(canvas, uv, thick, colour)

    def _ellipses(self, canvas: Image, estimate: Estimate) -> None:
        """Draw the 90 % ellipse of wrists and ankles from the axis-wise deviations."""
        for name in ENDS:
            index = estimate.joint_names.index(name)
            steps = np.diag(estimate.joint_sd[index])
            around = self.camera.project(estimate.joints[index] + np.stack([steps, -steps]))
            middle = self.camera.project(estimate.joints[index])
            slope = 0.5 * (around[0] - around[1])
            if not np.isfinite(slope).all():
                continue
            values, axes = np.linalg.eigh(slope.T @ slope)
            radii = _ELLIPSE * np.sqrt(np.maximum(values[::-1], 0))
            angle = np.degrees(np.arctan2(axes[1, 1], axes[0, 1]))
            thick = max(1, round(1.2 * self._size(estimate.joints[index])))
            _ellipse(canvas, middle, radii, float(angle), side_colour(name), thick)

    def _size(self, place: Array) -> float:
        """Scale of lines for a person at `place`: 1 where 1.7 m are 400 pixels."""
        depth = max(float(self.camera.depth(place)), 0.1)
        return float(np.clip(1.7 * self.camera.fy / depth / 400, 0.3, 4.0))


def tinted(canvas: Image, ids: NDArray[np.uint8], limbs: Sequence[str], width: int) -> Image:
    """Return `canvas` (h, w, 3) with limbs tinted and outlined; `ids` (h, w) holds limb index + 1, or 0."""
    colours = [side_colour(name) for name in limbs]
    table = np.array([(0, 0, 0), *colours], np.float32)
    inside = ids > 0
    out = canvas.copy()
    out[inside] = np.rint((1 - _FILL) * canvas[inside] + _FILL * table[ids[inside]]).astype(np.uint8)
    for limb, colour in enumerate(colours, 1):
        mask = (ids == limb).astype(np.uint8)
        contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(out, contours, -1, colour, width, cv2.LINE_AA)
    return out


def draw_bones(canvas: Image, uv: Mapping[str, Array], thick: int, colour: Colour | None = None) -> None:
    """Draw bones between joints at pixels `uv` in place, in one colour or that of their side."""
    for a, b in BONES:
        if np.isfinite([uv[a], uv[b]]).all():
            _line(canvas, [uv[a], uv[b]], colour or _brighter(side_colour(b)), thick)


def _lens_map(camera: Camera) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Column and row in the ideal picture of every pixel of the distorted one, each (h, w)."""
    grid = np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=2)
    seen = camera.rays(grid) @ camera.R.T
    ideal = seen[..., :2] / seen[..., 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
    return ideal[..., 0].astype(np.float32), ideal[..., 1].astype(np.float32)


def _brighter(colour: Colour) -> Colour:
    b, g, r = (int(0.45 * 255 + 0.55 * c) for c in colour)
    return b, g, r


def _fixed(point: Array) -> tuple[int, int]:
    """Pixel in OpenCV's fixed-point drawing coordinates, kept within their range."""
    x, y = np.clip(np.rint(point * (1 << _SUBPIXEL)), -(1 << 28), 1 << 28).astype(int)
    return int(x), int(y)


def _line(canvas: Image, ends: Sequence[Array], colour: Colour, thick: int) -> None:
    cv2.line(canvas, _fixed(ends[0]), _fixed(ends[1]), colour, thick, cv2.LINE_AA, _SUBPIXEL)


def _dot(canvas: Image, at: Array, radius: float, colour: Colour) -> None:
    cv2.circle(canvas, _fixed(at), round(radius * (1 << _SUBPIXEL)), colour, -1, cv2.LINE_AA, _SUBPIXEL)


def _ellipse(canvas: Image, at: Array, radii: Array, angle: float, colour: Colour, thick: int) -> None:
    axes = _fixed(np.maximum(radii, 1.0))
    cv2.ellipse(canvas, _fixed(at), axes, angle, 0, 360, _DARK, thick + 2, cv2.LINE_AA, _SUBPIXEL)
    cv2.ellipse(canvas, _fixed(at), axes, angle, 0, 360, colour, thick, cv2.LINE_AA, _SUBPIXEL)
