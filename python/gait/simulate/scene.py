"""The empty scene: ground, facade, boxes, bushes and perhaps a pole, ray-cast once per clip.

Everything except the pole is behind the person.  Light is stored in two layers, ambient and direct, so that
the person's shadow can remove the direct one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.simulate import paint
from gait.simulate.geometry import Array, Floats
from gait.simulate.paint import AMBIENT, SUN
from gait.simulate.wardrobe import linear


@dataclass(frozen=True)
class Block:
    """Box along the world axes: corners (3,) metres, name of its paint, colour factor (3,)."""

    low: Array
    high: Array
    finish: str
    tint: Array

    def distance(self, at: Floats) -> Floats:
        """Return the horizontal distance of positions (h, w, 3) from the box, metres."""
        dx = np.maximum(self.low[0] - at[..., 0], at[..., 0] - self.high[0])
        dy = np.maximum(self.low[1] - at[..., 1], at[..., 1] - self.high[1])
        return np.hypot(np.maximum(dx, 0), np.maximum(dy, 0))


@dataclass(frozen=True)
class Panel:
    """Rectangle on the wall with another paint, metres."""

    left: float
    right: float
    low: float
    high: float
    paint: Callable[[np.random.Generator], paint.Paint]


@dataclass(frozen=True)
class Bush:
    """Foliage: centre (3,) and radii (3,), metres; linear colour (3,)."""

    centre: Array
    radii: Array
    colour: Array


@dataclass
class Layout:
    """The plan of one scene, world metres."""

    to_sun: Array
    wall_y: float
    wall_height: float
    wall: str
    paving: str
    paving_turn: float
    strip: str
    strip_width: float
    panels: list[Panel] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)
    bushes: list[Bush] = field(default_factory=list)
    pole: Block | None = None


def draw_layout(
    camera: Camera,
    ground: Array,
    clutter: bool,
    pole: bool,
    rng: np.random.Generator,
    extent: tuple[float, float] | None = None,
) -> Layout:
    """Draw a yard or street behind the path.

    `ground` (n, 2): the path on the ground, metres; `clutter`: more and stronger objects behind the person;
    `pole`: put a pole between camera and path; `extent`: x range of the wall that a moving camera may show,
    metres, without objects that are painted randomly for each view.
    """
    wall_y = float(ground[:, 1].max() + rng.uniform(2.2, 3.4))
    side, high = rng.choice([-1.0, 1.0]), np.radians(rng.uniform(42, 58))
    azimuth = np.radians(rng.uniform(35, 65))
    sun = np.array([side * np.sin(azimuth) * np.cos(high), -np.cos(azimuth) * np.cos(high), np.sin(high)])
    tall = bool(rng.uniform() < 0.65) or clutter
    layout = Layout(
        sun, wall_y, 9.0 if tall else float(rng.uniform(1.9, 2.6)), str(rng.choice(["bricks", "plaster"])),
        str(rng.choice(["tiles", "asphalt", "tiles"])), float(rng.choice([0.0, np.pi / 4, 0.3])),
        str(rng.choice(["grass", "tiles", "asphalt"])), float(rng.uniform(0.7, 1.3)),
    )  # fmt: skip
    left, right = extent or _visible_range(camera, wall_y)
    if tall:
        layout.panels = _panels(left, right, clutter, rng)
    else:
        layout.bushes += _hedge(left, right, wall_y + 0.6, layout.wall_height, rng)
    _furnish(layout, left, right, float(ground[:, 1].max()), clutter, rng)
    if extent is not None:
        layout.bushes.clear()
    if pole:
        layout.pole = _pole(camera, ground, rng)
    return layout


def _visible_range(camera: Camera, y: float) -> tuple[float, float]:
    """Return the x range of the picture at the wall."""
    edge = camera.centre
    reach = (y - edge[1]) * 0.5 * camera.width / camera.fx
    return float(edge[0] - 1.1 * reach), float(edge[0] + 1.1 * reach)


def _panels(left: float, right: float, clutter: bool, rng: np.random.Generator) -> list[Panel]:
    """Place windows, with louvred shutters in clutter, a door, and boards."""
    pitch, breadth = float(rng.uniform(2.0, 3.0)), float(rng.uniform(0.9, 1.3))
    sill, tall = float(rng.uniform(0.85, 1.05)), float(rng.uniform(1.2, 1.6))
    panels, at = [], left + float(rng.uniform(0, pitch)) - pitch
    door = int(rng.integers(1, 4))
    number = 0
    while at < right:
        if number == door:
            panels.append(Panel(at - 0.1, at + 1.15, 0.0, 2.25, _frame))
            panels.append(Panel(at, at + 1.05, 0.0, 2.15, paint.planks))
        else:
            shutters = clutter or rng.uniform() < 0.3
            panels += _window(at, breadth, sill, tall, shutters) + _window(
                at, breadth, sill + 3.1, tall, shutters
            )
        if clutter and rng.uniform() < 0.5 and pitch - breadth > 1.3:
            middle = at + breadth + 0.5 * (pitch - breadth)
            panels.append(Panel(middle - 0.28, middle + 0.28, 1.2, 2.0, _poster))
        at += pitch
        number += 1
    return panels


def _window(left: float, breadth: float, sill: float, tall: float, shutters: bool) -> list[Panel]:
    out = [Panel(left - 0.08, left + breadth + 0.08, sill - 0.1, sill + tall + 0.08, _frame)]
    half, gap = 0.5 * breadth, 0.035
    for k in (0, 1):
        for level in (0.0, 0.62):
            x, z = left + k * half, sill + level * tall
            top = sill + tall * (0.62 if level == 0 else 1)
            out.append(Panel(x + gap, x + half - gap, z + gap, top - gap, _glass))
    if shutters:
        low, high = sill - 0.05, sill + tall + 0.05
        out.append(Panel(left - 0.1 - 0.45 * breadth, left - 0.1, low, high, paint.louvres))
        out.append(Panel(left + breadth + 0.1, left + 0.1 + 1.45 * breadth, low, high, paint.louvres))
    return out


def _frame(rng: np.random.Generator) -> paint.Paint:
    colour = linear((214, 210, 200)).astype(np.float32)
    return lambda u, v: np.broadcast_to(colour, (*u.shape, 3)).copy()


def _glass(rng: np.random.Generator) -> paint.Paint:
    """Return dark glass with a slanting reflection."""
    slope, offset = rng.uniform(0.4, 1.2), rng.uniform(0, 3)
    dark, bright = linear((52, 60, 66)), linear((122, 138, 150))

    def flat(u: Floats, v: Floats) -> Floats:
        share = np.clip(0.5 + 0.5 * np.sin(2.2 * (v + slope * u) + offset), 0, 1)[..., None] ** 2
        return (dark + share * (bright - dark)).astype(np.float32)

    return flat


def _poster(rng: np.random.Generator) -> paint.Paint:
    """Return a printed sheet: blocks of strong colour."""
    colours = linear(rng.uniform(50, 215, (4, 1)) + rng.uniform(-35, 35, (4, 3)))
    cuts = np.sort(rng.uniform(1.25, 1.95, 3))

    def sheet(u: Floats, v: Floats) -> Floats:
        return colours[np.searchsorted(cuts, v)].astype(np.float32)

    return sheet


def _hedge(left: float, right: float, y: float, low: float, rng: np.random.Generator) -> list[Bush]:
    """Return trees that are visible above a low wall."""
    out, x = [], left
    while x < right:
        size = rng.uniform(0.9, 1.7)
        colour = linear((rng.uniform(70, 100), rng.uniform(98, 122), rng.uniform(50, 70)))
        centre = np.array([x, y + 1.3 * size + rng.uniform(0, 1), low + rng.uniform(0, 1.0)])
        out.append(Bush(centre, np.full(3, size), colour))
        x += rng.uniform(0.9, 2.4)
    return out


def _furnish(
    layout: Layout, left: float, right: float, far: float, clutter: bool, rng: np.random.Generator
) -> None:
    """Put boxes and bushes between path and wall."""
    free = layout.wall_y - far
    slots = np.linspace(left, right, 11 if clutter else 6)
    for x in slots:
        if rng.uniform() < (0.2 if clutter else 0.4):
            continue
        x = float(x + rng.uniform(-0.3, 0.3))
        y = float(layout.wall_y - rng.uniform(0.25, 0.4 * free))
        kind = rng.choice(["bush", "box", "planter"])
        breadth, high = rng.uniform(0.25, 0.55), rng.uniform(0.3, 0.9)
        if kind != "bush":
            tint = np.clip(1 + 0.3 * rng.uniform(-1, 1) + 0.08 * rng.standard_normal(3), 0.4, 1.5)
            finish = str(rng.choice(["planks", "plaster", "louvres"]))
            high = min(high, 0.45) if kind == "planter" else high
            low, top = np.array([x - breadth, y - 0.22, 0]), np.array([x + breadth, y + 0.22, high])
            layout.blocks.append(Block(low, top, finish, tint))
        if kind != "box":
            base = high if kind == "planter" else 0.0
            radii = np.array([breadth * rng.uniform(0.8, 1.2), 0.3, rng.uniform(0.3, 0.75)])
            colour = linear((rng.uniform(66, 108), rng.uniform(96, 130), rng.uniform(46, 74)))
            layout.bushes.append(Bush(np.array([x, y, base + 0.8 * radii[2]]), radii, colour))


def _pole(camera: Camera, ground: Array, rng: np.random.Generator) -> Block:
    """Return a pole about two thirds of the way from the lens to a point near the middle of the path."""
    aim = ground[int(len(ground) * rng.uniform(0.42, 0.58))]
    at = camera.centre[:2] + rng.uniform(0.66, 0.76) * (aim - camera.centre[:2])
    radius = float(rng.uniform(0.07, 0.10))
    low, high = np.array([*(at - radius), 0.0]), np.array([*(at + radius), 4.2])
    return Block(low, high, "plaster", linear((rng.uniform(90, 150),) * 3) * [1, 1.05, 1.0])


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
    fixed = 16  # OpenCV's fixed-point steps per pixel
    at = np.rint(uv * fixed).astype(int)
    half = np.maximum(np.rint(np.stack([size * fixed, size * slim * fixed], axis=1)), 8).astype(int)
    sky, sunshine = (bush.colour * light[:, None] for light in (AMBIENT * shade, SUN * lit))
    leaves = (values[order].tolist() for values in (at, half, tilt, sky, sunshine))
    for centre, axes, turn, *colours in zip(*leaves, strict=True):
        for layer, colour in zip((ambient, direct), colours, strict=True):
            cv2.ellipse(layer, centre, axes, turn, 0, 360, colour, -1, cv2.LINE_8, 4)


_SAMPLES = 2  # rays per pixel in each direction; 1 for a moving camera, which casts them for each frame


@dataclass(frozen=True)
class Scene:
    """Pictures of the empty scene at the clip's size."""

    #: (h, w, 3) linear light; their sum is the plate.
    ambient: Floats
    direct: Floats
    position: Floats  #: (h, w, 3) position of each pixel's surface in the world, metres; far away for the sky
    front: Floats  #: (h, w) share of the pixel covered by something in front of the person
    to_sun: Array  #: (3,) unit vector

    @property
    def plate(self) -> Floats:
        """The empty scene in linear light."""
        return self.ambient + self.direct


