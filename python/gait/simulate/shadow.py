"""Shadows of the figure: the sun's view of it, and the darkening where its feet touch the ground."""

from __future__ import annotations

import cv2
import numpy as np

from gait.simulate.arrays import Floats, Ints
from gait.simulate.raster import rasterise
from gait.simulate.scene import Scene

_CELL = 0.0125  # metres per pixel of the sun's view
_BIAS = 0.025  # metres
_PENUMBRA = 1.6  # cells
_FOOT_CELL, _FOOT_SIDE = 0.02, 96


class SunView:
    """Parallel projection along the sun's rays, renewed for each frame."""

    def __init__(self, scene: Scene) -> None:
        z = scene.to_sun
        x = np.cross([0.0, 0.0, 1.0], z)
        x /= np.linalg.norm(x)
        self._axes = np.stack([x, np.cross(x, z), z]).astype(np.float32)  # right, down, towards the sun
        self._plate = scene.position @ self._axes.T
        self._nearest = np.zeros((1, 1), np.float32)
        self._corner = np.zeros(2, np.float32)
        self._centre = 0.0

    def look(self, vertices: Floats, faces: Ints) -> None:
        """Find what the sun sees of the figure."""
        seen = vertices @ self._axes.T
        self._corner = seen[:, :2].min(0) - np.float32(8 * _CELL)
        extent = seen[:, :2].max(0) - self._corner + 8 * _CELL
        width, height = (int(v) for v in np.ceil(extent / _CELL))
        hits = rasterise((seen[:, :2] - self._corner) / np.float32(_CELL), seen[:, 2], faces, width, height)
        self._nearest = np.full((height, width), -np.inf, np.float32)
        self._nearest[hits.row, hits.column] = np.einsum(
            "nk,nk->n", hits.weights, seen[:, 2][faces[hits.face]]
        )
        self._centre = float(seen[:, 2].mean())

    def visible(self, places: Floats, normals: Floats, shift: Floats) -> Floats:
        """Return 1 where places (n, 3) on the figure see the sun, 0 in its own shade; `shift` softens."""
        seen = (places + np.float32(0.012) * normals) @ self._axes.T
        at = np.rint((seen[:, :2] - self._corner) / np.float32(_CELL) + 2.5 * shift).astype(np.int32)
        rows, columns = self._nearest.shape
        inside = (at >= 0).all(1) & (at[:, 0] < columns) & (at[:, 1] < rows)
        depth = self._nearest[np.clip(at[:, 1], 0, rows - 1), np.clip(at[:, 0], 0, columns - 1)]
        return np.where(inside & (depth > seen[:, 2] + _BIAS), 0, 1).astype(np.float32)

    def cast(self) -> Floats:
        """Return how far the figure shades each pixel of the empty scene from the sun, 0..1, (h, w)."""
        mask = cv2.GaussianBlur(np.isfinite(self._nearest).astype(np.float32), (0, 0), _PENUMBRA)
        x = (self._plate[..., 0] - self._corner[0]) / np.float32(_CELL)
        y = (self._plate[..., 1] - self._corner[1]) / np.float32(_CELL)
        shade = cv2.remap(mask, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
        return shade * (self._plate[..., 2] < self._centre)


class Contact:
    """Loss of sky light on the ground close to the feet."""

    def __init__(self, position: Floats) -> None:
        self._x, self._y = position[..., 0].copy(), position[..., 1].copy()
        self._ground = np.abs(position[..., 2]) < 0.01

    def dark(self, vertices: Floats) -> Floats:
        """Return the share of light lost at each pixel, (h, w), for figure vertices (n, 3)."""
        low = vertices[vertices[:, 2] < 0.25]
        if not len(low):
            return np.zeros_like(self._x)
        corner = 0.5 * (low[:, :2].min(0) + low[:, :2].max(0)) - np.float32(0.5 * _FOOT_SIDE * _FOOT_CELL)
        cell = np.clip(((low[:, :2] - corner) / np.float32(_FOOT_CELL)).astype(int), 0, _FOOT_SIDE - 1)
        near = np.exp(-np.maximum(low[:, 2], 0) / 0.07)
        grid = np.zeros((_FOOT_SIDE, _FOOT_SIDE), np.float32)
        np.maximum.at(grid, (cell[:, 1], cell[:, 0]), near)
        grid = np.minimum(cv2.GaussianBlur(grid, (0, 0), 2.2) * 2.2, 1) * 0.6
        x, y = (self._x - corner[0]) / np.float32(_FOOT_CELL), (self._y - corner[1]) / np.float32(_FOOT_CELL)
        dark = cv2.remap(grid, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
        return np.asarray(dark * self._ground, np.float32)
