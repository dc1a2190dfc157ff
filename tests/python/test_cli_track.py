"""The commands that track, evaluate and draw, called as a user does."""

import csv
import json
import re
import resource
from dataclasses import replace

import cv2
import numpy as np
import pytest
from drawn_person import DATA, camera, clip, state_at, wall, write

from gait import Model, Video
from gait.bindings.model import read_blob
from gait.cli import main
from gait.io import blob
from gait.io import keypoints_file as tracks_file
from gait.track import read_scene

MODEL = Model()
SECTIONS = blob.decode(read_blob(None))
SUMMARY = [
    "frames",
    "particles",
    "threads",
    "step_ms",
    "wall_fps",
    "init",
    "tracking",
    "ambiguous",
    "lost",
    "followed",
    "memory_bytes",
    "digest",
    "verdict",
    "statuses",
    "warning",
    "used",
    "files",
    "notes",
]
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data is absent")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Drawn clip of 20 frames with camera, plate, init and truth."""
    folder = tmp_path_factory.mktemp("scene")
    pictures, states = clip(MODEL, SECTIONS, 20)
    write(folder / "walk.mp4", pictures)
    cv2.imwrite(str(folder / "plate.png"), wall())
    (folder / "camera.json").write_text(json.dumps(camera().to_dict()))
    first = state_at(MODEL, SECTIONS, 0.0)
    init = {
        "pelvis": first.pelvis.tolist(),
        "heading_rad": 0.0,
        "phase": 0.2,
        "stride_hz": 0.9,
        "stature_m": 1.75,
    }
    (folder / "init.json").write_text(json.dumps({"frame": 0, **init}))
    with open(folder / "truth.csv", "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["frame", "time", *(f"{j}_{a}" for j in MODEL.joint_names for a in "xyz")])
        for i, state in enumerate(states):
            rows.writerow([i, i / 30, *MODEL.pose(state)[0].ravel()])
    return folder


def track(scene, *options, out="out.csv"):
    words = ["track", scene / "walk.mp4", "-o", scene / out, "--init", scene / "init.json"]
    words += ["--background", scene / "plate.png", "--particles", 300]
    words += [] if "--camera" in options else ["--camera", scene / "camera.json"]
    return main([str(word) for word in (*words, *options)])


def test_track_evaluate_and_every_output(scene, capsys):
    assert track(scene, "--json", "--overlay", scene / "o.mp4", "--trc", scene / "o.trc") == 0
    summary = json.loads(capsys.readouterr().out)
    assert list(summary) == SUMMARY and list(summary["step_ms"]) == ["median", "p99", "max"]
    assert summary["verdict"].startswith("Tracked 20 of 20 frames, no whole stride, ")
    assert summary["files"] == {
        "track": str(scene / "out.csv"),
        "overlay": str(scene / "o.mp4"),
        "joints for OpenSim": str(scene / "o.trc"),
    }
    assert summary["used"]["start"] == f"{scene / 'init.json'}, frame 0" and not summary["notes"]
    assert (summary["frames"], summary["particles"], summary["threads"], summary["lost"]) == (20, 300, 1, 0)
    assert 0 < summary["step_ms"]["median"] <= summary["step_ms"]["p99"] <= summary["step_ms"]["max"]
    assert summary["memory_bytes"] > 1e5 and len(summary["digest"]) == 16
    film = Video(scene / "o.mp4")
    assert (film.size, film.count) == ((320, 240), 20)
    drawn, plain = list(film.frames())[15].image, list(Video(scene / "walk.mp4").frames())[15].image
    assert (np.abs(drawn.astype(int) - plain).max(axis=2) > 40).mean() > 0.05
    trc = (scene / "o.trc").read_text().split("\n")
    assert len(trc) == 6 + 20 + 1 and trc[2].split("\t")[2:4] == ["20", "19"]

    assert main(["eval", str(scene / "out.csv"), "--truth", str(scene / "truth.csv"), "--json"]) == 0
    errors = json.loads(capsys.readouterr().out)
    assert errors["frames"] == 20 and errors["lost"] == 0
    assert errors["abs"]["median"] < 70 and errors["px"]["median"] < 5
    assert main(["eval", str(scene / "out.csv"), "--truth", str(scene / "truth.csv")]) == 0
    table = capsys.readouterr().out
    assert re.search(r"Far off or lost +0\.0% of 20 frames\n", table)
    assert re.search(r"Pose, mm( +\d+){3}\n", table) and "  Pose, mm: The same after aligning" in table
    assert not re.search(r"\b(abs|root\w*|proc|static|free|p90)\b", table)


def test_the_result_does_not_depend_on_threads_and_does_on_the_seed(scene, capsys):
    digests = []
    for options in (("--threads", 1), ("--threads", 3), ("--seed", 2)):
        assert track(scene, "--json", *options) == 0
        digests.append(json.loads(capsys.readouterr().out)["digest"])
    assert digests[0] == digests[1] != digests[2]


def test_start_and_stop_choose_the_rows(scene, capsys):
    (scene / "anytime.json").write_text(json.dumps({"pelvis": [0.0, 0.0], "heading_rad": 0.0}))
    assert track(scene, "--init", scene / "anytime.json", "--start", 4, "--stop", 9, "--quiet") == 0
    with open(scene / "out.csv") as file:
        assert [row["frame"] for row in csv.DictReader(file)] == ["4", "5", "6", "7", "8"]
    assert capsys.readouterr().err == ""


def test_a_film_that_breaks_off_is_a_warning(scene, capsys, monkeypatch):
    class Cut(Video):
        broken = property(lambda self: f"{self.path}: breaks off")

    monkeypatch.setattr("gait.track.read_scene.Video", Cut)
    assert track(scene, "--stop", 3) == 0
    assert capsys.readouterr().err.startswith(f"warning: {scene / 'walk.mp4'}: breaks off\n")


def test_automatic_start_reports_what_it_found(scene, capsys):
    assert track(scene, "--init", "auto", "--height", 1.75) == 0
    out, err = capsys.readouterr()
    assert re.match(r"start found at frame \d+: x ", err) and "digest " in out
    assert re.search(r"(?m)^Tracked \d+ of 20 frames, no whole stride", out)
    counted = re.search(r"^(\d+) frames: (\d+) init, (\d+) tracking, (\d+) ambiguous, (\d+) lost", out, re.M)
    total, *each = map(int, counted.groups())
    assert sum(each) == total <= 20
    assert "start: found at frame" in out and f"written: track {scene / 'out.csv'}" in out
    init = scene / "init.json"
    assert f"note: not used: {init} beside the film; to use it: --init {init}\n" in out
    assert ("warning: no frame has status tracking" in out) == (each[1] == 0)
    assert "step 0.0 ms median" not in out


def test_a_stature_that_the_pictures_contradict_is_reported(scene, capsys):
    for height, reported in ((1.75, False), (2.2, True), (1.35, True)):
        assert track(scene, "--init", "auto", "--height", height, "--stop", 12) == 0
        assert ("tall by the camera" in capsys.readouterr().err) == reported


def test_a_start_outside_of_the_picture_is_refused(scene, capsys):
    init = json.loads((scene / "init.json").read_text())
    (scene / "far.json").write_text(json.dumps(init | {"pelvis": [100, 100, 1]}))
    assert track(scene, "--init", scene / "far.json", "--stop", 2) == 1
    assert "far.json: the start is outside the picture; check pelvis" in capsys.readouterr().err
    assert track(scene, "--init", scene / "init.json", "--stop", 2) == 0


def test_a_track_is_not_its_own_truth(scene, capsys):
    truth = str(scene / "truth.csv")
    assert main(["eval", f"{scene}/../{scene.name}/truth.csv", "--truth", truth]) == 1
    assert re.search(
        "truth.csv: is given as the track and as its truth; give two files", capsys.readouterr().err
    )


def test_a_camera_is_not_a_track(scene, capsys):
    assert main(["eval", str(scene / "camera.json"), "--truth", str(scene / "truth.csv")]) == 1
    predicted = capsys.readouterr().err
    assert re.search(r"camera.json: (not a track file|has no rows).*; give a track CSV", predicted)


def test_paper_mode_and_no_background(scene, capsys):
    assert track(scene, "--mode", "paper", "--background", "none", "--json") == 0
    assert json.loads(capsys.readouterr().out)["frames"] == 20


def test_each_mode_has_its_model(scene, capsys):
    for words, components in (
        (["--mode", "paper"], 5),
        (["--mode", "default"], 8),
        (["--mode", "paper", "--model", "walk"], 8),
    ):
        assert track(scene, *words, "--background", "none", "--json") == 0
        head = (scene / "out.csv").read_text().splitlines()[0].split(",")
        assert sum(re.fullmatch(r"c_\d+", name) is not None for name in head) == components, head
    capsys.readouterr()


@pytest.fixture(scope="module")
def tracks(scene):
    """What a detector finds in the clip: 2 px of noise, one joint in five missing, and a point of its own."""
    rng = np.random.default_rng(3)
    uv = np.array([camera().project(MODEL.pose(s)[0]) for s in clip(MODEL, SECTIONS, 20)[1]])
    uv += rng.normal(scale=2.0, size=uv.shape)
    uv[rng.random(uv.shape[:2]) < 0.2] = np.nan
    names = (*MODEL.joint_names, "nose")
    uv = np.concatenate([uv, np.full((20, 1, 2), 100.0)], axis=1)
    frame = np.arange(20)
    found = tracks_file.Keypoints(frame, frame / 30, names, uv, np.ones(uv.shape[:2]))
    tracks_file.write(scene / "tracks.csv", found)
    return scene / "tracks.csv"


def root_error(scene, capsys, *options):
    """Median error of tracks of the clip, mm, over four seeds because a single one is luck, and a digest."""
    errors = []
    for seed in range(1, 5):
        words = ["--json", "--mode", "paper", "--background", "none", "--seed", seed, *options]
        assert track(scene, *words) == 0
        digest = json.loads(capsys.readouterr().out)["digest"]
        assert main(["eval", str(scene / "out.csv"), "--truth", str(scene / "truth.csv"), "--json"]) == 0
        errors.append(json.loads(capsys.readouterr().out)["root"]["median"])
    return np.mean(errors), digest


@pytest.mark.long
def test_tracks_of_a_detector_help(scene, tracks, capsys):
    without, plain = root_error(scene, capsys)
    helped, found = root_error(scene, capsys, "--keypoints", tracks)
    assert helped < 0.98 * without and found != plain
    _, vague = root_error(scene, capsys, "--keypoints", tracks, "--keypoints-sd", 40)
    assert vague not in (plain, found)
    assert track(scene, "--keypoints", tracks) == 0
    assert "ignored: nose\n" in capsys.readouterr().err


def test_tracks_of_other_frames_are_refused(scene, tracks, monkeypatch, capsys):
    monkeypatch.setattr(read_scene, "sample", lambda *_: pytest.fail("began long work"))
    text = tracks.read_text().splitlines()
    late = [text[0], *(f"{i + 700}{row[row.index(',') :]}" for i, row in enumerate(text[1:]))]
    (scene / "late.csv").write_text("\n".join(late) + "\n")
    assert track(scene, "--keypoints", scene / "late.csv", out="fault.csv") == 1
    assert "late.csv: has none of the tracked frames; number frames as in the" in capsys.readouterr().err
    read, _ = tracks_file.read(tracks, MODEL.joint_names, ignore_unknown=True)
    tracks_file.write(scene / "large.csv", replace(read, uv=2 * read.uv))
    assert track(scene, "--keypoints", scene / "large.csv", out="fault.csv") == 1
    assert "large.csv: " in (printed := capsys.readouterr().err)
    assert "outside the video's 320x240 pictures; give keypoints found in this video" in printed
    assert not (scene / "fault.csv").exists()


FAULTS = [
    (["--camera", "{}/none.json"], "none.json: no such camera file"),
    (["--init", "{}/none.json"], "none.json: no such start file"),
    (["--init", "{}/init.json", "--start", "3"], "init.json: frame is 0, --start is 3"),
    (["--background", "{}/none.png"], "none.png: no such background image"),
    (["--background", "{}/small.png"], "small.png: is 32x24, the video 320x240"),
    (["--background", "{}/other.png"], "other.png: half of frame 0 differs from it; give the empty scene"),
    (["--background", "none", "--init", "auto"], "walk.mp4: --init auto found no person in full view"),
    (["-m", "{}/camera.json"], "camera.json: .*"),
    (["-m", "{}/none.gait"], "none.gait: no such model file"),
    (["-o", "{}/init.json/out.csv"], "out.csv: .*init.json is a file, not a folder; choose another place"),
    (["--detector", "lite"], "pose_detection.tflite: the detector's weights are not in .*GAIT_WEIGHTS"),
    (["-o", "{}/none/out.csv"], "out.csv: folder .* does not exist"),
    (["--overlay", "{}/none/o.mp4"], "o.mp4: folder .* does not exist"),
    (["--overlay", "{}/walk.mp4"], "walk.mp4: is read by this command; give the output another name"),
    (["--camera-out", "{}/init.json"], "init.json: is read by this command"),
    (["--cameras-out", "{}/fault.csv"], "fault.csv: two outputs have this name"),
    (["--camera", "{}"], "is a folder; give the camera file itself"),
    (["--keypoints", "{}/none.csv"], "none.csv: no such file of keypoints"),
    (["--trc", "{}/none/o.trc"], "o.trc: folder .* does not exist"),
    (["--init", "{}/late.json"], "late.json: frame is 20, the frames to track end at 19; give one"),
    (["--init", "auto", "--start", "500"], "walk.mp4: no frame from 500 up to 20; it has 20"),
]


@pytest.mark.parametrize("options, words", FAULTS, ids=[" ".join(f[0]) for f in FAULTS])
def test_every_fault_is_one_line_and_leaves_no_output(options, words, scene, capsys):
    cv2.imwrite(str(scene / "small.png"), np.zeros((24, 32), np.uint8))
    cv2.imwrite(str(scene / "other.png"), wall(seed=1))
    (scene / "late.json").write_text('{"frame": 20}')
    before = {path: path.read_bytes() for path in scene.iterdir()}
    assert track(scene, *[str(o).format(scene) for o in options], out="fault.csv") == 1
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    assert err.startswith("gait track: ")
    assert re.search(words, err)
    assert {path: path.read_bytes() for path in scene.iterdir()} == before


@pytest.mark.parametrize(
    "more", [[], ["--stabilize", "off"], ["--people", "all"]], ids=["default", "off", "people"]
)
@pytest.mark.parametrize(
    ("plate", "words"),
    [
        ("grey.png", "grey.png: either it or .*walk.mp4 is grey"),
        ("other.png", "other.png: half of frame 0 differs from it"),
        ("small.png", "small.png: is 32x24, the video 320x240"),
    ],
)
def test_a_background_of_another_scene_is_refused_before_long_work(
    plate, words, more, scene, monkeypatch, capsys
):
    grey = cv2.cvtColor(wall(), cv2.COLOR_BGR2GRAY)
    cv2.imwrite(str(scene / "grey.png"), grey)
    cv2.imwrite(str(scene / "other.png"), wall(seed=1))
    cv2.imwrite(str(scene / "small.png"), grey[:24, :32])
    for work in "sample", "find_people":
        monkeypatch.setattr(read_scene, work, lambda *_: pytest.fail("began long work"))
    monkeypatch.setattr(read_scene, "require_detector", lambda _: None)
    options = ["--background", scene / plate, "--init", "auto", *more]
    assert track(scene, *options, out="fault.csv") == 1
    assert re.search(words, capsys.readouterr().err)


def test_a_camera_cannot_be_estimated_without_keypoints(scene, monkeypatch, capsys):
    monkeypatch.setattr(read_scene, "sample", lambda *_: pytest.fail("began long work"))
    words = ["track", str(scene / "walk.mp4"), "--height", "1.75", "-o", str(scene / "fault.csv")]
    assert main([*words, "--detector", "none"]) == 1
    assert (
        "without --camera the keypoints of a walk are needed: leave out --detector" in capsys.readouterr().err
    )


def test_render_a_pose(tmp_path, scene):
    assert main(["render", "--phase", "0.3", "-o", str(tmp_path / "pose.png")]) == 0
    pose = cv2.imread(str(tmp_path / "pose.png"))
    assert pose.shape == (900, 720, 3)
    assert 0.03 < (np.abs(pose.astype(int) - pose[0, 0]).max(axis=2) > 30).mean() < 0.4
    state = {"phase": 0.3, "stature": 1.6, "pelvis": [0.2, 0.0, 0.85], "coef": [1.5]}
    (tmp_path / "state.json").write_text(json.dumps(state))
    words = ["render", "--state", tmp_path / "state.json", "--camera", scene / "camera.json"]
    assert main([str(w) for w in (*words, "-o", tmp_path / "shown.png")]) == 0
    assert cv2.imread(str(tmp_path / "shown.png")).shape == (240, 320, 3)


def test_a_picture_that_the_disk_has_no_space_for_is_one_line(tmp_path, capfd):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, limits[1]))
        assert main(["render", "--phase", "0.3", "-o", str(tmp_path / "pose.png")]) == 1
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    err = capfd.readouterr().err
    assert err == f"gait render: {tmp_path}/pose.png: File too large; choose another place\n"
    assert not list(tmp_path.iterdir())


