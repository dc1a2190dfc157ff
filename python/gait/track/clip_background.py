"""The background of a clip: the median of its frames, and whether it is of use."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from gait.bindings.model import Model
from gait.bindings.start_fit import StartFit
from gait.camera.camera import Camera
from gait.camera.path import CameraPose
from gait.detect.shapes import find_people
from gait.errors import UserError
from gait.io.video import Frame, Image, Video, median, sample_frames
from gait.progress import warning
from gait.track.moving_video import map_pixels
from gait.track.options import ClipOptions
from gait.track.scene import Scene, person_in_reference
from gait.track.stabilise import moves
from gait.track.walk_camera import expected_camera

Array = NDArray[np.float64]

_COLOUR_LEVELS = 4.0  # grey levels; least difference between channels, in half of a colour picture
_TRUNK = ("l_shoulder", "r_shoulder", "l_hip", "r_hip")
_TRUNKS = 200  # frames whose trunks are compared, evenly spread over the clip
_SHAPES = 16  # frames searched for people's shapes, which is slow
_TRUNK_HEIGHTS = (0.52, 0.81)  # of hips and shoulders, fractions of a person's height
_TRUNK_HALF_WIDTH = 0.2  # of a trunk seen from the side, as a fraction of its height
_DIFFERS = "half of frame {} differs from"
_STAYS = 0.45  # share of a clip's frames from which the median may show a person


def sample(
    options: ClipOptions,
    video: Video,
    poses: Mapping[int, CameraPose],
    update: Callable[[int], None] | None = None,
) -> tuple[list[Frame], Image | None]:
    """Sample frames over the clip if they are needed, and compute their median if it is the background."""
    static = options.stabilize == "off" and not options.cameras_out
    if options.background != "auto" and (static or options.camera_path):
        return [], None
    samples = sample_frames(video, progress=update)
    wanted = options.background == "auto" and not poses
    return samples, median([frame.image for frame in samples]) if wanted else None


def stays(scene: Scene) -> bool:
    """Whether the person's trunk covers the same part of the picture in about half of the clip's frames.

    This is so if the person walks in place, towards the camera or away from it.  Without keypoints, trunks
    are those of people's shapes.
    """
    low, high, shown = _trunks(scene) if scene.people else _shape_trunks(scene)
    if not len(low):
        return False
    reach = _TRUNK_HALF_WIDTH * (high - low)[:, 1:] * (1, 0)  # half of a trunk seen from the side
    middle = (low + high)[:, None] / 2
    covered = ((middle > low - reach) & (middle < high + reach)).all(axis=2)  # (middles, frames)
    return bool(covered.mean(axis=1).max() * shown > _STAYS)


def _trunks(scene: Scene) -> tuple[Array, Array, float]:
    """Corners (n, 2) of the person's trunk in frames that have keypoints of it, and the share of these."""
    keypoints = person_in_reference(scene)
    assert keypoints is not None
    trunk = keypoints.uv[:, [keypoints.names.index(name) for name in _TRUNK]]
    trunk = trunk[np.isfinite(trunk).all(axis=(1, 2))]
    trunk = trunk[:: len(trunk) // _TRUNKS + 1]
    return trunk.min(axis=1), trunk.max(axis=1), len(keypoints.frame) / scene.video.count


def _shape_trunks(scene: Scene) -> tuple[Array, Array, float]:
    """Return the same for frames in which a person's shape is found."""
    fit, found = StartFit(scene.model, scene.camera), []
    samples = sample_frames(scene.video, _SHAPES)
    for frame in samples:
        if frame.pose is not None:
            fit.set_pose(frame.pose)
        for box in find_people(frame.image, fit.stature)[:1]:
            ends = np.array([box.head, box.foot])
            moved = frame.pose is not None
            found.append(map_pixels(ends, frame.camera(scene.camera), scene.camera) if moved else ends)
    head, foot = np.array(found).reshape(-1, 2, 2).swapaxes(0, 1)
    trunk = [foot + share * (head - foot) for share in _TRUNK_HEIGHTS]
    return np.minimum(*trunk), np.maximum(*trunk), len(found) / len(samples)


def require_background(
    options: ClipOptions, video: Video, camera: Camera | None, model: Model, plate: Image, first: int
) -> None:
    """Raise UserError, before long work, if a background file does not show the scene of frame `first`.

    If the camera moves, only their colours are compared.
    """
    frame = next(iter(video.frames(first, first + 1)), None)
    if frame is None:
        return
    if one_is_grey(frame.image, plate):
        raise UserError(
            f"{options.background}: either it or {video.path} is grey, the other in colour; give both in the "
            "same colours"
        )
    lens = camera or expected_camera(video, options.fov)
    if not StartFit(model, lens).other_scene(frame.image, plate):
        return
    if options.stabilize == "off" or not moves(lens, sample_frames(video), {}):
        raise _other_scene(options, first)


def require_scene(options: ClipOptions, scene: Scene, first: int) -> None:
    """Raise UserError if a background file shows another scene than frame `first`; warn if a median does."""
    frame = next(iter(scene.video.frames(first, first + 1)), None)
    plate = frame.plate if frame is not None and scene.moving else scene.plate
    if plate is None or frame is None:
        return
    if not StartFit(scene.model, scene.camera).other_scene(frame.image, plate):
        return
    if options.background != "auto":
        raise _other_scene(options, first)
    warning(
        f"{_DIFFERS.format(first)} the median of the clip, the background: if the camera moves, give "
        "--camera-path, --stabilize auto or --background none",
        options.quiet,
    )


def _other_scene(options: ClipOptions, first: int) -> UserError:
    differs = _DIFFERS.format(first)
    return UserError(f"{options.background}: {differs} it; give the empty scene of this camera, auto or none")


def one_is_grey(image: Image, plate: Image) -> bool:
    """Whether one of two BGR pictures is entirely grey and the other in colour."""
    colour = [float(np.median(np.ptp(one[::4, ::4], axis=2))) for one in (image, plate)]
    return min(colour) == 0 and max(colour) > _COLOUR_LEVELS
