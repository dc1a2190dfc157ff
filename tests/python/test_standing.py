"""A person who stands has no phase, rate and speed until both feet have struck."""

from dataclasses import replace

import numpy as np
import pytest
from drawn_person import FPS, SIZE, camera, state_at

from gait import Camera, Estimate, Flag, Model, State, TrackStatus
from gait.bindings.frame import FrameKeypoints
from gait.bindings.model import read_blob
from gait.io import blob
from gait.io.track_file import TrackWriter, read_track
from gait.io.video import Frame
from gait.motion.parameters import measure
from gait.track.person_keypoints import PersonKeypoints
from gait.track.standing import Standing

MODEL = Model()
SECTIONS = blob.decode(read_blob(None))
NAMES = ("l_hip", "r_hip", "l_ankle", "r_ankle")
STANDS, WALKS = 20, 90  # frames


def track(path, stands, view=None, rate=0.9, depth_sd=0.0, motion="walk"):
    """Write the track of a person who stands for some frames while the estimated phase moves on; read it."""
    directions = {"walk": 1, "backwards": -1}
    view = view or camera()
    seconds = np.arange(stands + WALKS) / FPS
    order = [MODEL.joint_names.index(name) for name in NAMES]
    noise = np.random.default_rng(1)
    estimates, observed = [], {}
    for k, time in enumerate(seconds):
        state = state_at(
            MODEL, SECTIONS, directions[motion] * max(0.0, time - seconds[stands]), phase=0.3, rate=rate
        )
        joints = MODEL.pose(state)[0]
        observed[k] = FrameKeypoints(NAMES, view.project(joints[order]) + noise.normal(0, 0.3, (4, 2)))
        phase = state.phase if k > stands else 0.3 - 0.1 * (1 - k / max(stands, 1))
        pelvis = state.pelvis + [depth_sd * np.sin(3.5 * time), 0.0, 0.0]
        mean = replace(state, phase=phase, pelvis=pelvis)
        sd = State(phase=0.02, stride_hz=0.02, pelvis=np.array([depth_sd, 0.0, 0.0]), coef=np.zeros(5))
        estimates.append(
            Estimate(round(1e6 * time), k, TrackStatus.TRACKING, Flag(0), -80.0, 100.0, 1.0, 1.0, 1.3 * rate,
                     mean, sd, mean, joints, np.full((len(joints), 3), 0.02), np.zeros(24), MODEL.joint_names,
                     motion)
        )  # fmt: skip
    with TrackWriter(path, 5, MODEL.joint_names, MODEL.angle_names) as rows:
        found = (
            (Frame(k, time, None), one) for k, (time, one) in enumerate(zip(seconds, estimates, strict=True))
        )
        for frame, estimate in Standing(PersonKeypoints(view, {1: observed}, 1), directions).decided(found):
            rows.write(frame, estimate)
    return read_track(path)


def test_strides_begin_when_both_feet_have_struck(tmp_path):
    rows = track(tmp_path / "t.csv", STANDS)
    strike = STANDS + (1.0 - 0.3) / 0.9 * FPS  # of the right foot, after the left one
    walks = rows.frame >= strike
    assert len(rows.frame) == STANDS + WALKS
    for values in rows.phase, rows.numbers["stride_hz"], rows.numbers["speed_m_s"], rows.numbers["phase_sd"]:
        np.testing.assert_array_equal(np.isfinite(values), walks)
    rate = np.polyfit(rows.time[walks], np.unwrap(rows.phase[walks], period=1.0), 1)[0]
    assert rate == pytest.approx(0.9, rel=0.01)
    strides = measure(rows).strides
    assert all((one.start[one.counts] >= rows.time[walks][0] - 0.05).all() for one in strides.values())
    assert any(one.counts.any() for one in strides.values())


def test_who_walks_keeps_every_phase(tmp_path):
    assert np.isfinite(track(tmp_path / "t.csv", 0).phase).all()


@pytest.mark.parametrize("motion", ["walk", "backwards"])
def test_who_walks_slowly_towards_a_far_camera_keeps_every_phase(tmp_path, motion):
    far = Camera.looking((16.0, 0.0, 1.4), (0.0, 0.0, 0.9), SIZE, 1600.0)
    rows = track(tmp_path / "t.csv", 0, far, rate=0.5, depth_sd=0.2, motion=motion)
    assert np.isfinite(rows.phase).all()
