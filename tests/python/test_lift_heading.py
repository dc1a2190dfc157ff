"""A segment whose heading, place and depth are unknown, seen by a camera: found, with honest uncertainty."""

import numpy as np
import pytest
from segment_posterior import Person, dual, explain, infer, place
from toy_segments import FRONT, toy_prior

from gait.camera.camera import Camera
from gait.lift.keypoints.observations import Observations
from gait.lift.smooth.rows import orthographic, perspective

CAMERA = Camera.looking((0.0, -7.0, 1.6), (0.0, 0.0, 0.9), (640, 480), 700.0)
PIXEL = 1.0


def observed(x, camera, sd, rng, missing=0.0):
    """Pixels of a segment with noise."""
    uv = camera.project(x) + rng.normal(scale=sd, size=(*x.shape[:2], 2))
    gone = rng.uniform(size=x.shape[:2]) < missing
    return Observations(uv, np.where(gone, np.nan, sd))


@pytest.mark.parametrize("heading", [-2.5, -0.3, 0.4, 1.7, 3.0])
def test_heading_and_place_are_found_in_perspective(heading):
    prior, rng = toy_prior(5, 15, 6, seed=3), np.random.default_rng(4)
    truth = place(prior, heading=heading, at=(0.8, 1.5), ground_sd=0, height_sd=0).draw(rng)
    obs = observed(truth, CAMERA, PIXEL, rng, 0.1)
    best, *rest = explain(prior, lambda about: perspective(obs, CAMERA, about))
    error = (best.heading - heading + np.pi) % (2 * np.pi) - np.pi
    sd = best.posterior.covariance[-1, -1] ** 0.5 * 0.4
    assert abs(error) < max(4 * sd, 0.02)
    apart = np.linalg.norm(best.posterior.points - truth, axis=2)
    assert np.median(apart) < 0.05
    assert best.share > 0.9 and sum(e.share for e in [best, *rest]) == pytest.approx(1)


def test_distortion_is_taken_out():
    prior, rng = toy_prior(5, 15, 6, seed=3), np.random.default_rng(4)
    lens = Camera(
        *CAMERA.size, 700, 700, 320, 240, CAMERA.R, CAMERA.t, np.array([-0.2, 0.05, 1e-3, -1e-3, 0])
    )
    truth = place(prior, heading=0.5, ground_sd=0, height_sd=0).draw(rng, residual=False)
    obs = observed(truth, lens, 1e-3, rng)
    rows = perspective(obs, lens, truth)
    assert np.abs(rows.shifted(truth).value).max() < 1e-4
    ideal = perspective(obs, CAMERA, truth)
    assert np.abs(ideal.shifted(truth).value).max() > 1e-2


def test_two_similar_headings_share_the_probability():
    """From the side, without perspective, forwards and backwards look the same for a flat body."""
    prior, rng = toy_prior(4, 12, 4, seed=6), np.random.default_rng(2)
    flat = np.array([1.0, 0, 1])  # all in the plane of x and z: y and -y cannot be distinguished
    prior.mean[...] *= flat
    prior.modes[...] *= flat
    truth = place(prior, heading=0.6, ground_sd=0, height_sd=0).draw(rng, residual=False)
    axes = FRONT
    obs = Observations(truth @ axes.T, np.full(truth.shape[:2], 0.01))
    found = explain(prior, lambda _: orthographic(obs, axes))
    shares = sorted((e.share for e in found), reverse=True)
    assert shares[1] > 0.3
    first, second = (e.heading for e in sorted(found, key=lambda e: -e.share)[:2])
    assert np.cos(first) == pytest.approx(np.cos(second), abs=0.05)
    assert abs(np.sin(first) - np.sin(second)) > 0.5


def test_a_component_explains_its_own_segments():
    prior, rng = toy_prior(4, 12, 4, seed=9, components=3), np.random.default_rng(1)
    for component in range(3):
        truth = place(prior, component, heading=0.2, ground_sd=0, height_sd=0).draw(rng)
        obs = observed(truth, CAMERA, PIXEL, rng)
        best = explain(prior, lambda about, obs=obs: perspective(obs, CAMERA, about))[0]
        assert best.component == component and best.share > 0.99


def test_a_prior_in_the_axes_of_the_world_is_not_turned():
    prior, rng = toy_prior(4, 12, 4, headings=8), np.random.default_rng(1)
    truth = place(prior, ground_sd=0, height_sd=0).draw(rng)
    obs = observed(truth, CAMERA, PIXEL, rng)
    found = explain(prior, lambda about: perspective(obs, CAMERA, about))
    assert [e.heading for e in found] == [0.0]
    assert len(found[0].posterior.alpha) == 4 + 3


def test_an_unknown_stature_is_found_where_the_floor_is_known():
    """From above: the floor shows how far away the person is, and therefore how tall."""
    prior, rng = toy_prior(5, 15, 4, seed=3), np.random.default_rng(4)
    above = Camera.looking((0.0, -6.0, 6.0), (0.0, 0.0, 0.9), (640, 480), 700.0)
    truth = place(prior, stature=1.85, heading=0.3, ground_sd=0, height_sd=0).draw(rng, residual=False)
    obs = observed(truth, above, 0.5, rng)

    def error(person):
        best = explain(prior, lambda about: perspective(obs, above, about), person)[0]
        return np.abs(best.posterior.points - truth).mean()

    known = Person(headings=[0.3], stature_sd=0.1)
    assert error(known) < 0.3 * error(Person(headings=[0.3]))


def test_perspective_of_a_known_place_is_one_linear_problem():
    """Rows at the truth: the posterior is that of a linear measurement, in dual and information form."""
    prior, rng = toy_prior(4, 10, 5), np.random.default_rng(2)
    gaussian = place(prior)
    truth = gaussian.mean + 0.1
    rows = perspective(observed(truth, CAMERA, PIXEL, rng, 0.3), CAMERA, truth)
    assert np.allclose(infer(gaussian, rows).alpha, dual(gaussian, rows)[0], rtol=1e-7, atol=1e-9)
