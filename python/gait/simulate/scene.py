"""The empty scene: ground, facade, boxes, bushes and perhaps a pole, ray-cast once per clip.

Everything stands behind the walker except the pole.  Light is kept in two layers, ambient and direct, so that
the walker's shadow can take away the direct one.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.simulate import paint
from gait.simulate.arrays import Array, Floats
from gait.simulate.layout import Block, Layout
from gait.simulate.leaves import draw_bush
from gait.simulate.paint import AMBIENT, SUN
from gait.simulate.wardrobe import linear

_SAMPLES = 2  # rays per pixel, each way


@dataclass(frozen=True)
class Scene:
    """Pictures of the empty scene at the clip's size.

    Attributes
    ----------
    ambient, direct : ndarray of shape (h, w, 3)
        Linear light; their sum is the plate.
    position : ndarray of shape (h, w, 3)
        World place of each pixel's surface, metres; far away for the sky.
    front : ndarray of shape (h, w)
        Share of the pixel covered by something in front of the walker.
    to_sun : ndarray of shape (3,)
        Unit vector.
    """

    ambient: Floats
    direct: Floats
    position: Floats
    front: Floats
    to_sun: Array

    @property
    def plate(self) -> Floats:
        """The empty scene in linear light."""
        return self.ambient + self.direct


class _Caster:
    """Nearest surface along every ray, at `_SAMPLES` times the camera's size."""

    def __init__(self, camera: Camera) -> None:
        fine = camera.scaled(_SAMPLES)
        u, v = np.meshgrid(np.arange(fine.width), np.arange(fine.height))
        plane = np.stack([(u - fine.cx) / fine.fx, (v - fine.cy) / fine.fy, np.ones(u.shape)], axis=-1)
        self.camera, self.origin = fine, camera.centre
        self.ray = (plane @ fine.R).astype(np.float32)  # depth 1 along the optical axis
        self.depth = np.full(u.shape, np.inf, np.float32)
        self.albedo = np.zeros((*u.shape, 3), np.float32)
        self.facing = np.zeros(u.shape, np.float32)  # cosine to the sun
        self.open = np.ones(u.shape, np.float32)  # share of the sky that lights it

    def position(self) -> Floats:
        """World places (h, w, 3) of what was hit."""
        far = np.minimum(self.depth, 1e4)[..., None]
        return self.ray * far + self.origin.astype(np.float32)

    def plane(self, axis: int, level: float) -> tuple[Floats, Floats]:
        """Return depth and world places where rays meet a plane across world axis `axis`."""
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = (level - self.origin[axis]) / self.ray[..., axis]
        depth = np.where(depth > 0.05, depth, np.inf).astype(np.float32)
        return depth, self.ray * np.minimum(depth, 1e4)[..., None] + self.origin.astype(np.float32)

    def put(
        self, hit: NDArray[np.bool_], depth: Floats, albedo: Floats, facing: float, sky: Floats | float = 1.0,
        box: tuple[slice, slice] = (slice(None), slice(None)),
    ) -> None:  # fmt: skip
        """Keep a surface, given in the window `box`, where it is nearer than what is there."""
        hit = hit & (depth < self.depth[box])
        self.depth[box][hit], self.albedo[box][hit], self.facing[box][hit] = depth[hit], albedo[hit], facing
        self.open[box][hit] = sky[hit] if isinstance(sky, np.ndarray) else sky


def build_scene(camera: Camera, layout: Layout, rng: np.random.Generator) -> Scene:
    """Paint the scene of `layout` as `camera` sees it."""
    cast = _Caster(camera)
    sun = layout.to_sun
    _paint_sky(cast, rng)
    _paint_ground(cast, layout, rng)
    _paint_wall(cast, layout, rng)
    for block in layout.blocks:
        _paint_block(cast, block, sun, rng)
    position = cast.position()
    lit = _sunlit(position, layout)
    ambient = cast.albedo * (AMBIENT * cast.open)[..., None]
    direct = cast.albedo * (SUN * np.maximum(cast.facing, 0) * lit)[..., None]
    bare = ~np.isfinite(cast.depth)
    ambient[bare], direct[bare] = cast.albedo[bare], 0
    for bush in layout.bushes:
        draw_bush(ambient, direct, cast.depth, cast.camera, bush, sun, rng)
    front = np.zeros(cast.depth.shape, np.float32)
    if layout.pole is not None:
        front = _paint_pole(ambient, direct, cast, layout.pole, sun)

    def reduce(layer: Floats, how: int = cv2.INTER_AREA) -> Floats:
        return np.asarray(cv2.resize(layer, camera.size, interpolation=how), np.float32)

    place = reduce(position, cv2.INTER_NEAREST)
    return Scene(reduce(ambient), reduce(direct), place, reduce(front), sun)


def _paint_sky(cast: _Caster, rng: np.random.Generator) -> None:
    level = np.linalg.norm(cast.ray[..., :2], axis=-1)
    azimuth = np.arctan2(cast.ray[..., 0], cast.ray[..., 1])
    cast.albedo[:] = paint.sky(rng)(azimuth, cast.ray[..., 2] / np.maximum(level, 1e-3))


