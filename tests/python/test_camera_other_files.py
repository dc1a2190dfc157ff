"""Cameras of other tools: the same pixels as from the tool's own equations, or a one-line error."""

import json
import pickle
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from gait import Camera, UserError
from gait.camera.camera import read_camera
from gait.camera.lens import AGREE

QUALISYS = Path(__file__).resolve().parents[2] / "../shared/data/video/balancing/calibration"
SIZE, FOCAL, CENTRE = (1280, 720), (1200.0, 1205.0), (641.0, 356.5)
LENS = (-0.28, 0.09, 0.0008, -0.0005)
FISHEYE = (-0.03, 0.006, -0.004, 0.001)
MATRIX = np.array([[FOCAL[0], 0, CENTRE[0]], [0, FOCAL[1], CENTRE[1]], [0, 0, 1]])
POINTS = np.array([[x, y, 3.0] for x in np.linspace(-1.9, 1.9, 9) for y in np.linspace(-1.0, 1.0, 7)])


def pixels(coefficients, fisheye=False):
    """POINTS in the picture by OpenCV's own functions."""
    zero, world = np.zeros(3), POINTS[:, None]
    if fisheye:
        return cv2.fisheye.projectPoints(world, zero, zero, MATRIX, np.array(coefficients))[0][:, 0]
    return cv2.projectPoints(world, zero, zero, MATRIX, np.array(coefficients))[0][:, 0]


def kalibr(path, model="radtan", coefficients=LENS):
    path.write_text(
        f"cam0:\n  camera_model: pinhole\n  intrinsics: [{FOCAL[0]}, {FOCAL[1]}, {CENTRE[0]}, {CENTRE[1]}]\n"
        f"  distortion_model: {model}\n  distortion_coeffs: {list(coefficients)}\n  resolution: [1280, 720]\n"
        "  rostopic: /cam0/image_raw\ncam1:\n  camera_model: omni\n  intrinsics: [1.9, 1, 1, 1, 1]\n"
        "  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, 0.1]\n"
    )
    return f"{path}:cam0"


def ros_file(path, model="plumb_bob", coefficients=(*LENS, 0.0)):
    """As camera_calibration of ROS writes it."""
    path.write_text(
        "image_width: 1280\nimage_height: 720\ncamera_name: head\n"
        f"camera_matrix:\n  rows: 3\n  cols: 3\n  data: {MATRIX.ravel().tolist()}\n"
        f"distortion_model: {model}\ndistortion_coefficients:\n  rows: 1\n  cols: {len(coefficients)}\n"
        f"  data: {list(coefficients)}\nrectification_matrix:\n  rows: 3\n  cols: 3\n"
        "  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
    )
    return str(path)


def ros_message(path, model="plumb_bob", coefficients=(*LENS, 0.0), more=""):
    """As `ros2 topic echo` prints it: r rectifies the image and is not a pose in the world."""
    path.write_text(
        f"header:\n  frame_id: head\nheight: 720\nwidth: 1280\ndistortion_model: {model}\n"
        f"d: {list(coefficients)}\nk: {MATRIX.ravel().tolist()}\nr: [0, 1, 0, -1, 0, 0, 0, 0, 1]\n"
        "p: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]\n"
        "binning_x: 0\nbinning_y: 0\nroi:\n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n" + more
    )
    return str(path)


def colmap(path, model="OPENCV", coefficients=LENS, name="1"):
    f = (FOCAL[0] + 0.0, FOCAL[1]) if model not in ("RADIAL", "SIMPLE_RADIAL") else FOCAL[:1]
    values = [*f, CENTRE[0] + 0.5, CENTRE[1] + 0.5, *coefficients]
    row = f"1 {model} 1280 720 {' '.join(map(str, values))}"
    path.write_text(f"# Camera list\n{row}\n2 PINHOLE 64 48 9 9 32 24\n")
    return f"{path}:{name}"


def opencap(path, coefficients=(*LENS, 0.0)):
    size = np.array([[720.0], [1280.0]])
    data = {"intrinsicMat": MATRIX, "distortion": np.array([coefficients]), "imageSize": size,
            "rotation": np.eye(3), "translation": np.array([[1.0], [2.0], [3.0]])}  # fmt: skip
    path.write_bytes(pickle.dumps(data))
    return str(path)


