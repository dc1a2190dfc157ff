"""Curves over a cycle in the real orthonormal Fourier basis of the first harmonics."""

from __future__ import annotations

import numpy as np

from gait.learn.arrays import Floats, by_rows

CYCLE_HARMONICS = 19
FEWEST_SAMPLES = 4  # samples: one more than a constant, a cosine and a sine


def fourier_basis(samples: int, harmonics: int = CYCLE_HARMONICS) -> Floats:
    """Return the real orthonormal basis (1 + 2 harmonics, samples): constant, cosines and sines."""
    j = np.arange(samples) / samples
    angle = 2 * np.pi * np.outer(np.arange(1, harmonics + 1), j)
    waves = np.stack([np.cos(angle), np.sin(angle)], axis=1).reshape(-1, samples)
    return np.concatenate([np.full((1, samples), 1 / np.sqrt(samples)), waves * np.sqrt(2 / samples)])


def encode(curves: Floats, basis: Floats) -> Floats:
    """Convert curves (n, T, M) to Fourier coefficients (n, B M)."""
    return np.matmul(basis, curves).reshape(len(curves), len(basis) * curves.shape[2])


def encode_all(curves: Floats, basis: Floats) -> Floats:
    """Encode curves (n, T, M) that are on disk."""
    coded = np.empty((len(curves), len(basis) * curves.shape[2]))
    for part in by_rows(curves):
        coded[part] = encode(curves[part], basis)
    return coded


def decode(coded: Floats, basis: Floats, channels: int) -> Floats:
    """Convert Fourier coefficients (n, B M) to curves (n, T, M)."""
    return np.matmul(basis.T, coded.reshape(len(coded), len(basis), channels))


def first_harmonic(signal: Floats, period: float, offset: float = 0.0) -> complex:
    """Fit one cycle per period and a constant to a signal (T,) by least squares: complex amplitude.

    The signal is NaN where missing; the result is 0 if almost nothing is visible.  Period and offset (the
    beginning of the cycle) are frames.
    """
    visible = np.flatnonzero(np.isfinite(signal))
    if len(visible) < FEWEST_SAMPLES:
        return 0j
    angle = 2 * np.pi * (visible - offset) / period
    design = np.stack([np.ones(len(visible)), np.cos(angle), np.sin(angle)], axis=1)
    _, cosine, sine = np.linalg.lstsq(design, signal[visible], rcond=None)[0]
    return complex(cosine, -sine)
