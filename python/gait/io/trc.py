"""Read and write TRC, the marker format of OpenSim."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gait.errors import UserError, quoted
from gait.io.files import replacing, text_lines

Array = NDArray[np.float64]

METRES = {"m": 1.0, "mm": 0.001, "cm": 0.01}  #: units of a file, in metres
NAMED = {"DataRate", "NumMarkers", "Units"}  #: fields that a header must have
_RATE_OFF, _COLUMN_GAP = (
    0.02,
    1.7,
)  # largest relative difference of rates; frame times from which a step is a gap
_OFF_TIME = 0.3  # frame times by which a step of column Time may differ from that of Frame#
HEADER_LINES = 5  # lines of the header; an empty line may follow


class Row(NamedTuple):
    """A frame's line in the file, and what its first columns state."""

    line: int
    time: float  #: seconds; NaN if empty
    frame: float  #: Frame#; NaN if empty


class Table(NamedTuple):
    """Contents of a file with T frames of M points."""

    labels: list[str]
    points: Array  #: (T, M, 3); NaN where cells are empty
    rate: float  #: DataRate, frames per second
    original: float  #: OrigDataRate, that of the recording from which these frames were taken; NaN if missing
    rows: list[Row]


def read_trc(path: Path, fps: float | None = None) -> tuple[list[str], Array, float]:
    """Read the points of a .trc.

    Returns M labels, points (T, M, 3) in metres and in the file's axes, NaN where cells are empty or, by both
    Frame# and Time, a row is missing, and frames per second: `fps`, or DataRate, which must then agree with
    the times.  UserError names file, line and remedy.
    """
    table = _with_missing_rows(read_trc_table(path, METRES))
    if fps is None:
        _require_rate(path, table.rate, table.rows)
        _require_numbers(path, table)
    return table.labels, table.points, fps or table.rate


def read_trc_table(path: Path, scales: Mapping[str, float]) -> Table:
    """Read a file; points are multiplied by their unit's factor in `scales`."""
    lines = text_lines(path)
    if len(lines) < HEADER_LINES or not set(lines[1].split()) >= NAMED:
        raise UserError(f"{path}: not a .trc header of five lines; export the file again")
    head = dict(zip(lines[1].split(), lines[2].split(), strict=False))
    labels = [cell.strip() for cell in lines[3].split("\t")[2:] if cell.strip()]
    rate, scale, count = *_rate_and_scale(path, head, scales), len(labels)
    if head.get("NumMarkers") != str(count):
        promised = quoted(head.get("NumMarkers", ""))
        raise UserError(f"{path}:4: {count} labels where NumMarkers is {promised}; correct it")
    numbered = [(i, line) for i, line in enumerate(lines[HEADER_LINES:], HEADER_LINES + 1) if line.strip()]
    rows = [_row(line, 2 + 3 * count, f"{path}:{i}") for i, line in numbered]
    if len(rows) < 3:
        raise UserError(f"{path}: too few frames ({len(rows)}); a recording of a few seconds is needed")
    times = [Row(i, row[1], row[0]) for (i, _), row in zip(numbered, rows, strict=True)]
    _require_consistent(path, head, labels, times)
    points = np.array(rows)[:, 2:].reshape(len(rows), count, 3) * scale
    original = head.get("OrigDataRate", "")
    return Table(labels, points, rate, float(original) if _NUMBER.fullmatch(original) else np.nan, times)


def _rate_and_scale(path: Path, head: dict[str, str], scales: Mapping[str, float]) -> tuple[float, float]:
    """Read frames per second and the unit's factor from the header."""
    rate, units = head.get("DataRate", ""), head.get("Units", "")
    if not _NUMBER.fullmatch(rate) or not 0 < float(rate) < np.inf:
        raise UserError(f"{path}:3: DataRate is {quoted(rate)}; write the frames per second")
    if units.lower() not in scales:
        raise UserError(f"{path}:3: Units is {quoted(units)}; write one of {' '.join(scales)}")
    return float(rate), scales[units.lower()]


def _require_consistent(path: Path, head: dict[str, str], labels: list[str], times: list[Row]) -> None:
    """Raise UserError if labels are not unique, frames are missing, or times do not increase."""
    twice = next((label for label in labels if labels.count(label) > 1), None)
    if twice is not None:
        raise UserError(f"{path}:4: label {quoted(twice)} appears twice; rename or remove one")
    promised = head.get("NumFrames", str(len(times)))
    if promised != str(len(times)):
        raise UserError(
            f"{path}:3: NumFrames is {promised} but {len(times)} frames are there; get the file again or "
            "correct it"
        )
    late = next((k for k in range(1, len(times)) if times[k][1] <= times[k - 1][1]), None)
    if late is not None:
        raise UserError(f"{path}:{times[late][0]}: the times do not increase; correct column Time")


