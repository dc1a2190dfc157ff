"""Norms: people at this pace, comfortable speeds by age, and values outside with their certainty."""

import json
from dataclasses import replace

import numpy as np
import pytest
from walking_track import walking_track

from gait import UserError
from gait.bindings.model import read_cyclic
from gait.cli import main
from gait.motion.norms import Compared, beside_norms, comfortable, people, rate_at
from gait.motion.parameters import measure
from gait.report.gait_parts import add_norms
from gait.report.page import Page

MODEL = read_cyclic(None)


def with_stature(track, stature=1.7):
    numbers = track.numbers | {
        "stature_m": np.full(len(track.time), stature),
        "stature_sd_m": 0.01 + 0 * track.time,
    }
    return replace(track, numbers=numbers)


def test_words_follow_the_probability_of_being_outside():
    """A norm of 1 +- 0.1: values from 0.8 to 1.2 are inside."""
    for value, sd, words in (
        (1.0, 0.05, "inside"),
        (1.3, 0.03, "above (100 %)"),
        (0.77, 0.03, "probably below (84 %)"),
        (1.19, 0.03, "perhaps above (37 %)"),
        (1.05, 1.0, "uncertain either way"),
        (1.3, np.nan, "above (uncertainty unknown)"),
        (1.1, np.nan, "inside"),
    ):
        assert Compared("speed_m_s", value, sd, 1.0, 0.1, "age").words == words, value


def test_a_large_step_width_is_outside_and_an_ordinary_walk_inside():
    usual, straddling = (
        with_stature(walking_track(length=1.35, width=w, hz=0.9, sd=0.004)) for w in (0.09, 0.4)
    )
    inside, outside = (
        {c.name: c for c in beside_norms(track, measure(track), MODEL, age=45.0, sex="f")}
        for track in (usual, straddling)
    )
    assert inside["step_width_m"].words == "inside" and outside["step_width_m"].words == "above (100 %)"
    assert inside["speed_m_s"].source == "age" and inside["speed_m_s"].norm == 1.391
    assert inside["cadence_spm"].words == "inside"
    without = {c.name for c in beside_norms(usual, measure(usual), MODEL)}
    assert without == set(inside) - {"speed_m_s"}
    assert beside_norms(walking_track(), measure(walking_track()), MODEL) == []  # no stature


def test_people_whose_sides_differ_more_have_wider_norms_of_asymmetry():
    """META states how alike both sides are; otherwise it is as in the package's recordings."""
    meta = json.loads(MODEL["META"].tobytes())
    sds = []
    for alike in (1.0, None, 0.2):
        stated = meta if alike is None else meta | {"sides_alike": alike}
        found = people(MODEL | {"META": np.frombuffer(json.dumps(stated).encode(), np.uint8)}, 0.9, 1.7)
        sds.append([found[f"asymmetry:{name}"][1] for name in ("step_length_m", "stance_percent")])
        assert found["step_width_m"][1] > 0
    assert (np.diff(sds, axis=0) > 0).all() and sds[1][0] > 1.3 * sds[0][0]


def test_norms_of_asymmetry_have_the_width_of_recorded_people():
    """Step time 3.5 and stance 1.3 percentage points, which the curves of the model alone do not show."""
    found = people(MODEL, 0.9, 1.72)
    assert found["asymmetry:step_time_s"] == pytest.approx((0.0, 3.5), abs=0.3)
    assert found["asymmetry:stance_percent"] == pytest.approx((0.0, 1.3), abs=0.15)


def test_norms_know_their_limits():
    assert comfortable(79.9, "m") == (1.330, 0.196)
    mean, sd = comfortable(25)
    assert mean == pytest.approx(1.4) and 0.153 < sd < 0.175
    with pytest.raises(UserError, match="age 80: norms of speed are known from 20 to 79 years"):
        comfortable(80)
    slow, usual, fast = (rate_at(MODEL, speed, 1.7)[0] for speed in (0.6, 1.29, 1.9))
    assert slow < usual < fast and usual == pytest.approx(float(MODEL["GAIT"][0]), rel=0.02)


def test_the_page_shows_what_is_outside_and_of_which_people_the_norm_is():
    page = Page("walk.mp4", "Tracked.")
    add_norms(page, [Compared("asymmetry:step_length_m", 15.0, 2.0, 1.0, 4.0, "pace")])
    text = page.text().replace("\N{NO-BREAK SPACE}", " ")
    cells = ("asymmetry of step length, %", "15.0 ± 2.0", "1.0 ± 4.0", "at this cadence", "above (100 %)")
    assert "<h2>Beside norms</h2>" in text and all(cell in text for cell in cells)
    empty = Page("walk.mp4", "Tracked.")
    add_norms(empty, [])
    assert "norms" not in empty.text()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--age", "12"], "12: norms are known from 20 to 79 years; leave it out"),
        (["--sex", "f"], "--sex: needs --age"),
    ],
)
def test_wrong_ages_are_errors_of_usage(options, words, capsys):
    try:
        code = main(["report", "track", "absent.csv", *options])
    except SystemExit as exc:
        code = exc.code
    assert code == 2 and words in capsys.readouterr().err
