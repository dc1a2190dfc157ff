"""Where the walker goes: a straight line through the origin or a circle about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gait.simulate.arrays import Array


@dataclass(frozen=True)
class Path:
    """Curve on the ground by arc length; arc length 0 is the middle of the clip.

    Attributes
    ----------
    heading : float
        Direction of travel at arc length 0, radians from world x towards world y.
    radius : float
        Of the circle about the origin, metres, positive to the left (anticlockwise); 0 = straight.
    """

    heading: float
    radius: float = 0.0

    def direction(self, along: ArrayLike) -> Array:
        """Return the heading at arc lengths (...), radians, unwrapped."""
        along = np.asarray(along, np.float64)
        return self.heading + (along / self.radius if self.radius else np.zeros_like(along))

    def point(self, along: ArrayLike, left: ArrayLike = 0.0) -> Array:
        """Return world x, y (..., 2) at arc lengths (...) and an offset to the left, metres."""
        along, left = np.broadcast_arrays(np.asarray(along, np.float64), left)
        h = self.direction(along)
        ahead, aside = np.stack([np.cos(h), np.sin(h)], -1), np.stack([-np.sin(h), np.cos(h)], -1)
        base = -self.radius * aside if self.radius else along[..., None] * ahead
        return base + left[..., None] * aside
