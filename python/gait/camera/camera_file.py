"""Camera files: the project's JSON, OpenCV FileStorage YAML/XML, and the TOML of Pose2Sim and anipose."""

from __future__ import annotations

import sys
from codecs import BOM_UTF8
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gait.camera.camera import Array, Camera
from gait.errors import UserError
from gait.io.fields import Fields, parsing, read_json

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib
if TYPE_CHECKING:
    import cv2  # at run time where it is used: JSON files are read without OpenCV

MAX_PIXELS = 1 << 14
LONGEST_LENS = 1000  #: focal length over the width of the picture; the longest made have a few hundred

_JSON_KEYS = ("width", "height", "fx", "fy", "cx", "cy", "R", "t", "distortion", "note")

# Names in use for the same thing in OpenCV's own samples and in ROS; the first is the documented one.
_ALIASES = {
    "camera_matrix": ("cameraMatrix", "K"),
    "distortion_coefficients": ("distCoeffs", "dist_coeffs", "D"),
    "t": ("T", "tvec"),
    "image_width": ("image_Width",),
    "image_height": ("image_Height",),
}


def read_camera(path: str, size: tuple[int, int] | None = None, *, placed: bool = True) -> Camera:
    """Read a camera file of any supported kind, chosen by its suffix.

    Parameters
    ----------
    path : str
        ``.json``, ``.yaml``, ``.yml``, ``.xml``, or ``.toml`` with ``:name`` after it to choose a camera.
    size : (int, int), optional
        Width and height of the video, pixels: checked, and used by OpenCV files, which may lack it.
    placed : bool
        Whether rotation and translation must be there; without them the camera is at the origin.

    Raises
    ------
    UserError
        One line naming file, key and remedy.
    """
    file, name = _split(str(path))
    if not Path(file).is_file():
        raise UserError(f"{file}: no such camera file")
    suffix = Path(file).suffix.lower()
    if suffix == ".json":
        camera = _from_json(file, placed)
    elif suffix in (".yaml", ".yml", ".xml"):
        camera = _from_opencv(file, size, placed)
    elif suffix == ".toml":
        camera = _from_toml(file, name)
    else:
        raise UserError(f"{file}: unknown camera suffix; use .json, .yaml, .yml, .xml or .toml")
    focal = max(camera.fx, camera.fy)
    if focal > LONGEST_LENS * camera.width:
        raise UserError(
            f"{path}: focal length of {focal:.6g} pixels is over {LONGEST_LENS} times the picture's width; "
            "give it in pixels"
        )
    if size is not None:
        camera.check_size(str(path), size)
    return camera


def _split(path: str) -> tuple[str, str | None]:
    """Separate FILE.toml:name."""
    file, colon, name = path.rpartition(":")
    return (file, name) if colon and file.lower().endswith(".toml") else (path, None)


def _from_json(path: str, placed: bool) -> Camera:
    fields = read_json(path, "camera")
    fields.only(_JSON_KEYS)
    remedy = "give the size of the video in pixels"
    width, height = (fields.integer(key, 1, MAX_PIXELS, remedy) for key in ("width", "height"))
    fx, fy = (fields.number(key, 1e-3, 1e9, "give the focal length in pixels") for key in ("fx", "fy"))
    cx, cy = (fields.number(key, -1e6, 1e6, "give the principal point in pixels") for key in ("cx", "cy"))
    lens = _distortion(fields, "distortion")
    return Camera(width, height, fx, fy, cx, cy, *_pose(fields, placed), lens)


def _from_opencv(path: str, size: tuple[int, int] | None, placed: bool) -> Camera:
    fields = _file_storage(path)
    if "image_width" in fields or size is None:
        remedy = "add image_width and image_height in pixels"
        size = (
            fields.integer("image_width", 1, MAX_PIXELS, remedy),
            fields.integer("image_height", 1, MAX_PIXELS, remedy),
        )
    lens = _distortion(fields, "distortion_coefficients")
    return Camera(*size, *_intrinsics(fields, "camera_matrix"), *_pose(fields, placed), lens)


def _pose(fields: Fields, placed: bool) -> tuple[Array, Array]:
    """Return rotation and translation; none, where they need not be there and are not."""
    if not placed and not any(key in fields for key in ("R", "rvec", "t")):
        return np.eye(3), np.zeros(3)
    turn = _rodrigues(fields, "rvec") if "rvec" in fields and "R" not in fields else _rotation(fields, "R")
    return turn, _translation(fields, "t")


