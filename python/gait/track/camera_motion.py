"""How a camera turns and zooms during a clip, measured on the static scene.

Corners of a key frame are tracked into later frames (pyramidal Lucas-Kanade).  If the camera turns about its
lens, they move by the homography K' Q K^-1, whatever their distance.  Three angles and a zoom are fitted with
Tukey's weights, so that moving people and objects do not count.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.io.video import Image
from gait.track.moving_video import map_pixels

Array = NDArray[np.float64]
Box = tuple[float, float, float, float]
"""Left, top, right, bottom, pixels."""

_SIDE = 640  # pixels; largest longer side of the pictures in which corners are tracked
CELLS = 18  # cells along it; with one corner each, so that objects with much texture do not dominate
_CORNER_MARGIN_PX = 8  # pixels; margin of the picture without corners
_LEAST_CORNER_VALUE = 3e-4  # least value of cornerMinEigenVal at a corner
_FLOW_WINDOW, _LEVELS = (21, 21), 3  # of Lucas-Kanade
FEWEST_CORNERS = 20  # fewest corners that agree
_STILL_PX = 0.75  # pixels; corners of a still camera move less, by noise and compression
_SHARE = 0.3  # least share of the corners that agree
_AREA = 0.2  # least area that these cover, relative to corners all over the picture
_FEW_LEFT = 0.5  # share of a key frame's corners below which a new key frame is taken
TUKEY, SHARPEST, BLUNTEST = 4.685, 0.15, 2.0  # standard deviations to weight 0; least and most sd, pixels
#: Pixels; largest residual in a frame whose view is found.  A hand also moves the camera by centimetres.
_WORST_FIT = 4.0
_ZOOM = 1e-4  # variance of the logarithm of the zoom
FIT_ITERATIONS, COARSE = 20, 4  # iterations of the fit; the first ones use the sd of all corners


@dataclass(frozen=True)
class View:
    """View of a camera in a frame, relative to the reference.

    Attributes
    ----------
    turn : ndarray of shape (3, 3)
        Rotation from the camera's axes in the reference to those in the frame.
    zoom : float
        Focal length over that in the reference.
    residual : float
        Robust standard deviation of the corners' residuals, pixels; NaN if no view was found in the frame.
    """

    turn: Array
    zoom: float = 1.0
    residual: float = 0.0

    def after(self, other: View) -> View:
        """View of the same frame relative to the reference of `other`, which is a view of this reference."""
        return View(self.turn @ other.turn, self.zoom * other.zoom, self.residual)

    def inverse(self) -> View:
        """View of the reference relative to the frame."""
        return replace(self, turn=self.turn.T, zoom=1 / self.zoom)

    def camera(self, reference: Camera) -> Camera:
        """Return the camera of the frame, in the same world as that of the reference."""
        R, t = self.turn @ reference.R, self.turn @ reference.t
        return replace(reference, R=R, t=t, fx=self.zoom * reference.fx, fy=self.zoom * reference.fy)


UNMOVED_VIEW = View(np.eye(3))


class CameraMotion:
    """Finds the view of each frame of one camera.

    Parameters
    ----------
    camera : Camera
        Camera of the reference, which is the first frame.

    Attributes
    ----------
    scale : float
        Size of the reduced pictures over that of the frames.
    """

    def __init__(self, camera: Camera) -> None:
        self.scale = working_scale(camera)
        self._camera = replace(camera.scaled(self.scale), R=np.eye(3), t=np.zeros(3))
        self._last = self._key_view = UNMOVED_VIEW
        self._key = self._previous = np.zeros((0, 0), np.uint8)
        self._people: Iterable[Box] = ()
        self._corners = np.zeros((0, 2), np.float32)

    def start(self, image: Image, people: Iterable[Box] = ()) -> None:
        """Set the reference, (h, w) grey or (h, w, 3) BGR, with boxes of the people in it."""
        self._set_key(small_picture(image, self._camera), people, UNMOVED_VIEW)

    def still(self, image: Image) -> bool:
        """Whether the camera has the same view as in the key frame."""
        after = self._track(small_picture(image, self._camera), UNMOVED_VIEW)
        if after is None:
            return False
        off = np.hypot(*(after - self._corners)[np.isfinite(after[:, 0])].T)
        return bool((off < _STILL_PX).mean() > _SHARE)

    def step(self, image: Image, people: Iterable[Box] = ()) -> View:
        """Find the view of the next frame; if that fails, return the last one, with residual NaN."""
        small = small_picture(image, self._camera)
        found, visible = self._match(small)
        if visible < _FEW_LEFT:
            self._set_key(self._previous, self._people, self._last)
            again, _ = self._match(small)
            found = again or found
        view = found or replace(self._last, residual=np.nan)
        self._last, self._previous, self._people = view, small, people
        return replace(view, residual=view.residual / self.scale)

    def _set_key(self, small: Image, people: Iterable[Box], view: View) -> None:
        self._key, self._key_view = small, view
        self._previous, self._people = small, people
        self._corners = find_corners(small, self.scale * np.array(list(people)).reshape(-1, 4))

    def _match(self, small: Image) -> tuple[View | None, float]:
        """Find the view of a picture, if enough corners agree, and the share of corners still visible."""
        guess = self._last.after(self._key_view.inverse())
        after = self._track(small, guess)
        if after is None:
            return None, 0.0
        visible = np.isfinite(after[:, 0])
        places = after[visible].astype(float)
        view, agree = fit_view(self._camera, self._corners[visible].astype(float), places, guess)
        enough = agree.sum() >= FEWEST_CORNERS and self._everywhere(places[agree])
        found = enough and agree.mean() > _SHARE and view.residual < _WORST_FIT
        return view.after(self._key_view) if found else None, agree.sum() / len(after)

    def _everywhere(self, places: Array) -> bool:
        """Whether pixels (N, 2) are spread over the picture rather than on one object."""
        width, height = self._camera.size
        return bool(np.linalg.det(np.cov(places.T)) > (_AREA * width * height / 12) ** 2)

    def _track(self, small: Image, guess: View) -> NDArray[np.float32] | None:
        """Find the key frame's corners (N, 2), NaN where not visible; None if too few are."""
        if len(self._corners) < FEWEST_CORNERS:
            return None
        expected = map_pixels(self._corners.astype(float), self._camera, guess.camera(self._camera))
        places, found, _ = cv2.calcOpticalFlowPyrLK(
            self._key,
            small,
            self._corners[:, None],
            np.ascontiguousarray(expected[:, None], np.float32),
            winSize=_FLOW_WINDOW,
            maxLevel=_LEVELS,
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        )
        after = np.asarray(places[:, 0], np.float32)
        inside = ((after > 2) & (after < np.array(self._camera.size) - 3)).all(axis=1)
        after[(found[:, 0] == 0) | ~inside] = np.nan
        return after if np.isfinite(after[:, 0]).sum() >= FEWEST_CORNERS else None


