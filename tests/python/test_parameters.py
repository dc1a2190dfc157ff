"""Gait parameters of a walk with known rules and of true clips, with and without draws."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from drawn_person import DATA
from scipy.signal import find_peaks
from walking_track import STANCE, STEP, walking_track

from gait import Model, UserError
from gait.bindings.model import read_blob
from gait.body.model_curves import ModelCurves
from gait.io import blob
from gait.io.fields import read_json
from gait.io.track_file import read_truth
from gait.motion.footfalls import (
    STRIKE_SIDES,
    Draws,
    contacts,
    find_events,
    maxima,
    stride_time,
    strikes_from_meta,
)
from gait.motion.parameters import PARAMETER_LABELS, angle_cycles, measure, stride_rows
from gait.motion.verdict import verdict_of

MODEL = Model()
CURVES = ModelCurves(blob.decode(read_blob(None)))
CLIPS = sorted((DATA / "eval/dev").glob("*/meta.json"))


def drawn(track, count=60, late=0.02, seed=0):
    """Copies of the track, each late by a normal number of seconds and scaled about the origin."""
    random = np.random.default_rng(seed)
    names = tuple(track.places)
    joints = np.empty((count, len(track.time), len(names), 3), np.float32)
    for d in range(count):
        shift, scale = late * random.standard_normal(), 1 + 0.02 * random.standard_normal()
        for j, name in enumerate(names):
            for k in range(3):
                place = track.places[name][:, k]
                joints[d, :, j, k] = scale * np.interp(track.time - shift, track.time, place)
    angles = np.zeros((count, len(track.time), MODEL.info.angles), np.float32)
    phase = np.zeros((count, len(track.time)), np.float32)
    return Draws(track.frame, track.time, names, MODEL.angle_names, joints, angles, phase)


@pytest.mark.parametrize(("least", "apart"), [(-1.0, 1), (0.5, 4), (0.0, 9)])
def test_maxima_are_those_of_scipy(least, apart):
    values = np.random.default_rng(3).normal(size=400)
    values[100:103] = 9.0
    np.testing.assert_array_equal(maxima(values, least, apart), find_peaks(values, least, distance=apart)[0])


def test_a_walk_by_rule_has_its_own_parameters():
    summary = measure(walking_track()).summary()
    want = {
        "stride_time_s": (1 / 0.9, 0.002),
        "cadence_spm": (108.0, 0.2),
        "stride_length_m": (1.3, 0.004),
        "speed_m_s": (1.17, 0.002),
        "step_width_m": (0.12, 0.002),
        "stance_percent": (100 * STANCE, 2.0),
        "double_support_percent": (100 * (2 * STANCE - 1), 3.0),
    }
    for name, (value, tolerance) in want.items():
        assert summary[name]["both"]["mean"] == pytest.approx(value, abs=tolerance), name
    right, left = (summary["step_length_m"][side]["mean"] for side in STRIKE_SIDES)
    assert right == pytest.approx(1.3 * (1 - STEP["left"]), abs=0.005)
    assert left == pytest.approx(1.3 * STEP["left"], abs=0.005)
    uneven = summary["step_length_m"]["asymmetry_percent"]
    assert uneven["mean"] == pytest.approx(200 * (right - left) / (right + left)) and uneven["mean"] < -5
    assert set(summary) == set(PARAMETER_LABELS)


def test_sd_follow_those_of_the_track_and_last():
    once, twice = (measure(walking_track(sd=0.002, phase_sd=s)) for s in (0.01, 0.02))
    late = 0.01 / 0.9
    np.testing.assert_allclose(once.event_sd.strike["left"][1:-1], late, rtol=0.4)
    right = once.strides["right"]
    assert (right.sd["stride_time_s"][1:-1] < 0.85 * np.sqrt(2) * late).all()  # both ends are late together
    ratio = twice.strides["right"].sd["stride_time_s"] / right.sd["stride_time_s"]
    np.testing.assert_allclose(ratio, 2, rtol=0.35)
    # A mean over seven strides is more certain about what varies between them, not about the person.
    summary = once.summary()
    assert summary["stride_time_s"]["both"]["sd"] < 0.6 * right.sd["stride_time_s"].mean()
    assert summary["step_width_m"]["both"]["sd"] > 0.7 * right.sd["step_width_m"].mean()


def test_without_sd_nothing_is_claimed():
    track = walking_track()
    del track.numbers["phase_sd"]
    parameters = measure(track)
    assert np.isnan(parameters.strides["right"].sd["stride_time_s"]).all()
    assert np.isnan(parameters.event_sd.strike["left"]).all() and "unknown" in parameters.source
    assert np.isnan(parameters.summary()["speed_m_s"]["both"]["sd"])
    assert parameters.summary()["speed_m_s"]["both"]["mean"] == pytest.approx(1.17, abs=0.002)


def test_errors_that_last_cancel_between_the_ends_of_a_stride():
    """All events of a motion are equally late: its events are uncertain by that much, its strides are not."""
    track = walking_track()
    parameters = measure(track, drawn(track))
    late = 0.02 * 60**-0.5  # how well 60 draws know their standard deviation, roughly
    assert np.abs(parameters.event_sd.strike["right"][1:-1] - 0.02).max() < 3 * late
    right = parameters.strides["right"]
    assert right.sd["stride_time_s"][1:-1].max() < 0.002
    np.testing.assert_allclose(right.sd["stride_length_m"] / right.values["stride_length_m"], 0.02, rtol=0.35)


def test_the_persons_events_are_uncertain_in_every_stride_alike():
    """Motions that agree exactly do not show how this person's feet strike and leave the ground."""
    track = walking_track()
    parameters = measure(track, drawn(track, late=0.0))
    stride = 1 / 0.9
    for kind, sd in (("strike", 0.007), ("off", 0.019)):
        for times in getattr(parameters.event_sd, kind).values():
            np.testing.assert_allclose(times[1:-1] / stride, sd, rtol=0.3)
            assert np.ptp(times[1:-1]) < 1e-3
    assert parameters.strides["right"].sd["stride_time_s"][1:-1].max() < 0.002
    expected = 100 * np.hypot(0.007, 0.019) / np.sqrt(2)  # the feet are independent
    assert parameters.summary()["stance_percent"]["both"]["sd"] == pytest.approx(expected, rel=0.3)
    late = measure(
        walking_track(phase_sd=0.04), drawn(track, late=0.0)
    )  # beyond the draws: common to all events
    assert late.event_sd.strike["left"][1:-1].mean() == pytest.approx(0.04 * stride, rel=0.3)
    assert late.summary()["stance_percent"]["both"]["sd"] == pytest.approx(expected, rel=0.3)


