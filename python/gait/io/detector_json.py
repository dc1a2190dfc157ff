"""Read keypoints in JSON: OpenPose, COCO, AlphaPose, MMPose, MediaPipe."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.errors import UserError, unreadable
from gait.io.detections import Detection, Detections, names_of
from gait.io.fields import parsing

Array = NDArray[np.float64]

_OPENPOSE = "pose_keypoints_2d"
_LISTS = ("frames", "instance_info", "predictions", "results", "data")
_LANDMARKS = re.compile(r"pose_?landmarks?|landmarks?|keypoints", re.IGNORECASE)
_TIMES = {"timestamp_ms": 0.001, "timestamp_s": 1.0, "time": 1.0, "timestamp": 1.0, "t": 1.0}
_HIDDEN = 0.5  # confidence of a point that COCO's annotators marked as hidden


def read_folder(folder: str | os.PathLike[str]) -> Detections:
    """Read a folder of OpenPose: one JSON file per frame, whose name ends with the frame's number.

    UserError if a file is not OpenPose's, or two have the same number.
    """
    files = sorted(Path(folder).glob("*.json"))
    if not files:
        raise UserError(f"{folder}: has no JSON files; OpenPose writes NAME_000000000000_keypoints.json")
    found: list[Detection] = []
    width = 0
    before: dict[int, str] = {}
    for file in files:
        frame = _frame_of(file.name, str(file))
        if frame in before:
            raise UserError(f"{file}: is frame {frame}, like {before[frame]}; give a folder of one video")
        before[frame] = file.name
        data = _load(file)
        if not isinstance(data, Mapping) or "people" not in data:
            raise UserError(f"{file}: not a file of OpenPose, it has no people; remove it from the folder")
        for person in _openpose(str(file), data["people"], frame):
            width = _one_width(str(file), width, person)
            found.append(person)
    if not found:
        raise UserError(f"{folder}: no person in any of its {len(files)} frames")
    return Detections(names_of(str(folder), width), found)


def read_json_file(path: str | os.PathLike[str]) -> Detections:
    """Read a JSON file of any tool, recognised by its content.

    UserError in one line if it contains no people, or keypoints in an unknown layout.
    """
    data, where = _load(path), str(path)
    try:
        return _any(where, data, Path(path).name)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        what = f"{type(error).__name__}: {error}"
        raise UserError(f"{where}: JSON in an unknown layout ({what}); write the file again") from None


def _any(where: str, data: Any, name: str) -> Detections:
    if isinstance(data, Mapping):
        if "annotations" in data:
            return _coco(where, data)
        if "people" in data:
            people = list(_openpose(where, data["people"], _frame_of(name, where)))
            return _layout(where, people)
        if data and all(isinstance(v, Mapping) and {"people", "bodies"} & set(v) for v in data.values()):
            return _layout(where, [p for picture, v in data.items() for p in _by_picture(where, picture, v)])
        names = _mmpose_names(data.get("meta_info"))
        frames = next((data[key] for key in _LISTS if isinstance(data.get(key), list)), None)
        if frames is None:
            raise UserError(f"{where}: not a list of frames or people; give a file of a pose detector")
        return _frames(where, frames, names, first="meta_info" in data)
    if isinstance(data, list) and data and all(isinstance(v, Mapping) and "image_id" in v for v in data):
        return _layout(where, [_result(where, i, entry) for i, entry in enumerate(data)])
    if isinstance(data, list) and data:
        return _frames(where, data, ())
    raise UserError(f"{where}: JSON without people; give a file of a pose detector")


def _load(path: str | os.PathLike[str]) -> Any:
    try:
        text = Path(path).read_bytes()
    except OSError as error:
        raise unreadable(path, error) from error
    with parsing(str(path), "JSON", "write it again"):
        return json.loads(text.decode("utf-8-sig"))


def _frame_of(name: str, where: str) -> int:
    """Return the frame number in a file's name, which is the last number in it."""
    numbers = re.findall(r"\d+", re.sub(r"_keypoints|\.[a-zA-Z]\w*$", "", name))
    if not numbers:
        raise UserError(f"{where}: {name} has no frame number in its name; name it like NAME_000012")
    return int(numbers[-1])


