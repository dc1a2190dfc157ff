"""The smoother over a sequence of 2-D keypoints compared with dense algebra, and what it promises."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from toy_segments import toy_prior

from gait.body.skeleton import axis_rotation
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.lift.keypoints.observations import Grid, Observations
from gait.lift.segment.explain import Uncertain
from gait.lift.segment.view import Parallel, Perspective, looking_along
from gait.lift.smooth import block_arrowhead, chain, motion, smoother, soft_constraints
from gait.lift.smooth.chain import Around, Freedom, Segment, overlapping
from gait.lift.smooth.motion import Unlike
from gait.lift.smooth.options import METHODS, Options
from gait.lift.smooth.smoother import Observed, Start, smooth

FRAMES, MARKERS, BLOCKS = 6, 5, 4
LEFT = Uncertain(0.0, *np.zeros((4, 3)))


@pytest.fixture
def prior():
    """World-fixed prior, so that the whole problem is linear."""
    return toy_prior(FRAMES, MARKERS, 5, headings=2)


FREEDOM = Freedom(stature=1.7, stature_sd=1e-3, height_sd=0.05)


def around(prior, blocks=BLOCKS):
    """The mean motion, standing at the origin."""
    half = FRAMES // 2
    places = np.concatenate([1.7 * prior.mean[0], *[1.7 * prior.mean[0, half:]] * (blocks - 2)])
    segments = overlapping(places, half)
    return Around(np.zeros(blocks - 1), np.zeros(blocks - 1, int), 1.7, segments, segments)


def dense(diagonal, below):
    """Whole matrix from its blocks."""
    count, size = diagonal.shape[:2]
    full = np.zeros((count, size, count, size))
    for s in range(count):
        full[s, :, s] = diagonal[s]
    for s in range(count - 1):
        full[s + 1, :, s], full[s, :, s + 1] = below[s], below[s].T
    return full.reshape(count * size, -1)


def whole(information):
    """Whole matrix and vector from blocks and lasting unknowns."""
    inner = dense(information.diagonal, information.below)
    side = information.border.reshape(len(inner), -1)
    matrix = np.block([[inner, side], [side.T, information.corner]])
    return matrix, np.append(information.vector, information.edge)


def test_tridiagonal_is_dense_algebra():
    rng = np.random.default_rng(1)
    base = rng.normal(size=(3, 8, 20))
    diagonal = np.zeros((4, 4, 4))
    below = np.zeros((3, 4, 4))
    for s, rows in enumerate(base):  # each ties two neighbours
        square = rows @ rows.T
        diagonal[s] += square[:4, :4]
        diagonal[s + 1] += square[4:, 4:]
        below[s] += square[4:, :4]
    vector = rng.normal(size=(4, 4))
    full = dense(diagonal, below)
    factor = block_arrowhead.factor(diagonal, below)
    solved = np.linalg.solve(full, vector.ravel())
    np.testing.assert_allclose(factor.solve(vector[..., None]).ravel(), solved, rtol=1e-9)
    assert factor.log_det == pytest.approx(np.linalg.slogdet(full)[1])
    inverse = np.linalg.inv(full).reshape(4, 4, 4, 4)
    same, across = factor.covariance()
    np.testing.assert_allclose(same, [inverse[s, :, s] for s in range(4)], atol=1e-12)
    np.testing.assert_allclose(across, [inverse[s + 1, :, s] for s in range(3)], atol=1e-12)


def test_tridiagonal_refuses_indefinite():
    with pytest.raises(np.linalg.LinAlgError, match="block 1"):
        block_arrowhead.factor(np.stack([np.eye(2), -np.eye(2)]), np.zeros((1, 2, 2)))


def test_border_is_dense_algebra(prior):
    found = chain.chain(chain.Prior(prior), around(prior), FREEDOM)
    full, vector = whole(found.information)
    solution = block_arrowhead.solve(found.information)
    blocks, size = found.information.vector.shape
    mean = np.linalg.solve(full, vector)
    np.testing.assert_allclose(solution.blocks.ravel(), mean[: blocks * size], atol=1e-8)
    np.testing.assert_allclose(solution.lasting, mean[blocks * size :], atol=1e-8)
    assert solution.log_det == pytest.approx(np.linalg.slogdet(full)[1])
    inverse = np.linalg.inv(full)[: blocks * size, : blocks * size].reshape(blocks, size, blocks, size)
    same, across = solution.covariance()
    np.testing.assert_allclose(same, [inverse[s, :, s] for s in range(blocks)], rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(
        across, [inverse[s + 1, :, s] for s in range(blocks - 1)], rtol=1e-5, atol=1e-6
    )


def test_chain_holds_each_overlap_once(prior):
    """Its first segment has the segment's own covariance; its determinant is that of the factors."""
    straight, axes = around(prior), axis_rotation(2, 0.4)
    places = straight.places @ axes.T
    there = replace(straight, heading=straight.heading + 0.4, places=places, grown=places)
    found = chain.chain(chain.Prior(prior), there, FREEDOM)
    full, vector = whole(found.information)
    assert found.log_det == pytest.approx(np.linalg.slogdet(full)[1])
    segment = Segment(chain.Prior(prior), there, FREEDOM, 0)
    outside = prior.gamma * prior.residual[0]
    each = np.tile(np.eye(3 * MARKERS), FRAMES)  # offsets of each marker along each axis, alike in all frames
    changing = np.sqrt((1 - chain.THROUGHOUT) * chain.LASTING / (1 - chain.LASTING)) * segment.sd * each
    lasting = np.sqrt(chain.THROUGHOUT * chain.LASTING * outside + chain.OFFSET_SD**2)
    lasting = there.stature * np.repeat(lasting, 3)[:, None] * each
    modes = there.stature * prior.modes[0].reshape(-1, len(segment.sd))
    wanted = np.diag(segment.sd**2)
    wanted += sum(loads.T @ loads for loads in (segment.own[1:], segment.rigid, modes, changing, lasting))
    turn = np.kron(np.eye(FRAMES * MARKERS), axes)
    wanted = turn @ wanted @ turn.T
    size = len(wanted)
    # Condition 1e9, entries up to 100: rounding leaves 2e-5.
    np.testing.assert_allclose(np.linalg.inv(full)[:size, :size], wanted, rtol=4e-5, atol=2e-5)
    mean = np.linalg.solve(full, vector)
    np.testing.assert_allclose(mean[:size], turn @ segment.own[0], atol=1e-6)
    assert found.constant == pytest.approx(mean @ full @ mean, rel=1e-6)


