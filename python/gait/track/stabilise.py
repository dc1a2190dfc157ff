"""Stabilise a clip of a camera that turns: every frame as the camera of the reference frame would see it.

Background, blobs and tracker then see a camera that stands still, and the track is in the scene's frame.  The
picture is wider than the captured one where the camera turns; pixels outside a frame show the empty scene.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.io.keypoints_file import Keypoints
from gait.io.video import Frame, Image, Video
from gait.progress import note, progress
from gait.track.camera_motion import Box, CameraMotion, View, fit_view, map_pixels

Array = NDArray[np.float64]

_MARGIN = 0.15  # of a person's height, about the keypoints
_MOSTLY = 0.8  # of the frames in which the camera must be found, or be still
_TRAVELS = 1.0  # pixels of a picture 640 wide: median residual from which the camera does not only turn
_WIDEST = 1.0  # picture sizes added at each side
_STEP = 16  # pixels between points of which the place in a frame is computed; the others are interpolated


@dataclass(frozen=True)
class Motion:
    """What is known of the camera's motion in a clip.

    Attributes
    ----------
    camera : Camera
        Of the reference; without a calibration its place is meaningless and its focal length a guess.
    views : list of View
        Of each frame against the reference.
    reference : int
        Number of the reference frame; -1 for the background image.
    """

    camera: Camera
    views: list[View]
    reference: int

    def furthest(self) -> float:
        """Largest distance that a frame is moved, pixels in the middle of the picture."""
        middle = np.array([[self.camera.cx, self.camera.cy]])
        places = [map_pixels(middle, self.camera, view.camera(self.camera)) - middle for view in self.views]
        return float(np.nanmax(np.hypot(*np.concatenate(places).T)))


def find_motion(
    video: Video,
    camera: Camera,
    samples: Sequence[Frame],
    people: Mapping[int, Keypoints],
    plate: Image | None = None,
    update: Callable[[int], None] | None = None,
) -> tuple[Motion | None, str]:
    """Measure how the camera turns.

    Parameters
    ----------
    video : Video
    camera : Camera
        Of the reference.
    samples : sequence of Frame
        Frames spread over the clip, which show whether the camera moves at all.
    people : mapping of int to Keypoints
        Who is in the clip: they are not taken for the scene.
    plate : image, optional
        The empty scene, which is then the reference; otherwise it is the frame in the middle of the motion.

    Returns
    -------
    motion : Motion or None
        None if the camera stands still or its motion cannot be undone.
    why : str
        In words, why it cannot be undone; empty otherwise.
    """
    boxes = _boxes(people)
    motion = _begin(camera, samples, boxes, plate)
    if _still(motion, samples):
        return None, ""
    views = []
    for frame in video.frames(grey=True):
        views.append(motion.step(frame.image, boxes.get(frame.number, ())))
        if update is not None:
            update(frame.number)
    found = np.isfinite([view.residual for view in views])
    if found.mean() < _MOSTLY or motion.scale * np.median([v.residual for v in views]) > _TRAVELS:
        return None, "the camera moves along, or the scene has too little texture to show how it turns"
    reference = -1 if plate is not None else _middle(views)
    if reference >= 0:
        back = views[reference].inverse()
        views = [view.after(back) for view in views]
    return Motion(camera, views, reference), ""


def stabilised(
    video: Video,
    camera: Camera,
    samples: Sequence[Frame],
    people: Mapping[int, Keypoints],
    plate: Image | None,
    quiet: bool,
) -> SteadyVideo | None:
    """Undo the turns of a clip's camera, and report it; None if it stands still or they cannot be undone.

    Parameters are as for `find_motion`.
    """
    with progress("camera's motion", video.count, quiet) as update:
        motion, why = find_motion(video, camera, samples, people, plate, update)
    if why:
        note(f"{why}; frames are not stabilised", quiet)
    if motion is None:
        return None
    place = "the background" if plate is not None else f"frame {motion.reference}"
    note(
        f"the camera turned by up to {motion.furthest():.0f} px: frames are stabilised on {place}, for which "
        "camera and places hold",
        quiet,
    )
    return SteadyVideo(video, motion, samples)


def moves(
    camera: Camera, samples: Sequence[Frame], people: Mapping[int, Keypoints], plate: Image | None = None
) -> bool:
    """Whether the camera does not stand still; parameters as for `find_motion`."""
    return not _still(_begin(camera, samples, _boxes(people), plate), samples)


def _begin(
    camera: Camera, samples: Sequence[Frame], boxes: Mapping[int, list[Box]], plate: Image | None
) -> CameraMotion:
    """Take the empty scene, or the first sample, as the reference."""
    motion = CameraMotion(camera)
    if plate is None:
        motion.start(samples[0].image, boxes.get(samples[0].number, []))
    else:
        motion.start(plate)
    return motion


def _still(motion: CameraMotion, samples: Sequence[Frame]) -> bool:
    """Whether most samples look at the reference."""
    return bool(np.mean([motion.still(frame.image) for frame in samples]) > _MOSTLY)


def _boxes(people: Mapping[int, Keypoints]) -> dict[int, list[Box]]:
    """Boxes about everyone, by number of the frame."""
    boxes: dict[int, list[Box]] = {}
    for keypoints in people.values():
        for frame, uv in zip(keypoints.frame.tolist(), keypoints.uv, strict=True):
            uv = uv[np.isfinite(uv).all(axis=1)]
            if len(uv):
                (left, top), (right, bottom) = uv.min(axis=0), uv.max(axis=0)
                edge = _MARGIN * (bottom - top)
                boxes.setdefault(frame, []).append((left - edge, top - edge, right + edge, bottom + edge))
    return boxes


def _middle(views: list[View]) -> int:
    """Find the frame whose view is nearest to the median of all."""
    turns = np.array([cv2.Rodrigues(view.turn)[0][:, 0] for view in views])
    off = np.linalg.norm(turns - np.median(turns, axis=0), axis=1)
    off[[not np.isfinite(view.residual) for view in views]] = np.inf
    return int(off.argmin())


class SteadyVideo(Video):
    """A clip with its camera's motion undone.

    Attributes
    ----------
    camera : Camera
        Of the pictures; they are those of the reference, extended to what the clip shows.
    plate : image
        The empty scene: the median of the samples, where they show it.
    """

    def __init__(self, video: Video, motion: Motion, samples: Sequence[Frame]) -> None:
        self.path, self.fps, self.count, self.times = video.path, video.fps, video.count, video.times
        self._video, self._motion = video, motion
        left, top, right, bottom = self._extent()
        self._corner = np.array([left, top])
        self.width, self.height = right - left, bottom - top
        self.camera = self.extended(motion.camera)
        self._grid = self._directions()
        self.plate = self._median(samples)

    def extended(self, camera: Camera) -> Camera:
        """Camera of these pictures, from that of the reference."""
        cx, cy = camera.cx - self._corner[0], camera.cy - self._corner[1]
        return replace(camera, width=self.width, height=self.height, cx=float(cx), cy=float(cy))

    def reference(self, camera: Camera) -> Camera:
        """Camera of the reference, from that of these pictures."""
        cx, cy = camera.cx + self._corner[0], camera.cy + self._corner[1]
        width, height = self._video.size
        return replace(camera, width=width, height=height, cx=float(cx), cy=float(cy))

    def camera_at(self, number: int, camera: Camera) -> Camera:
        """Camera of a frame as captured; `camera`, of these pictures, may be better known by now."""
        reference, frame = self._motion.camera, self._motion.views[number].camera(self._motion.camera)
        u, v = (np.linspace(0, size - 1, 7) for size in self._video.size)
        before = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        found = self.reference(camera)
        return fit_view(found, before, map_pixels(before, reference, frame))[0].camera(found)

    def keypoints(self, captured: Keypoints) -> Keypoints:
        """Keypoints of the captured frames in these pictures."""
        uv = captured.uv.copy()
        for row, number in enumerate(captured.frame.tolist()):
            if number < len(self._motion.views):
                view = self._motion.views[number]
                uv[row] = map_pixels(uv[row], view.camera(self._motion.camera), self.camera)
        return replace(captured, uv=uv)

    def of_reference(self, keypoints: Keypoints) -> Keypoints:
        """Keypoints in the picture of the reference, from those in these pictures."""
        return replace(keypoints, uv=keypoints.uv + self._corner)

    def place(self, plate: Image) -> Image:
        """Extend an image of the empty scene from the reference by what the clip shows."""
        out = self.plate.copy()
        left, top = -self._corner
        out[top : top + plate.shape[0], left : left + plate.shape[1]] = plate
        return out

    def frames(self, start: int = 0, stop: int | None = None, *, grey: bool = False) -> Iterator[Frame]:
        """Yield the frames `start` <= index < `stop` in order, as BGR or grey."""
        for number, time, captured, _ in self._video.frames(start, stop):
            image = self._warp(captured, number, self.plate.copy(), cv2.BORDER_TRANSPARENT)
            if grey:
                image = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
            yield Frame(number, time, image, captured)

    def _extent(self) -> tuple[int, int, int, int]:
        """Left, top, right and bottom of what the frames show, pixels of the reference."""
        reference = self._motion.camera
        size = np.array(reference.size)
        if reference.distortion.any():  # its lens is not known outside of the picture
            return 0, 0, *reference.size
        u, v = (np.linspace(0, length - 1, 9) for length in size)
        border = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        places = np.concatenate(
            [map_pixels(border, view.camera(reference), reference) for view in self._motion.views]
        )
        low = np.floor(np.clip(np.nanmin(places, axis=0), -_WIDEST * size, 0)).astype(int)
        high = np.ceil(np.clip(np.nanmax(places, axis=0) + 1, size, (1 + _WIDEST) * size)).astype(int)
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])

    def _directions(self) -> Array:
        """Points (h, w, 3) of the world on a grid over these pictures."""
        u, v = (np.arange(0, length + _STEP, _STEP, dtype=float) for length in self.size)
        return self.camera.centre + self.camera.rays(np.stack(np.meshgrid(u, v), axis=-1))

    def _warp(self, captured: Image, number: int, out: Image, border: int) -> Image:
        """Draw a captured frame into `out`, an image of these pictures."""
        places = self._motion.views[number].camera(self._motion.camera).project(self._grid)
        places = np.nan_to_num(places, nan=-1e4).astype(np.float32)
        rows, columns = places.shape[:2]
        # Pixel (i, j) of the grid lies at _STEP (i, j); resize() would place it half a step further.
        fine = np.array([[1 / _STEP, 0, 0], [0, 1 / _STEP, 0]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        maps = cv2.warpAffine(places, fine, self.size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
        u, v = cv2.split(maps)
        return np.asarray(cv2.remap(captured, u, v, cv2.INTER_LINEAR, dst=out, borderMode=border), np.uint8)

    def _median(self, samples: Sequence[Frame]) -> Image:
        """Median of the samples at each pixel that any of them shows; elsewhere the nearest pixel."""
        shape = (self.height, self.width, 3)
        blank, white = np.zeros(shape, np.uint8), np.full(self._video.size[::-1], 255, np.uint8)
        pictures, shown = [], []
        for frame in samples:
            pictures.append(self._warp(frame.image, frame.number, blank.copy(), cv2.BORDER_TRANSPARENT))
            mask = self._warp(white, frame.number, np.zeros(shape[:2], np.uint8), cv2.BORDER_TRANSPARENT)
            shown.append(mask == 255)
        plate = self._warp(samples[0].image, samples[0].number, blank, cv2.BORDER_REPLICATE)
        for row in range(self.height):
            values = np.array([picture[row] for picture in pictures], np.int16)
            visible = np.array([mask[row] for mask in shown])
            values[~visible] = 256  # last
            values.sort(axis=0)
            count = visible.sum(axis=0)
            low, high = (np.maximum(count + more, 0) // 2 for more in (-1, 0))
            middle = [np.take_along_axis(values, at[None, :, None], axis=0)[0] for at in (low, high)]
            plate[row] = np.where((count > 0)[:, None], (middle[0] + middle[1]) // 2, plate[row])
        return plate