def test_errors_of_a_camera_are_common_to_all_frames():
    """A place that is a metre off in all frames changes no stride; a scale that is off changes all."""
    track = walking_track(sd=0.01)
    change = np.zeros((len(track.time), 3, 4))
    change[:, :2, 0] = 1.0
    change[:, :2, 1] = 0.1 * track.places["pelvis"][:, :2]
    wider = {}
    for name, sd in track.sd.items():
        ahead = 0.1 * (track.places["pelvis"] * (1, 1, 0))
        wider[name] = np.sqrt(sd**2 + np.array([1.0, 1.0, 0.0]) + ahead**2)
    plain, found = measure(track), measure(replace(track, sd=wider, camera_change=change))
    for name, expected in (("stride_length_m", 0.1), ("speed_m_s", 0.1), ("step_width_m", 0.0)):
        for way in ("right", "left"):
            least, sd = plain.strides[way].sd[name], found.strides[way].sd[name]
            np.testing.assert_allclose(
                sd, np.hypot(least, expected * found.strides[way].values[name]), rtol=0.2
            )
    assert found.summary()["stride_length_m"]["both"]["sd"] == pytest.approx(0.13, rel=0.1)  # in the mean too


def test_strides_with_lost_or_ambiguous_frames_do_not_count():
    track = walking_track()
    for word in ("lost", "ambiguous"):
        status = list(track.status)
        status[70] = word
        parameters = measure(replace(track, status=status))
        sure = np.concatenate([parameters.strides[side].sure for side in STRIKE_SIDES])
        assert (~sure).sum() == 2
    hidden = measure(replace(track, status=["lost"] * len(track.time)))
    assert all(row["both"] is None for row in hidden.summary().values())
    assert angle_cycles(track, hidden, CURVES) == {}


