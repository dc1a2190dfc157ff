"""Tables of numbers over time in .csv: `frame,time,...`, evenly sampled, with what is missing as NaN."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import ANGLES, ROOTS
from gait.errors import UserError, quoted, unreadable
from gait.io.fields import table_rows
from gait.learn.mocap.recording import DEGREES, FARTHEST, require_frames

Floats = npt.NDArray[np.float64]

LONGEST = 10.0  # a table may grow to so many times its rows by the frames that are missing in it
LOST = "lost"  # status of rows of a track in which nobody was followed
#: End of a column's name to the largest amount and the unit.
LIMITS = dict.fromkeys(("_x", "_y", "_z"), (FARTHEST, "metres"))
LIMITS |= {"_deg": (DEGREES, "degrees"), "_rad": (float(np.radians(DEGREES)), "radians")}
QUANTITIES = {"time", "stature_m", *ANGLES, *ROOTS}  # other columns of numbers that are learnt from


@dataclass
class Table:
    """Columns of numbers.

    Attributes
    ----------
    names : list of str
        As in the header.
    values : (T, n)
        NaN where cells are empty, or words in columns that are not learnt from; in rows left out, and in
        rows of a track that is lost.
    fps : float
        Rows per second.
    lines : (T,)
        Of the file; 0 for rows left out.
    """

    names: list[str]
    values: Floats
    fps: float
    lines: npt.NDArray[np.intp]

    def __getitem__(self, name: str) -> Floats:
        return self.values[:, self.names.index(name)]


def header(path: Path) -> list[str]:
    """Read the column names.

    Raises
    ------
    UserError
        If the file cannot be read or is empty.
    """
    return [name.strip() for name in _lines(path)[0][1]]


def read(path: Path, fps: float | None = None) -> Table:
    """Read a table; without column `time` the rate must be given.

    Rows whose times jump by whole frames have the frames between them missing.

    Raises
    ------
    UserError
        Naming file, line and remedy.
    """
    (_, first), *rows = _lines(path)
    names = [name.strip() for name in first]
    if "time" not in names and not fps:
        raise UserError(f"{path}:1: no column 'time'; the header must be frame,time,... (or give --fps)")
    twice = next((name for name in names if name and names.count(name) > 1), None)
    if twice is not None:
        raise UserError(f"{path}:1: column {quoted(twice)} is there twice; remove one")
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
    """Refuse angles and places that no walker reaches; what a column is its name tells."""
    for name, column in zip(names, values.T, strict=True):
        limit, unit = next((limits for end, limits in LIMITS.items() if name.endswith(end)), (np.inf, ""))
        beyond = np.abs(column) > limit
        if beyond.any():
            row = int(np.argmax(beyond))
            raise UserError(
                f"{path}:{lines[row]}: {name} is {column[row]:.4g}, at most {limit:.0f} {unit} are plausible;"
                " correct it, or the file's units"
            )


def _places(path: Path, times: Floats, lines: list[int]) -> tuple[npt.NDArray[np.intp], float]:
    """Frames that rows belong to, and the rate."""
    steps = np.diff(times)
    if not (steps > 0).all():  # also if one is NaN
        line = lines[1 + int(np.argmin(np.nan_to_num(steps, nan=-1.0) > 0))]
        raise UserError(f"{path}:{line}: the times do not increase; correct column 'time'")
    frames = np.maximum(1.0, np.round(steps / np.median(steps)))
    if frames.sum() > LONGEST * len(times):
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
        raise UserError(f"{path}:{line}: {len(row)} cells where {len(names)} belong; restore the file")
    return np.array([_number(cell, name, path, line) for cell, name in zip(row, names, strict=False)])


def _number(cell: str, name: str, path: Path, line: int) -> float:
    """Read the number of a cell; NaN if it is empty or nan, or a word in a column that is not learnt from."""
    try:
        value = float(cell.strip() or "nan")
    except ValueError:
        value = np.inf
    if not np.isinf(value):
        return value
    if name in QUANTITIES or name.endswith(tuple(LIMITS)):
        raise UserError(
            f"{path}:{line}: {name}: {quoted(cell.strip())} is not a number; correct it or empty it"
        )
    return float("nan")
