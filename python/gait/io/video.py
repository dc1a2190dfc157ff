"""Read and write video files (with PyAV, which includes FFmpeg), and make a plate of the empty scene.

PyAV and OpenCV are imported where they are used, so that pictures can be tracked without them.
"""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from fractions import Fraction
from pathlib import Path
from threading import Thread
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gait.ahead import BoundedQueue
from gait.errors import UserError
from gait.io.files import replacing, require_file

if TYPE_CHECKING:
    import av

    from gait.camera.camera import Camera
    from gait.camera.path import CameraPose

Image = NDArray[np.uint8]
"""A picture: (height, width) grey or (height, width, 3) BGR, uint8."""

_ONE = 1 << 16  # the number 1 in a display matrix, which is in fixed point
_CHUNK_BYTES = 100_000_000  # most bytes of pictures in memory when they are read backwards
EMPTY_SCENE_FRAMES = 40  # frames of a clip whose median is the empty scene
_WAITING = 4  # pictures that may wait for the encoder
_END = 3  # frames by which the stated duration may exceed that of the pictures
FAST = "veryfast"
"""Preset of x264 that takes 0.4 of the time of ``medium``; files are about as large."""
#: With AVX-512, on a busy machine, x264 sometimes wrote different files for the same pictures.
_SAME_BITS = {"x264-params": "asm=sse4.2"} if platform.machine() in ("x86_64", "AMD64") else {}
_CONTAINERS = (".mp4", ".mkv", ".mov")


class Frame(NamedTuple):
    """One frame of a video."""

    number: int
    """Position in the file, from 0."""
    time: float
    """Presentation time since the first frame of the file, seconds."""
    image: Image
    pose: CameraPose | None = None
    """Pose of the camera, if it moves."""
    plate: Image | None = None
    """The empty scene as seen with that pose, if known."""
    others: tuple[Frame | None, ...] = ()
    """Frames of further cameras at the same time, with the times and numbers in their own films."""

    def camera(self, lens: Camera) -> Camera:
        """Return the camera of this frame: `lens` with the pose of this frame, if it has one."""
        return lens if self.pose is None else self.pose.camera(lens)

    @property
    def utime(self) -> int:
        """Time in whole microseconds, as the tracker needs it."""
        return round(self.time * 1e6)


