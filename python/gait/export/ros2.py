"""MCAP with messages of ROS 2 in CDR: estimates as TF and as bodies of REP 155 (ROS4HRI), without ROS.

The person with number N is the body ``N``.  TF frames: ``body_N`` in ``world``, midway between the hips, x in
the direction of walking, z up; joints in ``body_N`` with its axes, such as ``l_knee_N``; cameras.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.errors import UserError
from gait.export.motion import Motion
from gait.io.track_file import PERSON_COLUMN

Array = NDArray[np.float64]

WORLD = "world"
_IN_VIEW = ("tracking", "ambiguous")
_GONE = 10**9  # nanoseconds without an estimate after which a person is no longer listed
_STILL = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
_TF, _POSE = "tf2_msgs/msg/TFMessage", "geometry_msgs/msg/PoseWithCovarianceStamped"
_ESTIMATES = re.compile(r"GAIT_ESTIMATE(?:_(\d+))?")
_CAMERA = re.compile(r"GAIT_CAMERA_(\d+)")

_HEADER = {"std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id"}
_HEADER |= {"builtin_interfaces/Time": "int32 sec\nuint32 nanosec"}
_VECTOR = "float64 x\nfloat64 y\nfloat64 z"
_QUATERNION = f"{_VECTOR}\nfloat64 w"
_POINT = "hri_msgs/NormalizedPointOfInterest2D"
#: Types of messages: their fields, and the types of these.
TYPES: dict[str, tuple[str, dict[str, str]]] = {
    _TF: (
        "geometry_msgs/TransformStamped[] transforms",
        {
            "geometry_msgs/TransformStamped": (
                "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform"
            ),
            "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
            "geometry_msgs/Vector3": _VECTOR,
            "geometry_msgs/Quaternion": _QUATERNION,
        }
        | _HEADER,
    ),
    "hri_msgs/msg/IdsList": ("std_msgs/Header header\nstring[] ids", _HEADER),
    "hri_msgs/msg/Skeleton2D": (
        f"std_msgs/Header header\n{_POINT}[] skeleton",
        {_POINT: "float32 x\nfloat32 y\nfloat32 c"} | _HEADER,
    ),
    _POSE: (
        "std_msgs/Header header\ngeometry_msgs/PoseWithCovariance pose",
        {
            "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance",
            "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
            "geometry_msgs/Point": _VECTOR,
            "geometry_msgs/Quaternion": _QUATERNION,
        }
        | _HEADER,
    ),
    "std_msgs/msg/String": ("string data", {}),
}
#: Points of hri_msgs/Skeleton2D in order; None: unknown to the tracker.
SKELETON_2D = (
    *(None, "neck"),
    *(f"{side}_{joint}" for side in "rl" for joint in ("shoulder", "elbow", "wrist")),
    *(f"{side}_{joint}" for side in "rl" for joint in ("hip", "knee", "ankle")),
    *(None,) * 4,
)


class Message(NamedTuple):
    """A message of ROS 2, with its fields as mappings and sequences."""

    topic: str
    type: str
    fields: dict[str, Any]


class Bodies:
    """Makes messages of ROS 2 from the estimates of one or several people, in order of time."""

    def __init__(self) -> None:
        self._visible: dict[int, int] = {}  # person to time of the last estimate, nanoseconds
        self._camera: tuple[int, Camera] | None = None

    def camera(self, stream: int, camera: Camera, nanoseconds: int) -> list[Message]:
        """Make the message with a camera's pose; skeletons are given in the first camera's picture."""
        from scipy.spatial.transform import Rotation

        if self._camera is None or self._camera[0] == stream:
            self._camera = stream, camera
        turn = dict(zip("xyzw", Rotation.from_matrix(camera.R.T).as_quat().tolist(), strict=True))
        place = _transform(_header(nanoseconds, WORLD), f"camera_{stream}", camera.centre, turn)
        return [Message("/tf", _TF, {"transforms": [place]})]

    def estimate(
        self,
        person: int,
        status: str,
        nanoseconds: int,
        joints: Mapping[str, Array],
        heading: float,
        sd: tuple[Array, float] | None = None,
    ) -> list[Message]:
        """Make the messages for one estimate.

        Parameters
        ----------
        person : int
            Number of the person, from 1.
        status : str
            ``init``, ``tracking``, ``ambiguous`` or ``lost``; the body exists while the person is visible.
        nanoseconds : int
            Time of the frame since the Unix epoch.
        joints : mapping of str to ndarray of shape (3,)
            Metres, world with z up.
        heading : float
            Direction of walking about z, radians; NaN: from the hips.
        sd : (ndarray of shape (3,), float), optional
            Standard deviations of the pelvis [m] and the heading [rad].
        """
        self._visible = {
            k: at for k, at in self._visible.items() if k != person and abs(nanoseconds - at) < _GONE
        }
        if visible := status in _IN_VIEW and bool(joints):
            self._visible[person] = nanoseconds
        header = _header(nanoseconds, WORLD)
        ids = {"header": header, "ids": [str(k) for k in sorted(self._visible)]}
        found = [
            Message(f"/gait/{person}/status", "std_msgs/msg/String", {"data": status}),
            Message("/humans/bodies/tracked", "hri_msgs/msg/IdsList", ids),
        ]
        if not visible:
            return found
        across = joints["l_hip"] - joints["r_hip"]
        turn = heading if np.isfinite(heading) else float(np.arctan2(-across[0], across[1]))
        middle = 0.5 * (joints["l_hip"] + joints["r_hip"])
        rotation = {"x": 0.0, "y": 0.0, "z": float(np.sin(turn / 2)), "w": float(np.cos(turn / 2))}
        ahead, left = (np.cos(turn), np.sin(turn), 0.0), (-np.sin(turn), np.cos(turn), 0.0)
        axes, own = np.array([ahead, left, (0.0, 0.0, 1.0)]), header | {"frame_id": f"body_{person}"}
        transforms = [_transform(header, f"body_{person}", middle, rotation)]
        transforms += [
            _transform(own, f"{name}_{person}", axes @ (at - middle), _STILL) for name, at in joints.items()
        ]
        found.append(Message("/tf", _TF, {"transforms": transforms}))
        if sd is not None:
            variance = np.zeros((6, 6))
            variance[range(3), range(3)], variance[5, 5] = np.square(sd[0]), sd[1] ** 2
            pose = {"position": _xyz(joints["pelvis"]), "orientation": rotation}
            spread = {"pose": pose, "covariance": variance.ravel().tolist()}
            found.append(Message(f"/gait/{person}/pose", _POSE, {"header": header, "pose": spread}))
        if self._camera is not None:
            stream, camera = self._camera
            own, points = _header(nanoseconds, f"camera_{stream}"), _skeleton(joints, camera)
            topic = f"/humans/bodies/{person}/skeleton2d"
            found.append(Message(topic, "hri_msgs/msg/Skeleton2D", {"header": own, "skeleton": points}))
        return found


def _header(nanoseconds: int, frame: str) -> dict[str, Any]:
    return {"stamp": {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}, "frame_id": frame}


def _xyz(at: Array) -> dict[str, float]:
    return dict(zip("xyz", map(float, at), strict=True))


def _transform(header: dict[str, Any], child: str, at: Array, rotation: dict[str, float]) -> dict[str, Any]:
    return {
        "header": header,
        "child_frame_id": child,
        "transform": {"translation": _xyz(at), "rotation": rotation},
    }


def _skeleton(joints: Mapping[str, Array], camera: Camera) -> list[dict[str, float]]:
    """Compute points as fractions of the picture; those outside it or unknown have confidence 0."""
    size = np.array(camera.size) - 1.0
    points = []
    for name in SKELETON_2D:
        share = camera.project(joints[name]) / size if name and name in joints else np.full(2, np.nan)
        inside = bool(np.isfinite(share).all() and (share >= 0).all() and (share <= 1).all())
        x, y = share.tolist() if inside else (0.0, 0.0)
        points.append({"x": x, "y": y, "c": float(inside)})
    return points


class _Writer:
    def __init__(self, writer: Any) -> None:
        self._writer = writer
        self._schemas: dict[str, Any] = {}
        self.counts: dict[str, int] = {}

    def write(self, messages: Sequence[Message], nanoseconds: int) -> None:
        for topic, kind, fields in messages:
            if kind not in self._schemas:
                self._schemas[kind] = self._writer.register_msgdef(kind, definition(kind))
            count = self.counts[topic] = self.counts.get(topic, 0) + 1
            self._writer.write_message(
                topic, self._schemas[kind], fields, nanoseconds, nanoseconds, count - 1
            )


def definition(kind: str) -> str:
    """Return the definition of a type with those of its fields' types, in the form of ``ros2msg``."""
    fields, needed = TYPES[kind]
    return f"\n{'=' * 80}\n".join([fields, *(f"MSG: {name}\n{text}" for name, text in needed.items())])


