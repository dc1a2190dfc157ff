"""Send frames, calibration, empty scene and start to a tracker."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from typing import Any

from gait.bindings.initial import Start
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.video import Frame, Image
from gait.lcm.ahead import ahead
from gait.lcm.link import handle, publisher
from gait.lcm.log import LogWriter
from gait.lcm.messages import camera_message, command_message, decode, image_message
from gait.lcm.pacing import Pacer
from gait.lcm.source import DeviceSource, FileSource
from gait.lcm.types import gaitmsg

ANNOUNCE = 2.0  # seconds of video between two announcements of camera and empty scene
_AHEAD = 8  # frames decoded before they are due
_ASK = 0.5  # seconds until a question to the tracker is repeated
_LEAD = 0.5  # seconds from START to the first frame, in which the tracker can confirm


@dataclass
class Setup:
    """What is sent beside the frames.

    Attributes
    ----------
    stream : int
        Number of the camera.
    camera : Camera or None
    plate : image or None
        Empty scene.
    start : Start or None
        First state of the walker.
    start_time : float
        Video time of `start`, seconds.
    jpeg : int or None
        Quality of compressed frames.
    """

    stream: int = 0
    camera: Camera | None = None
    plate: Image | None = None
    start: Start | None = None
    start_time: float = 0.0
    jpeg: int | None = None


class Publisher:
    """One stream of frames on ``GAIT_IMAGE_<i>`` and what belongs to it.

    Attributes
    ----------
    sent : int
        Frames sent.
    """

    def __init__(self, url: str, setup: Setup) -> None:
        self._setup, self._out = setup, publisher(url)
        self._status: Any = None
        self._announced = 0.0
        self.sent = 0
        if not isinstance(self._out, LogWriter):
            self._out.subscribe("GAIT_STATUS", self._on_status).set_queue_capacity(8)

    def meet(self, patience: float) -> None:
        """Announce until a tracker has said that it knows camera and empty scene.

        Raises
        ------
        UserError
            If none has after `patience` seconds.
        """
        self._ask(patience, lambda: self.announce(0), self._is_ready, "knows the camera")

    def begin(self, source: FileSource | DeviceSource, rate: float | None, patience: float) -> Pacer:
        """Announce, send START and return the clock of the stream, whose first frame is due from then on.

        With `patience` > 0 START is repeated, each time for a later stream, until a tracker confirms it.  The
        START of a file is for one capture time; that of a live camera is for the frame that comes next.
        """
        self._announced = source.first
        if self._setup.start is None or patience <= 0 or isinstance(self._out, LogWriter):
            pacer = Pacer(rate, source.first)
            self.announce(pacer.utime(source.first))
            if self._setup.start is not None:
                self._send_start(0 if source.live else pacer.utime(self._setup.start_time))
            return pacer
        deadline = time.monotonic() + patience
        while time.monotonic() < deadline:
            pacer = Pacer(rate, source.first, 0.0 if source.live else _LEAD)
            asked = self._send_start(0 if source.live else pacer.utime(self._setup.start_time))
            if self._listen(0.8 * _LEAD, partial(_confirms, asked)):
                return pacer
        raise UserError(
            f"no tracker confirmed START within {patience:g} s; is gait-trackd running on this URL?"
        )

    def close(self) -> None:
        """Write what waits, into a log."""
        if isinstance(self._out, LogWriter):
            self._out.close()

    def send(
        self,
        frames: Iterable[Frame],
        pacer: Pacer,
        done: Callable[[int], None],
        whole: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        """Send each frame when it is due; `done` is told the number of each.

        What goes out does so in a block of `whole`, where no interrupt may come.
        """
        channel = f"GAIT_IMAGE_{self._setup.stream}"
        for number, seconds, data in ahead(self._encoded(frames, pacer), _AHEAD):
            if seconds - self._announced >= ANNOUNCE:
                self._announced = seconds
                with whole():
                    self.announce(pacer.utime(seconds))
            pacer.wait(seconds)
            with whole():
                self._out.publish(channel, data)
                self.sent += 1
            done(number)

    def _encoded(self, frames: Iterable[Frame], pacer: Pacer) -> Iterator[tuple[int, float, bytes]]:
        """Yield number, video time and message of each frame."""
        for frame in frames:
            message = image_message(frame.image, pacer.utime(frame.time), frame.number, self._setup.jpeg)
            yield frame.number, frame.time, message.encode()

    def announce(self, utime: int) -> None:
        """Send calibration and empty scene, as far as they are known."""
        stream, setup = self._setup.stream, self._setup
        if setup.camera is not None:
            self._out.publish(f"GAIT_CAMERA_{stream}", camera_message(setup.camera, utime).encode())
        if setup.plate is not None:
            self._out.publish(f"GAIT_BACKGROUND_{stream}", image_message(setup.plate, utime, -1).encode())

    def _send_start(self, utime: int) -> int:
        """Send START for capture time `utime`; return its id."""
        start = self._setup.start
        assert start is not None
        command = command_message(gaitmsg.command_t.START, utime, start.mean, start.sd)
        self._out.publish("GAIT_COMMAND", command.encode())
        return int(command.id)

    def _is_ready(self, status: Any) -> bool:
        plate = self._setup.plate is None or bool(status.background_mask >> self._setup.stream & 1)
        return plate and status.state != gaitmsg.status_t.WAITING

    def _ask(
        self, patience: float, question: Callable[[], None], answered: Callable[[Any], bool], what: str
    ) -> None:
        deadline = time.monotonic() + patience
        while time.monotonic() < deadline:
            question()
            if self._listen(_ASK, answered):
                return
        heard = f"; it says: {self._status.text}" if self._status else "; none was heard"
        raise UserError(
            f"no tracker {what} after {patience:g} s{heard}; start gait-trackd on the same URL first"
        )

    def _listen(self, seconds: float, wanted: Callable[[Any], bool]) -> bool:
        """Wait for a status that is `wanted`."""
        assert not isinstance(self._out, LogWriter), "a log does not answer"
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0:
            handle(self._out, left, log=False)
            if self._status is not None and wanted(self._status):
                return True
        return False

    def _on_status(self, channel: str, data: bytes) -> None:
        self._status = decode(gaitmsg.status_t, data, channel)


def _confirms(command_id: int, status: Any) -> bool:
    return bool(status.command_id == command_id)
