"""The default skeleton as data, and its forward kinematics in numpy, for learning, before a model exists.

The C library poses learnt models; tests compare the two.

libgait/doc/model-format.md defines frames, rotations and signs.  Lengths are fractions of stature, angles
radians; body axes are x forward, y left, z up.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.body.model_curves import curves
from gait.io import blob as blobs

Floats = npt.NDArray[np.float64]

SIDES = ("l", "r")
_BALL = ("flexion", "abduction", "rotation")
PAPER_ANGLES = (
    [f"neck_{axis}" for axis in "xyz"]
    + [f"{s}_shoulder_{a}" for s in SIDES for a in _BALL]
    + [f"{s}_elbow_flexion" for s in SIDES]
    + [f"{s}_hip_{a}" for s in SIDES for a in _BALL]
    + [f"{s}_knee_flexion" for s in SIDES]
)
ANGLES = PAPER_ANGLES + [f"torso_{axis}" for axis in "xyz"] + [f"{s}_ankle_flexion" for s in SIDES]
ROOTS = [f"root_{name}" for name in ("forward", "sway", "height", "roll", "pitch", "yaw")]
CHANNELS = ANGLES + ROOTS
EVAL15 = ["pelvis", "neck", "head_top"] + [
    f"{s}_{j}" for j in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle") for s in SIDES
]
JOINTS = EVAL15 + [f"{s}_{j}" for j in ("toe", "heel") for s in SIDES]
_USUAL_DISTANCE = 0.04  # person's heights in the picture; of a keypoint from its joint
#: In the order of drawing.
BONES = (
    *(("pelvis", "neck"), ("neck", "head_top")),
    *(("neck", f"{s}_shoulder") for s in "lr"),
    *((f"{s}_shoulder", f"{s}_elbow") for s in "lr"),
    *((f"{s}_elbow", f"{s}_wrist") for s in "lr"),
    *(("pelvis", f"{s}_hip") for s in "lr"),
    *((f"{s}_hip", f"{s}_knee") for s in "lr"),
    *((f"{s}_knee", f"{s}_ankle") for s in "lr"),
    *((f"{s}_ankle", f"{s}_heel") for s in "lr"),
    *((f"{s}_heel", f"{s}_toe") for s in "lr"),
)


def side_of(name: str) -> str:
    """Side of the body, from the name of a joint, limb or angle: ``left``, ``right`` or ``middle``."""
    return {"l_": "left", "r_": "right"}.get(name[:2], "middle")


@dataclass(frozen=True)
class Proportions:
    """Body proportions, in fractions of stature; the right side mirrors the left.

    Vectors are in body axes with all angles 0.  The defaults are the means of eight walking subjects (CMU).
    """

    hip: tuple[float, float, float] = (0.0, 0.055, 0.0)  #: left hip from the pelvis joint, in the pelvis
    torso: tuple[float, float, float] = (
        0.0,
        0.0,
        0.0,
    )  #: lower end of the spine from the pelvis joint, in the pelvis
    shoulder: tuple[float, float, float] = (0.0, 0.107, 0.283)  #: left shoulder, in the torso
    neck: float = 0.320  #: height of the neck joint above the lower end of the spine
    neck_ahead: float = 0.0  #: its distance in front of it
    head: tuple[float, float, float] = (0.0, 0.0, 0.143)  #: top of the head from the neck joint, in the head
    upper_arm: float = 0.168
    forearm: float = 0.155  #: elbow to wrist
    thigh: float = 0.240
    shank: float = 0.250
    toe: tuple[float, float, float] = (0.069, 0.0, -0.0235)  #: ball of the foot from the ankle
    heel: tuple[float, float, float] = (-0.035, 0.0, -0.034)  #: heel from the ankle
    sole: float = 0.047  #: height of the ankle above the sole


@dataclass(frozen=True)
class Skeleton:
    """Frames, points and limbs in the form in which the blob stores them."""

    frames: list[str] = field(default_factory=list)  #: F names, parents first
    #: (F, 8) rows of FRMI: parent, number of rotations, then (signed axis, channel) pairs.
    links: npt.NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 8), np.int32))
    origins: Floats = field(default_factory=lambda: np.zeros((0, 3)))  #: (F, 3) in the parent frame
    #: P names, their frames (P,) and positions (P, 3).
    points: list[str] = field(default_factory=list)
    point_frames: npt.NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    point_positions: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    #: L names, rows of LIMI (L, 2), rows of LIMF (L, 10).
    limbs: list[str] = field(default_factory=list)
    limb_frames: npt.NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 2), np.int32))
    limb_shapes: Floats = field(default_factory=lambda: np.zeros((0, 10)))

    def sections(self) -> dict[str, blobs.Array]:
        """Make the sections FRNM ... LIMF of a blob."""
        return {
            "FRNM": blobs.pack_names(self.frames),
            "FRMI": self.links,
            "FRMF": self.origins.astype(np.float32),
            "PTNM": blobs.pack_names(self.points),
            "PTNI": self.point_frames,
            "PTNF": self.point_positions.astype(np.float32),
            "LBNM": blobs.pack_names(self.limbs),
            "LIMI": self.limb_frames,
            "LIMF": self.limb_shapes.astype(np.float32),
        }


def default_skeleton(p: Proportions | None = None) -> Skeleton:
    """Make the default skeleton with generic or given proportions."""
    body = p or Proportions()
    frames, links, origins = _frames(body)
    points = _points(body)
    limbs = _limbs(body)
    index = {name: i for i, name in enumerate(frames)}
    return Skeleton(
        frames=frames,
        links=links,
        origins=origins,
        points=JOINTS,
        point_frames=np.array([index[points[j][0]] for j in JOINTS], np.int32),
        point_positions=np.array([points[j][1] for j in JOINTS], float),
        limbs=list(limbs),
        limb_frames=np.array([[index[frame], shape] for frame, shape, _ in limbs.values()], np.int32),
        limb_shapes=np.array([numbers for _, _, numbers in limbs.values()], float),
    )


def other_sides(names: Sequence[str]) -> list[int]:
    """Columns of the points on the other side of the body; a point without one is its own."""
    other = {"l_": "r_", "r_": "l_"}
    twins = [other.get(name[:2], name[:2]) + name[2:] for name in names]
    return [names.index(twin if twin in names else name) for twin, name in zip(twins, names, strict=True)]


def side_pairs(names: Sequence[str]) -> list[tuple[int, int]]:
    """Columns of left and right of the points that have both."""
    pairs = zip(range(len(names)), other_sides(names), strict=True)
    return [(left, right) for left, right in pairs if names[left].startswith("l_") and left != right]


def mistaken_sides(
    uv: Floats, expected: Floats, names: Sequence[str], tall: Floats | float
) -> npt.NDArray[np.bool_]:
    """Whether (...) keypoints of a frame fit the expected ones better with left and right swapped.

    Parameters
    ----------
    uv, expected : (..., J, 2)
        Pixels; NaN where not found.
    names : sequence of str
        Names of the J joints.
    tall : (...)
        The person's height in the picture, pixels.
    """
    usual = _USUAL_DISTANCE * np.asarray(tall)[..., None]
    kept, other = (
        np.nansum(np.log1p(np.sum((points - expected) ** 2, axis=-1) / usual**2), axis=-1)
        for points in (uv, uv[..., other_sides(names), :])
    )
    return np.asarray(other < kept)


def _mirror(v: tuple[float, float, float], side: str) -> tuple[float, float, float]:
    return v if side == "l" else (v[0], -v[1], v[2])


def _frames(p: Proportions) -> tuple[list[str], npt.NDArray[np.int32], Floats]:
    """Frame names, FRMI rows and origins."""
    rows: list[tuple[str, str, tuple[float, float, float], list[tuple[int, str]]]] = [
        ("pelvis", "", (0, 0, 0), [(3, "root_yaw"), (2, "root_pitch"), (1, "root_roll")]),
        ("torso", "pelvis", p.torso, [(3, "torso_z"), (2, "torso_y"), (1, "torso_x")]),
        ("head", "torso", (p.neck_ahead, 0, p.neck), [(3, "neck_z"), (2, "neck_y"), (1, "neck_x")]),
    ]
    for s in SIDES:
        sign = 1 if s == "l" else -1
        ball = [(-2, "flexion"), (sign, "abduction"), (-3 * sign, "rotation")]
        rows += [
            (f"{s}_upper_arm", "torso", _mirror(p.shoulder, s), [(a, f"{s}_shoulder_{n}") for a, n in ball]),
            (f"{s}_forearm", f"{s}_upper_arm", (0, 0, -p.upper_arm), [(-2, f"{s}_elbow_flexion")]),
            (f"{s}_thigh", "pelvis", _mirror(p.hip, s), [(a, f"{s}_hip_{n}") for a, n in ball]),
            (f"{s}_shank", f"{s}_thigh", (0, 0, -p.thigh), [(2, f"{s}_knee_flexion")]),
            (f"{s}_foot", f"{s}_shank", (0, 0, -p.shank), [(-2, f"{s}_ankle_flexion")]),
        ]
    names = [row[0] for row in rows]
    links = np.zeros((len(rows), 8), np.int32)
    for i, (_, parent, _, rotations) in enumerate(rows):
        links[i, :2] = (names.index(parent) if parent else -1), len(rotations)
        for k, (axis, channel) in enumerate(rotations):
            links[i, 2 + 2 * k : 4 + 2 * k] = axis, CHANNELS.index(channel)
    return names, links, np.array([row[2] for row in rows], float)


def _points(p: Proportions) -> dict[str, tuple[str, tuple[float, float, float]]]:
    """Name of each joint, to its frame and position in that frame."""
    zero = (0.0, 0.0, 0.0)
    points: dict[str, tuple[str, tuple[float, float, float]]] = {
        "pelvis": ("pelvis", zero),
        "neck": ("head", zero),
        "head_top": ("head", p.head),
    }
    for s in SIDES:
        points |= {
            f"{s}_shoulder": (f"{s}_upper_arm", zero),
            f"{s}_elbow": (f"{s}_forearm", zero),
            f"{s}_wrist": (f"{s}_forearm", (0.0, 0.0, -p.forearm)),
            f"{s}_hip": (f"{s}_thigh", zero),
            f"{s}_knee": (f"{s}_shank", zero),
            f"{s}_ankle": (f"{s}_foot", zero),
            f"{s}_toe": (f"{s}_foot", _mirror(p.toe, s)),
            f"{s}_heel": (f"{s}_foot", _mirror(p.heel, s)),
        }
    return points


CONE, ELLIPSOID = 0, 1
#: Solids of a dressed body of 1.75 m, millimetres: shape, offsets of the axis's start and end from the joints
#: (left side), half axes at both ends.  Fitted to silhouettes of people in known poses (decisions.md, "What
#: the defaults were chosen on"): flesh lies in front of hips and spine; the trunk reaches into the neck.
_SOLIDS = {
    "torso": (CONE, (52, 0, 108), (61, 0, 86), (172, 133, 184, 72)),
    "pelvis": (CONE, (13, 0, -67), (40, 0, 128), (174, 117, 176, 120)),
    "head": (ELLIPSOID, (25, 0, -35), (25, 0, 6), (75, 98, 75, 98)),
    "upper_arm": (CONE, (0, -18, 18), (18, -5, 0), (60, 60, 38, 38)),
    "forearm": (CONE, (9, 0, 0), (-7, 0, -131), (35, 35, 25, 31)),
    "thigh": (CONE, (30, -22, 5), (14, -4, 0), (96, 102, 69, 69)),
    "shank": (CONE, (-15, 0, 0), (0, 0, 0), (67, 67, 54, 57)),
    "foot": (CONE, (14, 0, 30), (38, 0, 6), (28, 59, 37, 35)),
}


def _limbs(p: Proportions) -> dict[str, tuple[str, int, list[float]]]:
    """Name of each limb, to its frame, shape and LIMF row."""
    joint = (0.0, 0.0, 0.0)
    spans: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {  # joints between which solids lie
        "torso": (joint, (0, 0, p.shoulder[2])),
        "pelvis": (joint, joint),
        "head": (joint, (0, 0, p.head[2])),
        "upper_arm": (joint, (0, 0, -p.upper_arm)),
        "forearm": (joint, (0, 0, -p.forearm)),
        "thigh": (joint, (0, 0, -p.thigh)),
        "shank": (joint, (0, 0, -p.shank)),
        "foot": ((p.heel[0], 0, -p.sole), (p.toe[0], 0, -p.sole)),
    }
    limbs = {}
    for name in ("torso", "pelvis", "head"):
        limbs[name] = name, _SOLIDS[name][0], _solid(name, spans[name], "l")
    for s in SIDES:
        for name in ("upper_arm", "forearm", "thigh", "shank", "foot"):
            limbs[f"{s}_{name}"] = f"{s}_{name}", _SOLIDS[name][0], _solid(name, spans[name], s)
    return limbs


def _solid(name: str, span: tuple[tuple[float, ...], tuple[float, ...]], side: str) -> list[float]:
    """Make a LIMF row, in statures: start, end, half axes."""
    _, start, end, radii = _SOLIDS[name]
    ends = [
        np.array(at) + np.array(_mirror(by, side)) / 1750 for at, by in zip(span, (start, end), strict=True)
    ]
    return [*ends[0].tolist(), *ends[1].tolist(), *(r / 1750 for r in radii)]


def pose(
    model: Mapping[str, Any] | str | os.PathLike[str],
    phase: npt.ArrayLike,
    coef: npt.ArrayLike,
    stature: npt.ArrayLike,
    heading: npt.ArrayLike,
    pitch: npt.ArrayLike,
    roll: npt.ArrayLike,
    pelvis: npt.ArrayLike,
    proportion: npt.ArrayLike = (),
    stride_hz: npt.ArrayLike = 0.0,
) -> tuple[Floats, Floats]:
    """Pose N states: evaluate the curves (Ormoneit 2000, eq. 3), then forward kinematics.

    `model`: sections of a blob, from `gait.io.blob.read`, or its file. `phase`, `stature`,
    `heading`, `pitch`, `roll` (N,): strides, metres, radians. `coef` (N, k) or (k,): scores in standard
    deviations, k <= q; the rest are 0. `pelvis` (N, 3) or (3,): pelvis joint in the world, metres.
    `proportion` (N, l) or (l,): scores of the limbs' proportions, l <= p; the rest are 0. `stride_hz` (N,):
    stride rate, on which the mean cycle depends; 0: the average. Returns `joints` (N, P, 3): metres, world;
    `angles` (N, A): radians.
    """
    sections = model if isinstance(model, Mapping) else blobs.read(model)
    coef = np.atleast_2d(np.asarray(coef, float))
    scalars = [np.atleast_1d(np.asarray(v, float)) for v in (phase, stature, heading, pitch, roll)]
    n = np.broadcast_shapes(*(v.shape for v in scalars), coef.shape[:1], np.atleast_2d(pelvis).shape[:1])[0]
    phase, stature, heading, pitch, roll = (np.broadcast_to(v, n) for v in scalars)
    channels = curves(sections, phase, np.broadcast_to(coef, (n, coef.shape[1])), stride_hz)
    angles = channels.copy()
    angles[:, root_columns(sections)] += np.stack([heading, pitch, roll], axis=1)
    positions = points(sections, angles, proportion) * stature[:, None, None] + np.asarray(
        pelvis, float
    ).reshape(-1, 1, 3)
    return positions, channels[:, : channels.shape[1] - len(ROOTS)]


def points(sections: Mapping[str, Any], channels: Floats, proportion: npt.ArrayLike = ()) -> Floats:
    """Compute points (N, P, 3), in statures relative to frame 0's origin, from channel values (N, M).

    proportion : scores (N, l) or (l,) of the limbs' proportions.
    """
    rotations, origins, scale = frames(sections, channels, proportion)
    frame = np.asarray(sections["PTNI"])
    local = np.asarray(sections["PTNF"], float) * scale[:, frame, None]
    return origins[:, frame] + np.einsum("npij,npj->npi", rotations[:, frame], local)


def frames(
    sections: Mapping[str, Any], channels: Floats, proportion: npt.ArrayLike = ()
) -> tuple[Floats, Floats, Floats]:
    """Compute rotations (N, F, 3, 3), origins (N, F, 3) in statures, and scales (N, F) of all frames.

    Frame 0 is at the origin; a scale is the factor of the lengths given in a frame.
    """
    links, offsets = np.asarray(sections["FRMI"]), np.asarray(sections["FRMF"], float)
    n = len(channels)
    rotations, origins = np.empty((n, len(links), 3, 3)), np.empty((n, len(links), 3))
    scale = np.broadcast_to(length_change(sections, proportion)[:, :-1], (n, len(links)))
    shift = origin_shift(sections, proportion)
    for i, link in enumerate(links):
        parent = int(link[0])
        rotation = np.broadcast_to(np.eye(3), (n, 3, 3)) if parent < 0 else rotations[:, parent]
        if parent < 0:
            origins[:, i] = 0
        else:
            local = scale[:, parent, None] * offsets[i] + shift[:, i]
            origins[:, i] = origins[:, parent] + np.einsum("nij,nj->ni", rotation, local)
        for axis, channel in link[2 : 2 + 2 * link[1]].reshape(-1, 2):
            rotation = rotation @ axis_rotation(abs(axis) - 1, np.sign(axis) * channels[:, channel])
        rotations[:, i] = rotation
    return rotations, origins, scale


def length_change(sections: Mapping[str, Any], proportion: npt.ArrayLike) -> Floats:
    """Factors (N, F + 1) of lengths in each frame and of the pelvis's height, for scores (N, l) or (l,)."""
    score = np.atleast_2d(np.asarray(proportion, float))
    table = np.asarray(sections.get("PROP", np.zeros((0, len(sections["FRMI"]) + 1))), float)
    return np.asarray(1 + score @ table[: score.shape[1]])