_Coat = TypeVar("_Coat")


class Coats:
    """Paints of a scene, mixed in the order in which they are requested.

    `keep`: mix each only once, including those that are not visible, so that the same scene can be painted
    for every frame of a moving camera.
    """

    def __init__(self, rng: np.random.Generator, *, keep: bool = False) -> None:
        self.rng, self.keep = rng, keep
        self._mixed: list[Any] = []
        self._next = 0

    def restart(self) -> None:
        """Start again with the first paint."""
        self._next = 0

    def mix(self, make: Callable[[np.random.Generator], _Coat]) -> _Coat:
        """Return the next paint."""
        if self._next == len(self._mixed):
            self._mixed.append(make(self.rng))
        self._next += self.keep
        coat: _Coat = self._mixed[self._next - 1] if self.keep else self._mixed.pop()
        return coat


class _Caster:
    """Nearest surface along every ray, at `samples` times the camera's size."""

    def __init__(self, camera: Camera, samples: int) -> None:
        fine = camera.scaled(samples)
        u, v = np.meshgrid(np.arange(fine.width), np.arange(fine.height))
        plane = np.stack([(u - fine.cx) / fine.fx, (v - fine.cy) / fine.fy, np.ones(u.shape)], axis=-1)
        self.camera, self.origin = fine, camera.centre
        self.ray = (plane @ fine.R).astype(np.float32)  # depth 1 along the optical axis
        self.depth = np.full(u.shape, np.inf, np.float32)
        self.albedo = np.zeros((*u.shape, 3), np.float32)
        self.sun_cosine = np.zeros(u.shape, np.float32)  # cosine to the sun
        self.open = np.ones(u.shape, np.float32)  # share of the sky that lights it

    def position(self) -> Floats:
        """World positions (h, w, 3) of the points hit."""
        far = np.minimum(self.depth, 1e4)[..., None]
        return self.ray * far + self.origin.astype(np.float32)

    def plane(self, axis: int, level: float) -> tuple[Floats, Floats]:
        """Return depth and world positions where rays meet a plane perpendicular to world axis `axis`."""
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = (level - self.origin[axis]) / self.ray[..., axis]
        depth = np.where(depth > 0.05, depth, np.inf).astype(np.float32)
        return depth, self.ray * np.minimum(depth, 1e4)[..., None] + self.origin.astype(np.float32)

    def put(
        self, hit: NDArray[np.bool_], depth: Floats, albedo: Floats, cosine: float, sky: Floats | float = 1.0,
        box: tuple[slice, slice] = (slice(None), slice(None)),
    ) -> None:  # fmt: skip
        """Store a surface, given in the window `box`, where it is nearer than the present one."""
        hit = hit & (depth < self.depth[box])
        self.depth[box][hit], self.albedo[box][hit] = depth[hit], albedo[hit]
        self.sun_cosine[box][hit] = cosine
        self.open[box][hit] = sky[hit] if isinstance(sky, np.ndarray) else sky


