"""gait learn and gait info from end to end on toy walks, and the shipped model (L14)."""

import json
import shutil
from pathlib import Path

import learn_cases as cases
import mocap_files as files
import numpy as np
import pytest

import gait.cli
from gait.bindings.segment_prior import TAGS
from gait.body import skeleton
from gait.body.model_curves import curves
from gait.body.skeleton import ANGLES, CHANNELS, JOINTS
from gait.cli import info
from gait.io import blob
from gait.learn.corpus import sources
from gait.learn.prior import fit, model

SHIPPED = Path(gait.__file__).parent / "data/walk.gait"
WALKS = Path(__file__).parents[2] / "../shared/data/mocap/cmu_walk"


@pytest.fixture(scope="module")
def walks(tmp_path_factory):
    """Seven toy walks of three subjects, one as BVH, and a broken file."""
    folder = tmp_path_factory.mktemp("walks")
    for i, (subject, trial) in enumerate([(1, 1), (1, 2), (1, 3), (2, 1), (2, 2), (3, 1)]):
        motion = {
            "period": 110.0 + 6 * i,
            "offset": 13.0 * i,
            "swing": 0.85 + 0.05 * i,
            "seed": i,
            "frames": 420,
        }
        files.write_toy(folder / f"{subject:02}", f"{subject:02}_{trial:02}", speed=1.1 + 0.05 * i, **motion)
    amc = files.write_toy(folder / "09", "09_01", period=125.0, seed=9, frames=400)
    (folder / "04").mkdir()
    (folder / "04/04_01.bvh").write_text(files.bvh_from_amc(amc))
    shutil.rmtree(folder / "09")
    (folder / "02/02_99.amc").write_text(":DEGREES\n1\nroot 1 2\n")
    return folder


def run(*words):
    return gait.cli.main([str(w) for w in words])


@pytest.fixture(scope="module")
def learned(walks, tmp_path_factory):
    path = tmp_path_factory.mktemp("learned") / "toy.gait"
    assert run("learn", walks, "-o", path, "--components", 3, "--quiet") == 0
    return path


def test_a_bad_file_in_a_folder_is_named_and_the_rest_is_learnt(walks, tmp_path, capsys):
    assert run("learn", walks, "-o", tmp_path / "m.gait", "--components", 3, "--json") == 0
    out, err = capsys.readouterr()
    summary = json.loads(out)
    assert [s["name"] for s in summary["sequences"]] == [
        "01_01", "01_02", "01_03", "02_01", "02_02", "03_01", "04_01",
    ]  # fmt: skip
    assert err.count("\n") == 1 and "02_99.amc:3" in err and summary["left_out"][0] in err
    periods = [s["period_ms"] * 0.12 for s in summary["sequences"][:6]]
    assert periods == pytest.approx([110, 116, 122, 128, 134, 140], abs=0.4)
    assert summary["stride_hz"][0] == pytest.approx(
        np.mean([120 / 116, 120 / 131, 120 / 140, 120 / 125]), rel=0.01
    )
    assert np.all(np.diff(summary["imputation_objective"]) <= 0)


@pytest.mark.long
def test_the_same_input_gives_the_same_bytes(walks, learned, tmp_path):
    assert run("learn", walks, "-o", tmp_path / "again.gait", "--components", 3, "--quiet") == 0
    assert (tmp_path / "again.gait").read_bytes() == learned.read_bytes()
    assert list(tmp_path.iterdir()) == [tmp_path / "again.gait"]


def test_sections_are_those_of_the_format(learned):
    s = blob.read(learned)
    assert blob.unpack_names(s["CHNM"]) == CHANNELS and blob.unpack_names(s["PTNM"]) == JOINTS
    assert (
        s["CURV"].shape == (4, fit.CYCLE_SAMPLES, 30)
        and s["CHST"].shape == (30, 4)
        and s["SCST"].shape == (3, 3)
    )
    assert np.isfinite(s["CURV"]).all()
    assert np.all(s["CHST"][:, 0] >= 0) and np.all(s["CHST"][:, 1] <= s["CHST"][:, 2])
    assert s["GAIT"].shape == (8,) and s["GAIT"][5] == 120
    parents = s["FRMI"][:, 0]
    assert parents[0] == -1 and np.all(parents[1:] < np.arange(1, len(parents)))
    assert len(s["LIMI"]) == 13 and np.all(s["LIMF"][:, 6:] > 0)


