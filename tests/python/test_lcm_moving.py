"""gait-trackd --moving-camera: poses on GAIT_CAMERA_<i>, and the frames between them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import lcm_rig as rig
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gait.bindings.abi import Flag
from gait.bindings.config import TrackerConfig
from gait.camera.path import CameraPose, write_path
from gait.cli import main
from gait.lcm.link import gaitmsg
from gait.lcm.messages import camera_message, image_message
from gait.track.tracker import Tracker

FRAMES, LATE = 15, 9_000  # microseconds by which the second camera's frames are later
LACKS = range(5, 10)  # frames whose poses the second camera does not send
PRINTED = re.compile(r"poses_refused (\d+) frames_without_pose (\d+)")


def camera_at(frame: float) -> rig.Camera:
    """The camera moves along with the person at 1 m/s and turns away by 0.2 rad/s."""
    seconds = frame / rig.FPS
    R = rig.CAMERA.R @ Rotation.from_rotvec([0, 0, -0.2 * seconds]).as_matrix()
    return replace(rig.CAMERA, R=R, t=-R @ (rig.CAMERA.centre + [seconds - 0.3, 0, 0]))


@cache
def picture(frame: int) -> np.ndarray:
    ids = rig.model().render(camera_at(frame), rig.person(frame))
    colours = np.random.default_rng(2).integers(0, 255, (256, 3), np.uint8)
    return np.where(ids[..., None] > 0, colours[ids], rig.plate())


def image(frame: int) -> rig.Event:
    return "GAIT_IMAGE_0", image_message(picture(frame), rig.utime(frame), frame)


def pose(frame: float, camera: rig.Camera | None = None) -> rig.Event:
    return "GAIT_CAMERA_0", camera_message(camera or camera_at(frame), rig.utime(frame))


def play(tmp_path: Path, events: list[rig.Event], *options: object) -> tuple[rig.Outcome, tuple[int, int]]:
    """Track a log; also return how many poses were rejected, and how many frames had none."""
    log = rig.write_log(tmp_path / "a.log", [pose(0), ("GAIT_COMMAND", rig.start(0)), *events])
    outcome = rig.play(log, "--moving-camera", *options)
    printed = PRINTED.search(outcome.printed)
    assert printed, outcome.printed
    return outcome, (int(printed[1]), int(printed[2]))


def test_poses_at_the_frames_times_give_the_bits_of_the_library(tmp_path):
    events = [event for i in range(FRAMES) for event in (pose(i), image(i))]
    sd = ("--pose-turn-sd", 0.5, "--pose-place-sd", 0.02)
    outcome, counts = play(tmp_path, events, *sd)
    assert outcome.frames == FRAMES and counts == (0, 0)
    config = TrackerConfig.default(particles=rig.PARTICLES, lag=5)
    tracker = Tracker(rig.model(), camera_at(0), config)
    tracker.start(rig.person(0), rig.SD, rig.utime(0))
    for i in range(FRAMES):
        placed = CameraPose(camera_at(i).R, camera_at(i).t, 0.5 / 57.29578, 0.02)
        tracker.step(picture(i), rig.utime(i), poses=placed)
    assert outcome.digest == f"{tracker.digest():016x}"


def test_a_frame_between_two_poses_waits_for_the_later_one(tmp_path):
    """Poses at other times than the frames, the later one of each pair after its frame."""
    events = [pose(-0.4)]
    for i in range(FRAMES):
        events += [image(i), pose(i + 0.6)]
    log = rig.write_log(tmp_path / "a.log", [*events[:1], ("GAIT_COMMAND", rig.start(0)), *events[1:]])
    outcome = rig.play(log, "--moving-camera")
    assert outcome.frames == FRAMES and "frames_without_pose 0" in outcome.printed
    for estimate in outcome.estimates:
        off = np.array(estimate.mean.pelvis) - rig.person(estimate.frame).pelvis
        assert np.hypot(*off[:2]) < 0.12 and not estimate.flags & Flag.NO_IMAGE


def test_frames_in_gaps_and_breaks_are_predicted_and_late_poses_left_out(tmp_path):
    far = replace(camera_at(13), t=camera_at(13).t + [0, 0, 9.0])
    order = [0, 1, 2, 3, 24, 25, 24.5]  # a gap of 0.7 s; then one that is late
    events = [event for i in order[:4] for event in (pose(i), image(i))]
    events += [image(10), *(pose(i) for i in order[4:]), image(25)]
    events += [pose(26, far), image(26), image(27), pose(27)]  # 26.5 lies in a jump back
    outcome, counts = play(tmp_path, events, "--max-gap", 5)
    flagged = {one.frame: bool(one.flags & Flag.NO_IMAGE) for one in outcome.estimates}
    assert flagged == {0: False, 1: False, 2: False, 3: False, 10: True, 25: False, 26: False, 27: False}
    assert counts == (1, 1)
    assert "out of order" in outcome.words and "no camera pose for 0.70 s" in outcome.words


def test_equal_poses_give_the_bits_of_a_still_camera(tmp_path):
    events = [
        event for i in range(6) for event in (rig.opening(i)[0], ("GAIT_IMAGE_0", rig.frame_message(i)))
    ]
    log = rig.write_log(tmp_path / "a.log", [*rig.opening(), *events])
    assert rig.play(log, "--moving-camera").digest == rig.play(log).digest


def test_a_camera_that_moves_unexpectedly_is_named_with_the_option(tmp_path):
    events = [*rig.opening(), *rig.frames(0, 2), pose(2), *rig.frames(2, 4)]
    assert "run with --moving-camera" in rig.play(rig.write_log(tmp_path / "a.log", events)).words


def test_capture_announces_the_pose_of_each_frame(tmp_path):
    folder = rig.write_clip(tmp_path, 4)
    poses = [CameraPose(camera_at(i).R, camera_at(i).t) for i in range(4)]
    write_path(folder / "poses.csv", [i / rig.FPS for i in range(4)], poses, by_frame=False)
    words = ["capture", folder / "video.mp4", "--camera", folder / "camera.json", "--rate", "max"]
    words += ["--camera-path", folder / "poses.csv", "--url", f"file://{folder}/a.log?mode=w", "--quiet"]
    assert main([str(word) for word in words]) == 0
    sent = rig.read_log(folder / "a.log", "GAIT_CAMERA_0", gaitmsg.camera_t)[-4:]
    images = rig.read_log(folder / "a.log", "GAIT_IMAGE_0", gaitmsg.image_t)
    assert [one.utime for one in sent] == [one.utime for one in images]
    assert [one.t for one in sent] == [pytest.approx(pose.t.tolist()) for pose in poses]
    assert main([*map(str, words), "--loop"]) == 2


def side_at(frame: float) -> rig.Camera:
    """A second camera, beside the walk, that moves along with the person."""
    side = rig.Camera.looking((4.0, 0.5, 1.2), (0.0, 0.0, 0.9), (160, 120), 140.0)
    return replace(side, t=-side.R @ (side.centre + [frame / rig.FPS, 0, 0]))


def side_events(frame: int, placed: bool = True) -> list[rig.Event]:
    """Pose and frame of the second camera, 9 ms after those of the first."""
    image, utime = side_picture(frame), rig.utime(frame) + LATE
    sent = [("GAIT_CAMERA_3", camera_message(side_at(frame), utime))] * placed
    return [*sent, ("GAIT_IMAGE_3", image_message(image, utime, frame))]


@cache
def side_picture(frame: int) -> np.ndarray:
    ids = rig.model().render(side_at(frame), rig.person(frame))
    colours = np.random.default_rng(2).integers(0, 255, (256, 3), np.uint8)
    return np.where(ids[..., None] > 0, colours[ids], rig.plate())


def digest_of_two(lacks: Sequence[int]) -> str:
    """The library's with both cameras; where the second one lacks poses, three frames have the last one."""
    config = TrackerConfig.default(particles=rig.PARTICLES, lag=5)
    tracker = Tracker(rig.model(), [camera_at(0), side_at(0)], config)
    tracker.start(rig.person(0), rig.SD, rig.utime(0))
    for i in range(FRAMES):
        beside = side_at(lacks[0] - 1 if i in lacks else i)
        poses = [CameraPose(one.R, one.t) for one in (camera_at(i), beside)]
        tracker.step([picture(i), side_picture(i) if i not in lacks[3:] else None], rig.utime(i), poses=poses)
    return f"{tracker.digest():016x}"


