"""Gait parameters and norms of people who run, become faster or walk backwards, by class of motion."""

import re
from dataclasses import replace
from functools import cache
from html import escape

import numpy as np
import pytest
from walking_track import walking_track, write_track

from gait.bindings.model import read_cyclic
from gait.body.motion_classes import class_names
from gait.body.skeleton import JOINTS
from gait.cli import main
from gait.io.track_file import Track
from gait.motion.norms import beside_norms
from gait.motion.parameters import as_json, measure, norm_model, stride_rows, without_norm
from gait.motion.verdict import verdict_of
from gait.report.run_page import Run, cycles_of, run_page
from gait.simulate.scenario import PRESETS
from gait.simulate.stage import set_stage

CLASSES = read_cyclic("classes")


@cache
def true_track(preset: str, frames: int = 180) -> Track:
    """The true motion of a person of `gait simulate`, as a track with its classes of motion."""
    stage = set_stage(replace(PRESETS[preset], frames=frames, size=(96, 72), noise=0.0))
    at, timing, n = stage.frames, stage.walk.timing, len(stage.frames)
    places = {name: place for name, place in stage.walk.points(at).items() if name in JOINTS}
    phase = timing.phase[at] % 1
    numbers = {f"c_{k}{end}": np.zeros(n) for k in range(1, 9) for end in ("", "_sd")}
    numbers |= {"phase": phase, "phase_sd": np.full(n, 0.01), "stature_m": np.full(n, 1.75)}
    numbers |= {"stride_hz": np.gradient(timing.phase[at]) * 30, "stature_sd_m": np.full(n, 0.01)}
    numbers |= {"speed_m_s": stage.walk.speed[at]}
    numbers |= {f"p_{name}": 1.0 * (np.array(stage.classes) == name) for name in class_names(CLASSES)}
    numbers |= {"heading_rad": stage.walk.heading[at], "r_knee_flexion_deg": np.zeros(n)}
    return Track(
        frame=np.arange(n),
        time=np.arange(n) / 30,
        places=places,
        status=["tracking"] * n,
        phase=phase,
        sd={name: np.full((n, 3), 0.005) for name in JOINTS},
        numbers=numbers,
        motion_class=list(stage.classes),
    )


def test_a_walk_that_becomes_a_run_gives_the_means_of_one_class():
    track = true_track("accelerating")
    found = measure(track)
    assert found.motion_class == "run" and found.others == 6
    assert "not counted: 6 not of class run" in found.counted()
    speeds = np.concatenate([s.values["speed_m_s"][s.counts] for s in found.strides.values()])
    assert len(speeds) == 6 and speeds.min() > 2.4 and found.speed == pytest.approx(2.49, abs=0.02)
    rows = list(stride_rows(found))
    assert {row["motion_class"] for row in rows} == {"walk", "", "run"}
    assert all(row["counts"] == (row["motion_class"] == "run") for row in rows)
    verdict = verdict_of(track)
    assert verdict.speed < 2.3
    assert f"3 whole strides of class run, {verdict.speed:.2f} m/s along the whole path" in verdict.sentence()
    plain = measure(replace(track, motion_class=[]))
    assert plain.others == 0 and "motion_class" not in next(stride_rows(plain))


