"""Time offset between two films of a walk, from the joints detected in both.

The two directions in which two cameras see one joint at one time meet: the second lies in the plane through
both cameras and the first (the epipolar constraint).  With the films shifted against each other, joints that
move across these planes miss them.  What a detector and the camera files miss lasts, so the mismatch counts
how far directions are from the planes, and once more how far they are from that joint's usual distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.io.keypoints_file import Keypoints

Array = NDArray[np.float64]

_OVERLAP = 1.0  # seconds that both must show, at least
_SHARE = 0.3  # of the shorter film that both must show, at least
_MOST = 300  # frames compared
_GAP = 0.15  # seconds between frames from which joints between them are not known
_LEAST_SINE = 0.05  # of the angle between a direction and that to the other camera
_ELSEWHERE = 0.2  # seconds from the best offset to another one
_CLEARLY = 1.25  # times the mismatch of the best offset that any other must have
_FINE = 10  # parts of a frame in which an offset is found
_TOGETHER = 1.1  # times the best mismatch up to which films begin together if that is a frame away


@dataclass(frozen=True)
class Offset:
    """When a film began.

    Attributes
    ----------
    seconds : float
        Of its first frame, after that of the other film.
    mismatch : float
        Of directions to each other's planes, degrees.
    certain : bool
        Whether any other offset fits clearly worse.
    """

    seconds: float
    mismatch: float
    certain: bool


def find_offset(
    first: Keypoints, first_camera: Camera, other: Keypoints, camera: Camera, given: float | None = None
) -> Offset | None:
    """Find the offset of a film.

    Parameters
    ----------
    first, other : Keypoints
        Of the same person in two films, pixels.
    first_camera, camera : Camera
        In one world.
    given : float, optional
        The offset, seconds, if only its mismatch is wanted.

    Returns
    -------
    offset : Offset or None
        None if no offset lets both films show the person for long.
    """
    names = [name for name in first.names if name in other.names]
    planes, times = _planes(first, names, first_camera, camera.centre - first_camera.centre)
    rays = _rays(other, names, camera)
    if given is not None:
        mismatch = _mismatch(planes, times, rays, other.time, given)
        return Offset(given, mismatch, True) if np.isfinite(mismatch) else None
    step = float(np.median(np.diff(first.time)))
    span = min(np.ptp(first.time), np.ptp(other.time))
    least = max(_OVERLAP, _SHARE * span)
    low, high = times[0] - other.time[-1] + least, times[-1] - other.time[0] - least
    if len(names) == 0 or low > high:
        return None
    offsets = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1)
    coarse = np.array([_mismatch(planes, times, rays, other.time, offset) for offset in offsets])
    if not np.isfinite(coarse).any():
        return None
    at = float(offsets[np.nanargmin(coarse)])
    elsewhere = coarse[np.abs(offsets - at) > _ELSEWHERE]
    fine = at + step * np.arange(-_FINE, _FINE + 1) / _FINE
    near = np.array([_mismatch(planes, times, rays, other.time, offset) for offset in fine])
    best = float(np.nanmin(near))
    certain = not bool((elsewhere < _CLEARLY * best).any())
    together = _mismatch(planes, times, rays, other.time, 0.0)
    if abs(at) < 1.5 * step and together < _TOGETHER * best:
        return Offset(0.0, together, certain)
    return Offset(float(fine[np.nanargmin(near)]), best, certain)


def _planes(keypoints: Keypoints, names: list[str], camera: Camera, baseline: Array) -> tuple[Array, Array]:
    """Give unit normals (T, J, 3) of the planes through both cameras and each joint, and their times (T,)."""
    every = slice(None, None, len(keypoints.time) // _MOST + 1)
    rays = _rays(keypoints, names, camera)[every]
    normals = np.cross(baseline / np.linalg.norm(baseline), rays)
    sine = np.linalg.norm(normals, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        normals = np.where(sine > _LEAST_SINE, normals / sine, np.nan)
    return normals, keypoints.time[every]


def _rays(keypoints: Keypoints, names: list[str], camera: Camera) -> Array:
    """Give unit directions (T, J, 3) of joints, world; NaN where they were not found."""
    columns = [keypoints.names.index(name) for name in names]
    visible = keypoints.visible[:, columns]
    rays = camera.rays(np.where(visible[..., None], keypoints.uv[:, columns], 0.0))
    rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    return np.asarray(np.where(visible[..., None], rays, np.nan))


def _mismatch(planes: Array, times: Array, rays: Array, ray_times: Array, offset: float) -> float:
    """Mismatch of an offset, degrees; NaN if too few directions can be compared."""
    wanted = times - offset
    after = np.searchsorted(ray_times, wanted).clip(1, len(ray_times) - 1)
    begin, end = ray_times[after - 1], ray_times[after]
    share = (wanted - begin) / (end - begin)
    known = (share >= 0) & (share <= 1) & (end - begin < _GAP)
    between = rays[after - 1] + share[:, None, None] * (rays[after] - rays[after - 1])
    sine = (planes * between).sum(axis=-1)[known]
    if np.isfinite(sine).sum() < _SHARE / 3 * planes.shape[1] * len(times):
        return np.nan
    sine = sine[:, np.isfinite(sine).any(axis=0)]
    parts = np.nanmedian(np.abs(sine)), np.nanmedian(np.abs(sine - np.nanmedian(sine, axis=0)))
    return float(np.degrees(np.arcsin(np.clip(parts, 0, 1))).sum())
