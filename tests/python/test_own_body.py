"""The person's own body: joints that are elsewhere than in the model are found by two cameras."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import gait
from gait.bindings.abi import Flag, TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.model import read_cyclic
from gait.body import skeleton
from gait.body.displaced import PARTS, displaced, effects
from gait.errors import UserError
from gait.io import blob
from gait.io.keypoints_file import Keypoints
from gait.track import own_body
from gait.track.options import ClipOptions

FRAMES = 60
NAMES = [f"{s}_{joint}" for s in "lr" for joint in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")]
NAMES += [f"{s}_{joint}" for s in "lr" for joint in ("heel", "toe")]
MOVES = np.zeros((len(PARTS), 3))
MOVES[PARTS.index("shank")] = -0.02, 0.0, 0.01  # knees behind and above where the model has them, statures
MOVES[PARTS.index("upper_arm")] = 0.015, -0.01, 0.0


def test_joints_move_by_their_displacements_and_feet_stay_on_the_floor() -> None:
    sections = read_cyclic(None)
    cycle = np.asarray(sections["CURV"], float)[0]
    moved = displaced(sections, MOVES)
    change = skeleton.points(moved, cycle) - skeleton.points(sections, cycle)
    np.testing.assert_allclose(change, effects(sections, cycle) @ MOVES.ravel(), atol=1e-6)
    names = blob.unpack_names(sections["PTNM"])
    soles = [names.index(f"{side}_{part}") for side in "lr" for part in ("toe", "heel")]
    height = blob.unpack_names(sections["CHNM"]).index("root_height")
    low = [
        (
            np.asarray(one["CURV"], float)[0, :, height] + skeleton.points(one, cycle)[:, soles, 2].min(1)
        ).mean()
        for one in (sections, moved)
    ]
    assert low[0] == pytest.approx(low[1], abs=1e-3)


def test_two_cameras_show_where_joints_are() -> None:
    """Keypoints of a displaced body: half of the error of knees and shoulders goes, and none comes."""
    sections, plain = read_cyclic(None), gait.Model()
    body = gait.Model(blob.encode(displaced(sections, MOVES)))
    states = [
        replace(
            plain.prior()[0], phase=k / 33 % 1, heading=0.4, stature=1.7, pelvis=np.array([0.04 * k, 0, 0.9])
        )
        for k in range(FRAMES)
    ]
    order = [plain.joint_names.index(name) for name in NAMES]
    true = np.array([body.pose(state)[0] for state in states])[:, order]
    found = own_body._displacements(sections, *_scene(plain, states, true))
    joints = np.array([plain.pose(state)[0] for state in states])[:, order]
    after = np.array([gait.Model(blob.encode(displaced(sections, found))).pose(s)[0] for s in states])[
        :, order
    ]
    for name in ("l_knee", "r_shoulder"):
        k, hip = NAMES.index(name), NAMES.index("l_hip")
        off = [
            np.linalg.norm((x[:, k] - x[:, hip]) - (true[:, k] - true[:, hip]), axis=1)
            for x in (joints, after)
        ]
        assert off[0].mean() > 0.02 and off[1].mean() < 0.5 * off[0].mean()
    nothing = own_body._displacements(sections, *_scene(plain, states, joints))
    assert np.abs(nothing).max() < 1e-4


def _scene(
    model: gait.Model, states: list[gait.State], joints: np.ndarray
) -> tuple[SimpleNamespace, own_body.FirstPass]:
    """Two cameras that see `joints`, and a track in `states`."""
    first = own_body.FirstPass()
    for k, state in enumerate(states):
        nothing = np.zeros(0)
        estimate = Estimate(
            0, k, TrackStatus.TRACKING, Flag(0), 0.0, 1.0, 1.0, 1.0, 1.0, state, state, state,
            model.pose(state)[0], nothing, nothing, model.joint_names,
        )  # fmt: skip
        first.add(SimpleNamespace(number=k, others=(SimpleNamespace(number=k),)), estimate)
    scenes = []
    for place in ((1.0, -6.0, 1.2), (6.0, -3.0, 1.2)):
        camera = gait.Camera.looking(place, (1.0, 0.0, 0.9), (640, 480), 700.0)
        uv = camera.project(joints.reshape(-1, 3)).reshape(*joints.shape[:2], 2)
        sd = np.full(uv.shape[:2], 2.0)
        keypoints = Keypoints(
            np.arange(FRAMES), np.arange(FRAMES) / 30, tuple(NAMES), uv, np.ones(uv.shape[:2]), sd, sd
        )
        scenes.append(SimpleNamespace(camera=camera, people={3: keypoints}, person=3, further=()))
    scenes[0].further = (scenes[1],)
    return scenes[0], first


def test_too_few_frames_are_one_line() -> None:
    options = ClipOptions("walk.mp4", "camera.json", "track.csv", own_body=True)
    with pytest.raises(UserError, match="walk.mp4: --body auto: 0 frames are tracked, 15 are needed"):
        own_body.own_model(options, SimpleNamespace(), own_body.FirstPass())


def test_frames_without_strides_do_not_count() -> None:
    """Their phase is not a number, and so would be the body's."""
    model = gait.Model()
    _, first = _scene(model, [model.prior()[0]], np.zeros((1, len(NAMES), 3)))
    [estimate] = first.estimates
    stands = replace(estimate, mean=replace(estimate.mean, phase=float("nan")))
    for one in (stands, estimate):
        first.add(SimpleNamespace(number=1, others=()), one)
    assert first.estimates == [estimate, estimate]
