"""The C lifter against the numpy one, term by term, and the exact posterior of a perspective view."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
import segment_posterior as reference
from scipy.optimize import minimize_scalar
from toy_segments import FRONT as AXES
from toy_segments import toy_blob, toy_prior

from gait.bindings.lifter import LiftConfig, Lifter, LiftFlag
from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import axis_rotation
from gait.camera.camera import Camera
from gait.errors import GaitError
from gait.io import blob
from gait.lift.segment.explain import share_along, share_rigid
from gait.lift.smooth import rows as observe

FRAMES, MARKERS = 10, 19
FREEDOM = 4  # of the scale of a motion
CAMERA = Camera(
    width=1280,
    height=720,
    fx=900.0,
    fy=905.0,
    cx=640.0,
    cy=350.0,
    R=Camera.looking([0.0, -7.0, 1.5], [0.0, 0.0, 1.0], (1280, 720), 900.0).R,
    t=Camera.looking([0.0, -7.0, 1.5], [0.0, 0.0, 1.0], (1280, 720), 900.0).t,
    distortion=np.array([-0.2, 0.05, 0.001, -0.002, 0.0]),
)


def known(**changes: object) -> LiftConfig:
    """Settings for a person of exactly the mean stature."""
    return LiftConfig.default(**({"stature_sd": 0.0} | changes))


@cache
def model(size: int = 50, headings: int = 0, components: int = 1) -> tuple[bytes, SegmentPrior]:
    """A toy prior as a blob, and as read from the blob."""
    prior = toy_prior(FRAMES, MARKERS, size, seed=1, components=components, headings=headings)
    contents = toy_blob(prior)
    return contents, SegmentPrior.from_sections(blob.decode(contents, "toy"))


def noise_sd(rng: np.random.Generator, low: float, high: float, missing: float = 0.2) -> np.ndarray:
    """Standard deviations of all observations, infinite if not observed."""
    sd = rng.uniform(low, high, (FRAMES, MARKERS))
    sd[rng.random(sd.shape) < missing] = np.inf
    return sd


def noisy(uv: np.ndarray, sd: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return uv + rng.normal(size=uv.shape) * np.where(np.isfinite(sd), sd, 0)[..., None]


@pytest.mark.parametrize(("angle", "stature_sd"), [(0.0, 0.0), (0.3, 0.09), (2.5, 0.2)])
def test_every_figure_equals_the_numpy_posterior(angle: float, stature_sd: float) -> None:
    contents, prior = model()
    rng = np.random.default_rng(0)
    gaussian = reference.place(prior, heading=angle, stature_sd=stature_sd)
    truth = gaussian.draw(rng)
    sd = noise_sd(rng, 0.01, 0.05)
    uv = noisy(truth @ AXES.T, sd, rng)
    rows = observe.orthographic(observe.Observations(uv, sd), AXES)
    want = reference.infer(gaussian, rows)
    papers, _, _ = reference.dual(gaussian, rows)
    lifter = Lifter(contents, AXES, known(heading=angle, heading_sd=0.0, stature_sd=stature_sd))
    fit = lifter.segment(uv, sd)
    assert fit.log_evidence == pytest.approx(want.log_evidence, rel=1e-9)
    assert fit.log10_volume == pytest.approx(reference.log10_volume(gaussian, rows), rel=1e-11)
    mean, sd = lifter.positions()
    np.testing.assert_allclose(mean, want.points, atol=1e-10)
    np.testing.assert_allclose(sd, want.sd, rtol=1e-6)  # standard deviations are computed in floats
    alpha, covariance = lifter.posterior()
    np.testing.assert_allclose(alpha, want.alpha, atol=1e-9)
    np.testing.assert_allclose(alpha, papers, atol=1e-7)  # the paper's own form
    np.testing.assert_allclose(covariance, want.covariance, atol=1e-12)
    assert np.linalg.eigvalsh(np.eye(len(alpha)) - covariance).min() > -1e-12  # Q <= Lambda
    assert lifter.scale() == pytest.approx(_likeliest_scale(gaussian, rows), rel=1e-5)
    np.testing.assert_allclose(lifter.least_squares(), reference.likelihood_only(gaussian, rows), atol=1e-8)


def _likeliest_scale(gaussian: reference.Gaussian, rows: observe.Rows) -> float:
    """Factor of the modes with the largest evidence; its square is inverse gamma of FREEDOM a priori."""
    own = np.arange(len(gaussian.modes)) < len(gaussian.modes) - gaussian.rigid

    def objective(x: float) -> float:
        modes = gaussian.modes * np.where(own, np.exp(x / 2), 1)[:, None, None, None]
        evidence = reference.infer(replace(gaussian, modes=modes), rows).log_evidence
        return FREEDOM * (x + np.exp(-x)) / 2 - evidence

    return float(
        np.exp(minimize_scalar(objective, bounds=(-3, 3), method="bounded", options={"xatol": 1e-7}).x / 2)
    )


def test_uncertain_displacements_equal_the_numpy_ones() -> None:
    contents, prior = model()
    rng = np.random.default_rng(3)
    gaussian = reference.place(prior)
    sd = noise_sd(rng, 0.01, 0.05)
    uv = noisy(gaussian.draw(rng) @ AXES.T, sd, rng)
    rows = observe.orthographic(observe.Observations(uv, sd), AXES)
    want_sd, want = reference.uncertain_modes(reference.infer(gaussian, rows), 4)
    lifter = Lifter(contents, AXES, known(heading_sd=0.0))
    lifter.segment(uv, sd)
    got_sd, got = lifter.uncertain(4)
    np.testing.assert_allclose(got_sd, want_sd, rtol=1e-8)
    for one, other, size in zip(got, want, want_sd, strict=True):
        assert abs(np.sum(one * other)) == pytest.approx(size, rel=1e-6)
    assert share_along(got[0], np.array([0.0, 1, 0])) > 0.99  # rigid translation in depth
    assert share_rigid(got[0]) > 0.98


def test_drawn_from_the_prior_intervals_cover_the_stated_share() -> None:
    contents, prior = model(size=20)
    lifter = Lifter(contents, AXES, known(heading_sd=0.0))
    rng = np.random.default_rng(7)
    gaussian = reference.place(prior)
    inside, squares, count = [], 0.0, 0
    for _ in range(400):
        truth = gaussian.draw(rng)
        lifter.segment(truth @ AXES.T + rng.normal(size=(FRAMES, MARKERS, 2)) * 0.03, 0.03)
        mean, sd = lifter.positions()
        inside.append(np.abs(mean - truth) < 1.6449 * sd)
        alpha, covariance = lifter.posterior()
        off = alpha - _scores(gaussian, truth)
        squares += off @ np.linalg.solve(covariance, off)
        count += len(alpha)
    assert np.mean(inside) == pytest.approx(0.9, abs=0.01)
    assert squares / count == pytest.approx(1.0, abs=3 * np.sqrt(2 / count) + 0.05)


@pytest.mark.parametrize("far", [1.0, 2.0, 4.0])
def test_scaled_intervals_hold_motions_of_any_distance_from_the_mean(far: float) -> None:
    contents, prior = model(size=20)
    lifter = Lifter(contents, AXES, known(heading_sd=0.0, place_sd=(0.0, 0.0, 0.0)))
    rng = np.random.default_rng(8)
    gaussian = reference.place(prior, ground_sd=0.0, height_sd=0.0)
    inside = {"plain": [], "scaled": []}
    for _ in range(100):
        truth = gaussian.mean + far * (gaussian.draw(rng) - gaussian.mean)
        lifter.segment(truth @ AXES.T + rng.normal(size=(FRAMES, MARKERS, 2)) * 0.003, 0.003)
        mean, sd = lifter.positions()
        for kind, scale in (("plain", 1.0), ("scaled", lifter.scale())):
            inside[kind].append(np.abs(mean - truth)[..., 1] < 1.6449 * scale * sd[..., 1])
    assert 0.8 < np.mean(inside["scaled"]) < 0.95
    assert far == 1.0 or np.mean(inside["plain"]) < 0.8


def _scores(gaussian: reference.Gaussian, truth: np.ndarray) -> np.ndarray:
    """Scores of a draw: least squares over all its coordinates, which have little residual."""
    flat = gaussian.modes.reshape(len(gaussian.modes), -1)
    return np.linalg.lstsq(flat.T, (truth - gaussian.mean).ravel(), rcond=None)[0]


def test_a_perspective_fit_is_the_maximum_of_the_posterior() -> None:
    """The derivative of the negative log posterior, the lens included, vanishes at the solution."""
    contents, prior = model(size=12)
    rng = np.random.default_rng(5)
    truth = reference.place(prior, heading=1.2, ground_sd=0.8).draw(rng, residual=False)
    sd = noise_sd(rng, 2.0, 4.0)
    uv = noisy(CAMERA.project(truth), sd, rng)
    # without residual the noise does not depend on the depth
    lifter = Lifter(contents, CAMERA, known(residual=0.0))
    fit = lifter.segment(uv, sd)
    assert fit.converged
    theta, _ = lifter.posterior()
    unknowns = np.append(theta[:-1], fit.heading)

    def cost(x: np.ndarray) -> float:
        local = prior.mean[0] + np.tensordot(x[:12], prior.modes[0], 1)
        place = x[12:15] * lifter.config.place_sd
        points = prior.stature * local @ axis_rotation(2, x[15]).T + place
        miss = (CAMERA.project(points) - uv) / sd[..., None]
        return 0.5 * float(np.nansum(miss[np.isfinite(sd)] ** 2) + x[:15] @ x[:15])

    steps = 1e-4 * np.eye(len(unknowns))
    slope = [(cost(unknowns + s) - cost(unknowns - s)) / 2e-4 for s in steps]
    curvature = [(cost(unknowns + s) - 2 * cost(unknowns) + cost(unknowns - s)) / 1e-8 for s in steps]
    assert np.max(np.abs(np.array(slope) / np.sqrt(curvature))) < 0.02  # standard deviations from the maximum


@pytest.mark.parametrize("angle", [0.0, 1.0, 3.0, -2.0])
def test_an_unknown_heading_is_found_as_in_numpy(angle: float) -> None:
    contents, prior = model(size=20)
    rng = np.random.default_rng(int(10 * abs(angle)))
    truth = reference.place(prior, heading=angle, ground_sd=1.0).draw(rng)
    sd = np.full((FRAMES, MARKERS), 0.01)
    uv = noisy(truth @ AXES.T, sd, rng)
    observed = observe.Observations(uv, sd)
    person = reference.Person(stature_sd=0.09)  # the default of both, unless a stature is given
    want = reference.explain(prior, lambda _: observe.orthographic(observed, AXES), person)[0]
    floor = LiftConfig.default(place_sd=(reference.GROUND_SD, reference.GROUND_SD, reference.ALONE_FLOOR_SD))
    lifter = Lifter(contents, AXES, floor)
    fit = lifter.segment(uv, sd)
    assert np.cos(fit.heading - angle) > 0.999
    assert np.cos(fit.heading - want.heading) > 1 - 1e-8
    np.testing.assert_allclose(lifter.positions()[0], want.posterior.points, atol=1e-4)


def test_the_component_of_a_mixture_is_chosen_by_evidence() -> None:
    contents, prior = model(size=8, components=3)
    lifter = Lifter(contents, AXES, known(heading_sd=0.0))
    rng = np.random.default_rng(2)
    for component in range(3):
        gaussian = reference.place(prior, component)
        uv = gaussian.draw(rng) @ AXES.T
        fit = lifter.segment(uv, 0.05)
        rows = observe.orthographic(observe.Observations(uv, np.full(uv.shape[:2], 0.05)), AXES)
        score = [
            reference.infer(reference.place(prior, c), rows).log_evidence + np.log(prior.weights[c])
            for c in range(3)
        ]
        assert fit.component == component == int(np.argmax(score))
        assert fit.share == pytest.approx(1 / np.exp(np.subtract(score, max(score))).sum(), rel=1e-6)


@pytest.mark.parametrize("stature_sd", [0.0, 0.09])
def test_a_batch_is_each_segment_alone(stature_sd: float) -> None:
    contents, _ = model()
    rng = np.random.default_rng(4)
    lifter = Lifter(contents, AXES, known(heading=0.5, heading_sd=0.0, stature_sd=stature_sd))
    sd = noise_sd(rng, 0.01, 0.05)
    uv = rng.normal(size=(7, FRAMES, MARKERS, 2))
    with pytest.raises(GaitError):
        lifter.batch(uv)
    lifter.fix(sd)
    together, fixed_sd = lifter.batch(uv), lifter.positions()[1]
    for one, mean in zip(uv, together, strict=True):
        lifter.segment(one, sd)
        np.testing.assert_allclose(mean, lifter.positions()[0], atol=1e-11)
        np.testing.assert_allclose(fixed_sd, lifter.positions()[1], rtol=1e-12)


def test_a_prior_in_the_axes_of_the_world_has_no_heading_to_find() -> None:
    contents, prior = model(size=6, headings=8)
    lifter = Lifter(contents, AXES)
    lifter.segment(np.zeros((FRAMES, MARKERS, 2)), np.inf)
    assert lifter.info.headings == 8 and len(lifter.posterior()[0]) == prior.size + 4  # the stature


def test_intervals_hold_people_of_any_stature() -> None:
    """Assuming the mean stature puts people at a wrong distance with too small an uncertainty.

    If the stature moved the mean alone and not what the modes add, all people would come out nearer.
    """
    contents, prior = model(size=12)
    rng = np.random.default_rng(6)
    inside: dict[str, list[np.ndarray]] = {"default": [], "known": [], "given": []}
    off = []
    for _ in range(60):
        stature = prior.stature + 0.09 * rng.normal()
        gaussian = reference.place(prior, stature=stature, heading=0.4, ground_sd=1.0)
        truth = gaussian.draw(rng)
        uv = CAMERA.project(truth) + 2.0 * rng.normal(size=(FRAMES, MARKERS, 2))
        given = stature + 0.04 * rng.normal()
        for name, config in (
            ("default", LiftConfig.default()),
            ("known", known()),
            ("given", LiftConfig.default(stature=given)),
        ):
            lifter = Lifter(contents, CAMERA, config)
            lifter.segment(uv, 2.0)
            mean, sd = lifter.positions()
            inside[name].append(np.abs(mean - truth) < 1.6449 * sd)
            if name == "default":
                off.append(((mean - truth)[..., 1].mean(), sd[..., 1].mean()))  # depth
    share = {name: float(np.mean(found)) for name, found in inside.items()}
    assert 0.85 < share["default"] < 0.96 and 0.85 < share["given"] < 0.96
    assert share["known"] < 0.75
    error, predicted = np.mean(off, axis=0)
    assert abs(error) < 0.2 * predicted


def test_missing_markers_cost_what_the_sd_state() -> None:
    contents, prior = model(size=20)
    rng = np.random.default_rng(9)
    lifter = Lifter(contents, AXES, known(heading_sd=0.0, place_sd=(10.0, 0.0, 0.03)))
    gaussian = reference.place(prior, ground_sd=0.0)
    found: dict[float, list[tuple[float, float]]] = {0.0: [], 0.3: [], 0.5: []}
    for _ in range(60):
        truth = gaussian.draw(rng)
        for missing, errors in found.items():
            sd = noise_sd(rng, 0.02, 0.02, missing)
            lifter.segment(noisy(truth @ AXES.T, sd, rng), sd)
            mean, sds = lifter.positions()
            errors.append((float(np.mean((mean - truth) ** 2)), float(np.mean(sds**2))))
    rms = {k: np.sqrt(np.mean(v, axis=0)) for k, v in found.items()}
    for error, predicted in rms.values():
        assert error == pytest.approx(predicted, rel=0.1)
    assert rms[0.3][0] < 1.15 * rms[0.0][0]
    assert rms[0.5][0] > rms[0.0][0]


def test_wrong_shapes_and_settings_are_refused() -> None:
    contents, _ = model(size=6)
    lifter = Lifter(contents, CAMERA)
    with pytest.raises(ValueError, match="shape"):
        lifter.segment(np.zeros((FRAMES, MARKERS)))
    with pytest.raises(ValueError, match="shape"):
        lifter.push(1, np.zeros((3, 2)))
    for call in (lifter.positions, lifter.posterior, lifter.scale, lifter.least_squares, lifter.uncertain):
        with pytest.raises(GaitError, match=r"no segment yet; call gait_lift_segment\(\) first"):
            call()
    with pytest.raises(GaitError, match=r"no gain yet; call gait_lift_fix\(\) first"):
        lifter.batch(np.zeros((1, FRAMES, MARKERS, 2)))
    with pytest.raises(ValueError, match="count is 0; give one from 1 to"):
        lifter.uncertain(0)
    with pytest.raises(TypeError, match=r"Lifter\(view=camera\)"):
        Lifter(CAMERA)
    with pytest.raises(TypeError, match=r"takes no 'height'; .* config=LiftConfig.default\(stature=1.8"):
        Lifter(contents, CAMERA, height=1.8)
    with pytest.raises(TypeError, match="no setting 'height'; it has stature, "):
        LiftConfig.default(height=1.8)
    for view in ("x", [1, 2], [[1, 2], [3]], object()):
        with pytest.raises(TypeError, match=r"view is .*; give a Camera \(Camera.read\(FILE\)\), or the dir"):
            Lifter(contents, view)
    with pytest.raises(GaitError, match="stature"):
        Lifter(contents, CAMERA, LiftConfig.default(stature=-1.0))
    for wrong in (-0.5, 1.5, np.nan):
        with pytest.raises(GaitError, match=r"stature_sd (is neither -1 nor in|= .* is outside)"):
            Lifter(contents, CAMERA, LiftConfig.default(stature_sd=wrong))
    with pytest.raises(GaitError, match="axis"):
        Lifter(contents, [[1, 0, 0], [1, 0, 0]])
    with pytest.raises(TypeError):
        LiftConfig.default(nothing=1)
    damaged = bytearray(contents)
    damaged[-1] ^= 1
    with pytest.raises(GaitError, match="checksum"):
        Lifter(bytes(damaged), CAMERA)


def _walk(prior: SegmentPrior, times: np.ndarray, speed: float) -> np.ndarray:
    """The mean's first pose moved along x: with a steady prior it continues forever."""
    start = prior.stature * prior.mean[0, 0]
    return start + np.outer(speed * times, [1.0, 0, 0])[:, None]


