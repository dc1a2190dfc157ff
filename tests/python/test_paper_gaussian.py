"""Segments exactly as in Leventon and Freeman (1998): one Gaussian, its posterior, joined segments."""

from __future__ import annotations

import numpy as np
import pytest

from gait.learn.segments.virtual_markers import MARKERS
from gait.paper import leventon
from gait.reproducible import one_thread


@pytest.fixture(autouse=True)
def alone():
    """BLAS in one thread, as the command has it."""
    with one_thread():
        yield


def planted(rng, count=60, size=6):
    """Segments of a Gaussian of `size` modes about a body."""
    shape = (leventon.SEGMENT_FRAMES, len(MARKERS), 3)
    body = rng.normal(size=shape) * 0.3
    modes = np.linalg.qr(rng.normal(size=(body.size, size)))[0] * np.geomspace(3.0, 0.5, size)
    return body + (rng.normal(size=(count, size)) @ modes.T).reshape(count, *shape)


def test_the_gaussian_of_segments_has_their_modes_and_no_more():
    gaussian = leventon.learn(planted(np.random.default_rng(1)), turned=False)
    assert gaussian.modes.shape[1] == 6 and gaussian.explained()[5] == pytest.approx(1)
    x = planted(np.random.default_rng(1))[3]
    assert leventon.apart(gaussian.projected(x), x) < 1e-6  # millimetres
    turned = leventon.learn(planted(np.random.default_rng(1)))
    assert turned.modes.shape[1] > 6 and turned.segments == 60


def test_variances_add_up_to_those_of_the_coordinates():
    segments = planted(np.random.default_rng(5))
    gaussian = leventon.learn(segments, turned=False)
    total = segments.reshape(len(segments), -1).var(axis=0, ddof=1).sum()
    assert gaussian.variance.sum() == pytest.approx(total) == pytest.approx(gaussian.spectrum.sum())
    scores = (segments.reshape(len(segments), -1) - gaussian.mean) @ gaussian.modes
    assert gaussian.variance == pytest.approx(scores.var(axis=0, ddof=1))


def test_the_view_collapses_y():
    """Equation 1's P keeps x to the right and z upwards."""
    place = np.array([0.3, -7.0, 1.2])
    assert leventon.PICTURE @ place == pytest.approx([0.3, 1.2])


def test_the_view_alone_is_explained_as_it_is():
    """Least squares of minimum norm in the modes: exact in the picture, without a prior to restrict it."""
    rng = np.random.default_rng(6)
    gaussian = leventon.learn(planted(rng), turned=False)
    alpha = 3 * np.sqrt(gaussian.variance) * rng.normal(size=len(gaussian.variance))
    y = gaussian.segment(alpha) @ leventon.PICTURE.T
    assert gaussian.likelihood_only(y) @ leventon.PICTURE.T == pytest.approx(y, abs=1e-9)
    beyond = y + 0.1 * rng.normal(size=y.shape)
    found = gaussian.likelihood_only(beyond)
    rest = (beyond - found @ leventon.PICTURE.T).ravel()
    assert gaussian.visible.T @ rest == pytest.approx(0, abs=1e-9)


def test_the_least_certain_displacements_are_the_posteriors_longest_axes():
    gaussian = leventon.learn(planted(np.random.default_rng(7)), turned=False)
    found = gaussian.posterior(gaussian.segment(np.zeros(0)) @ leventon.PICTURE.T, 0.05)
    sd, moves = leventon.least_certain(gaussian, found, 3)
    assert sd[0] == pytest.approx(np.sqrt(np.linalg.norm(found.covariance, 2))) and sd[0] > sd[1] > sd[2]
    for length, move in zip(sd, moves, strict=True):
        scores = gaussian.modes.T @ move.ravel()
        assert np.linalg.norm(move) == pytest.approx(length)
        assert found.covariance @ scores == pytest.approx(length**2 * scores)


def test_the_posterior_holds_what_was_drawn_and_equals_the_papers_form():
    """Equation 5 in its dual form; intervals contain 90 %; the volume is that of the singular values."""
    rng, noise = np.random.default_rng(2), 0.05
    gaussian = leventon.learn(planted(rng), turned=False)
    sd = np.sqrt(gaussian.variance)
    inside, squares = [], []
    for _ in range(300):
        alpha = sd * rng.normal(size=len(sd))
        x = gaussian.segment(alpha)
        y = x @ leventon.PICTURE.T + noise * rng.normal(size=(*x.shape[:2], 2))
        found = gaussian.posterior(y, noise)
        off = found.alpha - alpha
        squares.append(off @ np.linalg.solve(found.covariance, off) / len(sd))
        inside.append(np.abs(off) < leventon.WITHIN * np.sqrt(np.diag(found.covariance)))
    assert np.mean(squares) == pytest.approx(1, abs=0.1)
    assert np.mean(inside) == pytest.approx(0.9, abs=0.03)
    design, prior = gaussian.visible, np.diag(gaussian.variance)
    rest = (y - gaussian.segment(np.zeros(0)) @ leventon.PICTURE.T).ravel()
    both = design @ prior @ design.T + noise**2 * np.eye(len(design))
    assert found.alpha == pytest.approx(prior @ design.T @ np.linalg.solve(both, rest), abs=1e-8)
    singular = np.linalg.svd(design * sd / noise, compute_uv=False)
    assert found.log10_volume == pytest.approx(-0.5 * np.log10(1 + singular**2).sum())
    assert leventon.noise_of(gaussian, found.log10_volume) == pytest.approx(noise, rel=1e-6)


def test_joined_segments_continue_in_depth():
    """Segments of one motion that differ only in depth are joined to that motion."""
    rng = np.random.default_rng(3)
    x = rng.normal(size=(leventon.WINDOW_FRAMES, len(MARKERS), 3))
    depth = np.eye(3)[leventon.DEPTH]
    parts = [x[s : s + leventon.SEGMENT_FRAMES] + k * depth for k, s in enumerate(leventon.SEGMENT_STARTS)]
    assert leventon.blended(np.array(parts)) == pytest.approx(x)


def test_the_gaussian_serves_as_a_prior_of_the_package():
    gaussian = leventon.learn(planted(np.random.default_rng(4)), turned=False)
    prior = leventon.prior_of(gaussian, 1.7)
    flat = 1.7 * prior.modes[0].reshape(prior.size, -1)
    assert flat @ flat.T == pytest.approx(np.diag(gaussian.variance), abs=1e-9)
    assert 1.7 * prior.mean[0].ravel() == pytest.approx(gaussian.mean)


def test_overlapping_segments_are_weighted_linearly():
    """Where two overlap, the later one counts 1 to 5 sixths."""
    parts = np.zeros((len(leventon.SEGMENT_STARTS), leventon.SEGMENT_FRAMES, len(MARKERS), 3))
    parts[1, ..., 0] = 6.0
    joined = leventon.blended(parts)[:, 0, 0]
    assert joined[:10] == pytest.approx([0, 0, 0, 0, 0, 1, 2, 3, 4, 5])