def origin_shift(sections: Mapping[str, Any], proportion: npt.ArrayLike) -> Floats:
    """Shifts (N, F, 3) of the frames' origins in their parents, statures, for scores (N, l) or (l,)."""
    score = np.atleast_2d(np.asarray(proportion, float))
    table = np.asarray(sections.get("SHFT", np.zeros((0, len(sections["FRMI"]), 3))), float)
    used = table[: score.shape[1]]
    return np.asarray(np.einsum("nk,kfi->nfi", score[:, : len(used)], used), float)


def axis_rotation(axis: int, angle: npt.ArrayLike) -> Floats:
    """Make rotations (..., 3, 3) by angles (...) about an axis: 0 = x, 1 = y, 2 = z."""
    angle = np.asarray(angle, float)
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.zeros((*angle.shape, 3, 3))
    u, v = (axis + 1) % 3, (axis + 2) % 3
    matrix[..., axis, axis] = 1
    matrix[..., u, u] = matrix[..., v, v] = c
    matrix[..., u, v], matrix[..., v, u] = -s, s
    return matrix


def root_columns(sections: Mapping[str, Any]) -> list[int]:
    """Columns of the channels that heading, pitch and roll of a state add to."""
    names = blobs.unpack_names(sections["CHNM"])
    return [names.index(f"root_{name}") for name in ("yaw", "pitch", "roll")]
