"""The paper's completion of cycles (Ormoneit 2000, Fig. 5 steps 3-9): what it fills, keeps and counts."""

import numpy as np
import pytest

from gait.learn.cycles.fourier import decode, encode, fourier_basis
from gait.learn.prior.iterated_svd import complete

ROWS, SAMPLES, CHANNELS, KEPT = 30, 64, 3, 2
BASIS = fourier_basis(SAMPLES)


def drawn(seed=1, noise=0.0):
    """Cycles of a mean far from zero and two components, smooth over the cycle; a fifth missing in blocks."""
    rng = np.random.default_rng(seed)
    smooth = np.zeros((1 + KEPT, len(BASIS), CHANNELS))
    smooth[:, :9] = rng.normal(size=(1 + KEPT, 9, CHANNELS))
    mean, *parts = decode(smooth.reshape(1 + KEPT, -1), BASIS, CHANNELS)
    values = 40 * mean + np.einsum("rk,ktm->rtm", rng.normal(size=(ROWS, KEPT)), np.array(parts))
    values += noise * rng.normal(size=values.shape)
    mask = np.ones(values.shape, bool)
    for row in range(ROWS):
        first = int(rng.integers(0, SAMPLES - 20))
        mask[row, first : first + 38 // CHANNELS, rng.integers(0, CHANNELS)] = False
    return values, mask


def test_twenty_coefficients_are_kept():
    """A constant, and cosine and sine of 1 to 19 cycles: 39 numbers for each angle."""
    basis = fourier_basis(128)
    assert basis.shape == (39, 128) and basis @ basis.T == pytest.approx(np.eye(39))
    time = np.arange(128) / 128
    for harmonic, kept in ((19, True), (20, False)):
        wave = np.cos(2 * np.pi * harmonic * time)[None, :, None]
        assert np.allclose(decode(encode(wave, basis), basis, 1), wave) is kept


def test_what_two_components_explain_is_filled_exactly():
    values, mask = drawn()
    found = complete(np.where(mask, values, 0.0), mask, KEPT, BASIS)
    assert np.array(found.filled)[~mask] == pytest.approx(values[~mask], abs=0.01 * values.std())
    assert found.rmse[-1] < 1e-2 < found.rmse[0]


def test_what_was_observed_stays_as_it_was():
    values, mask = drawn(noise=0.5)
    found = complete(np.where(mask, values, 0.0), mask, KEPT, BASIS)
    assert np.array_equal(np.array(found.filled)[mask], values[mask])


def test_the_error_is_that_of_what_was_observed():
    """Noise remains where entries were observed, and there is none where they were filled."""
    values, mask = drawn(noise=0.5)
    found = complete(np.where(mask, values, 0.0), mask, KEPT, BASIS)
    coded = encode(np.array(found.filled), BASIS)
    mean = coded.mean(axis=0)
    left, singular, right = np.linalg.svd(coded - mean, full_matrices=False)
    model = decode(mean + (left[:, :KEPT] * singular[:KEPT]) @ right[:KEPT], BASIS, CHANNELS)
    rest = values - model
    assert found.rmse[-1] == pytest.approx(np.sqrt(np.mean(rest[mask] ** 2)), rel=1e-4)
    assert found.rmse[-1] > 1.02 * np.sqrt(np.mean((np.array(found.filled) - model) ** 2))


def test_without_gaps_one_pass_is_the_truncated_svd():
    values, _ = drawn(noise=0.5)
    found = complete(values, np.ones(values.shape, bool), KEPT, BASIS)
    coded = encode(values, BASIS)
    singular = np.linalg.svd(coded - coded.mean(axis=0), compute_uv=False)
    beyond = np.sum(values**2) - np.sum(coded**2)  # the band that is left out
    squares = beyond + np.sum(singular[KEPT:] ** 2)
    assert found.converged and found.rmse == [pytest.approx(np.sqrt(squares / values.size))]
