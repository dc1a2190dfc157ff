"""gait capture of a stream: a local server breaks off, refuses, and returns; frames continue."""

import io
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest

av = pytest.importorskip("av", reason="PyAV is not installed: extra video")
pytest.importorskip("lcm", reason="lcm is not installed: extra lcm")

from gait.errors import UserError  # noqa: E402
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


@pytest.fixture
def camera():
    """A server that answers each request by the next of `camera.answers`: bytes, or a status."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            times.append(time.monotonic())
            answer = server.answers.pop(0) if server.answers else 503
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
    server.answers, server.times = [], times
    thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    server.url = f"http://user:secret@127.0.0.1:{server.server_port}/live.ts"
    yield server
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
