"""Logs recorded by the live page: complete or marked as unfinished, and beginning with the camera."""

import errno
import fcntl
import json
import os
import threading
import time
from copy import copy
from io import FileIO
from pathlib import Path
from urllib.request import Request, urlopen

import lcm
import lcm_rig as rig
import pytest

from gait.errors import UserError
from gait.lcm import link
from gait.lcm.link import events_of, open_lcm, private_url
from gait.live.feed import Feed
from gait.live.recording import Recording
from gait.live.server import Page


def test_a_recording_has_a_log_for_each_persons_tracker(tmp_path):
    rig.need_multicast()
    urls = [private_url() for _ in range(3)]
    recording = Recording(urls[0], urls[1:], tmp_path, lambda: None)
    senders, deadline = [rig.Listener(url) for url in urls], time.monotonic() + rig.PATIENCE
    while not all(map(rig.written, recording.paths)) and time.monotonic() < deadline:
        for k, sender in enumerate(senders):
            sender.send(rig.frames(k, k + 1))
            sender.listen(20)
    recording.end()
    assert [path.stem.partition("-person-")[2] for path in recording.paths] == ["", "1", "2"]
    for k, path in enumerate(recording.paths):
        wanted = rig.frames(k, k + 1)[0][1].encode()
        assert {event.data for event in lcm.EventLog(str(path), "r")} == {wanted}


def test_a_recording_begins_with_camera_and_background(tmp_path):
    """They may have come long before."""
    opening = [*rig.opening(), ("GAIT_BACKGROUND_0", rig.frames(0, 1)[0][1]), *rig.frames(0, 1)]
    camera = next(message for channel, message in opening if channel == "GAIT_CAMERA_0")
    wrong = copy(camera)
    wrong.fx = 0.0
    opening += [("GAIT_CAMERA_0", wrong), ("GAIT_BACKGROUND_0", camera)]  # not kept, nor of other numbers
    opening += [(f"GAIT_{kind}_{k}", camera) for kind in ("CAMERA", "BACKGROUND") for k in (31, 100, "01")]
    url = f"file://{rig.write_log(tmp_path / 'in.log', opening)}?speed=0"
    feed = Feed(url, [0], rig.model(), {}, lambda *_: None)
    while feed.handle(1.0):
        pass
    scene = feed.scene
    assert set(scene) == {"GAIT_CAMERA_0", "GAIT_BACKGROUND_0"} and scene["GAIT_CAMERA_0"] == camera.encode()
    rig.need_multicast()
    recording = Recording(private_url(), [], tmp_path, lambda: None, scene)
    recording.end()
    assert {event.channel: event.data for event in events_of(recording.paths[0])} == scene


def test_a_recording_for_which_there_is_no_space_is_marked(tmp_path, monkeypatch, capfd):
    """Whole messages are kept; stderr has the reason."""
    rig.need_multicast()
    full, real = threading.Event(), FileIO.write

    def write(self, data):
        if full.is_set():
            real(self, bytes(data)[:100])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(self, data)

    monkeypatch.setattr(link, "FileIO", type("Disk", (FileIO,), {"write": write}))
    ended = threading.Event()
    url = private_url()
    recording, sender = Recording(url, [], tmp_path, ended.set), rig.Listener(url)
    deadline = time.monotonic() + rig.PATIENCE
    while not ended.is_set() and time.monotonic() < deadline:
        sender.send(rig.frames(0, 1))
        sender.listen(20)
        if rig.written(recording.paths[0]):
            full.set()
    recording.end()
    kept = recording.paths[0].with_suffix(".unfinished.log")
    assert "No space left on device" in recording.fault and list(tmp_path.iterdir()) == [kept]
    assert {event.channel for event in events_of(kept)} == {"GAIT_IMAGE_0"}
    assert f"gait view: the recording has ended: {recording.paths[0]}" in capfd.readouterr().err


def test_a_recording_that_can_receive_no_more_is_marked(tmp_path, monkeypatch):
    """The messages before are kept, the fault names their file, and another recording can begin."""
    rig.need_multicast()

    def waiting(links, seconds):
        raise OSError(errno.EBADF, os.strerror(errno.EBADF))

    monkeypatch.setattr("gait.live.recording.waiting", waiting)
    page, reports = Page(0, [0], private_url(), tmp_path), []
    monkeypatch.setattr(page, "report", lambda _, value: reports.append(value))
    page.begin(dict, {"GAIT_CAMERA_0": b"camera"})
    try:
        first = Path(press(page, 1)["path"])
        page._recording.end()
        second = Path(press(page, 1)["path"])
        stopped = press(page, 0)
    finally:
        page.close()
    assert first != second and stopped["fault"] in [value.get("fault") for value in reports]
    for path in (first, second):
        kept = path.with_suffix(".unfinished.log")
        assert [event.channel for event in events_of(kept)] == ["GAIT_CAMERA_0"]
        words = f"Bad file descriptor; what was recorded is in {kept.name}"
        assert words in {value["path"]: value["fault"] for value in reports if value.get("fault")}[str(path)]


def press(page, on):
    """Press the page's record button."""
    own = page.address.rstrip("/")
    with urlopen(Request(f"{own}/record?on={on}", headers={"Origin": own}, method="POST")) as answer:
        return json.load(answer)


def test_a_killed_recording_is_marked_when_the_page_is_opened_again(tmp_path, capfd):
    left = tmp_path / ".gait-20260102-030405-person-2.0123456789abcdef.log"
    left.write_bytes(rig.write_log(tmp_path / "in.log", rig.frames(0, 2)).read_bytes()[:-100])
    Page(0, [0], private_url(), tmp_path).close()
    assert {p.name for p in tmp_path.iterdir()} == {"in.log", "gait-20260102-030405-person-2.unfinished.log"}
    whole = list(events_of(tmp_path / "gait-20260102-030405-person-2.unfinished.log"))
    assert [event.channel for event in whole] == ["GAIT_IMAGE_0"]
    assert "was killed; what it wrote is in" in capfd.readouterr().err


def test_no_two_pages_choose_one_name(tmp_path, monkeypatch):
    """While one chooses names and creates their files, another waits."""
    rig.need_multicast()
    real, refused = open_lcm, []

    def opened(url):
        other = os.open(tmp_path, os.O_RDONLY)
        try:
            fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            refused.append(len(list(tmp_path.glob(".gait-*.log"))))
        finally:
            os.close(other)
        return real(url)

    monkeypatch.setattr("gait.live.recording.open_lcm", opened)
    monkeypatch.setattr("time.strftime", lambda _: "gait-20260102-030405")
    (tmp_path / "gait-20260102-030405.unfinished.log").touch()
    both = [Recording(private_url(), [], tmp_path, lambda: None) for _ in range(2)]
    for one in both:
        one.end()
    assert refused == [1, 2]
    assert [one.paths[0].name for one in both] == [f"gait-20260102-030405-{k}.log" for k in (1, 2)]
    assert all(one.paths[0].is_file() for one in both)


def test_what_is_a_log_already_is_not_recorded(tmp_path):
    with pytest.raises(UserError, match="copy the file"):
        Recording(f"file://{tmp_path}/in.log", [], tmp_path, lambda: None)
