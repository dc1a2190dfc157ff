"""A clip from a moving camera: each frame with the camera's pose and, if it only turns, the empty scene.

If the camera stays in one place, the median of the clip's frames in each direction that they show gives a
picture of the whole scene, and from this each frame gets the empty scene as its camera would see it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.camera.path import CameraPose, one_place
from gait.io.video import Frame, Image, Video

Array = NDArray[np.float64]

_WIDEST = 1.0  # most picture sizes added on each side
_GRID_STEP_PX = 16  # pixels; grid of points that are mapped exactly; pixels in between are interpolated
_COVERED = 0.98  # least share of a frame that the picture of the scene covers
_FEWEST = 5  # fewest samples from which the median is computed


@dataclass(frozen=True)
class Panorama:
    """Empty scene as seen from one place.

    Attributes
    ----------
    camera : Camera
        Camera without lens distortion whose picture covers all frames.
    image : image
    """

    camera: Camera
    image: Image

    @staticmethod
    def of(
        samples: Sequence[Frame], lens: Camera, poses: Mapping[int, CameraPose], given: Image | None = None
    ) -> Panorama:
        """Compute the median of the samples; where `given` (the empty scene, by `lens`) is known, use it."""
        whole = _extended(lens, list(poses.values()))
        image = _median([(frame.image, poses[frame.number].camera(lens)) for frame in samples], whole)
        if given is not None:
            image = warped(given, lens, whole, image)
        return Panorama(whole, image)

    def plate_for(self, camera: Camera) -> Image | None:
        """Return the empty scene as seen by a camera in the same place; None if a part is unknown."""
        u, v = (np.arange(0, size, _GRID_STEP_PX, dtype=float) for size in camera.size)
        places = map_pixels(np.stack(np.meshgrid(u, v), axis=-1), camera, self.camera)
        with np.errstate(invalid="ignore"):
            inside = ((places >= 0) & (places <= np.array(self.camera.size) - 1)).all(axis=-1)
        return warped(self.image, self.camera, camera) if inside.mean() >= _COVERED else None


def map_pixels(pixels: Array, source: Camera, target: Camera) -> Array:
    """Convert pixels (..., 2) of `source` to the pixels of `target`, in the same place, in that direction."""
    return target.project(target.centre + source.rays(pixels))


def warped(image: Image, source: Camera, target: Camera, out: Image | None = None) -> Image:
    """Warp a picture of `source` to the view of `target` in the same place; `out` where it shows nothing."""
    u, v = (np.arange(0, size + _GRID_STEP_PX, _GRID_STEP_PX, dtype=float) for size in target.size)
    places = map_pixels(np.stack(np.meshgrid(u, v), axis=-1), target, source)
    places = np.nan_to_num(places, nan=-1e4).astype(np.float32)
    # Grid point (i, j) is at pixel _GRID_STEP_PX (i, j); resize() would place it half a step further.
    fine = np.array([[1 / _GRID_STEP_PX, 0, 0], [0, 1 / _GRID_STEP_PX, 0]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    maps = cv2.warpAffine(places, fine, target.size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    across, down = cv2.split(maps)
    border = cv2.BORDER_REPLICATE if out is None else cv2.BORDER_TRANSPARENT
    into: Any = None if out is None else out.copy()
    return np.asarray(cv2.remap(image, across, down, cv2.INTER_LINEAR, dst=into, borderMode=border), np.uint8)


class MovingVideo(Video):
    """A clip whose frames have the pose of the camera and, where known, the empty scene.

    Parameters
    ----------
    video : Video
    lens : Camera
    poses : mapping of int to CameraPose
        Poses by frame number, for all frames that are read.
    panorama : Panorama, optional
    """

    def __init__(
        self, video: Video, lens: Camera, poses: Mapping[int, CameraPose], panorama: Panorama | None = None
    ) -> None:
        self.path, self.fps, self.count, self.times = video.path, video.fps, video.count, video.times
        self.digest = video.digest
        self.width, self.height = video.size
        self._video, self._lens, self.poses, self.panorama = video, lens, poses, panorama

    @property
    def broken(self) -> str | None:
        """As in `Video`."""
        return self._video.broken

    def without_panorama(self) -> MovingVideo:
        """Return the same clip without the empty scene."""
        return MovingVideo(self._video, self._lens, self.poses)

    def frames(self, start: int = 0, stop: int | None = None, *, grey: bool = False) -> Iterator[Frame]:
        """Yield the frames `start` <= index < `stop` in order, as BGR or grey."""
        for frame in self._video.frames(start, stop, grey=grey):
            yield self._placed(frame)

    def pick(self, wanted: Collection[int], progress: Callable[[int], None] | None = None) -> Iterator[Frame]:
        """Yield those of the frames `wanted` whose poses are known, as BGR."""
        yield from map(self._placed, self._video.pick(self.poses.keys() & set(wanted), progress))

    def _placed(self, frame: Frame) -> Frame:
        pose, plate = self.poses[frame.number], None
        if self.panorama is not None and frame.image.ndim == 3:
            plate = self.panorama.plate_for(pose.camera(self._lens))
        return frame._replace(pose=pose, plate=plate)


def panorama_of(
    samples: Sequence[Frame], lens: Camera, poses: Mapping[int, CameraPose], given: Image | None = None
) -> Panorama | None:
    """Make a panorama of the empty scene; None if the camera travels or too few samples have a pose."""
    known = [frame for frame in samples if frame.number in poses]
    if len(known) < _FEWEST or not one_place(list(poses.values())):
        return None
    return Panorama.of(known, lens, poses, given)


def _extended(lens: Camera, poses: Sequence[CameraPose]) -> Camera:
    """Make a camera without distortion whose picture covers all frames, as far as one picture can."""
    flat = replace(_middle(poses).camera(lens), distortion=np.zeros(5))
    size = np.array(lens.size)
    u, v = (np.linspace(0, length - 1, 9) for length in lens.size)
    border = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    places = np.concatenate([map_pixels(border, pose.camera(lens), flat) for pose in poses])
    low = np.floor(np.clip(np.nanmin(places, axis=0), -_WIDEST * size, 0)).astype(int)
    high = np.ceil(np.clip(np.nanmax(places, axis=0) + 1, size, (1 + _WIDEST) * size)).astype(int)
    width, height = (high - low).tolist()
    return replace(flat, width=width, height=height, cx=lens.cx - low[0], cy=lens.cy - low[1])


def _middle(poses: Sequence[CameraPose]) -> CameraPose:
    """Find the pose whose direction is nearest to the median of all."""
    ways = np.array([pose.R[2] for pose in poses])
    return poses[int(np.linalg.norm(ways - np.median(ways, axis=0), axis=1).argmin())]


def _median(known: Sequence[tuple[Image, Camera]], whole: Camera) -> Image:
    """Median of pictures at each pixel shown by any of them; elsewhere the nearest pixel of the first."""
    width, height = whole.size
    blank = np.zeros((height, width, 3), np.uint8)
    pictures, shown = [], []
    for image, camera in known:
        white = np.full(image.shape[:2], 255, np.uint8)
        pictures.append(warped(image, camera, whole, blank))
        shown.append(warped(white, camera, whole, blank[..., 0]) == 255)
    plate = warped(known[0][0], known[0][1], whole)
    for row in range(height):
        values = np.array([picture[row] for picture in pictures], np.int16)
        visible = np.array([mask[row] for mask in shown])
        values[~visible] = 256  # unknown pixels are sorted last
        values.sort(axis=0)
        count = visible.sum(axis=0)
        low, high = (np.maximum(count + more, 0) // 2 for more in (-1, 0))
        middle = [np.take_along_axis(values, at[None, :, None], axis=0)[0] for at in (low, high)]
        plate[row] = np.where((count > 0)[:, None], (middle[0] + middle[1]) // 2, plate[row])
    return plate
