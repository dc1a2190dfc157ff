"""Ways to fill missing entries of cycles (R, T, M), as functions of values, mask and number of components."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from gait.learn.cycles.fourier import CYCLE_HARMONICS, decode, encode, fourier_basis
from gait.learn.prior import components as pca
from gait.learn.prior.imputation import column_mean, right_singular

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Imputer = Callable[[Floats, Mask, int], Floats]

PPCA_PASSES, PPCA_TOLERANCE = 200, 1e-5
SVD_PASSES, SVD_TOLERANCE = 500, 1e-6  # the paper's: relative decrease of the error


def mean(values: Floats, mask: Mask, components: int) -> Floats:
    """Mean of the other rows at the same phase."""
    del components
    return np.where(mask, values, column_mean(values, mask))


def line(values: Floats, mask: Mask, components: int) -> Floats:
    """Straight lines across the gaps of each curve, around the cycle."""
    del components
    return _interpolated(values, mask, lambda at, known, y, n: np.interp(at, known, y, period=n))


def cubic(values: Floats, mask: Mask, components: int) -> Floats:
    """Periodic cubic splines across the gaps of each curve."""
    del components

    def spline(at: Floats, known: Floats, y: Floats, n: int) -> Floats:
        if len(known) < 3:
            return np.full(len(at), y.mean())
        curve = CubicSpline([*known, known[0] + n], [*y, y[0]], bc_type="periodic")
        return np.asarray(curve(known[0] + (at - known[0]) % n))

    return _interpolated(values, mask, spline)


def _interpolated(values: Floats, mask: Mask, between: Callable[..., Floats]) -> Floats:
    result, samples = mean(values, mask, 0), values.shape[1]
    for r, m in np.ndindex(values.shape[0], values.shape[2]):
        known, gaps = np.flatnonzero(mask[r, :, m]), np.flatnonzero(~mask[r, :, m])
        if len(known) and len(gaps):
            result[r, gaps, m] = between(gaps, known, values[r, known, m], samples)
    return result


def svd(values: Floats, mask: Mask, components: int) -> Floats:
    """Singular value decomposition and filling in turn, without Fourier basis (SVDimpute)."""
    return _by_svd(values, mask, components, np.eye(values.shape[1]))


def _by_svd(values: Floats, mask: Mask, components: int, basis: Floats) -> Floats:
    """The paper's way (Fig. 5 steps 3-9): decompose the filled data, fill from the leading part, repeat."""
    filled, before = mean(values, mask, 0), np.inf
    for _ in range(SVD_PASSES):
        coded = encode(filled, basis)
        middle = coded.mean(axis=0)
        leading = right_singular(coded, middle)[1][:components]
        model = decode(middle + (coded - middle) @ leading.T @ leading, basis, values.shape[2])
        error = float(np.sqrt(np.mean((values - model)[mask] ** 2)))
        if error > before:
            break
        filled = np.where(mask, values, model)
        if error >= before * (1 - SVD_TOLERANCE):
            break
        before = error
    return filled


def ppca(values: Floats, mask: Mask, components: int) -> Floats:
    """Probabilistic principal components by maximum likelihood (EM), without Fourier basis (Roweis 1998)."""
    x, visible = values.reshape(len(values), -1), mask.reshape(len(values), -1).astype(float)
    filled = mean(values, mask, 0).reshape(x.shape)
    center = filled.mean(axis=0)
    _, s, v = np.linalg.svd(filled - center, full_matrices=False)
    load, noise = v[:components].T * s[:components] / np.sqrt(len(x)), 1.0
    for _ in range(PPCA_PASSES):
        covariance = noise * np.linalg.inv(_grams(visible, load) + noise * np.eye(components))
        scores = np.einsum("rkl,rl->rk", covariance, (visible * (x - center)) @ load) / noise
        before, model = filled, center + scores @ load.T
        # Each entry's row of loadings from the rows that have it.
        second = (covariance + scores[:, :, None] * scores[:, None]).reshape(len(x), -1)
        gram = (visible.T @ second).reshape(-1, components, components) + 1e-9 * np.eye(components)
        cross = (visible * (x - center)).T @ scores
        load = np.linalg.solve(gram, cross[..., None])[..., 0]
        center = (visible * (x - scores @ load.T)).sum(axis=0) / np.maximum(visible.sum(axis=0), 1)
        rest = np.sum(covariance * _grams(visible, load))
        noise = float(np.sum((visible * (x - center - scores @ load.T)) ** 2) + rest) / float(visible.sum())
        filled = np.where(visible > 0, x, model)
        if np.sqrt(np.mean((filled - before) ** 2)) <= PPCA_TOLERANCE * np.sqrt(noise):
            break
    return filled.reshape(values.shape)


def _grams(visible: Floats, load: Floats) -> Floats:
    """Products (R, q, q) of the loadings (P, q) of the entries that each row has (R, P)."""
    products = load[:, :, None] * load[:, None]
    return (visible @ products.reshape(len(load), -1)).reshape(len(visible), *products.shape[1:])


def paper(values: Floats, mask: Mask, components: int) -> Floats:
    """Functional components as in the paper."""
    return _by_svd(values, mask, components, fourier_basis(values.shape[1], CYCLE_HARMONICS))


def ours(values: Floats, mask: Mask, components: int) -> Floats:
    """Functional components as `gait learn` finds them."""
    return pca.fit(values, mask, components).filled


IMPUTERS: dict[str, Imputer] = {
    "column mean": mean,
    "linear": line,
    "cubic spline": cubic,
    "PPCA, EM": ppca,
    "iterative SVD": svd,
    "functional PCA as in the paper": paper,
    "gait (functional PCA, Bayesian)": ours,
}
