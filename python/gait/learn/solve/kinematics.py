"""Forward kinematics of the default skeleton with exact derivatives by pose and by the subject's lengths.

A pose has 30 degrees of freedom: 3 of the pelvis joint's position, 3 small rotations of the pelvis about the
world's axes, and the 24 angles.  A subject's lengths are log length scales (`SCALES`).  Lengths are metres,
angles radians; T frames, F segments, M points, S length scales.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gait.body.skeleton import ANGLES, SIDES, axis_rotation, default_skeleton
from gait.learn.arrays import Floats, Indices, Mask

_SKELETON = default_skeleton()
SEGMENTS = _SKELETON.frames
PARENTS = [int(link[0]) for link in _SKELETON.links]
#: Rotations of each segment but the pelvis, outermost first: signed axis and column of the angle.
TURNS = [
    [(int(axis), int(angle)) for axis, angle in link[2 : 2 + 2 * link[1]].reshape(-1, 2)]
    if link[0] >= 0
    else []
    for link in _SKELETON.links
]
ORIGINS = _SKELETON.origins  #: (F, 3) of the generic body in the parents' axes, statures
ROOT = 6
FREEDOMS = ROOT + len(ANGLES)


def _moves() -> Mask:
    """Return which rotations (columns: 3 of the pelvis, 24 angles) move a segment's points, (F, 27)."""
    table = np.zeros((len(SEGMENTS), FREEDOMS - 3), bool)
    for i, parent in enumerate(PARENTS):
        table[i] = True if parent < 0 else table[parent]
        table[i, 3:] &= parent >= 0
        table[i, [3 + angle for _, angle in TURNS[i]]] = True
    return table


MOVES = _moves()

#: The axes of `gait.learn.solve.body.Body` that point left, and the segments in which they are fixed.
HINGES = {"head": "head"} | {
    f"{s}_{joint}": f"{s}_{part}"
    for s in SIDES
    for joint, part in (("knee", "thigh"), ("elbow", "upper_arm"))
}
LIMBS = {"upper_arm": "z", "forearm": "z", "thigh": "z", "shank": "z", "foot": "x"}
#: Length scales in which bodies differ: the stature, then logarithms of ratios, with the segments and axes
#: that they lengthen (1) or shorten (-1).  Scaling a segment also moves the origins of its children.
SCALES: dict[str, list[tuple[str, str, float]]] = {
    "stature": [(name, "xyz", 1.0) for name in SEGMENTS],
    "pelvis width": [("pelvis", "y", 1.0)],
    "trunk": [("torso", "z", 1.0)],
    "shoulder width": [("torso", "y", 1.0)],
    "head": [("head", "z", 1.0)],
    **{part: [(f"{s}_{part}", axis, 1.0) for s in SIDES] for part, axis in LIMBS.items()},
    **{f"{part} left": [(f"l_{part}", axis, 1.0), (f"r_{part}", axis, -1.0)] for part, axis in LIMBS.items()},
}
#: Their standard deviations among people: of ratios to the stature, and of half the difference of the sides.
SCALE_SD = np.array([0.25] + [0.04 if name.endswith(" left") else 0.08 for name in list(SCALES)[1:]])
#: Table (F, 3, S): the log scale of a segment along each axis is this times the S log length scales.
SCALE_TABLE = np.zeros((len(SEGMENTS), 3, len(SCALES)))
for _k, _members in enumerate(SCALES.values()):
    for _name, _axes, _sign in _members:
        SCALE_TABLE[SEGMENTS.index(_name), ["xyz".index(a) for a in _axes], _k] = _sign


@dataclass
class Pose:
    """Poses of T frames."""

    position: Floats  #: (T, 3) of the pelvis joint in the world
    rotation: Floats  #: (T, 3, 3) of the pelvis in the world
    angles: Floats  #: (T, 24)

    def __getitem__(self, frames: Indices | slice) -> Pose:
        return Pose(self.position[frames], self.rotation[frames], self.angles[frames])

    def __setitem__(self, frames: Indices | slice, other: Pose) -> None:
        self.position[frames], self.rotation[frames] = other.position, other.rotation
        self.angles[frames] = other.angles

    def __len__(self) -> int:
        return len(self.position)

    def moved(self, step: Floats) -> Pose:
        """Return the poses after steps (T, 30)."""
        rotation = rotate_by(step[:, 3:ROOT]) @ self.rotation
        return Pose(self.position + step[:, :3], rotation, self.angles + step[:, ROOT:])


