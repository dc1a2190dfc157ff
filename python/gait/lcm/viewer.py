"""Match estimates with their frames and show them in a browser."""

from __future__ import annotations

import contextlib
import select
import threading
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import cv2
import numpy as np

from gait.bindings.estimate import Estimate
from gait.bindings.model import Model
from gait.bindings.state import POSE_SCALARS
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.video import Image
from gait.lcm.link import gaitmsg, handle, is_log, listener
from gait.lcm.messages import camera_of, decode, estimate_of, picture
from gait.report.drawing import Overlay

_KEPT = 64  # frames that wait for their estimate
_FURTHEST = 1e6  # metres, or anything else that is drawn
_MOST = 16  # browsers at a time
_WAIT = 5.0  # seconds for a picture
_PART = "gait-frame"
_PAGE = b"""<!DOCTYPE html><html><head><meta charset="utf-8"><title>gait view</title></head>
<body style="margin:0;background:#222;text-align:center">
<img src="/stream" style="max-width:100%"></body></html>"""


class Viewer:
    """Draws each estimate into its own frame.

    Parameters
    ----------
    url : str
    stream : int
        Number of the camera.
    model : Model
        Whose body is drawn.
    camera : Camera, optional
        Taken from ``GAIT_CAMERA_<i>`` if left out.
    show : callable
        Gets each finished BGR picture.

    Attributes
    ----------
    damage : str or None
        Describes what is wrong with the first message that could not be shown.
    """

    def __init__(
        self, url: str, stream: int, model: Model, camera: Camera | None, show: Callable[[Image], None]
    ) -> None:
        self._lcm, self._log = listener(url), is_log(url)
        self._model, self._show = model, show
        self._overlay: Overlay | None = None
        self._given = camera is not None
        if camera is not None:
            self._use(camera)
        self._frames: dict[int, Any] = {}
        self._origin: int | None = None
        self.damage: str | None = None
        for channel, handler, capacity in (
            (f"GAIT_IMAGE_{stream}", self._on_image, _KEPT),
            (f"GAIT_CAMERA_{stream}", self._on_camera, 1),
            ("GAIT_ESTIMATE", self._on_estimate, _KEPT),
        ):
            self._lcm.subscribe(channel, handler).set_queue_capacity(capacity)

    def handle(self, seconds: float) -> bool:
        """Take in a message, waiting at most so long, but for damaged ones; False at the end of a log."""
        try:
            return handle(self._lcm, seconds, self._log)
        except UserError as fault:
            self.damage = self.damage or str(fault)
            return True

    def _on_image(self, channel: str, data: bytes) -> None:
        message = decode(gaitmsg.image_t, data, channel)
        self._frames[message.utime] = message
        while len(self._frames) > _KEPT:
            del self._frames[next(iter(self._frames))]

    def _on_camera(self, channel: str, data: bytes) -> None:
        if not self._given:  # the newest counts: an earlier one may have been wrong
            self._use(camera_of(decode(gaitmsg.camera_t, data, channel)))

    def _use(self, camera: Camera) -> None:
        self._overlay, self._size = Overlay(self._model, camera), camera.size

    def _on_estimate(self, channel: str, data: bytes) -> None:
        message = decode(gaitmsg.estimate_t, data, channel)
        image = self._frames.pop(message.utime, None)
        if image is None or self._overlay is None:
            return
        estimate, pixels = estimate_of(message), picture(image)
        if estimate.joint_names != self._model.joint_names:
            raise UserError(
                f"{channel}: an estimate of other joints than the model's; give the model tracked"
            )
        if not _plausible(estimate):
            raise UserError(f"{channel}: an estimate with numbers that are not finite")
        if pixels.shape[1::-1] != self._size:
            size, own = ("{}x{}".format(*pair) for pair in (pixels.shape[1::-1], self._size))
            raise UserError(f"{channel}: a picture of {size}, the camera's is {own}; give its --camera")
        self._origin = message.utime if self._origin is None else self._origin
        # The panel shows seconds since the first frame seen, not the time of the day.
        estimate = replace(estimate, utime=message.utime - self._origin)
        self._show(self._overlay.draw(pixels, estimate, message.frame))