def build_scene(camera: Camera, layout: Layout, coats: Coats) -> Scene:
    """Paint the scene of `layout` as `camera` sees it."""
    cast = _Caster(camera, 1 if coats.keep else _SAMPLES)
    sun = layout.to_sun
    coats.restart()
    _paint_sky(cast, coats)
    _paint_ground(cast, layout, coats)
    _paint_wall(cast, layout, coats)
    for block in layout.blocks:
        _paint_block(cast, block, sun, coats)
    position = cast.position()
    lit = _sunlit(position, layout)
    ambient = cast.albedo * (AMBIENT * cast.open)[..., None]
    direct = cast.albedo * (SUN * np.maximum(cast.sun_cosine, 0) * lit)[..., None]
    no_surface = ~np.isfinite(cast.depth)
    ambient[no_surface], direct[no_surface] = cast.albedo[no_surface], 0
    for bush in layout.bushes:
        draw_bush(ambient, direct, cast.depth, cast.camera, bush, sun, coats.rng)
    front = np.zeros(cast.depth.shape, np.float32)
    if layout.pole is not None:
        front = _paint_pole(ambient, direct, cast, layout.pole, sun)

    def reduce(layer: Floats, how: int = cv2.INTER_AREA) -> Floats:
        return np.asarray(cv2.resize(layer, camera.size, interpolation=how), np.float32)

    place = reduce(position, cv2.INTER_NEAREST)
    return Scene(reduce(ambient), reduce(direct), place, reduce(front), sun)


