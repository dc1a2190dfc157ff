"""OpenSim: a model (.osim) scaled to the person, and its coordinates over time (.mot).

The ground frame is that of .trc files: x_trc = y, y_trc = z (up), z_trc = x.  In bodies x is forward, y up
and z to the right.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from gait.body.skeleton import CHANNELS, JOINTS
from gait.export.angles import FIXED_CHANNELS, Fitted
from gait.export.motion import Motion

Array = NDArray[np.float64]

GROUND = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])  #: world to ground of .trc
BODY_AXES = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  #: axes of the package's frames to axes of bodies

#: Names of coordinates by channel; names for the sides end in _l and _r.
_NAMES = {
    "root_yaw": "pelvis_rotation",
    "root_pitch": "pelvis_tilt",
    "root_roll": "pelvis_list",
    **{
        f"torso_{axis}": f"lumbar_{name}"
        for axis, name in zip("zyx", ("rotation", "flexion", "bending"), strict=True)
    },
    **{
        f"neck_{axis}": f"neck_{name}"
        for axis, name in zip("zyx", ("rotation", "flexion", "bending"), strict=True)
    },
    **{f"{{s}}_shoulder_{a}": f"arm_{a}" for a in ("flexion", "abduction", "rotation")},
    **{f"{{s}}_hip_{a}": f"hip_{a}" for a in ("flexion", "abduction", "rotation")},
    **{f"{{s}}_{joint}_flexion": f"{joint}_flexion" for joint in ("elbow", "knee", "ankle")},
}
_PATH = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
#: Masses of bodies relative to the person's (Winter 2009, table 4.1); the head includes the neck.
_MASSES = {
    **{"pelvis": 0.142, "torso": 0.355, "head": 0.081, "upper_arm": 0.028, "forearm": 0.022},
    **{"thigh": 0.1, "shank": 0.0465, "foot": 0.0145},
}
_MASS = 70.0  # kg; nominal


def coordinate(channel: int) -> str:
    """Return the name of a channel's coordinate."""
    name = CHANNELS[channel]
    if name in _NAMES:
        return _NAMES[name]
    return f"{_NAMES['{s}' + name[1:]]}_{name[0]}"


def coordinates(fitted: Fitted) -> tuple[list[str], Array]:
    """Return the names of all coordinates and their values (T, n), degrees and metres."""
    channels = [channel for rotations in fitted.rotations for _, channel in rotations]
    path = fitted.pelvis @ BODY_AXES.T
    values = np.degrees(fitted.angles[:, channels])
    return [*(coordinate(channel) for channel in channels), *_PATH], np.hstack([values, path])


def write_mot(path: Path, motion: Motion, fitted: Fitted) -> None:
    """Write the coordinates in the frames that the motion has."""
    names, values = coordinates(fitted)
    rows = np.column_stack([motion.time, values])[motion.present]
    head = [
        motion.name,
        "version=1",
        f"nRows={len(rows)}",
        f"nColumns={len(names) + 1}",
        "inDegrees=yes",
        "endheader",
        "\t".join(["time", *names]),
    ]
    body = ["\t".join([f"{row[0]:.6f}", *(f"{value:.6f}" for value in row[1:])]) for row in rows]
    path.write_text("\n".join([*head, *body, ""]), encoding="utf-8")


def write_osim(path: Path, name: str, fitted: Fitted) -> None:
    """Write the model: bodies, joints, and the joints of the motion as markers."""
    path.write_text("\n".join(_model(name, fitted)) + "\n", encoding="utf-8")


def _model(name: str, fitted: Fitted) -> Iterator[str]:
    yield '<?xml version="1.0" encoding="UTF-8" ?>'
    yield f'<OpenSimDocument Version="40000"><Model name={quoteattr(name)}>'
    yield "<credits>Lengths fitted by libgait; masses and inertias are nominal</credits>"
    yield "<length_units>meters</length_units><force_units>N</force_units><gravity>0 -9.80665 0</gravity>"
    yield '<BodySet name="bodyset"><objects>'
    for frame in fitted.frames:
        mass = _MASS * _MASSES[frame.removeprefix("l_").removeprefix("r_")]
        inertia = f"{mass * 0.02:.6g} " * 3
        yield (
            f'<Body name="{frame}"><mass>{mass:.6g}</mass><mass_center>0 0 0</mass_center>'
            f"<inertia>{inertia}0 0 0</inertia></Body>"
        )
    yield '</objects></BodySet><JointSet name="jointset"><objects>'
    for i in range(len(fitted.frames)):
        yield from _joint(fitted, i)
    yield '</objects></JointSet><MarkerSet name="markerset"><objects>'
    for joint, frame, place in zip(JOINTS, fitted.point_frames, fitted.points, strict=True):
        yield (
            f'<Marker name="{joint}"><socket_parent_frame>/bodyset/{fitted.frames[frame]}'
            f"</socket_parent_frame><location>{_three(BODY_AXES @ place)}</location><fixed>false</fixed>"
            "</Marker>"
        )
    yield "</objects></MarkerSet></Model></OpenSimDocument>"