class Video:
    """A video file that can be read any number of times.

    Attributes
    ----------
    path : pathlib.Path
    width, height : int
        Pixels, after the rotation or mirroring that a phone stores beside the picture.
    fps : float
        Mean frames per second.
    count : int
        Number of frames to show: those of the file, without those that an edit list cuts off.  Some may be
        unreadable because of damage.
    times : ndarray of shape (count,)
        Presentation times, seconds since the first frame, from the file's index.
    digest : str
        Hash of the sizes of the coded pictures: the same for copies in other containers, but not for other
        films.

    Raises
    ------
    UserError
        If the file is missing or contains no video that can be decoded.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        import av

        self.path = Path(path)
        self._cut = ""  # where the file ends before the last of the frames that it states
        self._damaged: set[int] = set()  # frames, of those decoded so far
        require_file(self.path, "video file")
        try:
            self._probe()
        except av.error.FFmpegError as exc:
            raise self._unreadable(exc) from exc

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.width, self.height

    @property
    def broken(self) -> str | None:
        """A description, if the file ends before the frames that it states, or a decoded frame was damaged.

        It is complete only after the frames have been decoded.
        """
        found = [self._cut] if self._cut else []
        if self._damaged:
            found.append(f"frames are damaged: {len(self._damaged)}, first {min(self._damaged)}")
        return f"{self.path}: {'; '.join(found)}; copy it again if you need all frames" if found else None

    def span(self, start: int, stop: int | None) -> range:
        """Return the numbers of the frames start <= number < stop; UserError if there are none."""
        stop = self.count if stop is None else min(stop, self.count)
        if start >= stop:
            raise UserError(f"{self.path}: no frame from {start} up to {stop}; it has {self.count}")
        return range(start, stop)

    def frames(self, start: int = 0, stop: int | None = None, *, grey: bool = False) -> Iterator[Frame]:
        """Yield the frames `start` <= index < `stop` in order, as BGR or grey."""
        pixels = "gray" if grey else "bgr24"
        convert = _converter()
        for index, time, frame in self._decode(stop):
            if index >= start:
                yield Frame(index, time, self._upright(convert(frame, format=pixels)))

    def pick(self, wanted: Collection[int], progress: Callable[[int], None] | None = None) -> Iterator[Frame]:
        """Yield the frames with the numbers `wanted`, as BGR; `progress` as in `sample_frames`."""
        convert = _converter()
        for index, time, frame in self._decode(None):
            if index in wanted:
                yield Frame(index, time, self._upright(convert(frame, format="bgr24")))
            if progress is not None:
                progress(index)

    def backwards(self, stop: int, start: int = 0) -> Iterator[Frame]:
        """Yield the frames `start` <= index < `stop` from the last to the first, as BGR.

        Decodes the file once per chunk of frames, so that memory does not grow with their number.
        """
        chunk = max(8, _CHUNK_BYTES // (3 * self.width * self.height))
        for end in range(stop, start, -chunk):
            yield from reversed(list(self.frames(max(start, end - chunk), end)))

    def _probe(self) -> None:
        """Get the size from the first frame, the count from the packets; headers also count hidden frames."""
        import av

        with av.open(str(self.path)) as container:
            if not container.streams.video:
                raise UserError(f"{self.path}: has no video stream; give a file with pictures")
            stream = container.streams.video[0]
            self.fps = float(stream.average_rate or stream.guessed_rate or 30)
            unit = float(stream.time_base or 0)
            packets = [p for p in container.demux(stream) if p.size > 0]
            stamps = [p.pts for p in packets if not p.is_discard]
            self.count = len(stamps)
            self.times = _times(stamps, unit, self.fps)
            self.digest = hashlib.sha256(",".join(str(p.size) for p in packets).encode()).hexdigest()[:16]
            stated, more = stream.frames, 0
            if not stated and container.duration and len(container.streams) == 1:  # sound may be longer
                stated, more = round(container.duration * 1e-6 * self.fps), _END
            if len(packets) + more < stated:
                self._cut = f"breaks off after frame {self.count} of {stated}"
        for _, _, frame in self._decode(1):
            self.height, self.width = self._upright(_converter()(frame, format="gray")).shape
            return
        raise UserError(f"{self.path}: has no frame that can be decoded; convert it with ffmpeg first")

    def _decode(self, stop: int | None) -> Iterator[tuple[int, float, av.VideoFrame]]:
        """Yield index, time and raw frame; the frame rate replaces missing or non-increasing times."""
        import av

        last: float | None = None
        try:
            with av.open(str(self.path)) as container:
                container.streams.video[0].thread_type = "AUTO"
                origin = None
                for index, frame in enumerate(container.decode(video=0)):
                    if stop is not None and index >= stop:
                        return
                    raw = frame.time
                    origin = raw if origin is None else origin
                    time = index / self.fps if raw is None or origin is None else raw - origin
                    if last is not None and time <= last:
                        time = last + 1 / self.fps
                    last = time
                    if frame.is_corrupt:
                        self._damaged.add(index)
                    yield index, time, frame
        except av.error.FFmpegError as exc:
            raise self._unreadable(exc) from exc

    def _upright(self, frame: av.VideoFrame) -> Image:
        """Return a frame's pixels, rotated and mirrored as the container states."""
        image = np.asarray(frame.to_ndarray(), np.uint8)
        side_data: Any = frame.side_data.get("DISPLAYMATRIX")
        if side_data is None:
            return image
        matrix = np.frombuffer(side_data, np.int32, 9) / _ONE  # transforms row vectors (x, y, 1)
        x, y = ([round(float(value), 2) for value in matrix[row : row + 2]] for row in (0, 3))
        across = x[0] == 0  # whether the picture's columns become rows
        if sorted(map(abs, (*x, *y))) != [0, 0, 1, 1] or across != (y[1] == 0):
            raise UserError(
                f"{self.path}: its display matrix {x + y} is neither a rotation by 90 degrees nor a "
                "mirroring; convert it with ffmpeg"
            )
        if across:
            image = np.swapaxes(image, 0, 1)
        right, down = x[0] + y[0], x[1] + y[1]  # 1 or -1
        return np.ascontiguousarray(image[:: int(down), :: int(right)])

    def no_frame(self, first: int) -> UserError:
        """Return (do not raise) the error for a file whose frames from `first` on are damaged or missing."""
        return UserError(f"{self.path}: no frame from {first} on can be decoded; convert it again")

    def _unreadable(self, exc: av.error.FFmpegError) -> UserError:
        reason = exc.strerror or type(exc).__name__
        return UserError(f"{self.path}: cannot be read as video ({reason}); give a file that ffmpeg plays")


