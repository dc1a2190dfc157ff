"""Processes on one machine over UDP multicast: readiness by messages, loss and latency measured."""

import os
import re
import signal
import subprocess
import threading
import time
from pathlib import Path

import lcm
import lcm_rig as rig
import numpy as np
import pytest

from gait.io.track_file import read_track
from gait.io.video import Frame
from gait.lcm.capture import Pacer, Publisher, Setup
from gait.lcm.link import gaitmsg, now, open_lcm, private_url
from gait.lcm.messages import camera_message, command_message
from gait.lcm.record import Recorder

STATUS = gaitmsg.status_t
RUNNING = STATUS.RUNNING


@pytest.fixture
def url():
    rig.need_multicast()
    return private_url()


def clip(count):
    """Endless walk to and fro is not needed: frames of the clip, numbered on."""
    return [Frame(i, i / rig.FPS, rig.picture(i % 30)) for i in range(count)]


def ready(listener):
    listener.ask(
        rig.opening()[:2], lambda s: s.state == STATUS.READY and s.background_mask == 1, "the camera"
    )


def begin(listener, pacer):
    """START for frame 0 of a stream; sent until it is confirmed."""
    command = rig.start(0, at=pacer.utime(0.0))
    listener.ask([("GAIT_COMMAND", command)], lambda s: s.command_id == command.id, "the START")


@pytest.mark.long
def test_a_stream_at_thirty_hertz_arrives_and_is_tracked_in_time(url, tmp_path):
    """Capture here, tracker in another process, recorder in a thread: loss and latency of each step."""
    count = 60
    with rig.daemon(url) as (listener, finish):
        ready(listener)
        recorder = Recorder(url, str(tmp_path / "t.csv"), str(tmp_path / "e.log"))
        collect = threading.Thread(target=recorder.run, kwargs={"idle": 2.0, "patience": rig.PATIENCE})
        collect.start()
        publisher = Publisher(open_lcm(url), Setup())
        pacer = Pacer(None, 0.0, 0.5)
        begin(listener, pacer)
        publisher.send(clip(count), pacer, lambda number: None)
        collect.join()
        listener.until(lambda: listener.last.frames > 0, "a status")
        outcome = finish()
    figures = recorder.summary()
    assert outcome.code == 0 and outcome.rejected == 0
    # No estimate is lost between tracker and recorder, and every frame is either tracked or known as dropped.
    assert figures["lost"] == 0 and figures["frames"] == outcome.frames
    assert outcome.frames + outcome.dropped == count or outcome.frames == count - figures["dropped"]
    # On a machine shared with others a few frames may be skipped, but not most.
    assert outcome.frames >= count / 2, f"{outcome.dropped} of {count} frames dropped"
    assert 0 < figures["latency_ms"]["median"] < 1000
    assert figures["latency_ms"]["median"] >= figures["step_ms"]["median"]
    assert figures["digest"] == outcome.digest
    track = read_track(tmp_path / "t.csv")
    assert len(track.frame) == figures["frames"]
    np.testing.assert_allclose(track.time, track.frame / rig.FPS, atol=2e-5)
    print(f"sent {count}, tracked {outcome.frames}, latency {figures['latency_ms']}, late {pacer.late:.3f} s")


def test_the_newest_frame_wins_and_the_others_are_counted(url):
    """Five times faster than a slow tracker, which must skip frames instead of lagging behind."""
    count = 80
    with rig.daemon(url, "-n", 60000, "--max-gap", 60) as (listener, finish):
        ready(listener)
        begin(listener, Pacer())
        pacer = Pacer(60.0)
        Publisher(open_lcm(url), Setup()).send(clip(count), pacer, lambda number: None)
        listener.until(lambda: any(e.frame == count - 1 for e in listener.estimates), "the last frame")
        outcome = finish()
    frames = [e.frame for e in listener.estimates]
    assert frames == sorted(set(frames)) and frames[-1] == count - 1
    assert outcome.dropped > count / 2 and outcome.frames + outcome.dropped == count
    assert max(np.diff(frames)) > 2, "it skips several at a time"
    newest = [e.receive_utime for e in listener.estimates]
    sent = [pacer.origin + round(e.frame / 60 * 1e6) for e in listener.estimates]
    waited = np.subtract(newest, sent) / 1e6
    assert np.median(waited) < 0.5, "what is tracked was captured just before, not at the head of a queue"
    assert listener.estimates[-1].dropped == outcome.dropped
    assert [e.step for e in listener.estimates] == list(range(len(frames)))


