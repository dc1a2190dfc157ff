"""What stands where in the scene: drawn from the seed, always behind the walker as the camera sees it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from gait.camera.camera import Camera
from gait.simulate import paint
from gait.simulate.arrays import Array, Floats
from gait.simulate.wardrobe import linear


@dataclass(frozen=True)
class Block:
    """Box along the world axes: corners (3,) metres, name of its paint, colour factor (3,)."""

    low: Array
    high: Array
    finish: str
    tint: Array

    def distance(self, at: Floats) -> Floats:
        """Return the horizontal distance of places (h, w, 3) from the box, metres."""
        dx = np.maximum(self.low[0] - at[..., 0], at[..., 0] - self.high[0])
        dy = np.maximum(self.low[1] - at[..., 1], at[..., 1] - self.high[1])
        return np.hypot(np.maximum(dx, 0), np.maximum(dy, 0))


@dataclass(frozen=True)
class Panel:
    """Rectangle of another kind on the wall, metres."""

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


def draw_layout(camera: Camera, ground: Array, clutter: bool, pole: bool, rng: np.random.Generator) -> Layout:
    """Draw a yard or street behind the path.

    Parameters
    ----------
    camera : Camera
    ground : ndarray of shape (n, 2)
        The path on the ground, metres.
    clutter : bool
        More and stronger things behind the walker.
    pole : bool
        Stand a pole between camera and path.
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
    left, right = _seen(camera, wall_y)
    if tall:
        layout.panels = _panels(left, right, clutter, rng)
    else:
        layout.bushes += _hedge(left, right, wall_y + 0.6, layout.wall_height, rng)
    _furnish(layout, left, right, float(ground[:, 1].max()), clutter, rng)
    if pole:
        layout.pole = _pole(camera, ground, rng)
    return layout


def _seen(camera: Camera, y: float) -> tuple[float, float]:
    """Return the x range of the picture at the wall."""
    edge = camera.centre
    reach = (y - edge[1]) * 0.5 * camera.width / camera.fx
    return float(edge[0] - 1.1 * reach), float(edge[0] + 1.1 * reach)


def _panels(left: float, right: float, clutter: bool, rng: np.random.Generator) -> list[Panel]:
    """Place windows, with louvred shutters in clutter, a door, and boards."""
    pitch, wide = float(rng.uniform(2.0, 3.0)), float(rng.uniform(0.9, 1.3))
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
            panels += _window(at, wide, sill, tall, shutters) + _window(at, wide, sill + 3.1, tall, shutters)
        if clutter and rng.uniform() < 0.5 and pitch - wide > 1.3:
            middle = at + wide + 0.5 * (pitch - wide)
            panels.append(Panel(middle - 0.28, middle + 0.28, 1.2, 2.0, _poster))
        at += pitch
        number += 1
    return panels


def _window(left: float, wide: float, sill: float, tall: float, shutters: bool) -> list[Panel]:
    out = [Panel(left - 0.08, left + wide + 0.08, sill - 0.1, sill + tall + 0.08, _frame)]
    half, gap = 0.5 * wide, 0.035
    for k in (0, 1):
        for level in (0.0, 0.62):
            x, z = left + k * half, sill + level * tall
            top = sill + tall * (0.62 if level == 0 else 1)
            out.append(Panel(x + gap, x + half - gap, z + gap, top - gap, _glass))
    if shutters:
        out.append(
            Panel(left - 0.1 - 0.45 * wide, left - 0.1, sill - 0.05, sill + tall + 0.05, paint.louvres)
        )
        out.append(
            Panel(left + wide + 0.1, left + 0.1 + 1.45 * wide, sill - 0.05, sill + tall + 0.05, paint.louvres)
        )
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
    """Return trees that look over a low wall."""
    out, x = [], left
    while x < right:
        size = rng.uniform(0.9, 1.7)
        colour = linear((rng.uniform(70, 100), rng.uniform(98, 122), rng.uniform(50, 70)))
        out.append(
            Bush(
                np.array([x, y + 1.3 * size + rng.uniform(0, 1), low + rng.uniform(0, 1.0)]),
                np.full(3, size),
                colour,
            )
        )
        x += rng.uniform(0.9, 2.4)
    return out


def _furnish(
    layout: Layout, left: float, right: float, far: float, clutter: bool, rng: np.random.Generator
) -> None:
    """Put boxes and bushes between path and wall."""
    room = layout.wall_y - far
    slots = np.linspace(left, right, 11 if clutter else 6)
    for x in slots:
        if rng.uniform() < (0.2 if clutter else 0.4):
            continue
        x = float(x + rng.uniform(-0.3, 0.3))
        y = float(layout.wall_y - rng.uniform(0.25, 0.4 * room))
        kind = rng.choice(["bush", "box", "planter"])
        wide, high = rng.uniform(0.25, 0.55), rng.uniform(0.3, 0.9)
        if kind != "bush":
            tint = np.clip(1 + 0.3 * rng.uniform(-1, 1) + 0.08 * rng.standard_normal(3), 0.4, 1.5)
            finish = str(rng.choice(["planks", "plaster", "louvres"]))
            high = min(high, 0.45) if kind == "planter" else high
            low, top = np.array([x - wide, y - 0.22, 0]), np.array([x + wide, y + 0.22, high])
            layout.blocks.append(Block(low, top, finish, tint))
        if kind != "box":
            base = high if kind == "planter" else 0.0
            radii = np.array([wide * rng.uniform(0.8, 1.2), 0.3, rng.uniform(0.3, 0.75)])
            colour = linear((rng.uniform(66, 108), rng.uniform(96, 130), rng.uniform(46, 74)))
            layout.bushes.append(Bush(np.array([x, y, base + 0.8 * radii[2]]), radii, colour))


def _pole(camera: Camera, ground: Array, rng: np.random.Generator) -> Block:
    """Return a pole a little before the middle of the path, three quarters of the way from the lens."""
    aim = ground[int(len(ground) * rng.uniform(0.42, 0.58))]
    at = camera.centre[:2] + rng.uniform(0.66, 0.76) * (aim - camera.centre[:2])
    radius = float(rng.uniform(0.07, 0.10))
    low, high = np.array([*(at - radius), 0.0]), np.array([*(at + radius), 4.2])
    return Block(low, high, "plaster", linear((rng.uniform(90, 150),) * 3) * [1, 1.05, 1.0])
