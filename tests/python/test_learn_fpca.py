"""Cycles and their components: imputation, closure, convergence (L7-L12)."""

import gait_generator as g
import learn_cases as cases
import numpy as np
import pytest
from learn_measures import falls

from gait.learn.cycles import cutting
from gait.learn.cycles.fourier import CYCLE_HARMONICS, fourier_basis
from gait.learn.prior import components, imputation
from gait.learn.prior.model import anova
from gait.learn.prior.rank import MOST_TRIED_COMPONENTS, choose


@pytest.fixture(
    scope="module", params=[(0.05, 1.02), (0.1, 1.02), (0.2, 1.02), (0.4, 1.03)], ids=lambda p: f"{p[0]:.0%}"
)
def imputed(request):
    share, limit = request.param
    case = cases.walks(np.random.default_rng(10), missing=share)
    return case, components.fit(case.values, case.mask, 5), limit


def test_imputation_is_near_the_oracle(imputed):
    case, found, limit = imputed
    best = case.error(case.oracle())
    assert best == pytest.approx(1.0, abs=0.1)
    assert case.error(found.filled) <= limit * best
    assert found.noise == pytest.approx(1.0, abs=0.02)


def test_imputation_beats_mean_and_line(imputed):
    case, found, _ = imputed
    values, mask, error = case.values, case.mask, case.error(found.filled)
    column = np.broadcast_to(np.nanmean(np.where(mask, values, np.nan), axis=0), values.shape)
    line = values.copy()
    for r, c in np.ndindex(values.shape[0], values.shape[2]):
        visible = np.flatnonzero(mask[r, :, c])
        if len(visible):
            line[r, :, c] = np.interp(np.arange(g.GRID), visible, values[r, visible, c], period=g.GRID)
    assert case.error(column) > 5 * error
    assert case.error(line) > 5 * error


def test_passes_descend_and_stop(imputed):
    _, found, _ = imputed
    assert falls(found.objective)
    assert found.converged and 1 < len(found.objective) == len(found.rmse) < 100
    assert found.rmse[-1] < found.rmse[0]


def test_passes_stop_when_the_bound_hardly_gains():
    """A channel that half of the people never show still changes when the others have converged."""
    case = cases.people(np.random.default_rng(26), missing=0.1)
    cases.without_channel(case, [10], np.flatnonzero(case.subject % 2 == 0))
    problem = imputation.Problem(case.values, case.mask, fourier_basis(g.GRID, CYCLE_HARMONICS))
    start = problem.begin(imputation.column_mean(case.values, case.mask), 8)
    found = imputation.climb(problem, start, tolerance=0.0)  # the model may not move at all
    gains = -np.diff(found.objective)
    assert found.converged and len(gains) < 200
    assert np.all(gains[-imputation.SLOW_PASSES :] < imputation.LEAST_GAIN)
    assert gains[-imputation.SLOW_PASSES - 1] >= imputation.LEAST_GAIN


def test_a_pass_that_makes_it_worse_is_shown_and_not_called_convergence(monkeypatch):
    case, passes = cases.walks(np.random.default_rng(24), rows=30), []
    maximise = imputation.Problem.maximise

    def spoiled(problem, posterior, rows):
        after = maximise(problem, posterior, rows)
        passes.append(after)
        if len(passes) >= 5:
            after.loadings *= 1.2
        return after

    monkeypatch.setattr(imputation.Problem, "maximise", spoiled)
    found = components.fit(case.values, case.mask, 5)
    assert not falls(found.objective) and not found.converged
    assert len(found.objective) == len(found.rmse) == 5
    assert found.rmse[-1] == found.rmse[-2]  # the better is kept
    assert case.error(found.filled) < 1.2 * case.error(case.oracle())


def test_start_of_the_missing_entries_does_not_matter(imputed):
    case, by_mean, _ = imputed
    basis = fourier_basis(g.GRID, CYCLE_HARMONICS)
    by_zero = imputation.complete(case.values, case.mask, 5, basis, np.zeros(case.values.shape[1:]))
    assert np.max(np.abs(by_mean.filled - by_zero.filled)) < 1e-3


def test_too_many_components_hurt_little(imputed):
    case, found, _ = imputed
    for count in (8, 12):
        more = components.fit(case.values, case.mask, count)
        assert case.error(more.filled) <= 1.005 * case.error(found.filled)
        assert more.converged and falls(more.objective)


