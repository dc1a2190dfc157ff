"""Procedural surfaces of the scene: functions from metres on a plane to linear RGB."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from gait.simulate.geometry import Array, Floats
from gait.simulate.wardrobe import linear, tile_noise

Paint = Callable[[Floats, Floats], Floats]
"""(h, w) metres along and across -> (h, w, 3) linear RGB."""

AMBIENT, SUN = 0.42, 0.64  # light of the whole sky, and of the sun on a surface that faces it

_NOISE_SIZE = 512


class Noise:
    """Noise on the plane, mean 0, standard deviation about 1: fractal, or fine like the grain of stone."""

    def __init__(self, rng: np.random.Generator, fine: bool = False) -> None:
        weights = ((256, 1.0), (128, 0.6)) if fine else ((8, 1.0), (24, 0.6), (72, 0.4), (200, 0.3))
        octaves = [tile_noise(rng, (n, n), _NOISE_SIZE) * w for n, w in weights]
        field = np.sum(octaves, axis=0)
        self.field = np.pad(field / field.std(), ((0, 1), (0, 1)), mode="wrap").astype(np.float32)

    def __call__(self, u: Floats, v: Floats, metres: float) -> Floats:
        """Sample at (h, w) positions; the pattern repeats after `metres`."""
        scale = _NOISE_SIZE / metres
        x = np.mod(u * scale, _NOISE_SIZE).astype(np.float32)
        y = np.mod(v * scale, _NOISE_SIZE).astype(np.float32)
        return np.asarray(cv2.remap(self.field, x, y, cv2.INTER_LINEAR), np.float32)


def _tint(i: Floats, j: Floats, table: Array) -> Floats:
    """Look up a random number for every cell (i, j)."""
    at = (i.astype(np.int64) * 73 + j.astype(np.int64) * 157) & (len(table) - 1)
    return table[at].astype(np.float32)


def _joint(x: Floats, pitch: float, gap: float) -> tuple[Floats, Floats]:
    """Return cell number and 0 in the gap, 1 on the stone, with a soft edge."""
    cell = np.floor(x / pitch)
    inside = x - cell * pitch
    edge = np.minimum(inside, pitch - inside) - gap / 2
    return cell, np.clip(edge / (0.4 * gap) + 0.5, 0, 1)


def bricks(rng: np.random.Generator) -> Paint:
    """Return a brick wall in running bond."""
    noise, table = Noise(rng), rng.standard_normal(256)
    face = linear([(150, 82, 62), (128, 96, 82), (172, 142, 112), (112, 66, 58)][int(rng.integers(4))])
    mortar = linear((176, 170, 160))

    def paint(u: Floats, v: Floats) -> Floats:
        row, on_row = _joint(v, 0.078, 0.014)
        column, on_column = _joint(u + 0.11 * np.mod(row, 2), 0.22, 0.014)
        tone = 1 + 0.20 * _tint(column, row, table) + 0.12 * noise(u, v, 1.5) + 0.10 * noise(u, v, 9.0)
        brick = np.clip(tone, 0.3, 1.8)[..., None] * face
        stone = (on_row * on_column)[..., None]
        return (stone * brick + (1 - stone) * mortar * (1 + 0.1 * noise(u, v, 2.0))[..., None]).astype(
            np.float32
        )

    return paint


def plaster(rng: np.random.Generator) -> Paint:
    """Return rendered masonry with stains, darker at its foot."""
    noise = Noise(rng)
    colour = linear(
        [(206, 196, 176), (178, 186, 190), (212, 178, 142), (168, 172, 150)][int(rng.integers(4))]
    )

    def paint(u: Floats, v: Floats) -> Floats:
        streak = noise(u, v * 0.15, 2.5)
        tone = 1 + 0.07 * noise(u, v, 1.2) + 0.10 * noise(u, v, 7.0) + 0.07 * streak
        tone *= 1 - 0.35 * np.exp(-np.maximum(v, 0) / 0.25)
        return (np.clip(tone, 0.2, 1.5)[..., None] * colour).astype(np.float32)

    return paint


def louvres(rng: np.random.Generator) -> Paint:
    """Return horizontal slats."""
    noise, pitch = Noise(rng), float(rng.uniform(0.07, 0.16))
    colour = linear([(92, 112, 104), (150, 146, 136), (96, 74, 58), (186, 184, 176)][int(rng.integers(4))])

    def paint(u: Floats, v: Floats) -> Floats:
        inside = np.mod(v, pitch) / pitch
        tone = (0.35 + 0.75 * np.clip(inside * 1.3, 0, 1)) * (1 + 0.06 * noise(u * 0.2, v, 1.0))
        return (tone[..., None] * colour).astype(np.float32)

    return paint


def planks(rng: np.random.Generator) -> Paint:
    """Return upright boards."""
    noise, table, pitch = Noise(rng), rng.standard_normal(256), float(rng.uniform(0.10, 0.18))
    colour = linear([(134, 104, 74), (110, 98, 86), (156, 122, 84)][int(rng.integers(3))])

    def paint(u: Floats, v: Floats) -> Floats:
        board, on = _joint(u, pitch, 0.012)
        tone = 1 + 0.16 * _tint(board, board, table) + 0.16 * noise(u * 4, v * 0.35, 1.6)
        return (np.clip(tone * (0.25 + 0.75 * on), 0.1, 1.7)[..., None] * colour).astype(np.float32)

    return paint


def tiles(rng: np.random.Generator) -> Paint:
    """Return square or oblong paving stones."""
    noise, table = Noise(rng), rng.standard_normal(256)
    side = float(rng.uniform(0.35, 0.6))
    long = side * float(rng.choice([1.0, 1.5]))
    colour = linear(
        [(166, 160, 150), (150, 144, 142), (176, 158, 136), (140, 146, 150)][int(rng.integers(4))]
    )

    def paint(u: Floats, v: Floats) -> Floats:
        row, on_row = _joint(v, side, 0.014)
        column, on_column = _joint(u + 0.5 * long * np.mod(row, 2), long, 0.014)
        tone = 1 + 0.09 * _tint(column, row, table) + 0.07 * noise(u, v, 1.3) + 0.10 * noise(u, v, 11.0)
        return (np.clip(tone * (0.55 + 0.45 * on_row * on_column), 0.2, 1.6)[..., None] * colour).astype(
            np.float32
        )

    return paint


def asphalt(rng: np.random.Generator) -> Paint:
    """Return rolled asphalt with patches."""
    noise, grain = Noise(rng), Noise(rng, fine=True)
    colour = linear((118, 118, 120)) * rng.uniform(0.75, 1.25)

    def paint(u: Floats, v: Floats) -> Floats:
        speckle = 0.20 * grain(u, v, 5.3) + 0.10 * noise(u, v, 3.1)
        tone = 1 + speckle + 0.06 * noise(u, v, 9.0) - 0.12 * (noise(u, v, 23.0) > 1.0)
        return (np.clip(tone, 0.3, 1.7)[..., None] * colour).astype(np.float32)

    return paint


def grass(rng: np.random.Generator) -> Paint:
    """Return a lawn."""
    noise, colour = Noise(rng), linear((96, 120, 62))
    dry = linear((150, 140, 88))

    def paint(u: Floats, v: Floats) -> Floats:
        tone = np.clip(1 + 0.30 * noise(u, v, 0.7) + 0.15 * noise(u, v, 4.0), 0.3, 2)
        share = np.clip(0.25 + 0.25 * noise(u, v, 6.0), 0, 1)[..., None]
        return (tone[..., None] * (colour + share * (dry - colour))).astype(np.float32)

    return paint


def sky(rng: np.random.Generator) -> Paint:
    """Return sky by direction: u = azimuth, v = elevation (tangents)."""
    noise = Noise(rng)
    blue, pale, white = linear((128, 166, 212)), linear((196, 212, 226)), linear((236, 236, 234))

    def paint(u: Floats, v: Floats) -> Floats:
        high = np.clip(v / 0.6, 0, 1)[..., None]
        cloud = np.clip(0.35 * noise(u, v * 2.5, 3.0) + 0.1, 0, 0.8)[..., None]
        clear = pale + high * (blue - pale)
        return (clear + cloud * (white - clear)).astype(np.float32)

    return paint
