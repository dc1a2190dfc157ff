"""Views in which a motion is observed: one or several calibrated cameras, or orthographic ("parallel").

The scale of a parallel view may be unknown; `gait.lift.smooth.rows` has the linear equations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.camera.camera import Camera
from gait.errors import UsageError
from gait.lift.keypoints.observations import Observations

Floats = npt.NDArray[np.float64]

VIEW_AXES = {"x": (1.0, 0, 0), "y": (0, 1.0, 0), "z": (0, 0, 1.0)}


@dataclass(frozen=True)
class Perspective:
    """View of a calibrated camera."""

    camera: Camera
    scaled = False  #: whether the scale is unknown
    grounded = True  #: whether the height above the floor z = 0 is known

    @property
    def axes(self) -> Floats:
        """Right, down and forward in the world, as rows of (3, 3)."""
        return np.asarray(self.camera.R)

    def alone(self, camera: int = 0) -> Perspective:
        """View of one camera: this one."""
        return self

    def project(self, places: Floats, lengths: Floats) -> Floats:
        """Project positions (T, J, 3) to pixels (T, J, 2)."""
        return self.camera.project(places)

    def direction(self, places: Floats) -> Floats:
        """Direction (3,) from the lens to the middle of positions (F, J, 3)."""
        ray = places.mean(axis=(0, 1)) - self.camera.centre
        return np.asarray(ray / np.linalg.norm(ray))


@dataclass(frozen=True)
class Parallel:
    """Orthographic view.

    Attributes
    ----------
    axes : (3, 3)
        Right, down and forward in the world, as rows.
    metres : float or None
        Length of one unit of the picture; None: unknown.
    origin : (2,)
        Point of the picture that does not move when the scale changes.
    steady : bool
        An unknown scale is constant over time.
    """

    axes: Floats
    metres: float | None
    origin: Floats
    steady: bool = True
    grounded = False

    @property
    def scaled(self) -> bool:
        """Whether the scale is unknown."""
        return self.metres is None

    def alone(self, camera: int = 0) -> Parallel:
        """View of one camera: this one."""
        return self

    def metric(self, observed: Observations, lengths: Floats) -> Observations:
        """Convert observations to metres from the origin, with `lengths` (T,) of a unit of the picture."""
        return Observations(
            (observed.uv - self.origin) * lengths[:, None, None], observed.sd * lengths[:, None]
        )

    def project(self, places: Floats, lengths: Floats) -> Floats:
        """Project positions (T, J, 3) to picture coordinates (T, J, 2)."""
        return np.asarray(places @ self.axes[:2].T / lengths[:, None, None] + self.origin)

    def direction(self, places: Floats) -> Floats:
        """Direction (3,) of view, the same for all positions."""
        return self.axes[2]

    def lengths(self, observed: Observations, mean: Floats, stature: float) -> Floats:
        """Guess the lengths (T,) of a unit from the extents of the observations and of a mean body (J, 3)."""
        if self.metres is not None:
            return np.full(len(observed.uv), self.metres)
        flat = stature * mean @ self.axes[:2].T
        ratio = np.full(len(observed.uv), np.nan)
        for t, known in enumerate(observed.visible):
            if known.sum() >= 3:
                ratio[t] = _extent(flat[known]) / max(_extent(observed.uv[t, known]), 1e-9)
        if np.isnan(ratio).all():
            raise UsageError("no frame has the three points that determine the scale; give --camera")
        known = np.flatnonzero(np.isfinite(ratio))
        if self.steady:
            return np.full(len(ratio), float(np.median(ratio[known])))
        return np.asarray(np.interp(np.arange(len(ratio)), known, _smoothed(ratio[known])))


@dataclass(frozen=True, eq=False)
class Several:
    """Views of several calibrated cameras together; each point belongs to one of them.

    Attributes
    ----------
    cameras : tuple of Camera
        Cameras in the same world.
    of_point : (P,)
        Number of each point's camera.
    """

    cameras: tuple[Camera, ...]
    of_point: npt.NDArray[np.intp]
    scaled = False
    grounded = True

    def alone(self, camera: int = 0) -> Perspective:
        """View of one of the cameras."""
        return Perspective(self.cameras[camera])

    def project(self, places: Floats, lengths: Floats) -> Floats:
        """Project points (T, P, 3) to pixels (T, P, 2), each in its own camera's picture."""
        uv = np.empty((*places.shape[:-1], 2))
        for number, camera in enumerate(self.cameras):
            own = self.of_point == number
            uv[:, own] = camera.project(places[:, own])
        return uv


View = Perspective | Parallel
AnyView = View | Several
"""View of one camera, or those of several at once."""


def _extent(points: Floats) -> float:
    """Extent of points (n, 2) along their main direction."""
    return float(np.linalg.norm(points - points.mean(axis=0), ord=2))


def _smoothed(values: Floats, reach: int = 15) -> Floats:
    """Compute a running median."""
    return np.array(
        [np.median(values[max(0, i - reach) : i + reach + 1]) for i in range(len(values))], np.float64
    )


def looking_along(text: str) -> Floats:
    """Parse a direction of view, such as `x`, `-y` or `1,2,0`, to axes (3, 3): right, down, forward; z is up.

    Raises
    ------
    UsageError
        If the text is not a direction.
    """
    name = text.lstrip("+-")
    try:
        ahead = np.array(VIEW_AXES[name] if name in VIEW_AXES else [float(v) for v in text.split(",")], float)
        if ahead.shape != (3,) or not 0 < np.linalg.norm(ahead) < np.inf:
            raise ValueError
    except ValueError:
        raise UsageError(f"--orthographic {text}: give x, y, z, with - the other way, or X,Y,Z") from None
    ahead = ahead / np.linalg.norm(ahead) * (-1 if name in VIEW_AXES and text.startswith("-") else 1)
    right = np.cross(ahead, [0.0, 0, 1])
    right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-6 else np.array([1.0, 0, 0])
    return np.stack([right, np.cross(ahead, right), ahead])
