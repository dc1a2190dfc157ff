"""Labelled points of .c3d and .trc files; ezc3d runs in a child process."""

from __future__ import annotations

import io
import subprocess
import sys
from pathlib import Path

import numpy as np

from gait.errors import UserError
from gait.io.trc import METRES, read_trc
from gait.learn.arrays import Floats
from gait.learn.mocap.recording import FARTHEST, require_frames, require_range

SUFFIXES = (".c3d", ".trc")
CHILD = Path(__file__).with_name("c3d_child.py")
PATIENCE = 120.0  # seconds for one file
BLOCK = 512  # bytes; the first is the header, and its first byte is the block in which the parameters begin
BIG_ENDIAN = 86  # kind of processor, fourth byte of the parameters
MANY = 65535  # frames: more do not fit into the header


def read(path: Path) -> tuple[list[str], Floats, float]:
    """Read M labels, points (T, M, 3) in metres and the axes of the file, and the frame rate.

    Points are NaN where missing; a point at exactly (0, 0, 0) is missing, because these formats write gaps
    so. UserError names the file and the remedy.
    """
    labels, points, rate = (read_trc if path.suffix.lower() == ".trc" else read_c3d)(path)
    require_frames(path, len(points))
    for k, label in enumerate(labels):
        require_range(path, f"a coordinate of point {label!r}", points[:, k], FARTHEST, "metres")
    points[(points == 0).all(axis=2)] = np.nan
    return labels, points, rate


def read_c3d(path: Path) -> tuple[list[str], Floats, float]:
    """Read labels, points (T, M, 3) in metres, NaN where the file marks them as missing, and the rate."""
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
        # The first sentence is the reason; the library's advice to programmers follows it.
        reason = words[-1].split(". ")[0].rstrip(".") if child.returncode > 0 and words else ""
        raise UserError(
            f"{path}: not a readable .c3d ({reason or 'the reader crashed on it'}); export it again"
        )
    with np.load(io.BytesIO(child.stdout)) as data:
        labels, points = [str(label).strip() for label in data["labels"]], data["points"]
        rate, units = float(data["rate"]), str(data["units"]).strip()
    if len(labels) < len(points):
        raise UserError(f"{path}: {len(points)} points but {len(labels)} labels; export it again with labels")
    if units.lower() not in METRES:
        raise UserError(f"{path}: points in {units!r}; set POINT:UNITS to one of {' '.join(METRES)}")
    if not (np.isfinite(rate) and rate > 0):
        raise UserError(f"{path}: {rate} frames per second; set POINT:RATE")
    expected = _frames_in_header(path)
    if points.shape[1] < expected:
        raise UserError(f"{path}: {points.shape[1]} of {expected} frames are there; fetch it again")
    return labels, np.swapaxes(points, 0, 1) * METRES[units.lower()], rate


def _frames_in_header(path: Path) -> int:
    """Read the number of frames from the header, which ezc3d corrects silently; 0 if it does not fit."""
    with path.open("rb") as file:
        header = file.read(BLOCK)
        file.seek((header[0] - 1) * BLOCK)
        big = file.read(4)[3:] == bytes([BIG_ENDIAN])
    first, last = (int.from_bytes(header[k : k + 2], "big" if big else "little") for k in (6, 8))
    return 0 if last >= MANY else max(0, last - first + 1)
