"""Strides and footfalls of people who stand, stop, turn or run: what there is, what counts, and why."""

from dataclasses import replace

import numpy as np
import pytest
from test_parameters_by_class import CLASSES, true_track
from walking_track import walking_track

from gait import UserError
from gait.cli.report_track import _text
from gait.motion.footfalls import STRIKE_SIDES, find_events
from gait.motion.norms import beside_norms
from gait.motion.parameters import measure, measured, stride_rows, without_norm
from gait.motion.verdict import verdict_of
from gait.report.gait_parts import floor_contacts
from gait.report.run_page import Run, run_page


def standing(track, first, last, name="stand"):
    """The track with a stand from `first` to `last` seconds, in which the legs go on."""
    stands = (track.time >= first) & (track.time <= last)
    classes = [name if still else "walk" for still in stands] if name else []
    numbers = track.numbers | {"p_walk": 1.0 - stands, "p_stand": 1.0 * stands}
    phase = np.where(stands, np.nan, track.phase)
    return replace(track, phase=phase, motion_class=classes, numbers=numbers)


def reasons(parameters):
    """Why strides do not count, in order of their start."""
    return [row["left_out"] for row in stride_rows(parameters)]


def test_a_person_who_stands_has_no_footfalls_and_no_strides():
    track = standing(walking_track(), 0.0, 9.0)
    assert find_events(replace(track, motion_class=[], phase=track.time)).count > 10  # those of the legs
    assert find_events(track).count == 0 and measured(track) is None
    assert verdict_of(track).sentence() == "Tracked 150 of 150 frames, stood throughout"
    with pytest.raises(UserError, match=r"has no whole stride in 4\.97 s, as the person stood throughout; "):
        measure(track)
    begin, end = floor_contacts(track, find_events(track), "left")
    assert begin.tolist() == [0.0] and end.tolist() == [track.time[-1]]


@pytest.mark.parametrize("name", ["stand", ""])
def test_a_stand_ends_strides_and_those_beside_it_do_not_count(name):
    """Without classes, the phase is empty in a stand; without either, as in lifts, nothing is known."""
    track = standing(walking_track(seconds=9.0), 3.0, 5.5, name)
    found, walk = measure(track), measure(walking_track(seconds=9.0))
    for kind in ("strike", "off"):
        for side in STRIKE_SIDES:
            times = getattr(walk.events, kind)[side]
            kept = times[(times < 3.0) | (times > 5.5)]
            np.testing.assert_allclose(getattr(found.events, kind)[side], kept)
    step = 0.5 / 0.9
    for row in stride_rows(found):
        assert row["end_s"] < 3.0 or row["start_s"] > 5.5
        beside = 3.0 - step < row["end_s"] < 3.0 or 5.5 < row["start_s"] < 5.5 + step
        assert row["left_out"] == ("stand" if beside else "")
    assert reasons(found).count("stand") == 2 and "(not counted: 2 beside a stand)" in found.counted()
    assert found.speed == pytest.approx(1.17, abs=0.002)
    for side in STRIKE_SIDES:
        begin, end = floor_contacts(track, found.events, side)
        for time in np.linspace(3.0, 5.5, 20):
            assert ((begin <= time) & (time <= end)).any()
    lift = replace(track, motion_class=[], phase=np.full(len(track.time), np.nan))
    assert find_events(lift).count == walk.events.count


def test_without_a_stride_that_counts_there_is_no_table_of_means():
    track = standing(walking_track(seconds=4.0), 2.2, 4.0)
    found = measure(track)
    assert set(reasons(found)) == {"stand"} and found.speed is None
    lost = replace(walking_track(), status=["lost"] * 150)
    for tracked, why in ((track, f"{len(reasons(found))} beside a stand"), (lost, "6 uncertain")):
        parameters = measure(tracked)
        words = f"No stride counts, so there are no means: {why}."
        assert parameters.warning() == words
        page = run_page(Run("a", tracked, verdict_of(tracked), parameters))
        assert words in page and "cadence, steps/min" not in page and "these strides anyway" not in page
        assert _text(parameters, [], "", "") == words
    unsure = measure(replace(track, status=["ambiguous"] * len(track.time)))
    assert "No stride counts" in unsure.warning() and set(reasons(unsure)) == {"stand"}


