"""Calibrated camera: projection of world points to pixels, and rays through pixels.

Reads the project's JSON, OpenCV FileStorage YAML/XML, the TOML of Pose2Sim, anipose and FreeMoCap, and the
files of `gait.camera.other_files`.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gait import extras
from gait.bindings.abi import MAX_PIXELS, CameraC
from gait.camera import other_files
from gait.camera.lens import AGREE, agreeing
from gait.errors import GaitArgumentError, UserError
from gait.io.fields import Fields, parsing, read_json
from gait.io.files import require_file
from gait.io.opencv_file import read_storage

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


Array = NDArray[np.float64]
Intrinsics = tuple[float, float, float, float]  # fx fy cx cy


@dataclass(frozen=True, eq=False)
class Camera:
    """Pinhole camera with OpenCV's five-parameter lens.

    ``x_cam = R x_world + t``, ``u = fx X/Z + cx``, ``v = fy Y/Z + cy``; pixel centres are at integers; in the
    world z is up and the ground is z = 0.

    Attributes
    ----------
    width, height : int
        Pixels.
    fx, fy, cx, cy : float
        Pixels.
    R : ndarray of shape (3, 3)
        World to camera.
    t : ndarray of shape (3,)
        Metres.
    distortion : ndarray of shape (5,)
        k1 k2 p1 p2 k3.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    R: Array = field(repr=False)
    t: Array
    distortion: Array = field(default_factory=lambda: np.zeros(5))

    def __post_init__(self) -> None:
        """Make arrays of lists."""
        for name in ("R", "t", "distortion"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), np.float64))

    @staticmethod
    def read(path: str, size: tuple[int, int] | None = None, scale: bool = False) -> Camera:
        """Read a camera file of any supported kind; see `read_camera`."""
        return read_camera(path, size, scale=scale)

    @staticmethod
    def looking(place: ArrayLike, target: ArrayLike, size: tuple[int, int], focal: float) -> Camera:
        """Make a camera at `place` with `target` in the middle of the picture and a level horizon.

        Parameters
        ----------
        place, target : array_like of shape (3,)
            World, metres; neither vertically above the other.
        size : (int, int)
            Width and height, pixels.
        focal : float
            Pixels.
        """
        centre = np.asarray(place, np.float64)
        ahead = np.asarray(target, np.float64) - centre
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        R = np.stack([right, np.cross(ahead, right), ahead])
        width, height = size
        return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, R, -R @ centre)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.width, self.height

    @property
    def matrix(self) -> Array:
        """Intrinsic matrix, shape (3, 3)."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    @property
    def centre(self) -> Array:
        """Position of the lens in the world, shape (3,), metres."""
        return np.asarray(-self.R.T @ self.t)

    def depth(self, points: ArrayLike) -> Array:
        """Distance of world points (..., 3) along the lens's axis, shape (...), metres; negative behind."""
        return np.asarray(np.asarray(points, np.float64) @ self.R[2] + self.t[2])

    def project(self, points: ArrayLike) -> Array:
        """Project world points (..., 3) to pixels (..., 2), with lens distortion; NaN behind the camera."""
        with extras.importing("gait.Camera", "video"):
            import cv2  # here, so that models can be used without OpenCV

        world = np.asarray(points, np.float64)
        flat = np.ascontiguousarray(world.reshape(-1, 3))
        uv = np.full((len(flat), 2), np.nan)
        front = self.depth(flat) > 1e-6
        if front.any():
            rvec, _ = cv2.Rodrigues(self.R)
            uv[front] = cv2.projectPoints(flat[front], rvec, self.t, self.matrix, self.distortion)[0][:, 0]
        return uv.reshape(*world.shape[:-1], 2)

    def linearised(self, points: ArrayLike) -> tuple[Array, Array]:
        """Project, also behind the camera; also return slopes (..., 2, 3) by place, pixels per metre."""
        with extras.importing("gait.Camera", "video"):
            import cv2

        world = np.asarray(points, np.float64)
        rvec, _ = cv2.Rodrigues(self.R)
        flat = np.ascontiguousarray(world.reshape(-1, 3))
        uv, table = cv2.projectPoints(flat, rvec, self.t, self.matrix, np.asarray(self.distortion))
        # a step of the point, rotated to the camera's axes, is a step of the translation
        slopes = table[:, 3:6].reshape(-1, 2, 3) @ self.R
        where = world.shape[:-1]
        return np.asarray(uv, float).reshape(*where, 2), slopes.reshape(*where, 2, 3)

    def shows(self, points: ArrayLike) -> bool:
        """Whether any of the world points (..., 3) is in the picture."""
        uv = self.project(points)
        return bool(((uv >= 0) & (uv < self.size)).all(axis=-1).any())

    def rays(self, pixels: ArrayLike) -> Array:
        """Find the rays through pixels (..., 2): unit directions (..., 3) in the world, from `centre`."""
        plane = self._undistorted(pixels, np.eye(3))
        direction = np.concatenate([plane, np.ones((*plane.shape[:-1], 1))], axis=-1) @ self.R
        direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
        return np.asarray(direction)

    def undistorted(self, pixels: ArrayLike) -> Array:
        """Find the pixels (..., 2) at which the same would appear without the distortion of the lens."""
        return self._undistorted(pixels, self.matrix)

    def _undistorted(self, pixels: ArrayLike, matrix: Array) -> Array:
        """Remove the distortion from pixels (..., 2), for a camera with this matrix (3, 3)."""
        with extras.importing("gait.Camera", "video"):
            import cv2  # as in project()

        uv = np.asarray(pixels, np.float64)
        flat = np.ascontiguousarray(uv.reshape(-1, 1, 2))
        if not flat.size:  # for which OpenCV returns None
            return np.empty(uv.shape)
        stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-9)
        found = cv2.undistortPointsIter(flat, self.matrix, self.distortion, np.eye(3), matrix, stop)
        return np.asarray(np.reshape(found, uv.shape), np.float64)

    def on_plane(self, pixels: ArrayLike, height: float = 0.0) -> Array:
        """Intersect rays of pixels (..., 2) with the plane z = `height`: (..., 3), NaN if they miss it."""
        direction = self.rays(pixels)
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (height - self.centre[2]) / direction[..., 2]
        along = np.where(np.isfinite(along) & (along > 0), along, np.nan)
        return self.centre + along[..., None] * direction

    def scaled(self, factor: float) -> Camera:
        """Return the camera of the same picture resized by `factor` (pixel centres at integers)."""
        shift = 0.5 * (factor - 1)
        return replace(
            self,
            width=round(self.width * factor),
            height=round(self.height * factor),
            fx=self.fx * factor,
            fy=self.fy * factor,
            cx=self.cx * factor + shift,
            cy=self.cy * factor + shift,
        )

    def check_size(self, where: str, size: tuple[int, int]) -> None:
        """Raise UserError unless the calibration is for frames of `size` (width, height)."""
        if self.size == tuple(size):
            return
        width, height = size
        made = f"{where}: calibrated for {self.width}x{self.height}, the video is {width}x{height}"
        if self.same_aspect(size):
            factor = width / self.width
            raise UserError(
                f"{made}, resized by {factor:.4g}; give --scale-camera if it shows the same, or scale width, "
                "height, fx, fy, cx, cy"
            )
        if self.same_aspect((height, width)):
            resized = "" if self.size == (height, width) else " and resized"
            raise UserError(f"{made}, turned by 90 degrees{resized}; turn it back, or calibrate it as it is")
        cut = ""
        if width == self.width and height < self.height:
            cut = f": {self.height - height} rows are cut off"
        elif height == self.height and width < self.width:
            cut = f": {self.width - width} columns are cut off"
        raise UserError(f"{made}, another aspect{cut}; calibrate for this video or undo its crop")

    def same_aspect(self, size: tuple[int, int]) -> bool:
        """Whether pictures of `size` may be resized pictures of this camera, to within a pixel."""
        return abs(self.height * size[0] / self.width - size[1]) < 1

    def for_size(self, size: tuple[int, int]) -> Camera:
        """Return the camera of the same picture resized to `size`, of the same aspect (`same_aspect`)."""
        return replace(self.scaled(size[0] / self.width), width=size[0], height=size[1])

    def check_place(self, where: str) -> None:
        """Raise UserError unless people standing on the floor, z = 0, would appear upright in the picture."""
        from gait.bindings.library import call

        try:
            call("gait_camera_check", self.to_c())
        except GaitArgumentError as exc:
            raise UserError(f"{where}: {exc.text} (gait camera makes such a file)") from None

    def to_c(self) -> CameraC:
        """Make a ``gait_camera``."""
        from gait.bindings.library import library

        library()  # loading it defines the structures
        c = CameraC(self.width, self.height, self.fx, self.fy, self.cx, self.cy)
        c.R[:], c.t[:] = self.R.ravel().tolist(), self.t.tolist()
        c.distortion[:] = self.distortion.tolist()
        return c

    def to_dict(self) -> dict[str, Any]:
        """Return the keys of the JSON camera file."""
        plain = {key: getattr(self, key) for key in ("width", "height", "fx", "fy", "cx", "cy")}
        return plain | {"R": self.R.tolist(), "t": self.t.tolist(), "distortion": self.distortion.tolist()}


