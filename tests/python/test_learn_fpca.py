"""Cycles and their components: imputation, closure, convergence (L7-L12)."""

import gait_generator as g
import numpy as np
import pytest

from gait.learn import cycles, fpca


def oracle(values, mask, modes, noise=1.0):
    """Best linear prediction of the missing entries by one who knows the generator."""
    phase = np.arange(g.GRID) / g.GRID
    mean, curves = g.mean_curves(phase), modes.curves(phase)
    result = values.copy()
    for row, seen in zip(result, mask, strict=True):
        design = curves[:, seen].T
        precision = design.T @ design / noise**2 + np.diag(1 / np.square(g.SCORE_SD))
        scores = np.linalg.solve(precision, design.T @ (row - mean)[seen] / noise**2)
        row[~seen] = (mean + np.einsum("q,qtc->tc", scores, curves))[~seen]
    return result


def rms(a, b, where):
    return float(np.sqrt(np.mean((a - b)[where] ** 2)))


@pytest.fixture(scope="module", params=[(0.05, 1.05), (0.2, 1.05), (0.4, 1.10)], ids=["5%", "20%", "40%"])
def imputed(request):
    share, limit = request.param
    rng = np.random.default_rng(10)
    modes = g.random_modes(rng)
    values, mask, scores = g.cycle_matrix(rng, 80, modes, missing=share)
    return values, mask, scores, modes, fpca.fit(values, mask, 5), limit


def test_imputation_is_near_the_oracle(imputed):
    values, mask, _, modes, found, limit = imputed
    best = rms(oracle(values, mask, modes), values, ~mask)
    assert best == pytest.approx(1.0, abs=0.1)
    assert rms(found.filled, values, ~mask) <= limit * best


def test_imputation_beats_mean_and_line(imputed):
    values, mask, _, _, found, _ = imputed
    error = rms(found.filled, values, ~mask)
    column = np.broadcast_to(np.nanmean(np.where(mask, values, np.nan), axis=0), values.shape)
    line = values.copy()
    for r, c in np.ndindex(values.shape[0], values.shape[2]):
        seen = np.flatnonzero(mask[r, :, c])
        if len(seen):
            line[r, :, c] = np.interp(np.arange(g.GRID), seen, values[r, seen, c], period=g.GRID)
    assert rms(column, values, ~mask) > 5 * error
    assert rms(line, values, ~mask) > 5 * error


def test_passes_descend_and_stop(imputed):
    found = imputed[4]
    assert np.all(np.diff(found.rmse) <= 1e-12)
    assert len(found.rmse) < 100


def test_components_span_the_modes(imputed):
    _, _, scores, modes, found, _ = imputed
    phase = np.arange(g.GRID) / g.GRID
    truth, _ = np.linalg.qr(modes.curves(phase).reshape(5, -1).T)
    cosines = np.linalg.svd(truth.T @ found.curves.reshape(5, -1).T, compute_uv=False)
    angles = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    assert angles.max() <= 5 and np.sort(angles)[2] <= 2
    unit = np.sqrt(g.GRID * 19)
    realised = np.linalg.svd(scores - scores.mean(axis=0), compute_uv=False) / np.sqrt(len(scores) - 1)
    assert found.sd / unit == pytest.approx(realised, rel=0.05)


def test_components_are_orthonormal_with_fixed_signs(imputed):
    flat = imputed[4].curves.reshape(5, -1)
    assert flat @ flat.T == pytest.approx(np.eye(5), abs=1e-9)
    assert np.all(flat[np.arange(5), np.abs(flat).argmax(axis=1)] > 0)


def test_automatic_number_of_components_is_the_generators():
    rng = np.random.default_rng(11)
    values, mask, _ = g.cycle_matrix(rng, 60, g.random_modes(rng), missing=0.2)
    count, errors = fpca.choose(values, mask, np.random.default_rng(1))
    assert abs(count - 5) <= 1
    assert len(errors) == fpca.LARGEST + 1 and errors[0] > 4 * errors[count]


def test_start_of_the_missing_entries_does_not_matter():
    rng = np.random.default_rng(12)
    values, mask, _ = g.cycle_matrix(rng, 40, g.random_modes(rng), missing=0.2)
    by_mean = fpca.fit(values, mask, 5, tolerance=1e-11)
    by_zero = fpca.fit(values, mask, 5, start=np.zeros(values.shape[1:]), tolerance=1e-11)
    assert np.max(np.abs(by_mean.filled - by_zero.filled)) < 1e-3


