"""gait learn: what it rejects, excludes and notes, who the files belong to, size and bytes of the model."""

import json
import os
import re
import shutil
from pathlib import Path

import gait_generator as g
import machines
import marked_person as mw
import mocap_files as files
import numpy as np
import pytest
from test_marker_files import write_c3d

import gait.cli
from gait import Model
from gait.body.skeleton import ANGLES, CHANNELS, Proportions
from gait.io import blob
from gait.learn.corpus import load, sources
from gait.learn.corpus.sources import names, subjects
from gait.learn.mocap import acclaim, recording
from gait.learn.options import LearnOptions
from gait.learn.prior import fit, imputation, lengths, model, people
from gait.learn.report import page
from gait.learn.solve import body, readers, retarget

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

    monkeypatch.setattr(page, "_figure", interrupted)
    output = tmp_path / "m.gait"
    assert run("learn", walks, "-o", output, "--report", tmp_path / "rep", "--quiet") == 1
    assert "the model is written; the report is not" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [output] and blob.read(output)


@pytest.mark.parametrize("name", ["01", "01/", "{folder}/01", "01/*", "01_*.amc"])
def test_a_folder_or_a_glob_is_excluded(walks, name):
    warnings = []
    found, _ = sources.find([str(walks)], [name.format(folder=walks.name), "nothing*"], warnings.append)
    assert [path.name for path, _ in found] == ["02_01.amc"] and warnings == [
        "--exclude nothing*: no file's path ends like this"
    ]


def test_lengths_of_a_generic_skeleton_are_not_learnt(walks):
    options = LearnOptions(generic_lengths=("01",), jobs=1)
    files, _ = sources.find([str(walks)])
    first, second = load.load_all(files, options).sequences
    assert first.measures is None and second.measures is not None
    learned = fit.fit([first, second])
    assert learned.proportions == retarget.generic_proportions([second.measures])


def test_an_idle_glob_and_all_that_fails_are_named(walks, tmp_path, capsys):
    assert run("learn", walks, "-o", tmp_path / "m.gait", "--exclude", "03") == 0
    assert "--exclude 03: no file" in capsys.readouterr().err
    (tmp_path / "bad").mkdir()
    for name in ("a.bvh", "b.bvh"):
        (tmp_path / "bad" / name).write_text("x\n")
    assert run("learn", tmp_path / "bad", "-o", tmp_path / "n.gait") == 1
    printed = capsys.readouterr().err
    assert "left out: " in printed and "a.bvh:1" in printed and "b.bvh:1" in printed


def test_hidden_files_skeletons_and_empty_names(walks, tmp_path, capsys):
    (tmp_path / ".trash").mkdir()
    (tmp_path / ".trash/a.bvh").write_text("x")
    for source, words in ((tmp_path, "no motion files"), (walks / "01/01.asf", ".amc"), ("", "not the name")):
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
    found, closed = sources.find([str(tmp_path)])
    assert [path.name for path, _ in found] == ["gone.bvh", "01_01.amc", "02_01.amc"]
    assert closed == [f"{tmp_path / 'closed'}: Permission denied; check its permissions"]
    assert run("learn", tmp_path, "-o", tmp_path / "m.gait") == 0
    assert {"closed: Permission denied; check", "gone.bvh: No such file"} <= set(
        re.findall(r"/(closed: .* check|gone.bvh: No such file)", capsys.readouterr().err)
    )
    assert run("learn", tmp_path / "closed", "-o", tmp_path / "n.gait") == 1
    assert "closed: Permission denied; check its permissions" in capsys.readouterr().err


def test_few_people_leave_uncertainty_about_others():
    one, rates = np.zeros(1, int), np.array([0.9, 0.9, 1.0])
    assert people.by_subject(np.array([0.9]), one, 0.07) == pytest.approx((0.9, 0.063))
    two = people.by_subject(rates[1:], np.arange(2), 0.07)
    assert two[1] > rates[1:].std(ddof=1) * 0.99
    assert people.by_subject(rates, np.arange(3), 0.5)[1] == pytest.approx(rates.std(ddof=1))
    assert people.by_subject(np.full(4, 0.9), np.arange(4), 0.07)[1] == pytest.approx(0.009)


