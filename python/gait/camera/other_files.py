"""Camera files of other tools: Kalibr, ROS camera_info, COLMAP, Qualisys, OpenCap.

Each reader returns the entries that an OpenCV file would have, under their documented names
(``camera_matrix``, ``distortion_coefficients``, ``image_width``, ``image_height``, ``R``, ``t``), and
``distortion_model`` if the lens is not OpenCV's usual one.  Cameras of files without extrinsics have no R and
t.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from gait.errors import UserError
from gait.io import plain_pickle
from gait.io.files import text_lines

Array = NDArray[np.float64]
Entries = dict[str, Any]

_UNDISTORT = "undistort the video, or calibrate with k1 k2 p1 p2 k3"
#: Parameters of COLMAP's models; f stands for both focal lengths.
_COLMAP = {
    "SIMPLE_PINHOLE": "f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
    "OPENCV_FISHEYE": "fx fy cx cy k1 k2 k3 k4",
    "SIMPLE_RADIAL_FISHEYE": "f cx cy k1",
    "RADIAL_FISHEYE": "f cx cy k1 k2",
}
#: Its other models, with their numbers of parameters.
_COLMAP_OTHERS = {"FOV": 5, "THIN_PRISM_FISHEYE": 12, "RAD_TAN_THIN_PRISM_FISHEYE": 16, "SIMPLE_DIVISION": 4,
                  "DIVISION": 5}  # fmt: skip
#: All of them, in the order of their numbers in binary files.
_COLMAP_MODELS = (
    "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE", "FULL_OPENCV", "FOV",
    "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "THIN_PRISM_FISHEYE", "RAD_TAN_THIN_PRISM_FISHEYE",
    "SIMPLE_DIVISION", "DIVISION",
)  # fmt: skip
_OPENCV_ORDER = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
_KALIBR = {"radtan": "radtan", "none": "none", "equidistant": "fisheye", "equi": "fisheye"}
#: Keys of Kalibr and ROS that are read, or do not describe the lens.
_KALIBR_KEYS = ("camera_model", "distortion_model", "intrinsics", "resolution", "rostopic", "cam_overlaps")
_ROS_KEYS = ("header", "width", "height", "k", "r", "p", "binning_x", "binning_y", "roi")


def read_plain_yaml(path: str, name: str | None) -> Entries:
    """Read YAML without OpenCV's header: Kalibr's camchain, ROS's camera_info, or OpenCV's entries.

    ModuleNotFoundError if PyYAML, of extra ``video``, is missing.
    """
    import yaml

    try:
        data = yaml.safe_load(Path(path).read_text(encoding="utf-8-sig"))
    except (yaml.YAMLError, UnicodeDecodeError, ValueError, RecursionError) as error:
        raise UserError(
            f"{path}: not a YAML file ({' '.join(str(error).split())[:80]}); write it again"
        ) from None
    if not isinstance(data, dict) or not data:
        raise UserError(f"{path}: contains no camera; use YAML of OpenCV, Kalibr or ROS")
    chain = {
        str(key): value for key, value in data.items() if isinstance(value, Mapping) and "intrinsics" in value
    }
    if chain:
        return _kalibr(path, chain, name)
    if name is not None:
        raise UserError(f"{path}: contains one camera, not {name}; leave out the name")
    ros = "distortion_model" in data and ("k" in data or "K" in data)
    return _ros(path, data) if ros else {str(key): _matrix(value) for key, value in data.items()}


def _choose(path: str, found: Mapping[str, Any], name: str | None) -> Any:
    """Choose the camera asked for, or the only one."""
    if name is None and len(found) == 1:
        return next(iter(found.values()))
    if name is None or name not in found:
        asked = f"no camera {name}" if name else f"{len(found)} cameras"
        raise UserError(
            f"{path}: {asked}; choose one as {Path(path).name}:NAME, found: {' '.join(found) or 'none'}"
        )
    return found[name]


def _matrix(value: Any) -> Any:
    """Convert a matrix written as rows, cols and data to a list of rows."""
    if not isinstance(value, Mapping) or not {"rows", "cols", "data"} <= set(value):
        return value
    try:
        return np.asarray(value["data"], float).reshape(int(value["rows"]), int(value["cols"])).tolist()
    except (TypeError, ValueError):
        return value["data"]


def _kalibr(path: str, chain: Mapping[str, Any], name: str | None) -> Entries:
    camera = _choose(path, chain, name)
    model, lens = camera.get("camera_model", "pinhole"), camera.get("distortion_model", "none")
    if model != "pinhole" or lens not in _KALIBR:
        raise UserError(f"{path}: lens {model}-{lens} is not supported; {_UNDISTORT}")
    try:
        fx, fy, cx, cy = (float(value) for value in camera["intrinsics"])
        width, height = camera["resolution"]
    except (KeyError, TypeError, ValueError):
        raise UserError(
            f"{path}: intrinsics are fu fv pu pv and resolution is [width, height]; correct them"
        ) from None
    others = {str(key): value for key, value in camera.items() if key not in _KALIBR_KEYS}
    if lens == "none" and any("dist" in key.lower() and np.any(value) for key, value in others.items()):
        raise UserError(f"{path}: distortion_coeffs without distortion_model; add radtan or equidistant")
    return others | _pinhole(fx, fy, cx, cy, width, height) | {"distortion_model": _KALIBR[lens]}


def _pinhole(fx: float, fy: float, cx: float, cy: float, width: Any, height: Any) -> Entries:
    matrix = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
    return {"camera_matrix": matrix, "image_width": width, "image_height": height}


def _ros(path: str, data: Mapping[str, Any]) -> Entries:
    """Read a sensor_msgs/CameraInfo message; its R is ignored, as it only rectifies stereo pictures."""
    plain = {str(key).lower(): value for key, value in data.items()}
    cut = plain.get("roi") or {}
    if any(plain.get(f"binning_{axis}", 0) not in (0, 1) for axis in "xy") or any(
        cut.get(key, 0) for key in ("x_offset", "y_offset", "width", "height")
    ):
        raise UserError(f"{path}: binning or roi is set; give the camera_info of full pictures")
    values = np.asarray(plain["k"], float)
    if values.size != 9:
        raise UserError(f"{path}: k has {values.size} numbers, not 9; write the message again")
    return {key: value for key, value in plain.items() if key not in _ROS_KEYS} | {
        "camera_matrix": values.reshape(3, 3).tolist(),
        "image_width": plain.get("width"),
        "image_height": plain.get("height"),
    }


def read_text(path: str, name: str | None) -> Entries:
    """Read a text file: Qualisys's .qca.txt, or COLMAP's cameras.txt with images.txt beside it."""
    lines = text_lines(Path(path))
    if any("<calibration" in line for line in lines[:5]):
        return read_qualisys(path, name)
    rows = [line.split() for line in lines if line.strip() and not line.startswith("#")]
    if not rows or not all(len(row) > 4 and row[1] in {*_COLMAP, *_COLMAP_OTHERS} for row in rows):
        raise UserError(
            f"{path}: contains no camera; give a JSON camera file, or as text cameras.txt of COLMAP or a "
            "calibration of Qualisys"
        )
    return _colmap(path, rows, _colmap_pictures(Path(path).with_name("images.txt")), name)


def read_binary(path: str, name: str | None) -> Entries:
    """Read COLMAP's cameras.bin with images.bin beside it, which contain the rows of the text files."""
    data, rows = _Binary(path), []
    for _ in range(data.take("Q")[0]):
        id, model, width, height = data.take("IiQQ")
        kind = _COLMAP_MODELS[model] if 0 <= model < len(_COLMAP_MODELS) else ""
        count = len(_COLMAP[kind].split()) if kind in _COLMAP else _COLMAP_OTHERS.get(kind)
        if count is None:
            raise data.fault(f"camera {id} has a model of the unknown number {model}")
        rows.append([str(id), kind, str(width), str(height), *map(repr, data.take(f"{count}d"))])
    data.require_end()
    return _colmap(path, rows, _binary_pictures(Path(path).with_name("images.bin")), name)


