"""A recorded skeleton from a file reader (z up, metres), and the checks common to all readers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gait.errors import UserError
from gait.learn.arrays import Floats, Mask

#: From x left, y up, z forward (ASF, BVH) to x forward, y left, z up.
Y_UP = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])

FEWEST_FRAMES = 3  # fewest frames that give speeds
FARTHEST_POSITION_M = 1000.0  # metres from the file's origin; more indicates damage or another unit
DEGREES = 3600.0  # the largest plausible angle of a joint
SHORT = 3  # consecutive frames of exact zeros that are missing, if zeros are declared missing
LONG = 5  # consecutive frames in which a moving part does not stay at exactly 0
#: Parts that must be 0 together to be reported: an angle may be clipped at 0, but no joint stays at the
#: origin.
ZERO_BONES, ZERO_JOINTS, ZERO_ANGLES = 3, 1, 3


@dataclass(frozen=True)
class FileNotes:
    """Observations of a reader that are no errors, but that the user may not have intended."""

    #: Labels of the markers, as `markers.plain` returns them, if a marker map is used.
    labels: frozenset[str] = frozenset()
    #: Which part is exactly 0 in which frames, as if it were missing; empty if there is none.
    zeros: str = ""
    #: Bones or joints that are missing in the file and not required.
    lacking: tuple[str, ...] = ()
    #: Speed of the treadmill from the feet, m/s; 0 if the person stays in place without one; None overground.
    belt: float | None = None


NO_NOTES = FileNotes()


@dataclass
class Recording:
    """Bones of a moving skeleton: T frames, B bones."""

    name: str  #: stem of the file
    source: Path
    fps: float  #: frames per second
    bones: list[str]  #: names as in the file
    start: Floats  #: (T, B, 3) metres, world with z up; NaN where missing
    end: Floats  #: (T, B, 3)
    rotation: Floats  #: (T, B, 3, 3) from the rest pose to the world
    rest_start: Floats  #: (B, 3) in the rest pose, metres, same axes
    rest_end: Floats  #: (B, 3)
    #: Axis (3,) of bones with one rotation, in the rest pose; flexion is positive as in the file.
    hinges: dict[str, Floats] = field(default_factory=dict)
    notes: FileNotes = NO_NOTES


def require_frames(path: Path, frames: int) -> None:
    """Raise UserError if a file has too few frames."""
    if frames < FEWEST_FRAMES:
        raise UserError(f"{path}: too few frames ({frames}); a recording of a few seconds is needed")


def require_range(path: Path, what: str, values: Floats, limit: float, unit: str) -> None:
    """Raise UserError naming the first frame in which |values| (T, ...) exceed the limit; NaN is missing."""
    beyond = np.abs(values.reshape(len(values), -1)) > limit
    if beyond.any():
        frame = int(np.argmax(beyond.any(axis=1)))
        value = values.reshape(len(values), -1)[frame, int(np.argmax(beyond[frame]))]
        raise UserError(
            f"{path}: frame {frame + 1}: {what} is {value:.4g} {unit}; at most {limit:.0f} is plausible; "
            "correct the value or the units of the file"
        )


def mask_zero_runs(columns: Floats) -> Floats:
    """Copy values (T, k) of one part with NaN where SHORT or more rows in a row are exactly 0.

    Some systems write 0 for occluded parts.  A part that is always 0 is fixed, not missing.
    """
    zero = (columns == 0).all(axis=1)
    result = columns.astype(float)
    if not zero.all():
        result[_runs(zero, SHORT)] = np.nan
    return result


def zero_run(parts: Mapping[str, Floats], together: int) -> str:
    """Describe the first run of LONG frames in which `together` of the parts (T, k) are exactly 0, or ''.

    Parts that are always 0 are fixed and do not count.
    """
    runs = {name: _long_zeros(columns) for name, columns in parts.items()}
    at_once = sum(runs.values(), np.zeros(len(next(iter(runs.values()), ())), int)) >= together
    if not at_once.any():
        return ""
    first = int(np.argmax(at_once))
    name = next(name for name, run in runs.items() if run[first])
    rest = at_once[first:]
    last = first + (len(rest) if rest.all() else int(np.argmin(rest)))
    return f"{name} in frames {first + 1} to {last}"


def _long_zeros(columns: Floats) -> Mask:
    """Rows (T,) that belong to a run of LONG or more rows of exact zeros, of a part that moves."""
    zero = (columns == 0).all(axis=1)
    moves = (zero < np.isfinite(columns).all(axis=1)).any()
    return _runs(zero, LONG) if moves else np.zeros(len(zero), bool)


def _runs(rows: Mask, count: int) -> Mask:
    """Rows (T,) that belong to a run of `count` or more True ones."""
    begins = (
        np.convolve(rows, np.ones(count), "full")[count - 1 :] >= count
    )  # `count` rows from here are True
    return np.convolve(begins, np.ones(count), "full")[: len(rows)] > 0
