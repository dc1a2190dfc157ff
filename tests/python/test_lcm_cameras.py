"""gait-trackd --further-streams: frames of several cameras of one person, as far as they arrive."""

import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache

import lcm_rig as rig
import numpy as np
import pytest

from gait.bindings.config import TrackerConfig
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.lcm.capture import Publisher, Setup
from gait.lcm.link import gaitmsg, open_lcm, private_url
from gait.lcm.messages import camera_message, image_message
from gait.track.tracker import Tracker

FRAMES, LATE = 24, 9_000  # microseconds by which the second camera's frames are later
BOTH = 1 << 0 | 1 << 3  # backgrounds of both cameras, as in a status
SIDE = Camera.looking((4.0, 0.5, 1.2), (0.0, 0.0, 0.9), (160, 120), 140.0)


@cache
def side(frame):
    """What the second camera sees."""
    ids = rig.model().render(SIDE, rig.person(frame))
    colours = np.random.default_rng(2).integers(0, 255, (256, 3), np.uint8)
    return np.where(ids[..., None] > 0, colours[ids], rig.plate())


def second(frame):
    return "GAIT_IMAGE_3", image_message(side(frame), rig.utime(frame) + LATE, frame)


def opening():
    return [
        ("GAIT_CAMERA_3", camera_message(SIDE, rig.utime(0))),
        ("GAIT_BACKGROUND_3", image_message(rig.plate(), rig.utime(0), -1)),
        *rig.opening(),
    ]


def play(tmp_path, events, *options):
    return rig.play(rig.write_log(tmp_path / "a.log", events), "-n", 300, *options)


def used(outcome):
    """Frames of the first camera with and without one of the second."""
    return tuple(map(int, re.search(r"stream_3_used (\d+) stream_3_missing (\d+)", outcome.printed).groups()))


