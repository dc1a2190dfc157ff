"""Camera files that contradict the walk are reported with values that would fit; correct ones are not."""

import re
from dataclasses import replace
from types import SimpleNamespace

import drawn_person
import numpy as np
import pytest
from drawn_person import camera, clip
from walking_keypoints import ACROSS, MODEL, SIZE, TOWARDS, keypoints, view

from gait.bindings.model import read_blob
from gait.camera.camera import Camera, write_camera
from gait.cli import main
from gait.errors import UserError
from gait.io.blob import decode
from gait.io.keypoints_file import Keypoints, write
from gait.track import camera_check
from gait.track.camera_check import _lean, _parameters, _turned, contradiction
from gait.track.from_walk import calibrate
from gait.track.keypoint_start import find_keypoint_start
from gait.track.options import ClipOptions
from gait.track.setup import _camera

STATURE = 1.75
Y_UP, Y_DOWN = (np.array([[1, 0, 0], [0, 0, s], [0, -s, 0]], float) for s in (1, -1))


@pytest.fixture(scope="module", autouse=True)
def calibrated_once():
    """The camera of each walk is found once, though several tests need it."""
    known = {}

    def remembered(walk, *given, **options):
        key = walk.uv.tobytes(), walk.names, given[0], given[2:], str(options)
        if key not in known:
            known[key] = calibrate(walk, *given, **options)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(camera_check, "calibrate", remembered)
        yield


def found(given, walk=TOWARDS, height=STATURE):
    return contradiction(given, keypoints(view(), walk), MODEL, height)


@pytest.mark.parametrize("walk", [TOWARDS, ACROSS], ids=["towards", "across"])
@pytest.mark.parametrize("height", [STATURE, None])
def test_a_right_camera_is_not_reported(walk, height):
    assert found(view(), walk, height) is None


def test_a_guessed_camera_is_not_reported():
    assert found(view(focal=1150.0, height=1.5)) is None


@pytest.mark.parametrize(("change", "words"), [
    ({"height": 1.4 * 4 / 3}, "m tall by it, --height is 1.75"),
    ({"height": 1.4 * 3 / 4}, "m tall by it, --height is 1.75"),
    ({"focal": 1500.0}, "check its focal length (1500 px)"),
    ({"focal": 667.0}, "check its focal length (667 px)"),
])  # fmt: skip
def test_a_wrong_camera_is_reported_with_one_that_fits(change, words):
    report = found(view(**change))
    assert words in report and "camera from the walk: focal length" in report and "height 1.4" in report


@pytest.mark.parametrize("share", [1.5, 1 / 1.5])
def test_a_wrong_focal_length_of_a_level_camera_is_reported(share):
    """The stature stays as it is."""
    level = view(tilt=0.0)
    walk = keypoints(level)
    report = contradiction(replace(level, fx=share * level.fx, fy=share * level.fy), walk, MODEL, None)
    assert report.startswith("the walk contradicts its focal length")
    assert contradiction(level, walk, MODEL, None) is None


def test_a_focal_length_that_the_path_leaves_open_is_not_reported():
    walk = keypoints(view(tilt=0.0), ACROSS)
    assert contradiction(view(tilt=0.0, focal=1500.0), walk, MODEL, STATURE) is None


def test_an_unknown_stature_has_to_be_that_of_a_person():
    report = found(view(height=1.4 * 4 / 3), height=None)
    assert "m tall by it, give --height if that is right" in report


@pytest.mark.parametrize("behind", [0.0, 6.0])  # metres from the origin
@pytest.mark.parametrize(("axes", "up"), [(Y_UP, r"\+y"), (Y_DOWN, "-y")])
def test_a_world_in_which_another_axis_is_up_is_refused_before_the_work(axes, up, behind):
    turned = view().R @ axes.T
    camera = replace(view(), R=turned, t=view().t + turned @ [0.0, behind, 0.0])
    with pytest.raises(UserError, match=f"{up} up; give R and t"):
        camera.check_place("c.json")


@pytest.mark.parametrize(
    ("quarters", "words"),
    [(1, "90 degrees clockwise"), (2, "180 degrees"), (3, "90 degrees counter-clockwise")],
)
def test_turned_frames(quarters, words):
    camera = Camera(720, 720, 700.0, 700.0, 359.5, 359.5, view().R, view().t)
    walk = keypoints(camera)
    turned = _turned(walk, camera.size, quarters)
    assert _lean(camera, walk) == pytest.approx(0.0, abs=10)
    assert f"the frames are turned by {words} against it" in contradiction(camera, turned, MODEL, STATURE)


def test_a_video_turned_against_its_calibration_is_refused():
    with pytest.raises(UserError, match="the video is 720x1280, turned by 90 degrees"):
        view().check_size("c.json", (720, 1280))


def test_parameters_are_those_of_the_camera():
    camera = view(focal=1200.0, tilt=0.2, roll=0.05, height=2.0)
    np.testing.assert_allclose(_parameters(camera), [np.log(1200.0), 0.2, 0.05, np.log(2.0)], atol=1e-5)


