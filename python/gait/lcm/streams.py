"""Cameras that send a stream over the network: RTSP, HTTP and other URLs that FFmpeg can open."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from itertools import chain

import av
import numpy as np

from gait.errors import UserError
from gait.io.video import Frame
from gait.lcm.capture import DeviceSource
from gait.progress import note

_URL = re.compile(r"(rtsps?|rtmps?|https?|srt|tcp|udp)://", re.IGNORECASE)
_LOGIN = re.compile(r"(?<=://)[^/@]*@")
BROKEN: tuple[type[BaseException], ...] = (av.error.FFmpegError, OSError, ValueError)
"""Exceptions for a stream that cannot be opened or breaks off."""
STOPPED: tuple[type[BaseException], ...] = (*BROKEN, StopIteration)
"""The same, and the end of its frames."""
#: Seconds that connecting, analysing, and one read may take; at first the former two may take longer.
_FIRST, _OPEN, _READ = 8.0, 1.5, 1.25
_SLOWER = 2.0  # times as long as at first, which they may take again if that is more
#: Seconds before each attempt to reconnect; the last value is repeated.  So a camera that returns just after
#: an attempt began, which hangs, is asked again 2 * 1.5 + 1.25 + 0.5 s later.
_WAITS = (0.0, 0.25, 0.5)
#: One second, in microseconds, suffices to analyse a stream; RTSP over TCP loses no packets.
_OPTIONS = {"analyzeduration": "1000000", "flags": "low_delay", "rtsp_transport": "tcp"}


def is_stream(name: str) -> bool:
    """Whether a source is a URL of a stream."""
    return _URL.match(name) is not None


class StreamSource(DeviceSource):
    """A camera's stream, which is reconnected whenever it breaks off.

    A frame's time stamp is when it is decoded; video time 0 is when the stream was opened.  UserError if it
    cannot be opened at first, or comes back with pictures of another size.
    """

    def __init__(self, url: str, *, grey: bool = False, quiet: bool = False) -> None:
        self._url, self._grey, self._quiet = url, grey, quiet
        self._name = _LOGIN.sub("", url)  # no password in messages
        self._stopped = threading.Event()
        self._opened = time.monotonic()
        self._frames = self._connect(_FIRST)
        try:
            first = next(self._frames)
        except STOPPED as error:
            what = str(error).replace(url, self._name) or "it has no picture"
            raise UserError(f"{self._name}: cannot be opened ({what}); check the URL in a player") from None
        self._limit = max(_OPEN, _SLOWER * (time.monotonic() - self._opened))
        self.size = first.width, first.height
        self._frames = chain([first], self._frames)

    def frames(self) -> Iterator[Frame]:
        """Yield frames as they arrive, until `stop` is called."""
        number = 0
        while not self._stopped.is_set():
            try:
                for frame in self._frames:
                    if (frame.width, frame.height) != self.size:
                        now, before = (f"{w}x{h}" for w, h in ((frame.width, frame.height), self.size))
                        raise UserError(
                            f"{self._name}: came back with {now} pixels instead of {before}; start again"
                        )
                    image = np.asarray(frame.to_ndarray(format="gray" if self._grey else "bgr24"), np.uint8)
                    yield Frame(number, time.monotonic() - self._opened, image)
                    number += 1
            except BROKEN:
                pass
            self._frames = self._again()

    def stop(self) -> None:
        """Do not reconnect any more."""
        self._stopped.set()

    def _connect(self, limit: float) -> Iterator[av.VideoFrame]:
        """Open the stream, in two steps of at most `limit` seconds, and decode it; errors are `BROKEN`'s."""
        with closing(av.open(self._url, options=_OPTIONS, timeout=(limit, _READ))) as container:
            if not container.streams.video:
                raise ValueError("it has no video")
            yield from container.decode(video=0)

    def _again(self) -> Iterator[av.VideoFrame]:
        """Reconnect until a frame arrives; none if `stop` is called before."""
        note(f"{self._name}: connection lost; reconnecting", self._quiet)
        lost, waits = time.monotonic(), chain(_WAITS, iter(lambda: _WAITS[-1], None))
        while not self._stopped.wait(next(waits)):
            frames = self._connect(self._limit)
            try:
                first = next(frames)
            except STOPPED:
                continue
            note(f"{self._name}: back after {time.monotonic() - lost:.1f} s", self._quiet)
            return chain([first], frames)
        return iter(())
