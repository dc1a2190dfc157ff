"""A camera is found from projected walks, with the uncertainty that the walk leaves."""

import json
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from walking_keypoints import ACROSS, MODEL, NAMES, SIZE, TOWARDS, keypoints, view

from gait.camera.camera import read_camera
from gait.cli import main
from gait.detect import profile
from gait.detect.people import by_size
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints, write
from gait.simulate.scenario import Scenario
from gait.simulate.stage import set_stage
from gait.track.clip_camera import calibrate_clip
from gait.track.from_walk import calibrate
from gait.track.options import ClipOptions
from gait.track.walk_model import WalkingBody
from gait.track.walk_start import swap_sides


@cache
def calibrated(walk=TOWARDS, **truth):
    """Camera found from a walk in front of a camera; found once for all tests."""
    return calibrate(keypoints(view(**truth), walk), SIZE, MODEL, 1.75)


@pytest.mark.parametrize(
    "truth",
    [
        {},
        {"focal": 1500.0, "height": 1.0, "tilt": 0.0},
        {"focal": 800.0, "height": 1.8, "tilt": 0.2, "roll": 0.03},
    ],
    ids=["phone", "long", "wide"],
)
def test_a_walk_towards_the_camera_gives_all_of_it(truth):
    camera = view(**truth)
    found = calibrated(**truth)
    focal, height = (
        np.log(found.camera.fx / camera.fx),
        np.log(found.camera.centre[2] / camera.centre[2]),
    )
    assert abs(focal) < 0.15 and abs(height) < 0.08
    assert abs(found.tilt - truth.get("tilt", 0.08)) < np.radians(1.5)
    off = np.array(
        [
            focal,
            found.tilt - truth.get("tilt", 0.08),
            found.roll - truth.get("roll", 0.0),
            height,
        ]
    )
    assert (np.abs(off) < 2.6 * found.sd).all(), (off, found.sd)
    assert len(found.describe()) == 1 and not found.in_place


def test_a_straight_path_across_leaves_the_focal_length_open():
    camera = view()
    across, towards = calibrated(ACROSS), calibrated()
    assert across.sd[0] > 1.5 * towards.sd[0]
    assert abs(np.log(across.camera.fx / camera.fx)) < 2 * across.sd[0]
    given = calibrate(keypoints(camera, ACROSS), SIZE, MODEL, 1.75, fov=65.2)
    assert given.sd[0] < 0.06 and given.camera.fx == pytest.approx(1000, rel=0.1)


def test_the_uncertainty_covers_the_path():
    found = calibrated()
    heading, place = TOWARDS
    way = 1.25 * found.time[:, None] * [np.cos(heading), np.sin(heading)]
    off = found.path[:, :2] - (np.array(place) + way)
    sd = np.linalg.norm(found.path_change[:, :2], axis=2)
    assert (np.abs(off) < 3 * np.hypot(sd, 0.1)).all() and sd.max() > 0.05


def test_a_walk_in_a_circle_gives_the_camera():
    stage = set_stage(Scenario(view="circle", frames=110, distance=7.5, stature=1.72, speed=1.2, seed=208))
    places = stage.walk.points(stage.frames)
    uv = np.stack([stage.camera.project(places[name]) for name in NAMES], axis=1)
    frame = np.arange(len(uv))
    walk = Keypoints(frame, frame / 30.0, NAMES, uv, np.ones(uv.shape[:2]))
    found = calibrate(walk, stage.camera.size, MODEL, 1.72)
    assert found.camera.fx == pytest.approx(stage.camera.fx, rel=0.15)
    assert found.camera.centre[2] == pytest.approx(stage.camera.centre[2], rel=0.08)


def test_the_pelvis_sways_so_that_feet_stand_still():
    body = WalkingBody(MODEL, NAMES)
    phase = np.linspace(0.12, 0.38, 20)
    ankle = body.joints(phase, np.full(20, body.rate), np.zeros(body.parts), np.zeros(body.offsets))[
        :, body.names.index("r_ankle"), 1
    ]
    assert np.ptp(ankle) < 0.002