def test_the_stride_in_which_the_person_stops_does_not_count():
    track = walking_track(seconds=7)
    slow = replace(track, time=track.time + 0.7 * np.maximum(track.time - 5.0, 0.0))
    found, steady = measure(slow), measure(track)
    slower = sum((s.left_out == "slow").sum() for s in found.strides.values())
    assert slower >= 1 and steady.counted().endswith("left strides")
    assert f"(not counted: {slower} while starting or stopping)" in found.counted()
    assert found.speed == pytest.approx(steady.speed, rel=0.03)
    assert verdict_of(slow).speed == found.speed  # one speed on the page


def test_a_person_followed_by_a_camera_of_unknown_motion_does_not_walk_in_place():
    track = walking_track()
    places = {name: place - track.places["pelvis"] * (1, 1, 0) for name, place in track.places.items()}
    speed = np.full(len(track.time), 1.2)
    still = replace(track, places=places, numbers=track.numbers | {"speed_m_s": speed})
    assert ", 1.20 m/s in place" in verdict_of(still).sentence()
    followed = verdict_of(still, camera_moves=True).sentence()
    assert "in place" not in followed and ", 1.20 m/s by the strides, as the camera moves" in followed


def test_one_frame_is_singular():
    found = verdict_of(walking_track())
    one = replace(found, total=1, counts=found.counts | {"tracking": 1})
    assert one.statuses().startswith("1 frame: 0 init, 1 tracking")


def test_a_missed_event_leaves_double_support_empty():
    track = walking_track()
    start = find_events(track).strike["right"][1]
    heel = track.places["l_heel"]
    hidden = (track.time > start - 0.8) & (track.time < start - 0.3)  # the left strike before that stride
    heel[hidden] = track.places["pelvis"][hidden] - [0, 0, 0.9]
    right = measure(track).strides["right"]
    values = dict(zip(right.start.round(2), right.values["double_support_percent"], strict=True))
    assert np.isnan(values.pop(start.round(2))) and np.nanmin([*values.values()]) > 10


def test_a_toe_off_just_after_the_strike_is_not_its_own():
    track = walking_track()
    events = find_events(track)
    strike = events.strike["right"]
    early = np.sort(np.append(events.off["right"], strike[1] + 0.06))
    here = contacts(track, replace(events, off=events.off | {"right": early}), "right", stride_time(events))
    np.testing.assert_array_equal(here.off, contacts(track, events, "right", stride_time(events)).off)


def test_strides_that_count_for_want_of_better_ones_are_not_sure():
    track = walking_track()
    found = measure(replace(track, status=["ambiguous"] * len(track.time)))
    rows = list(stride_rows(found))
    assert all(row["counts"] and not row["sure"] for row in rows)
    assert found.warning().startswith("Every stride has uncertain frames.")
    assert not measure(track).warning()


def test_a_missed_strike_does_not_make_one_long_stride():
    track = walking_track(seconds=8)
    track.places["r_heel"][100:140] = track.places["pelvis"][100:140] - [0, 0, 0.9]
    right = measure(track).strides["right"]
    assert len(right.start) >= 3 and (right.values["stride_time_s"] < 1.6 / 0.9).all()


