"""Placing a camera: the true place is recovered, every fault of the points is one line."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gait import Camera, UserError
from gait.camera.camera import read_camera
from gait.camera.placing import Points, place
from gait.cli import main

LENS = {"width": 640, "height": 480, "fx": 700.0, "fy": 710.0, "cx": 321.0, "cy": 238.5}
BENT = [-0.1, 0.05, 0.001, -0.002, 0.01]
FLOOR = np.array([[0, 0, 0], [2, 0, 0], [2, 1.5, 0], [0, 1.5, 0], [1, 0.7, 0]], float)


def shown(place, world=FLOOR):
    camera = Camera.looking(place, [1, 0.7, 0.3], (640, 480), 700.0)
    return camera, Points("p.csv", np.arange(2, 2 + len(world)), camera.project(world), world)


@given(st.floats(0, 6.28), st.floats(3, 12), st.floats(0.5, 5), st.floats(0, 1.5))
def test_the_true_place_comes_back(angle, distance, height, off_ground):
    world = FLOOR.copy()
    world[4, 2] = off_ground
    where = [1 + distance * np.cos(angle), 0.7 + distance * np.sin(angle), height]
    true, points = shown(where, world)
    camera, off = place(true, points)
    np.testing.assert_allclose(camera.centre, where, atol=1e-4)
    np.testing.assert_allclose(camera.R, true.R, atol=1e-5)
    assert off.max() < 1e-3


def test_noise_is_reported_in_pixels():
    true, points = shown([5, -6, 2])
    noise = np.random.default_rng(3).normal(size=points.uv.shape)
    camera, off = place(true, Points("p.csv", points.line, points.uv + noise, points.world))
    assert 0.2 * (noise**2).sum() < (off**2).sum() < (noise**2).sum()  # six of ten numbers are fitted
    assert np.linalg.norm(camera.centre - [5, -6, 2]) < 0.2


def test_points_mirrored_have_no_camera_above_the_ground():
    true, points = shown([5, -6, 2])
    with pytest.raises(UserError, match="right-handed"):
        place(true, Points("p.csv", points.line, points.uv, points.world * [1, -1, 1]))


def files(folder, rows, lens=LENS):
    (folder / "lens.json").write_text(json.dumps({**lens, "distortion": BENT}))
    (folder / "points.csv").write_text("\n".join(rows) + "\n")
    return [
        str(folder / "points.csv"),
        "--lens",
        str(folder / "lens.json"),
        "-o",
        str(folder / "camera.json"),
    ]


def test_command_writes_a_camera_that_tracks_can_use(tmp_path, capsys):
    lens = read_camera(files(tmp_path, [])[2], placed=False)
    looking = Camera.looking([4, -5, 1.6], [1, 0.7, 0.3], (640, 480), 700.0)
    true = Camera(*lens.size, lens.fx, lens.fy, lens.cx, lens.cy, looking.R, looking.t, lens.distortion)
    rows = ["x,y,u,v"] + [
        f"{x},{y},{u},{v}" for (x, y, _), (u, v) in zip(FLOOR, true.project(FLOOR), strict=True)
    ]
    assert main(["camera", *files(tmp_path, rows), "--json"]) == 0
    reported = json.loads(capsys.readouterr().out)
    assert reported["points"] == 5 and reported["rms_px"] < 1e-3
    np.testing.assert_allclose(reported["place"], [4, -5, 1.6], atol=1e-4)
    camera = Camera.read(str(tmp_path / "camera.json"))
    np.testing.assert_allclose(camera.distortion, BENT)
    np.testing.assert_allclose(camera.project(FLOOR), true.project(FLOOR), atol=1e-3)


def test_command_names_points_that_do_not_fit(tmp_path, capsys):
    true, points = shown([4, -5, 1.6])
    uv = points.uv + [[0, 0], [0, 0], [60, 0], [0, 0], [0, 0]]
    rows = ["u;v;x;y"] + [f"{u};{v};{x};{y}" for (u, v), (x, y, _) in zip(uv, FLOOR, strict=True)]
    arguments = files(tmp_path, rows)
    (tmp_path / "lens.json").write_text(json.dumps(true.to_dict()))
    assert main(["camera", *arguments]) == 0
    out, err = capsys.readouterr()
    assert "5 points" in out and "above the ground" in out
    assert "points.csv: reprojection error" in err and "check line" in err


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([], "must name the columns"),
        (["u,v,x"], "must name the columns"),
        (["u,v,x,y", "1,2,0,0"], "has 1 points; give 4"),
        (["u,v,x,y", *["1,2,0,zero"] * 4], "line 2: y is 'zero'; give a number of metres"),
        (["u,v,x,y", *["1,nan,0,0"] * 4], "line 2: v is 'nan'; give a number of pixels"),
        (["u,v,x,y", *["1,2,0"] * 4], "line 2: y is ''"),
        (["u,v,x,y", *[f"{k * k},{k},{k},{k}" for k in range(5)]], "x, y, z are on a line"),
        (["u,v,x,y", *[f"{k},{k},{k * k},{k}" for k in range(5)]], "u, v are on a line"),
    ],
)
def test_faults_of_the_points_are_one_line(tmp_path, capsys, rows, words):
    assert main(["camera", *files(tmp_path, rows)]) == 1
    err = capsys.readouterr().err
    assert "points.csv: " in err and words in err and err.count("\n") == 1
    assert not (tmp_path / "camera.json").exists()


def test_a_lens_without_focal_length_is_reported(tmp_path, capsys):
    rows = [
        "u,v,x,y",
        *[f"{u},{v},{x},{y}" for (u, v), (x, y, _) in zip(shown([5, -6, 2])[1].uv, FLOOR, strict=True)],
    ]
    assert main(["camera", *files(tmp_path, rows, {**LENS, "fx": 0})]) == 1
    assert "lens.json: fx" in capsys.readouterr().err
