"""Bodies from joint positions alone: .csv as tracks and truth have it, .trc of joint centres.

Orientations are not in such files: the pelvis is level across the hips, and a limb's hinge is across the bent
limb, or across the body while the limb is straight.  Rotations about a limb's own axis are therefore rough.
A track has the model's angles beside the joints, and they give the orientations.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import ANGLES, JOINTS, SIDES, default_skeleton
from gait.errors import UserError
from gait.learn.mocap import csv_table, remarks
from gait.learn.mocap.recording import Y_UP, mask_zero_runs
from gait.learn.rotations import frame_from, unit
from gait.learn.solve import skeleton_fit, torn_joint
from gait.learn.solve.articulated import HINGES, ORIGINS, SEGMENTS, Pose, posed
from gait.learn.solve.body import Body
from gait.learn.solve.gaps import bridged

Floats = npt.NDArray[np.float64]

PARTS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "toe")
NEEDED = ["neck", "head", *(f"{s}_{part}" for s in SIDES for part in PARTS)]
#: Joint to other names it has in files, compared without case, '_' and blanks.
ALIASES = {"head": ("headtop",), "l_toe": ("lbigtoe",), "r_toe": ("rbigtoe",)}
STRAIGHT = (
    0.25  # sine of the bend at which the bent limb and the body weigh the same in the hinge's direction
)


def read_csv(path: Path, fps: float | None = None, zero_runs: bool = False) -> Body:
    """Read `frame,time,<joint>_x,<joint>_y,<joint>_z,...`: metres, z (or y) up; empty cells are missing.

    With `zero_runs`, three or more exact zeros in a row of an angle, or of a joint's three columns, are too.

    Raises
    ------
    UserError
        Naming file, line and remedy.
    """
    table = csv_table.read(path, fps)
    names = [name[:-2] for name in table.names if name.endswith("_x")]
    try:
        places = {n: np.stack([table[f"{n}_{axis}"] for axis in "xyz"], axis=1) for n in names}
    except ValueError as error:
        raise UserError(
            f"{path}:1: column {error.args[0].split()[0]} is missing; each joint needs x, y, z"
        ) from None
    zeros = "" if zero_runs else remarks.zero_run(places, remarks.JOINTS)
    judged = places  # without zeros that are missing, or that a remark tells of
    if zero_runs or zeros:
        judged = {name: mask_zero_runs(place) for name, place in places.items()}
    torn_joint.refuse(judged, find(names), lambda frame: f"{path}:{table.lines[frame]}")
    if zero_runs:
        places = judged
    walker = replace(body(path, _upright(path, places), table.fps), remarks=remarks.Remarks(zeros=zeros))
    columns = [f"{name}_deg" for name in ANGLES]
    if not set(columns) <= set(table.names):
        return walker
    angles = [mask_zero_runs(table[c][:, None])[:, 0] if zero_runs else table[c] for c in columns]
    return oriented(walker, np.radians(np.stack(angles, axis=1)))


def _upright(path: Path, places: dict[str, Floats]) -> dict[str, Floats]:
    """Turn positions with y up to z up: up is from the ankles to the neck."""
    found = find(list(places))
    ends = [found.get(joint) for joint in ("neck", "l_ankle", "r_ankle")]
    if None in ends:
        return places  # `body` names the joint
    neck, *ankles = (places[name] for name in ends if name is not None)
    rise = neck - sum(ankles) / 2
    if not np.isfinite(rise).all(axis=1).any():
        return places
    up = np.nanmean(rise, axis=0)
    axis = int(np.argmax(np.abs(up)))
    if axis == 0 or up[axis] < 0:
        raise UserError(f"{path}: {'-' * bool(up[axis] < 0)}{'xyz'[axis]} is up; z must be, rotate the data")
    return {name: place @ Y_UP.T for name, place in places.items()} if axis == 1 else places


def oriented(walker: Body, angles: Floats) -> Body:
    """Body with the orientations that angles (T, 24) of the default skeleton, radians, give to its joints."""
    skeleton, joints = default_skeleton(), {**walker.joints, "head_top": walker.joints["head"]}
    used = [k for k, name in enumerate(JOINTS) if name in joints]
    points = skeleton_fit.Points(
        skeleton.point_frames[used].astype(np.intp), skeleton.point_positions[used], np.zeros(len(used))
    )
    observed = np.stack([joints[JOINTS[k]] for k in used], axis=1)
    pose = Pose(joints["pelvis"], skeleton_fit.turned(angles, points, observed), angles)
    turns = posed(pose, ORIGINS).turns
    lateral = {hinge: turns[:, SEGMENTS.index(part), :, 1] for hinge, part in HINGES.items()}
    return replace(walker, pelvis=pose.turn, lateral=lateral)


def body(path: Path, places: dict[str, Floats], fps: float) -> Body:
    """Body of named joint positions (T, 3), z up, metres, short gaps bridged.

    Raises
    ------
    UserError
        If a joint is missing, or one of the legs never seen.
    """
    columns = find(list(places))
    lacking = next((joint for joint in NEEDED if joint not in columns), None)
    if lacking is not None:
        raise UserError(f"{path}: no joint {lacking!r}; name one of its columns so, or leave the file out")
    joints = {joint: bridged(places[columns[joint]], fps) for joint in NEEDED}
    legs = [joint for joint in NEEDED if joint.split("_")[-1] in ("hip", "knee", "ankle")]
    empty = next((joint for joint in legs if not np.isfinite(joints[joint]).any()), None)
    if empty is not None:
        raise UserError(f"{path}: no values for joint {empty!r}; leave the file out")
    hips, shoulders = (joints[f"l_{part}"] - joints[f"r_{part}"] for part in ("hip", "shoulder"))
    joints["pelvis"] = (joints["l_hip"] + joints["r_hip"]) / 2
    lateral = {"head": unit(shoulders)}
    for s in SIDES:
        knee = _hinge(joints, s, ("hip", "knee", "ankle"))
        elbow = _hinge(joints, s, ("shoulder", "elbow", "wrist"))
        lateral[f"{s}_knee"] = unit(knee + STRAIGHT * unit(hips))
        lateral[f"{s}_elbow"] = unit(-elbow + STRAIGHT * unit(shoulders))
    up = np.broadcast_to([0.0, 0, 1], hips.shape)
    return Body(path.stem, fps, joints, frame_from(up, hips, exact="y"), lateral)


def find(names: list[str]) -> dict[str, str]:
    """Joints that names stand for: joint to name."""
    plain = {name.rsplit(":", 1)[-1].lower().replace("_", "").replace(" ", ""): name for name in names}
    known = {joint: (*ALIASES.get(joint, ()), joint.replace("_", "")) for joint in NEEDED}
    found = {joint: next((plain[n] for n in aliases if n in plain), None) for joint, aliases in known.items()}
    return {joint: name for joint, name in found.items() if name is not None}


def _hinge(joints: dict[str, Floats], s: str, chain: tuple[str, str, str]) -> Floats:
    """Return the normal of a limb's plane (T, 3), as long as the sine of its bend."""
    a, b, c = (joints[f"{s}_{part}"] for part in chain)
    return np.cross(unit(b - a), unit(c - b))
