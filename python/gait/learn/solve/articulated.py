"""Kinematics of the default skeleton with exact derivatives: by pose and by the lengths of the subject.

A pose has 30 degrees of freedom: 3 of the pelvis joint's place, 3 small turns of the pelvis about the world's
axes, and the 24 angles.  Lengths are metres, angles radians; T frames of time, F segments, M points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import ANGLES, SIDES, axis_rotation, default_skeleton

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

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
ORIGINS = _SKELETON.origins  #: (F, 3) of the generic body, statures
ROOT = 6
FREEDOMS = ROOT + len(ANGLES)


def _moves() -> npt.NDArray[np.bool_]:
    """Whether a rotation (columns: 3 of the pelvis, 24 angles) moves a segment's points, (F, 27)."""
    table = np.zeros((len(SEGMENTS), FREEDOMS - 3), bool)
    for i, parent in enumerate(PARENTS):
        table[i] = True if parent < 0 else table[parent]
        table[i, 3:] &= parent >= 0
        table[i, [3 + angle for _, angle in TURNS[i]]] = True
    return table


MOVES = _moves()

#: Axes to the left that `gait.learn.solve.body.Body` has, and the segments whose they are.
HINGES = {"head": "head"} | {
    f"{s}_{joint}": f"{s}_{part}"
    for s in SIDES
    for joint, part in (("knee", "thigh"), ("elbow", "upper_arm"))
}
LIMBS = {"upper_arm": "z", "forearm": "z", "thigh": "z", "shank": "z", "foot": "x"}
#: What may differ between bodies: the stature, then the logarithms of ratios, with the axes of the segments
#: that they stretch (or shrink, -1).  A segment's stretch also moves the origins of its children.
STRETCHES: dict[str, list[tuple[str, str, float]]] = {
    "stature": [(name, "xyz", 1.0) for name in SEGMENTS],
    "pelvis width": [("pelvis", "y", 1.0)],
    "trunk": [("torso", "z", 1.0)],
    "shoulder width": [("torso", "y", 1.0)],
    "head": [("head", "z", 1.0)],
    **{part: [(f"{s}_{part}", axis, 1.0) for s in SIDES] for part, axis in LIMBS.items()},
    **{f"{part} left": [(f"l_{part}", axis, 1.0), (f"r_{part}", axis, -1.0)] for part, axis in LIMBS.items()},
}
#: Their standard deviations in people: of ratios to the stature, and of half the difference of the sides.
STRETCH_SD = np.array([0.25] + [0.04 if name.endswith(" left") else 0.08 for name in list(STRETCHES)[1:]])
#: Table (F, 3, S): the logarithm of a segment's scale along each axis is this times the S stretches.
STRETCH = np.zeros((len(SEGMENTS), 3, len(STRETCHES)))
for _k, _members in enumerate(STRETCHES.values()):
    for _name, _axes, _sign in _members:
        STRETCH[SEGMENTS.index(_name), ["xyz".index(a) for a in _axes], _k] = _sign


@dataclass
class Pose:
    """Poses of T frames: place (T, 3) and turn (T, 3, 3) of the pelvis in the world, angles (T, 24)."""

    place: Floats
    turn: Floats
    angles: Floats

    def __getitem__(self, frames: Indices | slice) -> Pose:
        return Pose(self.place[frames], self.turn[frames], self.angles[frames])

    def __setitem__(self, frames: Indices | slice, other: Pose) -> None:
        self.place[frames], self.turn[frames], self.angles[frames] = other.place, other.turn, other.angles

    def __len__(self) -> int:
        return len(self.place)

    def moved(self, step: Floats) -> Pose:
        """Poses after steps (T, 30)."""
        return Pose(
            self.place + step[:, :3], turn_by(step[:, 3:ROOT]) @ self.turn, self.angles + step[:, ROOT:]
        )