def _paint_sky(cast: _Caster, coats: Coats) -> None:
    level = np.linalg.norm(cast.ray[..., :2], axis=-1)
    azimuth = np.arctan2(cast.ray[..., 0], cast.ray[..., 1])
    cast.albedo[:] = coats.mix(paint.sky)(azimuth, cast.ray[..., 2] / np.maximum(level, 1e-3))


def _paint_ground(cast: _Caster, layout: Layout, coats: Coats) -> None:
    """Paint pavement, and a strip with another paint along the wall, behind a kerb."""
    depth, at = cast.plane(2, 0.0)
    turn = layout.paving_turn
    u = (at[..., 0] * np.cos(turn) - at[..., 1] * np.sin(turn)).astype(np.float32)
    v = (at[..., 0] * np.sin(turn) + at[..., 1] * np.cos(turn)).astype(np.float32)
    colour = coats.mix(getattr(paint, layout.paving))(u, v)
    strip = coats.mix(getattr(paint, layout.strip))(at[..., 0], at[..., 1])
    edge = layout.wall_y - layout.strip_width
    kerb = np.clip(1 + 0.06 * coats.mix(paint.Noise)(at[..., 0], at[..., 1], 2.0), 0.6, 1.3)[
        ..., None
    ] * linear((172, 168, 160))
    colour = np.where((at[..., 1] > edge)[..., None], strip, colour)
    colour = np.where((np.abs(at[..., 1] - edge) < 0.07)[..., None], kerb, colour).astype(np.float32)
    corner = 1 - 0.55 * np.exp(-np.maximum(layout.wall_y - at[..., 1], 0) / 0.35)
    for block in layout.blocks:
        corner *= 1 - 0.45 * np.exp(-np.maximum(block.distance(at), 0) / 0.12)
    cast.put(np.isfinite(depth), depth, colour, float(layout.to_sun[2]), corner.astype(np.float32))


