"""Angles as a source of learning: .csv of the model's joint angles.

    frame,time,l_hip_flexion_deg,l_knee_flexion_deg,...

Columns are named like `ANGLES` of `gait.body.skeleton`, with `_deg`, `_rad` or no suffix; at least flexion of
both hips and knees, the rest is missing.  Angles without suffix are degrees if any of them is beyond
`RADIANS`, else radians.
Columns named like its `ROOTS` (statures, or angles as above) and `stature_m` are used if present.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import ANGLES, ROOTS, SIDES
from gait.errors import UserError
from gait.learn.mocap import csv_table, remarks
from gait.learn.mocap.recording import DEGREES, mask_zero_runs, require_range
from gait.learn.mocap.remarks import NOTHING, Remarks
from gait.learn.rotations import unwrap
from gait.learn.solve import joint_file

Floats = npt.NDArray[np.float64]

SUFFIXES = ("_deg", "_rad", "")
RADIANS = 4.0  # in a walk some joint turns by more degrees than that, and none by more radians
LEGS = [f"{s}_{joint}_flexion" for s in SIDES for joint in ("hip", "knee")]
LEAST_RANGE = 4.0  # degrees: a range of a radian or so under the name of degrees is less
MOST_RANGE = 361.0  # degrees: no leg turns round, and angles that wrap do not leave a turn
LONGEST = 100.0  # statures that the root may be away or move in a cycle
STATURE = 0.5, 2.5  # metres that people are tall
LENGTHS = ("root_forward", "root_sway", "root_height")


@dataclass
class AngleTable:
    """Angles over time without joint positions, T frames.

    Attributes
    ----------
    name : str
        Stem of the file.
    fps : float
        Frames per second.
    angles : (T, 24)
        In the order of `gait.body.skeleton.ANGLES`, radians; NaN where missing.
    root : (T, 6) or None
        In the order of `gait.body.skeleton.ROOTS`, radians and statures; None if the file has no such column.
    stature : float or None
        Metres, if the file says.
    remarks : Remarks
        What else was noticed in the file.
    """

    name: str
    fps: float
    angles: Floats
    root: Floats | None = None
    stature: float | None = None
    remarks: Remarks = NOTHING

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.angles)


def holds_angles(path: Path) -> bool:
    """Whether a .csv has columns of angles, and not the positions of all joints."""
    names = csv_table.header(path)
    joints = joint_file.find([name[:-2] for name in names if name.endswith("_x")])
    return set(joint_file.NEEDED) > set(joints) and bool(_columns(names, ANGLES))


def read(path: Path, fps: float | None = None, zero_runs: bool = False) -> AngleTable:
    """Read a .csv of angles.

    Parameters
    ----------
    fps : float, optional
        Frames per second, by default those of the column `time`.
    zero_runs : bool
        Take runs of three or more exact zeros of a column for missing data.

    Raises
    ------
    UserError
        Naming file, line or column, and remedy.
    """
    table = csv_table.read(path, fps)
    columns = _columns(table.names, ANGLES + ROOTS)
    lacking = next((name for name in LEGS if name not in columns), None)
    if lacking is not None:
        raise UserError(f"{path}:1: no column {lacking}_deg or {lacking}_rad; add it, or leave the file out")
    twice = next((name for name, found in columns.items() if len(found) > 1), None)
    if twice is not None:
        raise UserError(f"{path}:1: {twice} is there as {' and '.join(columns[twice])}; remove one")
    values = _in_radians(table, {name: found[0] for name, found in columns.items()})
    columned, zeros = {name: column[:, None] for name, column in values.items()}, ""
    if zero_runs:
        values = {name: mask_zero_runs(column)[:, 0] for name, column in columned.items()}
    else:
        zeros = remarks.zero_run(columned, remarks.ANGLES)
    for name, column in values.items():
        if name in LENGTHS:
            require_range(path, name, column, LONGEST, "statures")
        else:
            require_range(path, name, np.degrees(column), DEGREES, "degrees")
    _require_plausible(path, columns, values)
    empty = next((name for name in LEGS if not np.isfinite(values[name]).any()), None)
    if empty is not None:
        raise UserError(f"{path}: column {columns[empty][0]} is empty; leave the file out")
    missing = np.full(len(table.values), np.nan)
    angles, root = (np.stack([values.get(n, missing) for n in names], axis=1) for names in (ANGLES, ROOTS))
    stature = table["stature_m"] if "stature_m" in table.names else missing
    if ((stature < STATURE[0]) | (stature > STATURE[1])).any():
        raise UserError(f"{path}: stature_m is not from {STATURE[0]:g} to {STATURE[1]:g}; write metres")
    return AngleTable(
        path.stem,
        table.fps,
        unwrap(angles),
        root if any(name in values for name in ROOTS) else None,
        float(np.nanmedian(stature)) if np.isfinite(stature).any() else None,
        Remarks(zeros=zeros),
    )


def _require_plausible(path: Path, columns: dict[str, list[str]], values: dict[str, Floats]) -> None:
    """Refuse radians in columns of degrees, since no knee that cycles bends so little, and the reverse."""
    ranges = {name: _range(values[name]) for name in LEGS if np.isfinite(values[name]).any()}
    wide = next((name for name, degrees in ranges.items() if degrees > MOST_RANGE), None)
    if wide is not None:
        column = columns[wide][0]
        remedy = f"if it is in degrees, name it {wide}_deg" if column == f"{wide}_rad" else "repair it"
        raise UserError(f"{path}: {column} has a range of {ranges[wide]:.0f} degrees; {remedy}")
    knees = {name: degrees for name, degrees in ranges.items() if "knee" in name}
    if knees and max(knees.values()) < LEAST_RANGE:
        name = max(knees, key=lambda knee: knees[knee])
        raise UserError(
            f"{path}: {columns[name][0]} has a range of {knees[name]:.2g} degrees; if it is in radians, "
            f"name it {name}_rad"
        )


def _range(values: Floats) -> float:
    """Degrees between the least and the largest of values in radians."""
    return float(np.degrees(np.ptp(values[np.isfinite(values)])))


def _columns(names: list[str], wanted: Sequence[str]) -> dict[str, list[str]]:
    """Columns of each quantity that is there."""
    found = {name: [name + suffix for suffix in SUFFIXES if name + suffix in names] for name in wanted}
    return {name: columns for name, columns in found.items() if columns}


def _in_radians(table: csv_table.Table, columns: dict[str, str]) -> dict[str, Floats]:
    """Values by quantity; angles in radians."""
    bare = [table[column] for name, column in columns.items() if column == name and name not in LENGTHS]
    largest = max((float(np.nanmax(np.abs(v))) for v in bare if np.isfinite(v).any()), default=0.0)
    result = {}
    for name, column in columns.items():
        degrees = column.endswith("_deg") or (column == name and largest > RADIANS)
        result[name] = np.radians(table[column]) if degrees and name not in LENGTHS else table[column]
    return result
