"""Functional principal components of cycles with missing entries (Ormoneit 2000, Fig. 5 steps 2-9).

Rows are cycles on a grid of T phases for M channels.  The analysis uses the real orthonormal Fourier basis of
the first harmonics, so that means and components are smooth and periodic, and distances are those of the
curves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gait.learn.arrays import Floats, Mask, by_rows, stored
from gait.learn.cycles.fourier import decode, encode_all, fourier_basis
from gait.learn.prior.imputation import Filling, complete, right_singular

Fill = Callable[[Floats, Mask, int, Floats], Filling]
"""Fills missing entries of values (R, T, M) with this many components in a Fourier basis (B, T)."""


@dataclass
class Components(Filling):
    """Filled cycles, and their mean curves and q components."""

    mean: Floats  #: (T, M)
    curves: Floats  #: (q, T, M) orthonormal over all T M entries; the entry of largest magnitude is positive
    scores: Floats  #: (R, q)
    sd: Floats  #: (q,) standard deviations of the scores, singular value / sqrt(R - 1)
    spectrum: Floats  #: (min(R, ..),) share of the variance of the completed data per component

    def reconstruct(self, rows: slice = slice(None)) -> Floats:
        """Compute rows (R, T, M) from their scores."""
        return self.mean + np.einsum("rk,ktm->rtm", self.scores[rows], self.curves)


def fit(values: Floats, mask: Mask, components: int, fill: Fill = complete) -> Components:
    """Fill missing entries of values (R, T, M), then compute mean curves, components and scores by an SVD."""
    rows, samples, channels = values.shape
    basis, whole = fourier_basis(samples), bool(mask.all())
    if whole:
        copy = stored((values[part] for part in by_rows(values)), values.shape[1:])
        filling = Filling(copy, [], [], 0.0, converged=True)
    else:
        filling = fill(values, mask, components, basis)
    coded = encode_all(filling.filled, basis)
    mean = coded.mean(axis=0)
    singular, right = right_singular(coded, mean)
    curves = decode(right[:components], basis, channels)
    flat = curves.reshape(len(curves), samples * channels)
    sign = np.sign(flat[np.arange(len(flat)), np.abs(flat).argmax(axis=1)])
    found = Components(
        **vars(filling),
        mean=decode(mean[None], basis, channels)[0],
        curves=curves * sign[:, None, None],
        scores=(coded @ right[:components].T - mean @ right[:components].T) * sign,
        sd=singular[:components] / np.sqrt(max(rows - 1, 1)),
        spectrum=singular**2 / max(float(np.sum(singular**2)), 1e-300),
    )
    if whole:
        squares = sum(float(np.sum((values[p] - found.reconstruct(p)) ** 2)) for p in by_rows(values))
        found.noise = float(np.sqrt(squares / values.size))
        found.rmse, found.objective = [found.noise], [found.noise]
    return found