@dataclass
class PosedSkeleton:
    """The skeleton in T poses."""

    rotations: Floats  #: (T, F, 3, 3) of the segments
    origins: Floats  #: (T, F, 3) of the segments
    axes: Floats  #: (T, 27, 3) of the rotations
    pivots: Floats  #: (T, 27, 3) of the rotations

    def points(self, local: Floats, segment: Indices) -> Floats:
        """Return world positions (T, M, 3) of points (M, 3) in the axes of their segments."""
        return self.origins[:, segment] + np.einsum("tmij,mj->tmi", self.rotations[:, segment], local)

    def by_pose(self, points: Floats, segment: Indices) -> Floats:
        """Return the derivatives (T, M, 3, 30) of world points (T, M, 3)."""
        result = np.zeros((*points.shape, FREEDOMS))
        result[..., [0, 1, 2], [0, 1, 2]] = 1.0
        lever = points[:, :, None] - self.pivots[:, None]
        lever *= MOVES[segment][..., None]
        result[..., 3:] = np.moveaxis(_cross(self.axes[:, None], lever), -1, 2)
        return result

    def directions_by_pose(self, directions: Floats, segment: Indices) -> Floats:
        """Return the derivatives (T, M, 3, 30) of directions (T, M, 3) fixed in segments."""
        result = np.zeros((*directions.shape, FREEDOMS))
        turned = _cross(self.axes[:, None], directions[:, :, None]) * MOVES[segment][..., None]
        result[..., 3:] = np.moveaxis(turned, -1, 2)
        return result

    def by_scales(self, log_scales: Floats, at: Floats, segment: Indices) -> Floats:
        """Return the derivatives (T, M, 3, S) of points at (M, 3) statures by the log length scales (S,)."""
        change = segment_scales(log_scales)[..., None] * SCALE_TABLE  # of a unit vector, (F, 3, S)
        moved = np.zeros((*self.origins.shape, SCALE_TABLE.shape[2]))
        for i, parent in enumerate(PARENTS):
            if parent >= 0:
                moved[:, i] = moved[:, parent] + self.rotations[:, parent] @ (
                    change[parent] * ORIGINS[i, :, None]
                )
        return moved[:, segment] + self.rotations[:, segment] @ (change[segment] * at[..., None])


def segment_scales(log_scales: Floats) -> Floats:
    """Return metres per stature along each segment's axes, (F, 3)."""
    return np.exp(SCALE_TABLE @ log_scales)


def segment_origins(log_scales: Floats) -> Floats:
    """Return the origins (F, 3) of the segments in their parents, metres."""
    return segment_scales(log_scales)[np.maximum(PARENTS, 0)] * ORIGINS


def pose_skeleton(pose: Pose, origins: Floats) -> PosedSkeleton:
    """Pose the skeleton with segment origins (F, 3) in the parents' axes."""
    frames = len(pose)
    rotations, starts = np.empty((frames, len(SEGMENTS), 3, 3)), np.empty((frames, len(SEGMENTS), 3))
    axes, pivots = np.empty((2, frames, FREEDOMS - 3, 3))
    axes[:, :3], pivots[:, :3] = np.eye(3), pose.position[:, None]
    rotations[:, 0], starts[:, 0] = pose.rotation, pose.position
    for i, parent in enumerate(PARENTS[1:], 1):
        turn = rotations[:, parent]
        starts[:, i] = starts[:, parent] + turn @ origins[i]
        for axis, angle in TURNS[i]:
            sign, k = np.sign(axis), abs(axis) - 1
            axes[:, 3 + angle], pivots[:, 3 + angle] = sign * turn[:, :, k], starts[:, i]
            turn = turn @ axis_rotation(k, sign * pose.angles[:, angle])
        rotations[:, i] = turn
    return PosedSkeleton(rotations, starts, axes, pivots)


def rotate_by(vectors: Floats) -> Floats:
    """Return rotations (T, 3, 3) about axes (T, 3) by their length (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    return (
        np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * cross @ cross
    )


def _cross(a: Floats, b: Floats) -> Floats:
    """Compute the cross product over the last axis; faster than numpy's for many small vectors."""
    return np.stack(
        [
            a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
            a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
            a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
        ],
        axis=-1,
    )
