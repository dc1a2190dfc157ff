"""MCAP with Foxglove's schemas in JSON: a motion, or all messages of an LCM log."""

from __future__ import annotations

import base64
import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait._version import __version__
from gait.body.skeleton import BONES
from gait.errors import unreadable
from gait.export.motion import Motion

Array = NDArray[np.float64]

_FRAME = "world"
_JOINT, _BONE = 0.03, 0.02  # metres; sizes
_COLOUR = {"r": 0.2, "g": 0.5, "b": 1.0, "a": 1.0}

_TIME = {"type": "object", "title": "time", "properties": {k: {"type": "integer"} for k in ("sec", "nsec")}}
_NUMBER, _TEXT = {"type": "number"}, {"type": "string"}
_NUMBERS = {"type": "array", "items": _NUMBER}


def _object(title: str, **properties: Any) -> dict[str, Any]:
    return {"title": f"foxglove.{title}", "type": "object", "properties": properties}


_VECTOR = _object("Vector3", **dict.fromkeys("xyz", _NUMBER))
_QUATERNION = _object("Quaternion", **dict.fromkeys("xyzw", _NUMBER))
_POSE = _object("Pose", position=_VECTOR, orientation=_QUATERNION)
_COLOR = _object("Color", **dict.fromkeys("rgba", _NUMBER))
_SPHERE = _object("SpherePrimitive", pose=_POSE, size=_VECTOR, color=_COLOR)
_POINTS = {"type": "array", "items": _object("Point3", **dict.fromkeys("xyz", _NUMBER))}
_LINE = _object(
    "LinePrimitive",
    **{
        "type": {"type": "integer"},
        "pose": _POSE,
        "thickness": _NUMBER,
        "scale_invariant": {"type": "boolean"},
    },
    **{"points": _POINTS, "color": _COLOR, "colors": {"type": "array", "items": _COLOR}},
    indices={"type": "array", "items": {"type": "integer"}},
)
_ENTITY = _object(
    "SceneEntity",
    **{
        "timestamp": _TIME,
        "frame_id": _TEXT,
        "id": _TEXT,
        "lifetime": _TIME,
        "frame_locked": {"type": "boolean"},
    },
    **{"spheres": {"type": "array", "items": _SPHERE}, "lines": {"type": "array", "items": _LINE}},
)
_BYTES = {"type": "string", "contentEncoding": "base64"}
#: Foxglove's schemas that are written, by name.
SCHEMAS = {
    "foxglove.SceneUpdate": _object(
        "SceneUpdate",
        deletions={"type": "array", "items": _object("SceneEntityDeletion", timestamp=_TIME, id=_TEXT)},
        entities={"type": "array", "items": _ENTITY},
    ),
    "foxglove.CompressedImage": _object(
        "CompressedImage", timestamp=_TIME, frame_id=_TEXT, data=_BYTES, format=_TEXT
    ),
    "foxglove.RawImage": _object(
        "RawImage",
        **{"timestamp": _TIME, "frame_id": _TEXT, "data": _BYTES, "encoding": _TEXT},
        **dict.fromkeys(("width", "height", "step"), {"type": "integer"}),
    ),
    "foxglove.CameraCalibration": _object(
        "CameraCalibration",
        **{
            "timestamp": _TIME,
            "frame_id": _TEXT,
            "width": {"type": "integer"},
            "height": {"type": "integer"},
        },
        **{"distortion_model": _TEXT, **dict.fromkeys("DKRP", _NUMBERS)},
    ),
}
_ANY = {"type": "object"}


