"""Missing entries of cycles by an iterated singular value decomposition (Ormoneit 2000, Fig. 5 steps 3-9).

As in the paper, the completed cycles are centred, described by their first Fourier coefficients, and reduced
to a few components by an SVD, whose reconstruction of the missing entries completes the cycles for the next
pass.  The basis is real and orthonormal, so distances are those of the curves, and contains the mean; then
each pass finds the model nearest to the completed cycles, and the error on the observed entries cannot
increase.
"""

from __future__ import annotations

import numpy as np

from gait.learn.arrays import Floats, Mask, by_rows, stored
from gait.learn.cycles.fourier import decode, encode
from gait.learn.prior.imputation import Filling, column_mean

MOST_ITERATIONS = 500
ERROR_TOLERANCE = 1e-6  # relative decrease of the error at which to stop


def complete(values: Floats, mask: Mask, components: int, basis: Floats) -> Filling:
    """Fill missing entries of values (R, T, M), in memory; `basis` (B, T) is that of means and components."""
    rows, _, channels = values.shape
    completed = np.where(mask, values, column_mean(values, mask))
    errors: list[float] = []
    converged = False
    while not converged and len(errors) < MOST_ITERATIONS:
        coded = encode(completed, basis)
        mean = coded.mean(axis=0)
        left, singular, right = np.linalg.svd(coded - mean, full_matrices=False)
        kept = (left[:, :components] * singular[:components]) @ right[:components]
        model = decode(mean + kept, basis, channels)
        rest = (completed - model)[mask]
        errors.append(float(np.sqrt(np.mean(rest**2))))
        completed = np.where(mask, values, model)
        converged = bool(mask.all()) or (len(errors) > 1 and errors[-1] >= errors[-2] * (1 - ERROR_TOLERANCE))
    filled = stored((completed[part] for part in by_rows(completed)), values.shape[1:])
    return Filling(filled, errors, list(errors), errors[-1] if rows else 0.0, converged)
