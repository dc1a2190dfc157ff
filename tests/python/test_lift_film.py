"""gait lift of a film: keypoints by the detector, the camera given or estimated from the walk."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from walking_keypoints import MODEL, NAMES, SIZE, TOWARDS, keypoints, view, walk_at

from gait.bindings.segment_prior import SegmentPrior
from gait.camera.camera import read_camera, write_camera
from gait.cli import main
from gait.detect import people
from gait.errors import UserError
from gait.io.video import Video, VideoWriter
from gait.lift.video import run as video_run
from gait.lift.video.placement import Placement
from gait.track.from_walk import calibrate

STATURE = 1.75


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """An empty film, and the camera of the walk that the detector finds in it."""
    folder = tmp_path_factory.mktemp("film")
    with VideoWriter(folder / "walk.mp4", 15) as film:
        for _ in range(45):
            film.write(np.zeros((SIZE[1], SIZE[0]), np.uint8))
    write_camera(folder / "camera.json", view())
    return folder


@pytest.fixture
def lift(files, tmp_path, monkeypatch, capsys):
    """Lift the film, in which the detector finds the walk; return the result's columns and the output."""
    found = keypoints(view())
    found.confidence[:, NAMES.index("l_wrist")] = 0.05
    found.uv[:, NAMES.index("l_wrist")] = 700.0
    monkeypatch.setattr(people, "detect", lambda video, first=0, stop=None, update=None: {1: found})

    def command(*words):
        out = tmp_path / "out.csv"
        assert main(["lift", str(files / "walk.mp4"), "-o", str(out), "--json", *map(str, words)]) == 0
        with out.open(newline="") as file:
            rows = list(csv.DictReader(file))
        printed = capsys.readouterr()
        columns = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
        return columns, json.loads(printed.out), printed.err

    return command


def joints(columns, letters):
    """Values of the detector's joints (T, J, 3)."""
    return np.array([[columns[f"{name}_{letter}"] for letter in letters] for name in NAMES]).transpose(
        2, 0, 1
    )


@pytest.mark.long
def test_the_camera_comes_from_the_walk(lift, files, tmp_path):
    found, figures, notes = lift("--height", STATURE, "--camera-out", tmp_path / "found.json")
    given, _, _ = lift("--camera", files / "camera.json", "--height", STATURE)
    assert "camera from the walk: focal length" in notes
    camera = read_camera(str(tmp_path / "found.json"))
    assert camera.fx == pytest.approx(1000, rel=0.15)
    assert camera.fx == pytest.approx(figures["camera"]["focal_px"])
    shown = [MODEL.joint_names.index(name) for name in NAMES]
    true = np.array([walk_at(time)[shown] for time in found["time"]])
    off, sd = joints(found, "xyz") - true, joints(found, ("sx", "sy", "sz"))
    assert (np.abs(off) < 2.6 * sd).mean() > 0.9
    usual = np.median(joints(given, ("sx", "sy", "sz")), axis=(0, 1))
    widened = np.median(sd, axis=(0, 1))
    depth = 6.0 * figures["camera"]["focal_px_sd"] / camera.fx  # metres: the walk is 6 m away
    assert widened[1] > max(2 * usual[1], 0.5 * depth)
    assert widened[2] == pytest.approx(usual[2], rel=0.5)


def test_points_of_little_confidence_are_left_out_and_suggested(lift, files, tmp_path):
    also = "--suggest", 2, "--overlay", tmp_path / "overlay.mp4"
    found, figures, _ = lift("--camera", files / "camera.json", "--keep-spikes", *also)
    assert figures["visible_share"] == pytest.approx(1 - 1 / len(NAMES))
    assert figures["suggest"][0]["joint"] == "l_wrist"
    film = Video(tmp_path / "overlay.mp4")
    assert film.count == len(found["frame"]) and next(iter(film.frames())).image.max() > 100


def test_the_users_view_is_used(lift):
    camera = lift("--height", STATURE, "--fov", "65.2")[1]["camera"]
    assert camera["focal_px"] == pytest.approx(1000, rel=0.1) and camera["focal_px_sd"] < 60


def test_a_view_from_far_away_needs_no_camera(lift):
    _, figures, notes = lift("--orthographic", "y", "--height", STATURE, "--method", "blend")
    assert "camera" not in figures and "camera from the walk" not in notes


def test_a_placement_in_the_picture_is_put_on_the_floor():
    camera, prior = view(), SegmentPrior.load()
    found = calibrate(keypoints(camera), SIZE, MODEL, STATURE)
    pelvis = walk_at(1.0)[MODEL.joint_names.index("pelvis")]
    request = video_run.Request("walk.mp4", "p.json", calibration=found, height=STATURE)
    placed = Placement(
        15, np.zeros(2), TOWARDS[0], 1.6, pelvis_px=tuple(camera.project(pelvis)), height_px=300.0
    )
    on_floor = video_run._on_floor(request, placed, prior)
    np.testing.assert_allclose(on_floor.ground, pelvis[:2], atol=1.0)
    assert on_floor.stature == STATURE
    with pytest.raises(UserError, match="p.json: pelvis_px is above the horizon"):
        video_run._on_floor(request, replace(placed, pelvis_px=(640.0, 10.0)), prior)


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ([], "give --camera CAM, or --height M to estimate the camera from the walk"),
        (["--fov", "60"], "--fov: is for a camera estimated from the walk"),
        (
            ["--camera", "camera.json", "--height", "1.7", "--fov", "60"],
            "--fov: is for a camera estimated from the walk",
        ),
        (["--camera-out", "c.json"], "--camera-out: there is no camera"),
        (["--height", "1.7", "--background", "none"], "--background needs --placement"),
        (
            ["--height", "1.7", "--placement", "p.json", "--camera", "camera.json"],
            "--height: the placement gives",
        ),
        (["--height", "1.7", "--placement", "p.json", "--method", "blend"], "--method is for keypoints"),
        (["--height", "1.7", "--start", "9", "--stop", "9"], "must be greater than --start"),
    ],
)
def test_options_that_do_not_fit(files, tmp_path, words, text, capsys):
    assert main(["lift", str(files / "walk.mp4"), "-o", str(tmp_path / "out.csv"), *words]) == 2
    assert text in capsys.readouterr().err


def test_without_the_detector_the_remedy_is_named(files, tmp_path, capsys):
    assert main(["lift", str(files / "walk.mp4"), "-o", str(tmp_path / "out.csv"), "--height", "1.7"]) == 1
    printed = capsys.readouterr().err
    assert "gait detect --fetch" in printed and printed.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_camera_without_a_floor_is_refused_before_detection(files, tmp_path, capsys):
    write_camera(tmp_path / "origin.json", replace(view(), R=np.eye(3), t=np.zeros(3)))
    words = ["--camera", str(tmp_path / "origin.json"), "-o", str(tmp_path / "out.csv")]
    assert main(["lift", str(files / "walk.mp4"), *words]) == 1
    assert "lens 0 m above the floor" in capsys.readouterr().err
