"""Further cameras that film the same walk, synchronised with the first one."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.camera.synchronise import Film, no_shared_frame, require_apart, synchronise
from gait.errors import UserError
from gait.io.video import Frame, Video
from gait.progress import note
from gait.track.clip_background import require_scene, stays
from gait.track.options import ClipOptions
from gait.track.read_scene import read_scene
from gait.track.scene import Scene

Array = NDArray[np.float64]


class SeveralVideos(Video):
    """The film of the first camera, in which each frame contains the other cameras' nearest frames.

    UserError if the frames of one of these have no partner among those of the first film.

    Parameters
    ----------
    video : Video
    others : sequence of Video
    offsets : sequence of float
        Start of each of these, seconds after that of `video`.
    """

    def __init__(self, video: Video, others: Sequence[Video], offsets: Sequence[float]) -> None:
        self.path, self.fps, self.count, self.times = video.path, video.fps, video.count, video.times
        self.digest = video.digest
        self.width, self.height = video.size
        self._video, self._others = video, others
        self._partners = [
            _nearest(video.times, other.times + offset) for other, offset in zip(others, offsets, strict=True)
        ]
        for other, offset, partners in zip(others, offsets, self._partners, strict=True):
            if not (partners >= 0).any():
                raise no_shared_frame(str(other.path), str(video.path), offset, float(video.times[-1]))

    @property
    def broken(self) -> str | None:
        """As in `Video`, for all films."""
        return "; ".join(one.broken for one in (self._video, *self._others) if one.broken) or None

    def frames(self, start: int = 0, stop: int | None = None, *, grey: bool = False) -> Iterator[Frame]:
        """Yield the frames `start` <= index < `stop` in order, as BGR or grey."""
        beside = [
            self._beside(other, partners[start:stop], grey)
            for other, partners in zip(self._others, self._partners, strict=True)
        ]
        for frame in self._video.frames(start, stop, grey=grey):
            yield frame._replace(others=tuple(next(views, None) for views in beside))

    def pick(self, wanted: Collection[int], progress: object = None) -> Iterator[Frame]:
        """Yield the frames of the first camera with the numbers `wanted`, as BGR."""
        yield from self._video.pick(wanted)

    @staticmethod
    def _beside(other: Video, partners: NDArray[np.int64], grey: bool) -> Iterator[Frame | None]:
        """Yield the frames with the numbers `partners`, which increase; None for -1."""
        wanted = partners[partners >= 0]
        frames = other.frames(int(wanted[0]), int(wanted[-1]) + 1, grey=grey) if len(wanted) else iter(())
        found: Frame | None = None
        for number in partners.tolist():
            while number >= 0 and (found is None or found.number < number):
                found = next(frames, None)
                if found is None:  # the film ends before the frames that it states
                    return
            yield found if number >= 0 and found is not None and found.number == number else None


def _nearest(times: Array, others: Array) -> NDArray[np.int64]:
    """Find the other film's nearest frame (T,) to each time; -1 if that frame is nearer to another time."""

    def nearest(to: Array, of: Array) -> NDArray[np.int64]:
        after = np.searchsorted(of, to).clip(1, len(of) - 1)
        return after - (to - of[after - 1] < of[after] - to)

    partner = nearest(times, others)
    known = nearest(others, times)[partner] == np.arange(len(times))
    frame = max(float(np.median(np.diff(times))), float(np.median(np.diff(others))))
    known &= np.abs(others[partner] - times) <= frame / 2
    return np.where(known, partner, -1)


def require_cameras(options: ClipOptions) -> None:
    """Raise UserError if one of several films, its camera or its offset cannot be used, before long work."""
    if not options.further:
        return
    assert options.camera is not None
    cameras = [options.camera, *(camera for _, camera in options.further)]
    films = [Video(options.video), *(Video(film) for film, _ in options.further)]
    for film in films[1:]:
        if film.count < 2:
            raise UserError(f"{film.path}: has one frame; give a film of the walk")
    placed = [
        Camera.read(file, film.size, options.scale_camera) for file, film in zip(cameras, films, strict=True)
    ]
    require_apart([str(film.path) for film in films], placed)
    if options.offsets is not None:
        SeveralVideos(films[0], films[1:], options.offsets)  # which finds frames at the same time


def with_further_cameras(options: ClipOptions, scene: Scene) -> Scene:
    """Read the other films of `options`, find their time offsets, and add them to the scene.

    Raises
    ------
    UserError
        If a film cannot be read, or its time offset cannot be found.
    """
    if not options.further:
        return scene
    scenes: list[Scene] = []
    offsets, began = [], []
    for k, (video, camera) in enumerate(options.further):
        own = replace(
            options,
            video=video,
            camera=camera,
            start=None,
            stop=None,
            further=(),
            offsets=None,
            stabilize="off",
        )
        one = read_scene(own, starts=False)
        require_scene(options, one, 0)
        given = None if options.offsets is None else options.offsets[k]
        person, offset, words = synchronise([_film(each) for each in (scene, *scenes)], _film(one), given)
        one = replace(one, person=person)
        if options.background == "auto" and one.plate is not None and one.people and stays(one):
            one = one.without_plate()
        began.append(words)
        note(f"{video}: {words}", options.quiet)
        scenes.append(one)
        offsets.append(offset.seconds)
    several = SeveralVideos(scene.video, [one.video for one in scenes], offsets)
    return replace(scene, video=several, further=tuple(scenes), began=tuple(began), offsets=tuple(offsets))


def _film(scene: Scene) -> Film[int]:
    video = None if scene.poses or scene.moved else scene.video
    return Film(str(scene.video.path), scene.camera, scene.longer, scene.person, video)
