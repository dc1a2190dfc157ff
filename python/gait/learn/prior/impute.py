"""Missing entries filled the paper's way (Ormoneit 2000, Fig. 5 steps 3-9), and what filling gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from gait.learn.cycles.fourier import decode, encode_all
from gait.learn.prior.singular import right_singular
from gait.learn.spool import by_rows, stored

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

ITERATIONS = 500
TOLERANCE = 1e-6  # relative decrease of the error
ROUNDING = 1e-9  # relative; what is made smaller may rise by no more


@dataclass
class Filling:
    """Cycles with their missing entries filled.

    Attributes
    ----------
    filled : (R, T, M)
        The data where observed, the model elsewhere; on disk, read-only.
    rmse : list of float
        Data minus model over the observed entries, after each pass.
    objective : list of float
        What the passes make smaller, each as it came out; falls but for rounding.
    noise : float
        Standard deviation of the data about the model.
    converged : bool
        Whether nothing was left to gain; not if the objective rose or the passes ran out.
    """

    filled: Floats
    rmse: list[float]
    objective: list[float]
    noise: float
    converged: bool


def column_mean(values: Floats, mask: Mask) -> Floats:
    """Mean (T, M) over the rows where observed; a line across phases never seen, 0 in channels never seen."""
    count = mask.sum(axis=0)
    total = np.zeros(values.shape[1:])
    for part in by_rows(values):
        total += np.where(mask[part], values[part], 0).sum(axis=0)
    mean = total / np.maximum(count, 1)
    phases = np.arange(len(mean))
    for m in np.flatnonzero((count == 0).any(axis=0) & (count > 0).any(axis=0)):
        seen = np.flatnonzero(count[:, m])
        mean[:, m] = np.interp(phases, seen, mean[seen, m], period=len(mean))
    return mean


def by_svd(
    values: Floats, mask: Mask, components: int, basis: Floats, start: Floats, tolerance: float = TOLERANCE
) -> Filling:
    """Fill by turns: singular value decomposition of the filled data, entries from its leading part.

    Nothing holds back components that fit noise, so `components` must not be too many.

    Parameters
    ----------
    values, mask : (R, T, M)
        Data and where they are observed.
    basis : (B, T)
        Fourier basis of means and components.
    start : (T, M)
        Starting value of missing entries.
    tolerance : float
        Relative decrease of the error at which to stop.
    """
    rmse: list[float] = []
    complete, converged = bool(mask.all()), False
    filled = completed(values, mask, lambda _: start)
    while len(rmse) < ITERATIONS:
        coded = encode_all(filled, basis)
        mean = coded.mean(axis=0)
        leading = right_singular(coded, mean)[1][:components]
        scores = (coded - mean) @ leading.T
        curves = decode(np.vstack([mean, leading]), basis, values.shape[2])
        model = partial(_model, curves[0], curves[1:], scores)
        rmse.append(_rmse(values, mask, model))
        before = rmse[-2] if len(rmse) > 1 else np.inf
        if complete or rmse[-1] > before:
            converged = complete or rmse[-1] <= before * (1 + ROUNDING)
            break
        filled = completed(values, mask, model)
        if rmse[-1] >= before * (1 - tolerance):
            converged = True
            break
    return Filling(filled, rmse, list(rmse), min(rmse), converged)


def completed(values: Floats, mask: Mask, model: Callable[[slice], Floats]) -> Floats:
    """Put the data (R, T, M) on disk, with what `model` gives of a slice of the rows where not observed."""
    parts = (np.where(mask[part], values[part], model(part)) for part in by_rows(values))
    return stored(parts, values.shape[1:])


def _model(mean: Floats, curves: Floats, scores: Floats, part: slice) -> Floats:
    """Rows from their scores, (n, T, M)."""
    return np.asarray(mean + np.tensordot(scores[part], curves, 1))


def _rmse(values: Floats, mask: Mask, model: Callable[[slice], Floats]) -> float:
    total = sum(float(np.sum((values[part] - model(part))[mask[part]] ** 2)) for part in by_rows(values))
    return float(np.sqrt(total / mask.sum()))
