"""BVH: the fitted skeleton in centimetres, y up, facing z; bones have names that most importers know."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gait.body.skeleton import JOINTS
from gait.export.angles import Fitted
from gait.export.motion import Motion
from gait.export.opensim import GROUND

Array = NDArray[np.float64]

_CENTIMETRES = 100.0
_BONES = {"pelvis": "Hips", "torso": "Spine", "head": "Head"} | {
    f"{s}_{part}": f"{side}{bone}"
    for s, side in (("l", "Left"), ("r", "Right"))
    for part, bone in (
        *(
            ("upper_arm", "Arm"),
            ("forearm", "ForeArm"),
            ("thigh", "UpLeg"),
            ("shank", "Leg"),
            ("foot", "Foot"),
        ),
    )
}
_ENDS = {"head": "head_top"} | {f"{s}_{part}": f"{s}_{end}" for s in "lr" for part, end in
                                (("forearm", "wrist"), ("foot", "toe"))}  # fmt: skip
_ORDER = "Zrotation Xrotation Yrotation"


def write(path: Path, motion: Motion, fitted: Fitted) -> int:
    """Write the motion; return the number of missing frames, which repeat the previous frame."""
    present = motion.present
    source = np.maximum.accumulate(np.where(present, np.arange(len(present)), 0))
    rows = _channels(fitted)[source]
    lines = [
        "HIERARCHY",
        *_hierarchy(fitted, 0, 0),
        "MOTION",
        f"Frames: {len(rows)}",
        f"Frame Time: {1 / motion.rate:.9f}",
    ]
    lines += [" ".join(f"{value:.6f}" for value in row) for row in rows]
    path.write_text("\n".join([*lines, ""]), encoding="ascii")
    return int((~present).sum())


def _hierarchy(fitted: Fitted, i: int, depth: int) -> Iterator[str]:
    """Write the lines of a bone and its children, in the order of their frames."""
    gap, inner = "\t" * depth, "\t" * (depth + 1)
    frame = fitted.frames[i]
    place = "" if i else "Xposition Yposition Zposition "
    yield f"{gap}{'JOINT' if i else 'ROOT'} {_BONES[frame]}"
    yield gap + "{"
    yield f"{inner}OFFSET {_offset(fitted.origins[i])}"
    yield f"{inner}CHANNELS {3 if i else 6} {place}{_ORDER}"
    for k, parent in enumerate(fitted.parents):
        if parent == i:
            yield from _hierarchy(fitted, k, depth + 1)
    if frame in _ENDS:
        yield from (
            f"{inner}End Site",
            inner + "{",
            f"{inner}\tOFFSET {_offset(fitted.points[JOINTS.index(_ENDS[frame])])}",
            inner + "}",
        )
    yield gap + "}"


def _offset(place: Array) -> str:
    return " ".join(f"{value:.6f}" for value in _CENTIMETRES * (GROUND @ place))


def _order(fitted: Fitted, i: int = 0) -> Iterator[int]:
    """List the frames in the order of `_hierarchy`."""
    yield i
    for k, parent in enumerate(fitted.parents):
        if parent == i:
            yield from _order(fitted, k)


def _channels(fitted: Fitted) -> Array:
    """Compute values (T, n): position of the hips, then degrees of every bone."""
    turns, origins, _ = fitted.pose()
    columns = [_CENTIMETRES * origins[:, 0] @ GROUND.T]
    for i in _order(fitted):
        parent = fitted.parents[i]
        local = turns[:, i] if parent < 0 else turns[:, parent].transpose(0, 2, 1) @ turns[:, i]
        columns.append(_zxy(GROUND @ local @ GROUND.T))
    return np.hstack(columns)


def _zxy(turn: Array) -> Array:
    """Decompose rotations Rz Rx Ry to degrees (T, 3) z, x, y."""
    x = np.arcsin(np.clip(turn[:, 2, 1], -1, 1))
    z = np.arctan2(-turn[:, 0, 1], turn[:, 1, 1])
    y = np.arctan2(-turn[:, 2, 0], turn[:, 2, 2])
    return np.degrees(np.stack([z, x, y], axis=1))
