"""Recordings that show several motions: the part that is learnt, and what is reported."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from gait.cli import main
from gait.learn.cycles import sequence
from gait.learn.options import LearnOptions
from gait.learn.solve.joints import from_joints
from gait.reproducible import one_thread
from gait.simulate.scenario import PRESETS
from gait.simulate.stage import set_stage

Row = tuple[str, int, int, int]  # preset, frames, frames per second, seed
STOP = ("stopping", 1200, 100, 7)  # 3.9 s of walking, 5.4 s of standing, 2.7 s of walking
BRIEF_STOP = ("stopping", 300, 30, 61)
SHORT_WALKS = ("stopping", 400, 60, 61)  # 1.9 s of walking, 3.4 s of standing, 1.4 s of walking
BOTH = ("accelerating", 300, 30, 71)  # walking and running for 5 s each
HALF = ("accelerating", 180, 30, 3)  # the whole seems to have a period of 2 s
MORE_WALK = ("accelerating", 600, 60, 5)


@cache
def simulated(row: Row) -> tuple[dict[str, np.ndarray], list[str]]:
    """Joints (T, 3) by name and class of each frame of a simulated person."""
    preset, frames, fps, seed = row
    stage = set_stage(replace(PRESETS[preset], frames=frames, fps=fps, seed=seed))
    return stage.walk.points(stage.frames), stage.classes


def write(path: Path, row: Row) -> Path:
    places, _ = simulated(row)
    path.parent.mkdir(exist_ok=True)
    table = np.column_stack(list(places.values()))
    head = ",".join(["frame", "time", *(f"{name}_{axis}" for name in places for axis in "xyz")])
    rows = [f"{t},{t / row[2]:.6f}," + ",".join(f"{x:.4f}" for x in one) for t, one in enumerate(table)]
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


def learn(*words: object) -> int:
    return main(["learn", *map(str, words), "--segments", "none", "--components", "1", "--jobs", "1"])


@pytest.mark.parametrize(
    ("row", "activity", "seconds"),
    [
        (STOP, "walk", (0.0, 3.0)),  # the longer of two walks
        (BOTH, "walk", (0.0, 4.3)),
        (BOTH, "run", (5.1, 10.0)),
        (HALF, "run", (3.6, 6.0)),
        (MORE_WALK, "walk", (0.0, 4.8)),
        (MORE_WALK, "run", (5.4, 10.0)),
    ],
)
def test_the_longest_part_of_the_activity_is_learnt_and_named(tmp_path, capsys, row, activity, seconds):
    path = write(tmp_path / "a_01.csv", row)
    assert learn(path, "-o", tmp_path / "m.gait", "--activity", activity, "--json") == 0
    reported = capsys.readouterr()
    (made,) = json.loads(reported.out)["sequences"]
    _, classes = simulated(row)
    assert set(classes[slice(*made["kept"])]) == {activity} and made["activity"] == activity
    assert np.divide(made["kept"], row[2]) == pytest.approx(seconds, abs=0.3)
    assert [bool(why) for why in made["cut"]] == [
        made["kept"][0] > 0,
        made["kept"][1] < row[1],
    ]
    (line,) = [line for line in reported.err.splitlines() if str(path) in line]
    start, stop = (f"{frame / row[2]:.1f}" for frame in made["kept"])
    assert line == (
        f"{path}: not one steady motion: learnt from {start} to {stop} s of {row[1] / row[2]:.1f} s"
    )


def test_recordings_of_both_classes_give_both(tmp_path, capsys):
    for k, row in enumerate((BOTH, MORE_WALK)):
        write(tmp_path / "in" / f"a{k}_01.csv", row)
    assert learn(tmp_path / "in", "-o", tmp_path / "m.gait", "--class", "run", "--json") == 0
    reported = capsys.readouterr()
    assert [one["name"] for one in json.loads(reported.out)["classes"]] == ["walk", "run"]
    lines = [line for line in reported.err.splitlines() if "not one steady motion" in line]
    assert len(lines) == 2 and all("motion (and similar in 1 more file): learnt" in line for line in lines)
    assert lines[0].startswith("class run: ") and "left out" not in reported.err


def test_a_refusal_names_what_was_found(tmp_path, capsys):
    path = write(tmp_path / "a_01.csv", SHORT_WALKS)
    assert learn(path, "-o", tmp_path / "m.gait") == 1
    found = re.fullmatch(
        r".*: not learnt as 'walk': several motions, of which the longest steady walk lasts "
        r"(\d\.\d) s, (\d\.\d+) cycles \(at least 1.5\); leave it out\n",
        capsys.readouterr().err,
    )
    assert found and 1.0 < float(found[1]) < 1.9 and 1.0 < float(found[2]) < 1.5
    path = write(tmp_path / "b_01.csv", BRIEF_STOP)
    assert learn(path, "-o", tmp_path / "m.gait", "--activity", "run") == 1
    reported = capsys.readouterr().err
    assert "not learnt as 'run': 0.0 to 2.6 s of 10.0 s: this is not running: there is a foot" in reported
    assert reported.endswith("leave it out, or give --activity walk\n")


def test_a_walk_without_other_motions_is_not_named(tmp_path, capsys):
    path = write(tmp_path / "a_01.csv", ("side", 120, 30, 3))
    assert learn(path, "-o", tmp_path / "m.gait") == 0
    assert "steady" not in capsys.readouterr().err


def test_the_part_of_a_walk_backwards_is_that_of_the_file():
    """A recording in reversed time, which the option reverses again."""
    places, _ = simulated(BRIEF_STOP)
    walk = from_joints(Path("a_01.csv"), places, BRIEF_STOP[2])
    with one_thread():
        ahead = sequence.prepare(Path("a_01.csv"), walk)
        back = sequence.prepare(Path("a_01.csv"), walk.reversed(), LearnOptions(reverse=True))
    assert np.array_equal(ahead.channels, back.channels, equal_nan=True)
    assert back.kept == tuple(BRIEF_STOP[1] - frame for frame in ahead.kept[::-1])
    assert back.cut == ahead.cut[::-1] and back.part.startswith("7.4 to 10.0 s")
