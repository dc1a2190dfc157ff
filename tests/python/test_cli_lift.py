"""`gait lift` of keypoints, end to end."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from toy_segments import toy_blob, toy_prior

from gait.body.skeleton import JOINTS
from gait.camera.camera import Camera
from gait.cli import lift, main
from gait.io.keypoints_file import Keypoints, read, write
from gait.io.trc import read_trc
from gait.lift.keypoints import noise
from gait.lift.segment.explain import Uncertain
from gait.lift.smooth import motion, size
from gait.lift.smooth.options import METHODS
from gait.lift.summary import least_certain

FRAMES, MARKERS = 6, 12
VIEWS = {"camera": ["--camera", "cam.json"], "flat": ["--orthographic", "y"], "none": []}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A model, a camera, keypoints of the mean motion with noise, and the truth."""
    monkeypatch.chdir(tmp_path)
    prior = toy_prior(FRAMES, MARKERS, 4, seed=5)
    (tmp_path / "m.gait").write_bytes(toy_blob(prior))
    camera = Camera.looking((0, -6, 1.0), (0, 0, 1.0), (640, 480), 600)
    (tmp_path / "cam.json").write_text(json.dumps(camera.to_dict()))
    rng = np.random.default_rng(0)
    drift = np.arange(15)[:, None, None] * (prior.mean[0, 1] - prior.mean[0, 0])
    places = 1.7 * (prior.mean[0, 0] + drift)
    uv = camera.project(places) + rng.normal(size=(len(places), MARKERS, 2))
    uv[rng.random(uv.shape[:2]) < 0.1] = np.nan
    time = np.arange(len(places)) / 20
    write("t.csv", Keypoints(np.arange(len(places)), time, prior.names, uv, np.ones(uv.shape[:2])))
    np.save("truth.npy", places)
    return tmp_path


