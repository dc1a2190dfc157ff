"""Calibrated camera: where a point of the world falls in the picture, and which ray a pixel looks along."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gait.errors import UserError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Camera:
    """Pinhole camera with OpenCV's five-parameter lens.

    ``x_cam = R x_world + t``, ``u = fx X/Z + cx``, ``v = fy Y/Z + cy``; pixel centres at integers; the
    world has z up and the ground at z = 0.

    Attributes
    ----------
    width, height : int
        Pixels.
    fx, fy, cx, cy : float
        Pixels.
    R : ndarray of shape (3, 3)
        World to camera.
    t : ndarray of shape (3,)
        Metres.
    distortion : ndarray of shape (5,)
        k1 k2 p1 p2 k3.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    R: Array = field(repr=False)
    t: Array
    distortion: Array = field(default_factory=lambda: np.zeros(5))

    @staticmethod
    def read(path: str, size: tuple[int, int] | None = None) -> Camera:
        """Read JSON, OpenCV YAML/XML or Pose2Sim TOML; see `gait.camera.camera_file.read_camera`."""
        from gait.camera.camera_file import read_camera  # the readers build this class

        return read_camera(path, size)

    @staticmethod
    def looking(place: ArrayLike, target: ArrayLike, size: tuple[int, int], focal: float) -> Camera:
        """Make a camera at `place` with `target` in the middle and a level horizon.

        Parameters
        ----------
        place, target : array_like of shape (3,)
            World, metres; not one above the other.
        size : (int, int)
            Width and height, pixels.
        focal : float
            Pixels.
        """
        eye = np.asarray(place, np.float64)
        ahead = np.asarray(target, np.float64) - eye
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        R = np.stack([right, np.cross(ahead, right), ahead])
        width, height = size
        return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, R, -R @ eye)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.width, self.height

    @property
    def matrix(self) -> Array:
        """Intrinsic matrix, shape (3, 3)."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    @property
    def centre(self) -> Array:
        """Place of the lens in the world, shape (3,), metres."""
        return np.asarray(-self.R.T @ self.t)

    def depth(self, points: ArrayLike) -> Array:
        """Distance in front of the lens along its axis, shape (...), metres; negative behind."""
        return np.asarray(np.asarray(points, np.float64) @ self.R[2] + self.t[2])

    def project(self, points: ArrayLike) -> Array:
        """Pixels (..., 2) of world points (..., 3), lens distortion included; NaN behind the camera."""
        import cv2  # here, so that a model is used without OpenCV

        world = np.asarray(points, np.float64)
        flat = np.ascontiguousarray(world.reshape(-1, 3))
        uv = np.full((len(flat), 2), np.nan)
        front = self.depth(flat) > 1e-6
        if front.any():
            rvec, _ = cv2.Rodrigues(self.R)
            uv[front] = cv2.projectPoints(flat[front], rvec, self.t, self.matrix, self.distortion)[0][:, 0]
        return uv.reshape(*world.shape[:-1], 2)

    def shows(self, points: ArrayLike) -> bool:
        """Whether any of world points (..., 3) is in the picture."""
        uv = self.project(points)
        return bool(((uv >= 0) & (uv < self.size)).all(axis=-1).any())

    def rays(self, pixels: ArrayLike) -> Array:
        """Look along pixels (..., 2): unit directions (..., 3) in the world from `centre`."""
        import cv2  # as in project()

        uv = np.asarray(pixels, np.float64)
        flat = np.ascontiguousarray(uv.reshape(-1, 1, 2))
        if not flat.size:  # OpenCV answers None
            return np.empty((*uv.shape[:-1], 3))
        stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-9)
        same = np.eye(3)
        plane = cv2.undistortPointsIter(flat, self.matrix, self.distortion, same, same, stop)[:, 0]
        direction = np.column_stack([plane, np.ones(len(plane))]) @ self.R
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        return direction.reshape(*uv.shape[:-1], 3)

    def on_plane(self, pixels: ArrayLike, height: float = 0.0) -> Array:
        """World points (..., 3) where pixels (..., 2) meet the plane z = `height`; NaN if they never do."""
        direction = self.rays(pixels)
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (height - self.centre[2]) / direction[..., 2]
        along = np.where(np.isfinite(along) & (along > 0), along, np.nan)
        return self.centre + along[..., None] * direction

    def scaled(self, factor: float) -> Camera:
        """Camera of the same picture resized by `factor` (pixel centres at integers)."""
        shift = 0.5 * (factor - 1)
        return replace(
            self,
            width=round(self.width * factor),
            height=round(self.height * factor),
            fx=self.fx * factor,
            fy=self.fy * factor,
            cx=self.cx * factor + shift,
            cy=self.cy * factor + shift,
        )

    def check_size(self, where: str, size: tuple[int, int]) -> None:
        """Raise UserError unless the calibration is for frames of `size` (width, height)."""
        if self.size == tuple(size):
            return
        width, height = size
        factor = width / self.width
        made = f"{where}: calibrated for {self.width}x{self.height}, the video is {width}x{height}"
        if abs(self.height * factor - height) < 1:
            raise UserError(f"{made}; scale width, height, fx, fy, cx, cy by {factor:.6g}")
        raise UserError(f"{made}, another aspect; calibrate for this video or undo its crop")

    def to_dict(self) -> dict[str, Any]:
        """Return the keys of the JSON camera file."""
        plain = {key: getattr(self, key) for key in ("width", "height", "fx", "fy", "cx", "cy")}
        return plain | {"R": self.R.tolist(), "t": self.t.tolist(), "distortion": self.distortion.tolist()}
