"""Input of the tracker at one time, converted for the C library: images, and joints detected in them."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gait.bindings import abi
from gait.camera.camera import Camera
from gait.camera.path import CameraPose
from gait.io.video import Image


@dataclass(frozen=True)
class FrameKeypoints:
    """Joints that a detector has located in one image: one frame of `gait.io.keypoints_file.Keypoints`.

    Attributes
    ----------
    names : sequence of str
        The joints' names in the model; joints with other names are ignored.
    uv : array_like of shape (J, 2)
        Pixels as captured; NaN where a joint was not seen.
    sd : array_like that broadcasts to (J,)
        Standard deviations, pixels, including the differences between the detector's and the model's joints.
    """

    names: Sequence[str]
    uv: ArrayLike
    sd: ArrayLike = 4.0


def per_camera(items: Any) -> list[Any]:
    """Return a list with one item for each camera; a single item belongs to the only camera."""
    if items is None or isinstance(items, np.ndarray | FrameKeypoints | CameraPose):
        return [items]
    return list(items)


def capture_time(utime: Any) -> int:
    """Check a capture time: whole microseconds that fit 64 bits; ValueError if they do not."""
    try:
        whole = operator.index(utime)
    except TypeError:
        raise ValueError(f"utime = {utime!r}: give whole microseconds") from None
    if not -(1 << 63) <= whole < 1 << 63:
        raise ValueError(f"utime = {utime}: give microseconds in [-2^63, 2^63)")
    return whole


def image_view(image: Image, camera: Camera, what: str) -> abi.ImageView:
    """Make a ``gait_image`` of a contiguous image; ValueError if its size is not the camera's."""
    if image.dtype != np.uint8 or image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3):
        raise ValueError(f"{what}: {image.dtype} {image.shape}; give uint8 (h, w) grey or (h, w, 3) BGR")
    height, width = image.shape[:2]
    if (width, height) != camera.size:
        raise ValueError(f"{what}: {width}x{height}, the camera is {camera.width}x{camera.height}")
    form = abi.PixelFormat.GREY8 if image.ndim == 2 else abi.PixelFormat.BGR8
    return abi.ImageView(image.ctypes.data, width, height, image.strides[0], form)


def keypoint_array(keypoints: FrameKeypoints, names: Sequence[str]) -> Any:
    """Make an array of ``gait_keypoint`` in the order of the model's `names`."""
    uv, known = np.asarray(keypoints.uv, float), keypoints.names
    if uv.shape != (len(known), 2):
        raise ValueError(f"keypoints: uv has shape {uv.shape} instead of {(len(known), 2)}")
    sd = np.broadcast_to(keypoints.sd, len(uv)).tolist()
    found = dict(zip(known, zip(uv.tolist(), sd, strict=True), strict=True))
    array = (abi.KeypointC * len(names))()
    for point, name in zip(array, names, strict=True):
        (point.u, point.v), point.sd = found.get(name, ((0.0, 0.0), -1.0))
    return array
