"""Moving cameras: the exact camera of each frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from gait.camera.camera import Camera
from gait.simulate.geometry import Array, euler

_BEHIND, _HIGH = 1.0, 1.0  # metres; distance of the robot's camera behind the person, and its height
_AIM = 0.85  # metres; height at which it is aimed
_SMOOTH = 0.3  # seconds; delay with which a robot, or a person turning a camera, follows
_EDGE = 0.06  # margin that the person keeps free, as a fraction of half the picture
_ROBOT = (0.004, 0.05, 0.006, np.radians(1.0), np.radians(0.25), np.radians(0.25))
"""Standard deviations of a robot's wobble: across, along, up [m]; yaw, pitch, roll [rad]."""
_HAND = (0.012, 0.012, 0.012, np.radians(0.6), np.radians(0.6), np.radians(0.4))
"""The same for a hand-held camera."""


def make_cameras(
    kind: str,
    still: Camera,
    pelvis: Array,
    reach: Array,
    fps: float,
    rng: np.random.Generator,
    distance: float | None = None,
    height: float | None = None,
) -> list[Camera]:
    """Return the camera of each frame.

    Parameters
    ----------
    kind : str
        ``follow``: a robot drives behind the person.  ``pan``: a camera on a stand is turned to the person.
        ``shake``: the static camera is hand-held.
    still : Camera
        Static camera that would see the whole clip.
    pelvis : ndarray of shape (frames, 3)
        Metres, world.
    reach : ndarray of shape (frames, points, 3)
        Points around the person's surface in each frame, metres.
    fps : float
    rng : Generator
    distance, height : float, optional
        Distance of a robot's camera from the person, and its height above the floor, metres.
    """
    path = gaussian_filter1d(pelvis[:, :2], _SMOOTH * fps, axis=0, mode="nearest")
    wobble = _wobble(len(pelvis), fps, _ROBOT if kind == "follow" else _HAND, rng)
    if kind == "shake":
        cameras = [_shaken(still, error) for error in wobble]
    elif kind == "pan":
        aims = np.column_stack([path, np.full(len(path), reach[..., 2].mean())])
        cameras = [Camera.looking(still.centre, aim, still.size, still.fx) for aim in aims]
    else:
        steps = gaussian_filter1d(np.gradient(path, axis=0), _SMOOTH * fps, axis=0, mode="nearest")
        ahead = steps / np.linalg.norm(steps, axis=1, keepdims=True)
        places = path - (distance or _BEHIND) * ahead
        cameras = [
            _shaken(Camera.looking((*place, height or _HIGH), (*aim, _AIM), still.size, still.fx), error)
            for place, aim, error in zip(places, path, wobble, strict=True)
        ]
    return _zoomed(cameras, reach)


def _wobble(count: int, fps: float, sd: tuple[float, ...], rng: np.random.Generator) -> Array:
    """Return smooth errors (count, 6) with standard deviations `sd`, each of four waves of 0.5 to 3 Hz."""
    time = np.arange(count) / fps
    rate = rng.uniform(0.5, 3.0, (4, 6))
    phase = rng.uniform(0, 2 * np.pi, (4, 6))
    waves = np.sin(2 * np.pi * rate * time[:, None, None] + phase).sum(axis=1)
    return np.asarray(waves * np.array(sd) / np.sqrt(2.0))


def _shaken(camera: Camera, error: Array) -> Camera:
    """Return the camera moved across, along and up, and rotated."""
    yaw, pitch, roll = error[3:]
    turn = euler(roll, yaw, pitch)  # the camera's axes: z ahead, y down, x to the right
    R = turn @ camera.R
    right, ahead = camera.R[0], np.array([*camera.R[2, :2], 0.0])
    centre = camera.centre + error[0] * right + error[1] * ahead + [0.0, 0.0, error[2]]
    return replace(camera, R=R, t=-R @ centre)


def _zoomed(cameras: list[Camera], reach: Array) -> list[Camera]:
    """Return the cameras with the longest lens that shows the person in every frame."""
    across = tall = 0.0
    for camera, points in zip(cameras, reach, strict=True):
        inside = points @ camera.R.T + camera.t
        across = max(across, float(np.abs(inside[:, 0] / inside[:, 2]).max()))
        tall = max(tall, float(np.abs(inside[:, 1] / inside[:, 2]).max()))
    width, height = cameras[0].size
    focal = (1 - _EDGE) * min(0.5 * width / across, 0.5 * height / tall)
    return [replace(camera, fx=focal, fy=focal) for camera in cameras]
