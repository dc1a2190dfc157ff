"""How a camera travels over the floor, measured on the static scene.

Corners are tracked from frame to frame (pyramidal Lucas-Kanade).  Each is a landmark on its ray in the frame
where it was found.  Below the horizon it is assumed to be on the floor, which gives the scale; elsewhere, and
if that does not fit, its inverse distance is estimated (Civera, Davison, Montiel: Inverse Depth
Parametrization for Monocular SLAM, 2008).  The pose of each frame is fitted to all landmarks with Tukey's
weights, so that moving people, objects and shadows do not count.  Errors accumulate along the path.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.camera.path import CameraPose
from gait.io.video import Image
from gait.track.camera_motion import (
    BLUNTEST,
    CELLS,
    COARSE,
    FEWEST_CORNERS,
    FIT_ITERATIONS,
    TUKEY,
    Box,
    find_corners,
    small_picture,
    tukey,
    working_scale,
)

Array = NDArray[np.float64]

_FLOW_WINDOW, _LEVELS = (9, 9), 3  # of Lucas-Kanade
_RETURN_PX = 0.5  # pixels; largest distance of a corner tracked forwards and back from its origin
_DROPPED_MARGIN_PX = 4  # pixels from the picture's edge at which a landmark is dropped
_FURTHEST_LANDMARK_M = 40.0  # metres to the furthest landmark on the floor
#: Fewest corners on the floor that give the scale, and their least share of the landmarks below the horizon:
#: with a wall instead of a floor, about a tenth fit by chance.  Other landmarks keep the scale for a while.
_FLOOR_CORNERS, _FLOOR_SHARE = 10, 0.125
_INVERSE, _INVERSE_SD = 0.1, 0.3  # 1/m; prior of the inverse distance of other landmarks
_NEAREST = 5.0  # 1/m; largest inverse distance
_DRIFT = 3.0  # pixels; sd of a tracked corner over the time for which it is seen
_MISSES = 2  # frames in which a landmark may not fit
_CAMERA_TURN_SD, _PLACE_SD = np.radians(0.25), 0.01  # of a pose; about the errors with simulated robots


@dataclass
class _Landmarks:
    """Landmarks, each on its ray in the frame where it was found.

    Attributes
    ----------
    pixels : ndarray of shape (N, 2)
        Position in the last picture.
    origin, ray : ndarray of shape (N, 3)
        Position of the camera when the landmark was found, metres, and unit vector from there, world.
    inverse, variance : ndarray of shape (N,)
        Inverse distance along the ray, 1/m, and its variance, which is 0 on the floor.
    misses : ndarray of shape (N,)
        Number of frames in which it did not fit, minus those in which it did.
    """

    pixels: NDArray[np.float32]
    origin: Array
    ray: Array
    inverse: Array
    variance: Array
    misses: NDArray[np.int64]

    @staticmethod
    def at(camera: Camera, pixels: NDArray[np.float32], *, floor: bool = True) -> _Landmarks:
        """Make landmarks at pixels (N, 2) of a picture; `floor`: those below the horizon are on the floor."""
        ray = camera.rays(pixels.astype(float))
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        origin = np.tile(camera.centre, (len(ray), 1))
        inverse, below = -ray[:, 2] / camera.centre[2], floor & _below(ray, origin)
        return _Landmarks(
            pixels,
            origin,
            ray,
            np.where(below, inverse, _INVERSE),
            np.where(below, 0.0, _INVERSE_SD**2),
            np.zeros(len(ray), np.int64),
        )

    def where(self, chosen: NDArray[np.bool_]) -> _Landmarks:
        """Select landmarks by a mask (N,)."""
        return _Landmarks(*(values[chosen] for values in vars(self).values()))

    def and_(self, other: _Landmarks) -> _Landmarks:
        """Concatenate these landmarks and others."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return _Landmarks(*(np.concatenate(pair) for pair in pairs))

    def improve(self, camera: Camera, pixels: Array, sd: float, fits: NDArray[np.bool_]) -> None:
        """Update the inverse distance of landmarks that fit and are not on the floor, in place."""
        expected, _, slope = _project(camera, self)
        chosen = fits & (self.variance > 0)
        miss, slope, variance = (pixels - expected)[chosen], slope[chosen], max(_DRIFT, sd) ** 2
        information = 1 / self.variance[chosen] + np.square(slope).sum(axis=1) / variance
        step = (slope * miss).sum(axis=1) / variance / information
        self.inverse[chosen] = np.clip(self.inverse[chosen] + step, 0.0, _NEAREST)
        self.variance[chosen] = 1 / information