@pytest.mark.parametrize("lacks", [(), LACKS])
def test_two_cameras_move_each_by_its_own_poses(lacks, tmp_path):
    """Poses come after frames.  Without new ones the last is valid for 0.1 s; then frames are left out."""
    events = []
    for i in range(FRAMES):
        events += [image(i), pose(i), *reversed(side_events(i, i not in lacks))]
    first = side_events(0)[:1]
    outcome, counts = play(tmp_path, [*first, *events], "--further-streams", 3)
    left_out = len(lacks[3:])
    found = re.search(r"3_used (\d+) .*3_missing (\d+) .*3_frames_without_pose (\d+)", outcome.printed)
    assert [int(x) for x in found.groups()] == [FRAMES - left_out, left_out, left_out]
    assert outcome.frames == FRAMES and counts == (0, 0) and outcome.digest == digest_of_two(lacks)
    assert ("no camera pose for a frame" in outcome.words) == bool(lacks)


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (["--moving-camera", "--lift"], "--lift needs a static camera"),
        (["--pose-turn-sd", 1], "--pose-turn-sd needs --moving-camera"),
    ],
)
def test_options_that_contradict_are_refused(words, fault):
    outcome = rig.run(*rig.command(*words)[1:])
    assert outcome.code == 2 and fault in outcome.words