def working_scale(camera: Camera) -> float:
    """Size of the pictures in which corners are tracked over that of the camera's pictures."""
    return min(1.0, _SIDE / max(camera.size))


def small_picture(image: Image, camera: Camera) -> Image:
    """Convert a picture (h, w) or (h, w, 3) BGR to grey (h, w) of the size of `camera`."""
    grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    if grey.shape[::-1] != camera.size:
        grey = cv2.resize(grey, camera.size, interpolation=cv2.INTER_AREA)
    return np.asarray(grey, np.uint8)


def find_corners(grey: Image, people: Array) -> NDArray[np.float32]:
    """Find the best corner (N, 2) in each cell of a grid, outside the boxes (K, 4) of people."""
    strength = cv2.cornerMinEigenVal(grey, 7)
    for left, top, right, bottom in np.maximum(people, 0).astype(int):
        strength[top:bottom, left:right] = 0
    inner = strength[_CORNER_MARGIN_PX:-_CORNER_MARGIN_PX, _CORNER_MARGIN_PX:-_CORNER_MARGIN_PX]
    side = max(grey.shape) / CELLS
    rows, columns = (np.arange(0, size, side).astype(int) for size in inner.shape)
    found = []
    for top in rows:
        for left in columns:
            cell = inner[top : top + int(side), left : left + int(side)]
            v, u = np.unravel_index(cell.argmax(), cell.shape)
            if cell[v, u] > _LEAST_CORNER_VALUE:
                found.append((_CORNER_MARGIN_PX + left + u, _CORNER_MARGIN_PX + top + v))
    return np.array(found, np.float32).reshape(-1, 2)


def fit_view(
    camera: Camera, before: Array, after: Array, start: View = UNMOVED_VIEW
) -> tuple[View, NDArray[np.bool_]]:
    """Fit a view to points that moved from `before` to `after`, pixels (N, 2), N > 1.

    Gauss-Newton with Tukey's weights, from `start`.  Also returns which points (N,) agree.
    """
    rays, view, sd = replace(camera, R=np.eye(3), t=np.zeros(3)).rays(before), start, np.inf
    off = np.zeros(len(before))
    for iteration in range(FIT_ITERATIONS):
        expected, slope = _motion(rays, view, camera)
        miss = after - expected
        off = np.hypot(*miss.T)
        sd, weight = tukey(off, sd, iteration < COARSE)
        normal = np.einsum("nki,n,nkj->ij", slope, weight, slope)
        right = np.einsum("nki,n,nk->i", slope, weight, miss)
        normal[3, 3] += 1 / _ZOOM
        right[3] -= np.log(view.zoom) / _ZOOM
        step = np.linalg.solve(normal + 1e-6 * np.eye(4), right)
        view = View(cv2.Rodrigues(step[:3])[0] @ view.turn, view.zoom * float(np.exp(step[3])), sd)
        if iteration > COARSE and np.abs(step).max() < 1e-7:
            break
    return view, off < TUKEY * sd


def tukey(off: Array, sd: float, coarse: bool) -> tuple[float, Array]:
    """Return the sd of a pixel and Tukey's weights (N,) for distances (N,) of points, pixels.

    `sd`: the last one, which limits the points that count and the next sd, except in `coarse` iterations.
    """
    near = off if coarse else off[off < TUKEY * sd]
    near_sd = float(np.median(near)) / 1.177 if len(near) else np.inf  # median of a Rayleigh distribution
    sd = max(SHARPEST, near_sd if coarse else min(sd, near_sd))
    return sd, np.square(np.clip(1 - np.square(off / (TUKEY * sd)), 0, None))


def _motion(rays: Array, view: View, camera: Camera) -> tuple[Array, Array]:
    """Project rays (N, 3) to pixels (N, 2), with derivatives (N, 2, 4) by three angles and log zoom.

    The derivatives ignore lens distortion.
    """
    turned = rays @ view.turn.T
    one = replace(view.camera(camera), R=np.eye(3), t=np.zeros(3))
    x, y = (turned[:, :2] / turned[:, 2:]).T
    across = one.fx * np.stack([-x * y, 1 + x * x, -y, x], axis=1)
    down = one.fy * np.stack([-(1 + y * y), x * y, x, y], axis=1)
    return one.project(turned), np.stack([across, down], axis=1)