@contextmanager
def _writing(path: Path) -> Iterator[_Writer]:
    from mcap_ros2.writer import Writer

    with path.open("wb") as stream:
        writer: Any = Writer(stream)
        yield _Writer(writer)
        writer.finish()


def write_motion(path: Path, motion: Motion) -> dict[str, int]:
    """Write a motion's frames; return the number of messages by topic."""
    track = motion.track
    number = track.numbers.get(PERSON_COLUMN)
    bodies, heading = Bodies(), track.numbers.get("heading_rad")
    with _writing(path) as writer:
        for row, k in enumerate(np.flatnonzero(motion.present).tolist()):
            at = round(float(track.time[row]) * 1e9)
            joints = dict(zip(motion.names, motion.places[k], strict=True))
            person = 1 if number is None else int(number[row])
            turn = float("nan") if heading is None else float(heading[row])
            writer.write(bodies.estimate(person, track.status[row], at, joints, turn), at)
    return writer.counts


def write_log(path: Path, log: str | os.PathLike[str]) -> dict[str, int]:
    """Write the estimates of an LCM log at the times of their frames; return message counts by topic.

    UserError if the log is damaged or has no estimates.
    """
    from gait.lcm.link import events_of, gaitmsg
    from gait.lcm.messages import camera_of, decode, estimate_of

    bodies = Bodies()
    with _writing(path) as writer:
        for event in events_of(log):
            if named := _CAMERA.fullmatch(event.channel):
                message = decode(gaitmsg.camera_t, event.data, event.channel)
                at = 1000 * message.utime
                writer.write(bodies.camera(int(named[1]), camera_of(message), at), at)
            elif named := _ESTIMATES.fullmatch(event.channel):
                message = decode(gaitmsg.estimate_t, event.data, event.channel)
                at, estimate = 1000 * message.utime, estimate_of(message)
                joints = dict(zip(estimate.joint_names, estimate.joints, strict=True))
                sd = estimate.sd.pelvis, estimate.sd.heading
                status, heading = estimate.status.name.lower(), estimate.mean.heading
                writer.write(bodies.estimate(int(named[1] or 1), status, at, joints, heading, sd), at)
    if "/humans/bodies/tracked" not in writer.counts:
        raise UserError(f"{log}: has no messages on GAIT_ESTIMATE; log them with gait record --log")
    return writer.counts