def _file_storage(path: str) -> Fields:
    """Read the top-level nodes of an OpenCV FileStorage into a mapping under their documented names."""
    import cv2

    broken = UserError(f"{path}: not an OpenCV FileStorage file; write it with cv2.FileStorage")
    text = Path(path).read_bytes().removeprefix(BOM_UTF8).decode("latin-1")  # only ASCII is looked at
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    except (cv2.error, SystemError):  # the constructor's binding wraps the one in the other
        raise broken from None
    if not storage.isOpened():
        raise broken
    data: dict[str, Any] = {}
    known = ("image_width", "image_height", "camera_matrix", "distortion_coefficients", "R", "rvec", "t")
    for key in known:
        for alias in (key, *_ALIASES.get(key, ())):
            node = storage.getNode(alias)
            if not node.empty() and key not in data:
                data[key] = _node_value(node)
    storage.release()
    return Fields(path, data)


def _node_value(node: cv2.FileNode) -> Any:
    if node.isSeq():
        return [_node_value(node.at(i)) for i in range(node.size())]
    return node.mat() if node.isMap() else node.string() if node.isString() else node.real()


def _from_toml(path: str, name: str | None) -> Camera:
    with parsing(path, "TOML", "export the calibration anew"):
        data = tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
    cameras = {key: value for key, value in data.items() if isinstance(value, Mapping) and "matrix" in value}
    if name is None and len(cameras) == 1:
        name = next(iter(cameras))
    if name not in cameras:
        found = " ".join(cameras) or "none (a camera is a table with matrix, rotation and translation)"
        asked = f"no camera {name}" if name else "several cameras or none"
        raise UserError(f"{path}: {asked}; choose one as {Path(path).name}:NAME, found: {found}")
    fields = Fields(f"{path}: [{name}]", cameras[name])
    if cameras[name].get("fisheye"):
        raise fields.fail("fisheye", "lenses are not supported", "undistort the video first")
    size = fields.array("size", (2,), "give [width, height] in pixels")
    if not ((size >= 1) & (size <= MAX_PIXELS) & (size == size.round())).all():
        raise fields.fail("size", f"is {size.tolist()}", "give whole [width, height] in pixels")
    lens = _distortion(fields, "distortions")
    intrinsics, turn = _intrinsics(fields, "matrix"), _rodrigues(fields, "rotation")
    return Camera(int(size[0]), int(size[1]), *intrinsics, turn, _translation(fields, "translation"), lens)


def _intrinsics(fields: Fields, key: str) -> tuple[float, float, float, float]:
    """Return fx fy cx cy of a 3x3 matrix without skew."""
    m = fields.array(key, (3, 3), "give [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels")
    if m[0, 0] <= 0 or m[1, 1] <= 0:
        raise fields.fail(key, "has a focal length that is not positive", "give fx and fy in pixels")
    if abs(m[0, 1]) > 1e-6 * m[0, 0]:
        raise fields.fail(key, "has skew, which is not supported", "calibrate with zero skew")
    if not np.allclose([*m[1:, 0], *m[2, 1:]], [0, 0, 0, 1], atol=1e-9):
        raise fields.fail(key, "is not upper triangular", "give [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")
    return float(m[0, 0]), float(m[1, 1]), float(m[0, 2]), float(m[1, 2])


def _rotation(fields: Fields, key: str) -> Array:
    """Return a proper rotation; digits lost in a text file are restored."""
    m = fields.array(key, (3, 3), "give the rotation from world to camera, 3 rows of 3 (or rvec in YAML)")
    u, _, vt = np.linalg.svd(m)
    nearest = u @ vt
    if np.abs(nearest - m).max() > 1e-3 or np.linalg.det(nearest) < 0:
        raise fields.fail(key, "is not a rotation", "its rows must be orthogonal, of length 1, right-handed")
    return np.asarray(nearest)


def _rodrigues(fields: Fields, key: str) -> Array:
    import cv2

    vector = fields.array(key, (3,), "give the rotation vector from world to camera, radians")
    return np.asarray(cv2.Rodrigues(vector)[0], np.float64)


def _translation(fields: Fields, key: str) -> Array:
    return fields.array(key, (3,), "give the translation from world to camera, 3 numbers in metres")


def _distortion(fields: Fields, key: str) -> Array:
    """Return k1 k2 p1 p2 k3 from 0, 4 or 5 numbers; an absent key is an ideal lens."""
    if key not in fields:
        return np.zeros(5)
    remedy = "give k1 k2 p1 p2 [k3] (0, 4 or 5 numbers)"
    count = fields.count(key, remedy)
    if count not in (0, 4, 5):
        raise fields.fail(key, f"has {count} numbers", f"{remedy}, from a calibration without rational terms")
    values = fields.array(key, (count,), remedy) if count else np.zeros(0)
    return np.concatenate([values, np.zeros(5 - count)])
