"""Bodies from joint positions: .csv like tracks and truth files, .trc of joint centres.

Such files have no orientations.  The pelvis is assumed level along the hips, and the hinge of a limb
perpendicular to the bent limb, or, while it is straight, along the body's lateral axis.  Rotations about a
limb's own axis are therefore rough.  A track also has the model's angles, which give the orientations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from gait.body.skeleton import ANGLES, SIDES, default_skeleton
from gait.body.skeleton import JOINTS as POINTS
from gait.errors import UserError
from gait.learn.arrays import Floats
from gait.learn.mocap.recording import Y_UP, FileNotes, mask_zero_runs
from gait.learn.mocap.tables import NEEDED, TABLE_JOINTS, find_joints, read_joints
from gait.learn.rotations import unit
from gait.learn.solve import skeleton_fit
from gait.learn.solve.body import Body, level_pelvis
from gait.learn.solve.kinematics import HINGES, ORIGINS, SEGMENTS, Pose, pose_skeleton

#: Sine of the bend at which limb and body have equal weights for the direction of the hinge.
STRAIGHT_BEND_SINE = 0.25
#: Seconds from the middle of a gap within which there must be a sample on both sides for the gap to be
#: bridged, as for observed samples of a cycle (`gait.learn.cycles.cutting`), at a stride of 1.1 s.
BRIDGE_REACH_S = 0.75 / 16 * 1.1
NEXT = 1 + 1e-9  # least reach in frames
FEWEST_BRIDGE_SAMPLES = 4  # fewest samples for a bridging curve
LIMB = ("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"), ("ankle", "toe")
#: Pairs of joints whose distance hardly changes.
RIGID_PAIRS = (
    *(("neck", "head"), ("neck", "l_shoulder"), ("neck", "r_shoulder"), ("l_hip", "r_hip")),
    *((f"{s}_{upper}", f"{s}_{lower}") for s in SIDES for upper, lower in LIMB),
)
#: Longest bone, over its median; unsmoothed joints triangulated from videos reach 1.4.
LONGEST_BONE_RATIO = 2.0


def from_table(path: Path, fps: float | None = None, zeros_missing: bool = False) -> Body:
    """Read the body of a .csv of joint positions: metres, z (or y) up; empty cells are missing.

    With `zeros_missing`, three or more exact zeros in a row of an angle, or of a joint's three columns, are
    missing data.  UserError names file, line and remedy.
    """
    table, places, masked, zeros = read_joints(path, fps, zeros_missing)
    require_whole(masked, lambda frame: f"{path}:{table.lines[frame]}")
    body = from_joints(path, _z_up(path, places), table.fps)
    body = replace(body, notes=replace(body.notes, zeros=zeros))
    columns = [f"{name}_deg" for name in ANGLES]
    if not set(columns) <= set(table.names):
        return body
    angles = [mask_zero_runs(table[c][:, None])[:, 0] if zeros_missing else table[c] for c in columns]
    return _oriented(body, np.radians(np.stack(angles, axis=1)))


def from_joints(path: Path, places: dict[str, Floats], fps: float) -> Body:
    """Return the body of named joint positions (T, 3), z up, metres, with short gaps bridged.

    UserError if a joint of the legs is missing or never visible; others that are missing are NaN.
    """
    columns = find_joints(list(places))
    lacking = tuple(joint for joint in TABLE_JOINTS if joint not in columns)
    needed = next((joint for joint in NEEDED if joint in lacking), None)
    if needed is not None:
        raise UserError(
            f"{path}: no joint {needed!r}; give one of its columns this name, or leave out the file"
        )
    frames = len(next(iter(places.values())))
    joints = {joint: bridged(places[columns[joint]], fps) for joint in columns}
    joints |= {joint: np.full((frames, 3), np.nan) for joint in lacking}
    empty = next((joint for joint in NEEDED if not np.isfinite(joints[joint]).any()), None)
    if empty is not None:
        raise UserError(f"{path}: no values for joint {empty!r}; leave out the file")
    hips, shoulders = (joints[f"l_{part}"] - joints[f"r_{part}"] for part in ("hip", "shoulder"))
    joints["pelvis"] = (joints["l_hip"] + joints["r_hip"]) / 2
    lateral = {"head": unit(shoulders)}
    for s in SIDES:
        knee = _hinge(joints, s, ("hip", "knee", "ankle"))
        elbow = _hinge(joints, s, ("shoulder", "elbow", "wrist"))
        lateral[f"{s}_knee"] = unit(knee + STRAIGHT_BEND_SINE * unit(hips))
        lateral[f"{s}_elbow"] = unit(-elbow + STRAIGHT_BEND_SINE * unit(shoulders))
    notes = FileNotes(lacking=lacking)
    return Body(path.stem, fps, joints, level_pelvis(hips), lateral, notes=notes)


def _hinge(joints: dict[str, Floats], s: str, chain: tuple[str, str, str]) -> Floats:
    """Return the normal of a limb's plane (T, 3), as long as the sine of its bend."""
    a, b, c = (joints[f"{s}_{part}"] for part in chain)
    return np.cross(unit(b - a), unit(c - b))