def test_a_stream_follows_and_waits_as_set() -> None:
    _, prior = model(size=6)
    drift = 0.03 * np.arange(FRAMES)[None, :, None, None] * np.array([1.0, 0, 0])
    prior = replace(
        prior,
        mean=prior.mean[:, :1] + drift,
        modes=np.repeat(prior.modes[:, :, :1], FRAMES, axis=2),
        residual=np.full_like(prior.residual, 1e-6),
    )
    lifter = Lifter(toy_blob(prior), CAMERA, known(lag=3))
    rng = np.random.default_rng(1)
    times = np.arange(90) / 30.0
    truth = _walk(prior, times - 1.5, 0.03 * prior.stature * prior.fps)
    errors, inside = [], []
    for i, uv in enumerate(CAMERA.project(truth)):
        sd = np.where(rng.random(MARKERS) < 0.2, np.inf, 2.0)
        lifter.push(5000 + round(1e6 * times[i]), uv + 2.0 * rng.normal(size=uv.shape), sd)
        frame = lifter.estimate()
        assert (frame is None) == (i < 3)
        if frame is None or frame.status.name == "INIT":
            continue
        assert frame.frame == i - 3 and not frame.flags & LiftFlag.POOR_FIT
        errors.append(np.linalg.norm(frame.markers - truth[i - 3], axis=1).mean())
        inside.append(np.abs(frame.markers - truth[i - 3]) < 1.645 * frame.sd)
    assert len(errors) == 90 - 14
    assert np.median(errors) < 0.05
    assert 0.8 < np.mean(inside) < 1.0
    lifter.reset()
    assert lifter.estimate() is None


