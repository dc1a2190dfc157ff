"""Errors of gait parameters compared with a truth: known errors are found, and covering intervals counted."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from walking_track import walking_track

from gait import UserError
from gait.io.track_file import Joints
from gait.motion.footfalls import find_events
from gait.motion.parameters import PARAMETER_LABELS, measure

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
from gait_errors import gait_errors, true_events


def truth_of(track):
    return Joints(track.frame, track.time, track.places)


def test_a_known_error_of_each_kind_is_found():
    """A track 20 ms late with lengths 3 % too large: events are late, durations right, lengths too large."""
    truth = truth_of(walking_track(seconds=6))
    late, large = 0.02, 1.03
    places = {}
    for name, place in truth.places.items():
        moved = np.stack([np.interp(truth.time - late, truth.time, axis) for axis in place.T], axis=1)
        places[name] = moved * [large, large, 1]
    track = replace(walking_track(seconds=6), places=places)
    found = gait_errors(measure(track), truth, find_events(truth))
    assert set(PARAMETER_LABELS) <= set(found)
    np.testing.assert_allclose(found["heel_strike_s"].error[2:-2], late, atol=0.006)
    np.testing.assert_allclose(found["stride_time_s"].error, 0, atol=0.006)
    length = found["mean:stride_length_m"]
    assert length.error / length.true == pytest.approx([0.03], abs=0.005)
    assert found["asymmetry:step_length_m"].error == pytest.approx([0], abs=0.6)
    assert not found["mean:stride_length_m"].covered.any() and found["step_time_s"].covered.all()


def test_strides_of_which_one_side_knows_nothing_are_left_out():
    truth = truth_of(walking_track(seconds=6))
    track = walking_track(seconds=4)
    status = ["tracking"] * 60 + ["ambiguous"] * 60
    found = gait_errors(measure(replace(track, status=status)), truth, find_events(truth))
    assert 0 < len(found["stride_time_s"].found) < len(measure(track).strides["right"].start) * 2
    short = {name: place for name, place in truth.places.items() if name != "l_toe"}
    with pytest.raises(UserError, match="truth: has no l_toe; gait parameters need heels and toes"):
        gait_errors(measure(track), replace(truth, places=short), find_events(truth))


def test_events_of_a_clip_are_preferred_to_those_of_its_joints(tmp_path):
    truth = truth_of(walking_track(seconds=6))
    meta = tmp_path / "meta.json"
    assert true_events(truth, meta).strike["left"] == pytest.approx(find_events(truth).strike["left"])
    meta.write_text('{"events_video_frames": {"r_heel_strike": [37.0], "l_heel_strike": [], "r_toe_off": [],'
                    ' "l_toe_off": []}}')  # fmt: skip
    assert true_events(truth, meta).strike["right"] == pytest.approx([1.0])  # frames begin at 7
