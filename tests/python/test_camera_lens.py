"""Camera files of other tools: every lens is used correctly or rejected, and so are contradicting sizes."""

from pathlib import Path

import numpy as np
import pytest

from gait import Camera, UserError

FAULTS = Path(__file__).resolve().parents[2] / "../shared/data/faults"
LENS = (-0.25, 0.06, 0.001, -0.0005, -0.006)


def matrix(name, rows):
    rows = np.atleast_2d(rows)
    numbers = ", ".join(map(str, rows.ravel()))
    return (
        f"{name}: !!opencv-matrix\n   rows: {rows.shape[0]}\n   cols: {rows.shape[1]}\n   dt: d\n"
        f"   data: [ {numbers} ]\n"
    )


def opencv(path, *more, centre=(319.5, 239.5), sized="image_width: 640\nimage_height: 480\n"):
    """Write a camera of 640x480 pixels; `more` are further entries."""
    u, v = centre
    path.write_text(
        "%YAML:1.0\n---\n"
        + sized
        + matrix("camera_matrix", [[330, 0, u], [0, 330, v], [0, 0, 1]])
        + matrix("R", [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
        + matrix("t", [[0], [1], [4]])
        + "".join(more)
    )
    return str(path)


@pytest.mark.parametrize(
    "name",
    [
        "distortion_coefficients",
        "Distortion_Coefficients",
        "distCoeffs",
        "dist_coeffs",
        "D",
        "dist",
        "Distortion",
    ],
)
def test_a_lens_is_used_under_every_name_in_use(name, tmp_path):
    for shape in ((1, 5), (5, 1)):
        camera = Camera.read(opencv(tmp_path / "a.yaml", matrix(name, np.reshape(LENS, shape))))
        np.testing.assert_allclose(camera.distortion, LENS)


@pytest.mark.parametrize(
    "entry",
    [
        "distortion_model: thin_prism_fisheye\n",
        "camera_model: omni\n",
        "lens_model: FOV\n",
        "fisheye_model: 2\n",
        "xi: 0.9\n",
        "k1: -0.2\n",
        "skew: 0.5\n",
        matrix("D1", LENS),
        matrix("radial_distortion", LENS[:2]),
        matrix("undistorted_lens_dist", LENS[:2]),
        matrix("coefficients", LENS),
        matrix("kc", LENS),
        "camera_type: PINHOLE_EQUI\n",
        "made_by: [ calibrate, KannalaBrandt8 ]\n",
        "lens_parameters:\n   k1: -0.25\n",
        "left:\n   lens:\n      - kind: omnidirectional\n",
    ],
)
def test_lenses_described_in_other_ways_are_refused(entry, tmp_path):
    with pytest.raises(UserError, match=f"a.yaml: {entry.split(':')[0]} .*undistort the video"):
        Camera.read(opencv(tmp_path / "a.yaml", matrix("distortion_coefficients", LENS[:4]), entry))


@pytest.mark.parametrize("count", [4, 5, 8, 12, 14])
def test_a_list_that_may_be_the_lens_is_named_if_there_is_none(count, tmp_path):
    entry = matrix("intrinsics_kc", np.full(count, 0.1))
    with pytest.raises(
        UserError, match=f"intrinsics_kc may be .*{count} numbers.*distortion_coefficients with"
    ):
        Camera.read(opencv(tmp_path / "a.yaml", entry, matrix("D", np.zeros(5))))
    others = matrix("per_view_errors", np.full(count, 0.1)) + matrix("crop", np.full(count, 400))
    assert Camera.read(opencv(tmp_path / "a.yaml", others)).fx == 330
    assert Camera.read(opencv(tmp_path / "a.yaml", entry, matrix("D", LENS))).distortion[0] == LENS[0]


@pytest.mark.parametrize(
    "key", ["type", "lens", "projection", "flags", "nonlinear_model", "distortion_model"]
)
def test_a_fisheye_is_one_under_any_key(key, tmp_path):
    lens = matrix("D", (-0.02, 0.01, -0.004, 0.001))
    with pytest.raises(UserError, match="describes a fisheye lens that"):
        Camera.read(opencv(tmp_path / "a.yaml", lens, f"{key}: Fisheye\n"))
    with pytest.raises(UserError, match=f"{key} and lens_model name different lenses"):
        Camera.read(opencv(tmp_path / "a.yaml", lens, f"{key}: equidistant\n", "lens_model: radtan\n"))
    assert Camera.read(opencv(tmp_path / "a.yaml", lens, "camera_name: fisheye\n")).distortion[0] == -0.02


@pytest.mark.parametrize("count", [1, 2, 3, 6, 7, 9, 13])
def test_other_numbers_of_coefficients_are_refused(count, tmp_path):
    with pytest.raises(UserError, match="0, 4 or 5 numbers"):
        Camera.read(opencv(tmp_path / "a.yaml", matrix("D", np.full(count, 0.1))))


def test_entries_about_no_lens_do_not_matter(tmp_path):
    more = (
        "views: [ [ 1, 2 ], [ 3 ], { name: a } ]\n", "weights: [ [ 1, 2 ], [ 3 ] ]\n",
        "fisheye_model: 0\n", "camera_model: pinhole\n", "distortion_model: plumb_bob\n", "flags: 3\n",
        'camera_type: "Hero 9"\n', "avg_reprojection_error: 0.2\n", "distance: 4.5\n",
        'calibration_time: "Tue"\n',
    )  # fmt: skip
    assert not Camera.read(opencv(tmp_path / "a.yaml", *more)).distortion.any()


@pytest.mark.parametrize(
    "entry, words",
    [
        (matrix("K", np.diag([300.0, 300, 1])), "camera_matrix and K differ"),
        (matrix("rvec", [[0.1, 0.2, 0.3]]), "R and rvec differ"),
        ("image_size: [ 800, 600 ]\n", "image_size differs"),
        ("camera_matrix: 3\n", "camera_matrix appears twice"),
    ],
)
def test_two_statements_that_differ_are_refused(entry, words, tmp_path):
    with pytest.raises(UserError, match=words):
        Camera.read(opencv(tmp_path / "a.yaml", entry))


@pytest.mark.parametrize("key", ["distortion", "dist_coeffs", "xi", "k1", "distortion_model"])
def test_pose2sim_files_with_other_lenses_are_refused(key, tmp_path):
    good = (
        "[cam]\nsize = [640, 480]\nmatrix = [[330, 0, 319.5], [0, 330, 239.5], [0, 0, 1]]\n"
        "rotation = [1.5, 0.0, 0.0]\ntranslation = [0.0, 1.0, 4.0]\n"
    )
    (tmp_path / "a.toml").write_text(good)
    assert Camera.read(str(tmp_path / "a.toml")).fx == 330
    value = '"equidistant"' if key.endswith("model") else "0.3" if len(key) == 2 else "[0.1, 0, 0, 0]"
    (tmp_path / "a.toml").write_text(good + f"{key} = {value}\n")
    with pytest.raises(UserError, match=f"{key} .*undistort"):
        Camera.read(str(tmp_path / "a.toml"))


@pytest.mark.parametrize(
    "broken, words",
    [
        ("data: [ 1., 2., 3. ]", "camera_matrix has 3 numbers, other than its rows"),
        ("", "camera_matrix has 0 numbers"),
        ('data: [ "a", 2., 3. ]', "camera_matrix has 3 numbers"),
    ],
)
def test_matrices_that_lack_numbers_are_one_line(broken, words, tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text(
        f"%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   {broken}\n"
    )
    with pytest.raises(UserError, match=words):
        Camera.read(str(path), (640, 480))


def test_every_cut_of_a_file_is_one_line(tmp_path):
    text = Path(opencv(tmp_path / "a.yaml", matrix("D", LENS))).read_bytes()
    last = len(text) - len(matrix("D", LENS)) - 3
    for stop in range(0, last, 7):
        (tmp_path / "b.yaml").write_bytes(text[:stop])
        with pytest.raises(UserError, match="b.yaml: ") as caught:
            Camera.read(str(tmp_path / "b.yaml"), (640, 480))
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("factor", [0.5, 1.5, 2, 3])
def test_a_calibration_of_another_size_is_refused_by_its_principal_point(factor, tmp_path):
    centre = (320 * factor - 0.5, 240 * factor - 0.5)
    path = opencv(tmp_path / "a.yaml", sized="", centre=centre)
    with pytest.raises(UserError, match=r"principal point .* the picture is 640x480; add image_width"):
        Camera.read(path, (640, 480))
    with pytest.raises(UserError, match="give fx, fy, cx, cy for this size"):
        Camera.read(opencv(tmp_path / "a.yaml", centre=centre), (640, 480))


def test_principal_points_off_the_middle_need_a_stated_size(tmp_path):
    cropped = (440.0, 250.0)
    assert Camera.read(opencv(tmp_path / "a.yaml", centre=cropped), (640, 480)).cx == 440
    with pytest.raises(UserError, match="add image_width"):
        Camera.read(opencv(tmp_path / "a.yaml", centre=cropped, sized=""), (640, 480))
    near = opencv(tmp_path / "a.yaml", centre=(340.0, 225.0), sized="")
    assert Camera.read(near, (640, 480)).size == (640, 480)


def test_half_a_size_is_not_completed_by_the_video(tmp_path):
    with pytest.raises(UserError, match="image_width is missing"):
        Camera.read(opencv(tmp_path / "a.yaml", sized="image_height: 960\n"), (640, 480))
    with pytest.raises(UserError, match="calibrated for 800x480"):
        Camera.read(
            opencv(tmp_path / "a.yaml", sized="imageSize: [ 800, 480 ]\n", centre=(399, 239)), (640, 480)
        )


@pytest.mark.skipif(not FAULTS.is_dir(), reason="../shared/data/faults is absent")
def test_public_files():
    good, old = (Camera.read(str(FAULTS / "lens_dropped" / f"{name}.yaml")) for name in ("good", "old"))
    np.testing.assert_array_equal(good.distortion, old.distortion)
    with pytest.raises(UserError, match="describes a fisheye lens that .* cannot replace"):
        Camera.read(str(FAULTS / "lens_dropped" / "equi.yaml"))
    with pytest.raises(UserError, match="principal point"):
        Camera.read(str(FAULTS / "other_resolution" / "size_missing.yaml"), (640, 480))
