"""What gait-trackd reports about past frames and strides, on logs."""

import lcm_rig as rig
import numpy as np
import pytest

from gait.io import blob
from gait.io.track_file import read_track
from gait.lcm.link import gaitmsg
from gait.lcm.messages import estimate_of
from gait.lcm.record import Recorder, read_run
from gait.learn.classes import standing
from gait.learn.classes.join import Change, MotionClass, join

FRAMES = 76


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """A log of two and a half strides."""
    return rig.write_log(
        tmp_path_factory.mktemp("strides") / "a.log", [*rig.opening(), *rig.frames(0, FRAMES)]
    )


def played(log, *options):
    """Estimates, lagged estimates and strides that a run publishes."""
    outcome, out = rig.play(log, "-n", 300, *options), log.with_suffix(".out")
    lagged = rig.read_log(out, "GAIT_ESTIMATE_LAG", gaitmsg.estimate_t)
    return outcome.estimates, lagged, rig.read_log(out, "GAIT_STRIDE", gaitmsg.stride_t)


def places(messages):
    """Joints (n, P, 3) of estimates."""
    return np.array([[joint.position for joint in m.joints] for m in messages])


def test_classes_of_motion_come_with_each_estimate(walk, tmp_path):
    """``gait record`` writes them; with a model of one class there are none."""
    learnt = blob.read(rig.MODEL)
    classes = [
        MotionClass("walk", changes={"stand": Change(0.5, 6.0, 0.05)}),
        MotionClass("stand", 0, own=standing.sections(learnt), changes={"walk": Change(0.5, 6.0)}),
    ]
    blob.write(tmp_path / "m.gait", join(learnt, classes))
    now, past, _ = played(walk, "-m", tmp_path / "m.gait")
    out, log = walk.with_suffix(".out"), tmp_path / "e.log"
    found = {lag: rig.read_log(out, f"GAIT_CLASSES{lag}", gaitmsg.classes_t) for lag in ("", "_LAG")}
    for lag, estimates in (("_LAG", past), ("", now)):
        Recorder(f"file://{out}?speed=0", str(tmp_path / "t.csv"), str(log), f"GAIT_ESTIMATE{lag}").run()
        track = read_track(tmp_path / "t.csv")
        assert [(m.utime, m.frame) for m in found[lag]] == [(m.utime, m.frame) for m in estimates]
        assert all(
            m.name == ["walk", "stand"] and sum(m.probability) == pytest.approx(1, abs=1e-4)
            and m.most_probable == int(m.probability[1] > m.probability[0]) for m in found[lag]
        )  # fmt: skip
        assert track.motion_class == [m.name[m.most_probable] for m in found[lag]]
        share = [m.probability[1] for m in found[lag]]
        np.testing.assert_allclose(track.numbers["p_stand"], share, atol=1e-4)
        assert track.motion_class.count("walk") > 0.9 * len(estimates)
    assert [one.class_probability[1] for one in read_run(str(log)).estimates] == share
    played(walk)
    assert rig.read_log(walk.with_suffix(".out"), "GAIT_CLASSES", gaitmsg.classes_t) == []


def test_every_frame_comes_again_some_frames_later(walk):
    now, past, _ = played(walk, "--lag", 4)
    assert [m.frame for m in past] == list(range(FRAMES - 4)) == [m.step for m in past]
    for then, again, newest in zip(now, past, now[4:], strict=False):
        assert (again.utime, again.receive_utime) == (then.utime, then.receive_utime)
        assert (again.step_us, again.log_evidence) == (then.step_us, then.log_evidence)
        assert again.tracker_digest == newest.tracker_digest
    assert estimate_of(past[0]).joint_names == estimate_of(now[0]).joint_names
    sd = [np.mean([[j.sd for j in m.joints] for m in stream[10:]]) for stream in (now[:-4], past)]
    assert sd[1] < sd[0]
    assert 0 < np.abs(places(past) - places(now[:-4])).max() < 0.2


def test_the_lag_changes_nothing_else(walk):
    some, none = played(walk, "--lag", 4), played(walk, "--lag", 0)
    assert none[1] == [] and len(some[0]) == len(none[0])
    np.testing.assert_array_equal(places(some[0]), places(none[0]))


@pytest.mark.parametrize("lag", [0, 5])
def test_strides_of_the_drawn_walk_are_reported(walk, lag):
    """One stride a second at 1.2 m/s, from phase 0.1: right strikes at 0.9 and 1.9 s, left ones at 0.4 ..."""
    strides = played(walk, "--lag", lag)[2]
    right, left = gaitmsg.stride_t.RIGHT, gaitmsg.stride_t.LEFT
    assert [s.side for s in strides] == [left, right, left][: len(strides)] and len(strides) >= 2
    begun = rig.frame_message(0).utime
    for s, end in zip(strides, (1.4, 1.9, 2.4), strict=False):
        assert s.sure and s.start_utime < s.other_utime < s.utime
        assert 1e-6 * (s.utime - begun) == pytest.approx(end, abs=0.1)
        assert s.stride_time == pytest.approx(1.0, abs=0.06) and s.cadence == pytest.approx(
            120 / s.stride_time
        )
        assert s.stride_length == pytest.approx(1.2, abs=0.12)
        assert s.speed == pytest.approx(s.stride_length / s.stride_time, rel=1e-5)
        assert 0 < s.stride_time_sd < 0.1 and 0 < s.stride_length_sd < 0.2
        reported = 1e6 * s.frame / rig.FPS
        assert s.utime - begun <= reported + 1 < s.utime - begun + 1e6 / rig.FPS + 1


def test_pauses_bridged_by_prediction_are_not_frames(tmp_path):
    """A gap of a second or more makes steps without a frame; those are not sent again."""
    events = [*rig.opening(), *rig.frames(0, 12), *rig.frames(50, 62)]
    now, past, _ = played(rig.write_log(tmp_path / "gap.log", events), "--lag", 3)
    assert [m.frame for m in now] == [*range(12), *range(50, 62)]
    assert {m.frame for m in past} <= {m.frame for m in now} and past[-1].frame == 58
    assert all(m.utime == rig.frame_message(m.frame).utime for m in past)


def test_a_lag_out_of_range_is_a_usage_error(walk):
    assert rig.run(*rig.command("--url", f"file://{walk}?speed=0", "--lag", 65)[1:]).code == 2


def test_lagged_estimates_can_be_recorded(walk, tmp_path):
    _, past, _ = played(walk, "--lag", 4)
    log = rig.write_log(tmp_path / "past.log", [("GAIT_ESTIMATE_LAG", m) for m in past])
    words = ["record", "--url", f"file://{log}?speed=0", "-o", tmp_path / "t.csv", "--lagged", "--quiet"]
    assert rig.gait(*words).returncode == 0
    track = read_track(tmp_path / "t.csv")
    assert track.frame.tolist() == [m.frame for m in past]
    np.testing.assert_allclose(track.places["pelvis"], places(past)[:, 0], atol=1e-5)
    none = rig.gait(*words[:-2], "--quiet")
    assert none.returncode == 1 and "GAIT_ESTIMATE: no estimate" in none.stderr
