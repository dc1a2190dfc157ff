"""Send frames, calibration, empty scene and start to a tracker, at the recorded frame rate."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from gait.ahead import ahead
from gait.bindings.initial import Start
from gait.camera.camera import Camera
from gait.errors import UsageError, UserError
from gait.io.video import Frame, Image, Video
from gait.lcm.link import LogWriter, gaitmsg, handle, now
from gait.lcm.messages import camera_message, command_message, decode, image_message
from gait.lcm.record import channel_of

if TYPE_CHECKING:
    import lcm


class FileSource:
    """Frames `start` <= index < `stop` of a video file, once or in a loop.

    Attributes
    ----------
    video : Video
    size : (int, int)
        Width and height, pixels.
    first : float
        Video time of frame `start`, seconds.
    """

    live = False

    def __init__(
        self, path: str, start: int = 0, stop: int | None = None, *, grey: bool = False, loop: bool = False
    ) -> None:
        self.video = Video(path)
        self.size = self.video.size
        self._start, self._stop, self._grey, self._loop = start, stop, grey, loop
        self.first = self.time_of(start)

    def time_of(self, index: int) -> float:
        """Video time of one frame, seconds, exactly as in `frames`."""
        for frame in self.video.frames(index, index + 1, grey=True):
            return frame.time
        raise UserError(f"{self.video.path}: has no frame {index}; it has {self.video.count}, counted from 0")

    def frames(self) -> Iterator[Frame]:
        """Yield the frames; in a loop, numbers and times continue, with one frame interval in between."""
        shift_number, shift_time = 0, 0.0
        while True:
            number = time_ = None
            for index, seconds, image, *_ in self.video.frames(self._start, self._stop, grey=self._grey):
                number, time_ = index + shift_number, seconds + shift_time
                yield Frame(number, time_, image)
            if not self._loop or number is None or time_ is None:
                return
            shift_number = number + 1 - self._start
            shift_time = time_ + 1 / self.video.fps - self.first


class DeviceSource:
    """A camera of this machine, by number or path (/dev/video0).

    A frame's time stamp is when it is grabbed; video time 0 is when the device was opened.
    """

    live = True

    def __init__(self, device: str, *, grey: bool = False) -> None:
        self._name, self._grey = device, grey
        self._capture = cv2.VideoCapture(int(device) if device.isdigit() else device)
        if not self._capture.isOpened():
            raise UserError(f"{device}: no such camera or it is in use; give a video file or a device")
        self._opened = time.monotonic()
        width, height = (
            int(self._capture.get(k)) for k in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
        )
        self.size = width, height

    @property
    def first(self) -> float:
        """Video time of a frame grabbed now, seconds."""
        return time.monotonic() - self._opened

    def frames(self) -> Iterator[Frame]:
        """Yield frames until the device ends."""
        number = 0
        while self._capture.grab():
            seconds = time.monotonic() - self._opened
            ok, image = self._capture.retrieve()
            if not ok:
                break
            pixels = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if self._grey else image
            yield Frame(number, seconds, np.asarray(pixels, np.uint8))
            number += 1
        raise UserError(f"{self._name}: sends no more frames; is it unplugged?")

    def stop(self) -> None:
        """Make `frames`, in another thread, end instead of waiting for a camera that may not return."""


def is_device(name: str) -> bool:
    """Whether a source is a camera of this machine, not a file."""
    return name.isdigit() or Path(name).is_char_device()


_MAX_HZ = 1000.0


class Pacer:
    """Decides when to send each frame, and its capture time.

    Capture times always follow the video's own clock; only the sending may be faster or slower.

    Parameters
    ----------
    rate : float or None
        Frames per second; None: as recorded; infinity: without waiting.
    first : float
        Video time of the first frame, seconds.
    lead : float
        Seconds from now until the first frame is due.
    at : int, optional
        Capture time of the first frame, microseconds since the Unix epoch; None: when it is due.

    Attributes
    ----------
    origin : int
        Capture time of video time 0, microseconds since the Unix epoch.
    late : float
        Largest delay of a frame after it was due, seconds.
    """

    def __init__(
        self,
        rate: float | None = None,
        first: float = 0.0,
        lead: float = 0.0,
        at: int | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._rate, self._first = rate, first
        self._clock, self._sleep = clock, sleep
        self._begin = clock() + lead
        self._sent = 0
        self.origin = (now() + round(lead * 1e6) if at is None else at) - round(first * 1e6)
        self.late = 0.0

    def utime(self, video_time: float) -> int:
        """Capture time of a frame `video_time` seconds into the video."""
        return self.origin + round(video_time * 1e6)

    def wait(self, video_time: float) -> None:
        """Wait until the frame at `video_time` seconds is due; do not wait if it is late."""
        after = video_time - self._first if self._rate is None else self._sent / self._rate
        self._sent += 1
        delay = self._begin + after - self._clock()
        if delay > 0:
            self._sleep(delay)
        elif self._rate != float("inf"):
            self.late = max(self.late, -delay)


def parse_rate(text: str) -> float | None:
    """Read ``true``, ``max`` or a number of frames per second, for `Pacer`."""
    if text == "true":
        return None
    if text == "max":
        return float("inf")
    try:
        hertz = float(text)
    except ValueError:
        hertz = 0.0
    if not 0 < hertz <= _MAX_HZ:
        raise UsageError(f"--rate {text}: give true, max or frames per second up to {_MAX_HZ:g}")
    return hertz


ANNOUNCE = 2.0  # seconds of video between announcements of camera and empty scene
_AHEAD = 8  # frames decoded before they are due
_ASK = 0.5  # seconds after which a message is repeated if the tracker does not answer
_HEARD = 0.25  # seconds after which a tracker has seen an announcement
_LEAD = 0.5  # seconds from START to the first frame, in which the tracker can confirm


@dataclass
class Setup:
    """What is sent in addition to the frames.

    Attributes
    ----------
    stream : int
        Number of the camera.
    camera : Camera or None
    cameras : mapping of int to Camera
        Camera of each frame, by frame number, if the camera moves.
    plate : image or None
        Empty scene.
    start : Start or None
        First state of the person.
    start_time : float
        Video time of `start`, seconds.
    jpeg : int or None
        Quality of compressed frames.
    begin_at : int or None
        Capture time of the first frame of a file, microseconds since the Unix epoch; None: when it is sent.
    person : int or None
        Of several people, the number of the one in `start`, whose tracker has to answer; None: people are not
        distinguished, and any tracker may confirm camera and empty scene.
    """

    stream: int = 0
    camera: Camera | None = None
    cameras: Mapping[int, Camera] = field(default_factory=dict)
    plate: Image | None = None
    start: Start | None = None
    start_time: float = 0.0
    jpeg: int | None = None
    begin_at: int | None = None
    person: int | None = None


_CAMERAS_REFUSED = re.compile("not the camera in use:([^;]*);")
"""Begin of the text of a status: channels on which another camera than the one in use was announced."""


class Publisher:
    """Sends one stream of frames on ``GAIT_IMAGE_<i>``, with calibration, empty scene and START.

    Parameters
    ----------
    out : LCM or LogWriter
        From `gait.lcm.link.publisher`.
    setup : Setup

    Attributes
    ----------
    sent : int
        Number of frames sent.
    """

    def __init__(self, out: lcm.LCM | LogWriter, setup: Setup) -> None:
        self._setup, self._out = setup, out
        self._status: Any = None
        self._answered = 0.0  # monotonic time of the last status
        self._other = ""  # channel of a status that is not waited for
        self._answers = channel_of(setup.person, "GAIT_STATUS")
        self._announced = 0.0
        self.sent = 0
        if not isinstance(self._out, LogWriter):
            self._out.subscribe("GAIT_STATUS(_[1-8])?", self._on_status).set_queue_capacity(8)

    def meet(self, patience: float) -> None:
        """Announce camera and empty scene until a tracker confirms them.

        Raises
        ------
        UserError
            If no tracker has after `patience` seconds.
        """
        asked = time.monotonic()

        def is_ready(status: Any) -> bool:
            return self._answered - asked >= _HEARD and self._is_ready(status)

        self._ask(patience, lambda: self.announce(0), is_ready, "knows the camera")

    def begin(self, source: FileSource | DeviceSource, rate: float | None, patience: float) -> Pacer:
        """Announce, send START and return the stream's clock, by which the first frame is due from now on.

        With `patience` > 0 START is repeated, each time for a later stream, until a tracker confirms it.  For
        a file, START names a capture time; for a live camera, it refers to the next frame.

        Raises
        ------
        UserError
            If no tracker confirms START, or the time at which to begin has passed.
        """
        self._announced = source.first
        if self._setup.start is None or patience <= 0 or isinstance(self._out, LogWriter):
            pacer = Pacer(rate, source.first, self._lead(0.0), self._setup.begin_at)
            self.announce(pacer.utime(source.first))
            if self._setup.start is not None:
                self._send_start(0 if source.live else pacer.utime(self._setup.start_time))
            return pacer
        deadline = time.monotonic() + patience
        while time.monotonic() < deadline:
            lead = self._lead(0.0 if source.live else _LEAD)
            pacer = Pacer(rate, source.first, lead, self._setup.begin_at)
            asked = self._send_start(0 if source.live else pacer.utime(self._setup.start_time))
            if self._listen(0.8 * _LEAD, partial(_confirms, asked)):
                return pacer
        remedy = "is gait-trackd running on this URL?"
        if self._setup.person is None and self._other:
            remedy = f"one of several people answers on {self._other}: give --person"
        raise UserError(f"no tracker confirmed START within {patience:g} s; {remedy}")

    def _lead(self, usual: float) -> float:
        """Seconds until the first frame is due; UserError if that has passed.  A log may be of any time."""
        at = self._setup.begin_at
        if at is None or isinstance(self._out, LogWriter):
            return usual
        lead = (at - now()) / 1e6
        if lead < 0:
            raise UserError(f"--begin-at: passed {-lead:.3g} s ago; give a later time, as seconds since 1970")
        return lead

    def send(
        self,
        frames: Iterable[Frame],
        pacer: Pacer,
        done: Callable[[int], None],
        whole: Callable[[], AbstractContextManager[None]] = nullcontext,
        stop: Callable[[], None] = lambda: None,
    ) -> None:
        """Send each frame when it is due; call `done` with its number.

        Messages are sent in a block of `whole`, in which interrupts wait; `stop` ends the source of `frames`.
        """
        channel = f"GAIT_IMAGE_{self._setup.stream}"
        for number, seconds, data in ahead(self._encoded(frames, pacer), _AHEAD, stop):
            if seconds - self._announced >= ANNOUNCE and not self._setup.cameras:
                self._announced = seconds
                with whole():
                    self.announce(pacer.utime(seconds))
            pacer.wait(seconds)
            with whole():
                if number in self._setup.cameras:
                    self._send_camera(self._setup.cameras[number], pacer.utime(seconds))
                self._out.publish(channel, data)
                self.sent += 1
            done(number)

    def _encoded(self, frames: Iterable[Frame], pacer: Pacer) -> Iterator[tuple[int, float, bytes]]:
        """Yield number, video time and message of each frame."""
        for frame in frames:
            message = image_message(frame.image, pacer.utime(frame.time), frame.number, self._setup.jpeg)
            yield frame.number, frame.time, message.encode()

    def announce(self, utime: int) -> None:
        """Send calibration and empty scene, if known."""
        stream, setup = self._setup.stream, self._setup
        if setup.camera is not None:
            self._send_camera(setup.camera, utime)
        if setup.plate is not None:
            self._out.publish(f"GAIT_BACKGROUND_{stream}", image_message(setup.plate, utime, -1).encode())

    def _send_camera(self, camera: Camera, utime: int) -> None:
        self._out.publish(f"GAIT_CAMERA_{self._setup.stream}", camera_message(camera, utime).encode())

    def _send_start(self, utime: int) -> int:
        """Send START for capture time `utime`; return its id."""
        start = self._setup.start
        assert start is not None
        command = command_message(gaitmsg.command_t.START, utime, start.mean, start.sd)
        self._out.publish(channel_of(self._setup.person, "GAIT_COMMAND"), command.encode())
        return int(command.id)

    def _is_ready(self, status: Any) -> bool:
        plate = self._setup.plate is None or bool(status.background_mask >> self._setup.stream & 1)
        others = _CAMERAS_REFUSED.match(status.text)
        refused = others is not None and f"GAIT_CAMERA_{self._setup.stream}" in others[1].split()
        return plate and not refused and status.state != gaitmsg.status_t.WAITING

    def _ask(
        self, patience: float, question: Callable[[], None], answered: Callable[[Any], bool], what: str
    ) -> None:
        deadline = time.monotonic() + patience
        while time.monotonic() < deadline:
            question()
            if self._listen(_ASK, answered):
                return
        why = "no status was received; start gait-trackd on the same URL first"
        if self._status:
            why = f"its status: {self._status.text}"
        elif self._other:
            why = (
                f"a tracker answers on {self._other}, none on {self._answers}: give --person as it has, "
                f"or leave it out"
            )
        raise UserError(f"no tracker {what} after {patience:g} s; {why}")

    def _listen(self, seconds: float, wanted: Callable[[Any], bool]) -> bool:
        """Wait until a `wanted` status arrives; return whether one has."""
        assert not isinstance(self._out, LogWriter), "a log does not answer"
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0:
            handle(self._out, left, log=False)
            if self._status is not None and wanted(self._status):
                return True
        return False

    def _on_status(self, channel: str, data: bytes) -> None:
        if channel != self._answers:
            self._other = channel
        if channel == self._answers or self._setup.person is None:
            self._status, self._answered = decode(gaitmsg.status_t, data, channel), time.monotonic()


def _confirms(command_id: int, status: Any) -> bool:
    return bool(status.command_id == command_id)