LONGEST_LENS = 1000  #: largest ratio of focal length to picture width; real lenses reach a few hundred

_JSON_KEYS = ("width", "height", "fx", "fy", "cx", "cy", "R", "t", "distortion", "note")

#: Documented names in OpenCV files, and others in use for the same entries: in OpenCV's samples of several
#: versions, in ROS and in tutorials.  Compared in lower case without punctuation, as `_plain` returns them.
_OPENCV_NAMES = {
    "camera_matrix": ("cameramatrix", "k", "mtx", "intrinsicmatrix"),
    "distortion_coefficients": (
        *("distortioncoefficients", "distortioncoeffs", "distcoeffs", "distcoefs", "distortion", "dist", "d"),
        "distortions",
    ),
    "R": ("r", "rotationmatrix"),
    "rvec": ("rvec", "rotationvector"),
    "t": ("t", "tvec", "translation", "translationvector"),
    "image_width": ("imagewidth", "width"),
    "image_height": ("imageheight", "height"),
    "image_size": ("imagesize", "size", "resolution"),
}
_TOML_KEYS = ("name", "size", "matrix", "distortions", "rotation", "translation", "fisheye")

#: Keys that describe a lens, as `_plain` returns them: words in keys, and whole keys.
_LENS_WORD = re.compile(
    r"dist(?!ance)|fisheye|omni|radial|tangential|prism|equidistant|kannala|(lens|camera|projection)(model|type)"
    r"|(?<!correlation)coef"
)
_LENS_KEYS = re.compile(r"model|d\d+|k[1-9]|p[12]|s[1-4]|xi|tau[xy]|skew|kc\d*")
#: Keys of names, which may contain any word, and words in the keys of other short lists of numbers.
_NAME_KEYS = re.compile(r"(camera|cam)?name|.*(topic|path|file|time|date)")
_OTHER_LISTS = re.compile(
    r"error|rms|roi|quat|rot|orient|pos|size|board|square|rect|box|crop|view|overlap|time"
)
#: Names of lens models with at most k1 k2 p1 p2 k3; the number of coefficients reveals rational ones with
#: more.
_LENSES = {
    *(
        "",
        "none",
        "pinhole",
        "perspective",
        "plumbbob",
        "radtan",
        "radialtangential",
        "brown",
        "brownconrady",
    ),
    *("opencv", "standard", "rationalpolynomial"),
}
#: Words in the names of other lens models; keys "model" and "type" may also name the manufacturer's product.
_FOREIGN = re.compile(
    r"fisheye|equi(?![pv])|stereographic|kannala|^kb\d|omni|^mei$|e?ucm|unified|doublesphere|^ds$|^fov$"
    r"|division|ocam|scaramuzza|prism|spline|spheric|panoram"
)
#: Names of OpenCV's fisheye lens, with four coefficients.
_FISHEYES = ("fisheye", "opencvfisheye", "equidistant", "equi", "kannalabrandt", "kannalabrandt4", "kb4")
#: Names of lenses that are certainly none of those.
_NO_FISHEYES = ("plumbbob", "radtan", "radialtangential", "brown", "brownconrady", "rationalpolynomial")
_MORE_TERMS = (8, 12, 14)  # coefficients of OpenCV's lenses with rational terms, thin prisms, and tilt
_LARGEST_COEFFICIENT = 100  # below focal lengths and pictures' sizes, in pixels
#: Largest relative difference in size between the picture and one with the principal point in its middle: if
#: the file states the size, so that the picture may be cropped; otherwise; and, for a picture that was
#: resized, between the factors of width and height.
_CROPPED, _RESIZED, _ALIKE = 0.7, 0.2, 0.05