def test_components_span_the_modes(imputed):
    case, found, _ = imputed
    angles = cases.principal_angles(case.modes, found.curves)
    assert angles.max() <= 5 and np.sort(angles)[2] <= 2
    unit = np.sqrt(g.GRID * 19)
    centred = case.scores - case.scores.mean(axis=0)
    realised = np.linalg.svd(centred, compute_uv=False) / np.sqrt(len(centred) - 1)
    assert found.sd / unit == pytest.approx(realised, rel=0.05)


def test_components_are_orthonormal_with_fixed_signs(imputed):
    flat = imputed[1].curves.reshape(5, -1)
    assert flat @ flat.T == pytest.approx(np.eye(5), abs=1e-9)
    assert np.all(flat[np.arange(5), np.abs(flat).argmax(axis=1)] > 0)


def test_scores_are_the_generators_between_and_within_people():
    case = cases.people(np.random.default_rng(18))
    scores = cases.mode_scores(case, components.fit(case.values, case.mask, 5))
    for k in range(5):
        assert np.corrcoef(scores[:, k], case.scores[:, k])[0, 1] > 0.99
    for found, true in zip(anova(scores, case.subject), anova(case.scores, case.subject), strict=True):
        assert found == pytest.approx(true, rel=0.15)


def test_reference_problem_is_within_a_twentieth_of_the_oracle():
    ratios = []
    for seed in range(5):
        case = cases.reference(np.random.default_rng(seed))
        best = case.error(case.oracle())
        three, five = (case.error(components.fit(case.values, case.mask, q).filled) for q in (3, 5))
        ratios.append(three / best)
        assert five <= 1.05 * three
    assert np.median(ratios) <= 1.05


def test_whole_limbs_are_filled_from_the_others():
    rng = np.random.default_rng(15)
    case = cases.walks(rng, missing=0.1)
    taken = cases.without_limbs(case, rng)
    found = components.fit(case.values, case.mask, 5)
    assert np.isfinite(found.filled).all()
    assert case.error(found.filled, taken) <= 1.1 * case.error(case.oracle(), taken)


@pytest.mark.parametrize(("channels", "limit"), [([10], 1.3), ([3, 4, 5, 6, 11, 12, 13, 14], 1.3)])
def test_people_without_some_channels_are_filled(channels, limit):
    case = cases.people(np.random.default_rng(17), missing=0.1)
    taken = cases.without_channel(case, channels, np.flatnonzero(case.subject == 3))
    found = components.fit(case.values, case.mask, 5)
    assert np.isfinite(found.filled).all()
    assert case.error(found.filled, taken) <= limit * case.error(case.oracle(), taken)


def test_what_no_cycle_has_is_finite():
    case = cases.walks(np.random.default_rng(19), rows=30)
    case.mask[:, :, 4] = False  # a channel of no cycle
    case.mask[:, 30:60, 8] = False  # phases of no cycle
    case.mask[5] = False  # a row without anything
    for count in (0, 5, 29):
        found = components.fit(case.values, case.mask, count)
        assert np.isfinite(found.filled).all() and np.isfinite(found.curves).all()
        assert np.abs(found.filled).max() < 1.5 * np.abs(case.values).max()


def test_data_without_noise_are_completed_exactly():
    case = cases.walks(np.random.default_rng(20), rows=40, noise=0.0)
    for count in (5, 7):
        found = components.fit(case.values, case.mask, count)
        assert case.error(found.filled) < 1e-3
        assert falls(found.objective)


def test_automatic_number_of_components_is_the_generators():
    case = cases.people(np.random.default_rng(11))
    for groups in (None, case.subject):
        count, errors = choose(case.values, case.mask, np.random.default_rng(1), groups)
        assert abs(count - 5) <= 1
        assert len(errors) == MOST_TRIED_COMPONENTS + 1 and errors[0] > 4 * errors[count]


def test_people_held_out_need_no_more_components_than_they_share():
    """What only one person does helps to fill that person's cycles, but not to describe other people."""
    rng = np.random.default_rng(21)
    case = cases.people(rng, subjects=6)
    own = g.random_modes(rng, 6).curves(np.arange(g.GRID) / g.GRID)
    own_scores = 4 * rng.normal(size=len(case.values))
    values = case.values + own_scores[:, None, None] * own[case.subject]
    by_blocks, _ = choose(values, case.mask, np.random.default_rng(1))
    by_people, _ = choose(values, case.mask, np.random.default_rng(1), case.subject)
    assert by_blocks >= 10 and abs(by_people - 5) <= 2


