"""Corrections by hand of keypoints: the file, its effect on keypoints, and solving parts again."""

import json
from dataclasses import replace

import numpy as np
import pytest
import walking_keypoints
from walking_keypoints import NAMES

from gait.bindings.segment_prior import SegmentPrior
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.lift import run
from gait.lift.keypoints.corrections import (
    CLICK_SD,
    Correction,
    Edits,
    FloorPin,
    Hidden,
    Swap,
    corrected,
    pins,
    read_corrections,
    read_edits,
)
from gait.lift.keypoints.suggestions import FramePosterior
from gait.lift.smooth.interactive import Interactive
from gait.lift.smooth.options import Options
from gait.reproducible import one_thread

PRIOR = SegmentPrior.load(None)
FRAMES = range(0, 60)
TURN = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
CAMERA = Camera(640, 480, 700.0, 700.0, 319.5, 239.5, TURN, np.array([0.0, 1.2, 0.0]))
EVERY = Edits(
    (Correction(7, "l_knee", (10.5, 20.0), 2.0),),
    (Hidden(3, 5, "r_ankle"),),
    (Swap(20, 22),),
    (FloorPin(9, "l_heel", (300.0, 400.0)),),
)


def written(tmp_path, content):
    path = tmp_path / "c.json"
    path.write_text(json.dumps(content))
    return path


def keypoints(**more):
    rng = np.random.default_rng(1)
    uv = rng.uniform(100, 400, (60, len(NAMES), 2))
    return Keypoints(np.arange(60), np.arange(60) / 30, NAMES, uv, np.ones(uv.shape[:2]), **more)


def test_every_kind_survives_writing(tmp_path):
    assert read_edits(written(tmp_path, EVERY.as_json()), PRIOR, FRAMES) == EVERY
    assert read_edits(written(tmp_path, Edits().as_json()), PRIOR, FRAMES) == Edits()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"hiden": []}, "hiden is not a known key"),
        ({}, "corrections is missing"),
        ({"hidden": [{"first": 5, "last": 3, "joint": "l_knee"}]}, "hidden entry 1: last is 3, before first"),
        ({"swapped": [{"first": 5, "last": 60}]}, "swapped entry 1: last is 60"),
        ({"floor": [{"frame": 5, "joint": "l_knee", "uv": [1, 2]}]}, "only a toe, heel or ankle"),
        (
            {"floor": [{"frame": 5, "joint": "l_toe", "uv": [1, 2]}] * 2},
            "floor entry 2 pins l_toe",
        ),
        ({"swapped": {}}, "swapped is not a list"),
    ],
)
def test_a_wrong_entry_is_named(tmp_path, content, words):
    with pytest.raises(UserError, match=words):
        read_edits(written(tmp_path, content), PRIOR, FRAMES)


def test_pictures_take_corrections_alone(tmp_path):
    with pytest.raises(UserError, match="hidden is for keypoints"):
        read_corrections(written(tmp_path, EVERY.as_json()), PRIOR, 60)


def test_nothing_corrected_is_nothing_changed():
    points = keypoints()
    assert corrected(points, Edits(), 3.0) is points


def test_a_correction_is_a_point_of_its_own_noise():
    points = keypoints(lasting_sd=np.full((60, len(NAMES)), 2.0))
    found = corrected(points, Edits((Correction(7, "l_knee", (10.5, 20.0), 0.7),)), 3.0)
    knee = NAMES.index("l_knee")
    assert found.uv[7, knee] == pytest.approx([10.5, 20])
    for sd in (found.standard_deviations(3.0), found.changing(3.0), found.errors(3.0)):
        assert sd[7, knee] == pytest.approx(0.7)
    assert (points.uv[7, knee] != found.uv[7, knee]).any()  # the original stays as it was


def test_points_around_a_correction_are_less_certain_by_its_error():
    points = keypoints()
    knee, off = NAMES.index("l_knee"), np.array([40.0, 30.0])
    edits = Edits((Correction(30, "l_knee", tuple(points.uv[30, knee] + off), 1.0),))
    sd = corrected(points, edits, 3.0).changing(3.0)
    assert sd[31, knee] > 25 and sd[29, knee] > 25  # 50 pixels, along each of two axes
    assert sd[31, knee] > sd[36, knee] > sd[45, knee] and sd[59, knee] == pytest.approx(3.0, abs=0.5)
    assert sd[31, NAMES.index("r_knee")] == 3.0


def test_a_confirmed_point_changes_nothing_around_it():
    points = keypoints()
    knee = NAMES.index("l_knee")
    edits = Edits((Correction(30, "l_knee", tuple(points.uv[30, knee] + 1.0), 1.0),))
    assert corrected(points, edits, 3.0).changing(3.0)[31, knee] == 3.0


def test_a_detector_errs_about_a_foot_as_a_whole():
    points, names = keypoints(), NAMES
    ankle = names.index("l_ankle")
    edits = Edits((Correction(30, "l_ankle", tuple(points.uv[30, ankle] + 30.0), 1.0),))
    sd = corrected(points, edits, 3.0).changing(3.0)
    assert sd[31, names.index("l_toe")] == sd[31, ankle] > 20
    assert sd[31, names.index("r_toe")] == sd[31, names.index("l_knee")] == 3.0


def test_hidden_points_are_left_out_and_sides_swapped():
    points = keypoints()
    left, right = NAMES.index("l_hip"), NAMES.index("r_hip")
    found = corrected(points, Edits(hidden=(Hidden(3, 5, "r_ankle"),), swapped=(Swap(20, 22),)), 3.0)
    assert not found.visible[3:6, NAMES.index("r_ankle")].any() and found.visible.sum() == 60 * len(NAMES) - 3
    assert (found.uv[20:23, left] == points.uv[20:23, right]).all()
    assert (found.uv[19, left] == points.uv[19, left]).all()


