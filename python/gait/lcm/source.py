"""Where frames come from: a video file or a camera of this machine."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from gait.errors import UserError
from gait.io.video import Frame, Video


class FileSource:
    """Frames `start` <= index < `stop` of a video file, once or for ever.

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
        """Video time of one frame, seconds, exactly as `frames` gives it."""
        for frame in self.video.frames(index, index + 1, grey=True):
            return frame.time
        raise UserError(f"{self.video.path}: has no frame {index}; it has {self.video.count}, counted from 0")

    def frames(self) -> Iterator[Frame]:
        """Yield the frames; numbers and times go on through repetitions, one frame interval apart."""
        shift_number, shift_time = 0, 0.0
        while True:
            number = time_ = None
            for index, seconds, image in self.video.frames(self._start, self._stop, grey=self._grey):
                number, time_ = index + shift_number, seconds + shift_time
                yield Frame(number, time_, image)
            if not self._loop or number is None or time_ is None:
                return
            shift_number = number + 1 - self._start
            shift_time = time_ + 1 / self.video.fps - self.first


class DeviceSource:
    """A camera of this machine by number or path (/dev/video0).

    A frame is stamped when it is grabbed; video time counts from when the device was opened.
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
        raise UserError(f"{self._name}: gives no more frames; is it unplugged?")


def is_device(name: str) -> bool:
    """Tell a camera of this machine from a file."""
    return name.isdigit() or Path(name).is_char_device()