def test_a_lean_grows_with_height_and_an_offset_is_of_one_joint():
    body = WalkingBody(MODEL, NAMES)
    shoulder, hip, ankle = (body.names.index(f"l_{joint}") for joint in ("shoulder", "hip", "ankle"))

    def moved(parts, offsets):
        plain = np.zeros(body.parts), np.zeros(body.offsets)
        phase, rate = np.array([0.2]), np.array([body.rate])
        return (body.joints(phase, rate, parts, offsets) - body.joints(phase, rate, *plain))[0]

    lean = np.zeros(body.parts)
    lean[-3] = 1.0
    forward = moved(lean, np.zeros(body.offsets))[:, 0]
    assert 0 < forward[ankle] < 0.3 * forward[hip] < 0.3 * forward[shoulder]
    offset = np.zeros((len(body.names), 3))
    offset[shoulder] = 0.01, 0.0, 0.02
    change = moved(np.zeros(body.parts), offset.ravel())
    assert change[shoulder] == pytest.approx([0.01, 0.0, 0.02])
    assert not np.delete(change, shoulder, axis=0).any()
    sd = body.offset_sd.reshape(-1, 3)
    assert sd[shoulder, 0] == profile.load("full").joint("l_shoulder").lasting_sd > sd[ankle, 0]


def test_of_several_people_one_who_walks_gives_the_camera():
    film, options = (
        SimpleNamespace(path="v.mp4", size=SIZE, fps=15),
        ClipOptions("v.mp4", None, "t.csv", height=1.75, fov=65.2),
    )
    walks, stands = keypoints(view()), keypoints(view(), (0.0, (0.0, 3.0)), standing=True)
    people = {1: walks, 2: stands}
    assert by_size(people)[0] == 2  # nearer
    person, found = calibrate_clip(options, film, MODEL, people, None)
    assert person == 1 and found.camera.fx == pytest.approx(1000, rel=0.1)
    with pytest.raises(UserError, match="the person stands"):
        calibrate_clip(options, film, MODEL, {2: stands}, None)


def test_a_treadmill_is_in_place():
    camera = view()
    found = calibrate(keypoints(camera, (0.4, (0.0, 3.5)), belt=1.25), SIZE, MODEL, 1.75)
    assert found.in_place and found.sd[0] > 0.1
    assert np.ptp(found.path[:, :2], axis=0).max() < 0.1
    assert found.sd[0] < 0.2 or "a walk in place determines the focal length poorly" in found.describe()[1]
    assert abs(np.log(found.camera.fx / camera.fx)) < 2 * found.sd[0]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"seconds": 0.13}, "for less than a second"),
        ({"standing": True}, "the person stands"),
    ],
    ids=["two frames", "standing"],
)
def test_what_is_no_walk_is_refused(change, words):
    with pytest.raises(UserError, match=words):
        calibrate(keypoints(view(), **change), SIZE, MODEL, 1.75)


@pytest.mark.long
@pytest.mark.parametrize("share", [0.3, 1.0], ids=["some frames", "all frames"])
def test_sides_that_a_detector_swaps_are_put_right(share):
    away = 1.8, (0.3, 3.6)
    walk, right = keypoints(view(), away), calibrated(away)
    wrong = np.random.default_rng(3).uniform(size=len(walk.time)) < share
    found = calibrate(swap_sides(walk, wrong), SIZE, MODEL, 1.75)
    assert found.camera.fx == pytest.approx(right.camera.fx, rel=0.02)
    assert found.sd == pytest.approx(right.sd, rel=0.1)


def test_noise_is_refused():
    walk = keypoints(view())
    uv = np.random.default_rng(1).uniform(0, 700, walk.uv.shape)
    with pytest.raises(UserError, match="no second of it fits"):
        calibrate(replace(walk, uv=uv), SIZE, MODEL, 1.75)


def test_the_command_writes_the_camera(tmp_path, capsys):
    write(tmp_path / "k.csv", keypoints(view()))
    words = [
        "camera",
        "--walk",
        tmp_path / "k.csv",
        "--size",
        "1280x720",
        "-o",
        tmp_path / "c.json",
    ]
    assert main([*map(str, words), "--height", "1.75", "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    camera = read_camera(str(tmp_path / "c.json"))
    assert camera.fx == pytest.approx(figures["focal_px"]) and figures["height_m_sd"] > 0
    assert camera.centre[2] == pytest.approx(1.4, rel=0.08) and camera.size == SIZE


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--walk", "k.csv", "--height", "1.75"], "give the size of the picture"),
        (["--walk", "walk.mp4"], "needs --height M"),
        (["p.csv", "--lens", "l.yaml", "--fov", "60"], "go with --walk"),
        ([], "give POINTS.csv and --lens FILE, or --walk VIDEO"),
    ],
)
def test_options_that_do_not_fit(words, text, capsys):
    assert main(["camera", *words, "-o", "camera.json"]) == 2
    assert text in capsys.readouterr().err