def test_without_gaps_it_is_the_truncated_svd_of_the_band_limited_data():
    rng = np.random.default_rng(13)
    values, mask, _ = g.cycle_matrix(rng, 30, g.random_modes(rng), missing=0.0)
    found = fpca.fit(values, mask, 3)
    assert len(found.rmse) == 1
    spectrum = np.fft.rfft(values, axis=1)
    spectrum[:, fpca.HARMONICS + 1 :] = 0
    smooth = np.fft.irfft(spectrum, g.GRID, axis=1).reshape(30, -1)
    mean = smooth.mean(axis=0)
    u, s, v = np.linalg.svd(smooth - mean, full_matrices=False)
    assert found.reconstruct().reshape(30, -1) == pytest.approx(mean + (u[:, :3] * s[:3]) @ v[:3], abs=1e-8)
    assert found.sd == pytest.approx(s[:3] / np.sqrt(29))


def test_row_order_does_not_matter():
    rng = np.random.default_rng(14)
    values, mask, _ = g.cycle_matrix(rng, 30, g.random_modes(rng), missing=0.1)
    order = rng.permutation(30)
    first, second = fpca.fit(values, mask, 4), fpca.fit(values[order], mask[order], 4)
    assert second.curves == pytest.approx(first.curves, abs=1e-8)


def test_a_channel_never_seen_in_a_row_is_filled_finitely():
    rng = np.random.default_rng(15)
    values, mask, _ = g.cycle_matrix(rng, 40, g.random_modes(rng), missing=0.1)
    mask[3, :, 5] = False
    mask[7, :, 4:12] = False
    found = fpca.fit(values, mask, 5)
    assert np.isfinite(found.filled).all()
    assert rms(found.filled[[3, 7]], values[[3, 7]], ~mask[[3, 7]]) < 3.0


def seam(curves):
    """Worst step across the seam over the larger of the median step and its neighbours, per derivative."""
    worst = 0.0
    for _ in range(3):
        step = np.abs(np.diff(curves, axis=0, append=curves[:1]))
        usual = np.maximum(np.median(step, axis=0), np.maximum(step[-2], step[0]))
        worst = max(worst, float(np.max(step[-1] / usual)))
        curves = np.diff(curves, axis=0, append=curves[:1])
    return worst


@pytest.fixture(scope="module")
def drifting():
    """Cycles of walkers whose angles creep by 6 degrees per cycle."""
    rng = np.random.default_rng(16)
    modes, signals, periods, offsets = g.random_modes(rng), [], [], []
    for _ in range(12):
        period, frames = rng.uniform(100, 140), 460
        offset = rng.uniform(0, period)
        scores = rng.normal(size=5) * g.SCORE_SD
        z = g.walk(rng, period, frames, offset=offset, noise=0.5, scores=scores, modes=modes)
        signals.append(z + 6.0 * np.arange(frames)[:, None] / period)
        periods.append(period)
        offsets.append(offset)
    return cycles.slice_cycles(signals, np.array(periods), np.array(offsets), g.GRID)


def test_curves_close_though_the_cycles_do_not(drifting):
    found = fpca.fit(drifting.values, drifting.mask, 5)
    assert seam(found.mean) <= 2
    for curve in found.curves:
        assert seam(curve) <= 2


def test_ramp_is_taken_off_complete_cycles(drifting):
    complete = drifting.mask.all(axis=(1, 2))
    assert complete.sum() >= 20
    assert np.median(drifting.ramp[complete]) == pytest.approx(6.0, abs=0.3)
    assert np.all(drifting.ramp[~drifting.mask[:, 0].any(axis=1)] == 0)


def test_cycles_are_numbered_and_short_ones_dropped(drifting):
    assert set(drifting.sequence) == set(range(12))
    assert np.all(drifting.mask.mean(axis=(1, 2)) >= cycles.OBSERVED)
    assert np.all(np.diff(drifting.cycle)[np.diff(drifting.sequence) == 0] == 1)


def test_mask_reaches_no_farther_than_the_data():
    u = np.arange(-10, 300) / 120.0
    z = g.mean_curves(u)
    z[40:70, 2] = np.nan
    values, mask = cycles.resample(u, z, g.GRID)
    grid = np.arange(g.GRID) / g.GRID
    hole = (grid > u[39]) & (grid < u[70])
    assert not mask[hole, 2].any() or (u[70] - u[39]) < 2 * cycles.BRACKET / cycles.INTERVALS
    assert mask[~hole, 2].all() and mask[:, 0].all()
    assert values[mask] == pytest.approx(g.mean_curves(grid)[mask], abs=1.0)
