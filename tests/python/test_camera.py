"""Cameras: projection and its inverse, every file format, every fault reported in one line."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gait import Camera, UserError
from gait.io.track_file import read_truth

DATA = Path(__file__).resolve().parents[2] / "../shared/data"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data is absent")

GOOD = {
    "width": 640,
    "height": 480,
    "fx": 700.0,
    "fy": 710.0,
    "cx": 321.0,
    "cy": 238.5,
    "R": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    "t": [0.1, 1.6, 5.0],
    "distortion": [-0.1, 0.05, 0.001, -0.002, 0.01],
}


def write_json(path, **changes):
    data = {**GOOD, **changes}
    path.write_text(json.dumps({k: v for k, v in data.items() if v != "absent"}))
    return str(path)


def write_opencv(path, view, turn="R", sized=True):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    if sized:
        storage.write("image_width", 640)
        storage.write("image_height", 480)
    storage.write("camera_matrix", view.matrix)
    storage.write("distortion_coefficients", view.distortion.reshape(1, 5))
    storage.write(turn, view.R if turn == "R" else cv2.Rodrigues(view.R)[0])
    storage.write("t", view.t.reshape(3, 1))
    storage.release()
    return str(path)


def same(a, b):
    assert a.size == b.size
    np.testing.assert_allclose(a.matrix, b.matrix)
    for name in ("R", "t", "distortion"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), atol=1e-12)


@given(
    st.floats(30, 610),
    st.floats(30, 450),
    st.floats(0.5, 30),
    st.floats(-0.2, 0.2),
    st.floats(-0.01, 0.01),
    st.floats(-3, 3),
)
def test_projecting_what_a_pixel_sees_gives_the_pixel_back(u, v, distance, k1, p1, turn):
    lens = np.array([k1, 0.02, p1, -p1, 0.0])
    position = np.array([1.0, -4.0, 1.7])
    view = Camera.looking(position, position + [np.cos(turn), np.sin(turn), -0.1], (640, 480), 700.0)
    view = Camera(640, 480, 700.0, 690.0, 318.0, 242.0, view.R, view.t, lens)
    point = view.centre + distance * view.rays([u, v])
    np.testing.assert_allclose(view.project(point), [u, v], atol=1e-3)
    np.testing.assert_allclose(view.centre, position, atol=1e-9)


def test_projection_is_the_documented_formula():
    view = Camera(640, 480, 700.0, 710.0, 321.0, 238.5, np.array(GOOD["R"], float), np.array(GOOD["t"]))
    x, y, z = np.array(GOOD["R"]) @ [0.3, 2.0, 1.1] + GOOD["t"]
    np.testing.assert_allclose(view.project([0.3, 2.0, 1.1]), [700 * x / z + 321, 710 * y / z + 238.5])
    assert view.depth([0.3, 2.0, 1.1]) == pytest.approx(z)


def test_slopes_are_the_change_of_the_pixels_by_place():
    camera = replace(
        Camera.looking((6.0, 5.0, 1.6), (0.3, 5.5, 0.9), (640, 480), 500.0),
        distortion=(-0.2, 0.05, 1e-3, 2e-3),
    )
    points = np.random.default_rng(1).uniform((-1, 4, 0), (1, 7, 2), (2, 5, 3))
    uv, slopes = camera.linearised(points)
    np.testing.assert_allclose(uv, camera.project(points), atol=1e-9)
    steps = 1e-5 * np.eye(3)
    central = [(camera.project(points + step) - camera.project(points - step)) / 2e-5 for step in steps]
    np.testing.assert_allclose(slopes, np.stack(central, axis=-1), rtol=1e-6, atol=1e-4)


def test_points_behind_are_not_a_number_and_shapes_are_kept():
    view = Camera.looking((0, -5, 1.5), (0, 0, 1.0), (640, 480), 700.0)
    uv = view.project(np.array([[[0, 0, 1.0], [0, -9, 1.0]]]))
    assert uv.shape == (1, 2, 2)
    np.testing.assert_allclose(uv[0, 0], [319.5, 239.5])
    assert np.isnan(uv[0, 1]).all()


def test_lists_serve_as_arrays():
    turn = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    view = Camera(640, 480, 800, 800, 320, 240, R=turn, t=[0, 1.4, 8])
    assert np.allclose(view.centre, [0, -8, 1.4]) and np.allclose(view.project([0, 0, 1.4]), [320, 240])


def test_no_pixels_have_no_rays():
    camera = Camera.looking((0.0, -5.0, 1.5), (0.0, 0.0, 1.0), (640, 480), 800.0)
    assert camera.rays(np.empty((0, 2))).shape == (0, 3)
    assert camera.on_plane(np.empty((2, 0, 2))).shape == (2, 0, 3)


def test_pixels_meet_the_ground_below_the_horizon_only():
    view = Camera.looking((0, -5, 1.5), (0, 0, 1.5), (640, 480), 700.0)
    ground = view.on_plane([[319.5, 400.0], [319.5, 100.0]])
    assert ground[0, 2] == pytest.approx(0) and ground[0, 1] == pytest.approx(-5 + 1.5 * 700 / 160.5)
    assert np.isnan(ground[1]).all()


def test_scaling_keeps_what_a_resized_picture_shows():
    view = Camera.looking((0, -5, 1.5), (0, 0, 1.0), (640, 480), 700.0)
    half = view.scaled(0.5)
    assert half.size == (320, 240)
    # pixel centres at integers: the centre of pixel 0 of the half picture lies between pixels 0 and 1
    np.testing.assert_allclose(half.project([0.4, 1, 0.2]), (view.project([0.4, 1, 0.2]) - 0.5) / 2)


def test_json_round_trip(tmp_path):
    view = Camera.read(write_json(tmp_path / "cam.json"))
    (tmp_path / "again.json").write_text(json.dumps(view.to_dict()))
    same(view, Camera.read(str(tmp_path / "again.json")))


@pytest.mark.parametrize("count", [0, 4, 5])
def test_distortion_may_have_0_4_or_5_numbers(count, tmp_path):
    view = Camera.read(write_json(tmp_path / "cam.json", distortion=GOOD["distortion"][:count]))
    np.testing.assert_array_equal(view.distortion, GOOD["distortion"][:count] + [0.0] * (5 - count))


@pytest.mark.parametrize("suffix", ["yaml", "yml", "xml"])
@pytest.mark.parametrize("turn", ["R", "rvec"])
@pytest.mark.parametrize("sized", [True, False])
def test_opencv_files(suffix, turn, sized, tmp_path):
    expected = Camera.read(write_json(tmp_path / "cam.json"))
    path = write_opencv(tmp_path / f"cam.{suffix}", expected, turn, sized)
    same(expected, Camera.read(path, (640, 480)))
    if not sized:
        with pytest.raises(UserError, match="image_width is missing; add image_width"):
            Camera.read(path)


def test_opencv_sequences_and_common_names(tmp_path):
    path = tmp_path / "cam.yaml"
    path.write_text(
        "%YAML:1.0\n---\nK: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n"
        "  data: [700., 0., 320., 0., 700., 240., 0., 0., 1.]\nrvec: [0.1, 0.2, 0.3]\ntvec: [0., 1.5, 4.]\n"
    )
    view = Camera.read(str(path), (640, 480))
    np.testing.assert_allclose(view.t, [0, 1.5, 4])
    np.testing.assert_allclose(view.R, cv2.Rodrigues(np.array([0.1, 0.2, 0.3]))[0])


TOML = """
[{name}]
size = [ 640, 480]
matrix = [ [ 700.0, 0.0, 321.0], [ 0.0, 710.0, 238.5], [ 0.0, 0.0, 1.0]]
distortions = [ -0.1, 0.05, 0.001, -0.002]
rotation = [ 1.5707963267948966, 0.0, 0.0]
translation = [ 0.1, 1.6, 5.0]
fisheye = false
"""


def test_pose2sim_toml_by_name(tmp_path):
    path = tmp_path / "calib.toml"
    path.write_text(
        TOML.format(name="cam_01") + TOML.format(name="cam_02") + "[metadata]\nadjusted = false\n"
    )
    view = Camera.read(f"{path}:cam_02")
    expected = Camera.read(write_json(tmp_path / "cam.json", distortion=GOOD["distortion"][:4]))
    same(view, expected)
    for asked in ("", ":cam_09"):
        with pytest.raises(
            UserError, match="calib.toml: .*choose one as calib.toml:NAME, found: cam_01 cam_02"
        ):
            Camera.read(f"{path}{asked}")
    path.write_text(TOML.format(name="only"))
    same(Camera.read(str(path)), view)


@pytest.mark.parametrize("suffix", ["json", "toml", "yaml", "xml"])
def test_a_byte_order_mark_is_passed_over(suffix, tmp_path):
    """As editors on Windows write it."""
    path = tmp_path / f"cam.{suffix}"
    if suffix == "json":
        write_json(path)
    elif suffix == "toml":
        path.write_text(TOML.format(name="only"))
    else:
        write_opencv(path, Camera.read(write_json(tmp_path / "view.json")))
    view = Camera.read(str(path))
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    same(Camera.read(str(path)), view)


KEYS = ["width", "height", "fx", "fy", "cx", "cy", "R", "t"]
FAULTS = [({key: "absent"}, f"{key} is missing; ") for key in KEYS] + [
    ({"width": 640.5}, "width is 640.5, not a whole number"),
    ({"width": -1}, "width is -1, outside"),
    ({"height": "480"}, "height is not a number"),
    ({"fx": 0}, "fx is 0, outside"),
    ({"fx": float("nan")}, "fx is not finite"),
    ({"cx": True}, "cx is not a number"),
    ({"R": [[1, 0], [0, 1]]}, "R has shape 2x2, not 3x3; give the rotation"),
    ({"R": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}, "R is not a rotation; "),
    ({"R": [[2, 0, 0], [0, 1, 0], [0, 0, 1]]}, "R is not a rotation; "),
    ({"R": [[1, 0, 0], [0, 1, 0], [0, 0]]}, "R is not an array of numbers"),
    ({"t": [1, 2]}, "t has shape 2, not 3"),
    ({"t": ["a", "b", "c"]}, "t is not an array of numbers"),
    ({"t": [0, float("inf"), 0]}, "t is not finite"),
    ({"distorsion": [0.1] * 4}, "distorsion is not a known key; use width height fx"),
    ({"distortion": [0.1]}, r"distortion has 1 numbers; give k1 k2 p1 p2 \[k3\]"),
    ({"distortion": [0.0] * 8}, "distortion has 8 numbers; .*without rational terms"),
]


@pytest.mark.parametrize("changes, words", FAULTS, ids=[f[1] for f in FAULTS])
def test_every_fault_of_a_json_names_file_and_key(changes, words, tmp_path):
    with pytest.raises(UserError, match=f"cam.json: {words}") as caught:
        Camera.read(write_json(tmp_path / "cam.json", **changes))
    assert "\n" not in str(caught.value) and ";" in str(caught.value)


@pytest.mark.parametrize(
    "line, words",
    [
        ("size = [ 640, 480]", "size is missing"),
        ("rotation = [ 1.5707963267948966, 0.0, 0.0]", "rotation is missing"),
        ("translation = [ 0.1, 1.6, 5.0]", "translation is missing"),
    ],
)
def test_missing_toml_keys_name_the_camera(line, words, tmp_path):
    path = tmp_path / "calib.toml"
    path.write_text(TOML.format(name="demo").replace(line, ""))
    with pytest.raises(UserError, match=rf"calib.toml: \[demo\]: {words}"):
        Camera.read(f"{path}:demo")


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("fisheye = false", "fisheye = true\nxi = 1.2", "xi describes an unknown kind of lens"),
        ("[ 640, 480]", "[ 640.5, 480]", "size is .*whole"),
        ("700.0, 0.0, 321.0", "700.0, 3.0, 321.0", "matrix has skew"),
        ("700.0, 0.0, 321.0", "-700.0, 0.0, 321.0", "matrix has a focal length that is not positive"),
        ("[ 0.0, 0.0, 1.0]]", "[ 0.0, 0.5, 1.0]]", "matrix is not upper triangular"),
        ("[demo]", "[demo", "not valid TOML"),
    ],
)
def test_unusable_toml_cameras_are_refused(old, new, words, tmp_path):
    path = tmp_path / "calib.toml"
    path.write_text(TOML.format(name="demo").replace(old, new))
    with pytest.raises(UserError, match=words):
        Camera.read(f"{path}:demo")


@pytest.mark.parametrize(
    "name, text, words",
    [
        ("cam.json", "{", "not valid JSON"),
        ("cam.json", "[1]", "contains no JSON object"),
        ("cam.yaml", "{{{{", "not a YAML file"),
        ("cam.txt", "", "is empty; copy or make the camera file again"),
        ("cam.ini", "f=1", "unknown camera suffix; use .json"),
        ("cameras.bin", "x", r"not a binary file of COLMAP \(it ends in the middle of an entry\)"),
        ("none.json", None, "no such camera file"),
    ],
)
def test_files_that_are_no_cameras(name, text, words, tmp_path):
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(UserError, match=f"{name}: {words}"):
        Camera.read(str(tmp_path / name))


def test_size_of_the_video_is_checked(tmp_path):
    path = write_json(tmp_path / "cam.json")
    with pytest.raises(UserError, match="640x480, the video is 320x240, resized by 0.5; give --scale-camera"):
        Camera.read(path, (320, 240))
    with pytest.raises(UserError, match="640x480, the video is 640x360, another aspect"):
        Camera.read(path, (640, 360))


@needs_data
def test_outdoor_toml_puts_the_pelvis_between_the_marked_hips():
    outdoor = DATA / "video/outdoor"
    view = Camera.read(f"{outdoor}/Calib_demo.toml:demo", (1768, 994))
    np.testing.assert_allclose(view.centre, [10, 3.5, 1.7], atol=0.05)
    pelvis = json.loads((outdoor / "init.json").read_text())["pelvis"]
    marks = json.loads((outdoor / "reference2d.json").read_text())
    hips = [marks["uv"][0][marks["joints"].index(f"{s}_hip")] for s in "lr"]
    assert marks["frame_numbers"][0] == 64
    assert np.linalg.norm(view.project(pelvis) - np.mean(hips, axis=0)) < 15  # of 415 px of person


@needs_data
@pytest.mark.parametrize("clip", ["side_lr_35", "above_38", "toward300_08"])
def test_dev_cameras_project_the_truth_where_it_was_rendered(clip):
    folder = DATA / "eval/dev" / clip
    truth = read_truth(folder / "truth.csv")
    table = np.genfromtxt(folder / "truth.csv", delimiter=",", names=True)
    expected = np.stack([table["l_wrist_u"], table["l_wrist_v"]], axis=1)
    found = Camera.read(str(folder / "camera.json")).project(truth.places["l_wrist"])
    np.testing.assert_allclose(found, expected, atol=0.01)


def test_brackets_too_deep_to_read_are_one_line(tmp_path):
    deep = "[" * 100_000
    for name, text in (("cam.json", deep), ("cam.toml", f"matrix = {deep}")):
        (tmp_path / name).write_text(text)
        with pytest.raises(UserError, match=f"{name}: not valid (JSON|TOML) .brackets nested"):
            Camera.read(str(tmp_path / name))


FACES_UP = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
Y_UP = [[1, 0, 0], [0, -1, 0], [0, 0, -1]]
ON_ITS_HEAD = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]


@pytest.mark.parametrize(
    "pose, words",
    [
        ({"R": FACES_UP, "t": [0, 0, 0]}, r"lens 0 m above the floor, -y up"),
        ({"t": [100, 1600, 5000]}, r"lens 1600 m above the floor, \+z up"),
        ({"R": FACES_UP, "t": [0, 1.6, 5.0]}, r"lens -5 m above the floor, -y up"),
        ({"R": FACES_UP, "t": [0, 1.6, -5.0]}, r"lens 5 m above the floor, -y up"),
        ({"R": Y_UP, "t": [0, 1.6, 5.0]}, r"lens 5 m above the floor, \+y up"),
        ({"R": ON_ITS_HEAD, "t": [0, -1.6, 5.0]}, r"lens 1.6 m above the floor, -z up"),
    ],
)
def test_a_camera_that_cannot_be_is_refused(tmp_path, pose, words):
    view = Camera.read(write_json(tmp_path / "c.json", **pose))
    with pytest.raises(UserError, match=f"c.json: no standing person .*{words}; give R and t in metres"):
        view.check_place("c.json")


def test_cameras_that_can_be_are_accepted(tmp_path):
    Camera.read(write_json(tmp_path / "c.json")).check_place("c.json")
    for place in ([0, -3, 0.3], [2, -40, 12], [0, -3, 8]):
        Camera.looking(place, [0, 0, 0.8], (640, 480), 700).check_place("c.json")


@needs_data
def test_cameras_of_all_clips_are_accepted():
    files = sorted(DATA.glob("*/**/camera.json"))
    assert files
    for path in files:
        Camera.read(str(path)).check_place(str(path))
