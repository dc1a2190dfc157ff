"""Pose and path of a file of angles alone: the body is the default skeleton's, on its lower foot."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import ANGLES, CHANNELS, ROOTS, SIDES, Proportions
from gait.learn.mocap.angle_file import AngleTable
from gait.learn.segments.segment_people import Pose
from gait.learn.segments.virtual_markers import MARKERS

Floats = npt.NDArray[np.float64]

TURNS = [name for name in ROOTS if name.endswith(("roll", "pitch", "yaw"))]
ARMS = tuple(f"{s}_{joint}" for s in SIDES for joint in ("shoulder", "elbow"))


def pose(table: AngleTable) -> Pose:
    """Pose of a walker who looks along +x; joints of which the file has no angle are at rest.

    Arms of which it has none are missing.
    """
    channels = np.zeros((table.frames, len(CHANNELS)))
    channels[:, : len(ANGLES)] = _at_rest(table.angles)
    if table.root is not None:
        columns = [ROOTS.index(name) for name in TURNS]
        channels[:, [CHANNELS.index(name) for name in TURNS]] = np.nan_to_num(table.root[:, columns])
    return Pose(Proportions(), channels)


def _at_rest(angles: Floats) -> Floats:
    """Angles (T, A) with 0 for those that are never seen, unless their whole joint is and it is of an arm."""
    result = angles.copy()
    joints = [name.rsplit("_", 1)[0] for name in ANGLES]
    seen = [bool(column.any()) for column in np.isfinite(angles).T]
    known = {joint for joint, there in zip(joints, seen, strict=True) if there}
    for k, joint in enumerate(joints):
        if not seen[k] and (joint in known or joint not in ARMS):
            result[:, k] = 0.0
    return result


def standing(place: Floats, body: Proportions) -> Floats:
    """Path (T, 3) of the pelvis that puts the lowest of toes and heels on the floor and keeps it there.

    Parameters
    ----------
    place : (T, J, 3)
        Markers about the pelvis, statures.
    """
    over = {"toe": body.sole + body.toe[2], "heel": body.sole + body.heel[2]}
    feet = place[:, [MARKERS.index(f"{s}_{part}") for part in over for s in SIDES]]
    height = feet[..., 2] - np.repeat(list(over.values()), len(SIDES))
    seen = np.isfinite(height).all(axis=1)
    lowest = np.argmin(np.where(seen[:, None], height, 0.0), axis=1)
    rows = np.arange(len(place))
    step = feet[rows[:-1], lowest[:-1], :2] - feet[rows[1:], lowest[:-1], :2]
    way = np.concatenate([np.zeros((1, 2)), np.cumsum(np.nan_to_num(step), axis=0)])
    return np.column_stack([way, np.where(seen, -height[rows, lowest], np.nan)])