class _Binary:
    """A binary file of COLMAP, read from its beginning."""

    def __init__(self, path: str) -> None:
        self._path, self._data, self._at = path, Path(path).read_bytes(), 0

    def take(self, kinds: str) -> tuple[Any, ...]:
        """Take the next numbers, in the format of struct."""
        begin = self._at
        self.skip(struct.calcsize(f"<{kinds}"))
        if self._at > len(self._data):
            raise self.fault("it ends in the middle of an entry")
        return struct.unpack_from(f"<{kinds}", self._data, begin)

    def text(self) -> str:
        """Take the text up to the next zero."""
        end = self._data.find(b"\0", self._at)
        if end < 0:
            raise self.fault("it ends in the middle of a name")
        begin, self._at = self._at, end + 1
        return self._data[begin:end].decode(errors="replace")

    def skip(self, count: int) -> None:
        """Go on by so many bytes."""
        self._at += count

    def require_end(self) -> None:
        """UserError if there are more bytes, or fewer than were skipped."""
        if self._at != len(self._data):
            raise self.fault(f"it has {len(self._data)} bytes instead of {self._at}")

    def fault(self, what: str) -> UserError:
        """Make an error that names the file."""
        return UserError(f"{self._path}: not a binary file of COLMAP ({what}); export the model again")


