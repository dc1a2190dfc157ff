"""Profiles of the detector: its joints moved to the model's, and their lasting errors."""

import json

import numpy as np
import pytest

from gait.detect import profile
from gait.detect.networks import JOINTS
from gait.detect.weights import LANDMARKS
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints, read, write

NAMES = tuple(JOINTS)


def points(frames=4, rate=25.0, seed=0):
    """Keypoints of a body that stands anywhere: only their sums of vectors count."""
    rng = np.random.default_rng(seed)
    uv = rng.uniform(100, 300, (1, len(NAMES), 2)) + np.zeros((frames, 1, 1))
    return Keypoints(np.arange(frames), np.arange(frames) / rate, NAMES, uv, np.ones(uv.shape[:2]))


@pytest.mark.parametrize("network", list(LANDMARKS))
def test_every_network_has_a_profile_of_every_joint_and_its_source(network):
    joints = profile.load(network)
    assert set(joints) == {name[2:] for name in NAMES}
    for joint in joints.values():
        assert len(joint.offset) == 3 and np.abs(joint.offset).max() < 0.5
        assert 0 < joint.bias < 0.04 and 0 < joint.sd < 0.04 and 0 < joint.correlation_s < 1
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
    np.testing.assert_allclose(again.sd[again.visible], found.sd[again.visible], atol=6e-4)
    np.testing.assert_allclose(again.errors(3.0)[again.visible], np.hypot(3.0, again.sd[again.visible]))
    assert np.isinf(again.errors(3.0)[1, 3])


def test_a_negative_error_is_refused(tmp_path):
    path = tmp_path / "k.csv"
    path.write_text("frame,time,l_knee_u,l_knee_v,l_knee_sd\n0,0,3,4,2\n1,0.1,3,4,-2\n")
    with pytest.raises(UserError, match="line 3: l_knee_sd is -2; give pixels of 0 or more"):
        read(path, NAMES)