EXTREMES = [(3.0, 1.0), (1e-12, 1.0), (1e-150, 1.0), (1e300, 1.0), (3.0, 1e5), (1e-9, 1e5), (1e-9, 1e300)]


@pytest.mark.parametrize("camera", [{}, {"cx": 1e6}, {"fx": 1e-3}, {"fx": 1e9}, {"fx": 1e9, "fy": 1e9}])
def test_results_are_finite_or_refused(camera):
    """Whatever an input outside every range gives, it is not reported as a result."""
    contents, _ = model(12)
    lifter = Lifter(contents, replace(CAMERA, **camera), LiftConfig.default(lag=2))
    rng = np.random.default_rng(0)
    results = (lifter.positions, lifter.posterior, lifter.scale, lifter.least_squares, lifter.uncertain)
    for sd, scatter in EXTREMES:
        uv = rng.normal(size=(FRAMES, MARKERS, 2)) * 60 * scatter + [640, 350]
        for fit in (partial(lifter.segment, uv, sd), *results, partial(streamed, lifter, uv, sd)):
            try:
                found = fit()
            except GaitError:
                assert camera or sd != 3.0 or scatter > 1.0, "an ordinary segment is refused"
            else:
                assert all(np.isfinite(part).all() for part in numbers(found)), (sd, scatter, fit)


def streamed(lifter: Lifter, uv: np.ndarray, sd: float) -> object:
    """Estimate of a stream; None: nothing was observed."""
    lifter.reset()
    for k in range(FRAMES + 4):
        lifter.push(33_333 * k, uv[k % FRAMES], np.full(MARKERS, sd))
    return lifter.estimate()


def numbers(found: object) -> list[np.ndarray]:
    """All numbers of a result."""
    if found is None:
        return []
    values = vars(found).values() if hasattr(found, "__dict__") else found
    return [np.asarray(value, float) for value in (values if np.iterable(values) else [values])]
