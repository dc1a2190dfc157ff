"""Films of a tracked clip: the overlay video, and the smaller one embedded in a report."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import cv2
import numpy as np

from gait.errors import UserError
from gait.io.video import FAST, Image, VideoWriter

_MOST_FILM_BYTES = 5_000_000  # approximate largest size of a film in a page
_PIXELS = 1280 * 720  # largest size of its pictures
_BITS = 0.07  # bits per pixel and frame that x264 needs
_LEAST = 320  # least width in pixels, however long the film is
_CRF = 24
_SHOWN = 6  # pictures shown when the page is printed


@dataclass(frozen=True)
class PageFilm:
    """The film of a page.

    Attributes
    ----------
    data : str
        The file, base64.
    size : (int, int)
        Width and height, pixels.
    captured : (int, int)
        Width and height of the film that was tracked, pixels.
    frames : range
        Numbers of its frames in that film.
    rate : float
        Frames per second.
    pictures : list of (int, image)
        A few frames, with their numbers.
    """

    data: str
    size: tuple[int, int]
    captured: tuple[int, int]
    frames: range
    rate: float
    pictures: list[tuple[int, Image]]

    def note(self) -> str:
        """Describe the film's size, and whether it was scaled down."""
        (w, h), (a, b) = self.captured, self.size
        megabytes = f"{3 * len(self.data) / 4e6:.1f} MB"
        if (a, b) == (w + w % 2, h + h % 2):
            return f"The film in this page has the size of the tracked one, {w} × {h} pixels ({megabytes})."
        return f"The film in this page was scaled down from {w} × {h} to {a} × {b} pixels ({megabytes})."


class Films:
    """Writes drawn frames to the overlay video and the film of a page, if wanted.

    Use it as a context manager; after it has ended without error, `page` is the page's film.

    Parameters
    ----------
    overlay : str or None
        The overlay video.
    report : str or None
        The page that gets a film.
    frames : range
        Numbers of the frames that will be written.
    size : (int, int)
        Width and height of the frames, pixels.
    rate : float
        Frames per second.

    Raises
    ------
    UserError
        If a file cannot be written.
    """

    def __init__(
        self, overlay: str | None, report: str | None, frames: range, size: tuple[int, int], rate: float
    ) -> None:
        self._overlay, self._report, self._frames = overlay, report, frames
        self._size, self._rate = size, rate
        self._writers: list[VideoWriter] = []
        self._stack = ExitStack()
        self._pictures: list[tuple[int, Image]] = []
        self._written: list[int] = []
        self.page: PageFilm | None = None

    @property
    def wanted(self) -> bool:
        """Whether any film is to be written."""
        return self._overlay is not None or self._report is not None

    def __enter__(self) -> Films:
        if self._overlay is not None:
            writer = VideoWriter(self._overlay, self._rate, preset=FAST)
            self._writers.append(self._stack.enter_context(writer))
        if self._report is not None:
            self._inside = self._stack.enter_context(self._film_of_page(self._report))
        return self

    @contextmanager
    def _film_of_page(self, report: str) -> Iterator[VideoWriter]:
        """Write the page's film in a temporary folder and, if all goes well, read it."""
        self._small, bits = page_size(self._size, len(self._frames), self._rate)
        shown = np.linspace(0, len(self._frames) - 1, min(_SHOWN, len(self._frames))).round()
        self._shown = {self._frames[int(k)] for k in shown}
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "film.mp4")
            film = VideoWriter(file, self._rate, crf=_CRF, preset=FAST, bits_per_second=bits, keep=False)
            try:
                with film:
                    yield film
            except UserError as error:
                if not isinstance(error.__cause__, OSError):
                    raise
                where = f"{error.__cause__.strerror} in {tempfile.gettempdir()}, where its film is made"
                raise UserError(
                    f"{report}: {where}; set TMPDIR to a folder with more space"
                ) from error.__cause__
            if self._written:
                data = base64.b64encode(file.read_bytes()).decode("ascii")
                frames = range(self._written[0], self._written[0] + len(self._written))
                size = self._small[0] + self._small[0] % 2, self._small[1] + self._small[1] % 2
                self.page = PageFilm(data, size, self._size, frames, self._rate, self._pictures)

    def write(self, picture: Image, number: int) -> None:
        """Append a drawn frame with its number."""
        for writer in self._writers:
            writer.write(picture)
        if self._report is None:
            return
        small = picture
        if self._small != self._size:
            small = np.asarray(cv2.resize(picture, self._small, interpolation=cv2.INTER_AREA), np.uint8)
        self._inside.write(small)
        self._written.append(number)
        if number in self._shown:
            self._pictures.append((number, small))

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> bool | None:
        return self._stack.__exit__(kind, exc, trace)


def page_size(size: tuple[int, int], frames: int, rate: float) -> tuple[tuple[int, int], int]:
    """Choose the size in pixels of a page's film, and the bit rate that limits it to some megabytes."""
    width, height = size
    bits = 8 * _MOST_FILM_BYTES * rate / max(frames, 1)
    pixels = min(bits / (rate * _BITS), _PIXELS)
    scale = min(1.0, max(float(np.sqrt(pixels / (width * height))), _LEAST / max(width, height)))
    if scale == 1.0:
        return size, round(bits)
    return (2 * round(scale * width / 2), 2 * round(scale * height / 2)), round(bits)


def runs(status: list[str]) -> Iterator[tuple[str, int, int]]:
    """Yield runs of equal statuses: status, first index, index after the last."""
    edges = [0, *(k for k in range(1, len(status)) if status[k] != status[k - 1])]
    for first, after in zip(edges, [*edges[1:], len(status)], strict=True):
        yield status[first], first, after