def _binary_pictures(path: Path) -> dict[str, list[str]]:
    """Read images.bin by the picture's name, as `_colmap_pictures`; points are skipped."""
    if not path.is_file():
        return {}
    data, found = _Binary(str(path)), {}
    for _ in range(data.take("Q")[0]):
        id, *pose, camera = data.take("I7dI")
        name = data.text()
        found[name] = [str(id), *map(repr, pose), str(camera), name]
        data.skip(24 * data.take("Q")[0])  # u, v, id of each point
    data.require_end()
    return found


def _colmap(path: str, rows: list[list[str]], pictures: dict[str, list[str]], name: str | None) -> Entries:
    """Read a camera of COLMAP by its id, or, with extrinsics, by the name of a picture."""
    cameras = {row[0]: row for row in rows}
    picture = pictures.get(name or "")
    row = _choose(path, cameras, picture[8] if picture else name)
    if row[1] not in _COLMAP:
        raise UserError(f"{path}: lens {row[1]} is not supported; {_UNDISTORT}")
    try:
        names = _COLMAP[row[1]].split()
        values = dict(zip(names, map(float, row[4:]), strict=True))
        pose = [float(value) for value in picture[1:8]] if picture else []
    except ValueError:
        raise UserError(
            f"{path}: camera {row[0]} does not have {len(_COLMAP[row[1]].split())} parameters"
        ) from None
    fx, fy = values.get("fx", values.get("f", 0.0)), values.get("fy", values.get("f", 0.0))
    entries = _pinhole(
        fx, fy, values["cx"] - 0.5, values["cy"] - 0.5, int(row[2]), int(row[3])
    )  # COLMAP measures from the corner of the first pixel
    if row[1].endswith("FISHEYE"):
        lens = [values.get(f"k{i}", 0.0) for i in range(1, 5)]
        entries |= {"distortion_model": "fisheye", "distortion_coefficients": lens}
    else:
        lens = [values.get(key, 0.0) for key in _OPENCV_ORDER]
        entries["distortion_coefficients"] = lens if any(lens[4:]) else lens[:4]
    if pose:
        entries |= {"R": _quaternion(pose[:4]).tolist(), "t": pose[4:]}
    return entries


def _colmap_pictures(path: Path) -> dict[str, list[str]]:
    """Read the rows of images.txt by the picture's name; every second line lists points and is skipped."""
    if not path.is_file():
        return {}
    lines = [line for line in text_lines(path) if not line.startswith("#")]
    rows = [line.split(maxsplit=9) for line in lines[::2] if line.strip()]
    return {row[9].strip(): row for row in rows if len(row) == 10}