def read_camera(
    path: str, size: tuple[int, int] | None = None, *, placed: bool = True, scale: bool = False
) -> Camera:
    """Read a camera file of any supported kind, chosen by its suffix and content.

    Parameters
    ----------
    path : str
        ``.json``, ``.yaml``, ``.yml``, ``.xml``, ``.toml``, ``.txt`` (COLMAP, Qualisys), ``.bin``
        (COLMAP) or ``.pickle`` (OpenCap); followed by ``:name`` if the file has several cameras.
    size : (int, int), optional
        Width and height of the video, pixels: checked, and used for OpenCV files, which may lack the size.
    placed : bool
        Whether rotation and translation are required; without them the camera is at the origin.
    scale : bool
        Whether to resize a camera to `size` if its pictures have the same aspect but another size.

    Raises
    ------
    UserError
        One line naming file, key and remedy.
    """
    file, name = split_name(str(path))
    require_file(file, "camera file")
    suffix, stated = Path(file).suffix.lower(), True
    if suffix == ".json":
        camera = _from_json(file, placed)
    elif suffix in (".yaml", ".yml", ".xml", ".txt", ".bin", ".pickle", ".pkl"):
        camera, stated = _from_entries(file, _entries(file, suffix, name), size, placed)
    elif suffix == ".toml":
        camera = _from_toml(file, name)
    else:
        raise UserError(
            f"{file}: unknown camera suffix; use .json, .yaml, .yml, .xml, .toml, .txt, .bin or .pickle"
        )
    _check_middle(str(path), camera, stated)
    focal = max(camera.fx, camera.fy)
    if focal > LONGEST_LENS * camera.width:
        raise UserError(
            f"{path}: focal length of {focal:.6g} pixels is over {LONGEST_LENS} times the picture's width; "
            "give it in pixels"
        )
    if size is not None and scale and camera.same_aspect(size):
        return camera.for_size(size)
    if size is not None:
        camera.check_size(str(path), size)
    return camera


