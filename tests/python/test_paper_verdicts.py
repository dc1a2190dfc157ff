"""Verdicts of `gait paper` follow from the results: a wrong prior, figure or filter changes them."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from gait.learn.segments.corpus import Recorded
from gait.learn.segments.virtual_markers import MARKERS
from gait.lift.report.motion_figures import Strips
from gait.paper import leventon, leventon_figures, verdicts
from gait.report.figures import Drawing
from gait.reproducible import one_thread

MODES = 12  # of the planted Gaussian
TINY = np.full(MODES, 1e-12)  # variances, square metres
AT = dict(
    zip(MARKERS, np.random.default_rng(8).normal(size=(len(MARKERS), 3)) * (0.2, 0.2, 0.5), strict=True)
)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """No pictures, and BLAS in one thread as the command has it."""
    monkeypatch.setattr(Drawing, "png", lambda self: b"PNG")
    monkeypatch.setattr(Strips, "figure", lambda self: Figure())
    with one_thread():
        yield


def motion(name, seed, frames=150):
    """A stiff body that sways and turns as a whole about its middle, differently in each motion."""
    rng, t = np.random.default_rng(seed), np.arange(frames) / 20
    body = np.array([AT[marker] for marker in MARKERS])
    turn = rng.uniform(0.1, 0.4) * np.sin(t * rng.uniform(2, 5))
    sway = 0.05 * np.sin(np.outer(t, rng.uniform(1, 6, 3)) + rng.uniform(0, 6, 3))
    cos, sin, none, one = np.cos(turn), np.sin(turn), 0 * turn, 0 * turn + 1
    turns = np.array([[cos, -sin, none], [sin, cos, none], [none, none, one]]).transpose(2, 0, 1)
    places = np.einsum("tij,kj->tki", turns, body) + sway[:, None]
    return recorded(name, places / leventon.USUAL_STATURE)


def recorded(name, places):
    """Markers (T, J, 3) in statures as a recording."""
    table = np.concatenate([places.reshape(len(places), -1), np.zeros((len(places), 3))], axis=1)
    return Recorded(name, name, Path(name), MARKERS, np.nan, table)


@pytest.fixture(scope="module")
def found():
    """Results of four motions: the Gaussian of all, and the last one with that of the others."""
    motions = [motion(f"m{seed}", seed) for seed in range(4)]
    gaussian = leventon.learn_all(motions[:3])
    gaussian = replace(gaussian, modes=gaussian.modes[:, :MODES], variance=gaussian.variance[:MODES])
    prior = leventon.prior_of(gaussian, leventon.USUAL_STATURE)
    score = leventon.Score(
        0.02, mean=90, floor=5, likelihood=60, bayes=30, covered=0.4, ours=20, ours_covered=0.9
    )
    windows = leventon.cut(motions[3], leventon.WINDOW_FRAMES)
    held = leventon.HeldOut("m3", windows, gaussian, prior, leventon.USUAL_STATURE, (score,) * 3)
    everything = leventon.learn_all(motions)
    return leventon_figures.Segments(motions, everything, [held], held, leventon.example(held))


def verdict(found, figure):
    """Verdict of one of the second paper's figures."""
    made = leventon_figures.entries(found)
    return next(e.verdict for e in made if e.heading.startswith((f"Fig. {figure}:", f"{figure} ")))


def shown(found, **changes):
    """The same results with another Gaussian."""
    held = replace(found.shown, gaussian=replace(found.shown.gaussian, **changes))
    return replace(found, held=[held], shown=held)


@pytest.mark.parametrize(
    ("figure", "right", "wrong", "change"),
    [
        (1, "but fewer sequences", "shorter ones", lambda f: replace(f, motions=[motion("short", 1, 40)])),
        (2, "reproduced; fewer", "far from", lambda f: replace(f, everything=shuffled(f.everything))),
        (3, "reproduced: ", "not reproduced: 0 of", lambda f: shown(f, variance=TINY)),
        (4, "draws are bodies", "no bodies", lambda f: replace(f, everything=shuffled(f.everything))),
        (5, "reproduced: Bayes leaves 50 %", "not reproduced", lambda f: scored(f, bayes=61)),
        (5, "reproduced: Bayes leaves 50 %", "in part: Bayes leaves 97 %", lambda f: scored(f, bayes=58)),
        (5, "are too narrow", "intervals cover", lambda f: scored(f, covered=0.9)),
        ("Volume", "reproduced", "no likely noise", lambda f: shown(f, variance=TINY)),
        (6, "are motions in depth", "not only motions in depth", lambda f: turned_inside_out(f)),
    ],
)
def test_a_wrong_prior_changes_the_verdict(figure, right, wrong, change, found):
    assert right in verdict(found, figure) and wrong not in verdict(found, figure)
    assert wrong in verdict(change(found), figure)


def shuffled(gaussian):
    """The Gaussian with the coordinates of its modes permuted, which is no longer a motion of a body."""
    return replace(gaussian, modes=np.random.default_rng(3).permutation(gaussian.modes))


def scored(found, **changes):
    held = replace(found.shown, scores=tuple(replace(s, **changes) for s in found.shown.scores))
    return replace(found, held=[held], shown=held)


def turned_inside_out(found):
    """A posterior that is least certain of what the view shows best."""
    segment = found.example.segment
    wrong = replace(segment, covariance=np.linalg.inv(segment.covariance))
    return replace(found, example=replace(found.example, segment=wrong))


def test_every_verdict_of_numbers_can_come_out_otherwise():
    """Sentences of the figures whose numbers come from long runs."""
    for function, good, bad in (
        (verdicts.body, (19,), (24,)),
        (verdicts.periods, (True, 1.0, 0, False), (True, 0.5, 9, False)),
        (verdicts.periods, (True, 1.0, 0, False), (False, 1.0, 0, False)),
        (verdicts.offsets, (True, 0.01), (True, 0.3)),
        (verdicts.offsets, (True, 0.01), (False, 0.01)),
        (verdicts.passes, (True, 1.0, 2.0), (True, 2.0, 1.0)),
        (verdicts.components, (1.0, (5.0, 9.0)), (9.0, (5.0, 9.0))),
        (verdicts.components, (1.0, (5.0, 9.0)), (1.0, (8.0, 9.0))),
        (verdicts.tracking, ((9, 9), 10, 1.0, (1, 0)), ((2, 9), 10, 3.0, (8, 0))),
        (verdicts.held, ([10, 9], 10, [30, 30], [40, 40]), ([10, 8], 10, [30, 30], [40, 40])),
        (verdicts.held, ([10, 9], 10, [30, 30], [40, 40]), ([10, 9], 10, [30, 50], [40, 40])),
        (verdicts.at_rest, ([[-3.0], [-9.0]],), ([[3.0], [-9.0]],)),
        (verdicts.without_image, (10.0, 20.0), (-10.0, 20.0)),
        (verdicts.volume, ([-20, -10], 0.05, [0.01, 0.1]), ([-20, -10], 0.5, [0.01, 0.1])),
        (verdicts.volume, ([-20, -10], 0.05, [0.01, 0.1]), ([-10, -20], 0.05, [0.01, 0.1])),
        (verdicts.sequence, ([5.0, 4.0], 100.0, 0.1), ([20.0, 4.0], 100.0, 0.1)),
    ):
        assert function(*good) != function(*bad), function
        assert re.search(r"\b(not?|elsewhere|loses|leaves|part|in 1 of 1 views)\b", function(*bad))
    assert verdicts.held([2, 1], 10, [30, 30], [40, 40]).startswith("not reproduced")
    assert verdicts.kind("reproduced in part: x") == "reproduced in part"
