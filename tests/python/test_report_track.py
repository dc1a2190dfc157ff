"""`gait report track`: files, page, words, errors."""

import csv
import json
import re
from xml.etree import ElementTree

import accessibility
import numpy as np
import pytest
from test_parameters import drawn
from walking_track import walking_track, write_track

from gait.cli import main
from gait.motion.footfalls import Events
from gait.motion.parameters import PARAMETER_LABELS, measure
from gait.motion.verdict import verdict_of
from gait.report.colours import BLUE, ORANGE
from gait.report.drawing import side_colour
from gait.report.gait_parts import floor_contacts, footfall_plot


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A track of five seconds, and draws of it."""
    here = tmp_path_factory.mktemp("report")
    track = walking_track()
    write_track(here / "walk.csv", track)
    draws = drawn(track, count=20)
    for i, name in enumerate(draws.joint_names):  # a smoothed track is the mean of its draws
        draws.joints[:, :, i] += track.places[name] - draws.joints[:, :, i].mean(axis=0)
    draws.write(here / "draws.npz")
    return here


def table(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_files_state_the_same_as_the_library(folder, capsys):
    assert main(["report", "track", str(folder / "walk.csv"), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    out = folder / "walk_gait"
    assert json.loads((out / "parameters.json").read_text()) == printed
    known = measure(walking_track())
    speed = printed["summary"]["speed_m_s"]["both"]
    assert speed["mean"] == pytest.approx(known.summary()["speed_m_s"]["both"]["mean"], abs=1e-4)
    events = table(out / "events.csv")
    assert len(events) == known.events.count and [e["event"] for e in events] == [
        e["event"] for e in printed["events"]
    ]
    times = [float(e["time_s"]) for e in events]
    assert times == sorted(times) and float(events[0]["frame"]) == pytest.approx(7 + 30 * times[0], abs=1e-3)
    strides = table(out / "strides.csv")
    assert len(strides) == sum(len(s.start) for s in known.strides.values())
    assert set(PARAMETER_LABELS) <= set(strides[0]) and float(strides[0]["stride_time_s_sd"]) > 0
    curves = table(out / "curves.csv")
    assert len(curves) == 101 and float(curves[50]["l_hip_flexion_norm_sd_deg"]) > 1
    pelvis = {"root_pitch", "root_roll", "root_yaw"}
    assert set(printed["angles"]) == {"r_hip_flexion", "l_hip_flexion", "torso_x"} | pelvis


def test_uncertain_means_are_printed_with_a_warning(folder, capsys):
    text = (folder / "walk.csv").read_text().replace("tracking", "ambiguous")
    (folder / "unsure.csv").write_text(text)
    assert main(["report", "track", str(folder / "unsure.csv")]) == 0
    assert "\nEvery stride has uncertain frames." in capsys.readouterr().out


@pytest.mark.long
def test_the_page_needs_nothing_else_and_its_drawings_are_sound(folder, capsys):
    assert main(["report", "track", str(folder / "walk.csv"), "-o", str(folder / "page")]) == 0
    words = capsys.readouterr().out
    assert "stride time, s" in words and "of each frame, whose errors persist" in words
    page = (folder / "page/report.html").read_text(encoding="utf-8")
    accessibility.check_file(folder / "page/report.html")
    assert not re.search(r'(src|href)="(?!data:|#)', page)
    drawings = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    assert len(drawings) == 6 + 5 + 2 * 6  # strides and angles; what has a form for telephones too
    for drawing in drawings:
        ElementTree.fromstring(drawing.replace("xlink:href", "href"))
    assert "knees are about 10 degrees more flexed than in ISB" in page
    for heading in ("Gait", "Footfalls", "Stride by stride", "Departure from the norm", "Conventions"):
        assert f"<h2>{heading}</h2>" in page
    assert '<p class="lead">Tracked 150 of 150 frames, 3 whole strides, 1.17 m/s.</p>' in page
    assert "Trunk side lean" in page and not re.search("torso_|hip_flexion|_percent|root_", page)


def test_left_is_blue_and_right_orange_as_in_pictures():
    track = walking_track()
    drawing = footfall_plot(track, measure(track))
    assert "fill: var(--left)" in drawing and "fill: var(--right)" in drawing
    assert BLUE not in drawing and ORANGE not in drawing  # the page's style has them, light and dark
    blue, _, red = side_colour("l_knee")
    assert blue > red
    blue, _, red = side_colour("r_knee")
    assert blue < red


def test_a_foot_is_on_the_floor_until_it_leaves_it_however_long_the_person_stands():
    """It stands at first, then for two seconds; one toe-off is unknown; it stands at the end."""
    track = walking_track()
    events = Events(
        {"right": np.array([0.5, 1.5, 4.0, 4.4]), "left": np.array([])},
        {"right": np.array([0.2, 1.1, 3.6]), "left": np.array([0.7])},
    )
    first, last = track.time[[0, -1]]
    begin, until = floor_contacts(track, events, "right")
    assert begin.tolist() == [first, 0.5, 1.5, 4.0, 4.4] and until.tolist() == [0.2, 1.1, 3.6, 4.4, last]
    begin, until = floor_contacts(track, events, "left")
    assert begin.tolist() == [first] and until.tolist() == [0.7]


def test_draws_are_used_where_given(folder, capsys):
    command = ["report", "track", str(folder / "walk.csv"), "-o", str(folder / "d"), "--json"]
    sd = []
    for draws in ([], ["--draws", str(folder / "draws.npz")]):
        assert main([*command, *draws]) == 0
        printed = json.loads(capsys.readouterr().out)
        sd.append(np.median([e["sd_s"] for e in printed["events"] if e["event"].endswith("heel_strike")]))
    assert printed["uncertainty"].startswith("20 motions")
    assert sd[1] > 1.5 * sd[0]  # the draws are late by 20 ms, a person's own strikes by 7


def test_draws_of_another_track_are_refused(folder, capsys):
    track = walking_track()
    for place in track.places.values():
        place[:, 0] += 0.04
    write_track(folder / "other.csv", track)
    command = ["report", "track", str(folder / "other.csv"), "--draws", str(folder / "draws.npz")]
    assert main(command) == 1
    error = capsys.readouterr().err
    assert "draws.npz: its joints are 0.04 m from those of the track; give the draws made with it" in error


def test_settling_may_be_in_the_middle():
    track = walking_track()
    track.status[28] = "init"
    assert verdict_of(track).sentence().endswith("; settling in 1 frame")


def test_a_track_that_was_lost_all_along_still_has_a_page(folder):
    track = walking_track()
    track.status[:] = ["lost"] * len(track.status)
    write_track(folder / "lost.csv", track)
    assert main(["report", "track", str(folder / "lost.csv"), "--quiet"]) == 0
    assert "null" in (folder / "lost_gait/parameters.json").read_text()


def cut(source, target, lines):
    """Copy the first lines of a file."""
    target.write_text("".join(source.read_text().splitlines(keepends=True)[:lines]))


def lifted(source, target):
    """Write a track as gait lift does, joints alone."""
    rows = table(source)
    names = [name for name in rows[0] if name in ("frame", "time") or re.fullmatch(r"\w+_s?[xyz]", name)]
    with open(target, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names, extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda here: write_track(here / "x.csv", walking_track(seconds=0.9)),
            "x.csv: has no whole stride in",
        ),
        (lambda here: cut(here / "walk.csv", here / "x.csv", 3), "x.csv: has fewer than three frames; track"),
        (lambda here: lifted(here / "walk.csv", here / "x.csv"), "x.csv: has only joints, as from gait lift"),
        (lambda here: (here / "x.csv").write_text("frame\n"), "x.csv: has no rows"),
        (lambda here: (here / "x.csv").unlink(missing_ok=True), "x.csv: no such track file"),
    ],
)
def test_what_cannot_be_measured_is_one_line(folder, capsys, change, words):
    change(folder)
    assert main(["report", "track", str(folder / "x.csv")]) == 1
    printed = capsys.readouterr().err
    assert words in printed and printed.count("\n") == 1 and not (folder / "x_gait").exists()


def test_the_other_report_is_still_there(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["report", "--help"])
    assert stop.value.code == 0 and "E.log" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["report", "track", "--help"])
    assert "usage: gait report track" in capsys.readouterr().out
