"""gait capture of a stream: a local server breaks off, refuses, hangs, and returns; frames continue.

Over HTTP and over RTSP.
"""

import io
import signal
import subprocess
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import chain, repeat
from typing import NamedTuple

import numpy as np
import pytest

av = pytest.importorskip("av", reason="PyAV is not installed: extra video")
pytest.importorskip("lcm", reason="lcm is not installed: extra lcm")

import lcm_rig as rig  # noqa: E402
from rtsp_camera import Answer, RtspCamera  # noqa: E402

from gait.errors import UserError  # noqa: E402
from gait.lcm import streams  # noqa: E402
from gait.lcm.link import gaitmsg  # noqa: E402
from gait.lcm.streams import StreamSource, is_stream  # noqa: E402


def transport_stream(frames, size=(160, 120)):
    """Frames in MPEG-TS, noise about the grey levels 20, 40, ..."""
    out, noise = io.BytesIO(), np.random.default_rng(1).integers(0, 16, size[::-1], np.uint8)
    with av.open(out, "w", format="mpegts") as container:
        stream = container.add_stream("mpeg2video", rate=25)
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        for k in range(frames):
            grey = noise + np.uint8(20 * (k + 1))
            frame = av.VideoFrame.from_ndarray(grey, format="gray").reformat(format="yuv420p")
            for packet in stream.encode(frame):
                container.mux(packet)
        for packet in stream.encode(None):
            container.mux(packet)
    return out.getvalue()


class Hung(NamedTuple):
    after: int | None


@pytest.fixture
def camera():
    """A server that answers each request by the next of `camera.answers`: bytes, a status, or by hanging.

    `Hung` comes after that many bytes of an answer; None: before its header.
    """

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            times.append(time.monotonic())
            answer = server.answers.pop(0) if server.answers else 503
            if isinstance(answer, Hung):
                if answer.after is not None:
                    self.send_response(200)
                    self.send_header("Content-Type", "video/mp2t")
                    self.end_headers()
                    self.wfile.write(transport_stream(5)[: answer.after])
                    self.wfile.flush()
                server.over.wait()
                return
            self.send_response(answer if isinstance(answer, int) else 200)
            self.send_header("Content-Type", "video/mp2t")
            self.send_header("Content-Length", str(0 if isinstance(answer, int) else len(answer)))
            self.end_headers()
            if not isinstance(answer, int):
                self.wfile.write(answer)

        def log_message(self, *_):
            pass

    times = []
    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.answers, server.times, server.over = [], times, threading.Event()
    thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    server.url = f"http://user:secret@127.0.0.1:{server.server_port}/live.ts"
    yield server
    server.over.set()
    server.shutdown()
    server.server_close()


def test_frames_go_on_after_the_stream_broke_off(camera, capsys):
    camera.answers = [transport_stream(5), 503, 404, transport_stream(6)]
    source = StreamSource(camera.url, grey=True)
    assert source.size == (160, 120) and source.live
    frames, found = source.frames(), []
    while len(found) < 9:
        found.append(next(frames))
    assert [frame.number for frame in found] == list(range(9))
    assert all(np.diff([frame.time for frame in found]) >= 0)
    levels = [round(float(frame.image.mean())) for frame in found]
    start = next(k for k in range(1, 9) if levels[k] < levels[k - 1])
    assert 2 <= start <= 6 and len(camera.times) == 4
    assert found[start].time - found[start - 1].time < 5.0
    printed = capsys.readouterr().err
    assert "connection lost; reconnecting" in printed and "back after" in printed
    assert "secret" not in printed


@pytest.mark.parametrize("after", [None, 0, 400, 6000])
def test_a_camera_that_hangs_is_left_in_time(after, camera):
    """Before the header, before and in what is analysed, and between frames."""
    camera.answers = [transport_stream(5), Hung(after), *4 * [transport_stream(6)]]
    source = StreamSource(camera.url, grey=True, quiet=True)
    source._limit = streams._OPEN  # also on a busy machine
    frames = source.frames()
    for _ in range(11):
        next(frames)
    assert len(camera.times) >= 3
    limits = [streams._OPEN, streams._OPEN, streams._READ, max(streams._WAITS)]  # one after the other
    assert sum(limits) < 5.0


