"""Read labelled points of .c3d and .trc files; ezc3d runs in a child process."""

from __future__ import annotations

import io
import struct
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gait.errors import UserError
from gait.io.trc import METRES, read_trc
from gait.learn.arrays import Floats
from gait.learn.mocap.recording import FARTHEST_POSITION_M, require_frames, require_range

SUFFIXES = (".c3d", ".trc")
CHILD = Path(__file__).with_name("c3d_child.py")
READ_TIMEOUT_S = 120.0  # seconds for one file
#: Bytes; the first is the header, and its first byte is the block in which the parameters begin.
BLOCK_BYTES = 512
BIG_ENDIAN, DEC = 86, 85  # processor types, fourth byte of the parameters
TOLERANCE = 1e-3  # relative difference from which rates or scales are different
MOST_HEADER_FRAMES = 65535  # frames; more do not fit in the header


def read(path: Path, fps: float | None = None) -> tuple[list[str], Floats, float]:
    """Read M labels, points (T, M, 3) in metres and the axes of the file, and the frame rate.

    Points are NaN where missing; a point at exactly (0, 0, 0) is missing, as this is how these formats write
    gaps. `fps`: rate given by the user.  UserError names the file and the remedy, also if the file states a
    rate or a number twice with different values.
    """
    labels, points, rate = (read_trc if path.suffix.lower() == ".trc" else read_c3d)(path, fps)
    require_frames(path, len(points))
    for k, label in enumerate(labels):
        require_range(path, f"a coordinate of point {label!r}", points[:, k], FARTHEST_POSITION_M, "metres")
    points[(points == 0).all(axis=2)] = np.nan
    return labels, points, rate


def read_c3d(path: Path, fps: float | None = None) -> tuple[list[str], Floats, float]:
    """Read labels, points (T, M, 3) in metres, NaN where the file marks them as missing, and the rate."""
    if not path.is_file():
        raise UserError(f"{path}: no such file; check the name")
    try:
        child = subprocess.run(
            [sys.executable, "-I", str(CHILD), str(path)],
            capture_output=True,
            timeout=READ_TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise UserError(
            f"{path}: not read after {READ_TIMEOUT_S:.0f} s; the file is damaged, export it again"
        ) from None
    if child.returncode:
        words = child.stderr.decode(errors="replace").strip().splitlines()
        # The first sentence is the reason; it is followed by the library's advice to programmers.
        reason = words[-1].split(". ")[0].rstrip(".") if child.returncode > 0 and words else ""
        raise UserError(
            f"{path}: not a readable .c3d ({reason or 'the reader crashed on it'}); export it again"
        )
    with np.load(io.BytesIO(child.stdout)) as data:
        labels, points = [str(label).strip() for label in data["labels"]], data["points"]
        rate, units = fps or float(data["rate"]), str(data["units"]).strip()
        stated = {name: float(data[name]) for name in data.files if ":" in name}
    header = _header(path)
    _require_agreement(path, header, stated, fps is None)
    if len(labels) < len(points):
        raise UserError(f"{path}: {len(points)} points but {len(labels)} labels; export it again with labels")
    if units.lower() not in METRES:
        raise UserError(f"{path}: points in {units!r}; set POINT:UNITS to one of {' '.join(METRES)}")
    if not (np.isfinite(rate) and rate > 0):
        raise UserError(f"{path}: {rate} frames per second; set POINT:RATE")
    if points.shape[1] < header.frames:
        raise UserError(f"{path}: {points.shape[1]} of {header.frames} frames are there; get it again")
    return labels, np.swapaxes(points, 0, 1) * METRES[units.lower()], rate


class Header(NamedTuple):
    """Contents of the header, and POINT:FRAMES; ezc3d silently replaces or ignores them."""

    points: int
    analog: int  #: values per frame of points
    frames: int  #: 0 if their number does not fit
    rate: float  #: frames per second; NaN if written by a DEC, as the next
    scale: float  #: of whole numbers, in units of the file; negative if points are floating-point numbers
    data_block: int  #: number of the block in which the points begin
    stated_frames: int  #: POINT:FRAMES; 0 if missing or too large for it


def _header(path: Path) -> Header:
    content = path.read_bytes()
    begin = (content[0] - 1) * BLOCK_BYTES
    kind = content[begin + 3]
    order = ">" if kind == BIG_ENDIAN else "<"
    points, analog, first, last, _, scale, block, _, rate = struct.unpack_from(f"{order}5Hf2Hf", content, 2)
    frames = 0 if last >= MOST_HEADER_FRAMES else max(0, last - first + 1)
    if kind == DEC:
        rate = scale = float("nan")
    return Header(points, analog, frames, rate, scale, block, _stated_frames(content[begin:], order))


def _stated_frames(parameters: bytes, order: str) -> int:
    """Return POINT:FRAMES from the bytes of the parameters: records of a name, a group's id and a value."""
    at, group, frames = 4, 0, dict[int, int]()
    while at + 2 < len(parameters) and (length := abs(struct.unpack_from("b", parameters, at)[0])):
        (id,) = struct.unpack_from("b", parameters, at + 1)
        name, end = parameters[at + 2 : at + 2 + length].upper(), at + 2 + length
        if end + 6 > len(parameters):
            break
        step, kind, dimensions, value = struct.unpack_from(f"{order}HbBH", parameters, end)
        if id < 0 and name == b"POINT":
            group = -id
        elif name == b"FRAMES" and (kind, dimensions) == (2, 0):
            frames[id] = value % MOST_HEADER_FRAMES
        if not step:
            break
        at = end + step
    return frames.get(group, 0)


def _require_agreement(path: Path, header: Header, stated: Mapping[str, float], rated: bool) -> None:
    """Raise UserError if header and parameters differ, as one of them misplaces all following values.

    `rated`: whether to compare the rate.
    """
    point_rate, analog_rate = stated["POINT:RATE"], stated["ANALOG:RATE"]
    samples = analog_rate / point_rate if point_rate > 0 else 0.0
    analog = round(stated["ANALOG:USED"] * samples)
    block, scale = round(stated["POINT:DATA_START"]), stated["POINT:SCALE"]
    fault = ""
    if header.points != round(stated["POINT:USED"]):
        fault = f"{header.points} points, POINT:USED {stated['POINT:USED']:g}"
    elif header.analog != analog:
        fault = (
            f"{header.analog} analog values per frame, ANALOG:USED and ANALOG:RATE {analog} "
            f"({stated['ANALOG:USED']:g} channels at {analog_rate:g} Hz)"
        )
    elif rated and point_rate > 0 and abs(header.rate / point_rate - 1) > TOLERANCE:
        fault = f"{header.rate:g} frames per second, POINT:RATE {point_rate:g}"
    elif block and header.data_block != block:
        fault = f"points from block {header.data_block} on, POINT:DATA_START {block}"
    elif header.frames and header.stated_frames and header.frames != header.stated_frames:
        fault = f"{header.frames} frames, POINT:FRAMES {header.stated_frames}"
    elif scale and _scales_differ(header.scale, scale):
        fault = f"a scale of {header.scale:g}, POINT:SCALE {scale:g} (negative: floating-point numbers)"
    if fault:
        remedy = "export it again" + ", or give --fps" * ("per second" in fault)
        raise UserError(f"{path}: header and parameters differ: the header states {fault}; {remedy}")


def _scales_differ(first: float, second: float) -> bool:
    """Whether two scales give different points: floating-point numbers are not scaled."""
    if first < 0 or second < 0:
        return (first < 0) != (second < 0)
    return abs(first / second - 1) > TOLERANCE  # NaN: no
