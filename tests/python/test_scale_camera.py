"""Cameras of another resolution: resized by --scale-camera, else named; upright floors are rejected."""

import json
from dataclasses import replace

import numpy as np
import pytest

from gait import Camera, UserError
from gait.camera.camera import read_camera
from gait.cli import main
from gait.paper.clip import Clip

TRUE = Camera.looking([0.3, -5.0, 1.4], [0, 0, 0.9], (1280, 720), 1000.0)


@pytest.fixture
def camera(tmp_path):
    """A camera file."""
    (tmp_path / "camera.json").write_text(json.dumps(TRUE.to_dict()))
    return str(tmp_path / "camera.json")


@pytest.mark.parametrize("size", [(640, 360), (1920, 1080), (854, 480), (320, 180)])
def test_a_resized_picture_shows_the_same(camera, size):
    found = read_camera(camera, size, scale=True)
    assert found.size == size
    world = np.random.default_rng(1).uniform([-1, -1, 0], [1, 1, 2], (50, 3))
    shares = (found.project(world) + 0.5) / size[0] - (TRUE.project(world) + 0.5) / 1280
    assert np.abs(shares).max() < 1e-9
    with pytest.raises(
        UserError, match=f"the video is {size[0]}x{size[1]}, resized by .*; give --scale-camera"
    ):
        read_camera(camera, size)


@pytest.mark.parametrize(
    ("size", "words"),
    [
        ((720, 1280), "turned by 90 degrees; turn it back"),
        ((360, 640), "turned by 90 degrees and resized; turn it back"),
        ((1280, 640), "another aspect: 80 rows are cut off; calibrate for this video or undo its crop"),
        ((960, 720), "another aspect: 320 columns are cut off; calibrate"),
        ((640, 480), "another aspect; calibrate"),
    ],
)
def test_what_no_scale_can_mend_is_named(camera, size, words):
    for scale in (False, True):
        with pytest.raises(UserError, match=words):
            read_camera(camera, size, scale=scale)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["track", "v.mp4", "--height", "1.7", "-o", "o.csv"], "--scale-camera: needs --camera"),
        (
            ["lift", "k.csv", "--camera", "c.json", "-o", "o.csv"],
            "--scale-camera: is for the --camera of a VIDEO",
        ),
        (
            ["lift", "v.mp4", "--height", "1.7", "-o", "o.csv"],
            "--scale-camera: is for the --camera of a VIDEO",
        ),
        (["camera", "p.csv", "--lens", "l.json", "-o", "c.json"], "--scale-camera: is for --page"),
    ],
)
def test_where_it_means_nothing_it_is_refused(words, expected, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "v.mp4").touch()
    assert main([*words, "--scale-camera"]) == 2
    assert expected in capsys.readouterr().err


def keypoints(path, uv):
    """Write a file of two joints."""
    rows = ["frame,time,l_hip_u,l_hip_v,r_hip_u,r_hip_v"]
    rows += [f"{k},{k / 30},{a[0]:.1f},{a[1]:.1f},{a[0] + 9:.1f},{a[1]:.1f}" for k, a in enumerate(uv)]
    path.write_text("\n".join(rows) + "\n")
    return str(path)


def test_keypoints_with_y_down_are_refused(tmp_path, capsys):
    """As in films: no estimate is made in a world whose floor stands upright."""
    down = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # y down, as of OpenCV's own world
    turned = Camera(*TRUE.size, 1000, 1000, 639.5, 359.5, TRUE.R @ down, TRUE.t)
    (tmp_path / "y_down.json").write_text(json.dumps(turned.to_dict()))
    path = keypoints(tmp_path / "k.csv", np.column_stack([np.linspace(300, 900, 30), np.full(30, 400.0)]))
    assert main(["lift", path, "--camera", str(tmp_path / "y_down.json"), "-o", str(tmp_path / "o.csv")]) == 1
    err = capsys.readouterr().err
    assert "y_down.json: " in err and "-y up; give R and t" in err and err.count("\n") == 1
    assert not (tmp_path / "o.csv").exists()


def test_a_wrong_size_of_keypoints_is_noticed(tmp_path, capsys):
    walk = np.column_stack([np.linspace(100, 1200, 30), np.full(30, 600.0)])
    path = keypoints(tmp_path / "k.csv", walk)
    words = ["camera", "--walk", path, "--height", "1.7", "-o", str(tmp_path / "c.json")]
    assert main([*words, "--size", "640x360"]) == 1
    assert "of the points are outside --size 640x360; give the size of the video" in capsys.readouterr().err
    main([*words, "--size", "1920x1080"])
    assert "upper left 1208x600 of --size 1920x1080: is that the size" in capsys.readouterr().err
    main([*words, "--size", "1280x720"])
    assert "--size 1280x720" not in capsys.readouterr().err


def test_a_clip_of_the_papers_has_a_camera_of_its_size(camera):
    clip = Clip("walk", "walk.mp4", camera, "init.json", scale_camera=True)
    assert clip.calibration((640, 360)).size == (640, 360)
    with pytest.raises(UserError, match="give --scale-camera"):
        replace(clip, scale_camera=False).calibration((640, 360))
