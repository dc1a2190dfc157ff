"""One recorded sequence, whatever file it came from: bones with positions and orientations, z up, metres."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gait.errors import UserError
from gait.learn.mocap.remarks import NOTHING, Remarks

Floats = npt.NDArray[np.float64]

Y_UP = np.array(
    [[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]
)  # x left, y up, z forward (ASF, BVH) to x forward, y left, z up


FEWEST = 3  # frames from which speeds are had
FARTHEST = 1000.0  # metres from the file's origin: what is beyond is damage, or not in metres
DEGREES = 3600.0  # no walker turns a joint that often


def require_frames(path: Path, frames: int) -> None:
    """Refuse a file of hardly any frames, whatever its kind.

    Raises
    ------
    UserError
    """
    if frames < FEWEST:
        raise UserError(f"{path}: too few frames ({frames}); a recording of a few seconds is needed")


def require_range(path: Path, what: str, values: Floats, limit: float, unit: str) -> None:
    """Refuse values (T, ...) whose amount is beyond a limit, naming the first frame; NaN is missing.

    Raises
    ------
    UserError
    """
    beyond = np.abs(values.reshape(len(values), -1)) > limit
    if beyond.any():
        frame = int(np.argmax(beyond.any(axis=1)))
        value = values.reshape(len(values), -1)[frame, int(np.argmax(beyond[frame]))]
        raise UserError(
            f"{path}: frame {frame + 1}: {what} {value:.4g} {unit}, at most {limit:.0f} are plausible; "
            "correct it, or the file's units"
        )


@dataclass
class Recording:
    """Bones of a moving skeleton.

    Attributes
    ----------
    name : str
        Last part of the file's name, without suffix.
    source : Path
        The file.
    fps : float
        Frames per second.
    bones : list of str
        B names as in the file.
    start, end : (T, B, 3)
        Where each bone begins and ends, metres, world with z up; NaN where missing.
    rotation : (T, B, 3, 3)
        Turns a vector of the rest pose into the world.
    rest_start, rest_end : (B, 3)
        The rest pose, metres, axes as above.
    hinges : dict of str to (3,)
        Axis of bones with a single rotation, in the rest pose; flexion positive as the file has it.
    remarks : Remarks
    """

    name: str
    source: Path
    fps: float
    bones: list[str]
    start: Floats
    end: Floats
    rotation: Floats
    rest_start: Floats
    rest_end: Floats
    hinges: dict[str, Floats] = field(default_factory=dict)
    remarks: Remarks = NOTHING

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.start)


def mask_zero_runs(columns: Floats, run: int = 3) -> Floats:
    """Copy a bone's values (T, k) with NaN in runs of at least `run` rows of exact zeros.

    Mocap writes 0 for what was occluded; a bone that is 0 in all rows is fixed and not missing.
    """
    zero = (columns == 0).all(axis=1)
    result = columns.astype(float)
    if zero.all():
        return result
    edges = np.diff(np.concatenate([[0], zero.astype(int), [0]]))
    for begin, end in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        if end - begin >= run:
            result[begin:end] = np.nan
    return result