def test_uncertain_strides_count_if_there_are_no_others():
    track = walking_track()
    status = ["lost" if 20 < k < 30 else "ambiguous" for k in range(len(track.time))]
    found = measure(replace(track, status=status))
    assert "means over these strides anyway" in found.warning() and found.counting > 0
    assert all(row["left_out"] == "uncertain" for row in stride_rows(found) if row["start_s"] < 0.7)


def test_strides_in_a_turn_count_only_if_there_are_no_others():
    track = true_track("turning")
    found, straight = measure(track), measure(true_track("demo"))
    assert "turn" not in reasons(straight) and not straight.all_turn
    assert reasons(found).count("turn") == 3 and "(not counted: 3 in a turn)" in found.counted()
    assert "in a turn of" not in found.warning()
    width = found.summary()["step_width_m"]["both"]
    assert width["mean"] < 0.12 and width["between"] < 0.03
    late = measure(replace(track, numbers=track.numbers | {"heading_rad": 0 * track.time}))
    assert reasons(late) == reasons(found)  # the path turns
    walk = walking_track()
    heading = np.radians(30 * walk.time) % (2 * np.pi)
    circle = replace(walk, numbers=walk.numbers | {"heading_rad": heading})
    found = measure(circle)
    assert found.all_turn and set(reasons(found)) == {""}
    assert "Every stride is in a turn of more than 20 degrees." in found.warning()
    assert found.warning() in run_page(Run("a", circle, verdict_of(circle), found))
    slight = replace(walk, numbers=walk.numbers | {"heading_rad": np.radians(15 * walk.time)})
    assert not measure(slight).all_turn and set(reasons(measure(slight))) == {""}
    sway = 0.02 * np.stack([np.sin(7 * walk.time), np.cos(5 * walk.time), 0 * walk.time], axis=1)
    off = sway - walk.places["pelvis"] * (1, 1, 0)
    in_place = replace(walk, places={name: place + off for name, place in walk.places.items()})
    found = measure(in_place)
    assert found.counting and not found.all_turn and "turn" not in reasons(found)


def test_runs_have_no_toe_offs_stance_or_double_support():
    track = true_track("running")
    found = measure(track)
    assert found.counting == 14 and all(len(times) == 0 for times in found.events.off.values())
    assert all(row["both"] is None for name, row in found.summary().items() if "ce_perc" in name)
    assert found.summary()["double_support_percent"]["both"] is None
    assert not {"stance", "double"} & {c.name[:6] for c in beside_norms(track, found, CLASSES)}
    assert len(floor_contacts(track, found.events, "right")[0]) == 0
    words = "Toe-offs, stance and double support are not given for runs"
    assert words in run_page(Run("a", track, verdict_of(track), found)) and words in _text(found, [], "", "")
    faster = measure(true_track("accelerating"))
    for row in stride_rows(faster):
        assert np.isfinite(row["stance_percent"]) == (row["motion_class"] == "walk"), row
    assert words not in measure(walking_track()).warning()


def test_there_is_no_norm_without_strides_or_speed():
    track = true_track("demo")
    found = measure(track)
    stand = replace(found, motion_class="stand")
    assert without_norm(stand, CLASSES) == "the class stand of the model takes no strides"
    assert beside_norms(track, stand, CLASSES) == []
    none = {key: value for key, value in CLASSES.items() if key != "GAIT"}
    assert without_norm(found, none) == "the class walk of the model takes no strides"
    for s in found.strides.values():
        s.values["speed_m_s"][:] = 0.0
    norms = {c.name for c in beside_norms(track, found, CLASSES)}
    assert "step_width_m" in norms and not {"cadence_spm", "stride_length_m"} & norms