def test_the_pelvis_of_the_shipped_model_follows_from_its_legs():
    mean = np.asarray(blob.read(SHIPPED)["CURV"][0], float)
    plain = mean.copy()
    plain[:, CHANNELS.index("root_forward") :] = 0
    height, stride = fit._from_legs(plain, Proportions())
    assert height == pytest.approx(mean[:, fit.HEIGHT_COLUMN], abs=0.02)
    assert stride == pytest.approx(mean[:, fit.FORWARD_COLUMN].mean(), rel=0.2)
    still = np.zeros_like(mean)
    assert fit._from_legs(still, Proportions())[1] == fit.USUAL_STRIDE


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
def test_a_file_that_may_not_be_read_is_reported(tmp_path, capsys, monkeypatch, name):
    path = tmp_path / name
    path.write_text("x")
    path.with_suffix(".asf").write_text("x")  # of the .amc

    def denied(*_args, **_options):
        raise PermissionError(13, "Permission denied", str(path))

    for method in ("read_text", "read_bytes"):
        monkeypatch.setattr(Path, method, denied)
    assert run("learn", path, "-o", tmp_path / "m.gait", "--quiet") == 1
    assert "Permission denied; check its permissions" in capsys.readouterr().err


MAP = {"set": "plug-in-gait", "markers": {"Wand_L": "l_knee_lateral", "LKN": None, "l kne": "l_knee_lateral"}}


def parts(**runs):
    """Columns of noise by name with zeros in the rows given, and one that is always 0."""
    rng = np.random.default_rng(1)
    found = {"fixed": np.zeros((40, 3))}
    for name, rows in runs.items():
        found[name] = rng.normal(size=(40, 2))
        found[name][rows] = 0
    return found


def test_zeros_long_enough_and_together_are_reported():
    some = slice(10, 15)
    assert recording.zero_run(parts(a=some, b=some, c=some), 3) == "a in frames 11 to 15"
    assert recording.zero_run(parts(x=[], b=slice(3, 15), c=slice(8, 40)), 2) == "b in frames 9 to 15"
    assert recording.zero_run(parts(b=slice(30, 40)), 1) == "b in frames 31 to 40"
    assert recording.zero_run(parts(a=some, b=some), 3) == ""
    assert recording.zero_run(parts(a=some, b=some, c=slice(15, 20)), 3) == ""
    assert recording.zero_run(parts(a=slice(10, 14), b=[1, 2, 3, 5, 6, 7]), 1) == ""
    half = {"a": np.zeros((40, 1))}
    half["a"][20:] = np.nan
    assert recording.zero_run(half, 1) == recording.zero_run({}, 1) == ""


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
    assert readers.read(amc).notes.zeros == "lowerneck in frames 40 to 49"
    assert readers.read(amc, LearnOptions(zeros_missing=True)).notes == recording.NO_NOTES
    assert readers.read(bvh).notes.zeros.endswith("in frames 40 to 49")
    assert readers.read(bvh, LearnOptions(zeros_missing=True)).notes == recording.NO_NOTES
    whole = body.from_bones(acclaim.read(files.write_toy(tmp_path / "whole", frames=400)))
    assert whole.notes == recording.NO_NOTES
    names = [f"{name}_deg" for name in ("l_hip_flexion", "r_hip_flexion", "l_knee_flexion", "r_knee_flexion")]
    table = 10 + 30 * np.sin(np.arange(400)[:, None] / 20 + np.arange(4))
    table[100:120, 1:] = 0
    rows = [
        ",".join(["time", *names]),
        *(f"{t / 120:.5f}," + ",".join(map(str, r)) for t, r in enumerate(table)),
    ]
    (tmp_path / "a.csv").write_text("\n".join(rows) + "\n")
    assert readers.read(tmp_path / "a.csv").notes.zeros == "r_hip_flexion in frames 101 to 120"
    assert readers.read(tmp_path / "a.csv", LearnOptions(zeros_missing=True)).notes == recording.NO_NOTES


