"""Segments of a sequence alone, by the C library: equal to the numpy posterior."""

from __future__ import annotations

import numpy as np
import pytest
import segment_posterior as reference
from toy_segments import toy_prior

from gait.camera.camera import Camera
from gait.errors import UserError
from gait.lift.keypoints.observations import Observations
from gait.lift.segment import explain
from gait.lift.segment.explain import Explanation, SegmentLifter
from gait.lift.segment.view import Parallel, Perspective, looking_along
from gait.lift.smooth.rows import orthographic, perspective

CAMERA = Camera.looking((0.0, -7.0, 1.6), (0.0, 0.0, 0.9), (640, 480), 700.0)
FAR = Parallel(looking_along("y"), 1.0, np.zeros(2))
SAME = {"rtol": 1e-6, "atol": 1e-6}


def gaussian(prior, **changes):
    """The prior placed where the lifter expects a person without a camera."""
    return reference.place(prior, height_sd=explain.ANY_HEIGHT, **changes)


def drawn(prior, seed=1, sd=0.01, missing=0.2, heading=0.4):
    """A segment with a heading, and its picture in a view along y."""
    rng = np.random.default_rng(seed)
    x = reference.place(prior, heading=heading, ground_sd=0.5).draw(rng)
    uv = x @ FAR.axes[:2].T + sd * rng.normal(size=(*x.shape[:2], 2))
    return x, Observations(uv, np.where(rng.random(x.shape[:2]) < missing, np.inf, sd))


def test_a_posterior_in_the_axes_of_the_world_is_that_of_numpy():
    """Without a heading all is linear: means, sd, volume, and those about the middle of two markers."""
    prior = toy_prior(6, 9, 8, headings=8)
    _, observed = drawn(prior, heading=0.0)
    lifter = SegmentLifter(prior, FAR, prior.stature, 0.0)
    found = lifter.solve(lifter.explanations(observed)[0])
    wanted = reference.infer(gaussian(prior), orthographic(observed, FAR.axes[:2]))
    np.testing.assert_allclose(found.places, wanted.points, **SAME)
    np.testing.assert_allclose(found.sd, wanted.sd, rtol=1e-5)
    assert found.log10_volume == pytest.approx(wanted.log10_volume, rel=1e-6)
    sd, modes = reference.uncertain_modes(wanted, 3)
    np.testing.assert_allclose(found.mode_sd[:3], sd, rtol=1e-6)
    np.testing.assert_allclose(np.abs(np.sum(found.modes[:3] * modes, axis=(1, 2, 3))), sd, rtol=1e-6)
    about = wanted.rooted_sd(1, 3)
    rooted = found.rooted_sd(np.array([1, 3]))
    assert np.abs(rooted / about - 1).max() < 0.15  # what lies outside the modes is taken as independent


@pytest.mark.parametrize("heading", [-2.5, 0.4, 3.0])
def test_a_heading_is_found_as_by_the_numpy_search(heading):
    prior, rng = toy_prior(6, 15, 6, seed=3), np.random.default_rng(4)
    truth = reference.place(prior, heading=heading, at=(0.8, 1.5), ground_sd=0, height_sd=0).draw(rng)
    observed = Observations(
        CAMERA.project(truth) + rng.normal(size=(*truth.shape[:2], 2)), np.ones(truth.shape[:2])
    )
    lifter = SegmentLifter(prior, Perspective(CAMERA), prior.stature, 0.0)
    best = lifter.explanations(observed)[0]
    found = lifter.solve(best)
    wanted = reference.explain(prior, lambda about: perspective(observed, CAMERA, about))[0]
    turn = (found.heading - wanted.heading + np.pi) % (2 * np.pi) - np.pi
    assert best.share > 0.9 and abs(turn) < 0.02
    assert np.median(np.linalg.norm(found.places - truth, axis=2)) < 0.05