CASES = {
    "kalibr": (lambda p: kalibr(p / "chain.yaml"), LENS, False),
    "kalibr_fisheye": (lambda p: kalibr(p / "chain.yaml", "equidistant", FISHEYE), FISHEYE, True),
    "ros_file": (lambda p: ros_file(p / "a.yaml"), LENS, False),
    "ros_file_8": (
        lambda p: ros_file(
            p / "a.yaml", "rational_polynomial", (0.3, 0.05, 1e-3, -5e-4, 0.01, 0.6, 0.1, 0.02)
        ),
        (0.3, 0.05, 1e-3, -5e-4, 0.01, 0.6, 0.1, 0.02),
        False,
    ),
    "ros_message": (lambda p: ros_message(p / "a.yaml"), LENS, False),
    "ros_message_fisheye": (lambda p: ros_message(p / "a.yaml", "equidistant", FISHEYE), FISHEYE, True),
    "colmap": (lambda p: colmap(p / "cameras.txt"), LENS, False),
    "colmap_fisheye": (lambda p: colmap(p / "cameras.txt", "OPENCV_FISHEYE", FISHEYE), FISHEYE, True),
    "colmap_full": (
        lambda p: colmap(p / "cameras.txt", "FULL_OPENCV", (0.3, 0.05, 1e-3, -5e-4, 0.01, 0.6, 0.1, 0.02)),
        (0.3, 0.05, 1e-3, -5e-4, 0.01, 0.6, 0.1, 0.02),
        False,
    ),
    "opencap": (lambda p: opencap(p / "cameraIntrinsicsExtrinsics.pickle"), LENS, False),
}


@pytest.mark.parametrize("case", CASES)
def test_every_point_is_where_the_tools_equations_put_it(case, tmp_path):
    make, coefficients, fisheye = CASES[case]
    camera = read_camera(make(tmp_path), placed=False)
    assert camera.size == SIZE
    expected = pixels(coefficients, fisheye)
    shown = ((expected > -0.5) & (expected < np.array(SIZE) - 0.5)).all(axis=1)
    assert shown.sum() > 20
    off = np.abs(camera.project(POINTS) - expected)[shown].max()
    assert off < (AGREE if fisheye or len(coefficients) == 8 else 1e-9)
    rays = camera.rays(expected[shown])
    truth = POINTS[shown] / np.linalg.norm(POINTS[shown], axis=1, keepdims=True)
    assert np.abs(rays - truth).max() < 2e-4


BROAD = (-0.01, 0.001, 0.0, 0.0)
REFUSED = {
    "fisheye_too_large": (
        lambda p: broad(p / "a.yaml"),
        "fisheye lens that k1 k2 p1 p2 k3 cannot replace within 0.5 px",
    ),
    "kalibr_omni": (
        lambda p: kalibr(p / "c.yaml").replace("cam0", "cam1"),
        "lens omni-none is not supported",
    ),
    "kalibr_key": (
        lambda p: changed(kalibr(p / "c.yaml"), "distortion_coeffs", "distortion_terms"),
        "distortion_terms describes an unknown kind of lens; .* distortion_coefficients with k1 k2",
    ),
    "kalibr_no_model": (
        lambda p: changed(kalibr(p / "c.yaml"), "  distortion_model: radtan\n", ""),
        "distortion_coeffs without distortion_model; add radtan or equidistant",
    ),
    "kalibr_none": (lambda p: kalibr(p / "c.yaml", "none"), "without distortion_model; add radtan"),
    "kalibr_two": (
        lambda p: changed(kalibr(p / "c.yaml"), "  rostopic", "  fisheye: true\n  rostopic"),
        "fisheye and distortion_model name different lenses; remove one",
    ),
    "ros_key": (
        lambda p: changed(ros_message(p / "a.yaml"), "\nd: ", "\nlens: "),
        r"lens may be a lens \(5 numbers\); lenses are distortion_coefficients",
    ),
    "kalibr_fov": (lambda p: kalibr(p / "c.yaml", "fov", [0.9]), "pinhole-fov is not supported; undistort"),
    "kalibr_choice": (
        lambda p: kalibr(p / "c.yaml")[:-5],
        "2 cameras; choose one as c.yaml:NAME, found: cam0 cam1",
    ),
    "colmap_prism": (
        lambda p: colmap(p / "cameras.txt", "THIN_PRISM_FISHEYE", [0.1] * 8),
        "lens THIN_PRISM_FISHEYE is not supported; undistort",
    ),
    "colmap_count": (
        lambda p: colmap(p / "cameras.txt", "OPENCV", LENS[:3]),
        "camera 1 does not have 8 parameters",
    ),
    "opencap_object": (
        lambda p: foreign_pickle(p / "a.pickle"),
        "not a camera of OpenCap .contains an object pathlib",
    ),
    "text": (lambda p: written(p / "a.txt", "hello world\n"), "contains no camera; give a JSON camera file"),
    "yaml": (lambda p: written(p / "a.yaml", "a: [1, 2\n"), "not a YAML file"),
    "list": (lambda p: written(p / "a.yaml", "- 1\n- 2\n"), "contains no camera"),
    "metashape": (
        lambda p: written(
            p / "a.xml", "<document><chunk><calibration><f>9</f></calibration></chunk></document>"
        ),
        "a.xml: XML of <document>, not a calibration of Qualisys; export the camera for OpenCV or COLMAP",
    ),
    "xml": (lambda p: written(p / "a.qca.txt", "<calibration>\n<cameras>\n"), "not an XML file"),
}


