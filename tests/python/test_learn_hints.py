"""What gait learn tells of input that is no error: zeros like gaps, labels of no marker, an idle mapping."""

import json

import marked_walker as mw
import mocap_files as files
import numpy as np
import pytest
from test_marker_files import write_c3d

import gait.cli
from gait.learn.mocap import mocap_asf, remarks
from gait.learn.reading import Reading
from gait.learn.solve import body, readers

MAP = {"set": "plug-in-gait", "markers": {"Wand_L": "l_knee_lateral", "LKN": None, "l kne": "l_knee_lateral"}}


def parts(**runs):
    """Columns of noise by name with zeros in the rows given, and one that is always 0."""
    rng = np.random.default_rng(1)
    found = {"fixed": np.zeros((40, 3))}
    for name, rows in runs.items():
        found[name] = rng.normal(size=(40, 2))
        found[name][rows] = 0
    return found


def test_zeros_long_enough_and_together_are_told():
    some = slice(10, 15)
    assert remarks.zero_run(parts(a=some, b=some, c=some), 3) == "a in frames 11 to 15"
    assert remarks.zero_run(parts(x=[], b=slice(3, 15), c=slice(8, 40)), 2) == "b in frames 9 to 15"
    assert remarks.zero_run(parts(b=slice(30, 40)), 1) == "b in frames 31 to 40"
    assert remarks.zero_run(parts(a=some, b=some), 3) == ""
    assert remarks.zero_run(parts(a=some, b=some, c=slice(15, 20)), 3) == ""
    assert remarks.zero_run(parts(a=slice(10, 14), b=[1, 2, 3, 5, 6, 7]), 1) == ""
    half = {"a": np.zeros((40, 1))}
    half["a"][20:] = np.nan
    assert remarks.zero_run(half, 1) == remarks.zero_run({}, 1) == ""


@pytest.fixture
def amc(tmp_path):
    """A toy walk whose left arm is 0 in frames 40 to 49."""
    path = files.write_toy(tmp_path / "people", frames=400)
    lines, frame = path.read_text().splitlines(), 0
    for i, line in enumerate(lines):
        frame = int(line) if line.isdigit() else frame
        if 40 <= frame < 50 and line.split()[0] in ("lhumerus", "lradius", "lowerneck"):
            lines[i] = " ".join([line.split()[0], *("0" for _ in line.split()[1:])])
    path.write_text("\n".join(lines) + "\n")
    return path


def test_readers_notice_zeros_unless_they_are_missing(amc, tmp_path):
    bvh = tmp_path / "a.bvh"
    bvh.write_text(files.bvh_from_amc(amc))
    assert readers.read(amc).remarks.zeros == "lowerneck in frames 40 to 49"
    assert readers.read(amc, Reading(zero_runs=True)).remarks == remarks.NOTHING
    assert readers.read(bvh).remarks.zeros.endswith("in frames 40 to 49")
    assert readers.read(bvh, Reading(zero_runs=True)).remarks == remarks.NOTHING
    whole = body.body(mocap_asf.read(files.write_toy(tmp_path / "whole", frames=400)))
    assert whole.remarks == remarks.NOTHING
    names = [f"{name}_deg" for name in ("l_hip_flexion", "r_hip_flexion", "l_knee_flexion", "r_knee_flexion")]
    table = 10 + 30 * np.sin(np.arange(400)[:, None] / 20 + np.arange(4))
    table[100:120, 1:] = 0
    rows = [
        ",".join(["time", *names]),
        *(f"{t / 120:.5f}," + ",".join(map(str, r)) for t, r in enumerate(table)),
    ]
    (tmp_path / "a.csv").write_text("\n".join(rows) + "\n")
    assert readers.read(tmp_path / "a.csv").remarks.zeros == "r_hip_flexion in frames 101 to 120"
    assert readers.read(tmp_path / "a.csv", Reading(zero_runs=True)).remarks == remarks.NOTHING


def said(capsys, *words):
    assert gait.cli.main(["learn", *map(str, words), "--segments", "none"]) == 0
    return capsys.readouterr().err


def test_zeros_are_hinted_at_once(amc, tmp_path, capsys):
    (amc.parent / "77_02.amc").write_bytes(amc.read_bytes())
    words = (amc.parent, "-o", tmp_path / "m.gait", "--components", 1)
    line = "77_01.amc: exactly 0: lowerneck in frames 40 to 49 (and so on in 1 more file); if that is missing"
    err = said(capsys, *words)
    assert line in err and err.count("--zeros-missing") == 1
    assert "exactly 0" not in said(capsys, *words, "--zeros-missing")
    assert not said(capsys, *words, "--quiet")


def test_labels_of_no_marker_and_a_mapping_without_markers_are_told(amc, tmp_path, capsys):
    for k in (1, 2):
        points, _ = mw.walker(mw.FULL, frames=400, seed=k)
        write_c3d(tmp_path / f"{k}_1.c3d", mw.FULL, points)
    mapping = tmp_path / "map.json"
    mapping.write_text(json.dumps(MAP))
    words = ("-o", tmp_path / "m.gait", "--components", 1, "--activity", "march", "--markers", mapping)
    marked = [tmp_path / "1_1.c3d", tmp_path / "2_1.c3d"]
    err = said(capsys, *marked, *words)
    assert err.count("--markers") == 1
    assert f"--markers {mapping}: no file read has a marker 'Wand_L', 'LKN'; check the spelling\n" in err
    assert "Wand_L" not in said(capsys, *marked, *words, "--quiet")
    err = said(capsys, amc, *words)
    assert (
        f"--markers {mapping}: not used: no file is a .c3d or .trc\n" in err and err.count("--markers") == 1
    )


def test_zeros_are_hinted_at_where_they_may_be_why_a_file_is_refused(amc, tmp_path, capsys):
    (amc.parent / "77_02.amc").write_bytes(amc.read_bytes())
    for source in (amc, amc.parent):
        words = ("learn", source, "-o", tmp_path / "m.gait", "--activity", "run", "--segments", "none")
        assert gait.cli.main([*map(str, words)]) == 1
        err = capsys.readouterr().err
        assert "not learnt as 'run'" in err and err.count("give --zeros-missing") == 1
