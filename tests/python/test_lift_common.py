"""Errors that last a whole clip: the estimate moves as predicted, and intervals cover the stated share."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import EVAL15, JOINTS
from gait.lift.smooth.block_arrowhead import factor
from gait.lift.video import descent, fit_clip
from gait.lift.video.descent import Link, information, normal
from gait.simulate.scenario import Scenario
from gait.simulate.stage import set_stage

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
import lift_clicks
import lift_sticks
from test_lift_video import walk

ROUNDS = 6
SMALL = 0.05  # standard deviations
LEAST = 0.03  # metres


def settled(energies, link, states):
    """States of least energy, by undamped steps: a descent ends before changes that small."""
    for _ in range(ROUNDS):
        at = normal(energies, link, states)
        states = states - factor(at.diagonal, at.below).solve(at.gradient)
    return states


@pytest.fixture(scope="module")
def chain():
    """Two segments tied together, observed as the prior's mean, and their states of least energy."""
    prior = SegmentPrior.load()
    clip = lift_sticks.stick_clip(prior, walk(), np.radians(60), seed=1)
    state = clip.mean_state()
    state[-6:-3] = [*walk().joints[0, JOINTS.index("pelvis"), :2], 0.0]
    energies, states = [], []
    for segment in (0, 1):
        start = state.copy()
        start[-6] += segment * clip.hop * 1.2
        energy = clip.energy(segment, 0, start)
        observed = energy.reading.value + energy.residuals(start).reshape(energy.reading.value.shape)
        energies.append(replace(energy, reading=replace(energy.reading, value=observed)))
        states.append(start)
    link = Link(prior.hop, np.sqrt(2) * energies[0].shape.residual)
    return energies, link, settled(energies, link, np.array(states))


def shown_elsewhere(energy, state, error):
    """The same values, read where the figure with an error (in sd) would appear."""
    reading = energy.reading
    places, _ = energy.shape.positions(state, energy.weights, energy.sticks.markers)
    uv, _ = energy.view.project(places)
    pixels = np.array([energy.view.scale(body.mean(axis=0)) for body in places])
    middle = (uv.min(axis=1) + uv.max(axis=1)) / 2
    shift = pixels[:, None] * np.array(descent.SHIFT_SD) * error[:2]
    wrong = uv + shift[:, None] + error[2] * descent.SIZE_SD * (uv - middle[:, None])
    more, plain = (energy.sticks.responses(at, reading.places, reading.blur)[0] for at in (wrong, uv))
    return replace(energy, reading=replace(reading, value=reading.value - np.exp(state[-2]) * (more - plain)))


def markers(energies, states):
    """Places of all markers."""
    return np.array(
        [e.shape.positions(s, e.weights, slice(None))[0] for e, s in zip(energies, states, strict=True)]
    )


@pytest.mark.parametrize("which", [0, 1, 2], ids=["across", "along", "size"])
def test_an_error_moves_the_estimate_as_foretold(chain, which):
    energies, link, states = chain
    moves = descent.moves(energies, information(energies, link, states), states, np.zeros(2))
    error = np.zeros(3)
    error[which] = SMALL
    wrong = [shown_elsewhere(e, s, error) for e, s in zip(energies, states, strict=True)]
    moved = markers(energies, settled(wrong, link, states)) - markers(energies, states)
    foretold = markers(energies, states + SMALL * moves[..., which]) - markers(energies, states)
    assert np.linalg.norm(foretold, axis=-1).mean() > 0.5 * SMALL * LEAST
    assert np.linalg.norm(moved - foretold) < 0.1 * np.linalg.norm(foretold)


def test_without_sensors_there_is_nothing_to_get_wrong(chain):
    energies, link, states = chain
    blind = [replace(energy, reading=None) for energy in energies]
    assert not descent.moves(blind, information(blind, link, states), states, np.ones(2)).any()
    assert np.isnan(fit_clip.fit_correlation(blind, states))


def test_a_drift_is_a_shift_of_each_segment_by_how_far_it_drifted(chain):
    energies, link, states = chain
    factor = information(energies, link, states)
    both, first, second = (
        descent.moves(energies, factor, states, np.array(drifted))
        for drifted in ((0.5, 0.5), (0.5, 0.0), (0.0, 0.5))
    )
    for axis in (0, 1):
        alike = 0.5 / descent.SHIFT_SD[axis] * both[..., axis]
        assert both[..., 3 + axis] == pytest.approx(alike, abs=1e-9)
        assert (first + second)[..., 3 + axis] == pytest.approx(alike, abs=1e-9)


def test_fit_correlation_is_the_share_of_the_sensors_that_the_figure_explains(chain):
    energies, _, states = chain
    assert fit_clip.fit_correlation(energies, states) > 0.99
    rng, found = np.random.default_rng(0), []
    for noise in (0.5, 5.0):
        blurred = []
        for energy in energies:
            value = energy.reading.value
            more = noise * value.std() * rng.normal(size=value.shape)
            blurred.append(replace(energy, reading=replace(energy.reading, value=value + more)))
        found.append(fit_clip.fit_correlation(blurred, states))
    assert found[0] > 0.8 and abs(found[1]) < 0.4


def test_a_figure_that_explains_little_may_have_drifted():
    drifts = [
        fit_clip.drift(alike) for alike in (np.nan, 1.0, fit_clip.FOLLOWING_CORRELATION, 0.6, 0.3, -0.5)
    ]
    assert drifts[:3] == [0.0, 0.0, 0.0]
    assert 0 < drifts[3] < drifts[4] == drifts[5] < 0.3


def stranger(seed):
    """A person with a normative gait, which the prior does not contain."""
    stage = set_stage(Scenario(frames=24, fps=20.0, seed=seed))
    points = stage.walk.points(stage.frames)
    joints = np.stack([points[name] for name in JOINTS], axis=1)
    heading = float(stage.walk.heading[stage.frames[0]])
    return lift_sticks.Walk(list(JOINTS), joints, 20.0, heading, stage.body.stature)


@pytest.mark.long
def test_intervals_cover_the_stated_share(monkeypatch):
    """Stick figures of strangers from ahead to the side; sd are neither three times too small nor large."""
    prior, squares, held = SegmentPrior.load(), [], []
    for angle, seed in ((15, 201), (45, 202), (90, 203)):
        person = stranger(seed)
        clip = lift_sticks.stick_clip(prior, person, np.radians(angle), seed)
        truth = person.joints[:, [JOINTS.index(name) for name in EVAL15]]
        fit, markers = fit_clip.fit_clip(clip), prior.index(EVAL15)
        held.append(lift_clicks.score(clip, fit, truth, EVAL15).coverage)
        squares.append(np.mean(((fit.places[:, markers] - truth) / fit.sd[:, markers]) ** 2))
    assert min(held) > 0.8
    assert 0.4 < np.sqrt(np.mean(squares)) < 1.2
    monkeypatch.setattr(fit_clip, "moves", lambda _c, _f, states, _d: np.zeros((*states.shape, 3)))
    assert np.median(fit_clip.fit_clip(clip, fit.sequence).sd) < 0.95 * np.median(fit.sd)  # it counts