def lifted(path, names):
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    return np.array([[[float(row[f"{n}_{a}"]) for a in "xyz"] for n in names] for row in rows])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("view", VIEWS)
def test_lifts(folder, capsys, view, method):
    command = ["lift", "t.csv", "-m", "m.gait", "-o", "out.csv", "--height", "1.7", "--pixel-sd", "1"]
    assert main([*command, "--method", method, "--json", *VIEWS[view]]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["frames"] == 15 and printed["settled"]
    assert printed["reprojection_px"] < 4  # 1 of noise; without a camera the picture has perspective
    assert printed["log10_volume_ratio"] < 0
    names = printed["markers"]["estimated"]
    assert len(names) == MARKERS
    found, truth = lifted("out.csv", names), np.load("truth.npy")
    shape, true = (p - p.mean(axis=1, keepdims=True) for p in (found, truth))
    across = np.linalg.norm((shape - true)[..., [0, 2]], axis=2)
    assert np.median(across) < 0.03  # what the picture shows


@pytest.mark.parametrize("view", ["camera", "flat"])
def test_states_what_segments_leave_uncertain(folder, capsys, view):
    command = ["lift", "t.csv", "-m", "m.gait", "-o", "out.csv", "--pixel-sd", "1", *VIEWS[view]]
    assert main([*command, "--json"]) == 0
    segments = json.loads(capsys.readouterr().out)["segments"]
    assert segments["log10_volume_ratio"] < 0
    first, *others = segments["least_certain"]
    assert first["in_depth"] > 0.9 and first["rigid"] > 0.9  # how far away the person is
    assert [first["sd_mm"] > other["sd_mm"] > 0 for other in others] == [True, True]
    assert main(command) == 0
    printed = capsys.readouterr().out.splitlines()[-1]
    assert f"the whole body {first['sd_mm']:.0f} mm ({100 * first['in_depth']:.0f} % in depth), " in printed
    last = others[-1]["joints"]  # those it moves most, which are not the body as one
    assert len(set(last)) == 3 and set(last) <= set(JOINTS)
    assert others[-1]["rigid"] > 0.5 or f", {' '.join(last)} {others[-1]['sd_mm']:.0f} mm (" in printed
    assert ("which the view does not determine" in printed) == (view == "flat")


def test_the_joints_that_a_displacement_moves_most_are_named():
    shares = np.array([[0.1, 0.2, 0.3, 0.4], [0.7, 0.1, 0.2, 0.0], [0.25, 0.25, 0.25, 0.25]])
    left = Uncertain(0.0, *np.zeros((3, 3)), shares)
    found = least_certain(left, ("head", "hip", "knee", "toe"))["least_certain"]
    assert [each["joints"] for each in found][:2] == [["toe", "knee", "hip"], ["head", "knee", "hip"]]


@pytest.mark.parametrize("method", METHODS)
def test_a_stature_is_reported_where_it_was_estimated(folder, capsys, method):
    """With segments alone the stature stays the assumed one: it is not estimated."""
    command = ["lift", "t.csv", "-m", "m.gait", "-o", "out.csv", "--camera", "cam.json", "--method", method]
    assert main([*command, "--json"]) == 0
    stature = json.loads(capsys.readouterr().out)["stature_m"]
    assert stature > 1 if method == "smooth" else stature is None
    assert main(command) == 0
    assert (", stature" in capsys.readouterr().out) == (method == "smooth")


def test_the_likelihood_alone_is_less_sure_and_has_the_same_columns(folder, capsys):
    printed, heads = {}, {}
    for method in ("blend", "likelihood"):
        command = ["lift", "t.csv", "-m", "m.gait", "-o", f"{method}.csv", "--camera", "cam.json", "--json"]
        assert main([*command, "--method", method]) == 0
        printed[method] = json.loads(capsys.readouterr().out)
        heads[method] = (folder / f"{method}.csv").read_text().splitlines()[0]
    assert printed["likelihood"]["sd_mm"] > printed["blend"]["sd_mm"]
    assert heads["likelihood"] == heads["blend"]


def test_the_likelihood_alone_needs_more_points_than_the_prior(folder, capsys):
    prior = toy_prior(FRAMES, MARKERS, 60, seed=5)
    (folder / "m.gait").write_bytes(toy_blob(prior))
    keypoints, _ = read("t.csv", prior.names)
    few = replace(
        keypoints,
        names=keypoints.names[:4],
        uv=keypoints.uv[:, :4],
        confidence=keypoints.confidence[:, :4],
    )
    write("few.csv", few)
    command = ["lift", "few.csv", "-m", "m.gait", "-o", "out.csv", "--camera", "cam.json", "--quiet"]
    assert main([*command, "--method", "likelihood"]) == 1
    printed = capsys.readouterr().err
    assert "few.csv: the points seen" in printed and "of 60 modes" in printed and printed.count("\n") == 1
    assert not (folder / "out.csv").exists()
    assert main([*command, "--method", "blend"]) == 0


@pytest.mark.parametrize(("axis", "vector"), [("-y", "0,-1,0"), ("-x", "-1,0,0"), ("-z", "-0.0,0,-2.5")])
def test_views_the_other_way(folder, axis, vector):
    command = ["lift", "t.csv", "-m", "m.gait", "--quiet", "--pixel-sd", "1", "--method", "segment"]
    assert main([*command, "-o", "a.csv", "--orthographic", axis]) == 0
    assert main([*command, "--orthographic", vector, "-o", "b.csv"]) == 0
    assert main([*command, "-o", "c.csv", f"--orthographic={axis.replace('-', '')}"]) == 0
    assert (folder / "a.csv").read_bytes() == (folder / "b.csv").read_bytes()
    assert (folder / "a.csv").read_bytes() != (folder / "c.csv").read_bytes()


@pytest.mark.parametrize(("share", "milli"), [(1 / 640, 1), (1, 1000)])
def test_other_units_are_reported(folder, capsys, share, milli):
    keypoints, _ = read("t.csv", toy_prior(FRAMES, MARKERS, 4).names)
    write("u.csv", replace(keypoints, uv=keypoints.uv * share, time=keypoints.time * milli))
    assert main(["lift", "u.csv", "-m", "m.gait", "-o", "out.csv", "--camera", "cam.json"]) == 1
    words = capsys.readouterr().err
    assert "u.csv: " in words and ("give pixels" if share < 1 else "give seconds") in words
    assert not (folder / "out.csv").exists()


def test_a_view_without_its_axis(folder, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["lift", "t.csv", "--orthographic", "-o", "a.csv"])
    assert "--orthographic: expected one argument" in capsys.readouterr().err


def test_trc_and_sd(folder, capsys):
    command = ["lift", "t.csv", "-m", "m.gait", "-o", "out.csv", "--camera", "cam.json", "--trc", "o.trc"]
    assert main([*command, "--quiet"]) == 0
    labels, points, rate = read_trc(folder / "o.trc")
    assert rate == pytest.approx(20)
    np.testing.assert_allclose(points[:, :, [2, 0, 1]], lifted("out.csv", labels), atol=2e-5)
    with open("out.csv", newline="") as file:
        row = next(csv.DictReader(file))
    assert all(float(row[f"{labels[0]}_{axis}"]) > 0 for axis in ("sx", "sy", "sz"))


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--orthographic", "w"], 2, "give x, y, z"),
        (["--orthographic", "0,0,0"], 2, "give x, y, z"),
        (["--orthographic", "y", "--camera", "cam.json"], 2, "exclude each other"),
        (["--metres-per-unit", "1"], 2, "goes with --orthographic"),
        (["--method", "blend", "--no-bones"], 2, "go with --method smooth"),
        (["-o", "nowhere/out.csv"], 1, "does not exist"),
        (["--camera", "no.json"], 1, "no.json"),
        (["--floor-sd", "0.1"], 2, "goes with --camera and --method smooth"),
        (["--camera", "cam.json", "--floor-sd", "0.1", "--method", "blend"], 2, "--method smooth"),
        (["--start", "0"], 2, "--start is for a video, and t.csv contains keypoints"),
        (["--overlay", "o.mp4"], 2, "--overlay: give the --video in which the keypoints were found"),
        (["--placement", "cam.json"], 2, "--placement is for a video, and t.csv contains keypoints"),
        (["-o", "t.csv"], 1, "t.csv: is read by this command; give the output another name"),
        (["-o", ""], 1, "name is empty"),
    ],
)
def test_faults(folder, capsys, options, code, words):
    before = {path: path.read_bytes() for path in folder.iterdir()}
    assert main(["lift", "t.csv", "-m", "m.gait", "-o", "out.csv", *options]) == code
    printed = capsys.readouterr().err
    assert words in printed and printed.count("\n") == 1
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize(
    ("option", "words"),
    [
        (["--floor-sd", "1e300"], "give metres from 0.0001 to 100"),
        (["--pixel-sd", "0"], "give a standard deviation from 1e-06 to 1e+06"),
        (["--metres-per-unit", "nan"], "give metres from 1e-06 to 1000"),
    ],
)
def test_options_out_of_range(folder, capsys, option, words):
    with pytest.raises(SystemExit, match="2"):
        main(["lift", "t.csv", "-o", "out.csv", *option])
    assert f"argument {option[0]}: {option[1]}: {words}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: replace(t, time=t.time + 1e6 * (t.frame > 8)), "line 11: 1e+06 s after the frame before"),
        (lambda t: replace(t, time=t.time * 1e-9), "u.csv: time increases by 5e-11 per frame"),
        (lambda t: replace(t, uv=t.uv * 1e9), "give a number of at most 1e+06"),
        (lambda t: Keypoints(t.frame[:1], t.time[:1], t.names, t.uv[:1], t.confidence[:1]), "has one frame"),
    ],
)
def test_tracks_that_cannot_be(folder, capsys, change, words):
    keypoints, _ = read("t.csv", toy_prior(FRAMES, MARKERS, 4).names)
    changed = change(keypoints)
    head = ["frame", "time", *(f"{name}_{axis}" for name in keypoints.names for axis in "uv")]
    with open("u.csv", "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(head)
        for row in zip(changed.frame, changed.time, changed.uv.reshape(len(changed.frame), -1), strict=True):
            table.writerow([row[0], row[1], *("" if np.isnan(u) else u for u in row[2])])
    assert main(["lift", "u.csv", "-m", "m.gait", "-o", "out.csv", "--camera", "cam.json"]) == 1
    assert words in capsys.readouterr().err
    assert not (folder / "out.csv").exists()


def test_options_of_keypoints_and_of_pictures(folder, capsys):
    (folder / "clip.mp4").touch()
    assert main(["lift", "clip.mp4", "-m", "m.gait", "-o", "out.csv"]) == 2
    assert "--height M to estimate the camera" in capsys.readouterr().err
    assert main(["lift", "clip.mp4", "-o", "out.csv", "--placement", "p.json", "--method", "smooth"]) == 2
    assert "--method is for keypoints" in capsys.readouterr().err
    assert main(["lift", "absent", "-o", "out.csv", "--method", "smooth"]) == 1
    assert "absent: no such file" in capsys.readouterr().err
    assert main(["lift", "absent.mp4", "-o", "out.csv", "--method", "smooth"]) == 1
    assert "absent.mp4: no such file" in capsys.readouterr().err


def damaged(change):
    """Rewrite t.csv with its pixels changed."""
    keypoints, _ = read("t.csv", toy_prior(FRAMES, MARKERS, 4, seed=5).names)
    uv = keypoints.uv.copy()
    change(uv)
    write("t.csv", replace(keypoints, uv=uv))


def test_a_gap_is_bridged_with_larger_sd(folder):
    def hide(uv):
        uv[3:12] = np.nan

    damaged(hide)
    command = ["lift", "t.csv", "-m", "m.gait", "-o", "out.csv", "--camera", "cam.json", "--quiet"]
    assert main(command) == 0
    with open("out.csv", newline="") as file:
        sd = np.array([float(row["l_hip_sx"]) for row in csv.DictReader(file)])
    assert sd[7] > sd[1]


@pytest.mark.parametrize("method", ["smooth", "blend"])
def test_too_few_points_are_reported(folder, capsys, method):
    def hide(uv):
        uv[:] = np.nan
        uv[0, 0] = 100

    damaged(hide)
    command = ["lift", "t.csv", "-m", "m.gait", "-o", "out.csv", "--camera", "cam.json", "--method", method]
    assert main(command) == 1
    assert "t.csv: fewer than 4 points" in capsys.readouterr().err


def test_blending_needs_every_segment(folder, capsys):
    def hide(uv):
        uv[6:] = np.nan

    damaged(hide)
    command = ["lift", "t.csv", "-m", "m.gait", "-o", "out.csv", "--camera", "cam.json", "--method", "blend"]
    assert main(command) == 1
    assert "use --method smooth" in capsys.readouterr().err


def test_one_outlier_changes_little(folder, capsys):
    keypoints, _ = read("t.csv", toy_prior(FRAMES, MARKERS, 4, seed=5).names)
    row = int(np.flatnonzero(keypoints.visible[1:-1, 3])[4]) + 1
    uv = keypoints.uv.copy()
    uv[row, 3] += 20
    write("outliers.csv", replace(keypoints, uv=uv))
    command = ["-m", "m.gait", "--camera", "cam.json", "--pixel-sd", "1", "--json"]
    assert main(["lift", "outliers.csv", *command, "-o", "out2.csv"]) == 0
    printed = capsys.readouterr()
    summary = json.loads(printed.out)
    assert summary["spikes"] == 1
    assert summary["left_out"] == [{"frame": int(keypoints.frame[row]), "point": keypoints.names[3]}]
    assert f"{keypoints.names[3]} in frame {keypoints.frame[row]} (--keep-spikes)" in printed.err
    assert main(["lift", "t.csv", *command, "-o", "out.csv"]) == 0
    far = np.linalg.norm(lifted("out2.csv", keypoints.names) - lifted("out.csv", keypoints.names), axis=2)
    assert far.max() < 0.1
    assert main(["lift", "outliers.csv", *command, "-o", "kept.csv", "--keep-spikes"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["spikes"] == 0


def test_an_impossible_camera_is_reported(folder, capsys):
    camera = json.loads((folder / "cam.json").read_text())
    command = ["lift", "t.csv", "-m", "m.gait", "--camera", "long.json", "-o", "long.csv"]
    (folder / "long.json").write_text(json.dumps(camera | {"fx": 6e7, "fy": 6e7}))
    assert main(command) == 1
    assert "long.json: focal length of 6e+07 pixels is over 1000 times" in capsys.readouterr().err
    # a lens that could be, not one that took these keypoints
    (folder / "long.json").write_text(json.dumps(camera | {"fx": 6e5, "fy": 6e5}))
    code = main(command)
    printed = capsys.readouterr().err
    assert code == 1 or "do not rely on" in printed


def test_few_joints_are_reported(folder, capsys, monkeypatch):
    command = ["lift", "t.csv", "-m", "m.gait", "-o", "out.csv"]
    for shows, view in ((True, "camera"), (False, "camera"), (False, "none")):
        monkeypatch.setattr(size, "shows_distance", lambda keypoints, shows=shows: shows)
        assert main([*command, *VIEWS[view]]) == 0
        reported = "which determine the distance, are hardly visible" in capsys.readouterr().err
        assert reported == (view == "camera" and not shows)


def test_uncertain_results_are_reported(folder, capsys, monkeypatch):
    lift = motion.lift

    def doubting(prior, keypoints, *args):
        outliers = np.zeros(keypoints.uv.shape[:2], bool)
        outliers[2:6, 3] = outliers[4, 1] = True
        return replace(lift(prior, keypoints, *args), outliers=outliers, alone=True, steps=0, wider=2.0)

    monkeypatch.setattr(motion, "lift", doubting)
    monkeypatch.setattr(noise, "shake", lambda keypoints: 5.0)
    command = ["lift", "t.csv", "-m", "m.gait", "--camera", "cam.json", "-o", "out.csv"]
    assert main([*command, "--json"]) == 0
    printed = capsys.readouterr()
    names = read("t.csv", toy_prior(FRAMES, MARKERS, 4, seed=5).names)[0].names
    assert f"far from their predictions: {names[3]} in 4 frames\n" in printed.err
    assert (
        "the points jitter by 5 from frame to frame: this is used as their noise instead of 3 (--pixel-sd)\n"
        in printed.err
    )
    assert "segments are estimated alone" in printed.err and "widened 2 times" in printed.err
    figures = json.loads(printed.out)
    assert figures["outliers"] == 5 and figures["segments_alone"] and figures["pixel_sd"] == 5
    assert main([*command, "--pixel-sd", "3"]) == 0
    printed = capsys.readouterr()
    assert "the points jitter by 5 from frame to frame, not 3: try --pixel-sd 5\n" in printed.err
    assert "iterations" not in printed.out


@pytest.mark.parametrize(("recordings", "reported"), [(0, False), (1, True), (3, True), (4, False)])
def test_a_prior_of_few_recordings_is_reported(folder, capsys, recordings, reported):
    prior = replace(toy_prior(FRAMES, MARKERS, 4, seed=5), recordings=recordings)
    (folder / "few.gait").write_bytes(toy_blob(prior))
    assert main(["lift", "t.csv", "-m", "few.gait", "--camera", "cam.json", "-o", "out.csv"]) == 0
    assert ("standard deviations may be too small" in capsys.readouterr().err) == reported


@pytest.mark.parametrize("mark", [";", "\t"])
def test_tracks_may_be_separated_by_semicolons_or_tabs(folder, mark):
    text = (folder / "t.csv").read_text()
    if mark == ";":
        text = text.replace(",", ";").replace(".", ",")
    (folder / "other.csv").write_text("\ufeff" + text.replace(",", mark) if mark == "\t" else text)
    names = toy_prior(FRAMES, MARKERS, 4, seed=5).names
    one, other = read("t.csv", names)[0], read("other.csv", names)[0]
    assert other.names == one.names
    assert np.array_equal(other.time, one.time) and np.array_equal(other.uv, one.uv, equal_nan=True)


@pytest.mark.parametrize("stature", [24.0, -7.0, np.nan])
def test_an_impossible_stature_is_refused(folder, capsys, monkeypatch, stature):
    """As with a camera in millimetres."""
    lift = motion.lift
    monkeypatch.setattr(motion, "lift", lambda *args: replace(lift(*args), stature=stature))
    assert main(["lift", "t.csv", "-m", "m.gait", "--camera", "cam.json", "-o", "out.csv"]) == 1
    assert f"t.csv: the estimated stature is {stature:.3g} m; check the camera" in capsys.readouterr().err
    assert not (folder / "out.csv").exists()


def test_keypoints_with_a_height_and_no_camera_get_a_hint(folder, capsys):
    command = ["lift", "t.csv", "-m", "m.gait", "-o", "out.csv", "--height", "1.7"]
    assert main(command) == 0
    assert "gait camera --walk t.csv --size WxH --height 1.7 -o camera.json" in capsys.readouterr().err
    assert main([*command[:-2]]) == 0
    assert "gait camera --walk" not in capsys.readouterr().err


def test_the_summary_is_in_plain_words():
    mode = {"sd_mm": 81.2, "in_depth": 0.04, "rigid": 0.1, "joints": ["l_toe", "l_heel", "l_ankle"]}
    figures = {
        **{"frames": 30, "visible_share": 1.0, "reprojection_px": 0.5, "sd_mm": 74.0, "stature_m": 1.8},
        **{"markers": {"visible": ["l_hip"], "estimated": ["l_hip", "l_knee"]}, "iterations": 6},
        **{"settled": True, "log10_volume_ratio": -439.0},
        "segments": {"log10_volume_ratio": -12.0, "least_certain": [mode]},
    }
    printed = lift._text(figures)
    assert "1 point a frame" in printed and "1e-" not in printed and "converged after 6" in printed
    assert "least certain in a single segment: l_toe l_heel l_ankle 81 mm (4 % in depth)" in printed