def test_render_a_sheet(tmp_path):
    assert main(["render", "--strip", "-o", str(tmp_path / "sheet.png")]) == 0
    sheet = cv2.imread(str(tmp_path / "sheet.png"))
    rows = 1 + MODEL.info.components
    assert sheet.shape[0] > 250 * rows
    for row in range(rows):
        part = sheet[len(sheet) * row // rows : len(sheet) * (row + 1) // rows].astype(int)
        assert (np.ptp(part, axis=2) > 40).mean() > 0.005  # something coloured in every row


def test_render_a_class(tmp_path):
    """A run bends the knees more than a walk; who stands is the same at all phases."""
    drawn = {}
    for name in ("walk", "run", "stand"):
        out = tmp_path / f"{name}.png"
        assert main(["render", "-m", "classes", "--class", name, "--strip", "-o", str(out)]) == 0
        drawn[name] = cv2.imread(str(out)).astype(int)
    assert drawn["run"].shape == drawn["walk"].shape and (drawn["run"] != drawn["walk"]).mean() > 0.02
    first, later = (drawn["stand"][44:344, left : left + 176] for left in (120, 120 + 3 * 176))
    assert np.array_equal(first, later)
    poses = [tmp_path / f"{name}.bmp" for name in ("first", "run")]
    for out, more in zip(poses, ([], ["--class", "run"]), strict=True):
        assert main(["render", "-m", "classes", "--phase", "0.3", "-o", str(out), *more]) == 0
    assert poses[0].read_bytes() != poses[1].read_bytes()


@pytest.mark.parametrize(
    "words, message",
    [
        (["--strip", "--camera", "c.json"], "--camera: --strip has its own view"),
        (
            ["-m", "classes", "--class", "fly"],
            "--class fly: the model has no such class; give one of walk, st",
        ),
        (["--state", "{}"], "no such state file"),
    ],
)
def test_render_faults(words, message, tmp_path, capsys):
    words = [word.format(tmp_path / "none.json") for word in words]
    assert main(["render", *words, "-o", str(tmp_path / "o.png")]) == 1
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_render_refuses_a_phase_beyond_the_stride(tmp_path, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["render", "--phase", "1.5", "-o", str(tmp_path / "o.png")])
    assert "--phase: 1.5: give a share of the stride from 0 to 1" in capsys.readouterr().err


def test_render_does_not_draw_over_what_it_reads(tmp_path, capsys):
    state = tmp_path / "state.png"
    state.write_text("{}")
    assert main(["render", "--state", str(state), "-o", str(state)]) == 1
    assert "state.png: is read by this command" in capsys.readouterr().err and state.read_text() == "{}"


def test_report_does_not_write_over_the_clip(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "walk.mp4").write_bytes(b"clip")
    files = ["e.log", "--track", "t.csv", "--video", "walk.mp4", "--camera", "c.json"]
    assert main(["report", *files, "-o", "r.html", "--overlay", "./walk.mp4"]) == 1
    assert "walk.mp4: is read by this command" in capsys.readouterr().err
    assert (tmp_path / "walk.mp4").read_bytes() == b"clip" and len(list(tmp_path.iterdir())) == 1


@needs_data
def test_a_dev_clip_from_its_truth(tmp_path, capsys):
    folder = DATA / "eval/dev/oblique45_07"
    meta = json.loads((folder / "meta.json").read_text())
    with open(folder / "truth.csv") as file:
        first = next(csv.DictReader(file))
    right = meta["events_video_frames"]["r_heel_strike"]
    rate = 30 / np.diff(right).mean()
    init = {
        "frame": 0,
        "pelvis": [float(first[f"pelvis_{a}"]) for a in "xyz"],
        "heading_rad": float(first["heading_rad"]),
        "phase": float((-right[0] * rate / 30) % 1),
        "stride_hz": float(rate),
        "stature_m": meta["stature_m"],
    }
    (tmp_path / "init.json").write_text(json.dumps(init))
    words = ["track", folder / "video.mp4", "--camera", folder / "camera.json", "--stop", 30]
    words += [
        "--background",
        folder / "background.png",
        "--init",
        tmp_path / "init.json",
        "-o",
        tmp_path / "o.csv",
    ]
    assert main([str(word) for word in (*words, "--quiet", "--json")]) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == 30
    assert main(["eval", str(tmp_path / "o.csv"), "--truth", str(folder / "truth.csv"), "--json"]) == 0
    errors = json.loads(capsys.readouterr().out)
    assert errors["frames"] == 30 and errors["lost"] == 0
    assert errors["root"]["median"] < 90 and errors["abs"]["median"] < 200
    assert errors["phase"]["median"] < 0.04 and errors["phase"]["flips"] == 0
    assert errors["root"]["median"] < errors["static"]["root"]["median"]
