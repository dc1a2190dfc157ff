"""Where the camera stands for each view, and which way the walker goes."""

from __future__ import annotations

import numpy as np

from gait.errors import UsageError
from gait.camera.camera import Camera
from gait.simulate.arrays import Array
from gait.simulate.path import Path

VIEWS = ("side", "oblique", "toward", "away", "above", "circle")
DIRECTIONS = ("lr", "rl")
CIRCLE_RADIUS = 2.5
_CLOSEST = 2.2  # metres between lens and path
# heading of the path for left to right, degrees from world x; the camera looks along +y
_HEADING = {"side": 0, "oblique": -45, "toward": -90, "away": 90, "above": -30, "circle": 0}
_HEIGHT = {"side": 1.5, "oblique": 1.6, "toward": 1.5, "away": 1.5, "above": 3.6, "circle": 1.7}
_AWAY = {"side": 6.5, "oblique": 5.0, "toward": 5.0, "away": 4.5, "above": 5.5, "circle": 6.5}


def make_path(view: str, direction: str, seed_turn: float) -> Path:
    """Return the path; `seed_turn` in -1..1 turns straight paths by up to 3 degrees and shifts the circle."""
    mirrored = direction == "rl"
    if view == "circle":
        return Path(np.pi * seed_turn, -CIRCLE_RADIUS if mirrored else CIRCLE_RADIUS)
    heading = np.radians(_HEADING[view] + 3 * seed_turn)
    return Path(np.pi - heading if mirrored else heading)


def make_camera(
    view: str, size: tuple[int, int], points: Array, distance: float | None, height: float | None
) -> Camera:
    """Place the camera at (0, -distance, height) with the longest lens that keeps all `points` in view.

    Parameters
    ----------
    view : str
    size : (int, int)
        Width and height, pixels.
    points : ndarray of shape (n, 3)
        Everything the walker reaches, world, metres.
    distance : float, optional
        From the origin, horizontally, metres; by default such that the walker keeps well away.
    height : float, optional
        Metres.

    Raises
    ------
    UsageError
        If the walker would come too close to the lens.
    """
    near = -float(points[:, 1].min())
    if distance is None:
        distance = max(_AWAY[view], near + (4.0 if view in ("toward", "oblique", "away") else 3.0))
    if distance - near < _CLOSEST:
        raise UsageError(
            f"--distance {distance:g}: the walker comes within {distance - near:.1f} m of the camera; "
            f"give at least {near + _CLOSEST:.1f}"
        )
    place = np.array([0.0, -distance, _HEIGHT[view] if height is None else height])
    middle = 0.5 * (points.min(0) + points.max(0))
    rotation = _look_at(place, middle)
    for _ in range(4):  # turn until the walker's extent is centred
        low, high = _extent(points, place, rotation)
        ray = np.array([*(low + high) / 2, 1.0]) @ rotation
        rotation = _look_at(place, place + ray)
    low, high = _extent(points, place, rotation)
    width, tall = size
    across = max(high[0], -low[0])
    focal = min((0.5 - 0.035) * width / across, 0.86 * tall / (high[1] - low[1]))
    return Camera(
        width, tall, float(focal), float(focal), (width - 1) / 2, (tall - 1) / 2, rotation, -rotation @ place
    )


def _look_at(place: Array, target: Array) -> Array:
    """Return world-to-camera rotation with a level horizon."""
    ahead = (target - place) / np.linalg.norm(target - place)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(ahead, right), ahead])


def _extent(points: Array, place: Array, rotation: Array) -> tuple[Array, Array]:
    """Return the smallest and largest (x / z, y / z) of the points."""
    seen = (points - place) @ rotation.T
    flat = seen[:, :2] / seen[:, 2:]
    return flat.min(0), flat.max(0)
