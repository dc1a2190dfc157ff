"""Files of 2-D keypoints: what is read, and the message for every fault."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gait.errors import UserError
from gait.io.keypoints_file import Keypoints, read, write

FAULTS = Path(__file__).resolve().parents[2] / "../shared/data/faults/tracks_time"
KNOWN = ("pelvis", "l_knee", "r_knee")


def written(tmp_path, text):
    path = tmp_path / "t.csv"
    path.write_text(text)
    return path


def test_round_trip(tmp_path):
    rng = np.random.default_rng(0)
    uv = rng.uniform(0, 500, (5, 2, 2)).round(3)
    uv[2, 1] = np.nan
    confidence = np.where(np.isnan(uv[..., 0]), 0, 0.5)
    keypoints = Keypoints(np.arange(3, 8), np.arange(5) / 30, ("l_knee", "pelvis"), uv, confidence)
    write(tmp_path / "t.csv", keypoints)
    found, ignored = read(tmp_path / "t.csv", KNOWN)
    assert (found.names, ignored) == (keypoints.names, [])
    np.testing.assert_array_equal(found.frame, keypoints.frame)
    np.testing.assert_allclose(found.uv, uv)
    np.testing.assert_allclose(found.standard_deviations(3.0)[0], 6.0)
    assert np.isinf(found.standard_deviations(3.0)[2, 1])


def test_zeros_are_an_origin_or_missing(tmp_path):
    head = "frame,time,pelvis_u,pelvis_v,l_knee_u,l_knee_v"
    origin = read(written(tmp_path, f"{head}\n0,0,0,0,.1,.5\n1,.1,0,0,.2,.5\n"), KNOWN)[0]
    assert origin.visible.all()
    with pytest.raises(UserError, match="line 2: pelvis is at exactly 0, 0, .* give pelvis_c 0"):
        read(written(tmp_path, f"{head}\n0,0,0,0,0,0\n1,.1,0,0,.2,.5\n"), KNOWN)


def test_a_point_of_little_confidence_is_missing(tmp_path):
    path = written(tmp_path, "frame,time,pelvis_u,pelvis_v,pelvis_c\n0,0,1,2,0.05\n1,0.1,1,2,\n2,0.2,1,2,1\n")
    assert read(path, KNOWN)[0].visible.ravel().tolist() == [False, False, True]


HEAD = "frame,time,pelvis_u,pelvis_v"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "has no rows"),
        (f"{HEAD}\n", "has no rows"),
        ("time,pelvis_u,pelvis_v\n0,1,2\n", "column frame is missing"),
        ("frame,time,x\n0,0,1\n", "no columns <joint>_u"),
        ("frame,time,pelvis_u\n0,0,1\n", "column pelvis_v is missing"),
        ("frame,time,nose_u,nose_v\n0,0,1,2\n", "'nose' is unknown"),
        (f"{HEAD}\n0,0,1,2,3\n", "line 2 has 5 cells"),
        (f"{HEAD}\n0,0,1,\n", "line 2: pelvis has only one of _u and _v"),
        (f"{HEAD}\n0,0,1,2\n1,0.1,0,0\n", "line 3: pelvis is at exactly 0, 0"),
        (f"{HEAD}\n0,0,1,two\n", "line 2: pelvis_v is 'two'"),
        (f"{HEAD}\n0,0,1,2\n0,1,1,2\n", "line 3: frame is 0; it must be whole"),
        (f"{HEAD}\n0,0,1,2\n1.5,1,1,2\n", "line 3: frame is 1.5; it must be whole"),
        (f"{HEAD}\n0,0,1,2\n1e30,1,1,2\n", "frame is 1e+30; it must be whole numbers that increase, at most"),
        (f"{HEAD}\n0,0,1,-2e6\n", "line 2: pelvis_v is '-2e6'; give a number of at most 1e+06"),
        (f"{HEAD}\n0,0,1,2\n1,1e-9,1,2\n", "time increases by 1e-09 per frame; give seconds"),
        (f"{HEAD}\n0,0,1,2\n1,33.3,1,2\n", "time increases by 33.3 per frame; give seconds"),
        (f"{HEAD}\n0,0,1,2\n1,1,1,2\n", "time increases by 1 per frame; give seconds"),
        (f"{HEAD}\n0,0,1,2\n1,0,1,2\n", "line 3: time does not increase"),
        (f"{HEAD}\n0,,1,2\n", "line 2: time is empty"),
        (f"{HEAD}\n0,0,,\n", "no point is visible"),
        (f"{HEAD},pelvis_u\n0,0,1,2,3\n", "pelvis_u appears twice"),
        (f"{HEAD},pelvis_c\n0,0,1,2,7\n", "pelvis_c is 7; give it from 0 to 1"),
        (
            f"{HEAD},pelvis_lasting_sd,pelvis_frame_sd\n0,0,1,2,1,2\n1,.1,1,2,2,2\n",
            "line 3: pelvis_lasting_sd is 2, not less than pelvis_frame_sd, 2, which contains it; correct",
        ),
    ],
)
def test_faults_are_named(tmp_path, text, words):
    with pytest.raises(UserError, match=r"t\.csv") as caught:
        read(written(tmp_path, text), KNOWN)
    assert words in str(caught.value)


def test_unknown_points_can_be_left_out(tmp_path):
    path = written(tmp_path, f"{HEAD},nose_u,nose_v\n0,0,1,2,3,4\n")
    keypoints, ignored = read(path, KNOWN, ignore_unknown=True)
    assert (keypoints.names, ignored) == (("pelvis",), ["nose"])
    with pytest.raises(UserError, match="no point of the model"):
        read(path, ("l_wrist",), ignore_unknown=True)


def test_points_within_their_noise_show_nothing():
    uv = np.random.default_rng(1).uniform(0, 1, (4, 2, 2))
    keypoints = Keypoints(np.arange(4), np.arange(4) / 20, KNOWN[:2], uv, np.ones((4, 2)))
    with pytest.raises(
        UserError, match=r"t.csv: all u and v lie within 0\.\d+, less than .* of 3; give pixels"
    ):
        keypoints.require_extent("t.csv", 3.0)
    keypoints.require_extent("t.csv", 0.01)
    uv[:, 1] = np.nan  # one alone may stand still
    keypoints.require_extent("t.csv", 3.0)


def test_missing_file():
    with pytest.raises(UserError, match="no such file"):
        read("nowhere.csv", KNOWN)


TIMES = np.arange(60) / 30.0


def counted(frame, time):
    """Keypoints of one joint that is seen in these frames at these times."""
    return Keypoints(
        np.asarray(frame), np.asarray(time, float), ("pelvis",), np.ones((len(frame), 1, 2)), None
    )


@pytest.mark.parametrize(
    ("every", "first"), [(1, 0), (2, 0), (1, 20), (5, 3)], ids=["all", "every second", "part", "few"]
)
def test_times_of_the_video_are_accepted(every, first):
    frame = np.arange(first, 60, every)
    assert counted(frame, TIMES[frame].round(2)).compare_times("t.csv", TIMES) == ""


@pytest.mark.parametrize("rate", [0.5, 0.9, 1.2, 2.0])
def test_frames_that_number_something_else_are_refused(rate):
    with pytest.raises(UserError, match=r"t.csv: time increases by .* s a frame, the video by 0.03333 s"):
        counted(np.arange(30), rate * TIMES[:30]).compare_times("t.csv", TIMES)


@pytest.mark.parametrize("shift", [-1, 1, 40])
def test_frames_that_are_numbered_from_elsewhere_are_reported(shift):
    frame = np.arange(10, 40)
    words = counted(frame, (frame + shift) / 30).compare_times("t.csv", TIMES)
    assert f"({shift:+.1f} frames)" in words


def test_frames_left_out_but_numbered_on_are_reported():
    """A detector that skips two frames but does not count them is two frames off afterwards."""
    time = np.delete(TIMES, [40, 41])
    assert "0.0667 s off" in counted(np.arange(58), time).compare_times("t.csv", TIMES)


def test_keypoints_of_a_longer_video_are_reported():
    words = counted(np.arange(90), np.arange(90) / 30).compare_times("t.csv", TIMES)
    assert words == "has frame 89, the video ends at 59"


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_points_mostly_outside_the_pictures_are_of_another_size(factor):
    uv = factor * np.random.default_rng(0).uniform((300, 100), (400, 460), (30, 5, 2))
    keypoints = Keypoints(np.arange(30), TIMES[:30], tuple("abcde"), uv, np.ones((30, 5)))
    assert np.array(keypoints.reach()) == pytest.approx((400 * factor, 460 * factor), rel=0.02)
    if factor <= 1:
        keypoints.require_inside("t.csv", (640, 480))
        return
    with pytest.raises(
        UserError, match=r"t.csv: .*% of the points are outside the video's 640x480 pict.*in its"
    ):
        keypoints.require_inside("t.csv", (640, 480))


@pytest.mark.skipif(not FAULTS.is_dir(), reason="../shared/data/faults is absent")
def test_public_files_of_times():
    names = ("neck", "l_knee")
    times = np.arange(120) / 30
    read_all = {name: read(FAULTS / f"{name}.csv", names, True)[0] for name in ("base", "from1", "half_rate")}
    assert read_all["base"].compare_times("t.csv", times) == ""
    assert "(-1.0 frames)" in read_all["from1"].compare_times("t.csv", times)
    with pytest.raises(UserError, match="0.06666 s a frame"):
        read_all["half_rate"].compare_times("t.csv", times)
