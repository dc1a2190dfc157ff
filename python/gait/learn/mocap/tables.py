"""Read tables in .csv: joint angles (`read_angles`) and joint positions (`read_joints`) over time.

A table is `frame,time,...`, evenly sampled.  Joint positions are columns <joint>_x, <joint>_y, <joint>_z.
Angles are columns named like `ANGLES` of `gait.body.skeleton` with `_deg`, `_rad` or no suffix (then degrees
if any of them is beyond `RADIANS`); columns named like its `ROOTS` (statures, or angles as above) and
`stature_m` are used if present.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gait.body.skeleton import ANGLES, ROOTS, SIDES
from gait.errors import UserError, quoted, unreadable
from gait.io.fields import table_rows
from gait.learn.arrays import Floats, Indices
from gait.learn.mocap import recording
from gait.learn.mocap.recording import (
    DEGREES,
    FARTHEST_POSITION_M,
    NO_NOTES,
    FileNotes,
    mask_zero_runs,
    require_frames,
    require_range,
    zero_run,
)
from gait.learn.rotations import unwrap

MOST_ROW_GROWTH = 10.0  # missing frames may extend a table to this multiple of its rows
LOST = "lost"  # status of rows without a person in a track
#: End of a column name to the largest plausible magnitude and its unit.
COLUMN_LIMITS = dict.fromkeys(("_x", "_y", "_z"), (FARTHEST_POSITION_M, "metres"))
COLUMN_LIMITS |= {"_deg": (DEGREES, "degrees"), "_rad": (float(np.radians(DEGREES)), "radians")}
USED_COLUMNS = {"time", "stature_m", *ANGLES, *ROOTS}  # other columns of numbers that are used

#: Joints that a file of positions may have, and joints that it must have.
PARTS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "toe")
TABLE_JOINTS = ["neck", "head", *(f"{s}_{part}" for s in SIDES for part in PARTS)]
NEEDED = [f"{s}_{part}" for s in SIDES for part in ("hip", "knee", "ankle")]
#: Other names of joints in files, compared without case, '_' and blanks.
JOINT_ALIASES = {"head": ("headtop",), "l_toe": ("lbigtoe",), "r_toe": ("rbigtoe",)}

ANGLE_SUFFIXES = ("_deg", "_rad", "")
RADIANS = 4.0  # every walk has an angle of more degrees than this, but none of more radians
LEG_ANGLES = [f"{s}_{joint}_flexion" for s in SIDES for joint in ("hip", "knee")]  # required angles
LEAST_RANGE = 4.0  # degrees; a smaller range is probably radians in a column of degrees
MOST_RANGE = 361.0  # degrees; no leg rotates further
FARTHEST_ROOT = 100.0  # statures
MOST_STRIDE_LENGTH = 4.0  # statures; sprinters, whose strides are the longest, cover 2.6
FAST_SHARE = 10.0  # percent of the time in which `root_forward` may exceed it, as by errors of recording
PLAUSIBLE_STATURE_M = 0.5, 2.5  # metres
ROOT_LENGTHS = ("root_forward", "root_sway", "root_height")


@dataclass
class Table:
    """Columns of numbers with T rows."""

    names: list[str]  #: as in the header
    values: Floats  #: (T, n); NaN for empty cells, words, missing frames and rows with status `lost`
    fps: float  #: rows per second
    lines: Indices  #: (T,) lines of the file; 0 for missing frames

    def __getitem__(self, name: str) -> Floats:
        return self.values[:, self.names.index(name)]


@dataclass
class AngleTable:
    """Angles over time without joint positions, T frames."""

    name: str  #: stem of the file
    fps: float  #: frames per second
    angles: Floats  #: (T, 24) in the order of `gait.body.skeleton.ANGLES`, radians; NaN where missing
    root: Floats | None = None  #: (T, 6) in the order of `ROOTS`, radians and statures; None without columns
    stature: float | None = None  #: metres, if the file has it
    notes: FileNotes = NO_NOTES

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.angles)

    def part(self, start: int, stop: int) -> AngleTable:
        """Return frames start to stop."""
        root = None if self.root is None else self.root[start:stop]
        return replace(self, angles=self.angles[start:stop], root=root)

    def reversed(self) -> AngleTable:
        """Return the motion in reversed time."""
        ahead = [-1.0 if name == "root_forward" else 1.0 for name in ROOTS]
        root = None if self.root is None else self.root[::-1] * ahead
        return replace(self, angles=self.angles[::-1], root=root)


def holds_angles(path: Path) -> bool:
    """Whether a .csv has columns of angles rather than positions of the legs' joints."""
    names = [name.strip() for name in _lines(path)[0][1]]
    joints = find_joints([name[:-2] for name in names if name.endswith("_x")])
    return not set(NEEDED) <= set(joints) and bool(_columns(names, ANGLES))


