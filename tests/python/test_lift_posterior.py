"""Posterior of a segment: identities that hold exactly."""

from dataclasses import replace

import numpy as np
import pytest
from segment_posterior import dual, infer, likelihood_only, log10_volume, place, uncertain_modes
from toy_segments import FRONT as AXES
from toy_segments import toy_prior

from gait.lift.keypoints.observations import Observations
from gait.lift.segment.explain import share_along, share_rigid
from gait.lift.smooth.rows import Rows, orthographic

DEPTH = np.array([0.0, 1, 0])


def observed(x: np.ndarray, sd: float, rng=None, missing: float = 0.0) -> Observations:
    """Picture of a segment (F, J, 3) in a camera that looks along y."""
    rng = rng or np.random.default_rng(5)
    uv = x @ AXES.T
    unseen = rng.uniform(size=uv.shape[:2]) < missing
    noisy = uv + rng.normal(scale=sd, size=uv.shape)
    return Observations(noisy, np.where(unseen, np.inf, sd))


def measured(gaussian, sd=0.02, missing=0.0, seed=1) -> tuple[np.ndarray, Rows]:
    """A segment from the prior and its rows."""
    rng = np.random.default_rng(seed)
    x = gaussian.draw(rng)
    return x, orthographic(observed(x, sd, rng, missing), AXES)


@pytest.mark.parametrize("sd", [0.005, 0.05])
@pytest.mark.parametrize("missing", [0.0, 0.4])
def test_dual_and_information_form_are_one(sd, missing):
    gaussian = place(toy_prior(6, 9, 12), ground_sd=1.0)
    _, rows = measured(gaussian, sd, missing)
    found, (alpha, covariance, evidence) = infer(gaussian, rows), dual(gaussian, rows)
    for a, b in ((found.alpha, alpha), (found.covariance, covariance)):
        assert np.abs(a - b).max() <= 1e-10 * np.abs(a).max()
    assert found.log_evidence == pytest.approx(evidence, rel=1e-9)


def test_evidence_is_the_density_of_the_measurements():
    gaussian = place(toy_prior(3, 4, 5), ground_sd=0.5)
    _, rows = measured(gaussian)
    n = len(rows.frame)
    pick = np.zeros((2 * n, gaussian.mean.size))
    for k in range(n):
        at = 3 * (rows.frame[k] * 4 + rows.marker[k])
        pick[2 * k : 2 * k + 2, at : at + 3] = rows.direction[k]
    modes = gaussian.modes.reshape(len(gaussian.modes), -1)
    covariance = modes.T @ modes + np.diag(np.tile(np.repeat(gaussian.residual, 3), 3))
    noise = pick @ covariance @ pick.T + np.diag(rows.variance.ravel())
    y = rows.shifted(gaussian.mean).value.ravel()
    wanted = -0.5 * (y @ np.linalg.solve(noise, y) + np.linalg.slogdet(noise)[1] + len(y) * np.log(2 * np.pi))
    found = infer(gaussian, rows)
    assert found.log_evidence == pytest.approx(wanted, rel=1e-9)
    gain = covariance @ pick.T @ np.linalg.inv(noise)
    mean = gaussian.mean + (gain @ y).reshape(gaussian.mean.shape)
    assert np.allclose(found.points, mean, atol=1e-9)
    after = covariance - gain @ pick @ covariance
    assert np.allclose(found.sd**2, np.diag(after).reshape(gaussian.mean.shape), rtol=1e-6, atol=1e-11)


def test_the_posterior_is_symmetric_positive_and_within_the_prior():
    gaussian = place(toy_prior(5, 8, 10))
    _, rows = measured(gaussian)
    q = infer(gaussian, rows).covariance
    assert np.array_equal(q, q.T)
    assert np.linalg.eigvalsh(q).min() > 0
    assert np.linalg.eigvalsh(np.eye(len(q)) - q).min() > -1e-12
    assert (np.diag(q) <= 1 + 1e-12).all()


