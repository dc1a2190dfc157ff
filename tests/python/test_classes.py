"""Classes of motion: standing, blobs of several classes, their estimates, track files and simulated clips."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import drawn_person
import mocap_files
import numpy as np
import pytest

import gait
from gait.bindings.estimate import Estimate
from gait.body.motion_classes import class_sections
from gait.body.skeleton import points
from gait.cli import main
from gait.errors import GaitError, UsageError, UserError
from gait.io import blob, track_file
from gait.learn.classes import run as class_run
from gait.learn.classes import standing
from gait.learn.classes.join import Change, MotionClass, join
from gait.learn.corpus.load import NothingLeft
from gait.learn.options import LearnOptions, SegmentOptions
from gait.learn.prior.level import level_components
from gait.learn.prior.model import meta_section, origin
from gait.learn.report import page as pages
from gait.learn.report.classes import figures
from gait.learn.run import require_other_output
from gait.motion.verdict import verdict_of
from gait.report.drawing import class_words
from gait.report.run_files import estimates_of
from gait.report.run_page import Run, run_page
from gait.simulate.clip import describe, planned_events, simulate
from gait.simulate.scenario import PRESETS, Scenario
from gait.simulate.stage import build_set, set_stage
from gait.simulate.walk import TOE_OFF

SHIPPED = Path(gait.__file__).parent / "data/walk.gait"
CLASSES = SHIPPED.with_name("classes.gait")


def classes() -> list[MotionClass]:
    """Walk, stand and walk backwards."""
    walk = blob.read(SHIPPED)
    return [
        MotionClass("walk", changes={"stand": Change(1.0, 6.0, 0.05)}),
        MotionClass("stand", 0, own=standing.sections(walk), changes={"walk": Change(0.7, 6.0)}),
        MotionClass("backwards", -1, source="walk", changes={"stand": Change(1.0, 6.0, 0.05)}),
    ]


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> gait.Model:
    path = tmp_path_factory.mktemp("classes") / "m.gait"
    blob.write(path, join(blob.read(SHIPPED), classes()))
    return gait.Model(path)


def test_who_stands_is_on_straight_legs_with_the_soles_on_the_ground(
    model: gait.Model,
) -> None:
    walking, still = gait.State(phase=0.25), gait.State(motion_class=1)
    lowest = []
    for state in (walking, still):
        joints, _ = model.pose(state)
        lowest.append(joints[:, 2].min() + model.pelvis_height(state))
    assert lowest[1] == pytest.approx(lowest[0], abs=0.015)
    at = {name: joints[i] for i, name in enumerate(model.joint_names)}
    for side in "lr":
        assert abs(at[f"{side}_ankle"][0] - at[f"{side}_hip"][0]) < 0.01
        assert at[f"{side}_wrist"][2] < 0
    assert (
        model.pelvis_height(still)
        > max(model.pelvis_height(gait.State(phase=phase)) for phase in np.linspace(0, 1, 20)) - 0.005
    )
    other = replace(still, phase=0.6)
    assert np.array_equal(model.pose(still)[0], model.pose(other)[0])


def test_the_blob_names_its_classes(model: gait.Model) -> None:
    assert model.classes == ("walk", "stand", "backwards")
    assert [model.class_info(k).direction for k in range(3)] == [1, 0, -1]
    assert model.class_info(2).components == model.info.components
    with pytest.raises(IndexError, match="the model has 3"):
        model.class_info(3)
    with pytest.raises(GaitError):
        model.pose(gait.State(motion_class=3))
    assert gait.Model(SHIPPED).classes[0] == "walk"


def feet_lifted(sections: Mapping[str, blob.Array]) -> float:
    """Most by which a sd of a component lifts or lowers the feet that stand, statures."""
    names = blob.unpack_names(sections["PTNM"])
    feet = [names.index(f"{side}_{part}") for side in "lr" for part in ("heel", "toe")]
    height = blob.unpack_names(sections["CHNM"]).index("root_height")

    def lowest(curve: np.ndarray) -> np.ndarray:
        return points(sections, curve)[:, feet, 2].min(axis=1) + curve[:, height]

    mean, *components = np.asarray(sections["CURV"], float)
    stands = np.argsort(lowest(mean))[: len(mean) // 3]
    return max(float(abs(np.mean((lowest(mean + c) - lowest(mean - c))[stands]) / 2)) for c in components)


def test_components_leave_the_feet_on_the_floor() -> None:
    four, alone = blob.read(CLASSES), blob.read(SHIPPED)
    assert feet_lifted(four) < 1e-5 and feet_lifted(class_sections(four, 3)) < 1e-5
    assert feet_lifted(alone) > 0.003  # as learnt alone
    curves = level_components(alone, alone)
    assert feet_lifted(alone | {"CURV": curves}) < 1e-5
    change, height = curves - alone["CURV"], blob.unpack_names(alone["CHNM"]).index("root_height")
    assert not np.delete(change, height, axis=2).any() and not change[0].any()
    assert np.allclose(change, change.mean(axis=1, keepdims=True), atol=2e-6)  # the same at every phase


def test_classes_that_do_not_fit_are_refused() -> None:
    walk, three = blob.read(SHIPPED), classes()
    with pytest.raises(UserError, match="give each its own name"):
        join(walk, [*three, three[1]])
    with pytest.raises(UserError, match="class limp: has no curves, and no class 'trot'"):
        join(walk, [*three, MotionClass("limp", source="trot")])
    other = dict(three[1].own or {}) | {"CHNM": blob.pack_names(["a", "b"])}
    with pytest.raises(UserError, match="class stand: its model has other channels"):
        join(walk, [three[0], replace(three[1], own=other)])
    assert join(join(walk, three), three).keys() == join(walk, three).keys()


@pytest.mark.long
def test_learn_makes_classes_and_info_shows_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    walks, out = mocap_files.write_trials(tmp_path / "walks", 4), tmp_path / "m.gait"
    words = ["learn", str(walks), "-o", str(out), "--segments", "none", "--quiet", "--json", "--jobs", "1"]
    words += ["--report", str(tmp_path / "report")]
    assert main([*words, "--class", "stand", "--class", "backwards"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert [one["name"] for one in figures["classes"]] == ["walk", "stand", "backwards"]
    assert figures["bytes"] == out.stat().st_size and figures["classes"][0]["cycles"] >= 4
    assert main(["info", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "class stand: derived from the walk, stands still, 4 components" in printed
    assert "class backwards: derived: the curves of walk in reverse" in printed
    assert gait.Model(out).classes == ("walk", "stand", "backwards")
    assert feet_lifted(blob.read(out)) < 1e-5
    page = (tmp_path / "report" / "index.html").read_text()
    assert '<a href="#classes">Classes of motion</a>' in page
    assert "Mean posture of class stand" in page and "of class backwards" not in page
    assert page.count("strip-class-1") == 2 and (tmp_path / "report" / "strip-class-1.png").exists()
    assert (
        "<td>stand</td><td>derived from the walk</td>" in page
        and ">walk 0.7 (prior), backwards 0.3 (prior)<" in page
    )


def test_the_page_has_what_is_known_of_each_class() -> None:
    row = ["a<b", 730, 4.0, 50, None]
    run = {"subject_count": 2, "variance_explained": [0.5, 0.93], "sequences": {"count": 14, "rows": [row]}}
    found = figures(blob.read(CLASSES), {"run": run})
    page, info = pages._classes(found), gait.Model(CLASSES).class_info(3)
    cells = ["recorded: 46 recordings of 2 people, 350 cycles", "1.37 ± 0.08", "0.73", "1.27 ± 0.10", "1.73"]
    assert "".join(f"<td>{cell}</td>" for cell in cells) in page.replace('<td class="n">', "<td>")
    assert found[3]["stride_length_sd_statures"] == pytest.approx(info.stride_length_sd, abs=1e-4)
    assert "Sequences of class run" in page and "a&lt;b" in page and "and 13 more" in page
    assert ">93<" in page and ">75<" in page  # the walk's is in META
    assert "of 2 people" not in pages._classes(figures(blob.read(CLASSES)))


def test_a_class_of_one_cycle_is_refused_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    walks, out = mocap_files.write_trials(tmp_path / "walks", 4), tmp_path / "m.gait"
    mocap_files.write_toy(tmp_path / "limp", "21_01", period=120.0, frames=200)
    words = ["learn", str(walks), "-o", str(out), "--segments", "none", "--quiet", "--jobs", "1"]
    assert main([*words, "--class", f"limp={tmp_path / 'limp'}"]) == 1
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith("gait learn: class limp: ") and error.endswith(
        "add recordings, 3 cycles at least"
    )
    assert not out.exists()


def test_the_cycles_of_a_class_too_short_are_those_of_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mocap_files.write_toy(tmp_path / "limp", "21_01", period=120.0, frames=140)
    words = ["-o", str(tmp_path / "m.gait"), "--quiet", "--jobs", "1"]
    assert main(["learn", str(SHIPPED), *words, "--class", f"limp={tmp_path / 'limp'}"]) == 1
    error = capsys.readouterr().err
    found = re.search(
        r"not learnt as 'limp': 1\.2 s of motion are ([0-9.]+) cycles \(at least 1\.5\)",
        error,
    )
    assert found and float(found[1]) == pytest.approx(140 / 120, abs=0.03)


def test_walks_the_other_way_are_refused_in_words(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mocap_files.write_toy(tmp_path / "ahead", "1_01", frames=400)
    mocap_files.write_toy(tmp_path / "back", "1_01", frames=400, period=-120.0, speed=-1.3)
    words = ["-o", str(tmp_path / "m.gait"), "--quiet", "--jobs", "1"]
    assert (
        main(
            [
                "learn",
                str(SHIPPED),
                *words,
                "--class",
                f"backwards={tmp_path / 'ahead'}",
            ]
        )
        == 1
    )
    error = capsys.readouterr().err
    assert "not learnt as 'backwards': the walk is forwards, or left and right are swapped" in error
    assert "--class" not in error.split("not learnt")[1]
    assert main(["learn", str(tmp_path / "back"), *words]) == 1
    error = capsys.readouterr().err
    assert "not learnt as 'walk': the walk is backwards, or left and right are swapped" in error
    assert error.endswith("leave it out, or give --class backwards=FOLDER\n")


def test_a_class_without_recordings_among_the_sources_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def no_runs(*given: object, **more: object) -> None:
        words = "this is not running; leave it out"
        walk = f"a.amc: not learnt as 'run': {words}, or give --activity walk"
        raise NothingLeft([walk, f"b.amc: not learnt as 'run': {words}"])

    monkeypatch.setattr(class_run, "run", no_runs)
    out = tmp_path / "m.gait"
    (tmp_path / "a.amc").touch()
    assert main(["learn", str(tmp_path), "-o", str(out), "--class", "run"]) == 1
    error = capsys.readouterr().err
    assert "--class run: none of the recordings is a run (b.amc: " in error
    assert "give --class run=FOLDER, or leave it out" in error and not out.exists()


def test_what_belongs_elsewhere_is_neither_noted_nor_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    walks, notes = mocap_files.write_trials(tmp_path / "in", 3), list[str]()
    options = LearnOptions(
        sources=(str(walks),),
        output=str(tmp_path / "m.gait"),
        segments=SegmentOptions(source="none"),
        components=1,
        jobs=1,
        quiet=True,
    )
    figures = class_run.run(options, notes.append, left_out=lambda line: "" if "01_02x" in line else line)
    assert figures["left_out"] == [] and not any("left out" in line for line in notes)
    capsys.readouterr()
    assert main(["info", options.output]) == 0
    assert "\n1 component, " in capsys.readouterr().out


def test_recorded_backward_walks_are_learnt_in_reversed_time(tmp_path: Path) -> None:
    for folder, motion in (("walks", {}), ("backward", {"period": -120.0, "speed": -1.3})):
        for k in range(3):
            mocap_files.write_toy(tmp_path / folder, f"{k}_01", frames=400, offset=10.0 * k, **motion)
    out, words = tmp_path / "m.gait", ["--segments", "none", "--quiet", "--jobs", "1"]
    source = f"backwards={tmp_path / 'backward'}"
    assert main(["learn", str(tmp_path / "walks"), "-o", str(out), *words, "--class", source]) == 0
    model, sections = gait.Model(out), blob.read(out)
    assert model.class_info(1).direction == -1
    assert model.class_info(1).stride_length == pytest.approx(model.info.stride_length, rel=0.02)
    assert np.degrees(np.abs(sections["CUR1"][0] - sections["CURV"][0]).max()) < 3


def test_any_other_cyclic_motion_is_a_class(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Hops, with both legs at a time, which are refused as a walk."""
    for k in range(3):
        motion = {"period": 90.0, "speed": 0.6, "together": True}
        mocap_files.write_toy(tmp_path / "hops", f"{k}_01", frames=400, offset=10.0 * k, **motion)
    words = ["-o", str(tmp_path / "m.gait"), "--segments", "none", "--jobs", "1", "--components", "1"]
    assert main(["learn", str(tmp_path / "hops"), *words]) == 1
    assert "not learnt as 'walk': the legs do not alternate" in capsys.readouterr().err
    assert main(["learn", str(SHIPPED), *words, "--class", f"hop={tmp_path / 'hops'}"]) == 0
    found = capsys.readouterr()
    assert "class hop: any motion that repeats is learnt as 'hop', which" in found.err
    assert "class hop: recorded: 3 recordings of 3 people, 13 cycles, 1.33 +- " in found.out
    assert " % of the variance, residual " in found.out.splitlines()[-2]
    assert main(["info", str(tmp_path / "m.gait")]) == 0
    printed = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("class hop"))
    info = gait.Model(tmp_path / "m.gait").class_info(1)
    rate = f"{info.stride_hz:.2f} +- {info.stride_hz_sd:.2f} strides/s (period 0.75 s)"
    assert f"class hop: recorded: 3 recordings, 13 cycles, {rate}, " in printed
    assert f"stride length {info.stride_length:.2f} +- {info.stride_length_sd:.2f} statures" in printed
    model = gait.Model(tmp_path / "m.gait")
    state = gait.State(motion_class=model.classes.index("hop"), phase=0.3)
    at = dict(zip(model.joint_names, model.pose(state)[0], strict=True))
    assert abs(at["l_ankle"][0] - at["r_ankle"][0]) < 0.02


