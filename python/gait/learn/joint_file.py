"""Bodies from files of joint positions alone: .csv as tracks and truth have it, .trc of joint centres.

Orientations are not in such files: the pelvis is level across the hips, and a limb's hinge is across the bent
limb, or across the body while the limb is straight.  Rotations about a limb's own axis are therefore rough.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gait.errors import UserError
from gait.learn.body import Body
from gait.learn.recording import Y_UP
from gait.learn.rotations import frame_from, unit
from gait.skeleton import SIDES

Floats = npt.NDArray[np.float64]

PARTS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "toe")
NEEDED = ["neck", "head", *(f"{s}_{part}" for s in SIDES for part in PARTS)]
#: Joint to other names it has in files, compared without case, '_' and blanks.
ALIASES = {"head": ("headtop",), "l_toe": ("lbigtoe",), "r_toe": ("rbigtoe",)}
STRAIGHT = (
    0.25  # sine of the bend at which the bent limb and the body weigh the same in the hinge's direction
)
UNITS = {"m": 1.0, "mm": 0.001, "cm": 0.01}


def read_csv(path: Path, fps: float | None = None, zero_runs: bool = False) -> Body:
    """Read `frame,time,<joint>_x,<joint>_y,<joint>_z,...`: metres, z up; empty cells are missing.

    `zero_runs` is of no use here and ignored.

    Raises
    ------
    UserError
        Naming file, line and remedy.
    """
    lines = _lines(path)
    header = [name.strip() for name in lines[0]]
    if "time" not in header:
        raise UserError(f"{path}:1: no column 'time'; the header must be frame,time,<joint>_x,...")
    table = np.array([_numbers(row, len(header), path, i) for i, row in enumerate(lines[1:], 2) if row])
    if len(table) < 3:
        raise UserError(f"{path}: {len(table)} frames; a recording of a few seconds is needed")
    names = [name[:-2] for name in header if name.endswith("_x")]
    try:
        places = {n: table[:, [header.index(f"{n}_{axis}") for axis in "xyz"]] for n in names}
    except ValueError as error:
        raise UserError(
            f"{path}:1: column {error.args[0].split()[0]} is missing; each joint needs x, y, z"
        ) from None
    step = float(np.median(np.diff(table[:, header.index("time")])))
    if not step > 0:
        raise UserError(f"{path}: the times do not increase; correct column 'time'")
    return body(path, places, fps or 1 / step)


def read_trc(path: Path, fps: float | None = None, zero_runs: bool = False) -> Body:
    """Read a .trc of joint centres: y up, x or z ahead; see `read_csv`."""
    lines = _lines(path, "\t")
    try:
        keys, values = ([cell.strip() for cell in line if cell.strip()] for line in lines[1:3])
        head = dict(zip(keys, values, strict=False))
        rate, unit_name, count = float(head["DataRate"]), head["Units"], int(head["NumMarkers"])
        scale = UNITS[unit_name]
        names = [name for name in lines[3][2:] if name.strip()]
        if len(names) != count:
            raise ValueError
    except (IndexError, KeyError, ValueError):
        raise UserError(f"{path}: not a .trc header of five lines; export the file again") from None
    width = 2 + 3 * count
    rows = [
        _numbers(row[:width], width, path, i)
        for i, row in enumerate(lines[5:], 6)
        if any(map(str.strip, row))
    ]
    if len(rows) < 3:
        raise UserError(f"{path}: {len(rows)} frames; a recording of a few seconds is needed")
    points = np.array(rows)[:, 2:].reshape(len(rows), count, 3) @ Y_UP.T * scale
    return body(path, {name: points[:, k] for k, name in enumerate(names)}, fps or rate)


def _lines(path: Path, delimiter: str = ",") -> list[list[str]]:
    try:
        with path.open(newline="", encoding="latin-1") as file:
            lines = list(csv.reader(file, delimiter=delimiter))
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}; check the name") from error
    if not lines:
        raise UserError(f"{path}: the file is empty; export it again")
    return lines


def _numbers(row: list[str], width: int, path: Path, line: int) -> Floats:
    """Cells as numbers; empty ones, and words in columns of words, are NaN."""
    if len(row) < width:
        raise UserError(f"{path}:{line}: {len(row)} cells where {width} belong; restore the file")
    values = np.full(width, np.nan)
    for k, cell in enumerate(row[:width]):
        try:
            values[k] = float(cell)
        except ValueError:
            if any(c.isdigit() for c in cell):
                raise UserError(f"{path}:{line}: {cell!r} is not a number; restore the file") from None
    return values


def body(path: Path, places: dict[str, Floats], fps: float) -> Body:
    """Body of named joint positions (T, 3), z up, metres.

    Raises
    ------
    UserError
        If a joint is missing.
    """
    plain = {name.lower().replace("_", "").replace(" ", ""): p for name, p in places.items()}
    joints: dict[str, Floats] = {}
    for joint in NEEDED:
        names = (joint.replace("_", ""), *ALIASES.get(joint, ()))
        found = next((plain[name] for name in reversed(names) if name in plain), None)
        if found is None:
            raise UserError(f"{path}: no joint {joint!r}; name one of its columns so, or leave the file out")
        joints[joint] = found
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


def _hinge(joints: dict[str, Floats], s: str, chain: tuple[str, str, str]) -> Floats:
    """Return the normal of a limb's plane (T, 3), as long as the sine of its bend."""
    a, b, c = (joints[f"{s}_{part}"] for part in chain)
    return np.cross(unit(b - a), unit(c - b))
