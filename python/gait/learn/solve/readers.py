"""Read bodies from files: one reader per file format."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from gait.body.skeleton import SIDES
from gait.errors import UserError
from gait.learn.arrays import Floats
from gait.learn.mocap import acclaim, bvh, points, tables
from gait.learn.mocap.markers import plain
from gait.learn.mocap.recording import Y_UP, FileNotes
from gait.learn.mocap.tables import AngleTable
from gait.learn.options import DEFAULT, LearnOptions
from gait.learn.rotations import unit
from gait.learn.solve import anatomy, joints, markers
from gait.learn.solve.body import MIRRORED, Body, from_bones
from gait.learn.solve.retarget import mean, median, overground
from gait.learn.solve.skeleton_fit import LengthInformation

READERS = {".amc": acclaim.read, ".bvh": bvh.read}
LEG_LENGTH_M = 0.25, 1.5  #: metres from hip to knee to ankle: from small children to above the tallest adults
TOES, KNEES = 0.3, 0.05  #: cosine of toes, and sine of knees, from which they point backwards beyond noise
#: Suffixes of the files that can be read.
SUFFIXES = (*READERS, *points.SUFFIXES, ".csv")


def read(path: Path, options: LearnOptions = DEFAULT, log_scales: Floats | None = None) -> Body | AngleTable:
    """Read a motion file, chosen by suffix; a .csv may contain only angles.

    `log_scales` (S,): length scales of the person, for files of markers (`solve.markers`).  UserError names
    file, place and remedy if the file is malformed or lacks a joint.
    """
    suffix = path.suffix.lower()
    if suffix == ".csv" and tables.holds_angles(path):
        return tables.read_angles(path, options.fps, options.zeros_missing)
    if suffix in READERS:
        recording = READERS[suffix](path, options.fps, options.zeros_missing)
        body = from_bones(recording)
        if options.joints == "anatomical" and anatomy.is_acclaim(recording):
            body = anatomy.anatomical(body)
    elif suffix == ".csv":
        body = joints.from_table(path, options.fps, options.zeros_missing)
    else:
        body = _from_points(path, options, log_scales)
    _require_size(path, body)
    _require_anatomy(path, body)
    return overground(body)


def length_information(path: Path, options: LearnOptions = DEFAULT) -> LengthInformation | None:
    """Return what a .c3d or .trc shows of the person's length scales; None if it has no markers of a body.

    UserError if the file is malformed, or its markers are unknown.
    """
    labels, places, _ = points.read(path, options.fps)
    if _are_joints(labels, options):
        return None
    return markers.length_information(path, labels, places, options.markers)


def _from_points(path: Path, options: LearnOptions, log_scales: Floats | None) -> Body:
    """Read labelled points: centres of all joints (y up, as from `gait track --trc`), or markers."""
    labels, places, fps = points.read(path, options.fps)
    if _are_joints(labels, options):
        upright = places @ Y_UP.T
        by_name = {name: upright[:, k] for k, name in enumerate(labels)}
        joints.require_whole(by_name, lambda frame: f"{path}: frame {frame + 1}")
        return joints.from_joints(path, by_name, fps)
    body = markers.from_markers(path, labels, places, fps, options.markers, log_scales)
    return replace(body, notes=FileNotes(frozenset(map(plain, labels) if options.markers else ())))


def _are_joints(labels: list[str], options: LearnOptions) -> bool:
    """Whether points are centres of joints."""
    return options.markers is None and set(tables.TABLE_JOINTS) <= set(tables.find_joints(labels))


def _require_size(path: Path, body: Body) -> None:
    """Raise UserError for legs of impossible length, as with positions in other units than metres."""
    hip, knee, ankle = (
        np.stack([body.joints[f"{s}_{joint}"] for s in SIDES]) for joint in ("hip", "knee", "ankle")
    )
    legs = np.linalg.norm(hip - knee, axis=2) + np.linalg.norm(knee - ankle, axis=2)
    if not np.isfinite(legs).any():  # later checks deal with invisible joints
        return
    leg, (least, most) = float(np.nanmedian(legs)), LEG_LENGTH_M
    if not least <= leg <= most:
        raise UserError(
            f"{path}: legs of {leg:.3g} m; {least:g} to {most:g} m are plausible; correct the file's units"
        )


def _require_anatomy(path: Path, body: Body) -> None:
    """Raise UserError for a mirrored or upside-down body: toes must point forward and knees bend back."""
    ahead, left = body.pelvis[:, :, 0], body.pelvis[:, :, 1]
    toes, knees, legs = list[Floats](), list[Floats](), list[Floats]()
    for s in SIDES:
        hip, knee, ankle, toe = (body.joints[f"{s}_{joint}"] for joint in ("hip", "knee", "ankle", "toe"))
        toes.append(np.einsum("ti,ti->t", unit(toe - ankle), ahead))
        knees.append(np.einsum("ti,ti->t", np.cross(unit(knee - hip), unit(ankle - knee)), left))
        legs.append((hip - ankle)[:, 2])
    backwards = median(np.array(toes)) < -TOES or (
        not np.isfinite(toes).any() and mean(np.array(knees)) < -KNEES
    )
    if backwards:
        raise UserError(f"{path}: {MIRRORED}")
    if median(np.array(legs)) < -LEG_LENGTH_M[0]:
        raise UserError(
            f"{path}: the body is upside down: z, or y of .bvh and .trc, must point up; rotate the data"
        )