def test_classes_are_added_to_a_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "m.gait"
    words = ["--class", "backwards", "--class", "stand", "--class", f"stroll={SHIPPED}"]
    assert main(["learn", str(SHIPPED), "-o", str(out), *words]) == 0
    found = capsys.readouterr()
    assert "classes walk backwards stand stroll" in found.out
    assert "walk.gait: was learnt alone, so its strides are as long at every rate" in found.err
    model = gait.Model(out)
    assert model.classes == ("walk", "backwards", "stand", "stroll")
    assert model.class_info(3).components == model.info.components
    assert blob.read(out)["SGMD"].tobytes() == blob.read(SHIPPED)["SGMD"].tobytes()
    assert main(["learn", str(SHIPPED), "-o", str(tmp_path / "x.gait")]) == 1
    assert "walk.gait: is a model, not a recording; to add to a model" in capsys.readouterr().err
    assert main(["learn", str(SHIPPED), "-o", str(out), "--class", "run"]) == 2
    assert "--class run: the source is a model, which has no recordings; give a" in capsys.readouterr().err
    assert main(["learn", str(SHIPPED), "-o", str(out), *words, "--report", str(tmp_path / "report")]) == 2
    assert "--report: draws what is learnt from recordings" in capsys.readouterr().err


def test_a_class_is_taken_from_a_model_by_its_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, four = tmp_path / "m.gait", blob.read(CLASSES)
    words = ["--class", f"run={CLASSES}", "--class", f"backwards={CLASSES}"]
    assert main(["learn", str(SHIPPED), "-o", str(out), *words]) == 0
    made = blob.read(out)
    assert np.array_equal(made["CUR1"], four["CUR3"]) and np.array_equal(made["PAC1"], four["PAC3"])
    assert np.array_equal(made["CUR2"], four["CURV"])  # it has those of the walk there
    assert made["CLIN"][1:].tolist() == [[1, 1, *four["CLIN"][3, 2:]], [-1, 2, *four["CLIN"][2, 2:]]]
    capsys.readouterr()
    for given, expected in (
        (f"trot={CLASSES}", "has no class trot; name one of its classes, walk stand backwards run"),
        (f"run={SHIPPED}", "is a model of 'walk'; give recordings, or a model of run"),
        (f"stand={SHIPPED}", "is a model of 'walk'; give recordings, or a model of stand"),
        (f"backwards={SHIPPED}", "is a model of 'walk'; give recordings, or a model of backwards"),
    ):
        assert main(["learn", str(SHIPPED), "-o", str(tmp_path / "no.gait"), "--class", given]) == 1
        assert f"--class {given}: {expected}" in capsys.readouterr().err
    assert not (tmp_path / "no.gait").exists()


