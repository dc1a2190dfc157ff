"""Who is who in a run: by prefix, folder or file."""

import json
import shutil
from pathlib import Path

import mocap_files as files
import pytest

import gait.cli
from gait.learn.corpus import sources
from gait.learn.corpus.subjects import names, subjects


def paths(*words):
    return [Path("/data") / word for word in words]


CMU = paths("cmu/02/02_01.amc", "cmu/02/02_02.amc", "cmu/05/05_01.amc")
PEOPLE = paths("Anna/walk_01.amc", "Anna/walk_02.amc", "Ben/walk_01.amc", "Cy/slow_01.amc")


@pytest.mark.parametrize(
    ("found", "rule", "expected"),
    [
        (CMU, "auto", ["02", "02", "05"]),
        (paths("02_01.amc", "05_01.amc", "05_02.bvh"), "auto", ["02", "05", "05"]),
        (paths("a/02/02_01.amc", "b/02/02_04.amc", "b/md/md_01.amc"), "auto", ["02", "02", "md"]),
        (PEOPLE, "auto", ["Anna", "Anna", "Ben", "Cy"]),
        (paths("Anna/walk.bvh", "Anna/slow.bvh", "Ben/walk.bvh"), "auto", ["Anna", "Anna", "Ben"]),
        (paths("Anna/day/walk_1.c3d", "Ben/day/walk_1.c3d"), "auto", ["Anna/day", "Ben/day"]),
        (PEOPLE, "prefix", ["walk", "walk", "walk", "slow"]),
        (paths("one.bvh", "two.bvh"), "prefix", ["one", "two"]),
        (CMU, "folder", ["02", "02", "05"]),
        (paths("all/02_01.amc", "all/05_01.amc"), "folder", ["all", "all"]),
        (PEOPLE, "file", ["Anna/walk_01", "walk_02", "Ben/walk_01", "slow_01"]),
    ],
)
def test_files_belong_to_people(found, rule, expected):
    assert subjects(found, rule) == expected


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (CMU, ["02_01", "02_02", "05_01"]),
        (PEOPLE, ["Anna/walk_01", "walk_02", "Ben/walk_01", "slow_01"]),
        (paths("a/S1/x_1.trc", "b/S1/x_1.trc", "b/S1/y.trc"), ["a/S1/x_1", "b/S1/x_1", "S1/y"]),
        (paths("S1/x_1.trc", "S1/x_1.c3d"), ["x_1.trc", "x_1.c3d"]),
    ],
)
def test_every_recording_has_a_name_of_its_own(found, expected):
    assert names(found) == expected


def test_relative_paths_name_their_folders(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert subjects([Path("walk.bvh")]) == [tmp_path.name]
    assert names([Path("walk.bvh")]) == [f"{tmp_path.name}/walk"]


def test_names_do_not_hang_on_how_a_path_is_spelt(tmp_path, monkeypatch):
    (tmp_path / "Anna").mkdir()
    (tmp_path / "Anna/walk.bvh").write_text("")
    monkeypatch.chdir(tmp_path / "Anna")
    spelt = [Path(words) for words in ("walk.bvh", "../Anna/walk.bvh", "../Anna/../Anna/walk.bvh")]
    for path in (*spelt, tmp_path / "Anna/walk.bvh"):
        assert (subjects([path]), names([path])) == (["Anna"], ["Anna/walk"])
    assert sources.find(map(str, [*spelt, ".", tmp_path])) == [(spelt[2], False)]


def test_a_folder_for_each_person_is_learnt_as_such(tmp_path, capsys):
    for k, person in enumerate(("Anna", "Ben", "Cy")):
        files.write_toy(tmp_path / person, "walk_01", period=110.0 + 6 * k, seed=k)
        shutil.copy(tmp_path / person / "walk_01.amc", tmp_path / person / "walk_02.amc")

    def learnt(*words):
        assert gait.cli.main(["learn", str(tmp_path), "-o", str(tmp_path / "m.gait"), *words]) == 0
        return capsys.readouterr().out

    auto, prefix = (json.loads(learnt("--json", *words)) for words in ((), ("--subjects", "prefix")))
    assert auto["subjects"] == ["Anna", "Ben", "Cy"] and prefix["subjects"] == ["walk"]
    assert len({s["name"] for s in auto["sequences"]}) == 6
    assert "6 sequences of 3 subjects (Anna Ben Cy), " in learnt("--quiet")
