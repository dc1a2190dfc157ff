"""Classes of motion that `gait learn` sorts out of one folder."""

from __future__ import annotations

from pathlib import Path

import mocap_files
import numpy as np
import pytest

import gait
from gait.body.skeleton import ANGLES
from gait.cli import main
from gait.io import blob
from gait.learn.classes import run as class_run
from gait.learn.classes import standing
from gait.learn.options import LearnOptions
from gait.learn.solve import readers

SHIPPED = Path(gait.__file__).parent / "data/walk.gait"
CLASSES = SHIPPED.with_name("classes.gait")


def test_files_learnt_as_another_class_are_not_reported_as_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One line about each file that is in no class, as a run if it is one."""
    reported = {}
    a_run, a_walk = (f"leave it out, or give --activity {name}" for name in ("run", "walk"))
    lines = {
        "walk": (
            f"r.amc: not learnt as 'walk': this is running; {a_run}",
            f"short.amc: not learnt as 'walk': this is running; {a_run}",
            "back.amc: not learnt as 'walk': the walk is backwards; leave it out",
            "bad.amc: cannot be read",
        ),
        "run": (
            f"w.amc: not learnt as 'run': this is not running; {a_walk}",
            "short.amc: not learnt as 'run': too little of each cycle is observed; leave it out",
            f"back.amc: not learnt as 'run': this is not running; {a_walk}",
            "bad.amc: cannot be read",
        ),
    }

    def learnt(
        options, note, complete=lambda sections: sections, left_out=lambda line: line, only=(), metas=None
    ):
        found = map(left_out, lines[options.activity])
        reported[options.activity] = [line for line in found if line]
        blob.write(options.output, complete(blob.read(SHIPPED)))
        return {"sequences": [{"source": f"{options.activity[0]}.amc"}]}

    monkeypatch.setattr(class_run, "run", learnt)
    monkeypatch.chdir(tmp_path)
    names = ("r.amc", "w.amc", "short.amc", "back.amc", "bad.amc")
    for name in names:
        Path(name).touch()
    options = LearnOptions(sources=names, output=str(tmp_path / "m.gait"), classes=("run",))
    figures = class_run.learn(options, lambda line: None)
    assert [one["name"] for one in figures["classes"]] == ["walk", "run"]
    assert reported == {"run": [], "walk": [lines["run"][1], *lines["walk"][2:]]}


def test_walks_backwards_have_the_static_trials_of_their_people(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def learnt(
        options, note, complete=lambda sections: sections, left_out=lambda line: line, only=(), metas=None
    ):
        asked.append((options.reverse, options.static, only))
        line = "in/anna_2.trc: not learnt as 'walk': ...; or give --class backwards=FOLDER"
        assert left_out(line) == (line if options.reverse else "")
        blob.write(options.output, complete(blob.read(SHIPPED)))
        return {"sequences": [{"source": "in/anna_2.trc"}]}

    asked: list[tuple[bool, tuple[str, ...], set[Path]]] = []
    monkeypatch.setattr(class_run, "run", learnt)
    monkeypatch.chdir(tmp_path)
    for name in ("anna_1", "anna_2", "anna_static", "ben_1", "ben_static"):
        Path("in").mkdir(exist_ok=True)
        Path("in", f"{name}.trc").touch()
    trials = ("in/anna_static.trc", "in/ben_static.trc")
    options = LearnOptions(sources=("in",), output="m.gait", static=trials, classes=("backwards",))
    class_run.learn(options, lambda line: None)
    assert asked == [(False, trials, ()), (True, trials[:1], {Path("in/anna_2.trc")})]


def test_a_mixed_folder_is_sorted_into_classes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Walks, walks backwards, a person who stands; who raises the arms or walks off is no such person."""
    model, source, out = gait.Model(CLASSES), tmp_path / "in", tmp_path / "m.gait"
    words = ["learn", str(source), "-o", str(out), "--segments", "none", "--jobs", "1", "--components", "1"]
    words += ["--class", "stand", "--class", "backwards"]
    for k in range(3):
        mocap_files.write_toy(source, f"{k}_01", frames=400, offset=10.0 * k)

    assert main(words) == 0
    noted, derived, again = capsys.readouterr().err, blob.read(out), tmp_path / "again.gait"
    assert "--class backwards: derived, as the walk in reverse: none of the recordings" in noted
    assert "--class stand: derived from the walk: in none of the recordings" in noted
    assert main(["learn", str(out), "-o", str(again), *words[-4:]]) == 0  # where there is nothing to sort
    assert again.read_bytes() == out.read_bytes()

    mocap_files.write_toy(source, "0_02", frames=400, period=-120.0, speed=-1.3)
    mocap_files.write_toy(source, "1_02", frames=400, offset=10.0, period=-120.0, speed=-1.3)
    mocap_files.write_stand(source, "anna_01", model, 1.0)
    mocap_files.write_stand(source, "ben_01", model, 0.0, raised=1.4)
    mocap_files.write_stand(source, "carl_01", model, 0.0, walks=True, stops=45)
    capsys.readouterr()
    assert main(words) == 0
    noted, sorted_out = capsys.readouterr().err, blob.read(out)
    assert "--class backwards: recorded: 2 recordings" in noted
    assert f"--class stand: recorded: 1 recording: {source / 'anna_01.csv'}\n" in noted
    left = [line.split(": ")[1] for line in noted.splitlines() if line.startswith("left out")]
    assert left == [str(source / f"{name}_01.csv") for name in ("ben", "carl")]
    assert np.array_equal(sorted_out["CURV"], derived["CURV"])  # the walks are the same
    assert sorted_out["CLIN"][:, :2].tolist() == [[1, 0], [0, 1], [-1, 2]]
    assert sorted_out["CLIN"][:, 3].tolist() == [3, 1, 2] and derived["CLIN"][:, 3].tolist()[1] == 0
    posture = standing.posture_of(
        source / "anna_01.csv", readers.read(source / "anna_01.csv", LearnOptions()), throughout=True
    )
    elbow = ANGLES.index("r_elbow_flexion")
    column = blob.unpack_names(derived["CHNM"]).index("r_elbow_flexion")
    assert sorted_out["CUR1"][0, 0, column] == pytest.approx(posture[elbow], abs=1e-5)
    assert main(["info", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "class stand: recorded: 1 recording, stands still" in printed
    assert "class backwards: recorded: 2 recordings, " in printed


def test_too_few_walks_backwards_leave_the_walk_in_reverse(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, out = tmp_path / "in", tmp_path / "m.gait"
    for k in range(3):
        mocap_files.write_toy(source, f"{k}_01", frames=400, offset=10.0 * k)
    mocap_files.write_toy(source, "0_02", frames=220, period=-120.0, speed=-1.3)
    words = ["--segments", "none", "--jobs", "1", "--components", "1", "--class", "backwards"]
    assert main(["learn", str(source), "-o", str(out), *words]) == 0
    noted = capsys.readouterr().err
    assert "--class backwards: derived, as the walk in reverse: class backwards: " in noted
    assert "3 cycles at least" in noted
    assert blob.read(out)["CLIN"][1, :2].tolist() == [-1, 0]