def test_volume_ratio_is_the_closed_form_and_falls_with_the_noise():
    gaussian = place(toy_prior(5, 8, 10), height_sd=0, ground_sd=1)
    ratios = []
    for sd in (0.005, 0.02, 0.05, 0.1, 0.2, 1.0):
        _, rows = measured(gaussian, sd)
        ratios.append(infer(gaussian, rows).log10_volume)
        assert ratios[-1] == pytest.approx(log10_volume(gaussian, rows), rel=1e-9)
    assert (np.diff(ratios) > 0).all() and ratios[-1] < 0


def test_the_slope_of_the_volume_counts_the_modes_that_the_noise_leaves():
    """F5: a mode of s >> sigma adds 1 to d log10 V / d log10 sigma, one of s << sigma none (no residual)."""
    gaussian = place(toy_prior(5, 8, 10), height_sd=0, ground_sd=1)
    gaussian = replace(gaussian, residual=np.zeros(8))
    _, unit = measured(gaussian, 1.0)
    s = np.linalg.svd(infer(gaussian, unit).system.design, compute_uv=False)
    depth = s < 1e-6 * s[0]  # displacement along y, which is never seen
    assert depth.sum() == 1
    step, volumes = 1e-4, []
    few, all_shown = 1e4 * s[0], 1e-4 * s[~depth].min()
    for sd in (all_shown, *np.geomspace(0.001, 10, 9), few):
        low, at, high = (infer(gaussian, measured(gaussian, sd * 10**x)[1]) for x in (-step, 0, step))
        assert at.log10_volume == pytest.approx(-0.5 * np.log10(1 + s**2 / sd**2).sum(), rel=1e-9, abs=1e-12)
        slope = (high.log10_volume - low.log10_volume) / (2 * step)
        assert at.resolved == pytest.approx(slope, abs=1e-5)
        assert at.resolved == pytest.approx(np.sum(s**2 / (s**2 + sd**2)), abs=1e-6)
        volumes += [low.log10_volume, at.log10_volume, high.log10_volume]
        if sd in (few, all_shown):
            assert at.resolved == pytest.approx((s > sd).sum(), abs=1e-5)
    assert (np.diff(volumes) > 0).all()


def test_what_is_projected_is_the_nearest_segment_of_the_modes():
    gaussian = place(toy_prior(5, 8, 10))
    rng = np.random.default_rng(7)
    inside = gaussian.draw(rng, residual=False)
    np.testing.assert_allclose(gaussian.projected(inside), inside, atol=1e-10)
    x = gaussian.draw(rng)
    found = gaussian.projected(x)
    flat = gaussian.modes.reshape(len(gaussian.modes), -1)
    np.testing.assert_allclose(flat @ (x - found).ravel(), 0, atol=1e-10)
    assert np.linalg.norm(x - found) > 0


def test_posterior_covers_what_is_drawn_from_the_prior():
    """F3: 90 % intervals of scores and of coordinates cover 0.900 +- 0.005; NEES per dimension is 1."""
    gaussian, rng, draws = place(toy_prior(4, 6, 8), ground_sd=0.5), np.random.default_rng(3), 4000
    modes = gaussian.modes.reshape(len(gaussian.modes), -1)
    inside, within, nees = [], [], []
    for _ in range(draws):
        alpha = rng.normal(size=len(modes))
        x = gaussian.mean + (alpha @ modes).reshape(gaussian.mean.shape)
        x += rng.normal(size=x.shape) * np.sqrt(gaussian.residual)[:, None]
        found = infer(gaussian, orthographic(observed(x, 0.05, rng, 0.2), AXES))
        error = alpha - found.alpha
        inside.append(np.abs(error) < 1.6449 * np.sqrt(np.diag(found.covariance)))
        nees.append(error @ np.linalg.solve(found.covariance, error))
        within.append(np.abs(x - found.points) < 1.6449 * found.sd)
    k = len(modes)
    assert abs(np.mean(inside) - 0.9) < 0.005
    assert abs(np.mean(within) - 0.9) < 0.005
    assert abs(np.mean(nees) / k - 1) < 3 * np.sqrt(2 / (k * draws))