def test_no_model_that_is_read_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    own, link = Path("own.gait"), Path("link.gait")
    own.write_bytes(SHIPPED.read_bytes())
    link.symlink_to(own)
    Path("limp.amc").write_text(mocap_files.BROKEN)  # not read
    for source, given in (
        ("own.gait", "limp=limp.amc"),
        ("classes", "limp=own.gait"),
        ("link.gait", "stand"),
    ):
        assert main(["learn", source, "-o", "own.gait", "--class", given]) == 2
        error = capsys.readouterr().err
        assert error == "gait learn: -o own.gait: is also an input; give the model another name\n"
    assert own.read_bytes() == SHIPPED.read_bytes()
    for sources, classes in ((("walk",), ()), (("limp.amc",), ("limp=walk",))):
        options = LearnOptions(sources=sources, classes=classes, output=str(SHIPPED))
        with pytest.raises(UsageError, match="is also an input"):
            require_other_output(options)


def test_shipped_models_are_taken_by_their_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for walk, four, out in (
        ("walk", "classes", "a.gait"),
        (str(SHIPPED), str(CLASSES), "b.gait"),
    ):
        assert main(["learn", walk, "-o", out, "--class", f"run={four}", "--quiet"]) == 0
    assert Path("a.gait").read_bytes() == Path("b.gait").read_bytes()
    assert main(["learn", "classes", "-o", "c.gait", "--class", "limp=walk"]) == 0
    assert gait.Model("c.gait").classes == ("walk", "stand", "backwards", "run", "limp")
    capsys.readouterr()
    assert main(["learn", "classes", "-o", "d.gait"]) == 1
    assert "classes: is a model, not a recording" in capsys.readouterr().err
    Path("classes").mkdir()  # a folder of recordings comes first
    assert main(["learn", "classes", "-o", "d.gait", "--class", "stand"]) == 1
    assert "classes: no motion files" in capsys.readouterr().err


