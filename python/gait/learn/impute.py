"""Missing entries filled the paper's way (Ormoneit 2000, Fig. 5 steps 3-9), and what filling gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.learn.fourier import decode, encode

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

ITERATIONS = 500
TOLERANCE = 1e-6  # relative decrease of the error


@dataclass
class Filling:
    """Cycles with their missing entries filled.

    Attributes
    ----------
    filled : (R, T, M)
        The data where observed, the model elsewhere.
    rmse : list of float
        Data minus model over the observed entries, after each pass.
    objective : list of float
        What the passes make smaller; never increases.
    noise : float
        Standard deviation of the data about the model.
    converged : bool
        Whether the passes ended by themselves.
    """

    filled: Floats
    rmse: list[float]
    objective: list[float]
    noise: float
    converged: bool


def column_mean(values: Floats, mask: Mask) -> Floats:
    """Mean (T, M) over the rows where observed; a line across phases never seen, 0 in channels never seen."""
    count = mask.sum(axis=0)
    mean = np.where(mask, values, 0).sum(axis=0) / np.maximum(count, 1)
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
    filled, channels = np.where(mask, values, start), values.shape[2]
    rmse: list[float] = []
    complete, converged = bool(mask.all()), False
    while not converged and len(rmse) < ITERATIONS:
        coded = encode(filled, basis)
        mean = coded.mean(axis=0)
        _, vectors = np.linalg.eigh((coded - mean) @ (coded - mean).T)
        leading = vectors[:, ::-1][:, :components]
        model = decode(mean + leading @ (leading.T @ (coded - mean)), basis, channels)
        rmse.append(float(np.sqrt(np.mean((values - model)[mask] ** 2))))
        filled = np.where(mask, values, model)
        converged = complete or (len(rmse) > 1 and rmse[-2] - rmse[-1] <= tolerance * rmse[-2])
    return Filling(filled, rmse, list(rmse), rmse[-1], converged)