@dataclass
class Posed:
    """A posed skeleton: segments' turns (T, F, 3, 3) and origins (T, F, 3); axes and pivots (T, 27, 3)."""

    turns: Floats
    origins: Floats
    axes: Floats
    pivots: Floats

    def points(self, local: Floats, segment: Indices) -> Floats:
        """World positions (T, M, 3) of points (M, 3) of their segments' axes."""
        return self.origins[:, segment] + np.einsum("tmij,mj->tmi", self.turns[:, segment], local)

    def by_pose(self, points: Floats, segment: Indices) -> Floats:
        """Give the derivatives (T, M, 3, 30) of world points (T, M, 3)."""
        result = np.zeros((*points.shape, FREEDOMS))
        result[..., [0, 1, 2], [0, 1, 2]] = 1.0
        lever = points[:, :, None] - self.pivots[:, None]
        lever *= MOVES[segment][..., None]
        result[..., 3:] = np.moveaxis(_cross(self.axes[:, None], lever), -1, 2)
        return result

    def directions_by_pose(self, directions: Floats, segment: Indices) -> Floats:
        """Give the derivatives (T, M, 3, 30) of directions (T, M, 3) fixed in segments."""
        result = np.zeros((*directions.shape, FREEDOMS))
        turned = _cross(self.axes[:, None], directions[:, :, None]) * MOVES[segment][..., None]
        result[..., 3:] = np.moveaxis(turned, -1, 2)
        return result

    def by_stretch(self, stretch: Floats, at: Floats, segment: Indices) -> Floats:
        """Give the derivatives (T, M, 3, S) of points at (M, 3) statures by the stretches (S,)."""
        change = scales(stretch)[..., None] * STRETCH  # of a unit vector, (F, 3, S)
        moved = np.zeros((*self.origins.shape, STRETCH.shape[2]))
        for i, parent in enumerate(PARENTS):
            if parent >= 0:
                moved[:, i] = moved[:, parent] + self.turns[:, parent] @ (
                    change[parent] * ORIGINS[i, :, None]
                )
        return moved[:, segment] + self.turns[:, segment] @ (change[segment] * at[..., None])


def scales(stretch: Floats) -> Floats:
    """Metres per stature along each segment's axes, (F, 3)."""
    return np.exp(STRETCH @ stretch)


def origins(stretch: Floats) -> Floats:
    """Origins (F, 3) of the segments in their parents, metres."""
    return scales(stretch)[np.maximum(PARENTS, 0)] * ORIGINS


def posed(pose: Pose, offsets: Floats) -> Posed:
    """Put the skeleton with segments' origins `offsets` (F, 3) into poses."""
    frames = len(pose)
    turns, starts = np.empty((frames, len(SEGMENTS), 3, 3)), np.empty((frames, len(SEGMENTS), 3))
    axes, pivots = np.empty((2, frames, FREEDOMS - 3, 3))
    axes[:, :3], pivots[:, :3] = np.eye(3), pose.place[:, None]
    turns[:, 0], starts[:, 0] = pose.turn, pose.place
    for i, parent in enumerate(PARENTS[1:], 1):
        turn = turns[:, parent]
        starts[:, i] = starts[:, parent] + turn @ offsets[i]
        for axis, angle in TURNS[i]:
            sign, k = np.sign(axis), abs(axis) - 1
            axes[:, 3 + angle], pivots[:, 3 + angle] = sign * turn[:, :, k], starts[:, i]
            turn = turn @ axis_rotation(k, sign * pose.angles[:, angle])
        turns[:, i] = turn
    return Posed(turns, starts, axes, pivots)


def turn_by(vectors: Floats) -> Floats:
    """Rotations (T, 3, 3) about axes (T, 3) by their length (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    return (
        np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * cross @ cross
    )


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross product of the last axis; quicker than numpy's for many small vectors."""
    return np.stack(
        [
            a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
            a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
            a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
        ],
        axis=-1,
    )