def broad(path):
    """A fisheye that shows 70 degrees from its axis."""
    matrix = [[300, 0, 639.5], [0, 300, 359.5], [0, 0, 1]]
    path.write_text(
        f"image_width: 1280\nimage_height: 720\ncamera_matrix: {matrix}\ndistortion_model: equidistant\n"
        f"distortion_coefficients: {list(BROAD)}\n"
    )
    return str(path)


def written(path, text):
    path.write_text(text)
    return str(path)


def changed(path, old, new):
    """Replace the first `old` in a file, which may be followed by a camera's name."""
    file = Path(path.split(".yaml")[0] + ".yaml")
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new, 1))
    return path


def foreign_pickle(path):
    path.write_bytes(pickle.dumps({"intrinsicMat": Path("a")}))
    return str(path)


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_used_is_refused_in_one_line(case, tmp_path):
    make, words = REFUSED[case]
    with pytest.raises(UserError, match=words) as caught:
        read_camera(make(tmp_path), placed=False)
    assert "\n" not in str(caught.value)


def test_a_part_of_a_ros_picture_is_refused(tmp_path):
    path = Path(ros_message(tmp_path / "a.yaml"))
    for wrong in (("binning_x: 0", "binning_x: 2"), ("x_offset: 0", "x_offset: 64")):
        path.write_text(Path(ros_message(path)).read_text().replace(*wrong))
        with pytest.raises(UserError, match="binning or roi is set; give the camera_info of full pictures"):
            read_camera(str(path), placed=False)


def test_files_that_do_not_place_the_camera_are_lenses_alone(tmp_path):
    for path in (
        kalibr(tmp_path / "c.yaml"),
        ros_message(tmp_path / "a.yaml"),
        opencap(tmp_path / "a.pickle"),
    ):
        with pytest.raises(UserError, match="R and t are missing; place the camera"):
            Camera.read(path)


def test_a_picture_of_colmap_places_its_camera(tmp_path):
    turn, place = cv2.Rodrigues(np.array([1.2, 0.3, -0.4]))[0], np.array([0.2, 1.1, 4.0])
    w = np.sqrt(1 + np.trace(turn)) / 2
    x, y, z = (turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1])
    quaternion = [w, x / (4 * w), y / (4 * w), z / (4 * w)]
    row = " ".join(map(str, ["7", *quaternion, *place, "1", "walk 01.jpg"]))
    (tmp_path / "images.txt").write_text(f"# Image list\n{row}\n1.0 2.0 -1\n")
    camera = Camera.read(colmap(tmp_path / "cameras.txt", name="walk 01.jpg"))
    np.testing.assert_allclose(camera.R, turn, atol=1e-12)
    np.testing.assert_allclose(camera.t, place)
    (tmp_path / "b").mkdir()
    values = [*FOCAL, CENTRE[0] + 0.5, CENTRE[1] + 0.5, *LENS]
    cameras = struct.pack("<QIiQQ5dIiQQ8d", 2, 2, 7, 64, 48, 9, 9, 32, 24, 0.9, 1, 4, 1280, 720, *values)
    points = struct.pack("<Qddq", 1, 1.0, 2.0, -1)
    pictures = struct.pack("<QI7dI", 1, 7, *quaternion, *place, 1) + b"walk 01.jpg\0" + points
    (tmp_path / "b/cameras.bin").write_bytes(cameras)
    (tmp_path / "b/images.bin").write_bytes(pictures)
    binary = Camera.read(f"{tmp_path}/b/cameras.bin:walk 01.jpg")
    np.testing.assert_array_equal(binary.R, camera.R)
    np.testing.assert_array_equal(binary.matrix, camera.matrix)
    np.testing.assert_array_equal(binary.distortion, camera.distortion)
    (tmp_path / "b/images.bin").write_bytes(pictures[:-8])
    with pytest.raises(UserError, match="images.bin: not a binary file of COLMAP .it has"):
        Camera.read(f"{tmp_path}/b/cameras.bin:walk 01.jpg")