def test_few_cycles_limit_the_number_of_components():
    case = cases.walks(np.random.default_rng(22), rows=5)
    count, errors = choose(case.values, case.mask, np.random.default_rng(1), np.arange(5))
    assert 1 <= count < 5 and len(errors) <= 5


def test_without_gaps_it_is_the_truncated_svd_of_the_band_limited_data():
    values = cases.walks(np.random.default_rng(13), rows=30, missing=0.0).values
    found = components.fit(values, np.ones(values.shape, bool), 3)
    assert len(found.rmse) == 1 and found.converged
    spectrum = np.fft.rfft(values, axis=1)
    spectrum[:, CYCLE_HARMONICS + 1 :] = 0
    smooth = np.fft.irfft(spectrum, g.GRID, axis=1).reshape(30, -1)
    mean = smooth.mean(axis=0)
    u, s, v = np.linalg.svd(smooth - mean, full_matrices=False)
    assert found.reconstruct().reshape(30, -1) == pytest.approx(mean + (u[:, :3] * s[:3]) @ v[:3], abs=1e-8)
    assert found.sd == pytest.approx(s[:3] / np.sqrt(29))


def test_row_order_does_not_matter():
    case, order = cases.walks(np.random.default_rng(14), rows=30), np.random.default_rng(14).permutation(30)
    first = components.fit(case.values, case.mask, 4)
    second = components.fit(case.values[order], case.mask[order], 4)
    assert second.curves == pytest.approx(first.curves, abs=1e-8)


def test_units_do_not_matter():
    case = cases.walks(np.random.default_rng(23), rows=30)
    degrees = components.fit(case.values, case.mask, 4)
    radians = components.fit(np.radians(case.values), case.mask, 4)
    assert np.degrees(radians.filled) == pytest.approx(degrees.filled, abs=1e-7)


@pytest.fixture(scope="module")
def drifting():
    return cases.drifting(np.random.default_rng(16))


def test_curves_close_though_the_cycles_do_not(drifting):
    found = components.fit(drifting.values, drifting.mask, 5)
    assert cases.seam(found.mean) <= 2
    for curve in found.curves:
        assert cases.seam(curve) <= 2


def test_ramp_is_taken_off_complete_cycles(drifting):
    complete = drifting.mask.all(axis=(1, 2))
    assert complete.sum() >= 20
    assert np.median(drifting.ramp[complete]) == pytest.approx(6.0, abs=0.3)
    assert np.all(drifting.ramp[~drifting.mask[:, 0].any(axis=1)] == 0)


@pytest.mark.parametrize("rise", [0.0, 6.0])
def test_cycles_begin_at_the_offset_and_are_closed(rise):
    period, offset = 100.0, 60.0
    u = (np.arange(300) - offset) / period
    z = (np.cos(2 * np.pi * u) + rise * u)[:, None]
    found = cutting.cut_cycles([z], np.array([period]), np.array([offset]), g.GRID)
    grid, whole = np.arange(g.GRID) / g.GRID, found.mask[..., 0].all(axis=1)
    assert found.cycle.tolist() == [0, 1, 2] and whole.tolist() == [False, True, True]
    assert found.mask[0, :, 0].tolist() == (grid >= 0.4).tolist()
    for k, values in zip(found.cycle[whole], found.values[whole, :, 0], strict=True):
        middle = rise * (k - 0.5)  # of the rise over the cycle, which the line to its ends takes off
        assert values == pytest.approx(np.cos(2 * np.pi * grid) + middle, abs=0.02)


def test_cycles_are_numbered_and_short_ones_dropped(drifting):
    assert set(drifting.sequence) == set(range(12))
    assert np.all(drifting.mask.mean(axis=(1, 2)) >= cutting.OBSERVED)
    assert np.all(np.diff(drifting.cycle)[np.diff(drifting.sequence) == 0] == 1)


def test_mask_reaches_no_farther_than_the_data():
    u = np.arange(-10, 300) / 120.0
    z = g.mean_curves(u)
    z[40:70, 2] = np.nan
    values, mask = cutting.resample(u, z, g.GRID)
    grid = np.arange(g.GRID) / g.GRID
    hole = (grid > u[39]) & (grid < u[70])
    assert not mask[hole, 2].any()
    assert mask[~hole, 2].all() and mask[:, 0].all()
    assert values[mask] == pytest.approx(g.mean_curves(grid)[mask], abs=1.0)
