"""gait learn: what it refuses to write over, what --exclude leaves out, and models of little data."""

import os
import re
from pathlib import Path

import gait_generator as g
import mocap_files as files
import numpy as np
import pytest

import gait.cli
from gait import Model
from gait.body.skeleton import CHANNELS, Proportions
from gait.io import blob
from gait.learn.corpus import sources
from gait.learn.prior import between, ground
from gait.learn.report import report

SHIPPED = Path(gait.__file__).parent / "data/walk.gait"


@pytest.fixture(scope="module")
def walks(tmp_path_factory):
    folder = tmp_path_factory.mktemp("walks")
    for subject in (1, 2):
        motion = {"period": 110.0 + 6 * subject, "seed": subject, "frames": 480}
        files.write_toy(folder / f"{subject:02}", f"{subject:02}_01", speed=1.1, **motion)
    return folder


def run(*words):
    return gait.cli.main([str(w) for w in words])


def test_the_model_never_replaces_what_is_read(walks, tmp_path, capsys):
    amc = walks / "01/01_01.amc"
    held = amc.read_bytes()
    link = tmp_path / "m.gait"
    link.symlink_to(amc)
    for output in (amc, link, walks / "01/01.asf", tmp_path / "new.csv"):
        assert run("learn", walks, "-o", output, "--quiet") == 2
        assert "-o" in capsys.readouterr().err
    assert amc.read_bytes() == held and not (tmp_path / "new.csv").exists()
    markers = tmp_path / "map.json"
    markers.write_text('{"l_ankle": ["LANK"]}')
    assert run("learn", walks, "-o", markers, "--markers", markers, "--quiet") != 0
    assert markers.read_text().startswith("{")


def test_model_and_report_have_places_of_their_own(walks, tmp_path, capsys):
    for report_at in ("rep", "rep/inside"):
        assert run("learn", walks, "-o", tmp_path / "rep", "--report", tmp_path / report_at, "--quiet") == 2
        assert "--report" in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_an_interrupted_report_leaves_the_model_alone(walks, tmp_path, capsys, monkeypatch):
    def interrupted(folder, drawing):
        (folder / "period.png").write_bytes(b"")
        raise KeyboardInterrupt

    monkeypatch.setattr(report, "_figure", interrupted)
    output = tmp_path / "m.gait"
    assert run("learn", walks, "-o", output, "--report", tmp_path / "rep", "--quiet") == 1
    assert "the model is written; the report is not" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [output] and blob.read(output)


@pytest.mark.parametrize("name", ["01", "01/", "{folder}/01", "01/*", "01_*.amc"])
def test_a_folder_or_a_glob_is_excluded(walks, name):
    idle = []
    found = sources.find([str(walks)], [name.format(folder=walks.name), "nothing*"], idle.append)
    assert [path.name for path, _ in found] == ["02_01.amc"] and idle == ["nothing*"]


def test_an_idle_glob_and_all_that_fails_are_named(walks, tmp_path, capsys):
    assert run("learn", walks, "-o", tmp_path / "m.gait", "--exclude", "03") == 0
    assert "--exclude 03: no file" in capsys.readouterr().err
    (tmp_path / "bad").mkdir()
    for name in ("a.bvh", "b.bvh"):
        (tmp_path / "bad" / name).write_text("x\n")
    assert run("learn", tmp_path / "bad", "-o", tmp_path / "n.gait") == 1
    said = capsys.readouterr().err
    assert "left out: " in said and "a.bvh:1" in said and "b.bvh:1" in said


def test_hidden_files_skeletons_and_empty_names(walks, tmp_path, capsys):
    (tmp_path / ".trash").mkdir()
    (tmp_path / ".trash/a.bvh").write_text("x")
    for source, words in ((tmp_path, "no motion files"), (walks / "01/01.asf", ".amc"), ("", "no name")):
        assert run("learn", source, "-o", tmp_path / "m.gait") == 1
        assert words in capsys.readouterr().err


