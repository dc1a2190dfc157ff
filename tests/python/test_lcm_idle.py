"""gait-trackd reports once why frames arrive but no person is tracked, and where it listens."""

import lcm_rig as rig
import numpy as np

from gait.bindings.state import State
from gait.lcm.link import gaitmsg, private_url
from gait.lcm.messages import camera_message, command_message

CAMERA, SCENE, START = rig.opening()
NO_CAMERA = "frames arrive, but no camera"
NO_START = "frames arrive, but no START"
NO_SCENE = "frames arrive, but --init auto needs the background"


def printed(tmp_path, events, *options):
    """What was reported of idle frames, in order."""
    outcome = rig.play(rig.write_log(tmp_path / "a.log", events), *options)
    return [line.split(": ")[1] for line in outcome.words.splitlines() if "frames arrive" in line], outcome


def test_no_camera(tmp_path):
    words, outcome = printed(tmp_path, rig.frames(0, 5))
    assert words == [NO_CAMERA] and outcome.frames == 0


def test_a_camera_and_no_empty_scene(tmp_path):
    words, _ = printed(tmp_path, [CAMERA, *rig.frames(0, 5)])
    assert len(words) == 1 and words[0].startswith(NO_SCENE)


def test_no_start_after_stop(tmp_path):
    stop = ("GAIT_COMMAND", command_message(gaitmsg.command_t.STOP, rig.utime(0), State(), State()))
    words, _ = printed(tmp_path, [CAMERA, SCENE, stop, *rig.frames(0, 5)])
    assert words == [NO_START]


def test_begun_in_the_middle_of_a_stream(tmp_path):
    """Frames, then the announcement that comes every few seconds, then the START of another run."""
    events = [*rig.frames(0, 3), CAMERA, *rig.frames(3, 6), SCENE, START]
    words, outcome = printed(tmp_path, [*events, *rig.frames(6, 9)])
    assert words[0] == NO_CAMERA and words[1].startswith(NO_SCENE) and len(words) == 2
    assert outcome.frames == 3


def test_a_track_that_begins_prints_nothing(tmp_path):
    assert printed(tmp_path, [*rig.opening(), *rig.frames(0, 5)])[0] == []


def test_a_stop_by_a_pause_is_reported_once(tmp_path):
    later = [("GAIT_IMAGE_0", rig.frame_message(i, utime=rig.utime(i + 300))) for i in range(3, 6)]
    words, outcome = printed(tmp_path, [*rig.opening(), *rig.frames(0, 3), *later], "--init", "auto")
    assert words == [] and outcome.words.count("stopped; searching for a person again") == 1


def test_another_daemon_on_the_same_url_is_reported():
    rig.need_multicast()
    url = private_url()
    with rig.daemon(url) as (listener, finish), rig.daemon(url) as (_, finish_second):
        listener.until(lambda: "another gait-trackd uses" in listener.last.text, "the report")
        heard = len(listener.statuses)
        listener.until(lambda: len(listener.statuses) > heard + 6, "statuses of both")
        second = finish_second()
        assert "another gait-trackd uses this URL" in second.words
        assert "another gait-trackd uses this URL" in finish().words


def test_a_camera_that_cannot_be_is_refused_in_log_and_status():
    rig.need_multicast()
    nowhere = camera_message(rig.CAMERA, 1)
    nowhere.R, nowhere.t = np.eye(3).ravel().tolist(), [0.0] * 3
    fault = "GAIT_CAMERA_0: no standing person would be upright: lens 0 m above the floor, -y up; give R"
    with rig.daemon(private_url()) as (listener, finish):
        stream = [("GAIT_CAMERA_0", nowhere), *rig.frames(0, 1)]
        listener.ask(stream, lambda s: s.state == s.WAITING and s.text.startswith(fault), "the refusal")
        other = camera_message(rig.CAMERA, 1)
        other.fx = 0.0  # refused after the frame before it has been answered
        stream = [*rig.frames(1, 2), ("GAIT_CAMERA_0", other)]
        listener.ask(stream, lambda s: s.text.startswith("camera with focal lengths"), "the other refusal")
        words = finish().words
    assert words.count(f"gait-trackd: {fault}") == 1
    # frames that are read together with the second camera are reported with its fault
    reasons = [line.partition("no usable camera: ")[2] for line in words.splitlines()]
    assert any(reason.startswith((fault, "camera with focal lengths")) for reason in reasons)


def test_live_it_reports_where_it_listens_and_what_it_lacks():
    rig.need_multicast()
    url = private_url()
    with rig.daemon(url) as (listener, finish):
        for i in range(3):
            listener.send(rig.frames(i, i + 1))
        listener.statuses.clear()
        listener.until(lambda: len(listener.statuses) > 1, "two statuses")
        words = finish().words.splitlines()
    assert words[0] == f"gait-trackd: listening on {url}"
    assert len(words) == 2 and NO_CAMERA in words[1]
    with rig.daemon(url, "--quiet") as (_, finish):
        outcome = finish()
    assert outcome.words == outcome.printed == ""
