"""Alignment of sequences to one cycle (L5, L6)."""

import gait_generator as g
import numpy as np
import pytest

from gait.learn import align


def problem(rng, style, noise=3.0, count=8):
    """Signals, periods and true offsets of `count` walkers whose style has a standard deviation, degrees."""
    periods = rng.uniform(90, 150, count)
    offsets = rng.uniform(0, 1, count) * periods
    signals = []
    for period, offset in zip(periods, offsets, strict=True):
        modes = g.random_modes(rng, 5)
        scores = rng.normal(size=5) * style / np.sqrt(5)
        frames = int(rng.integers(300, 500))
        signals.append(g.walk(rng, period, frames, offset=offset, noise=noise, scores=scores, modes=modes))
    return signals, periods, offsets


def gauge_free(found, true, periods):
    """Errors of the offsets in frames after removal of the common phase."""
    phase = np.exp(2j * np.pi * (found - true) / periods)
    phase /= phase.mean() / abs(phase.mean())
    return np.angle(phase) / (2 * np.pi) * periods


@pytest.mark.parametrize("start", ["xcorr", "zeros"])
def test_offsets_are_found_below_a_frame(start):
    errors = {}
    for style in (0, 2, 4):
        errors[style] = []
        for seed in range(3):
            signals, periods, true = problem(np.random.default_rng([seed, style]), float(style))
            found = align.align(signals, periods, start=start)
            errors[style].extend(np.abs(gauge_free(found.offsets, true, periods)))
            assert np.all(np.diff(found.objective) <= 0)
            assert len(found.objective) <= 12
        assert np.max(errors[style]) < 0.1 * 90
    together = np.concatenate(list(errors.values()))
    assert np.median(together) <= 0.25 and np.quantile(together, 0.95) <= 1.2
    assert np.median(errors[0]) < 0.05


def test_missing_blocks_do_not_bias_the_offsets():
    rng = np.random.default_rng(1)
    signals, periods, true = problem(rng, 2.0)
    signals = [g.remove_blocks(rng, z, 0.3) for z in signals]
    found = align.align(signals, periods)
    assert np.max(np.abs(gauge_free(found.offsets, true, periods))) < 1.5


def test_a_common_shift_of_the_phases_changes_nothing_else():
    signals, periods, _ = problem(np.random.default_rng(2), 2.0)
    cut = [z[17:] for z in signals]
    first, second = align.align(signals, periods), align.align(cut, periods)
    moved = gauge_free(second.offsets, first.offsets - 17, periods)
    assert np.max(np.abs(moved)) < 0.6  # the 17 frames themselves are data


def test_basis_is_periodic_smooth_and_a_partition_of_one():
    basis = align.periodic_basis(np.array([0.0, 1.0, 0.31, 1.31, -0.69]))
    assert basis.sum(axis=1) == pytest.approx(1)
    assert basis[0] == pytest.approx(basis[1])
    assert basis[2] == pytest.approx(basis[3]) and basis[2] == pytest.approx(basis[4])
    step = 1e-3
    around = align.periodic_basis(np.array([-2, -1, 0, 1, 2]) * step)
    third = np.diff(around, 3, axis=0) / step**2
    assert np.max(np.abs(third)) < 50  # of second derivatives of order 20**2: no jump across the seam