@contextmanager
def reporting_damage(video: Video, warn: Callable[[str], None]) -> Iterator[None]:
    """Call `warn` with `Video.broken`, if there is any, after a block that decodes the film."""
    try:
        yield
    finally:
        if broken := video.broken:
            warn(broken)


def _converter() -> Callable[..., av.VideoFrame]:
    """Return a converter of frames to a pixel format, set up once rather than for every frame."""
    from av.video.reformatter import VideoReformatter

    return VideoReformatter().reformat


def _times(stamps: list[int | None], unit: float, fps: float) -> NDArray[np.float64]:
    """Convert time stamps in decoding order to seconds since the first; use the rate if one is missing."""
    known = np.array(sorted(stamp for stamp in stamps if stamp is not None), float)
    if len(known) < len(stamps) or (np.diff(known) <= 0).any() or not unit > 0:
        return np.arange(len(stamps)) / fps
    return (known - known[:1]) * unit


class VideoWriter:
    """H.264 file that every player and browser can show; it gets its name when closed without error.

    Use it as a context manager and call `write` with pictures of the same size.  A width or height that is
    not even is extended by repeating the last pixel, as 4:2:0 video needs.  If the block is interrupted or a
    disk is full, the pictures encoded so far are kept as NAME.unfinished.SUFFIX.

    Parameters
    ----------
    path : path
        Name ending in .mp4, .mkv or .mov.
    fps : float
    crf : int
        Quality of x264, 0 (lossless) to 51; 18 is visually clean.
    preset : str
        Speed of x264: ``medium``, or `FAST` for pictures that are drawn while something else runs.
    bits_per_second : int, optional
        Highest bit rate over two seconds, whatever the quality.
    keep : bool
        Whether to keep the pictures written before an interrupt.
    keyframes : int, optional
        Most frames from one I-frame to the next; with few, seeking is fast and the file large.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        fps: float,
        *,
        crf: int = 18,
        preset: str = "medium",
        bits_per_second: int | None = None,
        keep: bool = True,
        keyframes: int | None = None,
    ) -> None:
        self.path = Path(path)
        if self.path.suffix.lower() not in _CONTAINERS:
            raise UserError(f"{path}: unknown video suffix; use one of {' '.join(_CONTAINERS)}")
        self._rate = Fraction(fps).limit_denominator(1001)
        self._options = {"crf": str(crf), "preset": preset} | _SAME_BITS
        if bits_per_second is not None:
            self._options |= {"maxrate": str(bits_per_second), "bufsize": str(2 * bits_per_second)}
        if keyframes is not None:
            self._options |= {"g": str(keyframes)}
        self._keep = keep
        self._stack = ExitStack()
        self._stream: av.VideoStream | None = None
        self._size: tuple[int, int] | None = None
        self._waiting: BoundedQueue[Image | None] = BoundedQueue(_WAITING)
        self._thread = Thread(target=self._encode_all, daemon=True)
        self._fault: Exception | None = None
        self._finished = False

    def __enter__(self) -> VideoWriter:
        import av

        temporary = self._stack.enter_context(
            replacing(self.path, partial=lambda _: self._keep and self._finished)
        )
        self._container = self._stack.enter_context(av.open(str(temporary), "w"))
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> bool | None:
        self._waiting.widen()  # an interrupt may have taken a place
        self._waiting.put(None)
        self._thread.join()
        if self._fault is None or kind is not None:
            return self._stack.__exit__(kind, exc, trace)
        with self._stack:
            raise self._fault

    def write(self, image: Image) -> None:
        """Append one picture, (h, w) grey or (h, w, 3) BGR, which must not be changed afterwards.

        A thread encodes it; its errors are raised by a later call or at the end.
        """
        if self._fault is not None:
            raise self._fault
        height, width = image.shape[:2]
        self._size = self._size or (width, height)
        if (width, height) != self._size:
            raise ValueError(f"{self.path}: frame of {width}x{height} in a video with another size")
        self._waiting.put(image)

    def _encode_all(self) -> None:
        """Encode queued pictures until None, then finish the file; after an error, only empty the queue."""
        while (image := self._waiting.get()) is not None:
            self._try(self._encode, image)
        if self._stream is not None:
            self._try(self._encode, None)
            self._finished = self._fault is None

    def _try(self, encode: Callable[[Image | None], None], image: Image | None) -> None:
        if self._fault is None:
            try:
                encode(image)
            except Exception as exc:
                self._fault = exc

    def _encode(self, image: Image | None) -> None:
        """Encode one picture; with None, flush the encoder."""
        import av

        frame = None
        if image is not None:
            height, width = image.shape[:2]
            if self._stream is None:
                self._stream = self._open(width + width % 2, height + height % 2)
            if height % 2 or width % 2:
                edges = ((0, height % 2), (0, width % 2), (0, 0))[: image.ndim]
                image = np.pad(image, edges, mode="edge")
            pixels = "gray" if image.ndim == 2 else "bgr24"
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format=pixels)
        assert self._stream is not None
        self._container.mux(self._stream.encode(frame))

    def _open(self, width: int, height: int) -> av.VideoStream:
        stream: av.VideoStream = self._container.add_stream("libx264", rate=self._rate, options=self._options)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        return stream


def sample_frames(
    video: Video, samples: int = EMPTY_SCENE_FRAMES, progress: Callable[[int], None] | None = None
) -> list[Frame]:
    """Read `samples` frames spread evenly over the clip.

    `progress` is called with the index of each frame decoded.
    """
    wanted = set(np.linspace(0, video.count - 1, min(samples, video.count)).round().astype(int).tolist())
    return list(video.pick(wanted, progress))


def median(images: Sequence[Image]) -> Image:
    """Median of pictures of the same size, pixel by pixel."""
    plate = np.empty_like(images[0])
    for row in range(plate.shape[0]):  # row by row: a median of the whole stack would need it twice in memory
        plate[row] = np.median([image[row] for image in images], axis=0)
    return plate


def median_plate(
    video: Video, samples: int = EMPTY_SCENE_FRAMES, progress: Callable[[int], None] | None = None
) -> Image:
    """Estimate the empty scene as the median over time of `samples` frames spread over the clip, BGR.

    This works where each pixel shows the background in more than half of the samples: with a static camera
    and a person who walks through the picture.  `progress` is called with the index of each frame decoded.
    """
    return median([frame.image for frame in sample_frames(video, samples, progress)])


def read_plate(path: str | os.PathLike[str], size: tuple[int, int]) -> Image:
    """Read the empty scene from an image file, BGR, and check its (width, height)."""
    import cv2

    require_file(path, "background image", "give an image file, auto or none")
    plate = cv2.imread(str(path), cv2.IMREAD_COLOR_BGR)
    if plate is None:
        raise UserError(f"{path}: cannot be read as an image; give a PNG or JPEG of the empty scene")
    height, width = plate.shape[:2]
    if (width, height) != tuple(size):
        raise UserError(
            f"{path}: is {width}x{height}, the video {size[0]}x{size[1]}; give both in the same size"
        )
    return np.asarray(plate, np.uint8)


def write_picture(path: Path, picture: Image) -> None:
    """Write a BGR or grey picture in the format of the file's suffix; OSError names what is wrong."""
    import cv2

    path.write_bytes(cv2.imencode(path.suffix, picture)[1].tobytes())  # OpenCV's own writer states no reason


def background(choice: str, video: Video, progress: Callable[[int], None] | None = None) -> Image | None:
    """Make the plate for the ``--background`` option: ``auto`` (median), ``none`` or an image file."""
    if choice == "none":
        return None
    if choice == "auto":
        return median_plate(video, progress=progress)
    return read_plate(choice, video.size)