def camera_names(path: str) -> list[str]:
    """List the cameras of a TOML file as paths for `read_camera`; a file of another kind is one camera.

    Raises
    ------
    UserError
        If the file cannot be read.
    """
    file, name = split_name(path)
    if name is not None or Path(file).suffix.lower() != ".toml" or not Path(file).is_file():
        return [path]
    return [f"{file}:{name}" for name in _toml_cameras(file)[1]]


def write_camera(path: Path, camera: Camera) -> None:
    """Write a JSON camera file."""
    path.write_text(json.dumps(camera.to_dict(), indent=1) + "\n")


def write_lens(path: Path, camera: Camera, note: str) -> None:
    """Write a JSON camera file with the lens but no pose, and a note."""
    lens = {key: value for key, value in camera.to_dict().items() if key not in ("R", "t")}
    path.write_text(json.dumps(lens | {"note": note}, indent=1) + "\n")


def split_name(path: str) -> tuple[str, str | None]:
    """Split FILE.toml:name into file and name of a camera; the name is None if there is none."""
    file, colon, name = path.rpartition(":")
    several = file.lower().endswith((".toml", ".txt", ".bin", ".yaml", ".yml", ".xml"))
    return (file, name) if colon and several else (path, None)


def _from_json(path: str, placed: bool) -> Camera:
    fields = read_json(path, "camera")
    fields.only(_JSON_KEYS)
    remedy = "give the size of the video in pixels"
    width, height = (fields.integer(key, 1, MAX_PIXELS, remedy) for key in ("width", "height"))
    fx, fy = (fields.number(key, 1e-3, 1e9, "give the focal length in pixels") for key in ("fx", "fy"))
    cx, cy = (fields.number(key, -1e6, 1e6, "give the principal point in pixels") for key in ("cx", "cy"))
    lens = _distortion(fields, "distortion")
    return Camera(width, height, fx, fy, cx, cy, *_pose(fields, placed), lens)