def _triples(where: str, values: Any) -> Array:
    """Convert a flat list u v c u v c, or a list of triples, to points (P, 3)."""
    try:
        points = np.asarray(values, np.float64)
        return points.reshape(-1, 3)
    except (TypeError, ValueError):
        raise UserError(
            f"{where}: keypoints are not a list of u, v, confidence; write the file again"
        ) from None


def _one_width(where: str, width: int, person: Detection) -> int:
    """Return the number of points of a person; UserError if it differs from `width`, that of the others."""
    if width and len(person.points) != width:
        raise UserError(f"{where}: people have {width} points and {len(person.points)}; use one layout")
    return len(person.points)


def _layout(where: str, found: list[Detection], names: Sequence[str] = (), **more: Any) -> Detections:
    """Make `Detections`; UserError if people have different numbers of points."""
    if not found:
        raise UserError(f"{where}: contains no person")
    width = 0
    for person in found:
        width = _one_width(where, width, person)
    return Detections(names_of(where, width, names), found, **more)


def _openpose(where: str, people: Any, frame: int) -> Iterator[Detection]:
    if not isinstance(people, list):
        raise UserError(f"{where}: people is not a list; write the file again")
    for person in people:
        if not isinstance(person, Mapping) or _OPENPOSE not in person:
            raise UserError(f"{where}: a person has no {_OPENPOSE}; write 2-D keypoints")
        points = _triples(where, person[_OPENPOSE])
        if len(points):
            ids = np.ravel(person.get("person_id", -1)).tolist()
            known = len(ids) == 1 and isinstance(ids[0], int | float) and ids[0] >= 0
            yield Detection(frame, str(int(ids[0])) if known else None, points)


def _by_picture(where: str, name: str, content: Mapping[str, Any]) -> Iterator[Detection]:
    """Read the people of a picture in AlphaPose's formats open and cmu."""
    frame = _frame_of(name, where)
    if "people" in content:
        yield from _openpose(where, content["people"], frame)
    else:
        for body in content["bodies"]:
            yield Detection(frame, None, _triples(where, body.get("joints")))


def _result(where: str, index: int, entry: Mapping[str, Any]) -> Detection:
    """Read one entry of COCO's results, which AlphaPose also writes."""
    image = entry["image_id"]
    frame = int(image) if isinstance(image, int | float) else _frame_of(str(image), f"{where}: entry {index}")
    ids = np.ravel(entry.get("track_id", entry.get("idx", np.nan)))
    known = len(ids) == 1 and np.issubdtype(ids.dtype, np.number) and np.isfinite(ids[0])
    points = _triples(f"{where}: entry {index}", entry.get("keypoints"))
    return Detection(frame, f"{ids[0]:g}" if known else None, points)


def _coco(where: str, data: Mapping[str, Any]) -> Detections:
    """Read COCO's annotations: frames from file names, confidence from visibility 0 (none), 1 (hidden), 2."""
    pictures = {entry["id"]: entry for entry in data.get("images", []) if "id" in entry}
    numbers = {}
    for rank, (key, entry) in enumerate(sorted(pictures.items(), key=lambda item: str(item[0]).zfill(20))):
        name = str(entry.get("file_name", ""))
        numbers[key] = entry.get("frame_id", _frame_of(name, where) if re.search(r"\d", name) else rank)
    names = next((c["keypoints"] for c in data.get("categories", []) if c.get("keypoints")), ())
    found = []
    for i, entry in enumerate(data["annotations"]):
        if not entry.get("keypoints"):
            continue
        if entry.get("image_id") not in numbers:
            raise UserError(f"{where}: annotation {i}: image_id {entry.get('image_id')!r} is not in images")
        points = _triples(f"{where}: annotation {i}", entry["keypoints"]).copy()
        if np.isin(points[:, 2], (0, 1, 2)).all():
            points[:, 2] = np.choose(points[:, 2].astype(int), (0.0, _HIDDEN, 1.0))
        person = entry.get("track_id")
        frame = int(numbers[entry["image_id"]])
        found.append(Detection(frame, None if person is None else str(person), points))
    return _layout(where, found, names)


