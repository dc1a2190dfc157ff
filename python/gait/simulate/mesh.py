"""Lofted surfaces bound to bones: rings of superellipses joined by triangles, blended across joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from gait.simulate.anatomy import BONE_INDEX, BONES, JOINT_OF, Anatomy
from gait.simulate.arrays import Array, Floats, Ints


@dataclass
class Part:
    """A piece of surface in the rest pose, relative to the pelvis joint, metres.

    Attributes
    ----------
    vertices : ndarray of shape (n, 3)
    faces : ndarray of shape (m, 3)
        Anticlockwise seen from outside.
    uv : ndarray of shape (n, 2)
        Texture coordinates: metres along the cloth, or 0..1 for a picture.
    material : int
        Index of the texture.
    bones : ndarray of shape (n, 2)
        The bone towards the trunk and the one it blends into; the second turns about its own joint.
    blend : ndarray of shape (n,)
        Share of the second bone.
    """

    vertices: Array
    faces: Ints
    uv: Array
    material: int
    bones: Ints
    blend: Array

    def bind(self, first: str, second: str | None = None, blend: ArrayLike = 0.0) -> Part:
        """Fix every vertex to one bone, or blend it (n,) from `first` to its child `second`."""
        pair = [BONE_INDEX[first], BONE_INDEX[second or first]]
        self.bones = np.tile(np.array(pair, np.int32), (len(self.vertices), 1))
        self.blend = np.broadcast_to(np.asarray(blend, np.float64), (len(self.vertices),)).copy()
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

    Parameters
    ----------
    stations : array of shape (k, 6)
        Per control ring: centre x, y, z, radius along `x_axis`, radius along `y_axis`, exponent (2 = ellipse,
        larger = squarer), metres.
    count, segments : int
        Rings and vertices per ring of the result.
    x_axis, y_axis : array of shape (3,)
        Directions of the ring's radii; their cross product must point from the first ring to the last, or the
        surface faces inwards.
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

        The rotation is blended, not the positions, so that a bent knee keeps its girth.
        """
        a, b = self.pairs[:, 0], self.pairs[:, 1]
        turn = _blend(turns[a], turns[b], self.shares).astype(np.float32)
        joint = (origins[b] - origins[0]).astype(np.float32)
        each = turn[self.ring]
        vertices = np.einsum("nij,nj->ni", each, self.rest) + joint[self.ring]
        return vertices, np.einsum("nij,nj->ni", each, self.normals)


def _blend(a: Array, b: Array, share: Array) -> Array:
    """Return rotations (r, 3, 3) between `a` and `b`: `share` of the way, exact for equal ends."""
    mix = (1 - share)[:, None, None] * a + share[:, None, None] * b
    u, _, vt = np.linalg.svd(mix)
    return u @ vt


def merge(parts: list[Part], body: Anatomy) -> Mesh:
    """Join parts, compute smooth normals per part and group the vertices that move together."""
    joints = np.array([body.rest[JOINT_OF[bone]] for bone in BONES])
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
