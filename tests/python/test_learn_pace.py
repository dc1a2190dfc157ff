"""The mean cycle follows the stride rate: what is learnt, and that the library and numpy agree on it."""

from types import SimpleNamespace

import numpy as np
import pytest

from gait import GaitError, Model, State
from gait.body import skeleton
from gait.body.model_curves import ModelCurves
from gait.body.pace import MOST, pace, series, slope_of
from gait.body.skeleton import CHANNELS
from gait.cli import main
from gait.bindings.model import read_blob, read_cyclic
from gait.errors import UserError
from gait.io import blob
from gait.learn.prior import pace as learnt
from gait.learn.prior.prior import mirrored

SAMPLES = 64
GAIT = np.array([0.9, 0.07])
SHIPPED = blob.decode(read_blob(None))


def wave(rng):
    """A cycle (SAMPLES, 30) of three harmonics; the forward speed stays."""
    turn = 2 * np.pi * np.arange(SAMPLES)[:, None] / SAMPLES
    cycle = sum(0.1 * rng.normal(size=30) / h * np.cos(h * turn + rng.uniform(0, 6, 30)) for h in (1, 2, 3))
    cycle[:, CHANNELS.index("root_forward")] = 0.0
    return cycle


def walkers(rng, slope, paces):
    """Cycles, people and paces: everybody has an own mean, and the same slope."""
    rows = [own + p * slope for own, each in ((wave(rng), each) for each in paces) for p in each]
    subject = np.repeat(np.arange(len(paces)), [len(each) for each in paces])
    return np.array(rows), subject, np.concatenate(paces)


def test_pace_counts_deviations_and_stops_where_nothing_was_learnt():
    rates = np.array([0.9, 0.97, 0.83, 0.3, 2.4, 0.0])
    np.testing.assert_allclose(pace(GAIT, rates), [0, 1, -1, -MOST, MOST, 0], atol=1e-9)
    assert pace((0.9, 0.0), 1.2) == 0


def test_the_slope_is_that_within_people_drawn_towards_none():
    rng = np.random.default_rng(1)
    slope = wave(rng)
    slope = 0.5 * (slope + mirrored(slope[None])[0])
    paces = [np.array([-1.0, 1.0]), np.array([0.5, 1.5, 1.0]), np.array([-2.0])]
    found = learnt.slope(*walkers(rng, slope, paces))
    seen = 1 + 0.5 / 3  # variances of the people's paces; a single cycle tells nothing
    np.testing.assert_allclose(found, slope * seen / (seen + learnt.UNMOVED), atol=1e-12)


def test_turns_within_a_person_are_no_slope():
    rows, subject, at = walkers(
        np.random.default_rng(3), np.zeros((SAMPLES, 30)), [np.array([-1.0, 1.0])] * 2
    )
    rows[1, :, CHANNELS.index("l_knee_flexion")] += 8 * np.pi
    with pytest.raises(UserError, match=r"^[lr]_knee_flexion: .*turns of 360"):
        learnt.slope(rows, subject, at)


def test_more_cycles_of_one_person_weigh_no_more():
    rng = np.random.default_rng(2)
    slope, paces = wave(rng), [np.array([-1.0, 1.0]), np.array([-0.5, 0.5])]
    rows, subject, at = walkers(rng, slope, paces)
    often = np.r_[np.repeat([0, 1], 5), 2, 3]
    np.testing.assert_allclose(
        learnt.slope(rows[often], subject[often], at[often]), learnt.slope(rows, subject, at), atol=1e-12
    )


def test_the_slope_is_its_own_mirror_image():
    rng = np.random.default_rng(3)
    found = learnt.slope(*walkers(rng, wave(rng), [np.array([-1.0, 1.0]), np.array([0.0, 1.0])]))
    assert np.abs(found).max() > 0.1
    np.testing.assert_allclose(mirrored(found[None])[0], found, atol=1e-12)


def test_the_forward_speed_is_left_to_the_components():
    rng, paces = np.random.default_rng(7), [np.array([-1.0, 1.0]), np.array([0.0, 1.0])]
    rows, subject, at = walkers(rng, wave(rng), paces)
    rows[:, :, CHANNELS.index("root_forward")] += at[:, None]
    assert not learnt.slope(rows, subject, at)[:, CHANNELS.index("root_forward")].any()


@pytest.mark.parametrize("paces", [[[-1.0, 1.0]], [[0.5, 0.5], [-1.0], [1.5, 1.5]]])
def test_one_person_or_one_pace_each_tells_nothing(paces):
    rng = np.random.default_rng(4)
    found = learnt.slope(*walkers(rng, wave(rng), [np.array(each) for each in paces]))
    np.testing.assert_allclose(found, 0, atol=1e-12)


def test_cycles_without_the_slope_are_those_at_the_mean_rate():
    rng = np.random.default_rng(5)
    slope, paces = wave(rng), [np.array([-1.0, 2.0]), np.array([0.3])]
    rows, _, at = walkers(rng, slope, paces)
    even = learnt.without(rows, at, slope)
    np.testing.assert_allclose(even[0], even[1], atol=1e-12)
    np.testing.assert_allclose(rows[0] - even[0], -slope, atol=1e-12)


def test_paces_of_sequences_are_those_the_tracker_takes():
    def at(hz):
        return SimpleNamespace(fps=120.0, period=SimpleNamespace(frames=120.0 / hz))

    found = learnt.of([at(0.8), at(0.9), at(1.3), at(0.5)], np.array([0, 1, 2, 2]))
    means = np.array([0.8, 0.9, 0.9])
    expected = np.clip((np.array([0.8, 0.9, 1.3, 0.5]) - means.mean()) / means.std(ddof=1), -2, 2)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def paced():
    """The shipped model with a slope of its own in every channel."""
    slope = series(0.02 * wave(np.random.default_rng(6)), learnt.TERMS)
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
    np.testing.assert_allclose(fast - usual, MOST * step, atol=1e-9)
    np.testing.assert_allclose(sd_fast, sd, atol=1e-12)


def test_whoever_walks_faster_swings_further_in_the_shipped_model():
    slope = slope_of(SHIPPED)
    np.testing.assert_allclose(mirrored(slope[None])[0], slope, atol=2e-6)
    assert not slope[:, CHANNELS.index("root_forward")].any()
    hip = CHANNELS.index("r_hip_flexion")
    mean = np.asarray(SHIPPED["CURV"][0], float)
    assert np.ptp((mean + slope)[:, hip]) > np.ptp(mean[:, hip]) + np.radians(1)


def test_a_curve_and_its_series_are_the_same():
    sections = {
        "CURV": np.zeros((1, SAMPLES, 30)),
        "PACE": series(curve := wave(np.random.default_rng(8)), 7),
    }
    np.testing.assert_allclose(slope_of(sections), curve, atol=1e-12)
    assert slope_of({"CURV": sections["CURV"]}) is None


@pytest.mark.parametrize("rows", [20, 120, 121])
def test_what_is_no_series_is_refused_by_both(rows):
    made = {**SHIPPED, "PACE": np.zeros((rows, 30), np.float32)}
    with pytest.raises(GaitError, match=r"PACE: its rows are no Fourier series"):
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
