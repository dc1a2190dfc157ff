"""Z-buffer for many small triangles, vectorised over their candidate pixels; one sample per pixel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]

_MAX_SIDE = 4096.0  # a triangle wider than this in pixels is a mistake of the caller


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
    corner = xy[faces]
    ab, ac = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    low, high = np.ceil(corner.min(1)), np.floor(corner.max(1))
    low = np.maximum(low, 0)
    high = np.minimum(high, [width - 1, height - 1])
    size = high - low + 1
    seen = np.flatnonzero((area < -1e-9) & (size > 0).all(1) & (size < _MAX_SIDE).all(1))
    if not len(seen):
        empty = np.zeros(0, np.int32)
        return Hits(empty, empty, empty, np.zeros((0, 3), np.float32))
    x, y, which = _candidates(low[seen].astype(np.int32), size[seen].astype(np.int32))
    return _resolve(x, y, seen[which], corner, area, nearness[faces], width)


def _candidates(low: Ints, size: Ints) -> tuple[Ints, Ints, Ints]:
    """List the pixels of every bounding box: column, row and index of the box."""
    count = size[:, 0] * size[:, 1]
    which = np.repeat(np.arange(len(count), dtype=np.int32), count)
    start = np.cumsum(count, dtype=np.int32) - count
    local = np.arange(int(count.sum()), dtype=np.int32) - start[which]
    wide = size[which, 0]
    row = local // wide
    return low[which, 0] + (local - row * wide), low[which, 1] + row, which


def _resolve(x: Ints, y: Ints, face: Ints, corner: Floats, area: Floats, near: Floats, width: int) -> Hits:
    """Keep the candidates inside their triangle, then the nearest of each pixel."""
    a = corner[:, 0]
    ab, ac = corner[:, 1] - a, corner[:, 2] - a
    scale = 1 / area
    px, py = x - a[face, 0], y - a[face, 1]
    w1 = (px * (ac[:, 1] * scale)[face] - py * (ac[:, 0] * scale)[face]).astype(np.float32)
    w2 = (py * (ab[:, 0] * scale)[face] - px * (ab[:, 1] * scale)[face]).astype(np.float32)
    inside = np.flatnonzero((w1 >= 0) & (w2 >= 0) & (w1 + w2 <= 1))
    x, y, face, w1, w2 = x[inside], y[inside], face[inside], w1[inside], w2[inside]
    w0 = 1 - w1 - w2
    depth = w0 * near[face, 0] + w1 * near[face, 1] + w2 * near[face, 2]
    pixel = y.astype(np.int64) * width + x
    order = np.lexsort((depth, pixel))
    last = np.flatnonzero(np.diff(pixel[order], append=-1))
    keep = order[last]
    weights = np.stack([w0[keep], w1[keep], w2[keep]], axis=1)
    return Hits(y[keep], x[keep], face[keep].astype(np.int32), weights)
