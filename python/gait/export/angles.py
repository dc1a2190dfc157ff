"""Joint angles of a motion: a skeleton of constant lengths fitted to the joints by least squares.

The skeleton is the package's (libgait/doc/model-format.md), with the person's own lengths.  Joints do not
determine the forward tilt of the pelvis or the rotation of the head, so these two angles are 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gait.body.skeleton import CHANNELS, JOINTS, axis_rotation, default_skeleton

Array = NDArray[np.float64]

FIXED_CHANNELS = ("root_forward", "root_sway", "root_height", "root_pitch", "neck_z")
"""Channels that are 0: the pelvis's position replaces those of the path, and the others are undetermined."""
_FREE = tuple(i for i, name in enumerate(CHANNELS) if name not in FIXED_CHANNELS)
_ROUNDS, _STEPS = 6, 12  # alternations of lengths and angles; Gauss-Newton steps within each
_RIDGE = 1e-8  # metres squared per radian squared; too small to change what the joints determine
_SETTLED = 1e-10  # radians


@dataclass(frozen=True)
class Fitted:
    """A skeleton that follows a motion of T frames."""

    frames: tuple[str, ...]  #: names of the F frames, parents first
    parents: tuple[int, ...]  #: (F,) -1 for the first
    #: For each frame its rotations in order: (signed axis 1..3, channel).
    rotations: tuple[tuple[tuple[int, int], ...], ...]
    origins: Array  #: (F, 3) metres, in the parent; 0 for the first
    point_frames: NDArray[np.int64]  #: (P,) frame of each joint
    points: Array  #: (P, 3) metres, in its frame
    angles: Array  #: (T, C) radians by channel; NaN in frames that the motion lacks
    pelvis: Array  #: (T, 3) metres, world
    rms: float  #: rms distance of its joints from those of the motion, metres

    def pose(
        self, rows: slice | NDArray[np.bool_] = slice(None)
    ) -> tuple[Array, Array, list[tuple[int, int, Array]]]:
        """Compute, in the world, rotations (T, F, 3, 3), origins (T, F, 3), (channel, frame, axes (T, 3))."""
        angles, pelvis = self.angles[rows], self.pelvis[rows]
        turns = np.empty((len(angles), len(self.frames), 3, 3))
        origins = np.empty((len(angles), len(self.frames), 3))
        axes: list[tuple[int, int, Array]] = []
        for i, parent in enumerate(self.parents):
            turn = np.broadcast_to(np.eye(3), (len(angles), 3, 3)) if parent < 0 else turns[:, parent]
            origins[:, i] = pelvis if parent < 0 else origins[:, parent] + turn @ self.origins[i]
            for axis, channel in self.rotations[i]:
                axes.append((channel, i, np.sign(axis) * turn[:, :, abs(axis) - 1]))
                turn = turn @ axis_rotation(abs(axis) - 1, np.sign(axis) * angles[:, channel])
            turns[:, i] = turn
        return turns, origins, axes

    def joints(self) -> Array:
        """Compute joints (T, P, 3) in the world, metres."""
        turns, origins, _ = self.pose()
        at = self.point_frames
        return np.asarray(origins[:, at] + np.einsum("tpij,pj->tpi", turns[:, at], self.points))


