"""`gait lift` with what detectors and calibrations deliver: rejected, or reported in one line."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from toy_segments import toy_blob, toy_prior

from gait.camera.camera import Camera
from gait.cli import main
from gait.cli.lift import DEFAULT_PIXEL_SD
from gait.io.keypoints_file import Keypoints, read, shared_place, write
from gait.lift import run as lift_run
from gait.lift.keypoints import noise
from gait.lift.smooth import motion

FRAMES, MARKERS = 6, 12
FRONT = (640, 480)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A model, a camera and keypoints of the mean motion with noise."""
    monkeypatch.chdir(tmp_path)
    prior = toy_prior(FRAMES, MARKERS, 4, seed=5)
    (tmp_path / "m.gait").write_bytes(toy_blob(prior))
    camera = Camera.looking((0, -6, 1.0), (0, 0, 1.0), FRONT, 600)
    (tmp_path / "cam.json").write_text(json.dumps(camera.to_dict()))
    drift = np.arange(30)[:, None, None] * (prior.mean[0, 1] - prior.mean[0, 0])
    uv = camera.project(1.7 * (prior.mean[0, 0] + drift))
    uv += np.random.default_rng(0).normal(size=uv.shape)
    save("t.csv", uv)
    return tmp_path


def save(path, uv, step=1 / 20):
    names = toy_prior(FRAMES, MARKERS, 4, seed=5).names
    write(path, Keypoints(np.arange(len(uv)), np.arange(len(uv)) * step, names, uv, np.ones(uv.shape[:2])))


def pixels():
    return read("t.csv", toy_prior(FRAMES, MARKERS, 4, seed=5).names)[0].uv.copy()


def lift(capsys, keypoints="t.csv", camera="cam.json", *options):
    """Exit code and notes; notes about the input precede any method, so a fast one is used."""
    usual = ["-m", "m.gait", "-o", "out.csv", "--method", "blend"]
    code = main(["lift", keypoints, "--camera", camera, *usual, *options])
    return code, capsys.readouterr().err


def other_camera(**changes):
    with open("cam.json") as file:
        camera = json.load(file)
    with open("other.json", "w") as file:
        json.dump(camera | changes, file)
    return camera


def test_a_calibration_of_another_size_is_reported(folder, capsys):
    reported = "of the points lie outside the camera's 320x240 picture: is other.json the calibration"
    other_camera(width=320, height=240, cx=159.5, cy=119.5)
    assert reported in lift(capsys, "t.csv", "other.json")[1]
    assert reported not in lift(capsys, "t.csv", "other.json", "--quiet")[1]
    other_camera(width=1920, height=1080, cx=959.5, cy=539.5)
    for camera in ("other.json", "cam.json"):
        assert "outside" not in lift(capsys, "t.csv", camera)[1]


@pytest.mark.parametrize(
    ("rate", "size", "code", "words"),
    [
        (20, FRONT, 0, ""),
        (10, FRONT, 1, "t.csv: time increases by 0.05 s a frame, the video by 0.1 s; frame must number"),
        (40, FRONT, 1, "t.csv: time increases by 0.05 s a frame, the video by 0.025 s"),
        (20, (120, 90), 1, "t.csv: 100% of the points are outside the video's 120x90 pictures"),
    ],
)
def test_keypoints_are_compared_with_their_video(rate, size, code, words, folder, capsys, monkeypatch):
    film = SimpleNamespace(size=size, times=np.arange(40) / rate)
    monkeypatch.setattr("gait.io.video.Video", lambda path: film)
    found, printed = lift(capsys, "t.csv", "cam.json", "--video", "walk.mp4")
    assert found == code and (words in printed if words else "video" not in printed)


def test_the_share_outside_counts_visible_points():
    uv = np.array([[[0.0, 0], [639, 479], [640, 5], [np.nan, np.nan], [3, -1]]])
    keypoints = Keypoints(np.arange(1), np.zeros(1), tuple("abcde"), uv, np.ones((1, 5)))
    assert keypoints.outside(FRONT) == 0.5