def _below(ray: Array, origin: Array) -> NDArray[np.bool_]:
    """Whether rays (N, 3) from `origin` (N, 3) reach the floor near enough for landmarks on it."""
    return np.asarray(-ray[:, 2] / origin[:, 2] > 1 / _FURTHEST_LANDMARK_M)


class CameraTravel:
    """Finds the pose of each frame of one camera.

    Parameters
    ----------
    camera : Camera
        Camera of the first frame, above the floor z = 0.
    image : image
        First frame, (h, w) grey or (h, w, 3) BGR.
    people : iterable of Box
        People in it, who are not part of the scene.

    Attributes
    ----------
    on_floor : bool
        Whether enough landmarks on the floor fitted in the last frame to give the scale.
    """

    def __init__(self, camera: Camera, image: Image, people: Iterable[Box] = ()) -> None:
        self._scale = working_scale(camera)
        self._camera = camera.scaled(self._scale)
        self._picture = small_picture(image, self._camera)
        self._landmarks = _Landmarks.at(self._camera, np.zeros((0, 2), np.float32))
        self.on_floor = False
        self._add(self._boxes(people))

    def step(self, image: Image, people: Iterable[Box] = ()) -> CameraPose | None:
        """Find the pose of the next frame; None if too few landmarks are visible."""
        boxes = self._boxes(people)
        self._track(small_picture(image, self._camera), boxes)
        visible = self._landmarks
        if len(visible.pixels) < FEWEST_CORNERS:
            return None
        ideal = self._ideal(visible.pixels)
        floor, about, sd = visible.variance == 0, self._camera, np.inf
        # Use the floor first: most of the picture may be sky, which does not show that the camera travels.
        if floor.sum() >= FEWEST_CORNERS:
            about, sd, _ = _fit(about, visible.where(floor), ideal[floor])
        self._camera, sd, fits = _fit(about, visible, ideal, sd)
        visible.improve(self._camera, ideal, sd, fits)
        visible.misses = np.where(fits, np.maximum(visible.misses - 1, 0), visible.misses + 1)
        wrong = visible.misses >= _MISSES
        below = _below(visible.ray, visible.origin)
        self.on_floor = (fits & floor).sum() >= max(_FLOOR_CORNERS, _FLOOR_SHARE * below.sum())
        raised = _Landmarks.at(self._camera, visible.pixels[wrong & floor], floor=False)
        self._landmarks = visible.where(~wrong).and_(raised)
        self._add(boxes)
        if sd > BLUNTEST or fits.sum() < FEWEST_CORNERS:
            return None
        return CameraPose(self._camera.R, self._camera.t, float(_CAMERA_TURN_SD), _PLACE_SD)

    def _boxes(self, people: Iterable[Box]) -> Array:
        return self._scale * np.array(list(people), float).reshape(-1, 4)

    def _ideal(self, pixels: NDArray[np.float32]) -> Array:
        """Convert pixels (N, 2) to those of a lens without distortion."""
        lens = replace(self._camera, R=np.eye(3), t=np.zeros(3))
        return replace(lens, distortion=np.zeros(5)).project(lens.rays(pixels.astype(float)))

    def _add(self, boxes: Array) -> None:
        """Add corners in cells without a landmark."""
        found = find_corners(self._picture, boxes)
        side, across = max(self._picture.shape) / CELLS, np.array([1, 2 * CELLS])
        taken = (self._landmarks.pixels // side) @ across
        found = found[~np.isin((found // side) @ across, taken)]
        self._landmarks = self._landmarks.and_(_Landmarks.at(self._camera, found))

    def _track(self, picture: Image, boxes: Array) -> None:
        """Track the landmarks into the next picture, and drop those not found there."""
        before, self._picture, old = self._picture, picture, self._landmarks
        if not len(old.pixels):
            return
        there, found = _moved(before, picture, old.pixels)
        back, again = _moved(picture, before, there)
        size = np.array(picture.shape[::-1])
        inside = ((there >= _DROPPED_MARGIN_PX) & (there < size - _DROPPED_MARGIN_PX)).all(axis=1)
        point = there[:, None]
        within = np.all((point > boxes[:, :2]) & (point < boxes[:, 2:]), axis=2)
        returns = np.hypot(*(back - old.pixels).T) < _RETURN_PX
        old.pixels = there
        self._landmarks = old.where(found & again & returns & inside & ~np.any(within, axis=1))


def _moved(
    before: Image, after: Image, pixels: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Track corners (N, 2) of a picture into another one; also return whether (N,) each was found."""
    places, found, _ = cv2.calcOpticalFlowPyrLK(  # type: ignore[call-overload]
        before,
        after,
        pixels[:, None],
        None,
        winSize=_FLOW_WINDOW,
        maxLevel=_LEVELS,
    )
    return np.asarray(places[:, 0], np.float32), found[:, 0] > 0


def _project(camera: Camera, visible: _Landmarks) -> tuple[Array, Array, Array]:
    """Project landmarks without lens distortion.

    A landmark is at origin + ray / inverse; computing with this times `inverse` allows points at infinity.

    Returns
    -------
    pixels : ndarray of shape (N, 2)
        NaN behind the camera.
    by_pose : ndarray of shape (N, 2, 6)
        Derivatives by a rotation of the camera, radians, and by its position, metres.
    by_inverse : ndarray of shape (N, 2)
        Derivatives by the inverse distance.
    """
    away = visible.origin - camera.centre
    q = (visible.ray + visible.inverse[:, None] * away) @ camera.R.T
    x, y = q[:, :2].T
    z = np.where(q[:, 2] > 1e-3, q[:, 2], np.nan)
    zero = np.zeros_like(z)
    pixels = np.stack([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy], axis=1)
    across = np.stack([camera.fx / z, zero, -camera.fx * x / z**2], axis=1)
    down = np.stack([zero, camera.fy / z, -camera.fy * y / z**2], axis=1)
    by_point = np.stack([across, down], axis=1)
    by_turn = np.cross(q[:, None], by_point)
    by_place = -visible.inverse[:, None, None] * (by_point @ camera.R)
    by_inverse = np.einsum("nki,ij,nj->nk", by_point, camera.R, away)
    return pixels, np.concatenate([by_turn, by_place], axis=2), by_inverse


def _fit(
    camera: Camera, visible: _Landmarks, pixels: Array, sd: float = np.inf
) -> tuple[Camera, float, NDArray[np.bool_]]:
    """Fit the pose to pixels (N, 2) of landmarks; return camera, sd of a pixel, and which landmarks (N,) fit.

    `sd`: sd of a pixel, if `camera` is already about right.
    """
    off = np.zeros(len(pixels))
    for iteration in range(0 if np.isinf(sd) else COARSE, FIT_ITERATIONS):
        expected, slope, by_inverse = _project(camera, visible)
        ahead = np.isfinite(expected[:, 0])
        miss = np.where(ahead[:, None], pixels - expected, 1e3)
        slope[~ahead], by_inverse[~ahead] = 0.0, 0.0
        unit = sd if np.isfinite(sd) else 1.0
        covariance = by_inverse[:, :, None] * by_inverse[:, None] * visible.variance[:, None, None]
        precision = np.linalg.inv(unit**2 * np.eye(2) + covariance)
        off = unit * np.sqrt(np.einsum("nk,nkl,nl->n", miss, precision, miss))
        sd, weight = tukey(off, sd, iteration < COARSE)
        normal = np.einsum("nki,n,nkl,nlj->ij", slope, weight, precision, slope, optimize=True)
        right = np.einsum("nki,n,nkl,nl->i", slope, weight, precision, miss, optimize=True)
        step = np.linalg.solve(normal + 1e-6 * np.eye(6), right)
        R, centre = cv2.Rodrigues(step[:3])[0] @ camera.R, camera.centre + step[3:]
        camera = replace(camera, R=R, t=-R @ centre)
        if iteration > COARSE and np.abs(step).max() < 1e-6:
            break
    return camera, sd, off < TUKEY * sd