def printed(capsys, *words):
    assert gait.cli.main(["learn", *map(str, words), "--segments", "none"]) == 0
    return capsys.readouterr().err


def test_zeros_are_hinted_at_once(amc, tmp_path, capsys):
    (amc.parent / "77_02.amc").write_bytes(amc.read_bytes())
    words = (amc.parent, "-o", tmp_path / "m.gait", "--components", 1)
    line = "77_01.amc: exactly 0: lowerneck in frames 40 to 49 (and similar in 1 more file); if that"
    err = printed(capsys, *words)
    assert line in err and err.count("--zeros-missing") == 1
    assert "exactly 0" not in printed(capsys, *words, "--zeros-missing")
    assert not printed(capsys, *words, "--quiet")


def test_belts_and_walks_in_place_are_reported(tmp_path, capsys):
    files.write_toy(tmp_path / "walks", "77_01", frames=400, speed=0.0)
    files.write_toy(tmp_path / "walks", "77_02", frames=400, speed=0.0, swing=0.5, period=190.0)
    files.write_toy(tmp_path / "walks", "77_03", frames=400)
    words = (tmp_path / "walks", "-o", tmp_path / "m.gait", "--components", 1)
    err = printed(capsys, *words)
    assert re.search(r"/77_01.amc: on a treadmill: shifted at the belt's 0.9\d m/s, by the feet\n", err)
    in_place = "stays in place, and the feet do not slide at one speed: learnt without the speed of a belt"
    assert f"/77_02.amc: {in_place}\n" in err
    assert err.count("treadmill") == err.count("stays in place") == 1
    assert not printed(capsys, *words, "--quiet")


@pytest.mark.long
def test_labels_of_no_marker_and_a_mapping_without_markers_are_reported(amc, tmp_path, capsys):
    for k in (1, 2):
        points, _ = mw.person(mw.FULL, frames=400, seed=k)
        write_c3d(tmp_path / f"{k}_1.c3d", mw.FULL, points)
    mapping = tmp_path / "map.json"
    mapping.write_text(json.dumps(MAP))
    words = ("-o", tmp_path / "m.gait", "--components", 1, "--activity", "march", "--markers", mapping)
    marked = [tmp_path / "1_1.c3d", tmp_path / "2_1.c3d"]
    err = printed(capsys, *marked, *words)
    assert err.count("--markers") == 1
    assert f"--markers {mapping}: no file has the marker 'Wand_L', 'LKN'; check the spelling\n" in err
    assert "Wand_L" not in printed(capsys, *marked, *words, "--quiet")
    err = printed(capsys, amc, *words)
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
    assert sources.find(map(str, [*spelt, ".", tmp_path]))[0] == [(spelt[2], False)]


def test_a_folder_for_each_person_is_learnt_as_such(tmp_path, capsys):
    for k, person in enumerate(("Anna", "Ben", "Cy")):
        files.write_toy(tmp_path / person, "walk_01", period=110.0 + 6 * k, seed=k)
        shutil.copy(tmp_path / person / "walk_01.amc", tmp_path / person / "walk_02.amc")

    def learnt(*words):
        cheap = ("--segments", "none", "--components", "1")
        assert gait.cli.main(["learn", str(tmp_path), "-o", str(tmp_path / "m.gait"), *cheap, *words]) == 0
        return capsys.readouterr().out

    auto, prefix = (json.loads(learnt("--json", *words)) for words in ((), ("--subjects", "prefix")))
    assert auto["subjects"] == ["Anna", "Ben", "Cy"] and prefix["subjects"] == ["walk"]
    assert len({s["name"] for s in auto["sequences"]}) == 6
    assert "6 sequences of 3 subjects (Anna Ben Cy), " in learnt("--quiet")


SIZE_PEOPLE = 14  # more than META has rows
LIMIT = 100_000  # bytes of a cyclic model of five components