def test_links_are_followed_once_and_closed_folders_are_named(walks, tmp_path, capsys, monkeypatch):
    for name in ("a", "closed"):
        (tmp_path / name).mkdir()
    (tmp_path / "a/up").symlink_to(tmp_path)
    for name in ("walks", "again"):
        (tmp_path / name).symlink_to(walks)
    (tmp_path / "a/gone.bvh").symlink_to("nowhere")
    real = os.scandir

    def scandir(path):
        if str(path).endswith("closed"):
            raise PermissionError(13, "Permission denied", str(path))
        return real(path)

    monkeypatch.setattr(os, "scandir", scandir)
    closed = []
    found = sources.find([str(tmp_path)], closed=closed.append)
    assert [path.name for path, _ in found] == ["gone.bvh", "01_01.amc", "02_01.amc"]
    assert closed == [f"{tmp_path / 'closed'}: Permission denied; check its permissions"]
    assert run("learn", tmp_path, "-o", tmp_path / "m.gait") == 0
    assert {"closed: Permission denied; check", "gone.bvh: No such file"} <= set(
        re.findall(r"/(closed: .* check|gone.bvh: No such file)", capsys.readouterr().err)
    )
    assert run("learn", tmp_path / "closed", "-o", tmp_path / "n.gait") == 1
    assert "closed: Permission denied; check its permissions" in capsys.readouterr().err


def test_few_people_leave_a_doubt_about_others():
    one, rates = np.zeros(1, int), np.array([0.9, 0.9, 1.0])
    assert between.by_subject(np.array([0.9]), one, 0.07) == pytest.approx((0.9, 0.063))
    two = between.by_subject(rates[1:], np.arange(2), 0.07)
    assert two[1] > rates[1:].std(ddof=1) * 0.99
    assert between.by_subject(rates, np.arange(3), 0.5)[1] == pytest.approx(rates.std(ddof=1))
    assert between.by_subject(np.full(4, 0.9), np.arange(4), 0.07)[1] == pytest.approx(0.009)


def test_the_pelvis_of_the_shipped_model_follows_from_its_legs():
    mean = np.asarray(blob.read(SHIPPED)["CURV"][0], float)
    bare = mean.copy()
    bare[:, CHANNELS.index("root_forward") :] = 0
    height, stride = ground.from_legs(bare, Proportions())
    assert height == pytest.approx(mean[:, ground.HEIGHT], abs=0.02)
    assert stride == pytest.approx(mean[:, ground.FORWARD].mean(), rel=0.2)
    still = np.zeros_like(mean)
    assert ground.from_legs(still, Proportions())[1] == ground.USUAL


def test_a_model_of_angles_alone_stands_on_the_ground(tmp_path, capsys):
    names = [f"{s}_{a}_flexion" for s in "rl" for a in ("hip", "knee")]
    columns = [3 + g.SIDE.index("hip_flexion"), 3 + g.SIDE.index("knee")]
    columns += [c + len(g.SIDE) for c in columns]
    angles = g.mean_curves(np.arange(600) / 110.0)[:, columns]
    angles += np.random.default_rng(0).normal(scale=0.5, size=angles.shape)
    lines = [",".join(["frame", "time", *(f"{n}_deg" for n in names)])]
    lines += [f"{t},{t / 100:.2f}," + ",".join(f"{v:.3f}" for v in row) for t, row in enumerate(angles)]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    assert run("learn", tmp_path / "a.csv", "-o", tmp_path / "m.gait") == 0
    assert "no recording shows root_height or root_forward" in capsys.readouterr().err
    learned = Model(tmp_path / "m.gait")
    mean, sd = learned.prior()
    assert learned.pelvis_height(mean) == pytest.approx(0.51 * mean.stature, abs=0.06)
    assert 0.3 < learned.info.stride_length < 1.6 and learned.info.stride_length_sd > 0 and sd.stride_hz > 0


def test_ctrl_c_while_a_command_is_imported_is_one_line(capsys, monkeypatch):
    def interrupted(name):
        raise KeyboardInterrupt

    monkeypatch.setattr(gait.cli, "import_module", interrupted)
    assert run("learn", "x", "-o", "m.gait") == 1
    assert capsys.readouterr().err == "gait learn: interrupted\n"


@pytest.mark.parametrize("name", ["a.bvh", "a.amc", "a.csv", "a.trc"])
def test_a_file_that_may_not_be_read_says_so(tmp_path, capsys, monkeypatch, name):
    path = tmp_path / name
    path.write_text("x")
    path.with_suffix(".asf").write_text("x")  # of the .amc

    def denied(*_args, **_options):
        raise PermissionError(13, "Permission denied", str(path))

    for method in ("read_text", "read_bytes"):
        monkeypatch.setattr(Path, method, denied)
    assert run("learn", path, "-o", tmp_path / "m.gait", "--quiet") == 1
    assert "Permission denied; check its permissions" in capsys.readouterr().err