class _Writer:
    """Writes one file; channels are created when first used."""

    def __init__(self, stream: Any) -> None:
        from mcap.writer import Writer

        self._writer: Any = Writer(stream)
        self._writer.start(library=f"libgait {__version__}")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._count: dict[str, int] = {}

    def add(
        self, topic: str, schema: str, message: Mapping[str, Any], nanoseconds: int, number: int | None = None
    ) -> None:
        """Add a message in JSON; `number`: of the message in its channel, by default counted from 0."""
        data = json.dumps(message, allow_nan=False).encode()
        if topic not in self._channels:
            if schema not in self._schemas:
                content = json.dumps(SCHEMAS.get(schema, _ANY)).encode()
                self._schemas[schema] = self._writer.register_schema(schema, "jsonschema", content)
            self._channels[topic] = self._writer.register_channel(topic, "json", self._schemas[schema])
        self._write(topic, data, nanoseconds, number)

    def add_bytes(self, topic: str, data: bytes, nanoseconds: int, number: int) -> None:
        """Add the bytes of a message that is damaged or of an unknown type."""
        channel = f"{topic} as bytes"
        if channel not in self._channels:
            self._channels[channel] = self._writer.register_channel(topic, "lcm", 0)
        self._write(channel, data, nanoseconds, number)

    def _write(self, topic: str, data: bytes, nanoseconds: int, number: int | None) -> None:
        count = self._count.get(topic, 0)
        self._count[topic] = count + 1
        self._writer.add_message(
            self._channels[topic], nanoseconds, data, nanoseconds, count if number is None else number
        )

    def finish(self) -> None:
        """Write the index."""
        self._writer.finish()


@contextmanager
def _writing(path: Path) -> Iterator[_Writer]:
    with path.open("wb") as stream:
        writer = _Writer(stream)
        yield writer
        writer.finish()


def write_motion(path: Path, motion: Motion) -> int:
    """Write a motion's frames: /person[_N] as a scene, /state[_N] as numbers; return their count."""
    rows = np.flatnonzero(motion.present).tolist()
    state_topic = "/" + motion.person.replace("person", "state")
    with _writing(path) as writer:
        for row, k in enumerate(rows):
            at = round(float(motion.track.time[row]) * 1e9)
            update = scene(motion.names, motion.places[k], at, motion.person)
            writer.add(f"/{motion.person}", "foxglove.SceneUpdate", update, at)
            state = {name: _plain(float(values[row])) for name, values in motion.track.numbers.items()}
            state |= {"frame": int(motion.track.frame[row]), "status": motion.track.status[row]}
            writer.add(state_topic, "gait.State", state, at)
    return len(rows)


def scene(names: Sequence[str], joints: Array, nanoseconds: int, person: str = "person") -> dict[str, Any]:
    """Make a foxglove.SceneUpdate of a person's joints (P, 3), metres; `person`: identifier of the entity."""
    place = dict(zip(names, joints.tolist(), strict=True))
    points = [_point(place[end]) for bone in BONES if all(e in place for e in bone) for end in bone]
    still = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    spheres = [
        {
            "pose": {"position": _point(p), "orientation": still},
            "size": dict.fromkeys("xyz", _JOINT),
            "color": _COLOUR,
        }
        for p in place.values()
    ]
    line = {
        **{
            "type": 2,
            "pose": {"position": _point((0.0, 0.0, 0.0)), "orientation": still},
            "thickness": _BONE,
        },
        **{"scale_invariant": False, "points": points, "color": _COLOUR, "colors": [], "indices": []},
    }
    entity = {
        **{"timestamp": _stamp(nanoseconds), "frame_id": _FRAME, "id": person, "lifetime": _stamp(0)},
        **{"frame_locked": False, "metadata": [], "spheres": spheres, "lines": [line]},
        **{kind: [] for kind in ("arrows", "cubes", "cylinders", "triangles", "texts", "models")},
    }
    return {"deletions": [], "entities": [entity]}


def _point(place: Sequence[float]) -> dict[str, float]:
    return dict(zip("xyz", place, strict=True))


