"""Lasting errors of a detector, estimated along with the motion.

A detector that mistakes a point for the ankle does so in the next frame too.  Such an error is no new
evidence in later frames; as independent noise of each frame it would have to be so large that the figure
would hardly follow the points.  Therefore each point has an error in the picture that is linear between
knots, whose distance is the duration of errors; in a shorter sequence the error is constant.
"""

from __future__ import annotations

from copy import copy

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.intp]


class LastingErrors:
    """Errors of P points in T frames as functions of C unknowns, which are N(0, 1).

    Parameters
    ----------
    time : (T,)
        Seconds.
    sd : (T, P)
        Standard deviation along an axis, pixels; 0 or NaN for a point without such errors.
    lasts : float
        Seconds in which the autocorrelation of an error falls to 1/e.
    """

    def __init__(self, time: Floats, sd: Floats, lasts: float) -> None:
        intervals = int((time[-1] - time[0]) / lasts)
        at = np.linspace(time[0], time[-1], intervals + (2 if intervals else 1))
        knots = len(at)
        correlation = np.exp(-np.abs(at[:, None] - at) / lasts)
        straight = np.stack([np.interp(time, at, own) for own in np.eye(knots)], axis=1)
        self.sd, self._course = np.nan_to_num(sd), straight @ np.linalg.cholesky(correlation)
        self._shape = knots, sd.shape[1], 2
        self.count = int(np.prod(self._shape)) if self.sd.any() else 0

    def part(self, rows: Ints) -> LastingErrors:
        """Return the errors of some of the frames, with the same unknowns."""
        own = copy(self)
        own.sd, own._course = self.sd[rows], self._course[rows]
        return own

    def in_picture(self, numbers: Floats) -> Floats:
        """Compute errors (T, P, 2) in pixels from the unknowns."""
        if not self.count:
            return np.zeros((*self.sd.shape, 2))
        return np.asarray(
            np.einsum("tk,kpa->tpa", self._course, numbers.reshape(self._shape)) * self.sd[..., None]
        )

    def factors(self, frame: Ints, point: Ints) -> tuple[Ints, Floats]:
        """Return indices (n, K) of the unknowns of points' errors along the first axis, and factors, pixels.

        The unknowns of the second axis follow.
        """
        knots, points, _ = self._shape
        if not self.count:
            return np.zeros((len(frame), 0), np.intp), np.zeros((len(frame), 0))
        numbers = 2 * (np.arange(knots) * points + point[:, None])
        return numbers, self._course[frame] * self.sd[frame, point, None]