def error(outcome):
    """Mean distance of the joints in the second half, metres."""
    off = [
        np.array([j.position for j in e.joints]) - rig.model().pose(rig.person(e.frame))[0]
        for e in outcome.estimates[FRAMES // 2 :]
    ]
    return float(np.linalg.norm(off, axis=2).mean())


def in_message(camera):
    return replace(camera, R=camera.R.astype(np.float32), t=camera.t.astype(np.float32))


def by_python(there):
    """Digest of the library with the same input; `there`: frames that the second camera has."""
    tracker = Tracker(
        rig.model(),
        [in_message(rig.CAMERA), in_message(SIDE)],
        TrackerConfig.default(particles=300, lag=5),
        background=[rig.plate(), rig.plate()],
    )
    tracker.start(rig.person(0), rig.SD, rig.utime(0))
    for i in range(FRAMES):
        tracker.step([rig.picture(i), side(i) if i in there else None], rig.utime(i))
    return f"{tracker.digest():016x}"


@pytest.mark.parametrize("missing", [(), range(8, 14)])
def test_two_streams_are_one_tracker(missing, tmp_path):
    """The digest is the library's with two cameras, whichever frame comes first, even if some are missing."""
    both = [
        event for i in range(FRAMES) for event in (*rig.frames(i, i + 1), *([second(i)] * (i not in missing)))
    ]
    outcome = play(tmp_path, [*opening(), *both], "--further-streams", 3)
    assert used(outcome) == (FRAMES - len(missing), len(missing))
    assert outcome.frames == FRAMES and outcome.digest == by_python(set(range(FRAMES)) - set(missing))
    status = rig.read_log(tmp_path / "a.out", "GAIT_STATUS", gaitmsg.status_t)[-1]
    assert status.background_mask == BOTH
    if not missing:
        before = [event for i in range(FRAMES) for event in (second(i), *rig.frames(i, i + 1))]
        assert play(tmp_path, [*opening(), *before], "--further-streams", 3).digest == outcome.digest
        alone = play(tmp_path, [*opening(), *both])
        assert error(outcome) < min(0.05, error(alone))


def test_the_tracker_waits_for_all_cameras_and_reports_which(tmp_path):
    events = [*rig.opening(), *rig.frames(0, 4)]
    outcome = play(tmp_path, events, "--further-streams", 3)
    assert outcome.code == 1 and outcome.words.count("announce it on GAIT_CAMERA_3") == 2
    late = play(tmp_path, [*events, *opening(), *rig.frames(4, 8), second(7)], "--further-streams", 3)
    assert used(late) == (1, 3)


def test_each_of_two_cameras_waits_until_its_own_background_is_known():
    rig.need_multicast()
    url = private_url()
    cameras = {0: rig.CAMERA, 3: SIDE}
    with rig.daemon(url, "--further-streams", 3), ThreadPoolExecutor() as both:
        senders = [Publisher(open_lcm(url), Setup(i, cameras[i], plate=rig.plate())) for i in cameras]
        waits = [both.submit(sender.meet, rig.PATIENCE) for sender in senders]
        assert [wait.result() for wait in waits] == [None, None]


def test_capture_names_the_camera_for_which_the_tracker_still_waits():
    rig.need_multicast()
    url = private_url()
    with rig.daemon(url, "--further-streams", 3):
        sender = Publisher(open_lcm(url), Setup(0, rig.CAMERA, plate=rig.plate()))
        with pytest.raises(UserError, match="status: waiting for a camera on GAIT_CAMERA_3$"):
            sender.meet(2)


def test_capture_does_not_begin_while_the_tracker_has_another_camera():
    """It would be used for ten seconds; each stream waits for its own."""
    rig.need_multicast()
    url, cameras = private_url(), {0: rig.CAMERA, 3: SIDE}
    with rig.daemon(url, "--further-streams", 3), ThreadPoolExecutor() as both:
        senders = [Publisher(open_lcm(url), Setup(i, cameras[i])) for i in cameras]
        assert [wait.result() for wait in [both.submit(s.meet, rig.PATIENCE) for s in senders]] == [
            None,
            None,
        ]
        other = Publisher(open_lcm(url), Setup(3, replace(SIDE, fx=SIDE.fx + 5)))
        with pytest.raises(UserError, match=r"status: not the camera in use: GAIT_CAMERA_3; a different cam"):
            other.meet(2)
        senders[0].meet(rig.PATIENCE)


def test_after_a_kill_two_streams_are_tracked_as_if_nothing_had_happened(tmp_path):
    rig.need_multicast()
    url, killed = private_url(), 8
    words = ["-n", 300, "--further-streams", 3, "--snapshot", tmp_path / "state", "--snapshot-s", 0.1]

    def feed(listener, first, stop):
        for i in range(first, stop):
            listener.send([second(i), *rig.frames(i, i + 1)])
            listener.until(lambda i=i: any(e.frame == i for e in listener.estimates), f"estimate {i}")
        return listener.estimates[-1]

    with rig.daemon(url, *words) as (listener, _):
        listener.ask(opening()[:-1], lambda s: s.background_mask == BOTH, "cameras and backgrounds")
        listener.ask(opening()[-1:], lambda s: s.state == s.ARMED, "a start")
        feed(listener, 0, killed)
        rig.kill(listener)
    with rig.daemon(url, *words) as (listener, finish):
        backgrounds = [event for event in opening() if "BACKGROUND" in event[0]]
        listener.ask(backgrounds, lambda s: s.background_mask == BOTH, "backgrounds")
        last = feed(listener, killed, FRAMES)
        assert f"the person of frame {killed - 1}, captured" in finish().words
    state = (tmp_path / "state").read_bytes()
    assert f"{last.tracker_digest % 2**64:016x}" == by_python(set(range(FRAMES)))
    with rig.daemon(url, *words) as (listener, finish):
        other = camera_message(replace(SIDE, fx=SIDE.fx + 5), 1)
        listener.ask([("GAIT_CAMERA_3", other)], lambda s: s.state != s.RUNNING, "the other camera")
        assert "is followed if" in finish().words
    (tmp_path / "state").write_bytes(state)
    with rig.daemon(url, *words, "--further-streams", 4) as (_, finish):
        assert "is not used: for --further-streams 3" in finish().words


@pytest.mark.parametrize("streams", ["0", "1,1", "1,", "x", "31", "1,2,3,4"])
def test_numbers_that_are_no_further_cameras_are_refused(streams):
    done = rig.run(*rig.command("--further-streams", streams, "--url", "file:///nothing")[1:])
    assert done.code == 2 and "at most 3 numbers of cameras other than" in done.words
