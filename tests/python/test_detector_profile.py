"""Profiles of the detector: its joints are moved to the model's, and their lasting errors."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from gait.detect import profile
from gait.detect.networks import LANDMARK_JOINTS
from gait.detect.weights import LANDMARK_NETWORKS
from gait.errors import UserError
from gait.io.keypoints_file import TYPICAL_STRIDE_S, Keypoints, read, write
from gait.track.keypoint_start import keypoint_noise

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))

import detector_profile

NAMES = tuple(LANDMARK_JOINTS)


def points(frames=4, rate=25.0, seed=0):
    """Keypoints of a body that stands anywhere: only their sums of vectors count."""
    rng = np.random.default_rng(seed)
    uv = rng.uniform(100, 300, (1, len(NAMES), 2)) + np.zeros((frames, 1, 1))
    return Keypoints(np.arange(frames), np.arange(frames) / rate, NAMES, uv, np.ones(uv.shape[:2]))


@pytest.mark.parametrize("network", list(LANDMARK_NETWORKS))
def test_every_network_has_a_profile_of_every_joint_and_its_source(network):
    found = profile.load(network)
    assert set(found.joints) == {name[2:] for name in NAMES}
    assert found.lasting_s > 1 and 0 < found.repeated < 1
    for joint in found.joints.values():
        assert len(joint.offset) == 3 and np.abs(joint.offset).max() < 0.5
        assert 0 < joint.lasting_sd < 0.04 and 0 < joint.sd < 0.04 and 0 < joint.correlation_s < 1
    assert "walks" in json.loads(profile.FILE.read_text())["source"]


def test_offsets_turn_and_scale_with_the_picture():
    before = points()
    turn = 3.0 * np.array([[0.6, -0.8], [0.8, 0.6]])
    turned = Keypoints(before.frame, before.time, NAMES, before.uv @ turn.T + 7, before.confidence)
    np.testing.assert_allclose(
        profile.corrected(turned, "full").uv, profile.corrected(before, "full").uv @ turn.T + 7
    )


def test_left_and_right_are_mirror_images():
    before = points()
    other = [NAMES.index({"l": "r", "r": "l"}[name[0]] + name[1:]) for name in NAMES]
    mirrored = Keypoints(before.frame, before.time, NAMES, before.uv[:, other] * [-1, 1], before.confidence)
    np.testing.assert_allclose(
        profile.corrected(mirrored, "lite").uv, profile.corrected(before, "lite").uv[:, other] * [-1, 1]
    )


def test_frames_twice_as_frequent_add_nothing():
    slow, fast = (profile.corrected(points(rate=rate), "full").sd for rate in (50.0, 100.0))
    np.testing.assert_allclose(fast, slow * np.sqrt(2), rtol=1e-9)


def test_a_frame_without_the_person_stays_empty():
    keypoints = points()
    keypoints.uv[2] = np.nan
    found = profile.corrected(keypoints, "full")
    assert np.isnan(found.uv[2]).all() and np.isfinite(found.uv[[0, 1, 3]]).all()


def test_errors_that_last_are_written_and_read(tmp_path):
    found = profile.corrected(points(), "full")
    found.uv[1, 3] = np.nan
    write(tmp_path / "k.csv", found)
    again, _ = read(tmp_path / "k.csv", NAMES)
    seen = again.visible
    np.testing.assert_allclose(again.sd[seen], found.sd[seen], atol=6e-4)
    np.testing.assert_allclose(again.lasting_sd[seen], found.lasting_sd[seen], atol=6e-4)
    assert (again.lasting_s, again.repeated) == (found.lasting_s, found.repeated)
    np.testing.assert_allclose(again.changing(3.0)[seen], np.hypot(3.0, again.sd[seen]))
    np.testing.assert_allclose(  # 25 frames a second count as one observation of what lasts
        again.errors(3.0)[seen], np.hypot(again.changing(3.0), 5 * again.lasting_sd)[seen]
    )
    assert np.isinf(again.errors(3.0)[1, 3])
    for mine, theirs in zip(keypoint_noise(again).values(), keypoint_noise(found).values(), strict=True):
        np.testing.assert_allclose(mine.sd, theirs.sd, atol=6e-4)  # the tracker counts both alike


def test_errors_that_come_again_in_every_stride_count_once_in_a_sequence():
    found = profile.corrected(points(frames=round(25 * 11 * TYPICAL_STRIDE_S) + 1), "full")
    grown = found.changing(0.0, whole=True) / found.changing(0.0)
    np.testing.assert_allclose(grown, np.sqrt(1 + 10 * found.repeated), rtol=2e-3)


def test_a_negative_error_is_refused(tmp_path):
    path = tmp_path / "k.csv"
    path.write_text("frame,time,l_knee_u,l_knee_v,l_knee_sd\n0,0,3,4,2\n1,0.1,3,4,-2\n")
    with pytest.raises(UserError, match="line 3: l_knee_sd is -2; give pixels of 0 or more"):
        read(path, NAMES)


def test_a_profile_out_of_range_is_refused(tmp_path):
    path = tmp_path / "k.csv"
    for column, value, words in (("lasting_s", -1, "give seconds above 0"), ("repeated", 2, "from 0 to 1")):
        path.write_text(f"frame,time,{column},l_knee_u,l_knee_v\n0,0,{value},3,4\n1,0.1,,3,4\n")
        with pytest.raises(UserError, match=f"line 2: {column} is {value}; .*{words}"):
            read(path, NAMES)


OFFSET = np.array([0.05, -0.1, 0.08])
LASTING, CHANGING, STEP, PERIOD = 0.012, 0.006, 0.04, 1.0


def walk(rng, lasts, frames=250):
    """Errors of a joint as a detector with known faults has them: offset, lasting and changing errors."""
    keep = np.exp(-STEP / lasts)
    lasting = np.zeros((frames, 2))
    lasting[0] = LASTING * rng.normal(size=2)
    for t in range(1, frames):
        lasting[t] = keep * lasting[t - 1] + LASTING * np.sqrt(1 - keep**2) * rng.normal(size=2)
    every = round(PERIOD / STEP)
    again = np.tile(rng.normal(size=(every, 2)), (frames // every + 1, 1))[:frames]
    changing = CHANGING * (np.sqrt(0.4) * again + np.sqrt(0.6) * rng.normal(size=(frames, 2)))
    along = rng.normal(0.0, 0.1, (1, 2, 3)) + rng.normal(0.0, 0.02, (frames, 2, 3))
    return detector_profile.Joint(along @ OFFSET + lasting + changing, along, STEP, PERIOD)


def test_known_offsets_noise_and_durations_are_found():
    rng = np.random.default_rng(0)
    clips = [{"l_knee": walk(rng, 4.0), "r_knee": walk(rng, 4.0)} for _ in range(60)]
    for joint in clips[7].values():
        joint.off[:200] += 0.3  # sides swapped nearly throughout
    found = detector_profile.learn(clips)
    knee = found["joints"]["knee"]
    np.testing.assert_allclose(knee["offset"], OFFSET, atol=0.02)
    assert found["lasting_s"] == pytest.approx(4.0, rel=0.3)
    still = [{"l_knee": walk(rng, 1e4), "r_knee": walk(rng, 1e4)} for _ in range(60)]
    known = detector_profile.learn(still)
    assert known["joints"]["knee"]["lasting_sd"] == pytest.approx(LASTING, rel=0.2)
    assert known["joints"]["knee"]["sd"] == pytest.approx(CHANGING, rel=0.1)
    assert known["repeated"] == pytest.approx(0.4, abs=0.08)
    assert known["joints"]["knee"]["correlation_s"] < 2 * STEP
    assert known["lasting_s"] == pytest.approx(detector_profile.DURATIONS[-1])