def _mmpose_names(meta: Any) -> tuple[str, ...]:
    names = meta.get("keypoint_id2name", {}) if isinstance(meta, Mapping) else {}
    return tuple(str(names[key]) for key in sorted(names, key=int))


def _frames(where: str, frames: list[Any], names: Sequence[str], first: bool = False) -> Detections:
    """Read a list of frames, each with people or landmarks, of MMPose or MediaPipe.

    `first`: number of the first frame: 1 in files of MMPose's demos, unless a frame is numbered 0.
    """
    found: list[Detection] = []
    times: dict[int, float] = {}
    shares = False
    numbers = [_number(entry, i) for i, entry in enumerate(frames)]
    if not all(isinstance(number, int) for number in numbers):
        raise UserError(f"{where}: a frame number is not a whole number; write the file again")
    numbered = all(isinstance(entry, Mapping) and "frame_id" in entry for entry in frames)
    offset = int(first and numbered and min(numbers) > 0)
    for number, entry in zip(numbers, frames, strict=True):
        frame = number - offset
        if isinstance(entry, Mapping):
            given = [entry[key] * unit for key, unit in _TIMES.items() if _is_number(entry.get(key))]
            times |= {frame: float(given[0])} if given else {}
        for person, points, share in _people(where, entry):
            found.append(Detection(frame, person, points))
            shares |= share
    kept = times if len(times) == len(set(numbers)) else {}
    return _layout(where, found, names, shares=shares, times=kept)


def _number(entry: Any, default: int) -> Any:
    """Return the frame number in an entry of a list, or the default."""
    if not isinstance(entry, Mapping):
        return default
    return entry.get("frame_id", entry.get("frame", default))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _people(where: str, entry: Any) -> Iterator[tuple[str | None, Array, bool]]:
    """Yield each person of a frame: id, points (P, 3), and whether these are fractions of the picture."""
    if entry is None:
        return
    if isinstance(entry, Mapping) and isinstance(entry.get("instances"), list):
        entry = entry["instances"]
    if isinstance(entry, list) and entry and isinstance(entry[0], Mapping) and "x" in entry[0]:
        yield None, _landmarks(where, entry), True
        return
    for person in entry if isinstance(entry, list) else [entry]:
        if isinstance(person, Mapping) and "keypoint_scores" in person:
            yield _mmpose(where, person)
        elif isinstance(person, list):
            yield from _people(where, person)
        elif isinstance(person, Mapping):
            key = next((key for key in person if _LANDMARKS.fullmatch(key)), None)
            if key is None:
                raise UserError(f"{where}: a frame has neither instances nor landmarks; write the file again")
            yield from _people(where, person[key]) if _holds_landmarks(person[key]) else ()


def _holds_landmarks(value: Any) -> bool:
    """Whether a value is landmarks of one or several people; null and empty lists mean no person."""
    return isinstance(value, list) and bool(value) and isinstance(value[0], list | Mapping)


def _mmpose(where: str, person: Mapping[str, Any]) -> tuple[str | None, Array, bool]:
    try:
        uv = np.asarray(person["keypoints"], np.float64).reshape(-1, np.shape(person["keypoints"])[-1])[:, :2]
        points = np.column_stack([uv, np.asarray(person["keypoint_scores"], np.float64).reshape(len(uv))])
    except (KeyError, TypeError, ValueError, IndexError):
        raise UserError(
            f"{where}: keypoints and keypoint_scores do not match; write the file again"
        ) from None
    track = person.get("track_id", person.get("instance_id"))
    return None if track is None else str(track), points, False


def _landmarks(where: str, landmarks: list[Any]) -> Array:
    """Convert MediaPipe's normalised landmarks to points (33, 3), with visibility as confidence."""
    try:
        points = np.array([[p["x"], p["y"], p.get("visibility", 1.0)] for p in landmarks], np.float64)
    except (KeyError, TypeError, ValueError, AttributeError):
        raise UserError(f"{where}: a landmark has no numbers x and y; write the file again") from None
    if np.abs(points[:, :2]).max() > 10:
        raise UserError(f"{where}: landmarks are not fractions of the picture; write normalised landmarks")
    return points
