"""The body of a simulated person: its own joints and proportions, and surfaces bound to its bones.

Nothing is shared with the tracker's model.  Surfaces are lofted through rings of superellipses, bound to
bones, and blended across joints.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from gait.body.skeleton import points
from gait.errors import UserError
from gait.io.blob import unpack_names
from gait.simulate.geometry import Array, Floats, Ints

SIDES = ("l", "r")

# bone: parent; each bone rotates about its joint in `JOINT_OF`
PARENT_BONES: dict[str, str | None] = {"pelvis": None, "torso": "pelvis", "head": "torso"}
JOINT_OF = {"pelvis": "pelvis", "torso": "spine", "head": "neck"}
for _s in SIDES:
    PARENT_BONES |= {
        f"{_s}_upper_arm": "torso",
        f"{_s}_forearm": f"{_s}_upper_arm",
        f"{_s}_hand": f"{_s}_forearm",
    }
    PARENT_BONES |= {f"{_s}_thigh": "pelvis", f"{_s}_shank": f"{_s}_thigh", f"{_s}_foot": f"{_s}_shank"}
    PARENT_BONES |= {f"{_s}_toes": f"{_s}_foot", f"{_s}_aid": f"{_s}_hand"}
    JOINT_OF |= {f"{_s}_upper_arm": f"{_s}_shoulder", f"{_s}_forearm": f"{_s}_elbow"}
    JOINT_OF |= {f"{_s}_hand": f"{_s}_wrist", f"{_s}_thigh": f"{_s}_hip", f"{_s}_shank": f"{_s}_knee"}
    JOINT_OF |= {f"{_s}_foot": f"{_s}_ankle", f"{_s}_toes": f"{_s}_toe"}
    JOINT_OF |= {f"{_s}_aid": f"{_s}_wrist"}  # a stick or crutch, held in the hand
BODY_BONES = tuple(PARENT_BONES)
BONE_INDEX = {name: i for i, name in enumerate(BODY_BONES)}

# reported point: the bone it is fixed to
POINT_BONE = {
    "pelvis": "pelvis", "neck": "head", "head_top": "head",
    "l_shoulder": "l_upper_arm", "r_shoulder": "r_upper_arm", "l_elbow": "l_forearm", "r_elbow": "r_forearm",
    "l_wrist": "l_hand", "r_wrist": "r_hand", "l_hip": "l_thigh", "r_hip": "r_thigh",
    "l_knee": "l_shank", "r_knee": "r_shank", "l_ankle": "l_foot", "r_ankle": "r_foot",
    "l_toe": "l_toes", "r_toe": "r_toes", "l_heel": "l_foot", "r_heel": "r_foot",
    "l_toetip": "l_toes", "r_toetip": "r_toes",
}  # fmt: skip
POINTS = tuple(POINT_BONE)

# mean adult proportions in statures; the segment lengths sum to a stature of 1 (see `_upright_height`)
_MEAN = {
    "ankle_height": 0.0465, "shank": 0.2430, "thigh": 0.2440, "hip_drop": 0.0070, "hip_half": 0.0520,
    "spine_up": 0.0560, "neck_up": 0.3020, "neck_forward": -0.0060, "head_up": 0.1575, "head_forward": 0.0060,
    "shoulder_up": 0.2560, "shoulder_half": 0.1010, "upper_arm": 0.1680, "forearm": 0.1480, "hand": 0.1040,
    "heel_back": 0.0330, "heel_up": 0.0140, "ball_forward": 0.0760, "ball_up": 0.0180, "toe_forward": 0.1180,
}  # fmt: skip
_UPRIGHT = ("ankle_height", "shank", "thigh", "hip_drop", "neck_up", "head_up")


@dataclass(frozen=True)
class Anatomy:
    """Lengths of one person."""

    stature: float  #: height of the top of the head above the ground in the rest pose, with shoes, metres
    lengths: dict[str, float]  #: keys of the proportions table, metres
    #: (3,) joints and reported points in the rest pose (limbs hang, feet forward; x forward, y left, z up)
    #: relative to the pelvis joint, metres.
    rest: dict[str, Array]

    def __getitem__(self, name: str) -> float:
        return self.lengths[name]

    @property
    def leg(self) -> float:
        """Length of the straight leg from hip to ankle, metres."""
        return self["thigh"] + self["shank"]


def draw_anatomy(stature: float, rng: np.random.Generator, model: Mapping[str, Any] | None = None) -> Anatomy:
    """Draw a person of `stature` metres: every proportion varies by about 4 % (standard deviation).

    `model`: sections of a blob; proportions that it describes are drawn from it instead.
    """
    share = {
        key: value * float(1 + 0.04 * np.clip(rng.standard_normal(), -2, 2)) for key, value in _MEAN.items()
    }
    if model is not None:
        share |= _learnt(model, rng)
    upright = sum(share[key] for key in _UPRIGHT)
    for key in _UPRIGHT:
        share[key] /= upright
    if model is None:
        share["shoulder_up"] = share["neck_up"] - _MEAN["neck_up"] + _MEAN["shoulder_up"]
    lengths = {key: value * stature for key, value in share.items()}
    return Anatomy(stature, lengths, _rest_pose(lengths))


def _learnt(model: Mapping[str, Any], rng: np.random.Generator) -> dict[str, float]:
    """Draw the proportions that a model describes, in statures."""
    count = len(model.get("PROP", ()))
    if not count:
        raise UserError("--body drawn: the package's model has no proportions; use --body table")
    scores = np.clip(rng.standard_normal(count), -2, 2)
    channels = len(unpack_names(model["CHNM"]))
    places = dict(
        zip(unpack_names(model["PTNM"]), points(model, np.zeros((1, channels)), scores)[0], strict=True)
    )

    def apart(a: str, b: str) -> float:
        return float(np.linalg.norm(places[a] - places[b]))

    ends = {
        "thigh": "hip knee",
        "shank": "knee ankle",
        "upper_arm": "shoulder elbow",
        "forearm": "elbow wrist",
    }
    out = {
        bone: 0.5 * sum(apart(*(f"{s}_{joint}" for joint in pair.split())) for s in SIDES)
        for bone, pair in ends.items()
    }
    for joint in ("hip", "shoulder"):
        out[f"{joint}_half"] = 0.5 * apart(f"l_{joint}", f"r_{joint}")
    high = {joint: float(places[joint][2]) for joint in ("l_hip", "l_shoulder", "neck", "head_top")}
    out |= {"hip_drop": -high["l_hip"], "shoulder_up": high["l_shoulder"], "neck_up": high["neck"]}
    return out | {"head_up": high["head_top"] - high["neck"]}


def _rest_pose(k: dict[str, float]) -> dict[str, Array]:
    """Place the joints of a person who stands with hanging arms, relative to the pelvis joint."""
    at = {
        "pelvis": (0.0, 0.0, 0.0),
        "spine": (-0.004, 0.0, k["spine_up"]),
        "neck": (k["neck_forward"], 0.0, k["neck_up"]),
        "head_top": (k["neck_forward"] + k["head_forward"], 0.0, k["neck_up"] + k["head_up"]),
    }
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        y = sign * k["shoulder_half"]
        at[f"{side}_shoulder"] = (-0.004, y, k["shoulder_up"])
        at[f"{side}_elbow"] = (-0.004, y, k["shoulder_up"] - k["upper_arm"])
        at[f"{side}_wrist"] = (-0.004, y, k["shoulder_up"] - k["upper_arm"] - k["forearm"])
        hip, y = -k["hip_drop"], sign * k["hip_half"]
        ground = hip - k["thigh"] - k["shank"] - k["ankle_height"]
        at[f"{side}_hip"] = (0.0, y, hip)
        at[f"{side}_knee"] = (0.0, y, hip - k["thigh"])
        at[f"{side}_ankle"] = (0.0, y, hip - k["thigh"] - k["shank"])
        at[f"{side}_heel"] = (-k["heel_back"], y, ground + k["heel_up"])
        at[f"{side}_toe"] = (k["ball_forward"], y, ground + k["ball_up"])
        at[f"{side}_toetip"] = (k["toe_forward"], y, ground + 0.7 * k["ball_up"])
    return {name: np.array(xyz) for name, xyz in at.items()}


@dataclass
class Part:
    """A piece of surface in the rest pose, relative to the pelvis joint, metres."""

    vertices: Array  #: (n, 3)
    faces: Ints  #: (m, 3) anticlockwise seen from outside
    uv: Array  #: (n, 2) texture coordinates: metres along the cloth, or 0..1 for a picture
    material: int  #: index of the texture
    #: (n, 2) the bone nearer to the trunk and the one it blends into, which rotates about its own joint.
    bones: Ints
    blend: Array  #: (n,) share of the second bone

    def bind(self, bone: str) -> Part:
        """Fix every vertex to one bone."""
        self.bones = np.full((len(self.vertices), 2), BONE_INDEX[bone], np.int32)
        self.blend = np.zeros(len(self.vertices))
        return self

    def bind_chain(self, bones: list[str], body: Anatomy, direction: ArrayLike, width: float) -> Part:
        """Bind along a limb: each vertex to the bone beside it, blended over `width` metres about each joint.

        `direction` (3,) points from the trunk outwards along the limb at rest.
        """
        self.bind(bones[0])
        inwards = -np.asarray(direction, np.float64)
        along = self.vertices @ inwards
        for first, second in zip(bones, bones[1:], strict=False):
            joint = body.rest[JOINT_OF[second]] @ inwards
            u = np.clip((joint + width / 2 - along) / width, 0, 1)
            hit = u > 0
            self.bones[hit] = [BONE_INDEX[first], BONE_INDEX[second]]
            self.blend[hit] = (u * u * (3 - 2 * u))[hit]
        return self


def refine(stations: ArrayLike, count: int) -> Array:
    """Return `count` rows between the rows of a table by monotone interpolation, evenly along its path.

    Rows are any numbers per ring; the first three are the ring's centre.
    """
    table = np.asarray(stations, np.float64)
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(table[:, :5], axis=0), axis=1) + 1e-9)])
    return PchipInterpolator(along, table)(np.linspace(0, along[-1], count))


def loft(
    stations: ArrayLike, count: int, segments: int, material: int, x_axis: ArrayLike, y_axis: ArrayLike
) -> Part:
    """Return the surface through superelliptic rings.

    `stations` (k, 6): per control ring: centre x, y, z, radius along `x_axis`, radius along `y_axis`,
    exponent (2 = ellipse, larger = squarer), metres. `count`, `segments`: rings and vertices per ring of the
    result. `x_axis`, `y_axis` (3,): directions of the ring's radii; their cross product must point from the
    first ring to the last, or the surface faces inwards.
    """
    rows = refine(stations, count)
    angle = 2 * np.pi * np.arange(segments + 1) / segments
    power = 2 / rows[:, 5:6]
    c, s = np.cos(angle), np.sin(angle)
    out_x = rows[:, 3:4] * np.sign(c) * np.abs(c) ** power
    out_y = rows[:, 4:5] * np.sign(s) * np.abs(s) ** power
    vertices = (
        rows[:, None, :3] + out_x[..., None] * np.asarray(x_axis) + out_y[..., None] * np.asarray(y_axis)
    )
    girth = np.pi * (rows[:, 3] + rows[:, 4]).max()
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(rows[:, :3], axis=0), axis=1))])
    uv = np.stack(np.broadcast_arrays(girth * angle[None] / (2 * np.pi), length[:, None]), axis=-1)
    part = Part(
        vertices.reshape(-1, 3), grid_faces(count, segments + 1), uv.reshape(-1, 2).copy(), material,
        np.zeros((count * (segments + 1), 2), np.int32), np.zeros(count * (segments + 1)),
    )  # fmt: skip
    return part


def grid_faces(rows: int, columns: int) -> Ints:
    """Return two triangles per cell of a grid of vertices stored row by row."""
    at = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]
    both = np.stack([np.stack([a, b, d], -1), np.stack([a, d, c], -1)], axis=2)
    return both.reshape(-1, 3)


@dataclass(frozen=True)
class Mesh:
    """All parts of a figure as flat arrays, with what is needed to pose them."""

    rest: Floats  # (n, 3) relative to the joint of the second bone
    normals: Floats  # (n, 3)
    uv: Floats  # (n, 2)
    faces: Ints  # (m, 3)
    material: Ints  # (m,)
    ring: Ints  # (n,) row of `pairs`
    pairs: Ints  # (r, 2) bones
    shares: Array  # (r,) share of the second bone

    def pose(self, origins: Array, turns: Array) -> tuple[Floats, Floats]:
        """Return vertices (n, 3) relative to the pelvis and normals (n, 3) for bones (b, 3), (b, 3, 3).

        Rotations are blended rather than positions, so that a bent knee keeps its girth.
        """
        a, b = self.pairs[:, 0], self.pairs[:, 1]
        turn = _blend(turns[a], turns[b], self.shares).astype(np.float32)
        joint = (origins[b] - origins[0]).astype(np.float32)
        each = turn[self.ring]
        vertices = np.einsum("nij,nj->ni", each, self.rest) + joint[self.ring]
        return vertices, np.einsum("nij,nj->ni", each, self.normals)


def _blend(a: Array, b: Array, share: Array) -> Array:
    """Interpolate rotations (r, 3, 3) from `a` to `b` by `share`; exact if both are equal."""
    mix = (1 - share)[:, None, None] * a + share[:, None, None] * b
    u, _, vt = np.linalg.svd(mix)
    return u @ vt


def merge(parts: list[Part], body: Anatomy) -> Mesh:
    """Join parts, compute smooth normals per part and group the vertices that move together."""
    joints = np.array([body.rest[JOINT_OF[bone]] for bone in BODY_BONES])
    vertices = np.concatenate([part.vertices for part in parts])
    bones = np.concatenate([part.bones for part in parts])
    blend = np.round(np.concatenate([part.blend for part in parts]), 2)
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=False)])
    material = np.concatenate([np.full(len(part.faces), part.material, np.int32) for part in parts])
    keys, ring = np.unique(
        np.column_stack([bones, np.round(blend * 100)]).astype(np.int64), axis=0, return_inverse=True
    )
    return Mesh(
        (vertices - joints[bones[:, 1]]).astype(np.float32),
        vertex_normals(vertices, faces).astype(np.float32),
        np.concatenate([part.uv for part in parts]).astype(np.float32),
        faces.astype(np.int32), material, ring.ravel().astype(np.int32), keys[:, :2].astype(np.int32),
        keys[:, 2] / 100,
    )  # fmt: skip


def vertex_normals(vertices: Array, faces: Ints) -> Array:
    """Return unit normals (n, 3), averaged over coincident vertices so that seams do not show."""
    corner = vertices[faces]
    flat = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    _, same = np.unique(np.round(vertices, 6), axis=0, return_inverse=True)
    same = same.ravel()
    total = np.zeros((same.max() + 1, 3))
    for k in range(3):
        np.add.at(total, same[faces[:, k]], flat)
    out = total[same]
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)
