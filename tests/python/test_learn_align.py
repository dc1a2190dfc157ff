"""Alignment of sequences to one cycle (L5, L6)."""

import gait_generator as g
import numpy as np
import pytest
from learn_measures import falls, gauge_free, persons

from gait.learn.cycles import align


@pytest.mark.parametrize("start", [None, 0.0], ids=["xcorr", "zeros"])
def test_offsets_are_found_below_a_frame(start):
    errors = {}
    for style in (0, 2, 4):
        errors[style] = []
        for seed in range(3):
            signals, periods, true = persons(np.random.default_rng([seed, style]), float(style))
            found = align.align(signals, periods, None if start is None else np.zeros(len(signals)))
            errors[style].extend(np.abs(gauge_free(found.offsets, true, periods)))
            assert falls(found.objective) and found.converged
            assert len(found.objective) <= 12
        assert np.max(errors[style]) < 0.1 * 90
    together = np.concatenate(list(errors.values()))
    assert np.median(together) <= 0.25 and np.quantile(together, 0.95) <= 1.2
    assert np.median(errors[0]) < 0.05


def spoil(monkeypatch, passes, wrong):
    """After so many passes over 8 people, shift all offsets by so many frames, alternately up and down."""
    calls, best_offset = [], align._Sequence.best_offset

    def spoiled(sequence, table, weights, now):
        calls.append(now)
        off = wrong * (-1) ** len(calls) if len(calls) > passes * 8 else 0.0
        return best_offset(sequence, table, weights, now) + off

    monkeypatch.setattr(align._Sequence, "best_offset", spoiled)


def test_a_step_that_makes_it_worse_is_shown_and_taken_back(monkeypatch):
    signals, periods, true = persons(np.random.default_rng(6), 2.0)
    good = align.align(signals, periods, np.zeros(len(signals)))
    spoil(monkeypatch, 2, 10.0)
    bad = align.align(signals, periods, np.zeros(len(signals)))
    assert not falls(bad.objective) and not bad.converged
    assert bad.objective[:3] == good.objective[:3] and len(bad.objective) == 4
    assert np.max(np.abs(gauge_free(bad.offsets, true, periods))) < 3


def test_a_rise_too_small_to_act_on_is_the_end_and_taken_back(monkeypatch):
    signals, periods, true = persons(np.random.default_rng(6), 2.0)
    good = align.align(signals, periods, np.zeros(len(signals)))
    spoil(monkeypatch, len(good.objective) - 1, 0.01)
    end = align.align(signals, periods, start=good.offsets)
    rise = end.objective[-1] / end.objective[-2] - 1
    assert 0 < rise < align.ALIGNMENT_TOLERANCE and end.converged
    assert np.array_equal(end.offsets, good.offsets)


def test_missing_blocks_do_not_bias_the_offsets():
    rng = np.random.default_rng(1)
    signals, periods, true = persons(rng, 2.0)
    signals = [g.remove_blocks(rng, z, 0.3) for z in signals]
    found = align.align(signals, periods)
    assert np.max(np.abs(gauge_free(found.offsets, true, periods))) < 1.5


def test_a_common_shift_of_the_phases_changes_nothing_else():
    signals, periods, _ = persons(np.random.default_rng(2), 2.0)
    cut = [z[17:] for z in signals]
    first, second = align.align(signals, periods), align.align(cut, periods)
    moved = gauge_free(second.offsets, first.offsets - 17, periods)
    assert np.max(np.abs(moved)) < 0.6  # the 17 frames themselves are data


HIPS = (7, 15)  # right and left hip flexion of the generator


def test_a_constant_added_to_all_phases_gives_the_same_curves():
    """L6: the gauge removes it, so that model files of different runs agree."""
    signals, periods, _ = persons(np.random.default_rng(3), 2.0)
    begin = align.align(signals, periods).offsets
    curves = []
    for phase in (0.0, 0.123456, 0.5):
        found = align.align(signals, periods, start=begin + phase * periods, hips=HIPS)
        curves.append(align.common_curve(signals, periods, found.offsets))
    for other in curves[1:]:
        assert np.max(np.abs(other - curves[0])) < 1e-6


def test_the_hips_gauge_is_a_cosine_of_right_minus_left():
    signals, periods, _ = persons(np.random.default_rng(4), 0.0)
    found = align.align(signals, periods, hips=HIPS)
    curve = align.common_curve(signals, periods, found.offsets)
    first = np.fft.fft(curve[:, HIPS[0]] - curve[:, HIPS[1]])[1]
    assert abs(np.angle(first)) / (2 * np.pi) < 2e-3
    broad = np.zeros((len(curve), 24))
    broad[:, align.HIP_COLUMNS] = np.roll(curve[:, HIPS], 100, axis=0)
    assert align.hip_phase(broad) == pytest.approx(100 / len(curve), abs=2e-3)


def test_sequences_without_whole_angles_are_aligned_by_the_others():
    """One has no upper body, one no legs, one nothing but the left knee; no sequence has neck_z."""
    signals, periods, true = persons(np.random.default_rng(5), 2.0)
    legs = [7, 8, 9, 10, 15, 16, 17, 18]
    signals[1][:, [k for k in range(19) if k not in legs]] = np.nan
    signals[2][:, legs] = np.nan
    signals[4][:, [k for k in range(19) if k != 18]] = np.nan
    for z in signals:
        z[:, 2] = np.nan
    for start in (None, np.zeros(len(signals))):
        found = align.align(signals, periods, start=start, hips=HIPS)
        assert np.max(np.abs(gauge_free(found.offsets, true, periods))) < 3
        assert np.isfinite(found.weights).all() and found.weights[2] == 0
        assert falls(found.objective) and found.converged
    curve = align.common_curve(signals, periods, found.offsets)
    assert np.isnan(curve[:, 2]).all() and np.isfinite(np.delete(curve, 2, axis=1)).all()


def test_a_first_sequence_of_trunk_alone_is_ambiguous_and_others_start_too():
    """A curve that repeats every step fits at two phases: the initial curve comes from several sequences."""
    lower = 0
    for seed in range(4):
        rng = np.random.default_rng(seed)
        signals, periods, true = persons(rng, 0.0)
        for z, p, o in zip(signals, periods, true, strict=True):
            z[:, 0] = 3 * np.cos(4 * np.pi * (np.arange(len(z)) - o) / p) + rng.normal(scale=0.5, size=len(z))
        signals[0][:, 1:] = np.nan
        found = align.align(signals, periods)
        assert np.max(np.abs(gauge_free(found.offsets[1:], true[1:], periods[1:]))) < 1
        starts = list(align._xcorr_starts(align._Problem(signals, periods, None), found.weights))
        assert len(starts) == align.MOST_FIRST_SEQUENCES
        alone = align.align(signals, periods, start=starts[0])
        assert found.objective[-1] <= alone.objective[-1]
        lower += found.objective[-1] < alone.objective[-1]
    assert lower > 0, "the other starts never helped"


def test_basis_is_periodic_smooth_and_a_partition_of_one():
    basis = align._periodic_basis(np.array([0.0, 1.0, 0.31, 1.31, -0.69]))
    assert basis.sum(axis=1) == pytest.approx(1)
    assert basis[0] == pytest.approx(basis[1])
    assert basis[2] == pytest.approx(basis[3]) and basis[2] == pytest.approx(basis[4])
    step = 1e-3
    around = align._periodic_basis(np.array([-2, -1, 0, 1, 2]) * step)
    third = np.diff(around, 3, axis=0) / step**2
    assert np.max(np.abs(third)) < 50  # of second derivatives of order 20**2: no jump across the seam
