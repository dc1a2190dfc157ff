"""A camera on the network: an RTSP server that sends H.264, and fails on request."""

from __future__ import annotations

import re
import socketserver
import struct
import threading
from collections.abc import Iterator
from fractions import Fraction
from functools import cache
from typing import Any, NamedTuple

import av
import numpy as np

SIZE = 160, 120
CLOCK_HZ, FPS = 90_000, 25  # of RTP's time stamps, and of the pictures
DESCRIPTION = (
    "v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=camera\r\nc=IN IP4 0.0.0.0\r\nt=0 0\r\nm=video 0 RTP/AVP 96\r\n"
    "a=rtpmap:96 H264/90000\r\na=fmtp:96 packetization-mode=1\r\na=control:video\r\n"
)


class Answer(NamedTuple):
    """What the camera does with a connection: after the last frame it closes it, or hangs."""

    frames: int = 40
    status: int = 200  # of the answer to DESCRIBE
    hangs: str = ""  # method that is not answered; PLAY: it hangs after the last frame
    size: tuple[int, int] = SIZE


@cache
def pictures(frames: int, size: tuple[int, int]) -> list[list[bytes]]:
    """Encode noise about the grey levels 20, 25, ...; the NAL units of each frame."""
    noise = np.random.default_rng(1).integers(0, 16, size[::-1], np.uint8)
    encoder: Any = av.CodecContext.create("libx264", "w")
    encoder.width, encoder.height, encoder.pix_fmt = *size, "yuv420p"
    encoder.time_base = Fraction(1, FPS)
    encoder.options = {"tune": "zerolatency", "preset": "ultrafast"}
    made: list[list[bytes]] = []
    for k in range(frames):
        frame = av.VideoFrame.from_ndarray(noise + np.uint8(20 + 5 * k), format="gray")
        frame = frame.reformat(format="yuv420p")
        frame.pts = k
        made += (
            [unit for unit in re.split(rb"\x00\x00\x00?\x01", bytes(p)) if unit]
            for p in encoder.encode(frame)
        )
    return made


def packets(frames: int, size: tuple[int, int]) -> Iterator[bytes]:
    """Interleaved RTP packets (RFC 2326, 10.12), a NAL unit in each (RFC 6184, 5.6)."""
    sent = 0
    for k, units in enumerate(pictures(frames, size)):
        for unit in units:
            last = 0x80 if unit is units[-1] else 0
            head = struct.pack(">BBHII", 0x80, 96 | last, sent, k * CLOCK_HZ // FPS, 1)
            yield struct.pack(">cBH", b"$", 0, len(head) + len(unit)) + head + unit
            sent += 1


class _Connection(socketserver.StreamRequestHandler):
    server: RtspCamera

    def handle(self) -> None:
        camera = self.server
        camera.connections += 1
        if not camera.answers:
            camera.refused.set()
        answer = camera.answers.pop(0) if camera.answers else Answer(status=503)
        while (method := self._request()) and self._answered(method, answer):
            pass

    def _request(self) -> str:
        """Method of the next request; empty: there is none."""
        line = self.rfile.readline().decode()
        self._number = ""
        while (header := self.rfile.readline().decode().strip()) and line:
            name, _, value = header.partition(":")
            self._number = value.strip() if name.lower() == "cseq" else self._number
        return line.partition(" ")[0]

    def _answered(self, method: str, answer: Answer) -> bool:
        """Answer a request; False: the connection is over."""
        body, fields, status = "", "Session: 1", 200
        if method == answer.hangs != "PLAY":
            self.server.over.wait()
            return False
        if method == "OPTIONS":
            fields = "Public: DESCRIBE, SETUP, PLAY, TEARDOWN"
        elif method == "DESCRIBE":
            body, fields, status = DESCRIPTION, "Content-Type: application/sdp", answer.status
        elif method == "SETUP":
            fields = "Session: 1\r\nTransport: RTP/AVP/TCP;unicast;interleaved=0-1"
        head = (
            f"RTSP/1.0 {status} ?\r\nCSeq: {self._number}\r\n{fields}\r\nContent-Length: {len(body)}\r\n\r\n"
        )
        self.wfile.write((head + body).encode())
        if method == "PLAY":
            for packet in packets(answer.frames, answer.size):
                self.wfile.write(packet)
            if answer.hangs == "PLAY":
                self.server.over.wait()
        return method not in ("PLAY", "TEARDOWN") and status == 200


class RtspCamera(socketserver.ThreadingTCPServer):
    """Serves `url` in a thread until `close`; each connection gets the next of `answers`, then refusals."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Connection)
        self.answers: list[Answer] = []
        self.connections = 0
        self.refused = threading.Event()  # as there was no answer left
        self.over = threading.Event()
        self.url = f"rtsp://user:secret@127.0.0.1:{self.server_address[1]}/live"
        threading.Thread(target=self.serve_forever, args=(0.02,), daemon=True).start()

    def handle_error(self, *_: Any) -> None:
        """The other side may close the connection at any time."""

    def close(self) -> None:
        self.over.set()
        self.shutdown()
        self.server_close()
