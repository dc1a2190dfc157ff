"""Bushes and trees as a few hundred leaves, painted from back to front."""

from __future__ import annotations

import cv2
import numpy as np

from gait.camera.camera import Camera
from gait.simulate.arrays import Array, Floats
from gait.simulate.layout import Bush
from gait.simulate.paint import AMBIENT, SUN

_LEAVES_PER_M2 = 1600
_LEAF = 0.045  # metres


def draw_bush(
    ambient: Floats,
    direct: Floats,
    behind: Floats,
    camera: Camera,
    bush: Bush,
    sun: Array,
    rng: np.random.Generator,
) -> None:
    """Paint one bush into both layers of light where it is nearer than the depths `behind`."""
    area = np.pi * bush.radii[0] * bush.radii[2]
    count = int(min(_LEAVES_PER_M2 * area, 5000)) + 60
    out = rng.standard_normal((count, 3))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    lump = 1 + 0.22 * np.sin(5 * out @ rng.standard_normal((3, 3)) + rng.uniform(0, 6, 3)).sum(1) / 1.7
    place = bush.centre + out * bush.radii * (lump * rng.uniform(0.55, 1.0, count) ** 0.4)[:, None]
    uv, depth = camera.project(place), camera.depth(place)
    pixel = np.clip(np.nan_to_num(uv).round().astype(int), 0, [camera.width - 1, camera.height - 1])
    keep = (place[:, 2] > 0.02) & (depth > 0.5) & (depth < behind[pixel[:, 1], pixel[:, 0]])
    uv, depth, out = uv[keep], depth[keep], out[keep]
    order = np.argsort(-depth)
    size = _LEAF * camera.fx / depth
    shade = np.clip(0.55 + 0.45 * out[:, 2] + 0.15 * rng.standard_normal(len(out)), 0.15, 1.2)
    lit = np.clip(out @ sun + 0.25 * rng.standard_normal(len(out)), 0, 1)
    tilt = rng.uniform(0, 180, len(out))
    slim = rng.uniform(0.35, 0.8, len(out))
    for i in order:
        centre = (round(float(uv[i, 0]) * 16), round(float(uv[i, 1]) * 16))
        axes = (max(round(size[i] * 16), 8), max(round(size[i] * slim[i] * 16), 8))
        for layer, light in ((ambient, AMBIENT * shade[i]), (direct, SUN * lit[i])):
            colour = tuple(float(c) for c in bush.colour * light)
            cv2.ellipse(layer, centre, axes, tilt[i], 0, 360, colour, -1, cv2.LINE_8, 4)