def test_what_lcm_logger_recorded_is_tracked_again_with_the_same_bits(url, tmp_path):
    log = tmp_path / "all.log"
    logger = subprocess.Popen([Path(lcm.LCM_BIN_DIR) / "lcm-logger", "-q", "-l", url, log])
    try:
        with rig.daemon(url) as (listener, finish):
            # The logger listens once it has written a status; it writes to the disk every 100 ms.
            listener.until(lambda: log.is_file() and log.stat().st_size > 0, "the logger's first entry")
            ready(listener)
            pacer = Pacer(None, 0.0, 0.5)
            begin(listener, pacer)
            Publisher(open_lcm(url), Setup()).send(clip(30), pacer, lambda number: None)
            listener.until(lambda: any(e.frame == 29 for e in listener.estimates), "the last frame")
            live = finish()
    finally:
        logger.terminate()
        logger.wait(rig.PATIENCE)
    again = rig.play(log)
    assert again.frames + again.dropped == 30 and again.frames >= live.frames
    if live.dropped == 0 == again.dropped:
        assert again.digest == live.digest


def test_start_stop_and_reset_are_confirmed(url):
    with rig.daemon(url) as (listener, finish):
        assert listener.last.state == STATUS.WAITING
        ready(listener)
        assert listener.last.model_digest & (1 << 64) - 1 == rig.model().info.digest
        assert listener.last.memory_bytes > 1_000_000 and listener.last.particles == rig.PARTICLES
        start = rig.start(0, at=0)
        listener.ask([("GAIT_COMMAND", start)], lambda s: s.command_id == start.id, "START")
        assert listener.last.state == STATUS.ARMED
        stream = [("GAIT_IMAGE_0", rig.frame_message(i)) for i in range(3)]
        for i, event in enumerate(stream):
            listener.send([event])
            listener.until(lambda i=i: len(listener.estimates) > i, "an estimate")
        listener.until(lambda: listener.last.state == RUNNING and listener.last.frames == 3, "RUNNING")

        stop = command_message(gaitmsg.command_t.STOP)
        listener.ask([("GAIT_COMMAND", stop)], lambda s: s.command_id == stop.id, "STOP")
        assert listener.last.state == STATUS.READY and listener.last.frames == 3
        listener.send([("GAIT_IMAGE_0", rig.frame_message(3))])
        reset = command_message(gaitmsg.command_t.RESET)
        listener.ask([("GAIT_COMMAND", reset)], lambda s: s.command_id == reset.id, "RESET")
        assert (listener.last.state, listener.last.frames, listener.last.dropped) == (STATUS.READY, 0, 0)
        assert len(listener.estimates) == 3, "nothing was tracked after STOP"
        outcome = finish()
    assert outcome.code == 0 and outcome.frames == 0