def _check_middle(path: str, camera: Camera, stated: bool) -> None:
    """Raise UserError if the principal point is the middle of a picture of another, or an impossible, size.

    It is normally near the middle of the sensor.  Pictures may be cropped only if the file has `stated` their
    size.
    """
    x, y = (2 * camera.cx + 1) / camera.width, (2 * camera.cy + 1) / camera.height
    off = max(abs(x - 1), abs(y - 1))
    resized = off > _RESIZED and abs(x - y) < _ALIKE * max(x, y)
    if off > (_CROPPED if stated else _RESIZED) or resized:
        middle = f"the middle of {2 * camera.cx + 1:.0f}x{2 * camera.cy + 1:.0f}"
        remedy = (
            "give fx, fy, cx, cy for this size" if stated else "add image_width and image_height in pixels"
        )
        raise UserError(
            f"{path}: principal point ({camera.cx:.6g}, {camera.cy:.6g}) is {middle}, the picture is "
            f"{camera.width}x{camera.height}; {remedy}"
        )


def _entries(path: str, suffix: str, name: str | None) -> dict[str, Any]:
    """Read the entries of a file, under OpenCV's names."""
    start = Path(path).read_bytes()[:4096]
    if suffix == ".txt" or b"<calibration" in start:
        return other_files.read_text(path, name)
    if suffix == ".bin":
        return other_files.read_binary(path, name)
    if suffix in (".pickle", ".pkl"):
        return other_files.read_opencap(path)
    if suffix in (".yaml", ".yml") and b"%YAML" not in start:
        return other_files.read_plain_yaml(path, name)
    return read_storage(path)


def _from_entries(
    path: str, content: dict[str, Any], size: tuple[int, int] | None, placed: bool
) -> tuple[Camera, bool]:
    """Return the camera, and whether the file states its size."""
    fields, fisheye = _opencv_fields(path, content)
    stated = any(key in fields for key in ("image_width", "image_height", "image_size"))
    if stated or size is None:
        size = _image_size(fields)
    given = _intrinsics(fields, "camera_matrix")
    intrinsics, lens = _lens(fields, "distortion_coefficients", given, size, fisheye)
    return Camera(*size, *intrinsics, *_pose(fields, placed), lens), stated


def _image_size(fields: Fields) -> tuple[int, int]:
    """Read width and height from an OpenCV file."""
    remedy = "add image_width and image_height in pixels"
    if "image_size" in fields and "image_width" not in fields:
        return _size(fields, "image_size", remedy)
    width, height = (fields.integer(f"image_{side}", 1, MAX_PIXELS, remedy) for side in ("width", "height"))
    if "image_size" in fields and (width, height) != _size(fields, "image_size", remedy):
        raise fields.fail("image_size", "differs from image_width and image_height", "correct one of them")
    return width, height


def _size(fields: Fields, key: str, remedy: str) -> tuple[int, int]:
    size = fields.array(key, (2,), remedy)
    if not ((size >= 1) & (size <= MAX_PIXELS) & (size == size.round())).all():
        raise fields.fail(key, f"is {size.tolist()}", "give whole [width, height] in pixels")
    return int(size[0]), int(size[1])


def _pose(fields: Fields, placed: bool) -> tuple[Array, Array]:
    """Return rotation and translation; the identity and zero if both are missing and `placed` is false."""
    if not any(key in fields for key in ("R", "rvec", "t")):
        if not placed:
            return np.eye(3), np.zeros(3)
        raise fields.fail("R", "and t are missing", f"place the camera: gait camera --lens {fields.where}")
    turn = _rodrigues(fields, "rvec") if "rvec" in fields and "R" not in fields else _rotation(fields, "R")
    return turn, _translation(fields, "t")


def _plain(name: str) -> str:
    return "".join(c for c in name.lower() if c.isalnum())


def _opencv_fields(path: str, content: dict[str, Any]) -> tuple[Fields, bool]:
    """Return the entries of a camera under their documented names, and whether it is a fisheye lens."""
    data, others = dict[str, Any](), dict[str, Any]()
    documented = {other: name for name, others in _OPENCV_NAMES.items() for other in others}
    source: dict[str, str] = {}
    for key, value in content.items():
        name = documented.get(_plain(key))
        if name is None:
            others[key] = value
        elif name in data and np.ravel(data[name]).tolist() != np.ravel(value).tolist():
            raise UserError(f"{path}: {source[name]} and {key} differ; remove one")
        else:
            data[name], source[name] = value, key
    fields = Fields(path, data)
    fisheye = [key for key, value in others.items() if _is_fisheye(_plain(key), value)]
    rest = {key: value for key, value in others.items() if key not in fisheye}
    other = next((key for key, value in rest.items() if _plain(str(value)) in _NO_FISHEYES), None)
    if fisheye and other is not None:
        raise UserError(f"{path}: {fisheye[0]} and {other} name different lenses; remove one")
    _refuse_other_lenses(fields, rest, "distortion_coefficients")
    if (
        "R" in fields
        and "rvec" in fields
        and np.abs(_rotation(fields, "R") - _rodrigues(fields, "rvec")).max() > 1e-3
    ):
        raise UserError(f"{path}: {source['R']} and {source['rvec']} differ; remove one")
    return fields, bool(fisheye)