def _plausible(estimate: Estimate) -> bool:
    """Whether all numbers that are drawn are finite and on this planet."""
    mean = [getattr(estimate.mean, name) for name in POSE_SCALARS]
    numbers = np.concatenate([estimate.joints.ravel(), estimate.joint_sd.ravel(), estimate.mean.pelvis, mean])
    drawn = np.array([*numbers, estimate.speed, estimate.ess])
    return bool((np.abs(drawn) < _FURTHEST).all())  # False for NaN


class Screen:
    """The newest picture, for any number of browsers on this machine.

    Parameters
    ----------
    port : int
        Of 127.0.0.1; 0: any that is free.

    Attributes
    ----------
    address : str
        What to open in a browser.
    """

    def __init__(self, port: int) -> None:
        self._new = threading.Condition()
        self._jpeg, self._count, self._closed = b"", 0, False
        try:
            self._server = _Server(("127.0.0.1", port), partial(_Request, self))
        except (OSError, OverflowError) as exc:
            raise UserError(f"--port {port}: cannot be opened ({exc}); give another, or 0 for any") from None
        self.hosts = {f"{name}:{self._server.server_address[1]}" for name in ("127.0.0.1", "localhost")}
        self.address = f"http://127.0.0.1:{self._server.server_address[1]}/"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def show(self, image: Image) -> None:
        """Make `image` the newest."""
        jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes()
        with self._new:
            self._jpeg, self._count = jpeg, self._count + 1
            self._new.notify_all()

    def after(self, count: int) -> tuple[bytes, int]:
        """Wait a few seconds for a later picture than that of this count; return the newest and its count."""
        with self._new:
            self._new.wait_for(lambda: self._count > count or self._closed, _WAIT)
            return self._jpeg, self._count

    @property
    def closed(self) -> bool:
        """Whether nothing more is shown."""
        return self._closed

    def close(self) -> None:
        """Serve no more."""
        with self._new:
            self._closed = True
            self._new.notify_all()
        self._server.shutdown()
        self._server.server_close()


class _Server(ThreadingHTTPServer):
    """A thread for each browser, but not more than `_MOST`; others are sent away."""

    daemon_threads = True

    def __init__(self, *words: Any) -> None:
        self._free = threading.BoundedSemaphore(_MOST)
        super().__init__(*words)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a browser in a thread, if there is one for it."""
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            with contextlib.suppress(OSError):
                request.sendall(b"HTTP/1.0 503 Too many browsers\r\nContent-Length: 0\r\n\r\n")
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve, and leave the thread to others."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Report nothing: a browser that breaks off is no fault of ours."""


class _Request(BaseHTTPRequestHandler):
    """/ is a page with the moving picture, /stream the picture itself, /frame.jpg one of it."""

    def __init__(self, screen: Screen, *rest: Any) -> None:
        self._screen = screen
        super().__init__(*rest)

    timeout = 3 * _WAIT  # seconds for a browser that sends or takes nothing

    def do_GET(self) -> None:
        """Answer, for as long as the browser stays."""
        if self.headers.get("Host") not in self._screen.hosts:  # a page elsewhere that leads here by its name
            self.send_error(403)
        elif self.path == "/":
            self._answer("text/html; charset=utf-8", _PAGE)
        elif self.path == "/frame.jpg":
            jpeg = self._screen.after(0)[0]
            if jpeg:
                self._answer("image/jpeg", jpeg)
            else:
                self.send_error(503, "No picture yet")
        elif self.path == "/stream":
            self._stream()
        else:
            self.send_error(404)

    def log_message(self, format: str, *args: Any) -> None:
        """Log nothing: stderr is for the user."""

    def _answer(self, kind: str, body: bytes) -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def _stream(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", f"multipart/x-mixed-replace; boundary={_PART}")
        self.end_headers()
        count = 0
        with contextlib.suppress(OSError):  # the browser has left
            while not self._screen.closed and not self._left():
                jpeg, count = self._screen.after(count)
                if jpeg:
                    head = f"--{_PART}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
                    self.wfile.write(head.encode("ascii") + jpeg + b"\r\n")

    def _left(self) -> bool:
        """Whether the browser has closed the connection; it sends nothing after its request."""
        return bool(select.select([self.connection], [], [], 0)[0])
