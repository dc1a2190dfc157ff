"""How a person is seen: through a calibrated camera, or flat (scaled orthographic) where there is none.

A view maps points to pixels and gives the exact slope of that map.  Points are in the world with a camera;
in a flat view they are in the picture's own axes: x to the right, y away from the viewer, z up, metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

from gait.camera.camera import Camera

Floats = npt.NDArray[np.float64]

NEAREST = 0.2  # metres before the lens; nothing that is drawn comes nearer


class View(Protocol):
    """What the estimate from images asks of a view."""

    def project(self, points: Floats) -> tuple[Floats, Floats]:
        """Pixels (..., 2) of points (..., 3), and slopes (..., 2, 3) of pixels by points."""
        ...

    def visible(self, points: Floats) -> bool:
        """Whether all points are before the lens."""
        ...

    def depth(self, points: Floats) -> Floats:
        """Distance (...) along the direction of view, metres."""
        ...

    def scale(self, point: Floats) -> float:
        """Pixels per metre at a point (3,)."""
        ...

    def growth(self, points: Floats) -> Floats:
        """How points (..., 3) move, per share that the person is larger, without moving in the picture."""
        ...

    def away(self, point: Floats) -> Floats:
        """Direction (3,) along which a point moves away without moving in the picture."""
        ...


@dataclass(frozen=True)
class CameraView:
    """View of a calibrated camera, lens distortion included."""

    camera: Camera

    def project(self, points: Floats) -> tuple[Floats, Floats]:
        """Pixels and slopes as `View` says."""
        turn, _ = cv2.Rodrigues(self.camera.R)
        flat = np.ascontiguousarray(points.reshape(-1, 3))
        uv, table = cv2.projectPoints(
            flat, turn, self.camera.t, self.camera.matrix, np.asarray(self.camera.distortion)
        )
        # a step of the point turned into the camera's axes is a step of the translation
        slope = table[:, 3:6].reshape(-1, 2, 3) @ self.camera.R
        return np.asarray(uv, float).reshape(*points.shape[:-1], 2), slope.reshape(*points.shape[:-1], 2, 3)

    def visible(self, points: Floats) -> bool:
        """Whether all points are before the lens."""
        return bool((self.depth(points) > NEAREST).all())

    def depth(self, points: Floats) -> Floats:
        """Distance before the lens along its axis."""
        return self.camera.depth(points)

    def scale(self, point: Floats) -> float:
        """Pixels per metre at a point."""
        return self.camera.fy / max(float(self.camera.depth(point)), NEAREST)

    def growth(self, points: Floats) -> Floats:
        """Away from the lens: a larger person is further away."""
        return np.asarray(points - self.camera.centre)

    def away(self, point: Floats) -> Floats:
        """Direction of the ray through a point."""
        ray = point - self.camera.centre
        return np.asarray(ray / np.linalg.norm(ray))


@dataclass(frozen=True)
class FlatView:
    """Scaled orthographic view (Leventon & Freeman 1998, their P drops the depth).

    Attributes
    ----------
    pixels : float
        Per metre.
    origin : (2,)
        Pixel of the point (0, 0, 0).
    """

    pixels: float
    origin: tuple[float, float]

    def project(self, points: Floats) -> tuple[Floats, Floats]:
        """Pixels and slopes as `View` says."""
        slope = self.pixels * np.array([[1.0, 0, 0], [0, 0, -1.0]])
        uv = points @ slope.T + np.asarray(self.origin)
        return uv, np.broadcast_to(slope, (*points.shape[:-1], 2, 3))

    def visible(self, points: Floats) -> bool:
        """Nothing is behind a flat view."""
        return True

    def depth(self, points: Floats) -> Floats:
        """Distance from the point (0, 0, 0) away from the viewer."""
        return np.asarray(points[..., 1])

    def scale(self, point: Floats) -> float:
        """Pixels per metre, the same everywhere."""
        return self.pixels

    def growth(self, points: Floats) -> Floats:
        """Nowhere: the placement's stature is the unit of length."""
        return np.zeros_like(points)

    def away(self, point: Floats) -> Floats:
        """Direction of depth."""
        return np.array([0.0, 1.0, 0.0])