def test_the_mean_cycle_is_a_walk_and_phase_0_its_right_heel_strike(learned):
    s = blob.read(learned)
    phase = np.arange(fit.CYCLE_SAMPLES) / fit.CYCLE_SAMPLES
    joints, angles = skeleton.pose(s, phase, np.zeros(3), 1.7, 0.0, 0.0, 0.0, np.zeros(3))
    right, left = (joints[:, JOINTS.index(f"{side}_heel"), 0] for side in "rl")
    assert min(np.argmax(right), fit.CYCLE_SAMPLES - np.argmax(right)) <= 1
    assert abs(np.argmax(left) - fit.CYCLE_SAMPLES // 2) <= 6
    knee = np.degrees(angles[:, ANGLES.index("r_knee_flexion")])
    assert 50 < knee.max() < 80 and 0.6 < phase[np.argmax(knee)] < 0.85
    assert s["CURV"][0, :, CHANNELS.index("root_forward")].mean() == pytest.approx(s["GAIT"][3], rel=0.1)


def test_exclude_matches_the_tail_of_the_path(walks):
    def names(*globs):
        return [p.name for p, _ in sources.find([str(walks)], globs)[0]]

    assert "02_01.amc" in names()
    assert (
        names("02/*")
        == names("02_*.amc")
        == ["01_01.amc", "01_02.amc", "01_03.amc", "03_01.amc", "04_01.bvh"]
    )
    assert names("0[1-3]/*", "nothing") == ["04_01.bvh"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["{walks}", "--exclude", "*"], "leaves none of 8 files"),
        (["{walks}/nowhere"], "no such file or folder"),
        (["{walks}", "--markers", "{walks}/no.json"], "no.json: No such file or directory; check the name"),
        (["{walks}/01/01.asf"], "a skeleton without motion; name the .amc files"),
        (["{walks}/notes.txt"], "not supported; convert it to .amc .bvh"),
        (["{walks}/02/02_99.amc"], r"02_99.amc:3: 2 numbers, expected 6"),
        (["{walks}/01/01_01.amc", "--components", "5"], "too few for 5 components; add recordings"),
        (["{walks}", "--components", "5", "-o", "{walks}/no/where.gait"], "does not exist; create it"),
    ],
)
def test_errors_are_one_line_with_exit_code_1(walks, tmp_path, capsys, words, message):
    (walks / "notes.txt").write_text("of no motion\n")
    words = [w.format(walks=walks) for w in words]
    output = [] if "-o" in words else ["-o", tmp_path / "m.gait"]
    assert run("learn", *words, *output) == 1
    err = capsys.readouterr().err.splitlines()
    assert message in err[-1] and err[-1].startswith("gait learn: ")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("option", "value"),
    [
        *(("--components", value) for value in ("0", "17", "many")),
        *(("--fps", value) for value in ("fast", "1", "nan")),
        *(("--seed", value) for value in ("-1", "one")),
        ("--jobs", "0"),
    ],
)
def test_a_wrong_value_is_a_usage_error(capsys, option, value):
    with pytest.raises(SystemExit) as stop:
        run("learn", "x", "-o", "y", option, value)
    assert stop.value.code == 2 and value in capsys.readouterr().err


def test_jobs_and_a_cluster_do_not_go_together(walks, tmp_path, capsys):
    words = ("--jobs", 2, "--dask", "tcp://127.0.0.1:9")
    assert run("learn", walks, "-o", tmp_path / "m.gait", *words) == 2
    assert "give one of them" in capsys.readouterr().err


def test_json_shows_for_each_sequence_where_it_is_from_and_why_it_was_taken(walks, tmp_path, capsys):
    assert run("learn", walks, "-o", tmp_path / "m.gait", "--components", 3, "--json", "--quiet") == 0
    for s in json.loads(capsys.readouterr().out)["sequences"]:
        assert (
            Path(s["source"]).is_file() and s["subject"] == s["name"][:2] and s["fps"] == pytest.approx(120)
        )
        assert 0 <= s["kept"][0] < s["kept"][1] <= 420 and len(s["cut"]) == 2
        assert s["evidence"]["repeats"] > 0.75 and s["activity"] in ("walk", "")
        assert s["snr"] > s["sharpness"] > 3


def test_a_stand_before_the_walk_is_cut_off_unless_no_trim_keeps_it(tmp_path, capsys):
    lines = files.toy_amc(frames=420, seed=4).splitlines()
    at = lines.index("1")
    still = lines[at + 1 : lines.index("2")]
    frames = [line for k in range(150) for line in (str(k + 1), *still)]
    walk = [str(int(line) + 150) if line.isdigit() else line for line in lines[at:]]
    path = files.write_toy(tmp_path)
    path.write_text("\n".join([*lines[:at], *frames, *walk]) + "\n")
    words = ("learn", path, "-o", tmp_path / "m.gait", "--components", 1, "--json")
    assert run(*words) == 0
    (sequence,) = json.loads(capsys.readouterr().out)["sequences"]
    assert 100 <= sequence["kept"][0] <= 200 and sequence["kept"][1] == 570
    assert sequence["cut"][0] and not sequence["cut"][1]
    assert run(*words, "--no-trim") == 1
    assert "the cycles do not repeat" in capsys.readouterr().err


def test_people_get_a_few_lines_however_many_files(walks, tmp_path, capsys):
    for k in range(30):
        (tmp_path / f"07_{k:02}.amc").write_text("nothing\n")
    assert run("learn", walks, tmp_path, "-o", tmp_path / "m.gait", "--components", 3) == 0
    out, err = capsys.readouterr()
    assert out.count("\n") == 5 and "7 sequences of 4 subjects" in out and "31 files left out" in out
    assert err.count("\n") == 21 and "left out: 11 more" in err