def _paint_ground(cast: _Caster, layout: Layout, rng: np.random.Generator) -> None:
    """Paint pavement, and a strip of another kind along the wall behind a kerb."""
    depth, at = cast.plane(2, 0.0)
    turn = layout.paving_turn
    u = (at[..., 0] * np.cos(turn) - at[..., 1] * np.sin(turn)).astype(np.float32)
    v = (at[..., 0] * np.sin(turn) + at[..., 1] * np.cos(turn)).astype(np.float32)
    colour = getattr(paint, layout.paving)(rng)(u, v)
    strip = getattr(paint, layout.strip)(rng)(at[..., 0], at[..., 1])
    edge = layout.wall_y - layout.strip_width
    kerb = np.clip(1 + 0.06 * paint.Noise(rng)(at[..., 0], at[..., 1], 2.0), 0.6, 1.3)[..., None] * linear(
        (172, 168, 160)
    )
    colour = np.where((at[..., 1] > edge)[..., None], strip, colour)
    colour = np.where((np.abs(at[..., 1] - edge) < 0.07)[..., None], kerb, colour).astype(np.float32)
    corner = 1 - 0.55 * np.exp(-np.maximum(layout.wall_y - at[..., 1], 0) / 0.35)
    for block in layout.blocks:
        corner *= 1 - 0.45 * np.exp(-np.maximum(block.distance(at), 0) / 0.12)
    cast.put(np.isfinite(depth), depth, colour, float(layout.to_sun[2]), corner.astype(np.float32))


def _paint_wall(cast: _Caster, layout: Layout, rng: np.random.Generator) -> None:
    """Paint the facade with its windows, shutters and doors."""
    depth, at = cast.plane(1, layout.wall_y)
    u, v = np.ascontiguousarray(at[..., 0]), np.ascontiguousarray(at[..., 2])
    colour = getattr(paint, layout.wall)(rng)(u, v)
    for panel in layout.panels:
        inside = (u > panel.left) & (u < panel.right) & (v > panel.low) & (v < panel.high)
        if inside.any():
            box = _bounds(inside)
            colour[box][inside[box]] = panel.paint(rng)(u[box], v[box])[inside[box]]
    foot = 1 - 0.4 * np.exp(-np.maximum(v, 0) / 0.4)
    hit = np.isfinite(depth) & (v >= 0) & (v < layout.wall_height)
    cast.put(hit, depth, colour, float(-layout.to_sun[1]), foot.astype(np.float32))


def _paint_block(cast: _Caster, block: Block, sun: Array, rng: np.random.Generator) -> None:
    """Paint the faces of a box that look towards the camera."""
    finish = getattr(paint, block.finish)(rng)
    for axis, other in ((0, 1), (1, 0), (2, 0)):
        upper = cast.origin[axis] > 0.5 * (block.low[axis] + block.high[axis])
        depth, at = cast.plane(axis, float(block.high[axis] if upper else block.low[axis]))
        inside = np.isfinite(depth)
        for k in {0, 1, 2} - {axis}:
            inside &= (at[..., k] > block.low[k]) & (at[..., k] < block.high[k])
        if not inside.any():
            continue
        rise, box = 1 if axis == 2 else 2, _bounds(inside)
        colour = finish(at[..., other][box], at[..., rise][box])
        facing = float(sun[axis] * (1 if upper else -1))
        cast.put(inside[box], depth[box], (colour * block.tint).astype(np.float32), facing, 1.0, box)


def _bounds(mask: NDArray[np.bool_]) -> tuple[slice, slice]:
    """Return the smallest window that holds all of a mask."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)


def _sunlit(position: Floats, layout: Layout) -> Floats:
    """Return 0 where a box shades the surface from the sun, 1 elsewhere; (h, w)."""
    lit = np.ones(position.shape[:2], np.float32)
    sun = layout.to_sun.astype(np.float32)
    solid = [*layout.blocks]
    if layout.pole is not None:
        solid.append(layout.pole)
    for block in solid:
        enter = np.full(lit.shape, 1e-3, np.float32)
        leave = np.full(lit.shape, 1e3, np.float32)
        for k in range(3):
            one, two = (block.low[k] - position[..., k]) / sun[k], (block.high[k] - position[..., k]) / sun[k]
            enter, leave = np.maximum(enter, np.minimum(one, two)), np.minimum(leave, np.maximum(one, two))
        lit[(leave > enter) & (leave > 0.02)] = 0
    return np.asarray(cv2.GaussianBlur(lit, (0, 0), 1.5), np.float32)


def _paint_pole(ambient: Floats, direct: Floats, cast: _Caster, pole: Block, sun: Array) -> Floats:
    """Draw an upright cylinder; return the share of each fine pixel it covers."""
    centre = 0.5 * (pole.low + pole.high)
    radius = 0.5 * (pole.high[0] - pole.low[0])
    flat = cast.ray[..., :2]
    to = (centre - cast.origin)[:2]
    a, b = (flat**2).sum(-1), flat @ to.astype(np.float32)
    inside = b * b - a * (float(to @ to) - radius**2)
    depth = (b - np.sqrt(np.maximum(inside, 0))) / a
    height = cast.origin[2] + cast.ray[..., 2] * depth
    hit = (inside > 0) & (depth > 0.1) & (height > 0) & (height < pole.high[2])
    normal = (flat * depth[..., None] - to.astype(np.float32))[hit] / radius
    light = np.maximum(normal @ sun[:2].astype(np.float32), 0)[:, None]
    band = np.where((np.mod(height[hit], 0.9) < 0.06)[:, None], 0.5, 1.0)
    colour = (pole.tint * band).astype(np.float32)
    ambient[hit], direct[hit] = AMBIENT * colour, SUN * light * colour
    return hit.astype(np.float32)
