"""Array types of the simulator, and rotation matrices: right-handed, acting on column vectors."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gait.body.skeleton import axis_rotation as about

Array = NDArray[np.float64]
Floats = NDArray[np.floating[Any]]
"""Single precision, used in the renderer's inner loops, where it halves the time."""
Ints = NDArray[np.integer[Any]]
Picture = NDArray[np.uint8]
"""(h, w, 3) BGR."""


def euler(yaw: ArrayLike, pitch: ArrayLike, roll: ArrayLike) -> Array:
    """Return Rz(yaw) Ry(pitch) Rx(roll): turn left, lean forward, left side up."""
    return about(2, yaw) @ about(1, pitch) @ about(0, roll)


def limb(flexion: ArrayLike, abduction: ArrayLike, rotation: ArrayLike, sign: float) -> Array:
    """Return a ball joint's rotation from clinical angles; `sign` is +1 on the left, -1 on the right."""
    return (
        about(1, -np.asarray(flexion))
        @ about(0, sign * np.asarray(abduction))
        @ about(2, -sign * np.asarray(rotation))
    )


def apply(rotation: Array, vector: ArrayLike) -> Array:
    """Rotate vectors (..., 3) by rotations (..., 3, 3)."""
    return np.einsum("...ij,...j->...i", rotation, np.asarray(vector, np.float64))


def unit(vector: Array) -> Array:
    """Scale vectors (..., 3) to length 1."""
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)