def _stamp(nanoseconds: int) -> dict[str, int]:
    return {"sec": nanoseconds // 10**9, "nsec": nanoseconds % 10**9}


def _plain(value: Any) -> Any:
    """Convert a value for JSON; numbers that are not finite become null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, bytes | bytearray):
        return base64.b64encode(value).decode()
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if hasattr(value, "__slots__") and not isinstance(value, str | int):
        return {name: _plain(getattr(value, name)) for name in value.__slots__}
    return value


def is_lcm_log(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins like an LCM log."""
    try:
        with open(path, "rb") as file:
            return file.read(4) == b"\xed\xa1\xda\x01"
    except OSError as error:
        raise unreadable(path, error) from error


def write_log(path: Path, log: str | os.PathLike[str]) -> dict[str, int]:
    """Write every event of an LCM log with its channel and time; return the number of messages by topic.

    Pictures and cameras are written in Foxglove's schemas, other messages of gaitmsg field by field, and
    unknown ones as bytes.  Estimates are also written to CHANNEL/scene, as foxglove.SceneUpdate.  UserError
    if the log is damaged.
    """
    from gait.lcm.link import events_of, generated

    kinds = {
        kind._get_packed_fingerprint(): kind for kind in vars(generated()).values() if hasattr(kind, "decode")
    }
    counts: dict[str, int] = {}
    with _writing(path) as writer:
        for event in events_of(log):
            at, kind = event.timestamp * 1000, kinds.get(event.data[:8])
            counts[event.channel] = counts.get(event.channel, 0) + 1
            try:
                message = None if kind is None else kind.decode(event.data)
                if message is not None:
                    writer.add(event.channel, *_foxglove(message, at), at, event.eventnum)
            except Exception:  # damaged, or with numbers that JSON cannot represent
                message = None
            if message is None:
                writer.add_bytes(event.channel, event.data, at, event.eventnum)
            elif (update := _scene_of(message, at)) is not None:
                topic = f"{event.channel}/scene"
                counts[topic] = counts.get(topic, 0) + 1
                writer.add(topic, "foxglove.SceneUpdate", update, at, event.eventnum)
    return counts


def _scene_of(message: Any, nanoseconds: int) -> dict[str, Any] | None:
    """Draw an estimate; None for other messages, and where joints are not finite numbers."""
    if type(message).__name__ != "estimate_t" or not message.joints:
        return None
    places = np.array([joint.position for joint in message.joints])
    names = [joint.name for joint in message.joints]
    return scene(names, places, nanoseconds) if np.isfinite(places).all() else None


def _foxglove(message: Any, nanoseconds: int) -> tuple[str, dict[str, Any]]:
    """Return schema and content of a message of gaitmsg, with its own utime as time stamp."""
    name = type(message).__name__
    stamp = {
        "timestamp": _stamp(1000 * message.utime if hasattr(message, "utime") else nanoseconds),
        "frame_id": _FRAME,
    }
    if name == "image_t":
        formats = {
            message.PIXEL_FORMAT_GRAY: "mono8",
            message.PIXEL_FORMAT_RGB: "rgb8",
            message.PIXEL_FORMAT_BGR: "bgr8",
        }
        data = {"data": base64.b64encode(bytes(message.data)).decode()}
        if message.pixelformat == message.PIXEL_FORMAT_MJPEG:
            return "foxglove.CompressedImage", stamp | data | {"format": "jpeg"}
        if message.pixelformat in formats:
            size = {"width": message.width, "height": message.height, "step": message.row_stride}
            return "foxglove.RawImage", stamp | data | size | {"encoding": formats[message.pixelformat]}
    if name == "camera_t":
        k = [message.fx, 0.0, message.cx, 0.0, message.fy, message.cy, 0.0, 0.0, 1.0]
        turn, t = np.array(message.R).reshape(3, 3), np.array(message.t)
        p = np.array(k).reshape(3, 3) @ np.column_stack([turn, t])
        size = {"width": message.width, "height": message.height, "distortion_model": "plumb_bob"}
        lens = {
            "D": list(message.distortion),
            "K": k,
            "R": np.eye(3).ravel().tolist(),
            "P": p.ravel().tolist(),
        }
        return "foxglove.CameraCalibration", stamp | size | lens
    return f"gaitmsg.{name}", _plain(message)