def _is_fisheye(key: str, value: Any) -> bool:
    """Whether an entry names OpenCV's fisheye lens; `key` as `_plain` returns it."""
    if isinstance(value, str):
        return not _NAME_KEYS.fullmatch(key) and _plain(value) in _FISHEYES
    return key in ("fisheye", "fisheyemodel") and value == 1


def _refuse_other_lenses(fields: Fields, others: Mapping[str, Any], name: str) -> None:
    """Raise UserError for unknown keys that describe a lens, unless they are 0, false or ''.

    `name`: key of the coefficients.
    """
    without = name not in fields or not np.any(fields.get(name, ""))
    for key, value in others.items():
        if what := _other_lens(_plain(key), value, without):
            remedy = (
                f"lenses are {name} with k1 k2 p1 p2 [k3]: rename it, undistort the video, or calibrate anew"
            )
            raise fields.fail(key, what, remedy)


def _other_lens(key: str, value: Any, without: bool) -> str:
    """Return how an unknown entry, its key from `_plain`, describes a lens, or ''.

    `without`: whether the coefficients are missing, so that any list of as many numbers may be them.
    """
    named = _LENS_KEYS.fullmatch(key) or _LENS_WORD.search(key)
    if isinstance(value, str):
        foreign = _FOREIGN.search(_plain(value)) and not _NAME_KEYS.fullmatch(key)
        known = key in ("cameramodel", "cameratype") or _plain(value) in _LENSES
        return f"is {value[:40]!r}" if foreign or (named and not known) else ""
    if named and np.any(np.array(value, object)):
        return "describes an unknown kind of lens"
    if isinstance(value, Mapping):
        found = (_other_lens(_plain(str(inner)), entry, False) for inner, entry in value.items())
        return "describes an unknown kind of lens" if any(found) else ""
    if isinstance(value, list):
        if words := next(filter(None, (_other_lens("", entry, False) for entry in value)), ""):
            return words
        numbers = _row_or_column(value) if without and not _OTHER_LISTS.search(key) else np.zeros(0)
        if len(numbers) in (4, 5, *_MORE_TERMS) and 0 < np.abs(numbers).max() < _LARGEST_COEFFICIENT:
            return f"may be a lens ({len(numbers)} numbers)"
    return ""


def _row_or_column(value: list[Any]) -> Array:
    """Return the numbers of a list, or of a matrix of one row or column; empty if it is neither."""
    try:
        numbers = np.array(value, np.float64)
    except (TypeError, ValueError):
        return np.zeros(0)
    return numbers.ravel() if max(numbers.shape) == numbers.size else np.zeros(0)


def _toml_cameras(path: str) -> tuple[dict[str, Any], dict[str, Mapping[str, Any]]]:
    """Read a TOML file; return its content and those of its tables that are cameras."""
    with parsing(path, "TOML", "export the calibration again"):
        data = tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
    return data, {
        key: value for key, value in data.items() if isinstance(value, Mapping) and "matrix" in value
    }


def _from_toml(path: str, name: str | None) -> Camera:
    data, cameras = _toml_cameras(path)
    if name is None and len(cameras) == 1:
        name = next(iter(cameras))
    if name not in cameras:
        found = " ".join(cameras) or "none (a camera is a table with matrix, rotation and translation)"
        asked = f"no camera {name}" if name else "several cameras or none"
        raise UserError(f"{path}: {asked}; choose one as {Path(path).name}:NAME, found: {found}")
    fields = Fields(f"{path}: [{name}]", cameras[name])
    others = {key: value for key, value in cameras[name].items() if key not in _TOML_KEYS}
    _refuse_other_lenses(fields, others, "distortions")
    size = _size(fields, "size", "give [width, height] in pixels")
    given, turn = _intrinsics(fields, "matrix"), _rodrigues(fields, "rotation")
    intrinsics, lens = _lens(fields, "distortions", given, size, bool(cameras[name].get("fisheye")))
    metres = 0.001 if _in_millimetres(data.get("metadata")) else 1.0
    return Camera(*size, *intrinsics, turn, metres * _translation(fields, "translation"), lens)


