"""The prior for people who were not recorded: mirror images, metric, stride rate, gaps."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import subspace_angles

from gait import GaitError, Model, State
from gait.bindings.model import read_blob, read_cyclic
from gait.body import skeleton
from gait.body.model_curves import MOST_PACE_SDS, ModelCurves, pace, series, slope_of
from gait.body.skeleton import CHANNELS, JOINTS, Proportions, default_skeleton, points
from gait.cli import main
from gait.errors import UserError
from gait.io import blob
from gait.learn.cycles.fourier import decode, encode, fourier_basis
from gait.learn.prior import imputation, people
from gait.learn.prior.model import sides_alike
from gait.learn.prior.people import bounded, mirrored, never_shown

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
    np.testing.assert_array_equal(people.mirrored(people.mirrored(rows)), rows)


def test_mirrored_joints_are_the_mirror_image_half_a_cycle_later():
    rows = smooth(np.random.default_rng(2), 2)
    for row, image in zip(rows, people.mirrored(rows), strict=True):
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
    image = people.mirrored(rows)
    assert np.isnan(image[:, :, others]).all() and np.isfinite(image[:, :, legs]).all()


def test_metric_is_the_displacement_of_the_joints():
    rng = np.random.default_rng(4)
    mean = smooth(rng, 1, 0.3)[0]
    metric = people.joint_metric(mean, BODY)
    for _ in range(20):
        step = 1e-4 * rng.normal(size=len(CHANNELS))
        whole = sum((w * step[CHANNELS.index(name)]) ** 2 for name, w in people.DISPLACING.items())
        counted = step * [people.TURNING.get(name, 1.0) for name in CHANNELS]
        moved = points(SECTIONS, mean + counted) - points(SECTIONS, mean)
        expected = np.mean(np.sum(moved**2, axis=2)) + whole + people.SLOPE_RIDGE * np.sum(step**2)
        assert np.sum((step @ metric) ** 2) == pytest.approx(expected, rel=0.02)


def test_components_are_those_the_cycles_were_made_of():
    """Two modes, each symmetric: a mode equals its image."""
    rng = np.random.default_rng(6)
    mean, *modes = smooth(rng, 3)
    mean = (mean + people.mirrored(mean[None])[0]) / 2
    modes = np.array([(m + people.mirrored(m[None])[0]) / 2 for m in modes])
    subject = np.repeat(np.arange(6), 3)
    rows = mean + np.einsum("rq,qtm->rtm", rng.normal(size=(len(subject), 2)), modes)
    metric = people.joint_metric(mean, BODY)
    found, curves, scores, sd, spectrum = people.mirrored_components(rows, subject, 2, metric)
    assert np.degrees(subspace_angles(flat(curves).T, flat(modes).T)).max() < 1e-4
    np.testing.assert_allclose(found + np.einsum("rq,qtm->rtm", scores, curves), rows, atol=1e-9)
    assert spectrum[:2].sum() == pytest.approx(1, abs=1e-9) and sd[0] >= sd[1] > 0
    first = flat(curves[:, : SAMPLES // 2])
    assert np.all(first[np.arange(2), np.abs(first).argmax(axis=1)] > 0)
    unit = np.einsum("qtm,mk->qtk", curves, metric)
    np.testing.assert_allclose(flat(unit) @ flat(unit).T, np.eye(2), atol=1e-9)


def test_mean_is_its_own_mirror_image():
    rng = np.random.default_rng(7)
    mean, *_ = people.mirrored_components(smooth(rng, 7), np.repeat([0, 1], [2, 5]), 2, PLAIN)
    np.testing.assert_allclose(people.mirrored(mean[None])[0], mean, atol=1e-12)


def test_subjects_count_alike_however_many_cycles_they_have():
    rng = np.random.default_rng(8)
    rows = smooth(rng, 4)
    subject = np.array([0, 0, 1, 2])
    once = people.mirrored_components(rows, subject, 3, PLAIN)
    more = np.array([0, 1, 2, 2, 2, 2, 2, 3])  # rows; subject 1 was recorded five times
    often = people.mirrored_components(rows[more], subject[more], 3, PLAIN)
    for k in (0, 1, 3):  # mean, curves, sd
        np.testing.assert_allclose(often[k], once[k], atol=1e-9)
    np.testing.assert_allclose(often[2], once[2][more], atol=1e-9)


def test_sd_is_of_subjects():
    """One mode, two people one standard deviation apart: sd 1 although one of them has nine cycles."""
    mode = smooth(np.random.default_rng(9), 1)
    mode = mode + people.mirrored(mode)
    mode /= np.linalg.norm(mode)
    subject = np.repeat([0, 1], [1, 9])
    rows = np.where(subject == 0, 1.0, -1.0)[:, None, None] * mode
    _, _, scores, sd, _ = people.mirrored_components(rows, subject, 1, PLAIN)
    assert sd[0] == pytest.approx(1) and np.abs(scores[:, 0]) == pytest.approx(np.ones(10))


def test_static_offset_is_what_others_do_not_explain():
    rng = np.random.default_rng(10)
    number = 6
    offset = np.zeros((number, len(CHANNELS)))
    knee = CHANNELS.index("l_knee_flexion")
    offset[0, knee] = 0.3  # one person alone: unknown to the others
    subject = np.repeat(np.arange(number), 3)
    base = smooth(rng, 1)
    rows = base + people.mirrored(base) + offset[subject][:, None]
    uncertainty = np.sqrt(np.mean(people.lasting_offsets(rows, subject, 1, PLAIN) ** 2, axis=0))
    assert uncertainty[knee] == pytest.approx(0.3 / np.sqrt(number), rel=0.1)
    # others' learners see that person, whose image has the other knee; nothing else was ever different
    knees = [CHANNELS.index(f"{s}_knee_flexion") for s in "lr"]
    assert np.delete(uncertainty, knees).max() < 0.01
    shifted = rows + 0.3 * (rng.normal(size=number)[subject] > 0)[:, None, None] * (np.arange(30) == 0)
    assert np.abs(people.lasting_offsets(shifted, subject, 4, PLAIN)[:, 0]).max() < 1e-6


def test_sides_are_as_alike_as_the_lasting_angles_of_the_legs():
    rng = np.random.default_rng(3)
    lasting, same = 9 * rng.normal(size=(400, len(CHANNELS))), rng.normal(size=400)
    for name in CHANNELS:
        if name[2:5] in ("hip", "kne", "ank"):
            lasting[:, CHANNELS.index(name)] = 0.6**0.5 * same + 0.4**0.5 * rng.normal(size=400)
    assert sides_alike(lasting) == pytest.approx(0.6, abs=0.06)
    assert sides_alike(np.zeros((1, len(CHANNELS)))) is None


@pytest.mark.parametrize("rows", [10, 40, 200], ids=["few", "more", "many"])
def test_leading_directions_are_those_of_the_whole_decomposition(rows):
    rng = np.random.default_rng(8)
    data, factor = rng.normal(size=(rows, 60)) * 0.8 ** np.arange(60), rng.uniform(0.5, 2.0, rows)
    factor[0] = 0
    mean = data.mean(axis=0)
    right = np.linalg.svd((data - mean) * factor[:, None], full_matrices=False)[2]
    found = imputation.leading_vectors(data, mean, factor, 5)
    assert found.shape == (5, 60)
    assert np.abs(np.sum(found * right[:5], axis=1)) == pytest.approx(1, abs=1e-12)


def test_leading_directions_of_rows_that_hardly_vary_are_fewer():
    data = np.outer(np.arange(6.0), np.ones(40)) + np.outer([0, 0, 0, 0, 0, 1.0], np.arange(40))
    assert imputation.leading_vectors(data, data[0], np.ones(6), 4).shape == (2, 40)
    assert imputation.leading_vectors(data[:1], data[0], np.ones(1), 4).shape == (0, 40)


def test_static_offset_of_too_few_people_is_zero():
    rows = smooth(np.random.default_rng(11), 5)
    for subject in (np.zeros(5, int), np.array([0, 0, 1, 1, 1])):
        assert not people.lasting_offsets(rows, subject, 2, PLAIN).any()


def test_encoding_keeps_the_mean_of_the_metric():
    """The metric acts on channels and the basis on phases: their order does not matter."""
    rows = smooth(np.random.default_rng(12), 2)
    metric = people.joint_metric(rows[0], BODY)
    np.testing.assert_allclose(decode(encode(rows @ metric, BASIS), BASIS, 30), rows @ metric, atol=1e-12)


PACE_SAMPLES = 64
GAIT = np.array([0.9, 0.07])
SHIPPED = blob.decode(read_blob(None))


def wave(rng):
    """A cycle (PACE_SAMPLES, 30) of three harmonics; the forward speed stays."""
    turn = 2 * np.pi * np.arange(PACE_SAMPLES)[:, None] / PACE_SAMPLES
    cycle = sum(0.1 * rng.normal(size=30) / h * np.cos(h * turn + rng.uniform(0, 6, 30)) for h in (1, 2, 3))
    cycle[:, CHANNELS.index("root_forward")] = 0.0
    return cycle


def persons(rng, slope, paces):
    """Cycles, people and paces: every person has their own mean, and all have the same slope."""
    rows = [own + p * slope for own, each in ((wave(rng), each) for each in paces) for p in each]
    subject = np.repeat(np.arange(len(paces)), [len(each) for each in paces])
    return np.array(rows), subject, np.concatenate(paces)


def test_pace_counts_standard_deviations_and_stops_where_nothing_was_learnt():
    rates = np.array([0.9, 0.97, 0.83, 0.3, 2.4, 0.0])
    np.testing.assert_allclose(pace(GAIT, rates), [0, 1, -1, -MOST_PACE_SDS, MOST_PACE_SDS, 0], atol=1e-9)
    assert pace((0.9, 0.0), 1.2) == 0


def test_the_slope_is_that_within_people_drawn_towards_none():
    rng = np.random.default_rng(1)
    slope = wave(rng)
    slope = 0.5 * (slope + mirrored(slope[None])[0])
    paces = [np.array([-1.0, 1.0]), np.array([0.5, 1.5, 1.0]), np.array([-2.0])]
    found = people.pace_slope(*persons(rng, slope, paces))
    visible = 1 + 0.5 / 3  # variances of the people's paces; a single cycle shows nothing
    np.testing.assert_allclose(found, slope * visible / (visible + people.CONSTANT_GAIT_VARIANCE), atol=1e-12)


def test_turns_within_a_person_are_no_slope():
    rows, subject, at = persons(
        np.random.default_rng(3), np.zeros((PACE_SAMPLES, 30)), [np.array([-1.0, 1.0])] * 2
    )
    rows[1, :, CHANNELS.index("l_knee_flexion")] += 8 * np.pi
    with pytest.raises(UserError, match=r"^[lr]_knee_flexion: .*turns of 360"):
        people.pace_slope(rows, subject, at)


def test_more_cycles_of_one_person_count_no_more():
    rng = np.random.default_rng(2)
    slope, paces = wave(rng), [np.array([-1.0, 1.0]), np.array([-0.5, 0.5])]
    rows, subject, at = persons(rng, slope, paces)
    often = np.r_[np.repeat([0, 1], 5), 2, 3]
    np.testing.assert_allclose(
        people.pace_slope(rows[often], subject[often], at[often]),
        people.pace_slope(rows, subject, at),
        atol=1e-12,
    )


def test_the_slope_is_its_own_mirror_image():
    rng = np.random.default_rng(3)
    found = people.pace_slope(*persons(rng, wave(rng), [np.array([-1.0, 1.0]), np.array([0.0, 1.0])]))
    assert np.abs(found).max() > 0.1
    np.testing.assert_allclose(mirrored(found[None])[0], found, atol=1e-12)


def test_strides_are_longer_at_higher_rates_only_in_models_of_several_classes():
    rng, paces = np.random.default_rng(7), [np.array([-1.0, 1.0]), np.array([0.0, 1.0])]
    rows, subject, at = persons(rng, 0.0 * wave(rng), paces)
    forward = CHANNELS.index("root_forward")
    rows[:, :, forward] += 0.1 * at[:, None]
    assert not people.pace_slope(rows, subject, at)[:, forward].any()
    longer = people.pace_slope(rows, subject, at, stride=True)[:, forward]
    assert np.all((longer > 0.03) & (longer < 0.1))  # shrunk, as two people are few


@pytest.mark.parametrize("paces", [[[-1.0, 1.0]], [[0.5, 0.5], [-1.0], [1.5, 1.5]]])
def test_one_person_or_one_pace_each_shows_nothing(paces):
    rng = np.random.default_rng(4)
    found = people.pace_slope(*persons(rng, wave(rng), [np.array(each) for each in paces]))
    np.testing.assert_allclose(found, 0, atol=1e-12)


def test_cycles_without_the_slope_are_those_at_the_mean_rate():
    rng = np.random.default_rng(5)
    slope, paces = wave(rng), [np.array([-1.0, 2.0]), np.array([0.3])]
    rows, _, at = persons(rng, slope, paces)
    even = people.at_mean_pace(rows, at, slope)
    np.testing.assert_allclose(even[0], even[1], atol=1e-12)
    np.testing.assert_allclose(rows[0] - even[0], -slope, atol=1e-12)


def test_paces_of_sequences_are_those_the_tracker_takes():
    def at(hz):
        return SimpleNamespace(fps=120.0, period=SimpleNamespace(frames=120.0 / hz))

    found = people.paces([at(0.8), at(0.9), at(1.3), at(0.5)], np.array([0, 1, 2, 2]))
    means = np.array([0.8, 0.9, 0.9])
    expected = np.clip((np.array([0.8, 0.9, 1.3, 0.5]) - means.mean()) / means.std(ddof=1), -2, 2)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def paced():
    """The shipped model with a different slope in every channel."""
    slope = series(0.02 * wave(np.random.default_rng(6)), people.TERMS)
    return {**SHIPPED, "PACE": slope.astype(np.float32)}


@pytest.mark.parametrize("rate", [0.0, 0.3, 0.8, 0.9, 1.0, 1.3, 2.4])
def test_c_and_numpy_agree_at_every_rate(rate):
    made = paced()
    model, curves, coef = Model(blob.encode(made)), ModelCurves(made), np.array([0.5, -1.0])
    for phase in (0.0, 0.31, 0.997):
        state = State(phase=phase, stride_hz=rate, stature=1.8, coef=coef)
        joints, angles = model.pose(state)
        expected, expected_angles = skeleton.pose(
            made, phase, coef, 1.8, 0.0, 0.0, 0.0, np.zeros(3), stride_hz=rate
        )
        assert joints == pytest.approx(expected[0], abs=1e-5)
        assert angles == pytest.approx(expected_angles[0], abs=1e-5)
        at = curves.channel("root_height", np.array([phase]), coef[None], rate)
        assert model.pelvis_height(state) == pytest.approx(1.8 * at[0], abs=1e-5)
        knee = curves.channel("r_knee_flexion", np.array([phase]), coef[None], rate)
        assert angles[CHANNELS.index("r_knee_flexion")] == pytest.approx(knee[0], abs=1e-5)


def test_the_norm_is_that_of_the_rate():
    curves, phase = ModelCurves(paced()), np.arange(4) / 4
    usual, sd = curves.norm("l_hip_flexion", phase)
    fast, sd_fast = curves.norm("l_hip_flexion", phase, curves.stride_hz + 1.0)
    at = curves.names.index("l_hip_flexion")
    step = curves.faster[(phase * len(curves.faster)).astype(int), at]
    np.testing.assert_allclose(fast - usual, MOST_PACE_SDS * step, atol=1e-9)
    np.testing.assert_allclose(sd_fast, sd, atol=1e-12)


def test_people_who_walk_faster_swing_further_in_the_shipped_model():
    slope = slope_of(SHIPPED)
    np.testing.assert_allclose(mirrored(slope[None])[0], slope, atol=2e-6)
    assert not slope[:, CHANNELS.index("root_forward")].any()
    hip = CHANNELS.index("r_hip_flexion")
    mean = np.asarray(SHIPPED["CURV"][0], float)
    assert np.ptp((mean + slope)[:, hip]) > np.ptp(mean[:, hip]) + np.radians(1)


def test_a_curve_and_its_series_are_the_same():
    sections = {
        "CURV": np.zeros((1, PACE_SAMPLES, 30)),
        "PACE": series(curve := wave(np.random.default_rng(8)), 7),
    }
    np.testing.assert_allclose(slope_of(sections), curve, atol=1e-12)
    assert slope_of({"CURV": sections["CURV"]}) is None


@pytest.mark.parametrize("rows", [20, 120, 121])
def test_what_is_no_series_is_refused_by_both(rows):
    made = {**SHIPPED, "PACE": np.zeros((rows, 30), np.float32)}
    with pytest.raises(GaitError, match=r"PACE: its rows are not a Fourier series"):
        Model(blob.encode(made))
    with pytest.raises(UserError, match=r"PACE has \d+ rows.*learn the model again"):
        ModelCurves(made)


def test_commands_name_the_file_of_another_layout(tmp_path, capsys):
    old = tmp_path / "old.gait"
    old.write_bytes(blob.encode({**SHIPPED, "PACE": np.zeros((128, 30), np.float32)}))
    with pytest.raises(UserError, match=r"old\.gait: section PACE has 128 rows.*learn the model again"):
        read_cyclic(old)
    assert main(["info", str(old)]) == 1
    assert "old.gait: section PACE has 128 rows" in capsys.readouterr().err


def test_a_model_whose_rates_do_not_vary_has_no_use_for_a_slope():
    made = paced()
    made["GAIT"] = np.array(made["GAIT"])
    made["GAIT"][1] = 0.0
    with pytest.raises(GaitError, match="PACE"):
        Model(blob.encode(made))


def unseen_people(rng, unusual):
    """Cycles (8, 16, 3) of four people; the last never shows channel 2, which was filled `outlier` away."""
    subject = np.repeat(np.arange(4), 2)
    cycles = rng.normal(size=(8, 16, 3))
    cycles[6:, :, 2] = unusual * np.cos(np.arange(16))
    mask = np.ones(cycles.shape, bool)
    mask[6:, :, 2] = False
    return cycles, mask, subject


def test_who_shows_everything_is_not_touched():
    cycles, mask, subject = unseen_people(np.random.default_rng(1), 3.0)
    assert bounded(cycles, np.ones_like(mask), subject) is cycles
    absent = mask.copy()
    absent[..., 2] = False  # a channel that no person shows
    assert bounded(cycles, absent, subject) is cycles


def test_what_is_never_shown_deviates_as_people_do_at_most():
    cycles, mask, subject = unseen_people(np.random.default_rng(2), 50.0)
    found = bounded(cycles, mask, subject)
    assert np.array_equal(found[mask], cycles[mask])
    mean = cycles[:6, :, 2].mean(axis=0)
    usual = np.mean((cycles[:6, :, 2] - mean) ** 2)
    away = found[6:, :, 2] - mean
    np.testing.assert_allclose(np.mean(away**2), usual)
    whole = cycles[6:, :, 2] - mean
    np.testing.assert_allclose(away, whole * np.sqrt(usual / np.mean(whole**2)))


def test_a_modest_filling_stays():
    cycles, mask, subject = unseen_people(np.random.default_rng(3), 0.1)
    assert np.array_equal(bounded(cycles, mask, subject), cycles)


def test_who_never_shows_what_others_show_is_counted():
    _, mask, subject = unseen_people(np.random.default_rng(4), 0.1)
    people_lacking, channels = never_shown(mask, subject)
    assert people_lacking == 1 and channels.tolist() == [False, False, True]
    mask[..., 2] = False  # a channel that no person shows is not counted
    assert never_shown(mask, subject)[0] == 0
