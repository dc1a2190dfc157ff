"""Z-buffer for many small triangles, vectorised over their candidate pixels; one sample per pixel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gait.simulate.arrays import Floats, Ints


class Hits(NamedTuple):
    """The nearest surface at every covered pixel.

    Attributes
    ----------
    row, column : ndarray of shape (n,)
        Pixels, each once.
    face : ndarray of shape (n,)
        Triangle seen there.
    weights : ndarray of shape (n, 3)
        Barycentric weights of its corners in the picture plane.
    """

    row: Ints
    column: Ints
    face: Ints
    weights: Floats


def rasterise(xy: Floats, nearness: Floats, faces: Ints, width: int, height: int) -> Hits:
    """Find the visible triangle of every pixel.

    Parameters
    ----------
    xy : ndarray of shape (n, 2)
        Vertices in pixels, pixel centres at integers.
    nearness : ndarray of shape (n,)
        Larger is nearer, linear in the picture (1 / depth for a perspective camera).
    faces : ndarray of shape (m, 3)
        Triangles; those clockwise in a picture with v down (the back sides) are dropped.
    width, height : int
        Of the picture, pixels.
    """
    a, b, c = (xy[faces[:, k]] for k in range(3))
    area = _cross(b - a, c - a)
    front = np.flatnonzero(area < -1e-9)
    a, b, c, area = a[front], b[front], c[front], area[front]
    low = np.maximum(np.ceil(np.minimum(np.minimum(a, b), c)), 0).astype(np.int32)
    edge = np.array([width - 1, height - 1], np.float32)
    high = np.floor(np.minimum(np.maximum(np.maximum(a, b), c), edge)).astype(np.int32)
    size = high - low + 1
    seen = np.flatnonzero((size[:, 0] > 0) & (size[:, 1] > 0))
    x, y, which = _candidates(low[seen], size[seen])
    which = seen[which]
    weights = _weights(a, (b - a) / area[:, None], (c - a) / area[:, None], x, y, which)
    inside = np.flatnonzero(weights.min(0) >= 0)
    return _nearest(x[inside], y[inside], front[which[inside]], weights[:, inside], nearness, faces, width)


def _cross(a: Floats, b: Floats) -> Floats:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _candidates(low: Ints, size: Ints) -> tuple[Ints, Ints, Ints]:
    """List the pixels of every bounding box: column, row and index of the box."""
    count = size[:, 0] * size[:, 1]
    which = np.repeat(np.arange(len(count), dtype=np.int32), count)
    start = np.cumsum(count, dtype=np.int32) - count
    local = np.arange(int(count.sum()), dtype=np.int32) - start[which]
    wide = size[which, 0]
    row = local // wide
    return low[which, 0] + (local - row * wide), low[which, 1] + row, which


def _weights(a: Floats, ab: Floats, ac: Floats, x: Ints, y: Ints, which: Ints) -> Floats:
    """Return the barycentric weights (3, n) of pixels in triangles `which`; edges are given over the area."""
    px, py = x - a[which, 0], y - a[which, 1]
    second = px * ac[which, 1] - py * ac[which, 0]
    third = py * ab[which, 0] - px * ab[which, 1]
    return np.stack([1 - second - third, second, third])


def _nearest(
    x: Ints, y: Ints, face: Ints, weights: Floats, nearness: Floats, faces: Ints, width: int
) -> Hits:
    """Keep the nearest candidate of each pixel."""
    depth = np.einsum("kn,nk->n", weights, nearness[faces[face]])
    pixel = y * np.int32(width) + x
    order = np.lexsort((depth, pixel))
    last = order[np.flatnonzero(np.diff(pixel[order], append=-1))]
    return Hits(y[last], x[last], face[last].astype(np.int32), np.ascontiguousarray(weights[:, last].T))