def test_minus_one_is_refused_as_zero_is(folder, capsys):
    uv = pixels()
    uv[3, 5] = -1
    save("u.csv", uv)
    code, printed = lift(capsys, "u.csv")
    assert code == 1 and printed.count("\n") == 1
    assert "u.csv: line 5: l_elbow is at exactly -1, -1, as detectors write" in printed


@pytest.mark.parametrize(
    ("joints", "place", "reported"), [(2, -1000.0, True), (1, -1000.0, False), (5, 300.0, True)]
)
def test_points_at_one_place_are_reported(folder, capsys, joints, place, reported):
    uv = pixels()
    uv[5:20, :joints] = place, place
    assert (shared_place(uv) is not None) == reported
    save("u.csv", uv)
    words = f"{15 * joints} points are at exactly {place:g}, {place:g}: if these are"
    assert (words in lift(capsys, "u.csv", "cam.json")[1]) == reported


def test_joints_may_meet():
    """Whole pixels of a person who stands, seen from the side: hips at one place, ankles lowest of all."""
    uv = np.tile(
        np.array([[10.0, 0], [12, 40], [12, 40], [12, 40], [11, 65], [11, 90], [11, 90]]), (50, 1, 1)
    )
    assert shared_place(uv) is None


def test_an_unusual_stature_is_reported(folder, capsys, monkeypatch):
    lifted = motion.lift
    usual = toy_prior(FRAMES, MARKERS, 4, seed=5).stature
    for stature, options, reported in (
        (usual - 3 * motion.PEOPLE_SD, [], True),
        (usual + 2 * motion.PEOPLE_SD, [], False),
        (1.72 + 3 * motion.KNOWN_SD, ["--height", "1.72"], True),
        (1.72 + 2 * motion.KNOWN_SD, ["--height", "1.72"], False),
    ):
        monkeypatch.setattr(motion, "lift", lambda *args, s=stature: replace(lifted(*args), stature=s))
        believed = 1.72 if options else usual
        words = f"stature is {stature:.2f} m, expected {believed:.2f}: check the camera's focal length"
        printed = lift(capsys, "t.csv", "cam.json", *options, "--method", "smooth")[1]
        assert (words in printed) == reported and ("stature is" in printed) == reported


def test_swapped_sides_are_blamed_and_not_the_camera(folder, capsys, monkeypatch):
    lifted, uv = motion.lift, pixels()
    for first in range(2, 30, 7):
        uv[first : first + 3, 3:11] = uv[first : first + 3, [4, 3, 6, 5, 8, 7, 10, 9]]
    save("u.csv", uv)
    monkeypatch.setattr(
        motion, "lift", lambda *args: replace(lifted(*args), stature=1.1, resized=1.5, steps=5)
    )
    printed = lift(capsys, "u.csv", "cam.json", "--method", "smooth", "--keep-sides")[1]
    assert "left and right seem swapped in" in printed and "check left and right of the points" in printed
    assert "focal length" not in printed and "the camera is wrong" not in printed


@pytest.mark.parametrize("factor", [100, 1000])
def test_a_camera_in_centimetres_or_millimetres_is_refused(folder, capsys, factor):
    camera = other_camera()
    other_camera(t=[factor * value for value in camera["t"]])
    code, printed = lift(capsys, "t.csv", "other.json")
    assert code == 1 and printed.count("\n") == 1 and not (folder / "out.csv").exists()
    assert "other.json: " in printed and "in metres" in printed


def test_a_camera_on_a_mast_is_not_refused(folder, capsys):
    camera = Camera.looking((0, -30, 40.0), (0, 0, 1.0), FRONT, 3000)
    (folder / "mast.json").write_text(json.dumps(camera.to_dict()))
    prior = toy_prior(FRAMES, MARKERS, 4, seed=5)
    drift = np.arange(15)[:, None, None] * (prior.mean[0, 1] - prior.mean[0, 0])
    save("u.csv", camera.project(1.7 * (prior.mean[0, 0] + drift)))
    assert "give its t in metres" not in lift(capsys, "u.csv", "mast.json")[1]


