"""Corrections by hand, and their effect on keypoints.

The file (JSON), in which every list is optional::

    {"corrections": [{"frame": 70, "joint": "l_knee", "uv": [1285.5, 812.0], "sd_px": 5}],
     "hidden": [{"first": 80, "last": 95, "joint": "r_ankle"}],
     "swapped": [{"first": 40, "last": 52}],
     "floor": [{"frame": 60, "joint": "l_heel", "uv": [1190.0, 940.0]}]}

``corrections`` pull a joint (or another marker of the prior) to a pixel; ``sd_px`` is the standard deviation
of the click.  ``hidden`` joints are not visible, whatever the detector found.  ``swapped`` swaps left and
right of all joints.  ``floor`` puts a foot on the floor of a calibrated camera, where the pixel shows it.
``corrections`` also work when a video's images are lifted (`gait.lift.video`), the others only with
keypoints.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from gait.bindings.abi import MAX_PIXELS
from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import side_pairs
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.fields import Fields, read_json
from gait.io.keypoints_file import FURTHEST, Keypoints

Floats = npt.NDArray[np.float64]
Size = tuple[int, int]

_LARGEST = MAX_PIXELS, MAX_PIXELS  # largest picture of a camera
CLICK_SD = 4.0  # pixels, unless the correction states it
ERRS_FOR = 0.25  # seconds in which the autocorrelation of a detector's error falls to 1/e
STANDING_FOOT_SD_M = 0.02  # metres, of a foot that stands at a point of the floor
FOOT_JOINTS = ("toe", "heel", "ankle")


@dataclass(frozen=True)
class Correction:
    """A marker pulled to a point of the picture.

    Attributes
    ----------
    frame : int
        Frame of the video, from 0.
    joint : str
    uv : (float, float)
        Pixels.
    sd_px : float
        Standard deviation, pixels.
    """

    frame: int
    joint: str
    uv: tuple[float, float]
    sd_px: float = CLICK_SD


@dataclass(frozen=True)
class Hidden:
    """A joint that is not visible from frame `first` to frame `last`."""

    first: int
    last: int
    joint: str


@dataclass(frozen=True)
class Swap:
    """Frames `first` to `last`, in which left and right are swapped."""

    first: int
    last: int


@dataclass(frozen=True)
class FloorPin:
    """A foot that, in one frame, stands on the floor at pixel `uv`."""

    frame: int
    joint: str
    uv: tuple[float, float]
    sd_px: float = CLICK_SD


@dataclass(frozen=True)
class Edits:
    """Contents of a corrections file."""

    corrections: tuple[Correction, ...] = ()
    hidden: tuple[Hidden, ...] = ()
    swapped: tuple[Swap, ...] = ()
    floor: tuple[FloorPin, ...] = ()

    def as_json(self) -> dict[str, list[dict[str, Any]]]:
        """Make the contents of the file; of empty lists, only that of corrections is kept."""
        lists = {key: [_plain(asdict(each)) for each in getattr(self, key)] for key in _LISTS}
        return {key: entries for key, entries in lists.items() if entries or key == "corrections"}


def as_json(corrections: Sequence[Correction]) -> dict[str, list[dict[str, Any]]]:
    """Make the contents of a file that has only corrections."""
    return Edits(tuple(corrections)).as_json()


def _plain(entry: dict[str, Any]) -> dict[str, Any]:
    return {key: list(value) if isinstance(value, tuple) else value for key, value in entry.items()}


class EntryReader:
    """Reads and checks entries of a file, and of requests, which are saved to one only if they are valid.

    Frames must exist, joints must be in the prior, and pixels must be near the picture.
    """

    def __init__(self, prior: SegmentPrior, frames: range, size: Size) -> None:
        self._prior, self._frames, self._size = prior, frames, size

    def correction(self, fields: Fields) -> Correction:
        """Read an entry of ``corrections``."""
        fields.only(("frame", "joint", "uv", "sd_px"))
        return Correction(
            self.frame(fields, "frame"), self._joint(fields), self.pixel(fields, "uv"), _sd(fields)
        )

    def hidden(self, fields: Fields) -> Hidden:
        """Read an entry of ``hidden``."""
        fields.only(("first", "last", "joint"))
        return Hidden(*self._range(fields), self._joint(fields))

    def swap(self, fields: Fields) -> Swap:
        """Read an entry of ``swapped``."""
        fields.only(("first", "last"))
        return Swap(*self._range(fields))

    def pin(self, fields: Fields) -> FloorPin:
        """Read an entry of ``floor``."""
        fields.only(("frame", "joint", "uv", "sd_px"))
        joint = self._joint(fields)
        if not joint.endswith(FOOT_JOINTS):
            raise fields.fail("joint", f"is {joint!r}", "only a toe, heel or ankle can stand on the floor")
        return FloorPin(self.frame(fields, "frame"), joint, self.pixel(fields, "uv"), _sd(fields))

    def _range(self, fields: Fields) -> tuple[int, int]:
        first, last = self.frame(fields, "first"), self.frame(fields, "last")
        if last < first:
            raise fields.fail("last", f"is {last}, before first ({first})", "give the first frame as first")
        return first, last

    def frame(self, fields: Fields, key: str) -> int:
        """Read the number of a frame under a key."""
        frames = self._frames
        remedy = f"give a frame in the range used, {frames[0]} to {frames[-1]}, or other --start and --stop"
        return fields.integer(key, frames[0], frames[-1], remedy)

    def _joint(self, fields: Fields) -> str:
        joint = fields.get("joint", "name a joint")
        if joint not in self._prior.names:
            raise fields.fail("joint", f"is {joint!r}", f"use one of {' '.join(self._prior.names)}")
        return str(joint)

    def pixel(self, fields: Fields, key: str) -> tuple[float, float]:
        """Read column and row under a key."""
        size = self._size
        u, v = fields.array(key, (2,), "give column and row, pixels")
        if any(not -n <= x <= 2 * n for x, n in zip((u, v), size, strict=True)):
            what = f"is ({u:g}, {v:g}), far outside a picture of {size[0]}x{size[1]}"
            raise fields.fail(key, what, "give column and row, pixels")
        return float(u), float(v)


def _sd(fields: Fields) -> float:
    if "sd_px" not in fields:
        return CLICK_SD
    return fields.number("sd_px", 1e-3, FURTHEST, "give a standard deviation in pixels")


_LISTS: dict[str, Callable[[EntryReader, Fields], Any]] = {
    "corrections": EntryReader.correction,
    "hidden": EntryReader.hidden,
    "swapped": EntryReader.swap,
    "floor": EntryReader.pin,
}
_REMEDY = 'give {"corrections": [{"frame": 12, "joint": "l_knee", "uv": [x, y]}]}'
Entry = TypeVar("Entry", Correction, FloorPin)


def read_edits(
    path: str | os.PathLike[str], prior: SegmentPrior, frames: range, size: Size = _LARGEST
) -> Edits:
    """Read a corrections file for some frames; in each, a joint may be pulled or pinned only once.

    Joints may be outside the picture of `size` (width, height), but at most by its size.

    Raises
    ------
    UserError
        One line naming file, entry, key and remedy.
    """
    data = read_json(path, "corrections")
    data.only(tuple(_LISTS))
    if not any(key in data for key in _LISTS):
        data.get("corrections", _REMEDY)
    reader = EntryReader(prior, frames, size)
    found: dict[str, tuple[Any, ...]] = {}
    for key, read in _LISTS.items():
        listed = data.get(key, _REMEDY) if key in data else []
        if not isinstance(listed, list):
            raise data.fail(key, "is not a list", _REMEDY)
        entries = []
        for number, entry in enumerate(listed, 1):
            what = f"{path}: {_called(key)} {number}"
            if not isinstance(entry, dict):
                raise UserError(f"{what} is not an object of keys; {_REMEDY}")
            entries.append(read(reader, Fields(what, entry)))
        found[key] = tuple(entries)
    edits = Edits(**found)
    _require_single(path, "correction", "points at", edits.corrections)
    _require_single(path, "floor entry", "pins", edits.floor)
    return edits


def _called(key: str) -> str:
    return "correction" if key == "corrections" else f"{key} entry"


def _require_single(path: str | os.PathLike[str], what: str, does: str, entries: Sequence[Entry]) -> None:
    """Raise UserError for a second entry for the same joint and frame."""
    first: dict[tuple[int, str], int] = {}
    for number, entry in enumerate(entries, 1):
        twin = first.setdefault((entry.frame, entry.joint), number)
        if twin != number:
            of = f"{does} {entry.joint} in frame {entry.frame}, as {what} {twin} does"
            raise UserError(f"{path}: {what} {number} {of}; remove one of them")


def read_corrections(
    path: str | os.PathLike[str], prior: SegmentPrior, stop: int, first: int = 0, size: Size = _LARGEST
) -> list[Correction]:
    """Read a file that may contain only corrections, as for lifting a video's images.

    Frames must be in `first` <= frame < `stop`; errors are those of `read_edits`.
    """
    edits = read_edits(path, prior, range(first, stop), size)
    other = next((key for key in _LISTS if key != "corrections" and getattr(edits, key)), None)
    if other:
        raise UserError(f"{path}: {other} is for keypoints, but images are lifted; remove it")
    return list(edits.corrections)


def corrected(keypoints: Keypoints, edits: Edits, sd: float) -> Keypoints:
    """Apply corrections by hand to keypoints.

    A correction shows the detector's error at that joint and time.  Such errors last for a while, and concern
    a foot as a whole, so the variance of neighbouring points is increased by that of the error, less with
    time.

    Parameters
    ----------
    sd : float
        Noise of a point at full confidence, pixels.
    """
    if edits == Edits():
        return keypoints
    found = _with_points(keypoints, [c.joint for c in edits.corrections])
    uv, confidence = found.uv.copy(), found.confidence.copy()
    for swap in edits.swapped:
        rows = _rows(found, swap.first, swap.last)[:, None]
        for left, right in side_pairs(found.names):
            both = np.array([left, right])
            for values in (uv, confidence):
                values[rows, both] = values[rows, both[::-1]]
    for hide in edits.hidden:
        if hide.joint in found.names:
            uv[_rows(found, hide.first, hide.last), found.names.index(hide.joint)] = np.nan
    by_hand = np.full(uv.shape[:2], np.nan)
    errs = np.zeros(uv.shape[:2])
    rows_of = {int(frame): row for row, frame in enumerate(found.frame)}
    for c in edits.corrections:
        if c.frame not in rows_of:
            raise UserError(f"correction of frame {c.frame}: the keypoints have no such frame; remove it")
        row, column = rows_of[c.frame], found.names.index(c.joint)
        off = uv[row, column] - c.uv
        if np.isfinite(off).all():
            since = np.abs(found.time - found.time[row])
            wrong = max(float(off @ off) / 2 - c.sd_px**2 - sd**2, 0.0)
            for other in found_alike(found.names, c.joint):
                errs[:, other] = np.maximum(errs[:, other], wrong * np.exp(-2 * since / ERRS_FOR))
        by_hand[row, column] = c.sd_px
    for c in edits.corrections:  # all errors, before any point is moved
        row, column = rows_of[c.frame], found.names.index(c.joint)
        uv[row, column], confidence[row, column] = c.uv, 1.0
    own = np.zeros(errs.shape) if found.sd is None else np.nan_to_num(found.sd)
    lasting = found.lasting_sd
    return replace(
        found,
        uv=uv,
        confidence=confidence,
        sd=None if found.sd is None and not errs.any() else np.sqrt(own**2 + errs),
        lasting_sd=None if lasting is None else np.where(np.isfinite(by_hand), 0.0, lasting),
        by_hand=by_hand,
    )


def found_alike(names: Sequence[str], joint: str) -> list[int]:
    """List the columns of points with the same errors as a joint: itself, or all points of its foot."""
    if not joint.endswith(FOOT_JOINTS):
        return [names.index(joint)]
    return [k for k, name in enumerate(names) if name[:2] == joint[:2] and name.endswith(FOOT_JOINTS)]


def _rows(keypoints: Keypoints, first: int, last: int) -> npt.NDArray[np.intp]:
    return np.flatnonzero((keypoints.frame >= first) & (keypoints.frame <= last))


def _with_points(keypoints: Keypoints, joints: Sequence[str]) -> Keypoints:
    """Add empty columns for joints that the keypoints lack."""
    new = [joint for joint in dict.fromkeys(joints) if joint not in keypoints.names]
    if not new:
        return keypoints

    def wider(values: Floats | None, empty: float) -> Any:
        if values is None:
            return None
        more = np.full((len(values), len(new), *values.shape[2:]), empty)
        return np.concatenate([values, more], axis=1)

    return replace(
        keypoints,
        names=(*keypoints.names, *new),
        uv=wider(keypoints.uv, np.nan),
        confidence=wider(keypoints.confidence, 0.0),
        sd=wider(keypoints.sd, np.nan),
        lasting_sd=wider(keypoints.lasting_sd, 0.0),
        frame_sd=wider(keypoints.frame_sd, np.nan),
    )


@dataclass(frozen=True)
class Pins:
    """Feet on the floor of a camera's world.

    Attributes
    ----------
    row : (n,)
        Frames, as rows of the keypoints.
    joint : tuple of str
    place, sd : (n, 3)
        Position of the foot in the world, and its standard deviations, metres.
    """

    row: npt.NDArray[np.intp]
    joint: tuple[str, ...]
    place: Floats
    sd: Floats


def pins(keypoints: Keypoints, edits: Edits, camera: Camera | None, prior: SegmentPrior) -> Pins | None:
    """Find the positions of pinned feet in the world; None if there are none.

    Raises
    ------
    UserError
        If there is no camera, or a pixel shows no floor.
    """
    if not edits.floor:
        return None
    if camera is None:
        raise UserError("floor: needs a calibrated camera; give --camera, or remove the entries")
    rows_of = {int(frame): row for row, frame in enumerate(keypoints.frame)}
    row, place, sd = [], [], []
    for pin in edits.floor:
        at = camera.on_plane(np.array(pin.uv), 0.0)
        if pin.frame not in rows_of or not np.isfinite(at).all():
            raise UserError(f"floor: {pin.joint} in frame {pin.frame} is not on the floor; remove it")
        beside = camera.on_plane(np.array(pin.uv) + [0.0, pin.sd_px], 0.0)
        along = float(np.linalg.norm(beside - at)) if np.isfinite(beside).all() else STANDING_FOOT_SD_M
        index = prior.index([pin.joint])[0]
        height = prior.stature * float(prior.mean[:, :, index, 2].min())
        row.append(rows_of[pin.frame])
        place.append([at[0], at[1], height])
        sd.append([np.hypot(STANDING_FOOT_SD_M, along)] * 2 + [STANDING_FOOT_SD_M])
    return Pins(np.array(row), tuple(pin.joint for pin in edits.floor), np.array(place), np.array(sd))