def test_a_slow_camera_has_twice_the_time_that_it_took_at_first(camera, monkeypatch):
    camera.answers = [transport_stream(2), *4 * [transport_stream(3)]]
    given, opened, clock = [], av.open, chain([0.0], repeat(3.0))
    monkeypatch.setattr(streams.av, "open", lambda *a, **k: given.append(k["timeout"][0]) or opened(*a, **k))
    monkeypatch.setattr(streams.time, "monotonic", lambda: next(clock))
    frames = StreamSource(camera.url, grey=True, quiet=True).frames()
    for _ in range(3):
        next(frames)
    assert given[:2] == [streams._FIRST, 6.0]


def test_a_stream_that_never_comes_is_one_line_without_the_password(camera):
    with pytest.raises(UserError, match="cannot be opened") as caught:
        StreamSource(camera.url)
    assert "secret" not in str(caught.value) and "\n" not in str(caught.value)


def test_another_size_ends_it(camera):
    camera.answers = [transport_stream(4), transport_stream(4, (96, 64))]
    source = StreamSource(camera.url, quiet=True)
    with pytest.raises(UserError, match="came back with 96x64 pixels instead of 160x120"):
        for _ in source.frames():
            pass


@pytest.fixture
def rtsp():
    camera = RtspCamera()
    yield camera
    camera.close()


def test_frames_of_an_rtsp_camera_go_on_after_every_fault(rtsp, capsys):
    faults = [Answer(status=503), Answer(status=404), Answer(frames=0)]
    hung = [Answer(hangs=method) for method in ("OPTIONS", "DESCRIBE", "SETUP")]
    rtsp.answers = [Answer(), *faults, *hung, Answer(frames=0, hangs="PLAY"), Answer(hangs="PLAY"), Answer()]
    source = StreamSource(rtsp.url, grey=True)
    source._limit = streams._OPEN  # also on a busy machine
    frames, found = source.frames(), []
    while rtsp.connections < 10:
        found.append(next(frames))
    assert [frame.number for frame in found] == list(range(len(found)))
    assert all(np.diff([frame.time for frame in found]) >= 0)
    levels = [round(float(frame.image.mean())) for frame in found]
    begun = [k for k in range(1, len(found)) if levels[k] < levels[k - 1]]
    assert len(begun) == 2 and begun[1] - begun[0] >= 39  # only the last frame of a connection may be lost
    printed = capsys.readouterr().err
    assert printed.count("connection lost; reconnecting") == 2 and "secret" not in printed


def test_an_rtsp_camera_of_another_size_ends_it(rtsp):
    rtsp.answers = [Answer(), Answer(size=(96, 64))]
    with pytest.raises(UserError, match="came back with 96x64 pixels instead of 160x120"):
        for _ in StreamSource(rtsp.url, quiet=True).frames():
            pass


def test_the_command_records_an_rtsp_camera_that_broke_off(rtsp, tmp_path):
    rtsp.answers = [Answer(), Answer()]
    log = tmp_path / "a.log"
    words = [rig.PYTHON, "-m", "gait", "capture", rtsp.url, "--grey", "--url", f"file://{log}?mode=w"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as command:
        try:
            assert rtsp.refused.wait(rig.PATIENCE)  # both streams have been read
            command.send_signal(signal.SIGINT)
            printed, words = command.communicate(timeout=rig.PATIENCE)
        finally:
            command.kill()
    assert command.returncode == 0, words
    images = rig.read_log(log, "GAIT_IMAGE_0", gaitmsg.image_t)
    assert 60 <= len(images) <= 80  # some may still wait to be sent
    assert all(np.diff([image.utime for image in images]) >= 0)
    assert "connection lost; reconnecting" in words and "secret" not in printed + words


def test_a_refused_rtsp_camera_is_one_line_without_the_password(rtsp):
    with pytest.raises(UserError, match="cannot be opened") as caught:
        StreamSource(rtsp.url)
    assert "secret" not in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "stream"),
    [
        ("rtsp://10.0.0.2/1", True),
        ("HTTP://cam/video", True),
        ("file:///a.mp4", False),
        ("0", False),
        ("a.mp4", False),
    ],
)
def test_urls(name, stream):
    assert is_stream(name) == stream
