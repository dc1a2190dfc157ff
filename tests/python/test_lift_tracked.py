"""Joints of a track from one camera, half-way to those that its keypoints are lifted to."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from drawn_person import camera, clip, wall, write

import gait
from gait.bindings.abi import Flag, TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.model import read_blob, read_cyclic
from gait.body.displaced import PARTS, displaced
from gait.body.skeleton import other_sides
from gait.cli import main
from gait.errors import UserError
from gait.io import blob, keypoints_file
from gait.io.keypoints_file import Keypoints
from gait.io.track_file import read_estimates
from gait.lift import tracked
from gait.lift.smooth.motion import Motion
from gait.lift.tracked import TrackedAndLifted, every_frame, half_lifted
from gait.track.clip import track_clip
from gait.track.options import ClipOptions

MODEL = gait.Model()
NAMES = tuple(MODEL.joint_names)
VIEW = gait.Camera.looking((1.0, -6.0, 1.2), (1.0, 0.0, 0.9), (640, 480), 700.0)
MOVES = np.zeros((len(PARTS), 3))
MOVES[PARTS.index("shank")] = -0.02, 0.0, 0.01  # statures
HIPS = [NAMES.index("l_hip"), NAMES.index("r_hip")]


@pytest.fixture(scope="module")
def pose() -> tuple[Estimate, np.ndarray]:
    """Return an estimate, and the joints of a person with other knees in that pose."""
    state = replace(MODEL.prior()[0], phase=0.3, heading=0.4, stature=1.7, pelvis=np.array([0.5, 0.3, 0.9]))
    nothing = np.zeros(0)
    estimate = Estimate(
        0, 0, TrackStatus.TRACKING, Flag(0), 0.0, 1.0, 1.0, 1.0, 1.0, state, state, state,
        MODEL.pose(state)[0], nothing, nothing, MODEL.joint_names,
    )  # fmt: skip
    person = gait.Model(blob.encode(displaced(read_cyclic(None), MOVES)))
    return estimate, np.array(person.pose(state)[0])


@pytest.mark.parametrize(
    ("turn_rate", "walks", "share"), [(-0.3, 1.0, 0.5), (0.4, 1.0, 0.0), (0.1, 0.3, 0.3)]
)
def test_only_people_who_walk_straight_on_are_moved(
    pose: tuple[Estimate, np.ndarray], turn_rate: float, walks: float, share: float
) -> None:
    estimate, person = pose
    knee = NAMES.index("l_knee")
    whole = moved(estimate, person)[knee] - estimate.joints[knee]
    turning = replace(
        estimate,
        mean=replace(estimate.mean, turn_rate=turn_rate),
        class_probability=np.array([1.0 - walks, walks]),
    )
    found = moved(turning, person, classes=("run", "walk"))[knee] - estimate.joints[knee]
    np.testing.assert_allclose(found, share * whole, atol=1e-9)
    np.testing.assert_array_equal(moved(turning, person, classes=("run", "hop")), estimate.joints)


def keypoints(frames: int, visible: list[int]) -> Keypoints:
    """Keypoints in some of `frames` frames, and rows without any in the others."""
    uv = np.full((frames, len(NAMES), 2), np.nan)
    uv[visible] = 100.0
    return Keypoints(np.arange(frames), np.arange(frames) / 30, NAMES, uv, np.ones(uv.shape[:2]))


def moved(
    estimate: Estimate, lifted: np.ndarray, number: int = 0, classes: tuple[str, ...] = ("walk",)
) -> np.ndarray:
    """Joints of an estimate of frame `number`, of which frame 0 is lifted."""
    motion = SimpleNamespace(names=NAMES, places=lifted[None])
    mover = TrackedAndLifted(VIEW, keypoints(1, [0]), motion, classes)
    [(_, found)] = mover.moved([(SimpleNamespace(number=number), estimate)])
    assert found.mean is estimate.mean and found.status == estimate.status
    return found.joints


def test_joints_are_half_way_to_the_persons(pose: tuple[Estimate, np.ndarray]) -> None:
    estimate, person = pose
    np.testing.assert_allclose(moved(estimate, person), (estimate.joints + person) / 2, atol=5e-3)
    knee = NAMES.index("l_knee")
    before, after = (
        np.linalg.norm((one - person)[knee]) for one in (estimate.joints, moved(estimate, person))
    )
    assert before > 0.03 and after < 0.6 * before


def test_the_depth_is_the_trackers(pose: tuple[Estimate, np.ndarray]) -> None:
    """A lift that places the same body half a metre further away on the line of sight changes nothing."""
    estimate, _ = pose
    way = estimate.joints[HIPS].mean(axis=0) - VIEW.centre
    away = estimate.joints + 0.5 * way / np.linalg.norm(way)
    np.testing.assert_allclose(moved(estimate, away), estimate.joints, atol=1e-9)


@pytest.mark.parametrize("case", ["legs swapped", "lost", "another frame", "no number"])
def test_where_they_disagree_or_one_is_absent_the_joints_stay(
    pose: tuple[Estimate, np.ndarray], case: str
) -> None:
    estimate, person = pose
    if case == "legs swapped":
        person = person[other_sides(NAMES)]
    if case == "no number":
        person = np.full_like(person, np.nan)
    if case == "lost":
        estimate = replace(estimate, status=TrackStatus.LOST)
    joints = moved(estimate, person, 1 if case == "another frame" else 0)
    np.testing.assert_array_equal(joints, estimate.joints)


def test_the_weight_falls_gradually(pose: tuple[Estimate, np.ndarray]) -> None:
    """All joints but the hips are further and further to the left: each a bit less than before."""
    estimate, _ = pose
    shares = []
    for off in (0.05, 0.08, 0.12, 0.14, 0.17):
        lifted = estimate.joints + np.array([0.0, off, 0.0])
        lifted[HIPS] = estimate.joints[HIPS]
        shares.append(float(np.median((moved(estimate, lifted) - estimate.joints)[:, 1])) / off)
    np.testing.assert_allclose(shares, [0.5, 0.5, 0.25, 0.125, 0.0], atol=1e-6)


def test_frames_without_keypoints_are_lifted_too_and_the_weight_falls_in_a_gap(
    pose: tuple[Estimate, np.ndarray],
) -> None:
    """Keypoints in every second of 20 frames, then in none: the whole weight for 0.1 s, none after 0.3 s."""
    estimate, person = pose
    motion = SimpleNamespace(names=NAMES, places=np.repeat(person[None], 40, axis=0))
    mover = TrackedAndLifted(VIEW, keypoints(40, list(range(0, 20, 2))), motion)
    found = mover.moved((SimpleNamespace(number=number), estimate) for number in range(40))
    knee = NAMES.index("l_knee")
    moves = np.array([np.linalg.norm((now.joints - estimate.joints)[knee]) for _, now in found])
    whole = moves[0]
    np.testing.assert_allclose(moves[:22] / whole, 1.0)
    assert np.all(np.diff(moves[21:28]) < 0) and np.all(moves[28:] == 0)


def test_only_frames_to_track_and_a_second_around_are_lifted() -> None:
    """In rows of their own, also where the file has none."""
    given = keypoints(200, list(range(200))).part(slice(0, 200, 2))
    found = every_frame(given, range(60, 90), np.arange(200) / 30)
    assert set(range(31, 119)) <= set(found.frame.tolist()) <= set(range(30, 121))
    assert found.visible.any(axis=1).tolist() == [number % 2 == 0 for number in found.frame.tolist()]
    assert np.array_equal(found.time, found.frame / 30)


@pytest.mark.parametrize("fault", [{"wider": 2.0}, {"alone": True}, {"resized": 0.9}, {}])
def test_a_lift_unlike_those_learnt_moves_nothing(
    fault: dict[str, float], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = keypoints(30, list(range(30)))
    nothing = np.zeros(0)
    fit = (nothing, nothing, nothing, nothing, 1.75, 3, True, 0.0, nothing)
    motion = Motion(NAMES, *fit, **fault)
    monkeypatch.setattr(tracked, "lift_keypoints", lambda *_: SimpleNamespace(motion=motion, keypoints=found))
    scene = SimpleNamespace(
        poses={}, people={0: found}, person=0, camera=VIEW, frames=range(30), model=MODEL,
        video=SimpleNamespace(times=np.arange(30) / 30),
    )  # fmt: skip
    mover = half_lifted(ClipOptions("walk.mp4", "camera.json", "track.csv", own_body=True), scene)
    assert (mover is iter) == bool(fault)
    assert ("the joints are the tracker's alone" in capsys.readouterr().err) == bool(fault)


def test_from_python_one_film_needs_the_lift() -> None:
    with pytest.raises(ValueError, match="own_body: one film needs joints_of"):
        track_clip(ClipOptions("walk.mp4", "camera.json", "track.csv", own_body=True))


def test_moving_cameras_and_absent_people_are_one_line() -> None:
    options = ClipOptions("walk.mp4", "camera.json", "track.csv", own_body=True)
    with pytest.raises(
        UserError, match=r"walk.mp4: --body auto: .* the camera must stand still; leave it out"
    ):
        half_lifted(options, SimpleNamespace(poses={0: None}))
    with pytest.raises(UserError, match=r"walk.mp4: --body auto: no person is detected; leave it out"):
        half_lifted(options, SimpleNamespace(poses={}, people={}, person=-1))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--detector", "none"], "--body auto: needs the detector or --keypoints"),
        (["--mode", "paper"], "--body auto: paper mode uses no keypoints"),
        (["--people", "2"], "--people: everyone has the model's body; leave out --body"),
        (["--smooth", "--draws", "d.npz"], "leave out --draws"),
        (["--stabilize", "auto"], "leave out --draws, --camera-path and --stabilize auto"),
    ],
)
def test_options_that_exclude_it(options: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    line = ["track", "walk.mp4", "--camera", "c.json", "--body", "auto", "-o", "track.csv", *options]
    assert main(line) == 2
    assert words in capsys.readouterr().err


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Clip of 40 frames, and keypoints of a person whose knees are elsewhere than the model's."""
    out = tmp_path_factory.mktemp("tracked")
    sections = blob.decode(read_blob(None))
    pictures, states = clip(MODEL, sections, 40)
    write(out / "walk.mp4", pictures)
    cv2.imwrite(str(out / "plate.png"), wall())
    (out / "camera.json").write_text(json.dumps(camera().to_dict()))
    person = gait.Model(blob.encode(displaced(read_cyclic(None), MOVES)))
    joints = np.array([person.pose(state)[0] for state in states])
    uv = camera().project(joints.reshape(-1, 3)).reshape(*joints.shape[:2], 2)
    found = Keypoints(np.arange(40), np.arange(40) / 30, NAMES, uv, np.ones(uv.shape[:2]))
    keypoints_file.write(out / "keypoints.csv", found)
    np.save(out / "joints.npy", joints)
    return out