def test_classes_of_a_walk_with_strides_of_one_foot_alone():
    track = walking_track(seconds=8)
    track.places["l_heel"][:] = track.places["pelvis"] - [0, 0, 0.9]
    track = replace(track, motion_class=["walk"] * len(track.time))
    found = measure(track)
    assert not len(found.strides["left"].start) and found.strides["right"].counts.any()
    assert found.motion_class == "walk" and found.others == 0


def test_too_short_tracks_are_refused():
    with pytest.raises(UserError, match="no whole stride in 0.97 s"):
        measure(walking_track(seconds=1.0))
    with pytest.raises(UserError, match="three frames"):
        measure(walking_track(seconds=0.06))


def test_angle_cycles_are_put_beside_the_norm():
    track = walking_track(seconds=6)
    scores = np.zeros((1, 5))
    right, left = "r_hip_flexion", "l_hip_flexion"
    for name, extra in ((right, 0.0), (left, 2.0)):
        phase = track.phase - (STEP["left"] - 0.5 if name == left else 0.0)
        mean, sd = CURVES.norm(name, phase)
        track.numbers[f"{name}_deg"] = np.degrees(mean + extra * sd)
    cycles = angle_cycles(track, measure(track), CURVES)
    assert set(cycles) == {right, left}
    assert np.abs(cycles[right].z).max() < 0.3
    assert np.abs(cycles[left].z - 2.0).max() < 0.35
    assert cycles[left].summary()["rms_z"] == pytest.approx(2.0, abs=0.1)
    slope = np.degrees(
        CURVES.channel(right, np.array([0.25]), scores) - CURVES.channel(right, np.array([0.2]), scores)
    )
    assert cycles[right].sd[22] > 0.9 * abs(slope[0] / 0.05 * 0.004)  # the phase alone gives that much
    assert len(cycles[right].strides) == len(measure(track).strides["right"].start)


def test_draws_give_the_cycles_their_sd():
    track = walking_track(seconds=6)
    track.numbers["r_knee_flexion_deg"] = np.zeros(len(track.time))
    draws = drawn(track, late=0.0)
    draws.angles[:, :, MODEL.angle_names.index("r_knee_flexion")] = np.radians(
        3 * np.random.default_rng(1).standard_normal(60)
    )[:, None]
    sd = angle_cycles(track, measure(track), CURVES, draws)["r_knee_flexion"].sd
    np.testing.assert_allclose(sd, 3, rtol=0.3)


def test_the_norm_is_wider_where_people_differ_and_periodic():
    phase = np.linspace(0, 1, 50)
    mean, sd = CURVES.norm("r_knee_flexion", phase)
    np.testing.assert_allclose([mean[0], sd[0]], [mean[-1], sd[-1]], atol=1e-9)
    at = CURVES.names.index("r_knee_flexion")
    assert (sd > CURVES.residual[at]).all()
    np.testing.assert_allclose(CURVES.norm("r_knee_flexion", phase + 3)[0], mean, atol=1e-9)


@pytest.mark.skipif(not CLIPS, reason="../shared/data is absent")
@pytest.mark.parametrize("meta", CLIPS, ids=lambda m: m.parent.name)
def test_true_motions_have_their_listed_events_and_parameters(meta):
    """The clips list their events by the same rule, from 120 frames a second."""
    truth, reported = read_truth(meta.parent / "truth.csv"), read_json(meta, "meta")
    events, listed = find_events(truth), strikes_from_meta(meta)
    for side in STRIKE_SIDES:
        found = np.interp(events.strike[side], truth.time, truth.frame)
        want = getattr(listed, side)
        want = want[(want > 3) & (want < truth.frame[-1] - 3)]
        assert all(np.abs(found - w).min() < 0.5 for w in want)
        assert all(late > early for early, late in pairwise(events.off[side]))
    assert stride_time(events) == pytest.approx(
        reported.number("stride_period_s", 0.3, 3.0, "give seconds"), rel=0.015
    )