def _z_up(path: Path, places: dict[str, Floats]) -> dict[str, Floats]:
    """Rotate positions with y up to z up; up is from the ankles to the neck or, without one, to the hips."""
    found = find_joints(list(places))
    tops = ("neck",) if "neck" in found else ("l_hip", "r_hip")
    if not {*tops, "l_ankle", "r_ankle"} <= set(found):
        return places  # `from_joints` names the joint
    top, ankles = (
        np.mean([places[found[joint]] for joint in joints], axis=0)
        for joints in (tops, ("l_ankle", "r_ankle"))
    )
    rise = top - ankles
    if not np.isfinite(rise).all(axis=1).any():
        return places
    up = np.nanmean(rise, axis=0)
    axis = int(np.argmax(np.abs(up)))
    if axis == 0 or up[axis] < 0:
        raise UserError(f"{path}: {'-' * bool(up[axis] < 0)}{'xyz'[axis]} is up; z must be, rotate the data")
    return {name: place @ Y_UP.T for name, place in places.items()} if axis == 1 else places


def _oriented(body: Body, angles: Floats) -> Body:
    """Add the orientations that angles (T, 24) of the default skeleton, radians, give to the joints."""
    skeleton, joints = default_skeleton(), {**body.joints, "head_top": body.joints["head"]}
    used = [k for k, name in enumerate(POINTS) if name in joints]
    points = skeleton_fit.Points(
        skeleton.point_frames[used].astype(np.intp), skeleton.point_positions[used], np.zeros(len(used))
    )
    observed = np.stack([joints[POINTS[k]] for k in used], axis=1)
    pose = Pose(joints["pelvis"], skeleton_fit.pelvis_rotations(angles, points, observed), angles)
    rotations = pose_skeleton(pose, ORIGINS).rotations
    lateral = {hinge: rotations[:, SEGMENTS.index(part), :, 1] for hinge, part in HINGES.items()}
    return replace(body, pelvis=pose.rotation, lateral=lateral)


def bridged(places: Floats, fps: float) -> Floats:
    """Fill short gaps in the coordinates (T, 3) of a joint, before angles are computed from several joints.

    Gaps are filled if there are samples within `BRIDGE_REACH_S` on both sides, 0.05 s or the next frame.
    Rows in which a coordinate is still missing are NaN.
    """
    reach = max(BRIDGE_REACH_S * fps, NEXT)
    result, frames = places.copy(), np.arange(len(places))
    for column in result.T:
        visible = np.flatnonzero(np.isfinite(column))
        if not FEWEST_BRIDGE_SAMPLES <= len(visible) < len(column):
            continue
        after = np.searchsorted(visible, frames)
        left, right = visible[np.maximum(after - 1, 0)], visible[np.minimum(after, len(visible) - 1)]
        near = (left < frames) & (frames < right) & (right - left <= 2 * reach)
        column[near] = Akima1DInterpolator(visible, column[visible])(frames[near])
    return np.where(np.isfinite(result).all(axis=1, keepdims=True), result, np.nan)


def require_whole(places: Mapping[str, Floats], where: Callable[[int], str]) -> None:
    """Raise UserError for positions (T, 3), by name, in which a bone is far longer than usual; NaN: missing.

    The error names the misplaced joint in the first such frame.  `where`: describes a frame of the file,
    counted from 0, for the error.
    """
    names = find_joints(list(places))
    joints = {joint: places[name] for joint, name in names.items()}
    bones = [bone for bone in RIGID_PAIRS if set(bone) <= set(joints)]
    ratios = np.array([_relative(_distance(joints, *bone)) for bone in bones], ndmin=2)
    torn = (ratios > LONGEST_BONE_RATIO).any(axis=0)
    if not torn.any():
        return
    frame = int(np.argmax(torn))
    bone = bones[int(np.nanargmax(ratios[:, frame]))]
    off, other = sorted(bone, key=lambda joint: -_misplaced(joints, joint, frame))
    lengths = _distance(joints, off, other)
    more = f" ({torn.sum()} such frames)" if torn.sum() > 1 else ""
    raise UserError(
        f"{where(frame)}: {names[off]} is {lengths[frame]:.3g} m from {names[other]}, "
        f"usually {np.nanmedian(lengths):.3g} m; correct its position or empty it{more}"
    )


def _distance(joints: Mapping[str, Floats], a: str, b: str) -> Floats:
    return np.linalg.norm(joints[a] - joints[b], axis=1)


def _relative(lengths: Floats) -> Floats:
    """Divide lengths (T,) by their median; NaN if there is none, or if the joints mostly coincide."""
    visible = lengths[np.isfinite(lengths)]
    usual = float(np.median(visible)) if len(visible) else 0.0
    return lengths / usual if usual > 0 else np.full(len(lengths), np.nan)


def _misplaced(joints: Mapping[str, Floats], joint: str, frame: int) -> float:
    """Return the median change of a joint's distances to the others from their medians."""
    to_others = [_distance(joints, joint, other) for other in joints if other != joint]
    return float(np.median([abs(d[frame] - np.nanmedian(d)) for d in to_others if np.isfinite(d[frame])]))