def test_what_lasts_is_no_surer_for_a_longer_sequence(prior):
    """Without observations the size of the body is as uncertain in a long sequence as in one segment."""
    freedom, blocks = Freedom(stature=1.7, stature_sd=0.1, height_sd=0.05), 12
    found = chain.chain(chain.Prior(prior), around(prior, blocks), freedom)
    covariance = np.linalg.inv(whole(found.information)[0])
    half = np.zeros((blocks, FRAMES // 2, MARKERS, 3))
    half[..., 3, 2], half[..., 0, 2] = 1, -1  # height of one marker over another
    sds = []
    for used in (2, blocks):
        along = np.where(np.arange(blocks)[:, None, None, None] < used, half, 0).ravel()
        along = np.pad(along / (used * FRAMES // 2), (0, len(covariance) - along.size))
        sds.append(np.sqrt(along @ covariance @ along))
    body = 1.7 * (prior.mean[0, :, 3, 2] - prior.mean[0, :, 0, 2]).mean()
    offsets = 2 * (chain.THROUGHOUT * chain.LASTING * prior.gamma * prior.residual[0, [0, 3]].mean())
    least = np.sqrt((0.1 / 1.7 * body) ** 2 + 1.7**2 * (offsets + 2 * chain.OFFSET_SD**2))
    assert sds[1] > 0.99 * least
    assert sds[1] < sds[0]


def drawn(prior, rng):
    """Motion drawn from the chain, (grid, J, 3)."""
    found = chain.chain(chain.Prior(prior), around(prior), FREEDOM)
    matrix, vector = whole(found.information)
    covariance = np.linalg.inv(matrix)
    mean = covariance @ vector
    x = mean + np.linalg.cholesky((covariance + covariance.T) / 2) @ rng.normal(size=len(mean))
    return x[: found.information.vector.size].reshape(-1, MARKERS, 3)


def observed(prior, places, view, sd, rng, missing=0.1):
    """Keypoints between the frames of the grid, and the places observed there."""
    grid = Grid(0.0, prior.fps, BLOCKS, FRAMES // 2)
    time = np.arange(0.0, grid.time[-1], 1 / 30)
    frames, weights = grid.between(time)
    truth = np.einsum("tw,twjc->tjc", weights, places[frames])
    uv = view.project(truth, np.ones(len(time))) + sd * rng.normal(size=(len(time), MARKERS, 2))
    noise = np.where(rng.random(uv.shape[:2]) < missing, np.inf, sd)
    return truth, Observed(time, Observations(uv, noise), np.arange(MARKERS))


def test_smoother_covers_what_is_drawn_from_its_prior(prior):
    """90 % intervals contain 90 % of the coordinates, also in depth; the posterior has the smaller volume."""
    rng = np.random.default_rng(3)
    view = Parallel(looking_along("y"), 1.0, np.zeros(2))
    inside, ratios = [], []
    there = around(prior)
    start = Start(
        there.heading,
        there.component,
        1.7,
        chain.blended(there.places, FRAMES // 2),
        np.ones(BLOCKS * 3),
    )
    for _ in range(40):
        truth, points = observed(prior, drawn(prior, rng), view, 0.01, rng)
        found = smooth(prior, points, view, FREEDOM, start, contact=False, bones=False)
        assert found.settled
        inside.append(np.abs(found.places - truth) < 1.645 * found.sd)
        ratios.append(found.log_volume_ratio)
    assert 0.87 < np.mean(inside) < 0.93
    assert 0.85 < np.mean(np.array(inside)[..., 1]) < 0.95  # the depth
    assert max(ratios) < 0


def test_places_between_frames_are_cubic():
    grid = Grid(0.0, 20.0, 4, 3)
    time = np.linspace(0, grid.time[-1], 31)
    frames, weights = grid.between(time)
    np.testing.assert_allclose(np.sum(weights * grid.time[frames] ** 3, axis=1), time**3, atol=1e-12)


def test_scale_does_not_drift_with_noise():
    """Noise does not pull a body towards the camera: its unknown size stays near the truth."""
    prior = toy_prior(FRAMES, 12, 4, seed=5)
    rng = np.random.default_rng(0)
    camera = Camera.looking((0, -6, 1.4), (0, 0, 0.9), (640, 480), 600)
    body = 1.7 * prior.mean[0]
    time = np.arange(FRAMES * 2) / 20
    places = body[np.minimum(np.arange(FRAMES * 2), FRAMES - 1)]
    uv = camera.project(places) + 3 * rng.normal(size=(*places.shape[:2], 2))
    keypoints = Keypoints(np.arange(len(time)), time, prior.names, uv, np.ones(uv.shape[:2]))
    found = motion.lift(
        prior,
        keypoints,
        Perspective(camera),
        Options(contact=False, bones=False),
        prior.names,
    )
    size = np.linalg.norm(found.places - found.places.mean(axis=1, keepdims=True))
    true = np.linalg.norm(places - places.mean(axis=1, keepdims=True))
    assert size / true == pytest.approx(1, abs=0.05)


def rows_of(prior):
    layout = soft_constraints.Layout(BLOCKS, FRAMES // 2, len(prior.names), None)
    return soft_constraints.Rows(layout)


def residual(rows, places):
    """A x - y of collected rows, squared and summed, with x = places."""
    normal, square = rows.normal()
    x = places.ravel()
    return float(x @ dense(normal.diagonal, normal.below) @ x - 2 * x @ normal.vector.ravel() + square)


def test_bones_cost_nothing_to_a_rigid_or_resized_body():
    prior = toy_prior(FRAMES, 19, 4)
    rng = np.random.default_rng(2)
    body = rng.normal(size=(19, 3))
    turns = [axis_rotation(2, 0.1 * t) for t in range(BLOCKS * FRAMES // 2)]
    places = np.stack([body @ turn.T for turn in turns])
    rows = rows_of(prior)
    soft_constraints.bones(rows, prior.names, places)
    assert residual(rows, places) == pytest.approx(0, abs=1e-6)
    assert residual(rows, 1.1 * places) == pytest.approx(0, abs=1e-6)
    stretched = places * np.linspace(1, 1.2, len(places))[:, None, None]
    assert residual(rows, stretched) > 10


def test_contacts_hold_slow_low_feet_only():
    prior = toy_prior(FRAMES, 19, 4)
    names = list(prior.names)
    places = np.tile(np.random.default_rng(2).normal(size=(19, 3)) + (0, 0, 2), (BLOCKS * 3, 1, 1))
    still, moving = names.index("l_toe"), names.index("r_toe")
    places[:, [still, moving], 2] = 0.0
    places[:, moving, 0] += np.arange(BLOCKS * 3) * 0.1  # 2 m/s
    rows = rows_of(prior)
    sure = soft_constraints.contacts(rows, prior.names, places, 20.0)
    feet = [name for name in soft_constraints.FLOOR_JOINTS if name in names]
    assert sure[:, feet.index("l_toe")].min() > 0.9
    assert sure[:, feet.index("r_toe")].max() < 0.01
    slid = places.copy()
    slid[:, still, 0] += np.arange(BLOCKS * 3) * 0.02
    assert residual(rows, slid) > residual(rows, places) + 1


def test_blending_keeps_what_segments_agree_on():
    values = np.arange(12.0)[:, None]
    np.testing.assert_allclose(chain.blended(overlapping(values, 3), 3), values)


def test_lifting_needs_four_frames():
    prior = toy_prior(3, 4, 3)
    keypoints = Keypoints(
        np.arange(9),
        np.arange(9) / 20,
        prior.names,
        np.ones((9, 4, 2)),
        np.ones((9, 4)),
    )
    view = Parallel(looking_along("y"), 1.0, np.zeros(2))
    with pytest.raises(motion.UserError, match="4 or more"):
        motion.lift(prior, keypoints, view, Options(), prior.names)


def lifted_by(monkeypatch, outcomes):
    """Lift with a smoother whose attempts end as listed, one by one: an error, or chi2 per observation."""
    prior, pending = toy_prior(6, 4, 3), list(outcomes)

    def attempt(of):
        nothing = np.zeros((9, 4, 3))
        if of.options.method == "blend":
            return motion.Motion(
                prior.names, nothing, nothing, nothing, nothing[..., 0], 1.8, 0, True, 0.0, LEFT
            )
        ends = pending.pop(0)
        if isinstance(ends, Exception):
            raise ends
        whole = motion.Motion(
            prior.names, nothing + 1, nothing, nothing, nothing[..., 0], 1.7, 9, False, 0.0, LEFT
        )
        return replace(whole, evidence=-ends, chi2_per_observation=ends)

    monkeypatch.setattr(motion, "_lift", attempt)
    keypoints = Keypoints(np.arange(9), np.arange(9) / 20, prior.names, np.ones((9, 4, 2)), np.ones((9, 4)))
    view = Parallel(looking_along("y"), 1.0, np.zeros(2))
    return motion.lift(prior, keypoints, view, Options(), prior.names), pending


def test_a_wider_prior_is_tried_where_a_narrow_one_fails(monkeypatch):
    found, _ = lifted_by(monkeypatch, [Unlike("1"), Unlike("2"), 1.2])
    assert found.wider == 4 and found.chi2_per_observation == 1.2
    found, pending = lifted_by(monkeypatch, [9.0, 3.0, Unlike("4"), 1.0])
    assert found.wider == 2 and pending == [1.0]


def test_what_no_width_mends_is_refused_as_the_learnt_one_is(monkeypatch):
    with pytest.raises(Unlike, match="1"):
        lifted_by(monkeypatch, [Unlike("1"), Unlike("2"), Unlike("4"), Unlike("8")])
    with pytest.raises(UserError, match="too little"):
        lifted_by(monkeypatch, [UserError("too little"), 1.0])


def test_a_motion_estimated_by_its_segments_is_reported(monkeypatch):
    """Iterations, rest and stature are then those of the segments, not of the smoother that failed."""
    found, _ = lifted_by(monkeypatch, [1.0])  # came to no rest
    assert found.alone and found.settled and found.steps == 0 and found.stature == 1.8
    assert (found.places == 0).all() and found.chi2_per_observation == 1.0


def test_restricted_prior_is_its_marginal(prior):
    part = prior.restricted(prior.names[1:3])
    assert part.mean.shape == (1, FRAMES, 2, 3)
    np.testing.assert_array_equal(part.modes, prior.modes[:, :, :, 1:3])
    uneven = replace(toy_prior(7, 4, 3))
    assert uneven.restricted(uneven.names).frames == 6
    assert Grid.over(np.array([0.0, 1.0]), uneven.restricted(uneven.names)).blocks == 7


@pytest.mark.parametrize("method", METHODS)
def test_without_a_camera_the_lowest_feet_are_on_the_floor(method):
    prior = toy_prior(FRAMES, 19, 4, seed=5)
    time = np.arange(FRAMES * 2) / 20
    places = np.tile(1.7 * prior.mean[0], (2, 1, 1))
    view = Parallel(looking_along("y"), 1.0, np.array([0.0, 3.0]))  # v begins anywhere
    uv = view.project(places, np.ones(len(time)))
    keypoints = Keypoints(np.arange(len(time)), time, prior.names, uv, np.ones(uv.shape[:2]))
    options = Options(method=method, stature=1.7, pixel_sd=0.01, contact=False, bones=False)
    view = replace(view, origin=np.nanmean(uv, axis=(0, 1)))
    found = motion.lift(prior, keypoints, view, options, prior.names)
    feet = [n for n, name in enumerate(prior.names) if name.endswith(("_toe", "_heel", "_ankle"))]
    floor = prior.stature * prior.mean[:, :, feet, 2].min()
    assert feet and np.quantile(found.places[:, feet, 2].min(axis=1), 0.1) == pytest.approx(floor)


@pytest.mark.parametrize("method", METHODS)
def test_sd_about_the_hips_are_those_of_differences(method):
    """About the hips the common displacement, which a distant view does not show, cancels."""
    prior = toy_prior(FRAMES, 12, 4, seed=5)
    time = np.arange(FRAMES * 2) / 20
    drift = np.arange(len(time))[:, None, None] * (prior.mean[0, 1] - prior.mean[0, 0])
    places = 1.7 * (prior.mean[0, 0] + drift)
    view = Parallel(looking_along("y"), 1.0, np.zeros(2))
    uv = view.project(places, np.ones(len(time)))
    keypoints = Keypoints(np.arange(len(time)), time, prior.names, uv, np.ones(uv.shape[:2]))
    options = Options(method=method, stature=1.7, pixel_sd=0.01, contact=False, bones=False)
    found = motion.lift(prior, keypoints, view, options, prior.names)
    assert found.sd[..., 1].min() > 5 and found.rooted_sd[..., 1].max() < 1  # metres
    hips = [prior.names.index(name) for name in smoother.HIP_JOINTS]
    both = found.rooted_sd[:, hips]
    np.testing.assert_allclose(both[:, 0], both[:, 1], rtol=1e-4)  # opposite ends of one difference


def test_numbers_out_of_range_are_refused_in_one_line(monkeypatch):
    """Whatever step they are found in: a segment's equations may fail before those of the sequence."""

    def failing(*_args, **_kwargs):
        raise np.linalg.LinAlgError("not positive definite")

    monkeypatch.setattr(motion.explain, "explanations", failing)
    prior = toy_prior(6, 19, 4)
    uv = np.full((12, 3, 2), 100.0)
    keypoints = Keypoints(np.arange(12), np.arange(12) / 20.0, prior.names[:3], uv, np.ones((12, 3)))
    view = Perspective(Camera.looking((0, -4, 1.5), (0, 0, 0.9), (640, 480), 600))
    for method in ("smooth", "blend"):
        with pytest.raises(UserError, match="not fit any motion that the model knows"):
            motion.lift(prior, keypoints, view, Options(method=method), prior.names)


def test_nothing_before_the_lens_is_refused_in_one_line(monkeypatch):
    rows = smoother.rows_of

    def none(*around):
        found = rows(*around)
        return replace(found, **{part.name: getattr(found, part.name)[:0] for part in fields(found)})

    prior = toy_prior(6, 19, 4)
    camera = Camera.looking((0, -4, 1.5), (0, 0, 0.9), (640, 480), 600)
    uv = 320.0 + 50.0 * np.random.default_rng(1).standard_normal((12, 19, 2))
    keypoints = Keypoints(np.arange(12), np.arange(12) / 20.0, prior.names, uv, np.ones((12, 19)))
    monkeypatch.setattr(smoother, "rows_of", none)
    with pytest.raises(UserError, match="v points down"):
        motion.lift(prior, keypoints, Perspective(camera), Options(), prior.names)


def test_variances_below_zero_by_rounding_are_zero():
    np.testing.assert_array_equal(smoother._roots(np.array([-1e-18, 0.0, 4.0])), [0.0, 0.0, 2.0])