def fit(places: Array) -> Fitted:
    """Fit lengths and angles to joints, alternately.

    `places` (T, P, 3): positions of `JOINTS`, metres, world with z up; NaN in missing frames.
    """
    skeleton = default_skeleton()
    present = np.isfinite(places).all(axis=(1, 2))
    wanted = places[present]
    stature = _stature(wanted)
    links = [tuple(int(n) for n in row) for row in skeleton.links]
    count = len(wanted)
    fitted = Fitted(
        frames=tuple(skeleton.frames),
        parents=tuple(row[0] for row in links),
        rotations=tuple(
            tuple(zip(row[2 : 2 + 2 * row[1] : 2], row[3 : 3 + 2 * row[1] : 2], strict=True)) for row in links
        ),
        origins=skeleton.origins * stature,
        point_frames=np.asarray(skeleton.point_frames, np.int64),
        points=skeleton.point_positions * stature,
        angles=np.zeros((count, len(CHANNELS))),
        pelvis=wanted[:, JOINTS.index("pelvis")].copy(),
        rms=np.inf,
    )
    fitted.angles[:, CHANNELS.index("root_yaw")] = _heading(wanted)
    for _ in range(_ROUNDS):
        fitted = _with_lengths(_with_angles(fitted, wanted), wanted)
    fitted = _with_angles(fitted, wanted)
    for side in "lr":
        _choose_branch(fitted.angles, f"{side}_shoulder_rotation", f"{side}_elbow_flexion")
    rms = float(np.sqrt(((fitted.joints() - wanted) ** 2).sum(axis=2).mean()))
    angles, pelvis = (np.full((len(places), n), np.nan) for n in (len(CHANNELS), 3))
    angles[present] = np.unwrap(fitted.angles, axis=0)
    pelvis[present] = fitted.pelvis
    return replace(fitted, angles=angles, pelvis=pelvis, rms=rms)


def _stature(joints: Array) -> float:
    """Estimate the stature from the legs, metres."""

    def length(a: str, b: str) -> float:
        return float(
            np.median(np.linalg.norm(joints[:, JOINTS.index(a)] - joints[:, JOINTS.index(b)], axis=1))
        )

    legs = [length(f"{s}_hip", f"{s}_knee") + length(f"{s}_knee", f"{s}_ankle") for s in "lr"]
    return max(sum(legs) / 2 / 0.49, 0.1)


def _heading(joints: Array) -> Array:
    """Compute the heading (T,) of the pelvis, radians."""
    left = joints[:, JOINTS.index("l_hip")] - joints[:, JOINTS.index("r_hip")]
    return np.unwrap(np.arctan2(-left[:, 0], left[:, 1]))


def _with_angles(fitted: Fitted, wanted: Array) -> Fitted:
    """Find angles and pelvis for which the joints are nearest to those wanted, by Gauss-Newton."""
    free = list(_FREE)
    for _ in range(_STEPS):
        joints, rows, normal = _equations(fitted)
        missed = (wanted - joints).reshape(len(wanted), -1)
        pull = np.zeros((len(wanted), len(free) + 3))
        pull[:, : len(free)] = _RIDGE * fitted.angles[:, free]
        step = np.linalg.solve(normal, (np.einsum("tri,tr->ti", rows, missed) - pull)[..., None])[..., 0]
        step[:, : len(free)] = np.clip(step[:, : len(free)], -0.5, 0.5)
        angles = fitted.angles.copy()
        angles[:, free] += step[:, : len(free)]
        fitted = replace(fitted, angles=angles, pelvis=fitted.pelvis + step[:, len(free) :])
        if np.abs(step).max() < _SETTLED:
            break
    return fitted


def _equations(fitted: Fitted) -> tuple[Array, Array, Array]:
    """Compute joints (T, P, 3), slopes (T, 3 P, n) by free angles and pelvis, and the normal matrix."""
    turns, origins, axes = fitted.pose()
    at, inside, free = fitted.point_frames, _descendants(fitted.parents), list(_FREE)
    joints = origins[:, at] + np.einsum("tpij,pj->tpi", turns[:, at], fitted.points)
    slopes = np.zeros((*joints.shape, len(free) + 3))
    for channel, frame, axis in axes:
        if channel not in free:
            continue
        moved = inside[frame][at]
        arm = joints[:, moved] - origins[:, None, frame]
        slopes[..., free.index(channel)][:, moved] = np.cross(axis[:, None], arm)
    slopes[..., len(free) :] = np.eye(3)
    rows = slopes.reshape(len(joints), -1, len(free) + 3)
    return joints, rows, rows.transpose(0, 2, 1) @ rows + np.diag([_RIDGE] * len(free) + [0.0] * 3)