def test_info_shows_what_was_learnt(learned, capsys):
    assert run("info", learned, "--json") == 0
    reported = json.loads(capsys.readouterr().out)
    assert (
        reported["components"] == 3
        and reported["phases"] == fit.CYCLE_SAMPLES
        and len(reported["joints"]) == 19
    )
    assert reported["bytes"] == learned.stat().st_size
    assert reported["meta"]["subjects"] == ["01", "02", "03", "04"] and reported["meta"]["activity"] == "walk"
    assert run("info", learned) == 0
    text = capsys.readouterr().out
    assert reported["crc32"] in text and model.CMU in text and "01_03" in text


def test_an_activity_that_is_not_known_is_reported(walks, tmp_path, capsys):
    assert run("learn", walks, "-o", tmp_path / "m.gait", "--activity", "wlak", "--components", 1) == 0
    assert (
        "any motion that repeats is learnt as 'wlak', which is no name of walking or running"
        in capsys.readouterr().err
    )


def test_people_without_arms_are_reported(walks, tmp_path, capsys):
    rows = np.degrees(curves(blob.read(SHIPPED), np.arange(400) / 100, np.zeros((400, 1))))
    for k, some in enumerate((ANGLES, [a for a in ANGLES if "shoulder" not in a])):
        lines = [",".join(["time", *(f"{a}_deg" for a in some)])]
        for t, row in enumerate(rows):
            lines.append(",".join([f"{t / 100:.2f}", *(f"{row[ANGLES.index(a)]:.3f}" for a in some)]))
        (tmp_path / f"{'ab'[k]}_1.csv").write_text("\n".join(lines) + "\n")
    assert run("learn", tmp_path, "-o", tmp_path / "m.gait", "--components", 1) == 0
    assert "1 person never shows l_shoulder or r_shoulder: estimated from" in capsys.readouterr().err


def test_columns_of_info_widen_for_long_names():
    rows = [["a_recording_of_a_long_name", 1100, 2.5, 40.0, 3.2], ["b", 990, 12.5, 9.0, None]]
    lines = info.sequence_lines(rows)
    assert len({len(line) for line in lines}) == 1 and lines[1].startswith("a_recording_of_a_long_name  ")


def test_info_reads_shipped_models_by_name_and_refuses_something_else(tmp_path, capsys):
    assert run("info", "classes") == 0 and "class run: " in capsys.readouterr().out
    (tmp_path / "x.gait").write_text("hello")
    assert run("info", tmp_path / "x.gait") == 1
    assert "not a .gait model" in capsys.readouterr().err


@pytest.mark.parametrize("meta", [b"{", b"[1]", b"\xff{}", b"[" * 99_999])
def test_info_of_a_model_with_damaged_words_names_them(tmp_path, capsys, meta):
    path = tmp_path / "x.gait"
    blob.write(path, {"META": np.frombuffer(meta, np.uint8)})
    assert run("info", path) == 1
    err = capsys.readouterr().err
    assert f"{path}: section META: " in err and "learn the model again" in err and err.count("\n") == 1


def test_the_shipped_model_is_small_and_acknowledges_its_source():
    s = {tag: array for tag, array in blob.read(SHIPPED).items() if tag not in TAGS}
    assert len(blob.encode(s)) < 145_000  # nine curves over 120 phases of 30 channels are 130 kB
    assert SHIPPED.stat().st_size < 375_000  # with fifty modes of 37 markers over ten frames
    meta = json.loads(s["META"].tobytes())
    assert meta["acknowledgement"] == model.CMU and meta["sequences"]["count"] == 51
    assert s["CURV"].shape == (9, fit.CYCLE_SAMPLES, 30) and s["PROP"].shape == (4, len(s["FRMI"]) + 1)


def test_the_curves_of_the_shipped_model_have_no_seam():
    curves = blob.read(SHIPPED)["CURV"].astype(float)
    assert max(cases.seam(curve) for curve in curves) <= 2
    ramp = 0.01 * np.ptp(curves[0], axis=0) * np.arange(fit.CYCLE_SAMPLES)[:, None] / fit.CYCLE_SAMPLES
    assert cases.seam(curves[0] + ramp) > 2  # a jump of a hundredth of each channel's range shows


@pytest.mark.long
def test_the_shipped_model_comes_from_the_documented_command(tmp_path):
    if not WALKS.is_dir():
        pytest.skip(f"{WALKS} is absent: the learning data are not part of the repository")
    assert run("learn", WALKS, "-o", tmp_path / "walk.gait", "--quiet") == 0
    again, shipped = blob.read(tmp_path / "walk.gait"), blob.read(SHIPPED)
    assert list(again) == list(shipped)
    for tag in shipped:
        if tag != "META":
            assert again[tag] == pytest.approx(shipped[tag], abs=1e-5), tag