def test_the_least_certain_mode_is_displacement_in_depth():
    """F6: no orthographic view shows how far away the person is."""
    gaussian = place(toy_prior(5, 10, 12))
    _, rows = measured(gaussian)
    found = infer(gaussian, rows)
    sd, modes = uncertain_modes(found, 5)
    assert share_along(modes[0], DEPTH) >= 0.999 and share_rigid(modes[0]) >= 0.99
    assert (np.diff(sd) <= 0).all() and np.allclose(np.sum(modes**2, axis=(1, 2, 3)), 1)
    flat = modes.reshape(5, -1)
    full = gaussian.modes.reshape(len(gaussian.modes), -1)
    along = flat @ full.T
    assert np.allclose(along @ found.covariance @ along.T, np.diag(sd**2), atol=1e-9)


def test_an_unknown_place_in_depth_stays_as_unknown_as_it_was():
    gaussian = place(toy_prior(4, 6, 6), ground_sd=10, height_sd=0)
    _, rows = measured(gaussian)
    found = infer(gaussian, rows)
    along_x, along_y = np.sqrt(np.diag(found.covariance)[-2:])
    assert along_y == pytest.approx(1, abs=1e-3) and along_x < 0.05


def test_likelihood_only_is_least_squares_of_minimum_norm():
    gaussian = place(toy_prior(3, 5, 40, seed=4), ground_sd=0, height_sd=0)  # more modes than measurements
    _, rows = measured(gaussian)
    found = likelihood_only(gaussian, rows)
    residual = rows.shifted(found).value
    assert np.abs(residual).max() < 1e-9  # interpolates
    norm = np.linalg.norm(gaussian.modes.reshape(40, -1), axis=1)
    basis = gaussian.modes.reshape(40, -1) / norm[:, None]
    scores = np.linalg.lstsq(basis.T, (found - gaussian.mean).ravel(), rcond=None)[0]
    design = np.einsum("nai,mni->nam", rows.direction, basis.reshape(40, 3, 5, 3)[:, rows.frame, rows.marker])
    design = design.reshape(-1, 40)
    null = np.linalg.svd(design)[2][np.linalg.matrix_rank(design) :]
    assert len(null) and np.abs(null @ scores).max() < 1e-9
    flat = replace(
        gaussian, modes=1e4 * basis.reshape(gaussian.modes.shape), residual=np.zeros_like(gaussian.residual)
    )
    assert np.abs(infer(flat, rows).subspace - found).max() < 1e-4  # its limit for a prior without influence


@pytest.mark.parametrize("missing", [0.1, 0.3, 0.5])
def test_missing_markers_cost_what_the_posterior_states(missing):
    """F11: the error with rows dropped is that of the analytic covariance."""
    gaussian, rng = place(toy_prior(6, 10, 8), ground_sd=0.2), np.random.default_rng(8)
    errors, expected = [], []
    for _ in range(200):
        x = gaussian.draw(rng)
        found = infer(gaussian, orthographic(observed(x, 0.03, rng, missing), AXES))
        errors.append(np.mean((found.points - x) ** 2))
        expected.append(np.mean(found.sd**2))
    assert np.mean(errors) == pytest.approx(np.mean(expected), rel=0.15)


def test_nothing_observed_leaves_the_prior():
    gaussian = place(toy_prior())
    x = gaussian.draw(np.random.default_rng(0))
    nothing = Observations(np.full((*x.shape[:2], 2), np.nan), np.full(x.shape[:2], np.inf))
    found = infer(gaussian, orthographic(nothing, AXES))
    assert np.array_equal(found.points, gaussian.mean) and found.log_evidence == 0
    assert np.allclose(found.covariance, np.eye(len(gaussian.modes)))


def test_subspace_estimate_is_the_papers():
    """x = m + U alpha with Var(x) = U Q U' + gamma psi; observations outside the modes reduce it."""
    gaussian = place(toy_prior(4, 6, 6))
    _, rows = measured(gaussian)
    found = infer(gaussian, rows)
    modes = gaussian.modes.reshape(len(gaussian.modes), -1)
    variance = np.einsum("md,mn,nd->d", modes, found.covariance, modes).reshape(gaussian.mean.shape)
    variance += gaussian.residual[:, None]
    unseen = found.points - found.subspace
    assert np.abs(unseen[..., 1]).max() < 1e-12  # what was not measured, depth, is not moved
    assert (found.sd**2 <= variance + 1e-12).all()
    assert np.allclose(found.sd[..., 1] ** 2, variance[..., 1])