def _in_millimetres(metadata: Any) -> bool:
    """Whether a calibration is FreeMoCap's, whose unit is that of its board, and that is the millimetre."""
    side = metadata.get("charuco_square_size") if isinstance(metadata, Mapping) else None
    return isinstance(side, int | float) and side > 1  # no square is a metre wide


def _intrinsics(fields: Fields, key: str) -> Intrinsics:
    """Read fx fy cx cy from a 3x3 matrix without skew."""
    m = fields.array(key, (3, 3), "give [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels")
    if m[0, 0] <= 0 or m[1, 1] <= 0:
        raise fields.fail(key, "has a focal length that is not positive", "give fx and fy in pixels")
    if abs(m[0, 1]) > 1e-6 * m[0, 0]:
        raise fields.fail(key, "has skew, which is not supported", "calibrate with zero skew")
    if not np.allclose([*m[1:, 0], *m[2, 1:]], [0, 0, 0, 1], atol=1e-9):
        raise fields.fail(key, "is not upper triangular", "give [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")
    return float(m[0, 0]), float(m[1, 1]), float(m[0, 2]), float(m[1, 2])


def _rotation(fields: Fields, key: str) -> Array:
    """Read a rotation and make it exactly orthonormal, since text files round it."""
    m = fields.array(key, (3, 3), "give the rotation from world to camera, 3 rows of 3 (or rvec in YAML)")
    u, _, vt = np.linalg.svd(m)
    nearest = u @ vt
    if np.abs(nearest - m).max() > 1e-3 or np.linalg.det(nearest) < 0:
        raise fields.fail(key, "is not a rotation", "its rows must be orthogonal, of length 1, right-handed")
    return np.asarray(nearest)


def _rodrigues(fields: Fields, key: str) -> Array:
    with extras.importing("gait.Camera", "video"):
        import cv2

    vector = fields.array(key, (3,), "give the rotation vector from world to camera, radians")
    return np.asarray(cv2.Rodrigues(vector)[0], np.float64)


def _translation(fields: Fields, key: str) -> Array:
    return fields.array(key, (3,), "give the translation from world to camera, 3 numbers in metres")


def _lens(
    fields: Fields,
    key: str,
    intrinsics: Intrinsics,
    size: tuple[int, int],
    fisheye: bool,
) -> tuple[Intrinsics, Array]:
    """Return fx fy cx cy and k1 k2 p1 p2 k3; a fisheye lens, or one with more terms, is approximated."""
    remedy = "give k1 k2 p1 p2 [k3]"
    count = fields.count(key, remedy) if key in fields else 0
    if not (fisheye or count in _MORE_TERMS):
        return intrinsics, _distortion(fields, key)
    if fisheye and count not in (0, 4):
        raise fields.fail(key, f"has {count} numbers", "a fisheye lens has k1 k2 k3 k4")
    given = fields.array(key, (count,), remedy) if count else np.zeros(4)
    fx, fy, cx, cy = intrinsics
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    found = agreeing("fisheye" if fisheye else "opencv", given, matrix, size)
    if found is None or found[2] > AGREE:
        best = "no lens fits" if found is None else f"{found[2]:.2g} px off at best"
        kind = f"describes a {'fisheye ' * fisheye}lens"
        what = f"{kind} that k1 k2 p1 p2 k3 cannot replace within {AGREE:g} px ({best})"
        raise fields.fail(key, what, "undistort the video, or calibrate with k1 k2 p1 p2 [k3]")
    return (fx * found[1], fy * found[1], cx, cy), found[0]


def _distortion(fields: Fields, key: str) -> Array:
    """Read k1 k2 p1 p2 k3 from 0, 4 or 5 numbers; without the key the lens is ideal."""
    if key not in fields:
        return np.zeros(5)
    remedy = "give k1 k2 p1 p2 [k3] (0, 4 or 5 numbers)"
    count = fields.count(key, remedy)
    if count not in (0, 4, 5):
        raise fields.fail(key, f"has {count} numbers", f"{remedy}, from a calibration without rational terms")
    values = fields.array(key, (count,), remedy) if count else np.zeros(0)
    return np.concatenate([values, np.zeros(5 - count)])