def _paint_wall(cast: _Caster, layout: Layout, coats: Coats) -> None:
    """Paint the facade with its windows, shutters and doors."""
    depth, at = cast.plane(1, layout.wall_y)
    u, v = np.ascontiguousarray(at[..., 0]), np.ascontiguousarray(at[..., 2])
    colour = coats.mix(getattr(paint, layout.wall))(u, v)
    for panel in layout.panels:
        inside = (u > panel.left) & (u < panel.right) & (v > panel.low) & (v < panel.high)
        coat = coats.mix(panel.paint) if coats.keep or inside.any() else None
        if coat is not None and inside.any():
            box = _bounds(inside)
            colour[box][inside[box]] = coat(u[box], v[box])[inside[box]]
    foot = 1 - 0.4 * np.exp(-np.maximum(v, 0) / 0.4)
    hit = np.isfinite(depth) & (v >= 0) & (v < layout.wall_height)
    cast.put(hit, depth, colour, float(-layout.to_sun[1]), foot.astype(np.float32))


def _paint_block(cast: _Caster, block: Block, sun: Array, coats: Coats) -> None:
    """Paint the faces of a box that face the camera."""
    finish = coats.mix(getattr(paint, block.finish))
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
        cosine = float(sun[axis] * (1 if upper else -1))
        cast.put(inside[box], depth[box], (colour * block.tint).astype(np.float32), cosine, 1.0, box)


def _bounds(mask: NDArray[np.bool_]) -> tuple[slice, slice]:
    """Return the smallest window that contains a mask."""
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
