"""Functional principal components of cycles with missing entries (Ormoneit 2000, Fig. 5 steps 2-9).

Rows are cycles on a grid of T phases for M channels.  Everything happens in the real orthonormal Fourier
basis of the first harmonics, so means and components close smoothly, and distances are those of the curves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.learn.cycles.fourier import HARMONICS, decode, encode_all, fourier_basis
from gait.learn.prior.bayes import by_bayes
from gait.learn.prior.impute import Filling, by_svd, column_mean
from gait.learn.prior.singular import right_singular

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

METHODS = {"bayes": by_bayes, "paper": by_svd}


@dataclass
class Components(Filling):
    """Result of `fit`: the filled data, and their mean curves and components.

    Attributes
    ----------
    mean : (T, M)
    curves : (q, T, M)
        Orthonormal over all T M entries; the entry of largest magnitude is positive.
    scores : (R, q)
    sd : (q,)
        Standard deviations of the scores, singular value / sqrt(R - 1).
    spectrum : (min(R, ..),)
        Share of the variance of the completed data per component.
    """

    mean: Floats
    curves: Floats
    scores: Floats
    sd: Floats
    spectrum: Floats

    def reconstruct(self, rows: slice = slice(None)) -> Floats:
        """Rows from their scores, (R, T, M)."""
        return self.mean + np.einsum("rk,ktm->rtm", self.scores[rows], self.curves)


def fit(
    values: Floats,
    mask: Mask,
    components: int,
    harmonics: int = HARMONICS,
    start: Floats | None = None,
    method: str = "bayes",
    **options: float,
) -> Components:
    """Mean curves, components and scores: missing entries filled, then a singular value decomposition.

    Parameters
    ----------
    values, mask : (R, T, M)
        Data and where they are observed.
    start : (T, M), optional
        Starting value of missing entries; by default the column mean of the observed rows.
    method : {"bayes", "paper"}
        How entries are filled: `bayes.by_bayes`, or the paper's `impute.by_svd`.
    **options
        `tolerance` of the method.
    """
    rows, samples, channels = values.shape
    basis = fourier_basis(samples, harmonics)
    how = by_svd if mask.all() else METHODS[method]
    filling = how(
        values, mask, components, basis, column_mean(values, mask) if start is None else start, **options
    )
    coded = encode_all(filling.filled, basis)
    mean = coded.mean(axis=0)
    singular, right = right_singular(coded, mean)
    curves = decode(right[:components], basis, channels)
    flat = curves.reshape(len(curves), samples * channels)
    sign = np.sign(flat[np.arange(len(flat)), np.abs(flat).argmax(axis=1)])
    return Components(
        **vars(filling),
        mean=decode(mean[None], basis, channels)[0],
        curves=curves * sign[:, None, None],
        scores=(coded @ right[:components].T - mean @ right[:components].T) * sign,
        sd=singular[:components] / np.sqrt(max(rows - 1, 1)),
        spectrum=singular**2 / max(float(np.sum(singular**2)), 1e-300),
    )