def _joint(fitted: Fitted, i: int) -> Iterator[str]:
    """Write the joint of a frame and its parent; the first frame is free in the ground."""
    frame, parent = fitted.frames[i], fitted.parents[i]
    above = "ground" if parent < 0 else fitted.frames[parent]
    turn = _angles(GROUND @ BODY_AXES.T) if parent < 0 else np.zeros(3)
    rotations = [(BODY_AXES @ (np.sign(a) * np.eye(3)[abs(a) - 1]), c) for a, c in fitted.rotations[i]]
    yield f'<CustomJoint name="{above}_{frame}">'
    yield f"<socket_parent_frame>{above}_offset</socket_parent_frame>"
    yield f"<socket_child_frame>{frame}_offset</socket_child_frame><coordinates>"
    for _, channel in rotations:
        locked = CHANNELS[channel] in FIXED_CHANNELS
        yield _coordinate(coordinate(channel), "rotational", locked)
    if parent < 0:
        yield from (_coordinate(name, "translational", False) for name in _PATH)
    yield "</coordinates><frames>"
    yield _offset(
        f"{above}_offset",
        "/ground" if parent < 0 else f"/bodyset/{above}",
        BODY_AXES @ fitted.origins[i],
        turn,
    )
    yield _offset(f"{frame}_offset", f"/bodyset/{frame}", np.zeros(3), np.zeros(3))
    yield "</frames><SpatialTransform>"
    axes = [axis for axis, _ in rotations]
    for k, axis in enumerate(_completed(axes)):
        name = coordinate(rotations[k][1]) if k < len(rotations) else ""
        yield _axis(f"rotation{k + 1}", axis, name)
    for k, axis in enumerate(np.eye(3)):
        yield _axis(f"translation{k + 1}", axis, _PATH[k] if parent < 0 else "")
    yield "</SpatialTransform></CustomJoint>"


def _coordinate(name: str, kind: str, locked: bool) -> str:
    limits = "-10 10" if kind == "rotational" else "-1000 1000"
    return (
        f'<Coordinate name="{name}"><default_value>0</default_value><range>{limits}</range>'
        f"<clamped>false</clamped><locked>{str(locked).lower()}</locked></Coordinate>"
    )


def _offset(name: str, parent: str, place: Array, turn: Array) -> str:
    return (
        f'<PhysicalOffsetFrame name="{name}"><socket_parent>{parent}</socket_parent>'
        f"<translation>{_three(place)}</translation><orientation>{_three(turn)}</orientation></PhysicalOffsetFrame>"
    )


def _axis(name: str, axis: Array, coordinate: str) -> str:
    """Write one axis of a joint; without a coordinate it is fixed."""
    function = (
        '<LinearFunction name="function"><coefficients>1 0</coefficients></LinearFunction>'
        if coordinate
        else '<Constant name="function"><value>0</value></Constant>'
    )
    return (
        f'<TransformAxis name="{name}"><coordinates>{coordinate}</coordinates><axis>{_three(axis)}</axis>'
        f"{function}</TransformAxis>"
    )


def _completed(axes: list[Array]) -> list[Array]:
    """Complete axes to three independent ones."""
    rest = [axis for axis in np.eye(3) if not any(abs(axis @ other) > 0.5 for other in axes)]
    return [*axes, *rest][:3]


def _angles(turn: Array) -> Array:
    """Decompose a rotation to angles about x, y, z, each about the axes rotated by those before."""
    y = np.arcsin(np.clip(turn[0, 2], -1, 1))
    return np.array([np.arctan2(-turn[1, 2], turn[2, 2]), y, np.arctan2(-turn[0, 1], turn[0, 0])])


def _three(values: Array) -> str:
    return " ".join(f"{value:.9g}" for value in values)