def find_joints(names: list[str]) -> dict[str, str]:
    """Map joints to the names of points that are joints."""
    plain = {name.rsplit(":", 1)[-1].lower().replace("_", "").replace(" ", ""): name for name in names}
    known = {joint: (*JOINT_ALIASES.get(joint, ()), joint.replace("_", "")) for joint in TABLE_JOINTS}
    found = {joint: next((plain[n] for n in aliases if n in plain), None) for joint, aliases in known.items()}
    return {joint: name for joint, name in found.items() if name is not None}


def read_joints(
    path: Path, fps: float | None, zeros_missing: bool
) -> tuple[Table, dict[str, Floats], dict[str, Floats], str]:
    """Read a .csv of joint positions.

    Returns the table, the positions (T, 3) by name as in the file, these positions without runs of exact
    zeros, and a description of such zeros if they are not declared missing ('' if there are none).
    """
    table = read(path, fps)
    names = [name[:-2] for name in table.names if name.endswith("_x")]
    try:
        places = {n: np.stack([table[f"{n}_{axis}"] for axis in "xyz"], axis=1) for n in names}
    except ValueError as error:
        raise UserError(
            f"{path}:1: column {error.args[0].split()[0]} is missing; each joint needs x, y, z"
        ) from None
    zeros = "" if zeros_missing else zero_run(places, recording.ZERO_JOINTS)
    masked = places
    if zeros_missing or zeros:
        masked = {name: mask_zero_runs(place) for name, place in places.items()}
    return table, masked if zeros_missing else places, masked, zeros


def read_angles(path: Path, fps: float | None = None, zeros_missing: bool = False) -> AngleTable:
    """Read a .csv of angles; `fps` defaults to the column `time`.

    With `zeros_missing`, three or more exact zeros of a column in a row are missing data.  UserError names
    file, line or column, and remedy.
    """
    table = read(path, fps)
    columns = _columns(table.names, ANGLES + ROOTS)
    lacking = next((name for name in LEG_ANGLES if name not in columns), None)
    if lacking is not None:
        raise UserError(f"{path}:1: no column {lacking}_deg or {lacking}_rad; add it, or leave out the file")
    twice = next((name for name, found in columns.items() if len(found) > 1), None)
    if twice is not None:
        raise UserError(f"{path}:1: {twice} appears as {' and '.join(columns[twice])}; remove one")
    values = _in_radians(table, {name: found[0] for name, found in columns.items()})
    columned, zeros = {name: column[:, None] for name, column in values.items()}, ""
    if zeros_missing:
        values = {name: mask_zero_runs(column)[:, 0] for name, column in columned.items()}
    else:
        zeros = zero_run(columned, recording.ZERO_ANGLES)
    for name, column in values.items():
        if name in ROOT_LENGTHS:
            require_range(path, name, column, FARTHEST_ROOT, "statures")
        else:
            require_range(path, name, np.degrees(column), DEGREES, "degrees")
    _require_speed(path, values.get("root_forward", np.zeros(1)))
    _require_plausible(path, columns, values)
    empty = next((name for name in LEG_ANGLES if not np.isfinite(values[name]).any()), None)
    if empty is not None:
        raise UserError(f"{path}: column {columns[empty][0]} is empty; leave out the file")
    missing = np.full(len(table.values), np.nan)
    angles, root = (np.stack([values.get(n, missing) for n in names], axis=1) for names in (ANGLES, ROOTS))
    stature = table["stature_m"] if "stature_m" in table.names else missing
    if ((stature < PLAUSIBLE_STATURE_M[0]) | (stature > PLAUSIBLE_STATURE_M[1])).any():
        raise UserError(
            f"{path}: stature_m is not from {PLAUSIBLE_STATURE_M[0]:g} to {PLAUSIBLE_STATURE_M[1]:g}; "
            "write metres"
        )
    return AngleTable(
        path.stem,
        table.fps,
        unwrap(angles),
        root if any(name in values for name in ROOTS) else None,
        float(np.nanmedian(stature)) if np.isfinite(stature).any() else None,
        FileNotes(zeros=zeros),
    )


def _require_speed(path: Path, forward: Floats) -> None:
    """Raise UserError if `root_forward`, in statures per stride, is beyond what people do."""
    speed = np.abs(forward[np.isfinite(forward)])
    if len(speed) and (fast := float(np.percentile(speed, 100 - FAST_SHARE))) > MOST_STRIDE_LENGTH:
        raise UserError(
            f"{path}: root_forward reaches {fast:.1f} statures per stride (at most {MOST_STRIDE_LENGTH:g}) "
            "and looks like a position; give the speed, in statures per stride, or remove the column"
        )


def _require_plausible(path: Path, columns: dict[str, list[str]], values: dict[str, Floats]) -> None:
    """Raise UserError for radians in columns of degrees (walking knees bend more), and the reverse."""
    ranges = {
        name: float(np.degrees(np.ptp(values[name][np.isfinite(values[name])])))
        for name in LEG_ANGLES
        if np.isfinite(values[name]).any()
    }
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


def _columns(names: list[str], wanted: Sequence[str]) -> dict[str, list[str]]:
    """Return the columns of each quantity in the file."""
    found = {name: [name + suffix for suffix in ANGLE_SUFFIXES if name + suffix in names] for name in wanted}
    return {name: columns for name, columns in found.items() if columns}


