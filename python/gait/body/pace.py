"""Pace: how much faster than the mean a person walks, which the mean cycle of a model follows (PACE)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.errors import UserError

Floats = npt.NDArray[np.float64]

MOST = 2.0
"""Standard deviations between people: as far from the mean rate as is learnt (kinematics.h)."""


def pace(statistics: npt.ArrayLike, stride_hz: npt.ArrayLike) -> Floats:
    """Stride rates (...) as standard deviations between people from the mean, at most `MOST`.

    Parameters
    ----------
    statistics : (2, ...)
        Mean and standard deviation of the stride rate, as section GAIT begins.
    stride_hz : (...)
        0: not known, as if it were the mean.
    """
    mean, sd = np.asarray(statistics, float)[:2]
    rate = np.asarray(stride_hz, float)
    if not sd > 0:
        return np.zeros(rate.shape)
    return np.where(rate > 0, np.clip((rate - mean) / sd, -MOST, MOST), 0.0)


@cache
def waves(terms: int, phases: int) -> Floats:
    """Constant, then cosine and sine of each harmonic (terms, phases); `terms` is an odd number."""
    turn = 2 * np.pi * np.outer(np.arange(1, (terms + 1) // 2), np.arange(phases) / phases)
    pairs = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return np.concatenate([np.ones((1, phases)), pairs.reshape(terms - 1, phases)])


def series(curve: Floats, terms: int) -> Floats:
    """PACE (terms, M) of a curve (T, M): its Fourier series, cut off."""
    rows = waves(terms, len(curve))
    return np.asarray(rows @ curve / np.sum(rows**2, axis=1)[:, None])


def slope_of(sections: Mapping[str, Any], name: str = "model") -> Floats | None:
    """Change (T, M) of the mean cycle per unit of pace, at the phases of CURV; None without section PACE.

    Errors call the model `name`.

    Raises
    ------
    UserError
        If PACE is no Fourier series that this many phases can show.
    """
    if "PACE" not in sections:
        return None
    terms, phases = len(sections["PACE"]), sections["CURV"].shape[1]
    if terms % 2 == 0 or terms >= phases:
        raise UserError(f"{name}: section PACE has {terms} rows, no Fourier series; learn the model again")
    return np.asarray(waves(terms, phases).T @ np.asarray(sections["PACE"], float))