def _with_missing_rows(table: Table) -> Table:
    """Insert rows of NaN where numbers and times agree that some are missing, at most as many again."""
    frames, seconds = (np.array([getattr(row, name) for row in table.rows]) for name in ("frame", "time"))
    steps, spans = np.diff(frames), np.diff(seconds)
    usual = np.median(steps), np.median(spans)  # NaN if a column is empty
    if not min(usual) > 0:
        return table
    count = np.round(steps / usual[0])
    agree = (count >= 1) & (np.abs(spans / usual[1] - count) < _OFF_TIME)
    if not agree.all() or not 0 < count.sum() - len(count) <= len(table.rows):
        return table
    at = np.concatenate([[0], np.cumsum(count)]).astype(int)
    points = np.full((at[-1] + 1, *table.points.shape[1:]), np.nan)
    points[at] = table.points
    every = np.arange(len(points))
    lines = [table.rows[k].line for k in np.searchsorted(at, every)]
    times, numbers = (np.interp(every, at, column).tolist() for column in (seconds, frames))
    return table._replace(points=points, rows=list(map(Row, lines, times, numbers)))


def _require_rate(path: Path, rate: float, times: list[Row]) -> None:
    """Raise UserError if times contradict the rate, or have gaps because rows are missing."""
    seconds = np.array([row.time for row in times])
    if np.isnan(seconds).any():  # the column may be empty
        return
    steps = np.diff(seconds)
    measured = len(steps) / float(seconds[-1] - seconds[0])  # mean rate, as times are rounded
    gap = int(np.argmax(steps))
    if steps[gap] > _COLUMN_GAP / rate and steps[gap] > _COLUMN_GAP * np.median(steps):
        raise UserError(
            f"{path}:{times[gap + 1][0]}: {steps[gap]:.3g} s after the row before, at {rate:g} per second; "
            "add rows with empty cells for frames that are missing, or cut the file there"
        )
    if abs(measured / rate - 1) > _RATE_OFF:
        raise UserError(
            f"{path}: DataRate is {rate:g} per second, but column Time increases by {1 / measured:.4g} s, "
            f"{measured:.4g} per second; correct one of them, or give --fps"
        )


def _require_numbers(path: Path, table: Table) -> None:
    """Raise UserError if the numbers of frames have gaps where the times have none.

    The first number may be any; of a recording of a higher rate, every second frame or so may have been kept.
    """
    steps = np.diff([row.frame for row in table.rows])
    usual = (
        table.original / table.rate if abs(steps[0] * table.rate / table.original - 1) < _RATE_OFF else 1.0
    )
    if np.isnan(steps).any() or (np.abs(steps - usual) < 0.5).all():  # the column may be empty
        return
    at = int(np.argmax(np.abs(steps - usual) >= 0.5))
    before, row = table.rows[at], table.rows[at + 1]
    raise UserError(
        f"{path}:{row.line}: Frame# is {row.frame:g} after {before.frame:g}, but no frame is missing by "
        "DataRate and column Time; correct one of them, or give --fps"
    )


def _row(line: str, width: int, where: str) -> list[float]:
    """Convert cells to numbers, empty ones to NaN; exporters omit empty cells at the end of a line."""
    cells = line.rstrip("\r\n").split("\t")
    if len(cells) < 2 or any(cell.strip() for cell in cells[width:]):
        raise UserError(f"{where}: {len(cells)} cells where {width} belong; restore the file")
    try:
        values = [float(cell) if cell.strip() else float("nan") for cell in cells[:width]]
    except ValueError:
        bad = next(cell for cell in cells if cell.strip() and not _NUMBER.fullmatch(cell.strip()))
        raise UserError(f"{where}: {quoted(bad.strip())} is not a number; restore the file") from None
    return values + [float("nan")] * (width - len(values))


_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|[-+]?(nan|inf|infinity)", re.IGNORECASE)


def write_trc(
    path: str | os.PathLike[str],
    names: tuple[str, ...],
    times: Array,
    joints: Array,
    rate: float,
    frames: NDArray[np.int64] | None = None,
) -> None:
    """Write joints (n, P, 3) in metres, z up, as OpenSim's y-up frame: x_trc = y, y_trc = z, z_trc = x.

    `names`: the P joints; `times` (n,): seconds; `rate`: frames per second; `frames` (n,): numbers of the
    frames, from 0.  Frames that are missing have no row, since OpenSim's inverse kinematics stops at an empty
    one; Frame# and Time show them.
    """
    count, markers = joints.shape[:2]
    numbers = 1 + (np.arange(count) if frames is None else frames)
    head = [
        f"PathFileType\t4\t(X/Y/Z)\t{os.path.basename(path)}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate:g}\t{rate:g}\t{count}\t{markers}\tm\t{rate:g}\t{numbers[0]}\t{count}",
        "Frame#\tTime\t" + "".join(f"{name}\t\t\t" for name in names).rstrip("\t"),
        "\t\t" + "\t".join(f"{axis}{i + 1}" for i in range(markers) for axis in "XYZ"),
        "",
    ]
    turned = joints[..., [1, 2, 0]].reshape(count, -1)
    body = [
        f"{number}\t{time:.6f}\t" + "\t".join(f"{value:.5f}" for value in row)
        for number, time, row in zip(numbers, times, turned, strict=True)
    ]
    with replacing(path) as temporary:
        temporary.write_text("\n".join([*head, *body, ""]), encoding="utf-8")