def _in_radians(table: Table, columns: dict[str, str]) -> dict[str, Floats]:
    """Return values by quantity, angles in radians."""
    unnamed = [
        table[column] for name, column in columns.items() if column == name and name not in ROOT_LENGTHS
    ]
    largest = max((float(np.nanmax(np.abs(v))) for v in unnamed if np.isfinite(v).any()), default=0.0)
    result = {}
    for name, column in columns.items():
        degrees = column.endswith("_deg") or (column == name and largest > RADIANS)
        result[name] = np.radians(table[column]) if degrees and name not in ROOT_LENGTHS else table[column]
    return result


def read(path: Path, fps: float | None = None) -> Table:
    """Read a table; the rate must be given if it has no column `time`.

    Where times jump by whole frames, the frames between are missing.  UserError names file, line and remedy.
    """
    (_, first), *rows = _lines(path)
    names = [name.strip() for name in first]
    if "time" not in names and not fps:
        raise UserError(f"{path}:1: no column 'time'; the header must be frame,time,... (or give --fps)")
    twice = next((name for name in names if name and names.count(name) > 1), None)
    if twice is not None:
        raise UserError(f"{path}:1: column {quoted(twice)} appears twice; remove one")
    values = np.array([_numbers(row, names, path, line) for line, row in rows])
    require_frames(path, len(values))
    lines = [line for line, _ in rows]
    _require_ranges(path, names, values, lines)
    if "status" in names:
        status = [row[names.index("status")].strip() for _, row in rows]
        values[[k for k, word in enumerate(status) if word == LOST]] = np.nan
    if "time" not in names:
        return Table(names, values, float(fps or 0), np.array(lines, np.intp))
    times = np.array([_number(row[names.index("time")], "time", path, line) for line, row in rows])
    place, rate = _places(path, times, lines)
    even = np.full((place[-1] + 1, len(names)), np.nan)
    even[place] = values
    even_lines = np.zeros(len(even), np.intp)
    even_lines[place] = lines
    return Table(names, even, fps or rate, even_lines)


def _require_ranges(path: Path, names: list[str], values: Floats, lines: list[int]) -> None:
    """Raise UserError for implausible angles and positions, which the names of columns distinguish."""
    for name, column in zip(names, values.T, strict=True):
        limit, unit = next(
            (limits for end, limits in COLUMN_LIMITS.items() if name.endswith(end)), (np.inf, "")
        )
        beyond = np.abs(column) > limit
        if beyond.any():
            row = int(np.argmax(beyond))
            raise UserError(
                f"{path}:{lines[row]}: {name} is {column[row]:.4g}; at most {limit:.0f} {unit} are plausible;"
                " correct the value or the units of the file"
            )


def _places(path: Path, times: Floats, lines: list[int]) -> tuple[Indices, float]:
    """Return the frame of each row, and the frame rate."""
    steps = np.diff(times)
    if not (steps > 0).all():  # also if one is NaN
        line = lines[1 + int(np.argmin(np.nan_to_num(steps, nan=-1.0) > 0))]
        raise UserError(f"{path}:{line}: the times do not increase; correct column 'time'")
    frames = np.maximum(1.0, np.round(steps / np.median(steps)))
    if frames.sum() > MOST_ROW_GROWTH * len(times):
        jump = int(np.argmax(frames))
        raise UserError(
            f"{path}:{lines[1 + jump]}: {steps[jump]:.3g} s after the row before; cut the file there"
        )
    place = np.concatenate([[0], np.cumsum(frames)]).astype(np.intp)
    return place, float(place[-1] / (times[-1] - times[0]))


def _lines(path: Path) -> list[tuple[int, list[str]]]:
    """Read the header and the rows that are not blank, each with its line number."""
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise unreadable(path, error) from error
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    try:
        lines = table_rows(text)
    except csv.Error as error:
        raise UserError(f"{path}: not a .csv ({error}); export it again") from None
    if not lines or not any(lines[0][1]):
        raise UserError(f"{path}: the file is empty; export it again")
    return [lines[0], *((line, row) for line, row in lines[1:] if any(row))]


def _numbers(row: list[str], names: list[str], path: Path, line: int) -> Floats:
    if len(row) < len(names) or any(cell.strip() for cell in row[len(names) :]):
        raise UserError(f"{path}:{line}: {len(row)} cells instead of {len(names)}; restore the file")
    return np.array([_number(cell, name, path, line) for cell, name in zip(row, names, strict=False)])


def _number(cell: str, name: str, path: Path, line: int) -> float:
    """Convert a cell; NaN if it is empty or nan, or is a word in a column that is not used."""
    try:
        value = float(cell.strip() or "nan")
    except ValueError:
        value = np.inf
    if not np.isinf(value):
        return value
    if name in USED_COLUMNS or name.endswith(tuple(COLUMN_LIMITS)):
        raise UserError(
            f"{path}:{line}: {name}: {quoted(cell.strip())} is not a number; correct it or empty it"
        )
    return float("nan")