@pytest.mark.long
def test_status_comes_every_second(url):
    with rig.daemon(url) as (listener, _):
        listener.statuses.clear()
        listener.until(lambda: len(listener.statuses) == 3, "three statuses", 6.0)
        apart = np.diff([s.utime for s in listener.statuses]) / 1e6
        assert (abs(apart - 1.0) < 0.5).all()
        assert listener.last.utime <= now() and listener.last.version == "0.1.0"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_end_it_in_good_order(url, number):
    process = subprocess.Popen(
        rig.command("--url", url), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    listener = rig.Listener(url)
    try:
        listener.until(lambda: bool(listener.statuses), "a first status")
        process.send_signal(number)
        printed, _ = process.communicate(timeout=rig.PATIENCE)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == 0 and printed.startswith("frames 0 dropped 0")


def test_damaged_messages_do_not_stop_a_running_tracker(url):
    with rig.daemon(url) as (listener, finish):
        ready(listener)
        raw = open_lcm(url)
        for channel in ("GAIT_IMAGE_0", "GAIT_CAMERA_0", "GAIT_BACKGROUND_0", "GAIT_COMMAND"):
            for data in (b"", b"\0" * 8, os.urandom(64), rig.frame_message(0).encode()[:500]):
                raw.publish(channel, data)
        listener.until(lambda: listener.last.rejected == 8, "eight rejected images")
        assert finish().code == 0


@pytest.mark.parametrize("line", ["damaged message", "searching for a person"])
def test_a_flood_reaches_neither_the_log_nor_the_status(line, url):
    """Two messages in turn, so that no line repeats the one before: junk, and commands between frames."""
    with rig.daemon(url) as (listener, finish):
        ready(listener)
        listener.statuses.clear()
        begun, raw, frame = time.monotonic(), open_lcm(url), rig.frame_message(0).encode()
        while time.monotonic() < begun + 1.5:  # past the second after which the lines left out are counted
            reset = command_message(gaitmsg.command_t.RESET).encode()
            junk = ("GAIT_CAMERA_0", b"junk"), ("GAIT_COMMAND", b"junk")
            for channel, data in (
                junk if line == "damaged message" else (("GAIT_COMMAND", reset), ("GAIT_IMAGE_0", frame))
            ):
                raw.publish(channel, data)
                time.sleep(0.002)  # LCM's queues are finite
        listener.until(lambda: bool(listener.statuses), "a status")
        words, seconds = finish().words, time.monotonic() - begun
        assert len(listener.statuses) <= 25 * seconds + 3
        assert 10 <= words.count(line) <= 10 * (seconds + 2)
        assert sum(map(int, re.findall(r"(\d+) more lines suppressed", words))) > 0


def test_a_sender_cannot_state_that_ten_seconds_have_passed(url):
    with rig.daemon(url) as (listener, finish):
        ready(listener)
        other = rig.CAMERA.scaled(0.5)
        stranger = [("GAIT_CAMERA_0", camera_message(other, 2_000_000 * k)) for k in range(12)]
        listener.ask(stranger, lambda s: "different camera" in s.text, "a complaint")
        listener.ask(rig.opening()[2:], lambda s: s.state == STATUS.ARMED, "a start")
        listener.send(rig.frames(0, 1))
        listener.until(lambda: bool(listener.estimates), "an estimate")
        assert "camera 80x60" not in finish().words


def test_two_daemons_on_one_url_are_reported_by_both(url):
    words = "another gait-trackd uses this URL"
    with rig.daemon(url) as (listener, finish), rig.daemon(url, "--particles", 80) as (_, finish_other):

        def reporting():
            return {status.particles for status in listener.statuses if words in status.text}

        listener.until(lambda: len(reporting()) == 2, "reports of both")
        assert [finish().words.count(words), finish_other().words.count(words)] == [1, 1]


def test_two_streams_do_not_meet(url):
    with rig.daemon(url, "--stream", 1) as (listener, finish):
        one = [(channel.replace("_0", "_1"), message) for channel, message in rig.opening()[:2]]
        listener.ask(rig.opening()[:2] + one, lambda s: s.background_mask == 2, "camera 1")
        start = rig.start(0, at=0)
        listener.ask([("GAIT_COMMAND", start)], lambda s: s.state == STATUS.ARMED, "START")
        listener.send([("GAIT_IMAGE_0", rig.frame_message(5)), ("GAIT_IMAGE_1", rig.frame_message(6))])
        listener.until(lambda: bool(listener.estimates), "an estimate")
        assert [e.frame for e in listener.estimates] == [6]
        assert finish().frames == 1
