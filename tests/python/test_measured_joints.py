"""Joints of a body unlike the model's are moved to where several cameras see them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import gait
from gait.bindings.abi import Flag, TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.frame import FrameKeypoints
from gait.io.video import Frame
from gait.track.measured_joints import MeasuredJoints
from gait.track.person_keypoints import PersonKeypoints

FRAMES, FPS, NOISE = 30, 30, 2.0
MODEL = gait.Model()
NAMES = MODEL.joint_names
SHOWN = [k for k, name in enumerate(NAMES) if name not in ("pelvis", "neck", "head_top")]
CAMERAS = [
    gait.Camera.looking(place, (0.5, 0.0, 0.9), (640, 480), 700.0)
    for place in ((0.5, -5.0, 1.2), (5.5, -2.0, 1.2))
]
SD = 0.026  # metres, of the tracker's joints


def walk() -> tuple[list[Estimate], np.ndarray]:
    """A track, and the joints (T, J, 3) of a body that is unlike the model's, by `SD`."""
    rng = np.random.default_rng(4)
    off = SD * rng.standard_normal((len(NAMES), 3))
    off[NAMES.index("pelvis")] = off[[NAMES.index("l_hip"), NAMES.index("r_hip")]].mean(axis=0)
    track = []
    for k in range(FRAMES):
        state = replace(
            MODEL.prior()[0],
            phase=k / 33,
            heading=0.4,
            stature=1.7,
            pelvis=np.array([0.04 * k, 0, 0.9]),
        )
        joints, nothing = MODEL.pose(state)[0], np.zeros(0)
        track.append(
            Estimate(
                0,
                k,
                TrackStatus.TRACKING,
                Flag(0),
                0.0,
                1.0,
                1.0,
                1.0,
                1.0,
                state,
                state,
                state,
                joints,
                np.full(joints.shape, SD),
                nothing,
                NAMES,
            )  # fmt: skip
        )
    return track, np.array([one.joints for one in track]) + off


def frames(cameras: int) -> list[Frame]:
    """Frames of the first camera, with those of the others."""
    one = [Frame(k, k / FPS, np.zeros((2, 2, 3), np.uint8)) for k in range(FRAMES)]
    return [frame._replace(others=(frame,) * (cameras - 1)) for frame in one]


def keypoints(true: np.ndarray, cameras: int, swapped: range = range(0)) -> PersonKeypoints:
    """What the cameras see, with noise; in the `swapped` frames the last has left and right swapped."""
    rng, views = np.random.default_rng(5), []
    other = [
        NAMES.index({"l_": "r_", "r_": "l_"}[name[:2]] + name[2:]) for name in map(NAMES.__getitem__, SHOWN)
    ]
    for c, camera in enumerate(CAMERAS[:cameras]):
        found = {}
        for k, joints in enumerate(true):
            observed = joints[other if c and k in swapped else SHOWN]
            uv = camera.project(observed) + NOISE * rng.standard_normal((len(SHOWN), 2))
            found[k] = FrameKeypoints([NAMES[j] for j in SHOWN], uv, NOISE)
        views.append(PersonKeypoints(camera, {0: found}, 0))
    return PersonKeypoints(CAMERAS[0], views[0]._keypoints, 0, further=views[1:])


def moved(track: list[Estimate], observed: PersonKeypoints, cameras: int) -> list[Estimate]:
    """The track after the measurement, whose frames must be those before it."""
    pairs = list(MeasuredJoints(CAMERAS[:cameras], observed).moved(zip(frames(cameras), track, strict=True)))
    assert [frame.number for frame, _ in pairs] == list(range(FRAMES))
    return [estimate for _, estimate in pairs]


@pytest.mark.parametrize("swapped", [range(0), range(8, 20)])
def test_two_cameras_move_joints_to_the_persons(swapped: range) -> None:
    track, true = walk()
    after = moved(track, keypoints(true, 2, swapped), 2)
    before = np.array([one.joints for one in track]) - true
    errors = np.array([one.joints for one in after]) - true
    with_pelvis = [*SHOWN, NAMES.index("pelvis")]
    assert np.sqrt((errors[:, with_pelvis] ** 2).mean()) < 0.4 * np.sqrt((before[:, with_pelvis] ** 2).mean())
    rest = [k for k in range(len(NAMES)) if k not in with_pelvis]
    np.testing.assert_array_equal(errors[:, rest], before[:, rest])
    sd = np.array([one.joint_sd for one in after])[:, SHOWN]
    assert (sd < 0.8 * SD).all()
    assert (np.abs(errors[:, SHOWN]) < 1.645 * sd).mean() > 0.85
    assert after[9].mean == track[9].mean  # the state is the tracker's


def test_one_camera_and_lost_frames_change_nothing() -> None:
    track, true = walk()
    for one, before in zip(moved(track, keypoints(true, 1), 1), track, strict=True):
        np.testing.assert_array_equal(one.joints, before.joints)
    lost = [replace(one, status=TrackStatus.LOST) if 10 <= k < 15 else one for k, one in enumerate(track)]
    after = moved(lost, keypoints(true, 2), 2)
    assert all(after[k] is lost[k] for k in range(10, 15))
    assert np.abs(after[9].joints - track[9].joints).max() > 0.01


def test_frames_that_one_camera_missed_fade_to_the_models_joints() -> None:
    track, true = walk()
    observed = keypoints(true, 2)
    films = [frame._replace(others=(None,)) if frame.number >= 15 else frame for frame in frames(2)]
    after = [one for _, one in MeasuredJoints(CAMERAS, observed).moved(zip(films, track, strict=True))]
    moves = [np.abs(one.joints - before.joints).max() for one, before in zip(after, track, strict=True)]
    assert moves[5] > moves[17] > moves[19] > 0.0 and max(moves[22:]) == 0.0
    sd = np.array([one.joint_sd[SHOWN].mean() for one in after])
    assert (np.diff(sd[12:21]) > 0.0).all() and sd[20] < sd[21] == SD  # as fewer frames show it


def test_joints_missed_in_some_frames_move_as_around_them() -> None:
    track, true = walk()
    observed, gap = keypoints(true, 2), [10, 13, 16]
    k, point = SHOWN[4], 4
    for view in (observed, *observed._further):
        for frame in gap:
            view._keypoints[0][frame].uv[point] = np.nan
    whole, after = moved(track, keypoints(true, 2), 2), moved(track, observed, 2)
    for frame in range(8, 19):
        moves = [np.linalg.norm(one[frame].joints[k] - track[frame].joints[k]) for one in (whole, after)]
        assert moves[1] > 0.9 * moves[0]
        assert (after[frame].joint_sd[k] > whole[frame].joint_sd[k]).all()
        rest = np.arange(len(NAMES)) != k
        np.testing.assert_array_equal(after[frame].joints[rest], whole[frame].joints[rest])


def test_estimates_wait_for_a_fifth_of_a_second_only() -> None:
    track, true = walk()
    taken = []

    def source():
        for pair in zip(frames(2), track, strict=True):
            taken.append(pair)
            yield pair

    next(MeasuredJoints(CAMERAS, keypoints(true, 2)).moved(source()))
    assert len(taken) == 8