def test_a_model_keeps_its_classes_and_the_name_of_the_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "m.gait"
    assert main(["learn", str(CLASSES), "-o", str(out), "--class", f"limp={SHIPPED}"]) == 0
    assert f"{CLASSES}: keeps its classes stand backwards run" in capsys.readouterr().err
    assert gait.Model(out).classes == ("walk", "stand", "backwards", "run", "limp")
    before, after = blob.read(CLASSES), blob.read(out)
    assert np.array_equal(after["CLSW"][:4, :4], before["CLSW"]) and after["CLSW"][4, 0, 0] > 0
    assert all(np.array_equal(after[tag], before[tag]) for tag in before if tag[:2] != "CL")
    runs = blob.read(SHIPPED) | {"META": meta_section({"activity": "run"})}
    blob.write(tmp_path / "runs.gait", runs)
    assert main(["learn", str(tmp_path / "runs.gait"), "-o", str(out), "--class", "stand"]) == 0
    assert gait.Model(out).classes == ("run", "stand")


def test_a_model_contains_the_credits_of_all_its_classes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = {tag: array for tag, array in blob.read(SHIPPED).items() if tag != "META"}
    limp, plain, out = (tmp_path / f"{name}.gait" for name in ("limp", "plain", "m"))
    blob.write(limp, own | {"META": meta_section({"acknowledgement": "Thanks.", "credits": ["Lab A, MIT"]})})
    blob.write(plain, own)
    words = ["--class", f"limp={limp}", "--credit", "Lab B, CC BY 4.0", "--credit", "Lab A, MIT"]
    assert main(["learn", str(plain), "-o", str(out), *words]) == 0
    assert main(["info", str(out)]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[-3:] == ["Thanks.", "Lab B, CC BY 4.0", "Lab A, MIT"]
    assert origin(LearnOptions(credit=("Lab C",)), [])["credits"] == ["Lab C"]


def test_standing_is_learnt_from_people_who_stand(
    model: gait.Model, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The mean of two people, one of them in two recordings; a recording of a walk is left out."""
    for name, elbow in (("anna_01", 1.0), ("anna_02", 1.0), ("ben_01", 0.4)):
        mocap_files.write_stand(tmp_path / "in", name, model, elbow)
    mocap_files.write_stand(tmp_path / "in", "carl_01", model, 0.0, walks=True)
    out, words = tmp_path / "m.gait", ["learn", str(SHIPPED), "-o", str(tmp_path / "m.gait")]
    assert main([*words, "--class", f"stand={tmp_path / 'in'}"]) == 0
    noted = capsys.readouterr().err
    assert "carl_01.csv: not learnt as 'stand': the person does not stand still" in noted
    stood = ", ".join(str(tmp_path / "in" / f"{name}.csv") for name in ("anna_01", "anna_02", "ben_01"))
    assert f"--class stand: recorded: 3 recordings: {stood}\n" in noted
    derived, learnt = standing.sections(blob.read(SHIPPED))["CURV"], blob.read(out)["CUR1"]
    change = np.degrees(learnt[0, 0] - derived[0, 0])
    names = blob.unpack_names(blob.read(SHIPPED)["CHNM"])
    elbows = [name.endswith("elbow_flexion") for name in names]
    assert change[elbows] == pytest.approx(np.degrees(0.7), abs=3)
    legs = [any(joint in name for joint in ("hip", "knee", "ankle")) for name in names]
    assert np.abs(change[legs]).max() < 4 and np.allclose(learnt[1:], derived[1:], atol=2e-3)
    assert gait.Model(out).class_info(1).direction == 0
    assert main(["info", str(out)]) == 0
    assert "class stand: recorded: 3 recordings, stands still" in capsys.readouterr().out
    mocap_files.write_stand(tmp_path / "walks", "carl_01", model, 0.0, walks=True)
    out.unlink()
    assert main([*words, "--class", f"stand={tmp_path / 'walks'}"]) == 1
    assert "none of the recordings can be used" in capsys.readouterr().err and not out.exists()


UNFIT = "the name is blank, or has a comma, quote, '=', '/', '<', '>' or control character"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            ["hop"],
            "--class hop: only run, backwards and stand are sorted out of the sources; give a folder of "
            "recordings, --class hop=FOLDER",
        ),
        (["limp=in", "limp=im"], "--class limp=im: limp is given twice; give each class its own name"),
        ([" =in"], "--class ' =in': the name is blank"),
        (["=in"], "--class '=in': the name is blank"),
        (["../x=in"], f"--class '../x=in': {UNFIT}"),
        (["<b>x=in"], f"--class '<b>x=in': {UNFIT}"),
        (["walk"], "--class walk: give each class its own name, not walk"),
        (
            ["Walk=in"],
            "--class Walk=in: differs from the class walk only by case; rename it",
        ),
        (
            ["limp=in", "Limp=in"],
            "--class Limp=in: differs from the class limp only by case; rename it",
        ),
        (["x" * 80 + "=in"], "the name is longer than 31 bytes; shorten it"),
        (["\u00e9" * 16 + "=in"], "the name is longer than 31 bytes; shorten it"),
        (
            ["a,b=in"],
            f"--class 'a,b=in': {UNFIT}",
        ),
        (['a"b=in'], UNFIT),
        (
            ["a\nb=in"],
            f"--class 'a\\nb=in': {UNFIT}",
        ),
        (["a\udcff=in"], UNFIT),
    ],
)
def test_bad_classes_are_one_line(
    given: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = [word for name in given for word in ("--class", name)]
    assert main(["learn", "nowhere", "-o", str(tmp_path / "m.gait"), *options]) == 2
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ([f"--class={name}={CLASSES}" for name in "abcdefg"], "--class: with walk these are 9 classes"),
        (["--class", "trot=nowhere"], "--class trot: nowhere: no such file or folder"),
        (["--class", f"trot={CLASSES}"], f"--class trot={CLASSES}: has no class trot"),
        (["--changes", "nowhere"], "nowhere: no such file or folder"),
        (["-o", "nowhere/m.gait"], "nowhere/m.gait: folder "),
    ],
)
def test_classes_are_checked_before_any_recording_is_read(
    more: list[str],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """As they are in a run whose only recording cannot be read."""
    monkeypatch.chdir(tmp_path)
    Path("limp.amc").write_text(mocap_files.BROKEN)
    for source in (str(SHIPPED), "limp.amc"):
        assert main(["learn", source, "-o", "m.gait", "--class", "limp=limp.amc", *more]) in (1, 2)
        error = capsys.readouterr().err
        assert error.startswith(f"gait learn: {words}") and error.count("\n") == 1
        assert [path.name for path in tmp_path.iterdir()] == ["limp.amc"]


@pytest.mark.parametrize("name", ["x" * 80, "a=b"])
def test_the_first_class_needs_a_name_that_fits_too(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [
        "learn",
        "nowhere",
        "-o",
        str(tmp_path / "m.gait"),
        "--activity",
        name,
        "--class",
        "stand",
    ]
    assert main(words) == 2
    error = capsys.readouterr().err
    assert "--activity '" in error and ": the name " in error and error.count("\n") == 1


AHEAD = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
CAMERA = gait.Camera(64, 48, 60, 60, 31.5, 23.5, AHEAD, np.array([0, 1, 4.0]))


def estimates(model: gait.Model) -> list[Estimate]:
    """A small clip of a person who stands."""
    tracker = gait.Tracker(model, CAMERA, gait.TrackerConfig.default(particles=64, seed=1))
    mean, sd = model.prior()
    mean.motion_class, mean.phase = 1, 0.3
    sd.phase = sd.heading = 0.05
    tracker.start(mean, sd, 0)
    image = np.full((48, 64), 90, np.uint8)
    return [tracker.step(image, 33_000 * n) for n in range(3)]


def test_estimates_and_track_files_have_the_classes(model: gait.Model, tmp_path: Path) -> None:
    found = estimates(model)
    for one in found:
        assert one.class_probability.sum() == pytest.approx(1, abs=1e-5)
        assert one.motion_class == model.classes[int(one.class_probability.argmax())] == "stand"
        assert one.speed == 0 and model.classes[one.mean.motion_class] == one.motion_class
        assert not one.takes_strides and replace(one, speed=1.0).takes_strides
    path = tmp_path / "t.csv"
    sizes = model.info.components, model.joint_names, model.angle_names
    with track_file.TrackWriter(path, *sizes, model.classes) as rows:
        for number, one in enumerate(found):
            frame = gait.io.video.Frame(number, number / 30, 0, np.zeros((1, 1), np.uint8))
            rows.write(frame, one)
    track = track_file.read_track(path)
    assert track.motion_class == ["stand"] * 3
    for name in ("phase", "stride_hz", "phase_sd", "stride_hz_sd"):
        assert np.isnan(track.numbers[name]).all(), name
    assert (track.numbers["speed_m_s"] == 0).all() and all(np.isfinite(one.mean.phase) for one in found)
    assert np.allclose(track.numbers["p_stand"], [one.class_probability[1] for one in found], atol=1e-4)
    assert track_file.header(2, (), ("walk",)) == track_file.header(2, ())
    drawn = [estimates_of(track, one)[0] for one in (model, gait.Model(SHIPPED))]
    assert [one.mean.motion_class for one in drawn] == [1, 0] and model.render(CAMERA, drawn[0].mean).any()
    assert {class_words(one) for one in (*drawn, found[0])} == {class_words(found[0])} != {""}
    assert not any(one.takes_strides for one in drawn)
    page = run_page(Run("classes", track, verdict_of(track)))
    assert "Probability of each class of motion" in page and "backwards" in page


TINY = {"size": (96, 72), "fps": 30.0, "noise": 0.0}


def test_a_stop_brings_the_feet_together_without_a_slide(tmp_path: Path) -> None:
    stage = set_stage(replace(PRESETS["stopping"], **TINY))
    names, points = stage.classes, stage.walk.points(stage.frames)
    still = [k for k, name in enumerate(names) if name == "stand"]
    assert (
        names[0] == names[-1] == "walk"
        and 30 < len(still) < 100
        and still == list(range(still[0], still[-1] + 1))
    )
    inner = slice(still[12], still[-12])
    speed = np.linalg.norm(np.diff(points["pelvis"][inner], axis=0), axis=1) * 30
    assert speed.max() < 0.05
    assert np.linalg.norm(points["l_ankle"][inner] - points["r_ankle"][inner], axis=1).max() < 0.35
    for side in "lr":
        for part in ("heel", "toe"):  # a person who stands does not slide
            assert np.ptp(points[f"{side}_{part}"][inner], axis=0).max() < 0.005
    assert stage.walk.speed[stage.frames][:10].mean() > 0.9
    found = describe(stage, build_set(stage), planned_events(stage), seed=1)
    assert 0.9 < found["stride_period_s"] < 1.3 and found["stride_period_sd_s"] < 0.1  # without the stand


@pytest.mark.parametrize("name", ["demo", "backwards"])
def test_a_foot_rests_between_its_heel_strike_and_toe_off(name: str) -> None:
    """Heel or toe rests while the foot stands; in a walk backwards it lands at the phase of a toe-off."""
    stage = set_stage(replace(PRESETS[name], **TINY))
    events, points = planned_events(stage), stage.walk.points()
    timing, first = stage.walk.timing, stage.frames[0]
    near = round(0.08 / timing.step)
    for side in "lr":
        paths = [points[f"{side}_{part}"] for part in ("heel", "toe")]
        speeds = [np.linalg.norm(np.gradient(path, timing.step, axis=0), axis=1) for path in paths]
        moves = np.min(speeds, axis=0)
        for event, sign in (("heel_strike", 1), ("toe_off", -1)):
            at = np.rint(first + timing.per_frame * events[f"{side}_{event}"]).astype(int)
            at = at[(at > near) & (at < len(moves) - near)][1:-1]  # those at the ends are cut
            assert len(at) >= 2
            assert moves[at + sign * near].max() < 0.3 and moves[at - sign * near].min() > 0.5


def test_backwards_moves_against_the_heading_and_turns_go_round() -> None:
    back = set_stage(replace(PRESETS["backwards"], **TINY))
    ahead = np.column_stack([np.cos(back.walk.heading[back.frames]), np.sin(back.walk.heading[back.frames])])
    moved = np.diff(back.walk.points(back.frames)["pelvis"][:, :2], axis=0)
    assert (moved * ahead[1:]).sum(1).max() < 0 and set(back.classes) == {"backwards"}
    turn = set_stage(replace(PRESETS["turning"], **TINY))
    heading = np.unwrap(turn.walk.heading[turn.frames])
    assert 70 < abs(np.degrees(heading[-1] - heading[0])) < 85


def test_a_run_flies_falls_and_does_not_slide() -> None:
    stage = set_stage(Scenario(motion="run", frames=40, **TINY))  # type: ignore[arg-type]
    clip = slice(stage.frames[0], stage.frames[-1])
    timing, points = stage.walk.timing, stage.walk.points(clip)
    feet = {side: timing.of_side(side)[clip] % 1 for side in "lr"}
    flies = (feet["l"] > TOE_OFF) & (feet["r"] > TOE_OFF)
    assert set(stage.classes) == {"run"} and 0.2 < flies.mean() < 0.3
    fall = np.median(np.diff(points["pelvis"][:, 2], 2)[flies[1:-1]]) / timing.step**2
    assert fall == pytest.approx(-9.81, rel=0.02)
    for side, phase in feet.items():
        flat = (phase > 0.15) & (phase < 0.35)
        toe = np.diff(points[f"{side}_toe"], axis=0)[flat[1:] & flat[:-1]]
        assert np.linalg.norm(toe, axis=1).max() < 1e-3 and points[f"{side}_toe"][:, 2].min() > 0


def test_a_walk_becomes_a_run_at_a_heel_strike_and_no_foot_slides() -> None:
    stage = set_stage(Scenario(motion="accelerate", frames=90, **TINY))  # type: ignore[arg-type]
    timing, clip = stage.walk.timing, slice(stage.frames[0], stage.frames[-1] + 1)
    first, phase = stage.classes.index("run"), timing.phase[stage.frames]
    assert (
        30 < first < 60 and set(stage.classes[:first]) == {"walk"} and set(stage.classes[first:]) == {"run"}
    )
    assert phase[first - 1] < np.ceil(phase[first - 1]) <= phase[first] and np.diff(phase).min() > 0
    speed = stage.walk.speed[stage.frames]
    assert speed[0] < 1.8 and speed[-1] > 2.4 and np.abs(np.diff(speed)).max() < 0.06
    points, feet = stage.walk.points(clip), {side: timing.of_side(side)[clip] % 1 for side in "lr"}
    flies = (feet["l"] > TOE_OFF) & (feet["r"] > TOE_OFF)
    running = np.arange(len(flies)) >= (stage.frames[first] - stage.frames[0])
    assert not flies[~running].any() and 0.2 < flies[running].mean() < 0.3
    for side, own in feet.items():
        flat = (own > 0.15) & (own < 0.35)
        toe = np.diff(points[f"{side}_toe"], axis=0)[flat[1:] & flat[:-1]]
        assert np.linalg.norm(toe, axis=1).max() < 1e-3 and points[f"{side}_toe"][:, 2].min() > 0


def test_the_class_becomes_run_while_the_phase_goes_on() -> None:
    """A person of the model walks faster and faster for a second, then runs."""
    model, view, plate = gait.Model("classes"), drawn_person.camera(), drawn_person.wall()
    tracker = gait.Tracker(model, view, gait.TrackerConfig.default(particles=600, seed=2), background=plate)
    phase, place, found, true = 0.1, -2.4, list[Estimate](), list[float]()
    for i in range(60):
        now, rate = ("walk", 0.95 + 0.008 * i) if i < 30 else ("run", 1.36)
        info = model.class_info(model.classes.index(now))
        state = gait.State(phase=phase % 1, stride_hz=rate, motion_class=model.classes.index(now))
        state.stature, state.pelvis[0] = 1.75, place
        state.pelvis[2] = model.pelvis_height(state)
        if i == 0:
            sd = gait.State(phase=0.02, stride_hz=0.03, heading=0.03, stature=0.01)
            sd.pelvis = np.full(3, 0.01)
            tracker.start(state, sd, 0)
        found.append(tracker.step(drawn_person.draw(model, view, state, plate, i), round(1e6 * i / 30)))
        true.append(phase)
        place += 1.75 * info.stride_length * rate / 30
        phase += rate / 30
    classes_found = [one.motion_class for one in found]
    assert classes_found[:30].count("walk") >= 28 and classes_found[45:] == ["run"] * 15
    off = np.array([(one.mean.phase - at + 0.5) % 1 - 0.5 for one, at in zip(found, true, strict=True)])
    assert np.abs(off).max() < 0.08


def test_the_truth_names_the_class_where_it_is_not_always_a_walk(
    tmp_path: Path,
) -> None:
    for motion, classes_of in (("stand", {"stand"}), ("walk", {None})):
        folder = tmp_path / motion
        simulate(Scenario(motion=motion, frames=3, **TINY), folder)  # type: ignore[arg-type]
        with (folder / "truth.csv").open(newline="") as file:
            assert {row.get("motion_class") for row in csv.DictReader(file)} == classes_of
        assert json.loads((folder / "meta.json").read_text())["steady"] == (motion == "walk")
