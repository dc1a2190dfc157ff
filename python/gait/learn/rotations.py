"""Rotation matrices of whole sequences, (T, 3, 3): composed from angles, decomposed into the model's angles.

Angles are radians.  NaN marks missing frames and stays NaN.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from gait.body.skeleton import axis_rotation
from gait.learn.arrays import Floats

GIMBAL = 0.05  # cosine of the middle angle below which the outer two cannot be separated
CLEAR_COSINE = 0.3  # cosine above which the two branches cannot be confused


def from_angles(angles: Floats, axes: Sequence[int]) -> Floats:
    """Return the product Rot(axes[0], angles[..., 0]) Rot(axes[1], angles[..., 1]) ..., first outermost."""
    result = np.broadcast_to(np.eye(3), (*angles.shape[:-1], 3, 3))
    for k, axis in enumerate(axes):
        result = result @ axis_rotation(axis, angles[..., k])
    return result


def frame_from(z: Floats, y: Floats, exact: str = "z") -> Floats:
    """Return frames (..., 3, 3), axes as columns, from two directions.

    `exact` ("z" or "y"): the axis that is exactly along its vector; the other is as near as possible.
    """
    x = unit(np.cross(y, z))
    if exact == "z":
        z = unit(z)
        return np.stack([x, np.cross(z, x), z], axis=-1)
    y = unit(y)
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def unit(v: Floats) -> Floats:
    """Scale vectors (..., 3) to length 1; NaN where the length is 0."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return v / np.where(length > 0, length, np.nan)


def rotation_vectors(r: Floats) -> Floats:
    """Return axis times angle (T, 3) of rotations below half a turn."""
    twist = np.stack(
        [r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]], axis=-1
    )
    sine = np.linalg.norm(twist, axis=-1) / 2
    angle = np.arctan2(sine, (np.trace(r, axis1=-2, axis2=-1) - 1) / 2)
    return twist * (angle / np.where(sine > 1e-12, 2 * sine, 1))[..., None]


def decompose(r: Floats, order: str) -> Floats:
    """Return the angles (T, 3), continuous in time, of R_i(a) R_j(b) R_k(c); `order` is yxz or zyx."""
    i, j, k = ("xyz".index(axis) for axis in order)
    b = np.arcsin(np.clip(-r[:, i, k], -1, 1))
    outer = np.stack([np.arctan2(r[:, j, k], r[:, k, k]), b, np.arctan2(r[:, i, j], r[:, i, i])], axis=1)

    def inner(t: int, a: float) -> Floats:
        rest = axis_rotation(i, -a) @ r[t]
        return np.array([a, np.arctan2(-rest[i, k], rest[k, k]), np.arctan2(-rest[j, i], rest[j, j])])

    return _continuous(outer, inner)


def unwrap(table: Floats) -> Floats:
    """Remove jumps of a whole turn from each column, also across gaps."""
    result = table.copy()
    for column in result.T:
        visible = np.isfinite(column)
        column[visible] = np.unwrap(column[visible])
    return result


def _continuous(angles: Floats, inner: Callable[[int, float], Floats]) -> Floats:
    """Choose in each frame the branch nearest to the frame before; keep the outer angle in gimbal lock.

    (a, b, c) and (a + pi, pi - b, c + pi) are the same rotation; near |b| = 90 degrees only a +- c is known.
    """
    if not np.any(np.cos(angles[:, 1]) < CLEAR_COSINE):
        return unwrap(angles)
    result = angles.copy()
    visible = [int(t) for t in np.flatnonzero(np.isfinite(angles).all(axis=1))]
    previous = angles[visible[0]]
    for t in visible[1:]:
        now = angles[t] if np.cos(angles[t, 1]) >= GIMBAL else inner(t, float(previous[0]))
        other = np.array([now[0] + np.pi, np.pi - now[1], now[2] + np.pi])
        now, other = _nearest_turn(now, previous), _nearest_turn(other, previous)
        closer = np.sum((now - previous) ** 2) <= np.sum((other - previous) ** 2)
        result[t] = previous = now if closer else other
    return result


def _nearest_turn(angles: Floats, previous: Floats) -> Floats:
    """Add whole turns so that the angles are nearest to the previous ones."""
    return angles - 2 * np.pi * np.round((angles - previous) / (2 * np.pi))