def test_a_person_with_other_knees_is_nearer(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`gait track --body auto` of one film; without it the track is the same but for the joints."""
    words = ["track", folder / "walk.mp4", "--camera", folder / "camera.json", "--quiet", "--json"]
    words += ["--background", folder / "plate.png", "--keypoints", folder / "keypoints.csv", "--height", 1.75]
    tracks, rows = [], []
    for name, more in (("plain", []), ("own", ["--body", "auto"])):
        assert main([str(word) for word in (*words, "-o", folder / f"{name}.csv", *more)]) == 0
        assert json.loads(capsys.readouterr().out)["followed"]
        tracks.append(read_estimates(folder / f"{name}.csv"))
        with (folder / f"{name}.csv").open() as file:
            rows.append(list(csv.DictReader(line for line in file if not line.startswith("#"))))
    joints = {f"{name}_{axis}" for name in NAMES for axis in "xyz"}
    for one, other in zip(*rows, strict=True):
        assert {key for key in one if one[key] != other[key]} <= joints
    true = np.load(folder / "joints.npy")
    knees = [NAMES.index("l_knee"), NAMES.index("r_knee")]
    errors = []
    for track in tracks:
        off = np.stack([track.places[name] for name in NAMES], axis=1) - true[track.frame]
        pose = off - off[:, HIPS].mean(axis=1, keepdims=True)
        errors.append(float(np.median(np.linalg.norm(pose[:, knees], axis=2))))
    assert errors[1] < 0.9 * errors[0]