def test_freemocap_is_in_millimetres(tmp_path):
    table = (
        "[cam_0]\nname = '0'\nsize = [1280, 720]\nmatrix = [[900, 0, 640], [0, 900, 360], [0, 0, 1]]\n"
        "distortions = [0.0, 0.0, 0.0, 0.0, 0.0]\n"
        "rotation = [1.6, 0.0, 0.0]\n"
        "translation = [10.0, 1200.0, 4000.0]\n"
        "world_position = [0.0, 0.0, 0.0]\n"
    )
    path = tmp_path / "calibration.toml"
    path.write_text(table + "[metadata]\ncharuco_square_size = 39.0\n")
    np.testing.assert_allclose(Camera.read(f"{path}:cam_0").t, [0.01, 1.2, 4.0])
    path.write_text(table + "[metadata]\nadjusted = false\n")
    np.testing.assert_allclose(Camera.read(f"{path}:cam_0").t, [10, 1200, 4000])


def test_a_fisheye_of_anipose_is_used(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(
        f"[cam]\nsize = [1280, 720]\nmatrix = {json.dumps(MATRIX.tolist())}\ndistortions = {list(FISHEYE)}\n"
        "rotation = [0.0, 0.0, 0.0]\ntranslation = [0.0, 0.0, 0.0]\nfisheye = true\n"
    )
    assert np.nanmax(np.abs(Camera.read(str(path)).project(POINTS) - pixels(FISHEYE, True))[20:40]) < AGREE


@pytest.mark.skipif(not QUALISYS.is_dir(), reason="../shared/data/video is absent")
def test_a_calibration_of_qualisys_is_as_pose2sim_converts_it():
    for i in range(1, 5):
        ours = Camera.read(f"{QUALISYS}/Calib.qca.txt:cam{i:02d}")
        theirs = Camera.read(f"{QUALISYS}/Calib_qualisys.toml:cam_{i:02d}")
        assert ours.size == theirs.size == (1088, 1920)
        np.testing.assert_allclose(ours.matrix, theirs.matrix, atol=1e-6)
        np.testing.assert_allclose(ours.R, theirs.R, atol=1e-7)
        np.testing.assert_allclose(ours.centre, theirs.centre, atol=1e-6)


def test_a_made_calibration_of_qualisys_with_a_cut_picture(tmp_path):
    path = tmp_path / "a.qca.txt"
    path.write_text(
        "<?xml version='1.0'?>\n<calibration><cameras><camera serial='21' viewrotation='0'>\n"
        "<fov_video left='100' top='20' right='739' bottom='499'/>"
        "<fov_video_max left='0' top='0' right='1279' bottom='719'/>"
        "<transform x='0' y='-4000' z='1500' r11='1' r12='0' r13='0'"
        " r21='0' r22='0' r23='1' r31='0' r32='-1' r33='0'/>"
        "<intrinsic focalLengthU='57600' focalLengthV='57600'"
        " centerPointU='40928' centerPointV='23008' skew='0'"
        " sensorMinU='0' sensorMaxU='81856' sensorMinV='0' sensorMaxV='46016' radialDistortion1='-0.1'"
        " radialDistortion2='0.02' radialDistortion3='0.003'"
        " tangentalDistortion1='0.001' tangentalDistortion2='-0.002'/>"
        "</camera></cameras></calibration>"
    )
    camera = Camera.read(str(path))
    assert camera.size == (640, 480) and (camera.fx, camera.cx, camera.cy) == (900, 539.5, 339.5)
    np.testing.assert_allclose(camera.distortion, [-0.1, 0.02, 0.001, -0.002, 0.003])
    np.testing.assert_allclose(camera.centre, [0, -4, 1.5])
    np.testing.assert_allclose(camera.project([[0, 0, 1.5], [0, 0, 1.0]])[:, 1] > 300, True)
    path.write_text(path.read_text().replace("viewrotation='0'", "viewrotation='90'"))
    with pytest.raises(UserError, match="viewrotation is 90"):
        Camera.read(str(path))
