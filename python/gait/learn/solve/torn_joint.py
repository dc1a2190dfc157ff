"""Joints that are torn off the body in a frame: slips in a file that are no motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import SIDES
from gait.errors import UserError

Floats = npt.NDArray[np.float64]

LIMB = ("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"), ("ankle", "toe")
#: Joints whose distance hardly changes.
BONES = (
    *(("neck", "head"), ("neck", "l_shoulder"), ("neck", "r_shoulder"), ("l_hip", "r_hip")),
    *((f"{s}_{upper}", f"{s}_{lower}") for s in SIDES for upper, lower in LIMB),
)
LONGEST = 2.0  # medians of a bone; joints triangulated from videos, not smoothed, reach 1.4


def refuse(places: Mapping[str, Floats], names: Mapping[str, str], where: Callable[[int], str]) -> None:
    """Refuse places (T, 3) by name in which a bone is far longer than it mostly is; NaN is missing.

    Parameters
    ----------
    names : mapping
        Joint to its name in the file.
    where : callable
        Words for a frame of the file, counted from 0.

    Raises
    ------
    UserError
        Naming the joint of the first such frame.
    """
    joints = {joint: places[name] for joint, name in names.items()}
    bones = [bone for bone in BONES if set(bone) <= set(joints)]
    ratios = np.array([_relative(_distance(joints, *bone)) for bone in bones], ndmin=2)
    torn = (ratios > LONGEST).any(axis=0)
    if not torn.any():
        return
    frame = int(np.argmax(torn))
    bone = bones[int(np.nanargmax(ratios[:, frame]))]
    off, other = sorted(bone, key=lambda joint: -_misplaced(joints, joint, frame))
    lengths = _distance(joints, off, other)
    more = f" ({torn.sum()} such frames)" if torn.sum() > 1 else ""
    raise UserError(
        f"{where(frame)}: {names[off]} is {lengths[frame]:.3g} m from {names[other]}, "
        f"mostly {np.nanmedian(lengths):.3g} m; correct its place or empty it{more}"
    )


def _distance(joints: Mapping[str, Floats], a: str, b: str) -> Floats:
    return np.linalg.norm(joints[a] - joints[b], axis=1)


def _relative(lengths: Floats) -> Floats:
    """Lengths (T,) over their median; NaN where there is none, or where joints mostly coincide."""
    seen = lengths[np.isfinite(lengths)]
    usual = float(np.median(seen)) if len(seen) else 0.0
    return lengths / usual if usual > 0 else np.full(len(lengths), np.nan)


def _misplaced(joints: Mapping[str, Floats], joint: str, frame: int) -> float:
    """Return how far a joint's distances to the others mostly are from what they usually are."""
    to_others = [_distance(joints, joint, other) for other in joints if other != joint]
    return float(np.median([abs(d[frame] - np.nanmedian(d)) for d in to_others if np.isfinite(d[frame])]))
