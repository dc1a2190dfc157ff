"""Functional principal components of cycles with missing entries (Ormoneit 2000, Fig. 5 steps 2-9; R7-R10).

Rows are cycles on a grid of T phases for M channels.  Everything happens in the real orthonormal Fourier
basis of the first harmonics, so means and components close smoothly, and distances are those of the curves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

HARMONICS = 19
ITERATIONS = 500
TOLERANCE = 1e-6
LARGEST = 8  # components that `choose` tries
HELD_OUT = 0.05  # share of the observed entries held out to choose the number of components


@dataclass
class Components:
    """Result of `fit`.

    Attributes
    ----------
    mean : (T, M)
    curves : (q, T, M)
        Orthonormal over all T M entries; the entry of largest magnitude is positive.
    scores : (R, q)
    sd : (q,)
        Standard deviations of the scores, singular value / sqrt(R - 1).
    filled : (R, T, M)
        The data, missing entries replaced by the model's.
    spectrum : (min(R, ..),)
        Share of the variance of the completed data per component.
    rmse : list of float
        Over the observed entries, after each pass; never increases.
    """

    mean: Floats
    curves: Floats
    scores: Floats
    sd: Floats
    filled: Floats
    spectrum: Floats
    rmse: list[float]

    def reconstruct(self) -> Floats:
        """Rows from their scores, (R, T, M)."""
        return self.mean + np.einsum("rk,ktm->rtm", self.scores, self.curves)


def fourier_basis(samples: int, harmonics: int = HARMONICS) -> Floats:
    """Real orthonormal basis (1 + 2 harmonics, samples): constant, cosines and sines."""
    j = np.arange(samples) / samples
    angle = 2 * np.pi * np.outer(np.arange(1, harmonics + 1), j)
    waves = np.stack([np.cos(angle), np.sin(angle)], axis=1).reshape(-1, samples)
    return np.concatenate([np.full((1, samples), 1 / np.sqrt(samples)), waves * np.sqrt(2 / samples)])


def fit(
    values: Floats,
    mask: Mask,
    components: int,
    harmonics: int = HARMONICS,
    start: Floats | None = None,
    tolerance: float = TOLERANCE,
) -> Components:
    """Mean curves, components and scores by alternating the SVD and the filling of missing entries.

    Parameters
    ----------
    values, mask : (R, T, M)
        Data and where they are observed.
    start : (T, M), optional
        Starting value of missing entries; by default the column mean of the observed rows.
    tolerance : float
        Relative decrease of the error at which to stop.
    """
    rows, samples, channels = values.shape
    basis = fourier_basis(samples, harmonics)
    filled = np.where(mask, values, _column_mean(values, mask) if start is None else start)
    rmse: list[float] = []
    complete = bool(mask.all())
    for _ in range(ITERATIONS):
        coded = _encode(filled, basis)
        mean = coded.mean(axis=0)
        _, vectors = np.linalg.eigh((coded - mean) @ (coded - mean).T)
        leading = vectors[:, ::-1][:, :components]
        model = _decode(mean + leading @ (leading.T @ (coded - mean)), basis, channels)
        rmse.append(float(np.sqrt(np.mean((values - model)[mask] ** 2))))
        filled = np.where(mask, values, model)
        if complete or (len(rmse) > 1 and rmse[-2] - rmse[-1] <= tolerance * rmse[-2]):
            break
    left, singular, right = np.linalg.svd(coded - mean, full_matrices=False)
    curves = _decode(right[:components], basis, channels)
    flat = curves.reshape(len(curves), samples * channels)
    sign = np.sign(flat[np.arange(len(flat)), np.abs(flat).argmax(axis=1)])
    return Components(
        mean=_decode(mean[None], basis, channels)[0],
        curves=curves * sign[:, None, None],
        scores=left[:, :components] * singular[:components] * sign,
        sd=singular[:components] / np.sqrt(max(rows - 1, 1)),
        filled=filled,
        spectrum=singular**2 / max(float(np.sum(singular**2)), 1e-300),
        rmse=rmse,
    )


def _encode(curves: Floats, basis: Floats) -> Floats:
    """Curves (n, T, M) to Fourier coefficients (n, B M)."""
    return np.matmul(basis, curves).reshape(len(curves), -1)


def _decode(coded: Floats, basis: Floats, channels: int) -> Floats:
    """Fourier coefficients (n, B M) to curves (n, T, M)."""
    return np.matmul(basis.T, coded.reshape(len(coded), len(basis), channels))


def _column_mean(values: Floats, mask: Mask) -> Floats:
    """Mean (T, M) over the rows where observed; the channel's mean where none is."""
    count = mask.sum(axis=0)
    total = np.where(mask, values, 0).sum(axis=0)
    channel = total.sum(axis=0) / np.maximum(count.sum(axis=0), 1)
    return np.where(count > 0, total / np.maximum(count, 1), channel)


def hold_out(mask: Mask, share: float, rng: np.random.Generator) -> Mask:
    """Choose blocks of observed entries, an eighth of a cycle of one channel and row each; `share` in all."""
    rows, samples, channels = mask.shape
    length = samples // 8
    chosen = np.zeros_like(mask)
    for _ in range(int(share * mask.sum() / length)):
        r, m, t = int(rng.integers(rows)), int(rng.integers(channels)), int(rng.integers(samples))
        chosen[r, (t + np.arange(length)) % samples, m] = True
    return chosen & mask


def choose(
    values: Floats, mask: Mask, rng: np.random.Generator, harmonics: int = HARMONICS, largest: int = LARGEST
) -> tuple[int, Floats]:
    """Find the number of components with the least error on held-out blocks; errors for 0 ... largest."""
    held = hold_out(mask, HELD_OUT, rng)
    errors = []
    for q in range(min(largest, len(values) - 1) + 1):
        model = fit(values, mask & ~held, q, harmonics).reconstruct()
        errors.append(float(np.sqrt(np.mean((model - values)[held] ** 2))))
    return int(np.argmin(errors)), np.array(errors)