def test_what_is_no_walk_is_no_contradiction():
    walk = keypoints(view())
    noise = np.random.default_rng(1).uniform(0, 700, walk.uv.shape)
    assert contradiction(view(), replace(walk, uv=noise), MODEL, STATURE) is None
    others = tuple(f"marker_{k}" for k in range(len(walk.names)))
    assert contradiction(view(), replace(walk, names=others), MODEL, STATURE) is None


@pytest.mark.parametrize("height", [1.5, 1.9])
def test_a_person_an_eighth_too_tall_or_too_short_is_reported(height):
    for share in (0.89, 1.11):
        assert camera_check._wrong_size(share * height, height) is None
    for share in (0.87, 1.13):
        report = camera_check._wrong_size(share * height, height)
        assert report == f"the person appears {share * height:.2f} m tall by it, --height is {height:g}"


def test_a_person_of_unknown_stature_is_of_any_usual_one():
    for stature in (1.41, 2.09):
        assert camera_check._wrong_size(stature, None) is None
    for stature in (1.39, 2.11):
        assert "give --height if that is right" in camera_check._wrong_size(stature, None)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"tilt": 0.08 + np.radians(2.5)}, None),
        ({"roll": np.radians(2.5)}, None),
        ({"focal": 1150.0}, None),
        ({"tilt": 0.08 + np.radians(10)}, "tilt"),
        ({"roll": np.radians(8)}, "roll"),
        ({"focal": 1500.0}, "focal length"),
    ],
)
def test_a_part_is_named_from_its_threshold_on(change, words):
    """The person appears with their true height, so that only the parts of the camera can differ."""
    walk = keypoints(view())
    given = view(**change)
    appears = find_keypoint_start(walk, given, MODEL)
    stature = STATURE if appears is None else appears.mean.stature
    named = camera_check._wrong_part(given, walk, MODEL, stature)
    assert named == (words and f"the walk contradicts its {words}")


def test_a_difference_within_the_uncertainty_of_the_estimate_is_not_reported(monkeypatch):
    """A path across the view leaves the focal length open: only its standard deviation prevents a report."""
    walk, given = keypoints(view(tilt=0.0), ACROSS), view(tilt=0.0, focal=1500.0)
    assert camera_check._wrong_part(given, walk, MODEL, STATURE) is None
    found = calibrate(walk, SIZE, MODEL, STATURE)
    for sd, words in ((0.15, "the walk contradicts its focal length"), (0.25, None)):  # log(1.5) is 0.405
        differs = replace(found, camera=view(tilt=0.0), sd=np.full_like(found.sd, sd))
        monkeypatch.setattr(camera_check, "calibrate", lambda *_, differs=differs, **options: differs)
        assert camera_check._wrong_part(given, walk, MODEL, STATURE) == words


def test_gait_lift_reports_it(tmp_path, capsys):
    write(tmp_path / "k.csv", keypoints(view()))
    write_camera(tmp_path / "wrong.json", view(focal=1500.0))
    words = [
        tmp_path / "k.csv",
        "--camera",
        tmp_path / "wrong.json",
        "--height",
        STATURE,
        "--method",
        "blend",
    ]
    assert main(["lift", *map(str, words), "-o", str(tmp_path / "out.csv")]) == 0
    report = capsys.readouterr().err
    assert f"{tmp_path / 'wrong.json'}: the person appears" in report
    assert "camera from the walk: focal length" in report


def test_gait_track_reports_it(tmp_path, monkeypatch, capsys):
    drawn = camera()
    pictures, states = clip(MODEL, decode(read_blob(None)), 30, view=drawn, heading=-1.2, start=(-0.5, 0.8))
    drawn_person.write(tmp_path / "walk.mp4", pictures)
    uv, frame = np.array([drawn.project(MODEL.pose(state)[0]) for state in states]), np.arange(30)
    write(tmp_path / "k.csv", Keypoints(frame, frame / 30, MODEL.joint_names, uv, np.ones(uv.shape[:2])))
    write_camera(tmp_path / "right.json", drawn)
    write_camera(tmp_path / "wrong.json", camera(focal=1.5 * drawn.fx))
    words = ["track", "walk.mp4", "--keypoints", "k.csv", "--height", "1.75", "--background", "none"]
    words += ["--particles", "60", "-o", "o.csv", "--camera"]
    monkeypatch.chdir(tmp_path)
    reports = []
    for name in ("right", "wrong"):
        assert main([*words, f"{name}.json"]) == 0
        reports.append(capsys.readouterr().err)
    assert "camera from the walk" not in reports[0]
    assert reports[1].startswith("warning: wrong.json: the person appears")
    focal = float(re.search(r"camera from the walk: focal length (\d+) ", reports[1])[1])
    assert abs(focal / drawn.fx - 1) < 0.15


def test_the_summary_states_what_contradicts_the_camera():
    text = "c.json: the walk contradicts its tilt"
    scene = SimpleNamespace(against_camera=text, moved="", motion=None, poses={}, calibration=None)
    assert _camera(ClipOptions("walk.mp4", "c.json", "track.csv"), scene) == text
