"""The prior that reaches people who were not recorded: mirror images, metric, weights, components."""

import numpy as np
import pytest
from scipy.linalg import subspace_angles

from gait.body.skeleton import CHANNELS, JOINTS, Proportions, default_skeleton, points
from gait.learn.cycles.fourier import decode, encode, fourier_basis
from gait.learn.prior import prior, singular

SAMPLES, HARMONICS = 64, 5
BODY = Proportions()
SECTIONS = default_skeleton(BODY).sections()
BASIS = fourier_basis(SAMPLES, HARMONICS)
PLAIN = np.eye(len(CHANNELS))


def smooth(rng, rows, size=0.1):
    """Random band-limited cycles (rows, SAMPLES, 30)."""
    return (
        size
        * decode(rng.normal(size=(rows, len(BASIS) * len(CHANNELS))), BASIS, len(CHANNELS))
        / np.sqrt(len(BASIS) / SAMPLES)
    )


def flat(curves):
    return curves.reshape(len(curves), -1)


def test_mirrored_twice_is_the_same():
    rows = smooth(np.random.default_rng(1), 3)
    np.testing.assert_array_equal(prior.mirrored(prior.mirrored(rows)), rows)


def test_mirrored_joints_are_the_mirror_image_half_a_cycle_later():
    rows = smooth(np.random.default_rng(2), 2)
    for row, image in zip(rows, prior.mirrored(rows), strict=True):
        expected = np.roll(points(SECTIONS, row), SAMPLES // 2, axis=0) * (1, -1, 1)
        twins = [JOINTS.index({"l": "r", "r": "l"}[n[0]] + n[1:] if n[1] == "_" else n) for n in JOINTS]
        np.testing.assert_allclose(points(SECTIONS, image), expected[:, twins], atol=1e-12)
        for name, sign in (("root_forward", 1), ("root_height", 1), ("root_sway", -1)):
            k = CHANNELS.index(name)
            np.testing.assert_array_equal(image[:, k], sign * np.roll(row[:, k], SAMPLES // 2))


def test_mirrored_legs_alone_leave_the_rest_unseen():
    rows = smooth(np.random.default_rng(3), 2)
    legs = [k for k, name in enumerate(CHANNELS) if any(j in name for j in ("hip", "knee", "ankle"))]
    others = np.setdiff1d(np.arange(len(CHANNELS)), legs)
    rows[:, :, others] = np.nan
    image = prior.mirrored(rows)
    assert np.isnan(image[:, :, others]).all() and np.isfinite(image[:, :, legs]).all()


def test_metric_is_the_displacement_of_the_joints():
    rng = np.random.default_rng(4)
    mean = smooth(rng, 1, 0.3)[0]
    metric = prior.joint_metric(mean, BODY)
    for _ in range(20):
        step = 1e-4 * rng.normal(size=len(CHANNELS))
        whole = sum((w * step[CHANNELS.index(name)]) ** 2 for name, w in prior.DISPLACING.items())
        counted = step * [prior.TURNING.get(name, 1.0) for name in CHANNELS]
        moved = points(SECTIONS, mean + counted) - points(SECTIONS, mean)
        expected = np.mean(np.sum(moved**2, axis=2)) + whole + prior.RIDGE * np.sum(step**2)
        assert np.sum((step @ metric) ** 2) == pytest.approx(expected, rel=0.02)


def test_components_are_those_the_cycles_were_made_of():
    """Two modes, each symmetric: a mode and its image are one."""
    rng = np.random.default_rng(6)
    mean, *modes = smooth(rng, 3)
    mean = (mean + prior.mirrored(mean[None])[0]) / 2
    modes = np.array([(m + prior.mirrored(m[None])[0]) / 2 for m in modes])
    subject = np.repeat(np.arange(6), 3)
    rows = mean + np.einsum("rq,qtm->rtm", rng.normal(size=(len(subject), 2)), modes)
    metric = prior.joint_metric(mean, BODY)
    found, curves, scores, sd, spectrum = prior.components(rows, subject, 2, metric, HARMONICS)
    assert np.degrees(subspace_angles(flat(curves).T, flat(modes).T)).max() < 1e-4
    np.testing.assert_allclose(found + np.einsum("rq,qtm->rtm", scores, curves), rows, atol=1e-9)
    assert spectrum[:2].sum() == pytest.approx(1, abs=1e-9) and sd[0] >= sd[1] > 0
    first = flat(curves[:, : SAMPLES // 2])
    assert np.all(first[np.arange(2), np.abs(first).argmax(axis=1)] > 0)
    unit = np.einsum("qtm,mk->qtk", curves, metric)
    np.testing.assert_allclose(flat(unit) @ flat(unit).T, np.eye(2), atol=1e-9)


def test_mean_is_its_own_mirror_image():
    rng = np.random.default_rng(7)
    mean, *_ = prior.components(smooth(rng, 7), np.repeat([0, 1], [2, 5]), 2, PLAIN, HARMONICS)
    np.testing.assert_allclose(prior.mirrored(mean[None])[0], mean, atol=1e-12)


def test_subjects_count_alike_however_many_cycles_they_have():
    rng = np.random.default_rng(8)
    rows = smooth(rng, 4)
    subject = np.array([0, 0, 1, 2])
    once = prior.components(rows, subject, 3, PLAIN, HARMONICS)
    more = np.array([0, 1, 2, 2, 2, 2, 2, 3])  # rows; subject 1 was recorded five times
    often = prior.components(rows[more], subject[more], 3, PLAIN, HARMONICS)
    for k in (0, 1, 3):  # mean, curves, sd
        np.testing.assert_allclose(often[k], once[k], atol=1e-9)
    np.testing.assert_allclose(often[2], once[2][more], atol=1e-9)


def test_sd_is_of_subjects():
    """One mode, two people a deviation apart: sd 1 although one has nine cycles."""
    mode = smooth(np.random.default_rng(9), 1)
    mode = mode + prior.mirrored(mode)
    mode /= np.linalg.norm(mode)
    subject = np.repeat([0, 1], [1, 9])
    rows = np.where(subject == 0, 1.0, -1.0)[:, None, None] * mode
    _, _, scores, sd, _ = prior.components(rows, subject, 1, PLAIN, HARMONICS)
    assert sd[0] == pytest.approx(1) and np.abs(scores[:, 0]) == pytest.approx(np.ones(10))


def test_static_spread_is_what_others_do_not_explain():
    rng = np.random.default_rng(10)
    people = 6
    offset = np.zeros((people, len(CHANNELS)))
    knee = CHANNELS.index("l_knee_flexion")
    offset[0, knee] = 0.3  # one person alone: unknown to the others
    subject = np.repeat(np.arange(people), 3)
    base = smooth(rng, 1)
    rows = base + prior.mirrored(base) + offset[subject][:, None]
    spread = prior.static_spread(rows, subject, 1, PLAIN)
    assert spread[knee] == pytest.approx(0.3 / np.sqrt(people), rel=0.1)
    # others' learners see that person, whose image has the other knee; nothing else was ever different
    knees = [CHANNELS.index(f"{s}_knee_flexion") for s in "lr"]
    assert np.delete(spread, knees).max() < 0.01
    everybody = rows + 0.3 * (rng.normal(size=people)[subject] > 0)[:, None, None] * (np.arange(30) == 0)
    assert prior.static_spread(everybody, subject, 4, PLAIN)[0] < 1e-6


@pytest.mark.parametrize("rows", [10, 40, 200], ids=["few", "more", "many"])
def test_leading_directions_are_those_of_the_whole_decomposition(rows):
    rng = np.random.default_rng(8)
    data, factor = rng.normal(size=(rows, 60)) * 0.8 ** np.arange(60), rng.uniform(0.5, 2.0, rows)
    factor[0] = 0
    mean = data.mean(axis=0)
    right = np.linalg.svd((data - mean) * factor[:, None], full_matrices=False)[2]
    found = singular.leading(data, mean, factor, 5)
    assert found.shape == (5, 60)
    assert np.abs(np.sum(found * right[:5], axis=1)) == pytest.approx(1, abs=1e-12)


def test_leading_directions_of_rows_that_hardly_vary_are_fewer():
    data = np.outer(np.arange(6.0), np.ones(40)) + np.outer([0, 0, 0, 0, 0, 1.0], np.arange(40))
    assert singular.leading(data, data[0], np.ones(6), 4).shape == (2, 40)
    assert singular.leading(data[:1], data[0], np.ones(1), 4).shape == (0, 40)


def test_static_spread_of_too_few_people_is_zero():
    rows = smooth(np.random.default_rng(11), 5)
    for subject in (np.zeros(5, int), np.array([0, 0, 1, 1, 1])):
        assert not prior.static_spread(rows, subject, 2, PLAIN).any()


def test_encoding_keeps_the_mean_of_the_metric():
    """The metric acts on channels and the basis on phases: their order does not matter."""
    rows = smooth(np.random.default_rng(12), 2)
    metric = prior.joint_metric(rows[0], BODY)
    np.testing.assert_allclose(decode(encode(rows @ metric, BASIS), BASIS, 30), rows @ metric, atol=1e-12)
