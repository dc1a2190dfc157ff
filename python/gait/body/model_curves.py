"""Curves of a model in numpy, for many hypotheses at once (Ormoneit 2000, eq. 3)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gait.body.pace import pace, slope_of
from gait.errors import UserError
from gait.io import blob

Array = NDArray[np.float64]


class ModelCurves:
    """Angles and root motion of a model over the stride.

    Parameters
    ----------
    sections : mapping
        Of the blob, from `gait.io.blob.decode`.

    Attributes
    ----------
    names : list of str
        M channels: the angles, then the root's.
    samples : ndarray of shape (1 + q, T, M)
        Mean, then components times their standard deviations; radians or statures.
    residual, static : ndarray of shape (M,)
        Standard deviations of what the components leave, and of a person's constant offset.
    height_change : ndarray of shape (p,)
        Of the pelvis, relatively, by one standard deviation of each of the limbs' proportions.
    faster : ndarray of shape (T, M)
        Change of the mean per unit of `gait.body.pace.pace`; 0 in models whose mean does not follow the rate.
    stride_hz, stride_length : float
        Means of the training set; per second, statures.
    """

    def __init__(self, sections: Mapping[str, NDArray[Any]]) -> None:
        missing = [tag for tag in ("CHNM", "CURV", "CHST", "GAIT") if tag not in sections]
        if missing:
            raise UserError(f"model: section {missing[0]} is missing, not a cyclic model; use gait learn")
        self.names = blob.unpack_names(sections["CHNM"])
        self.samples = np.asarray(sections["CURV"], float)
        slope = slope_of(sections)
        self.faster = np.zeros(self.samples.shape[1:]) if slope is None else slope
        self._gait = np.asarray(sections["GAIT"], float)
        statistics = np.asarray(sections["CHST"], float)
        self.residual, self.static = statistics[:, 0], statistics[:, 3]
        table = np.asarray(sections.get("PROP", np.zeros((0, 1))), float)
        self.height_change = table[:, -1]
        self.stride_hz, self.stride_length = float(self._gait[0]), float(self._gait[3])

    def channel(self, name: str, phase: Array, coef: Array, stride_hz: ArrayLike = 0.0) -> Array:
        """Values of one channel.

        Parameters
        ----------
        name : str
        phase : ndarray of shape (...)
            Strides, of any cycle.
        coef : ndarray of shape (..., k)
            Scores of the first k components; broadcast against `phase`.
        stride_hz : array_like
            Stride rates, broadcast against `phase`; 0: the mean rate.
        """
        at = self.names.index(name)
        curve = np.vstack([self.samples[: 1 + coef.shape[-1], :, at], self.faster[:, at]])
        size = curve.shape[1]
        place = (np.asarray(phase, float) % 1.0) * size
        left = np.floor(place).astype(int) % size
        share = place - np.floor(place)
        rows = curve[:, left] + share * (curve[:, (left + 1) % size] - curve[:, left])
        moved = np.sum(np.moveaxis(coef, -1, 0) * rows[1:-1], axis=0)
        return np.asarray(rows[0] + moved + pace(self._gait, stride_hz) * rows[-1])

    def norm(self, name: str, phase: Array, stride_hz: float = 0.0) -> tuple[Array, Array]:
        """Mean and standard deviation of one channel among people, each of the shape of `phase`.

        stride_hz : the rate at which they walk; 0: the mean rate.
        """
        at = self.names.index(name)
        q = len(self.samples) - 1
        mean = self.channel(name, phase, np.zeros((1, q)), stride_hz)
        parts = [self.channel(name, phase, row, stride_hz) - mean for row in np.eye(q)[:, None]]
        variance = sum(part**2 for part in parts) + self.residual[at] ** 2 + self.static[at] ** 2
        return mean, np.sqrt(variance)