def standard_deviations(fitted: Fitted, covariance: Array) -> Array:
    """Compute standard deviations (T, C), radians, from the joints' covariance; 0 for `FIXED_CHANNELS`.

    Parameters
    ----------
    fitted : Fitted
        Skeleton of a motion without missing frames.
    covariance : (T, 3 P, 3 P)
        Covariance of the coordinates of the motion's joints in each frame, square metres.
    """
    _, rows, normal = _equations(fitted)
    by_joint = np.linalg.solve(normal, rows.transpose(0, 2, 1))[:, : len(_FREE)]
    found = np.zeros((len(rows), len(CHANNELS)))
    square = np.einsum("tna,tab,tnb->tn", by_joint, covariance, by_joint, optimize=True)
    found[:, list(_FREE)] = np.sqrt(np.maximum(square, 0.0))
    return found


def _choose_branch(angles: Array, rotation: str, flexion: str) -> None:
    """Make an arm's angles continuous, in place: rotated by half a turn and bent backwards it is the same.

    The branch is chosen so that the elbow is bent forwards where it is bent most.
    """
    turn, bend = angles[:, CHANNELS.index(rotation)], angles[:, CHANNELS.index(flexion)]
    start = int(np.abs(bend).argmax())
    before = 0.0
    for rows in (range(start, len(bend)), range(start, -1, -1)):
        for k in rows:
            if (k == start and bend[k] < 0) or (k != start and abs(_wrapped(turn[k] - before)) > np.pi / 2):
                turn[k] += np.pi
                bend[k] = -bend[k]
            turn[k] = before + _wrapped(turn[k] - before) if k != start else _wrapped(turn[k])
            before = float(turn[k])


def _wrapped(angle: float) -> float:
    """Return an angle in [-pi, pi)."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def _descendants(parents: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return which frames move with which, (F, F): row i for rotations of frame i."""
    inside = np.eye(len(parents), dtype=bool)
    for i, parent in enumerate(parents):
        if parent >= 0:
            inside[:, i] |= inside[:, parent]
    return inside


def _with_lengths(fitted: Fitted, wanted: Array) -> Fitted:
    """Set the person's lengths to means over the motion, in the rotating frames.

    Where a frame's angles determine the direction (arms, legs, top of the head), only the distance is used.
    """
    turns, origins, _ = fitted.pose()
    place = dict(zip(JOINTS, np.moveaxis(wanted, 1, 0), strict=True))
    starts = {"head": "neck"} | {
        f"{s}_{part}": f"{s}_{joint}" for s in "lr" for part, joint in _STARTS.items()
    }
    new_origins, new_points = fitted.origins.copy(), fitted.points.copy()
    for i, name in enumerate(fitted.frames):
        if name in starts:
            parent = fitted.parents[i]
            new_origins[i] = _mean_in(
                turns[:, parent], origins[:, parent], place[starts[name]], fitted.origins[i]
            )
    for p, joint in enumerate(JOINTS):
        frame = int(fitted.point_frames[p])
        if fitted.points[p].any():
            new_points[p] = _mean_in(turns[:, frame], origins[:, frame], place[joint], fitted.points[p])
    return replace(fitted, origins=new_origins, points=new_points)


#: Joint at the origin of each frame.
_STARTS = {
    **{"upper_arm": "shoulder", "forearm": "elbow", "thigh": "hip", "shank": "knee", "foot": "ankle"},
}


def _mean_in(turns: Array, origins: Array, places: Array, before: Array) -> Array:
    """Mean position (3,) of a point in a frame; only along `before` if that is on an axis."""
    local = np.einsum("tji,tj->ti", turns, places - origins)
    if np.count_nonzero(before) == 1:
        length = np.linalg.norm(places - origins, axis=1).mean()
        return np.asarray(np.sign(before) * length)
    return np.asarray(local.mean(axis=0))