def test_a_joint_that_the_detector_does_not_know_gets_a_column():
    found = corrected(keypoints(), Edits((Correction(7, "head_top", (10.0, 20.0)),)), 3.0)
    assert found.names == (*NAMES, "head_top") and found.visible[:, -1].sum() == 1
    assert found.changing(3.0)[7, -1] == CLICK_SD


def test_a_pin_stands_where_the_pixel_shows_the_floor():
    foot = np.array([0.3, 4.0, 0.0])
    pin = FloorPin(9, "l_heel", tuple(CAMERA.project(foot)), 1.0)
    found = pins(keypoints(), Edits(floor=(pin,)), CAMERA, PRIOR)
    assert found.place[0, :2] == pytest.approx(foot[:2], abs=1e-6) and 0 < found.place[0, 2] < 0.15
    assert found.row.tolist() == [9]
    with pytest.raises(UserError, match="needs a calibrated camera"):
        pins(keypoints(), Edits(floor=(pin,)), None, PRIOR)
    above = Edits(floor=(replace(pin, uv=(300.0, 5.0)),))
    with pytest.raises(UserError, match="l_heel in frame 9 is not on the floor"):
        pins(keypoints(), above, CAMERA, PRIOR)


@pytest.fixture(scope="module")
def walk():
    """Keypoints of 3 s of a walk across the view, a foot wrong for a while; and the true positions."""
    points = walking_keypoints.keypoints(CAMERA, walking_keypoints.ACROSS, noise=0.5)
    truth = walking_keypoints.keypoints(CAMERA, walking_keypoints.ACROSS, noise=0.0).uv
    uv = points.uv.copy()
    foot = [NAMES.index(name) for name in ("l_ankle", "l_toe", "l_heel")]
    uv[15:23, foot] += [0.0, -18.0]
    return truth, replace(points, uv=uv)


@pytest.fixture(scope="module")
def lifted(walk):
    request = run.Request(Options(), hints=False)
    prepared = run.Prepared(walk[1], run.Perspective(CAMERA), Options(), {"spikes": 0})
    return request, prepared, run.lift_prepared("k.csv", prepared, Edits(), PRIOR, request, True)


def test_a_correction_moves_the_figure_there_and_the_part_agrees_with_the_whole(walk, lifted):
    truth, points = walk
    request, prepared, before = lifted
    ankle = NAMES.index("l_ankle")
    edits = Edits((Correction(19, "l_ankle", tuple(truth[19, ankle]), 1.0),))
    whole = run.lift_prepared("k.csv", prepared, edits, PRIOR, request, True).motion
    column = whole.names.index("l_ankle")
    miss = [np.linalg.norm(m.uv[19, column] - truth[19, ankle]) for m in (before.motion, whole)]
    assert miss[0] > 6 and miss[1] < 3
    live = Interactive(PRIOR, prepared.view, prepared.options, points.names, before.motion)
    with one_thread():
        part = live.solve(corrected(points, edits, 3.0), None, range(19, 20))
    row = int(np.flatnonzero(part.rows == 19)[0])
    assert np.linalg.norm(part.uv[row, column] - truth[19, ankle]) < 3
    # One view leaves the distance open, and the whole moves it; the body is the same.
    bodies = [places - places[:, :1] for places in (part.places, whole.places[part.rows])]
    assert np.linalg.norm(bodies[0] - bodies[1], axis=2).mean() < 0.02
    assert 10 < len(part.rows) < len(points.time)  # no more than it has to


def test_a_removed_correction_puts_the_part_back(walk, lifted):
    truth, points = walk
    _, prepared, before = lifted
    edits = Edits((Correction(19, "l_ankle", tuple(truth[19, NAMES.index("l_ankle")]), 1.0),))
    live = Interactive(PRIOR, prepared.view, prepared.options, points.names, before.motion)
    with one_thread():
        moved = live.solve(corrected(points, edits, 3.0), None, range(19, 20))
        back = live.solve(points, None, range(19, 20))
    was = before.motion.places[back.rows]
    assert np.linalg.norm(moved.places - was, axis=2).max() > 0.05
    assert np.linalg.norm(back.places - was, axis=2).max() < 0.02


def test_a_pinned_foot_stands_on_its_point(walk, lifted):
    request, prepared, before = lifted
    column = before.motion.names.index("r_heel")
    at = before.motion.places[19, column] + [0.0, 0.15, 0.0]
    edits = Edits(floor=(FloorPin(19, "r_heel", tuple(CAMERA.project(np.array([*at[:2], 0.0]))), 0.5),))
    found = run.lift_prepared("k.csv", prepared, edits, PRIOR, request, True).motion
    off = [np.linalg.norm(m.places[19, column, :2] - at[:2]) for m in (before.motion, found)]
    assert off[1] < 0.5 * off[0]


def test_the_gain_of_a_correction_is_the_variance_that_it_takes():
    rng = np.random.default_rng(0)
    half = rng.normal(size=(6, 6))
    posterior = FramePosterior(np.arange(2), rng.normal(size=(2, 3, 2, 6)), half @ half.T)
    before, gain = (posterior.off**2).sum(), posterior.gain[1, 2]
    assert posterior.best(0.0)[0] == posterior.gain.max()
    posterior.correct(1, 2, CLICK_SD)
    assert before - (posterior.off**2).sum() == pytest.approx(gain)