def _quaternion(q: list[float]) -> Array:
    """Convert a quaternion w x y z to a rotation."""
    w, x, y, z = np.asarray(q) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def read_qualisys(path: str, name: str | None) -> Entries:
    """Read a camera of Qualisys's calibration by its serial number.

    In these files lengths are in millimetres, z is up, the rows of the rotation point right, up and
    backwards, and intrinsics are in fractions of a pixel.
    """
    try:
        root = ElementTree.fromstring(Path(path).read_bytes())
    except ElementTree.ParseError as error:
        raise UserError(f"{path}: not an XML file ({error}); export the calibration again") from None
    found = {
        str(camera.get("serial")): camera
        for camera in root.iter("camera")
        if camera.find("intrinsic") is not None
    }
    if not found:
        raise UserError(
            f"{path}: XML of <{root.tag}>, not a calibration of Qualisys; export the camera for OpenCV or "
            "COLMAP"
        )
    camera = _choose(path, found, name)
    if camera.get("viewrotation", "0") not in ("0", ""):
        turned = camera.get("viewrotation")
        raise UserError(f"{path}: viewrotation is {turned}; export it with unrotated pictures")
    place, lens = _attributes(path, camera, "transform"), _attributes(path, camera, "intrinsic")
    view, most = _attributes(path, camera, "fov_video"), _attributes(path, camera, "fov_video_max")
    try:
        left, top = view["left"], view["top"]
        part_u = (lens["sensorMaxU"] - lens["sensorMinU"]) / (most["right"] - most["left"])
        part_v = (lens["sensorMaxV"] - lens["sensorMinV"]) / (most["bottom"] - most["top"])
        if lens.get("skew"):
            raise UserError(
                f"{path}: skew is {lens['skew']:g}, which is not supported; calibrate with zero skew"
            )
        entries = _pinhole(
            lens["focalLengthU"] / part_u,
            lens["focalLengthV"] / part_v,
            (lens["centerPointU"] - lens["sensorMinU"]) / part_u - left + most["left"],
            (lens["centerPointV"] - lens["sensorMinV"]) / part_v - top + most["top"],
            int(view["right"] - left + 1),
            int(view["bottom"] - top + 1),
        )
        radial = [lens[f"radialDistortion{i}"] for i in (1, 2, 3)]
        tangential = [lens[f"tangentalDistortion{i}"] for i in (1, 2)]
        gl = np.array([[place[f"r{i}{j}"] for j in (1, 2, 3)] for i in (1, 2, 3)])
        centre = np.array([place[axis] for axis in "xyz"]) / 1000
    except (KeyError, ZeroDivisionError) as error:
        raise UserError(
            f"{path}: camera {camera.get('serial')} lacks {error}; export the calibration again"
        ) from None
    turn = np.diag([1.0, -1.0, -1.0]) @ gl
    entries["distortion_coefficients"] = [*radial[:2], *tangential, radial[2]]
    return entries | {"R": turn.tolist(), "t": (-turn @ centre).tolist()}


def _attributes(path: str, camera: ElementTree.Element, name: str) -> dict[str, float]:
    """Read the numbers in the attributes of a camera's element."""
    element = camera.find(name)
    if element is None:
        raise UserError(f"{path}: camera {camera.get('serial')} lacks {name}; export the calibration again")
    return {key: float(value) for key, value in element.items() if re.fullmatch(r"[-+\d.eE]+", value)}


def read_opencap(path: str) -> Entries:
    """Read OpenCap's cameraIntrinsicsExtrinsics.pickle without R and t, which are relative to the board."""
    try:
        data = plain_pickle.load(Path(path).read_bytes())
        matrix, lens = np.asarray(data["intrinsicMat"], float), np.ravel(data["distortion"]).astype(float)
        height, width = np.ravel(data["imageSize"]).astype(float).tolist()
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise UserError(
            f"{path}: not a camera of OpenCap ({str(error)[:80]}); use its cameraIntrinsicsExtrinsics.pickle"
        ) from None
    return {
        "camera_matrix": matrix.tolist(),
        "distortion_coefficients": lens.tolist(),
        "image_width": width,
        "image_height": height,
    }
