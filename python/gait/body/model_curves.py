"""Curves of a cyclic model in numpy, for many states at once, and their dependence on the stride rate.

A model's angles and root motion are a mean plus principal components over the stride (Ormoneit 2000, eq. 3).
In models with section PACE the mean depends on the pace: how far a person's stride rate is above the average.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.errors import UserError
from gait.io import blob

Floats = npt.NDArray[np.float64]

MOST_PACE_SDS = 2.0
"""Standard deviations between people: as far from the mean rate as is learnt (kinematics.h)."""


def pace(statistics: npt.ArrayLike, stride_hz: npt.ArrayLike) -> Floats:
    """Pace (...): stride rate minus its mean, in standard deviations between people, at most `MOST_PACE_SDS`.

    `statistics` (2, ...): mean and standard deviation of the stride rate, the first values of section GAIT;
    `stride_hz` (...): 0 where unknown, for which the pace is 0.
    """
    mean, sd = np.asarray(statistics, float)[:2]
    rate = np.asarray(stride_hz, float)
    if not sd > 0:
        return np.zeros(rate.shape)
    return np.where(rate > 0, np.clip((rate - mean) / sd, -MOST_PACE_SDS, MOST_PACE_SDS), 0.0)


@cache
def waves(terms: int, phases: int) -> Floats:
    """Fourier basis (terms, phases), `terms` = 1 + 2 n: a constant, then cosine and sine of n harmonics."""
    turn = 2 * np.pi * np.outer(np.arange(1, (terms + 1) // 2), np.arange(phases) / phases)
    pairs = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return np.concatenate([np.ones((1, phases)), pairs.reshape(terms - 1, phases)])


def series(curve: Floats, terms: int) -> Floats:
    """Fourier coefficients (terms, M) of curves (T, M), truncated, as section PACE stores them."""
    rows = waves(terms, len(curve))
    return np.asarray(rows @ curve / np.sum(rows**2, axis=1)[:, None])


def slope_of(sections: Mapping[str, Any], name: str = "model") -> Floats | None:
    """Change (T, M) of the mean cycle per unit of pace, at the phases of CURV; None without section PACE.

    Errors call the model `name`.

    UserError if PACE is no Fourier series that this many phases can show.
    """
    if "PACE" not in sections:
        return None
    terms, phases = len(sections["PACE"]), sections["CURV"].shape[1]
    if terms % 2 == 0 or terms >= phases:
        raise UserError(
            f"{name}: section PACE has {terms} rows, which is not a Fourier series; learn the model again"
        )
    return np.asarray(waves(terms, phases).T @ np.asarray(sections["PACE"], float))


def at_phase(samples: Floats, phase: npt.ArrayLike) -> Floats:
    """Interpolate curves (K, T, ...) over the stride linearly at phases (n...): (K, n..., ...)."""
    size = samples.shape[1]
    place = (np.asarray(phase, float) % 1.0) * size
    left = np.floor(place).astype(int) % size
    share = (place - np.floor(place)).reshape(place.shape + (1,) * (samples.ndim - 2))
    return np.asarray(samples[:, left] + share * (samples[:, (left + 1) % size] - samples[:, left]))


def curves(
    sections: Mapping[str, Any], phase: npt.ArrayLike, coef: npt.ArrayLike, stride_hz: npt.ArrayLike = 0.0
) -> Floats:
    """Evaluate all channels (N, M) at phases (N,) for scores (N, k): mean plus sum of score times component.

    stride_hz : stride rates (N,) or scalar, on which the mean depends; 0: the average rate.
    """
    phase, coef = np.asarray(phase, float), np.asarray(coef, float)
    weights = np.concatenate([np.ones((len(phase), 1)), coef], axis=1)
    table = np.asarray(sections["CURV"], float)[: weights.shape[1]]
    if (slope := slope_of(sections)) is not None:
        faster = np.broadcast_to(pace(sections["GAIT"], stride_hz), len(phase))
        weights = np.column_stack([weights, faster])
        table = np.concatenate([table, slope[None]])
    return np.asarray(np.einsum("nk,knm->nm", weights, at_phase(table, phase)))


class ModelCurves:
    """Angles and root motion of a model over the stride.

    `sections`: those of the blob, from `gait.io.blob.decode`. `names`: the M channels: angles, then root.
    `samples` (1 + q, T, M): mean, then components times their standard deviations; radians or statures.
    `residual`, `static` (M,): standard deviations of what the components do not explain, and of a person's
    constant offset. `height_change` (p,): relative change of the pelvis's height per standard deviation of
    each component of the limbs' proportions. `faster` (T, M): change of the mean per unit of `pace`; 0 in
    models whose mean does not depend on the rate. `stride_hz`, `stride_length`: means of the training set, in
    strides per second and statures.
    """

    def __init__(self, sections: Mapping[str, npt.NDArray[Any]]) -> None:
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

    def channel(self, name: str, phase: Floats, coef: Floats, stride_hz: npt.ArrayLike = 0.0) -> Floats:
        """Evaluate one channel.

        `phase` (...): strides, of any cycle. `coef` (..., k): scores of the first k components, broadcast
        against `phase`. `stride_hz`: stride rates, broadcast against `phase`; 0: the average rate.
        """
        at = self.names.index(name)
        curve = np.vstack([self.samples[: 1 + coef.shape[-1], :, at], self.faster[:, at]])
        rows = at_phase(curve, phase)
        moved = np.sum(np.moveaxis(coef, -1, 0) * rows[1:-1], axis=0)
        return np.asarray(rows[0] + moved + pace(self._gait, stride_hz) * rows[-1])

    def norm(self, name: str, phase: Floats, stride_hz: float = 0.0) -> tuple[Floats, Floats]:
        """Mean and standard deviation of one channel among people, each of the shape of `phase`.

        stride_hz : the people's stride rate; 0: the average rate.
        """
        at = self.names.index(name)
        q = len(self.samples) - 1
        mean = self.channel(name, phase, np.zeros((1, q)), stride_hz)
        parts = [self.channel(name, phase, row, stride_hz) - mean for row in np.eye(q)[:, None]]
        variance = sum(part**2 for part in parts) + self.residual[at] ** 2 + self.static[at] ** 2
        return mean, np.sqrt(variance)