@pytest.fixture(scope="module")
def learned(tmp_path_factory):
    """Five components of people with names as long as a file system takes, who walk at two rates each."""
    folder = tmp_path_factory.mktemp("named")
    for i in range(SIZE_PEOPLE):
        for trial, period in (("01", 112.0 + i), ("02", 126.0 - i)):
            name = f"{'Ä' * 120}{i:02}_{trial}"
            files.write_toy(folder / "walks", name, period=period, swing=0.9 + 0.02 * i, seed=i, frames=300)
    words = ["learn", folder / "walks", "-o", folder / "m.gait", "--components", 5, "--segments", "none"]
    assert gait.cli.main([*map(str, words), "--activity", "walk" * 100, "--quiet"]) == 0
    return folder / "m.gait"


@pytest.mark.long
def test_five_components_take_less_than_100_kB(learned):
    sections = blob.read(learned)
    assert (
        sections["PACE"].shape == (people.TERMS, 30)
        and len(sections["PROP"]) == lengths.MOST_LENGTH_COMPONENTS
    )
    meta = json.loads(sections["META"].tobytes())
    assert meta["subject_count"] == SIZE_PEOPLE and meta["sequences"]["count"] == 2 * SIZE_PEOPLE
    assert len(meta["subjects"]) == len(meta["sequences"]["rows"]) == model.MOST_ROWS
    assert model.CMU in meta["acknowledgement"]
    assert learned.stat().st_size < LIMIT - 1000


@pytest.mark.parametrize(
    "name", ["02_01", "x" * 32, "Ä" * 40, "\t\n" * 40, "\udcff" * 9, '"' * 99, "𝔸" * 20, ""]
)
def test_names_in_a_model_are_bounded(name):
    kept = model.shortened(name)
    assert len(json.dumps(kept)) <= model.MOST_NAME
    assert kept == name if len(json.dumps(name)) <= model.MOST_NAME else name.startswith(kept[:-3])


def test_zeros_have_no_sign():
    stored = model.rounded(np.array([-1e-9, 1e-9, -0.0, -0.25]))
    assert stored.tobytes() == np.array([0, 0, 0, -0.25], np.float32).tobytes()


@pytest.mark.long
def test_machines_that_calculate_otherwise_write_the_same_bytes(tmp_path):
    played = machines.environments()
    if len(played) < 2:
        pytest.skip("this CPU, or another algebra than OpenBLAS's, leaves numpy no choice of kernels")
    for i in range(4):
        motion = {"period": 110.0 + 5 * i, "offset": 13.0 * i, "swing": 0.85 + 0.05 * i, "seed": i}
        files.write_toy(tmp_path / "walks", f"{i // 2:02}_{i % 2:02}", speed=1.1 + 0.05 * i, **motion)
    least, *_, most = played
    found = {
        name: machines.learn(played[name], tmp_path / "m.gait", tmp_path / "walks") for name in (least, most)
    }
    assert len(set(found.values())) == 1, found


def test_gaps_that_are_still_changing_are_an_error_with_a_remedy(walks, tmp_path, capsys, monkeypatch):
    """Nothing is written, and the people whose parts are missing are named; the search converges."""
    monkeypatch.setattr(imputation.climb, "__defaults__", (imputation.MODEL_TOLERANCE, 2))
    options = ("-o", tmp_path / "m.gait", "--segments", "none")
    legs = tmp_path / "03_01.csv"
    angles = readers.read(walks / "01/01_01.amc")
    table = np.degrees(retarget.angles(angles, retarget.measure(angles)))
    wanted = [f"{s}_{joint}_flexion" for s in "lr" for joint in ("hip", "knee")]
    rows = [",".join(f"{v:.4f}" for v in row) for row in table[:, [ANGLES.index(n) for n in wanted]]]
    header = ",".join(["time", *(f"{name}_deg" for name in wanted)])
    times = [f"{t / 120:.5f},{row}" for t, row in enumerate(rows)]
    legs.write_text("\n".join([header, *times]) + "\n")
    assert run("learn", walks, legs, *options) == 1
    error = capsys.readouterr().err.splitlines()[-1]
    assert re.search(r"filling of gaps did not converge in 2 passes: 1 of 3 people \(03\) never show", error)
    assert "leave some of them out with --exclude" in error and not (tmp_path / "m.gait").exists()