@pytest.mark.parametrize("blank", [False, True])
def test_too_few_frames_per_second_are_named(folder, capsys, blank):
    uv = pixels()
    if blank:  # rows at the camera's rate, a detector at a fifth of it
        uv[np.arange(len(uv)) % 4 > 0] = np.nan
    save("u.csv", uv, 1 / 20 if blank else 1 / 5)
    code, printed = lift(capsys, "u.csv")
    assert code == 1 and printed.count("\n") == 1
    assert "u.csv: 5 frames per second with points are too few to follow a motion; give 7 or more" in printed


@pytest.mark.parametrize(("stop", "where"), [(20, "in frames 10 to 19"), (99, "at frame 10")])
def test_a_change_of_person_is_reported(folder, capsys, stop, where):
    uv = pixels()
    uv[10:stop, :, 0] += 250
    save("u.csv", uv)
    printed = lift(capsys, "u.csv")[1]
    assert f"most points jump at once: the keypoints switch to another person {where}; keep" in printed


def test_outliers_are_no_other_person(folder):
    uv, rng = pixels(), np.random.default_rng(2)
    outliers = rng.random(uv.shape[:2]) < 0.7
    uv[outliers] += rng.normal(size=uv.shape)[outliers] * 100
    names = toy_prior(FRAMES, MARKERS, 4, seed=5).names
    keypoints = Keypoints(np.arange(30), np.arange(30) / 20, names, uv, np.ones(uv.shape[:2]))
    assert noise.person_changes(keypoints) == []
    assert noise.person_changes(replace(keypoints, uv=pixels())) == []


def test_a_picture_upside_down_names_v(folder, capsys):
    uv = pixels()
    uv[..., 1] = 479 - uv[..., 1]
    save("u.csv", uv)
    code, printed = lift(capsys, "u.csv")
    assert code == 1 or "that v points down" in printed


def test_swapped_sides_are_put_back_and_reported(folder, capsys):
    names, uv = toy_prior(FRAMES, MARKERS, 4, seed=5).names, pixels()
    for joint in ("shoulder", "elbow"):
        pair = [names.index(f"{side}_{joint}") for side in "lr"]
        uv[np.ix_([5, 6, 7, 8], pair)] = uv[np.ix_([5, 6, 7, 8], pair[::-1])]
    save("swapped.csv", uv)
    code, printed = lift(capsys, "swapped.csv")
    assert code == 0 and "swapped; undone: shoulder, elbow in frames 5 to 8 (--keep-sides)" in printed
    assert (
        main(["lift", "swapped.csv", "-m", "m.gait", "--camera", "cam.json", "-o", "out.csv", "--json"]) == 0
    )
    put = [{"joint": joint, "first": 5, "last": 8} for joint in ("shoulder", "elbow")]
    assert json.loads(capsys.readouterr().out)["swaps"] == put
    for keypoints, options in (("swapped.csv", ["--keep-sides"]), ("t.csv", [])):
        code, printed = lift(capsys, keypoints, "cam.json", *options)
        assert code == 0 and "put back" not in printed


def test_more_outliers_than_it_bears_are_reported(folder, capsys):
    rng = np.random.default_rng(2)
    reported = "of the points seem wrong"
    for share in (0.05, 0.2):
        uv = pixels()
        outliers = rng.random(uv.shape[:2]) < share
        uv[outliers] += rng.normal(0, 60, (outliers.sum(), 2))
        save("outliers.csv", uv)
        _, printed = lift(capsys, "outliers.csv", "cam.json", "--pixel-sd", "1", "--method", "smooth")
        assert (reported in printed) == (share == 0.2)


def test_outliers_are_no_noise(folder):
    rng = np.random.default_rng(2)
    uv = pixels() + rng.normal(0, 2, pixels().shape)
    outliers = rng.random(uv.shape[:2]) < 0.15
    uv[outliers] += rng.normal(0, 60, (outliers.sum(), 2))
    save("outliers.csv", uv)
    keypoints = read("outliers.csv", toy_prior(FRAMES, MARKERS, 4, seed=5).names)[0]
    assert noise.shake(keypoints) > 1.3 * DEFAULT_PIXEL_SD
    assert lift_run.measured_noise(keypoints, print) == DEFAULT_PIXEL_SD