def test_a_person_far_away_is_not_drawn_to_the_origin():
    prior, rng = toy_prior(6, 15, 6, seed=3), np.random.default_rng(4)
    camera = Camera.looking((0.0, -7.0, 2.6), (0.0, 40.0, 0.9), (640, 480), 1400.0)
    truth = reference.place(prior, heading=0.4, at=(3.0, 60.0), ground_sd=0, height_sd=0).draw(rng)
    observed = Observations(camera.project(truth), np.full(truth.shape[:2], 0.3))
    lifter = SegmentLifter(prior, Perspective(camera), prior.stature, 0.0)
    found = lifter.solve(lifter.explanations(observed)[0])
    assert abs((found.places - truth).mean(axis=(0, 1))[1]) < 0.5


def test_similar_headings_share_the_probability_and_the_course_decides():
    """From the side, without perspective, forwards and backwards look the same for a flat body."""
    prior = toy_prior(4, 12, 4, seed=6)
    flat = np.array([1.0, 0, 1])  # all in the plane of x and z: y and -y cannot be distinguished
    prior.mean[...] *= flat
    prior.modes[...] *= flat
    truth = reference.place(prior, heading=0.6, ground_sd=0, height_sd=0).draw(
        np.random.default_rng(2), False
    )
    observed = Observations(truth @ FAR.axes[:2].T, np.full(truth.shape[:2], 0.01))
    found = SegmentLifter(prior, FAR, prior.stature, 0.0).explanations(observed)
    assert found[1].share > 0.3
    assert np.cos(found[0].heading) == pytest.approx(np.cos(found[1].heading), abs=0.05)
    sure = [Explanation(found[1].heading, 0, np.zeros(3), 1.0, observed)]
    assert [e.heading for e in explain.course([sure, found, [], sure])] == [found[1].heading] * 4


def test_wrong_points_are_weighted_down():
    prior = toy_prior(6, 15, 6, seed=3)
    _, observed = drawn(prior, missing=0.0)
    observed.uv[2:4, 5] += 0.5
    best = SegmentLifter(prior, FAR, prior.stature, 0.0).explanations(observed)[0]
    heavy = best.visible.sd > observed.sd
    assert heavy[2:4, 5].all() and heavy.sum() < 6


def test_too_few_observations_are_not_explained():
    prior = toy_prior(6, 15, 6)
    observed = Observations(np.zeros((6, 15, 2)), np.full((6, 15), np.inf))
    assert SegmentLifter(prior, FAR, prior.stature, 0.0).explanations(observed) == []


def test_without_a_prior_modes_have_their_least_squares():
    prior = toy_prior(6, 9, 4, headings=8)
    _, observed = drawn(prior, heading=0.0, missing=0.0)
    lifter = SegmentLifter(prior, FAR, prior.stature, 0.0)
    best = lifter.explanations(observed)
    found = explain.without_prior(prior, FAR, prior.stature, 0.0, best)[0]
    broad = gaussian(prior)
    broad.modes[:4] *= 1e4
    limit = reference.infer(broad, orthographic(observed, FAR.axes[:2]))
    np.testing.assert_allclose(found.places, limit.points, atol=1e-3)
    np.testing.assert_allclose(found.sd, limit.sd, rtol=0.01)
    assert (found.sd >= lifter.solve(best[0]).sd).all()


def test_without_a_prior_modes_that_nothing_shows_are_refused():
    prior = toy_prior(4, 5, 60, seed=4, headings=8)  # 40 numbers seen
    _, observed = drawn(prior, heading=0.0, missing=0.0)
    best = SegmentLifter(prior, FAR, prior.stature, 0.0).explanations(observed)
    with pytest.raises(UserError, match="of 60 modes"):
        explain.without_prior(prior, FAR, prior.stature, 0.0, best)


def test_what_segments_leave_is_the_median_and_depth_comes_first():
    prior = toy_prior(6, 10, 12, headings=8)
    lifter = SegmentLifter(prior, FAR, prior.stature, 0.0)
    fits = []
    for sd in (0.01, 0.03, 0.2):
        fits.append(lifter.solve(lifter.explanations(drawn(prior, sd=sd, heading=0.0)[1])[0]))
    left = explain.summarise(fits, FAR)
    assert left.log10_volume == fits[1].log10_volume
    assert left.along[0] >= 0.999 and left.rigid[0] >= 0.99 and (np.diff(left.sd) <= 0).all()
    # a displacement of all markers by the ground's standard deviation is that many metres of each
    assert left.sd[0] == pytest.approx(10, rel=0.01)
