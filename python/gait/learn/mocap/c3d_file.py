"""Labelled points of .c3d files, read by ezc3d behind a process boundary."""

from __future__ import annotations

import io
import subprocess
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gait.errors import UserError
from gait.io.trc import METRES

Floats = npt.NDArray[np.float64]

CHILD = Path(__file__).with_name("c3d_child.py")
PATIENCE = 120.0  # seconds for one file
BLOCK = 512  # bytes; the first is the header, and its first byte says in which the parameters begin
BIG_ENDIAN = 86  # kind of processor, fourth byte of the parameters
MANY = 65535  # frames: more do not fit into the header


def read(path: Path) -> tuple[list[str], Floats, float]:
    """Read the points of a .c3d.

    Returns
    -------
    labels : list of str
        M labels.
    points : (T, M, 3)
        Metres, axes of the file; NaN where the file marks a point as not seen.
    rate : float
        Frames per second.

    Raises
    ------
    UserError
        If the file is malformed; one line, whatever is wrong with it.
    """
    if not path.is_file():
        raise UserError(f"{path}: no such file; check the name")
    try:
        child = subprocess.run(
            [sys.executable, "-I", str(CHILD), str(path)], capture_output=True, timeout=PATIENCE, check=False
        )
    except subprocess.TimeoutExpired:
        raise UserError(
            f"{path}: not read after {PATIENCE:.0f} s; the file is damaged, export it again"
        ) from None
    if child.returncode:
        words = child.stderr.decode(errors="replace").strip().splitlines()
        reason = _first_sentence(words[-1]) if child.returncode > 0 and words else "the reader crashed on it"
        raise UserError(f"{path}: not a readable .c3d ({reason}); export it again")
    return _checked(path, child.stdout)


def _first_sentence(words: str) -> str:
    """Say what is wrong without the library's advice to programmers that follows."""
    return words.split(". ")[0].rstrip(".")


def _checked(path: Path, stored: bytes) -> tuple[list[str], Floats, float]:
    with np.load(io.BytesIO(stored)) as data:
        labels, points = [str(label).strip() for label in data["labels"]], data["points"]
        rate, units = float(data["rate"]), str(data["units"]).strip()
    if len(labels) < len(points):
        raise UserError(f"{path}: {len(points)} points but {len(labels)} labels; export it again with labels")
    if units.lower() not in METRES:
        raise UserError(f"{path}: points in {units!r}; set POINT:UNITS to one of {' '.join(METRES)}")
    if not (np.isfinite(rate) and rate > 0):
        raise UserError(f"{path}: {rate} frames per second; set POINT:RATE")
    promised = _promised(path)
    if points.shape[1] < promised:
        raise UserError(f"{path}: {points.shape[1]} of {promised} frames are there; fetch it again")
    return labels, np.swapaxes(points, 0, 1) * METRES[units.lower()], rate


def _promised(path: Path) -> int:
    """Read how many frames the header promises, which the library corrects in silence; 0 if it cannot say."""
    with path.open("rb") as file:
        header = file.read(BLOCK)
        file.seek((header[0] - 1) * BLOCK)
        big = file.read(4)[3:] == bytes([BIG_ENDIAN])
    first, last = (int.from_bytes(header[k : k + 2], "big" if big else "little") for k in (6, 8))
    return 0 if last >= MANY else max(0, last - first + 1)
