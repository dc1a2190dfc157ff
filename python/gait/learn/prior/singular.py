"""Singular values and right singular vectors of many rows, in memory that does not grow with their number."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.linalg

from gait.learn.spool import by_rows

Floats = npt.NDArray[np.float64]

LEAST = 1e-14  # of the largest squared singular value: what is smaller is rounding


def right_singular(rows: Floats, mean: Floats, factor: Floats | None = None) -> tuple[Floats, Floats]:
    """Decompose rows (R, P) minus their mean, each times its factor (R,), without the left vectors.

    Many rows are decomposed by the eigenvectors of their products, which need memory for P x P numbers only.
    Their leading vectors are as good; singular values below 1e-8 of the largest are noise.

    Returns
    -------
    singular : (min(R, P),)
        Descending.
    right : (>= min(R, P), P)
        Orthonormal.
    """
    weight = np.ones(len(rows)) if factor is None else factor
    fewer = min(rows.shape)
    if 2 * len(rows) <= rows.shape[1]:
        _, singular, right = np.linalg.svd((rows - mean) * weight[:, None], full_matrices=False)
        return singular, right
    gram = np.zeros((rows.shape[1], rows.shape[1]))
    for part in by_rows(rows):
        some = (rows[part] - mean) * weight[part, None]
        gram += some.T @ some
    squares, vectors = scipy.linalg.eigh(gram.T, overwrite_a=True, check_finite=False)
    return np.sqrt(np.maximum(squares[::-1][:fewer], 0)), vectors[:, ::-1].T


def leading(rows: Floats, mean: Floats, factor: Floats, count: int) -> Floats:
    """Give the first right singular vectors (<= count, P) alone; of few rows by the products of those.

    Directions in which the rows do not vary are left out.
    """
    if 2 * len(rows) > rows.shape[1]:
        return right_singular(rows, mean, factor)[1][:count]
    some = (rows - mean) * factor[:, None]
    first = max(len(rows) - count, 0)
    squares, left = scipy.linalg.eigh(some @ some.T, subset_by_index=(first, len(rows) - 1))
    kept = squares > LEAST * squares[-1]
    return np.asarray(((left[:, kept] / np.sqrt(squares[kept])).T @ some)[::-1])