def test_a_track_whose_class_changes_in_every_stride_gives_a_warning():
    track = true_track("accelerating")
    changing = replace(track, motion_class=["walk" if k // 3 % 2 else "run" for k in track.frame])
    found = measure(changing)
    assert found.counted() == "0 right and 0 left strides (not counted: 12 in which the class changes)"
    assert "No stride counts, so there are no means: 12 in which the class changes." in found.warning()
    verdict = verdict_of(changing)
    assert found.warning() in run_page(Run("a", changing, verdict, found))


def test_a_run_is_compared_with_runs():
    track = true_track("running")
    found = measure(track)
    norms = {c.name: c for c in beside_norms(track, found, CLASSES, age=30)}
    walks = {c.name: c for c in beside_norms(track, replace(found, motion_class="walk"), CLASSES, age=30)}
    assert "speed_m_s" in walks and "speed_m_s" not in norms  # people walk at that speed
    assert norms["foot_clearance_m"].norm > 2 * walks["foot_clearance_m"].norm
    both = found, replace(found, motion_class="walk")
    tilts = [cycles_of(track, one, CLASSES)["root_pitch"] for one in both]
    run = norm_model(found, CLASSES)
    assert run["CURV"].tobytes() == CLASSES["CUR3"].tobytes() and not any(tag[3:].isdigit() for tag in run)
    assert np.abs(tilts[0].mean - tilts[0].norm_mean).max() < 1.0  # both are those of the mean run
    assert np.abs(tilts[0].mean - tilts[1].mean).max() > 2.0


def test_strides_without_a_norm_state_why():
    back, run = (measure(true_track(name)) for name in ("backwards", "running"))
    reason = without_norm(back, CLASSES)
    assert reason == "strides of class backwards are the model's in reverse, for which there is no norm"
    assert beside_norms(true_track("backwards"), back, CLASSES) == []
    assert cycles_of(true_track("backwards"), back, CLASSES) == {}
    assert without_norm(run, read_cyclic("walk")).startswith("the model has no class run; give the model")
    track = true_track("backwards")
    page = run_page(Run("a", track, verdict_of(track), back, without_norm=reason))
    assert f"No norm, and no angles over the stride: {escape(reason)}." in page
    assert as_json(track, back, {})["strides"][0]["motion_class"] == "backwards"


def test_the_verdict_names_a_class_other_than_the_walk_that_lasts_throughout():
    back, run, walk = (true_track(name) for name in ("backwards", "running", "demo"))
    assert "whole strides of class backwards, " in verdict_of(back).sentence()
    sentence = verdict_of(run).sentence()
    assert "whole strides of class run, " in sentence and "along the whole path" not in sentence
    assert f'<p class="lead">{sentence}.</p>' in run_page(Run("a", run, verdict_of(run)))
    assert set(walk.motion_class) == {"walk"} and "of class" not in verdict_of(walk).sentence()
    short = {"frame": run.frame[:2], "time": run.time[:2], "phase": run.phase[:2]}
    short |= {name: {k: v[:2] for k, v in getattr(run, name).items()} for name in ("places", "sd", "numbers")}
    short = replace(run, status=run.status[:2], motion_class=run.motion_class[:2], **short)
    assert verdict_of(short).sentence() == "Tracked 2 of 2 frames, no whole stride of class run, 2.50 m/s"
    stand = replace(short, motion_class=["stand"] * 2, phase=np.full(2, np.nan))
    assert verdict_of(stand).sentence() == "Tracked 2 of 2 frames, stood throughout"


def test_the_norm_is_that_of_the_model_that_tracked(tmp_path, capsys):
    """Without -m: of a track of the shipped classes these, of one without classes the walk."""
    runs, walks = true_track("running"), walking_track()
    write_track(tmp_path / "runs.csv", runs, classes=runs.classes)
    write_track(tmp_path / "walks.csv", walks)
    found = {}
    for words in (["runs.csv"], ["runs.csv", "-m", "classes"], ["walks.csv"], ["runs.csv", "-m", "walk"]):
        words = [str(tmp_path / words[0]), *words[1:]]
        assert main(["report", "track", *words, "-o", str(tmp_path / "out")]) == 0
        page = re.findall(
            "Norm: the people of the model (.*?)[.]<", (tmp_path / "out/report.html").read_text()
        )
        found[" ".join(words[0].rsplit("/", 1)[-1:] + words[1:])] = capsys.readouterr().out, page
    assert found["runs.csv"] == found["runs.csv -m classes"]
    assert "\nnorm: the people of the model classes, class run\n" in found["runs.csv"][0]
    assert found["runs.csv"][1] == ["classes, class run"] and found["walks.csv"][1] == ["walk"]
    assert "no norm: the model has no class run" in found["runs.csv -m walk"][0]
    assert found["runs.csv -m walk"][1] == []
    limps = replace(runs, numbers=runs.numbers | {"p_limp": np.zeros(len(runs.frame))})
    write_track(tmp_path / "limps.csv", limps, classes=limps.classes)
    assert main(["report", "track", str(tmp_path / "limps.csv")]) == 1
    error = capsys.readouterr().err
    assert "limps.csv: was tracked with the classes walk stand backwards run limp, which no model of" in error
    assert error.endswith("give the model that was tracked with, -m MODEL\n") and error.count("\n") == 1
    assert not (tmp_path / "limps_gait").exists()
