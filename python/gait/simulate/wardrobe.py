"""Appearance of a walking person: cut, colours and patterns of the clothes, skin, hair, face."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from gait.simulate.geometry import Array, Floats

TOP, LEGS, SKIN, FACE, HAIR, SHOE, SOLE, SOCK = range(8)
TEXTURE_SIZE = 256  # texels of a texture, square
CLOTH_TILE = 0.40  # metres of cloth in one texture

_SKINS = ((224, 178, 150), (205, 155, 122), (168, 117, 86), (120, 80, 58), (236, 196, 170))
_HAIRS = ((38, 28, 24), (70, 46, 30), (112, 78, 48), (150, 120, 84), (20, 18, 20))
_TOPS = (
    *((176, 52, 46), (52, 88, 140), (70, 112, 78), (196, 188, 172)),
    *((120, 72, 110), (206, 150, 62), (60, 66, 78)),
)
_TROUSERS = ((46, 58, 86), (58, 56, 58), (120, 104, 80), (74, 84, 98), (94, 78, 66), (34, 36, 42))
_SHOES = ((44, 38, 36), (206, 204, 198), (96, 66, 44), (60, 64, 74))


@dataclass(frozen=True)
class Appearance:
    """Cut and colours of one person."""

    #: Girth factors, 1 = average.
    trunk: float
    limbs: float
    hips: float
    long_sleeves: bool
    long_hair: bool
    hem: float  #: length of the top below the pelvis joint, metres at 1.75 m stature
    loose: float  #: extra width of the trousers, 0 (slim) to 1
    tiles: Floats  #: (8, TEXTURE_SIZE, TEXTURE_SIZE, 3) linear RGB of each material, 0..1
    spans: Array  #: (8,) metres covered by one texture; 1 where texture coordinates run 0..1
    notes: dict[str, str]  #: descriptions for meta.json


def draw_appearance(rng: np.random.Generator) -> Appearance:
    """Draw girths within 15 %, a cut, colours and patterns."""
    top_pattern = str(rng.choice(["plain", "stripes", "checks", "weave"]))
    legs_pattern = str(rng.choice(["plain", "denim", "plain", "weave"]))
    skin, hair = _pick(_SKINS, rng), _pick(_HAIRS, rng)
    tiles = np.zeros((8, TEXTURE_SIZE, TEXTURE_SIZE, 3), np.float32)
    tiles[TOP] = _cloth(top_pattern, _pick(_TOPS, rng), rng)
    tiles[LEGS] = _cloth(legs_pattern, _pick(_TROUSERS, rng), rng)
    shoe = _pick(_SHOES, rng)
    for material, colour, grain in (
        (SKIN, skin, 0.04), (HAIR, hair, 0.25), (SHOE, shoe, 0.10), (SOLE, 0.4 * shoe + 0.35, 0.05),
        (SOCK, np.full(3, 0.12), 0.1),
    ):  # fmt: skip
        tiles[material] = colour * _grain(rng, grain)
    tiles[FACE] = _face(skin, hair, rng)
    spans = np.full(8, CLOTH_TILE)
    spans[FACE] = 1.0
    bounds = {"trunk": 0.11, "limbs": 0.12, "hips": 0.06}
    girths = {name: float(1 + rng.uniform(-half, half)) for name, half in bounds.items()}
    return Appearance(
        **girths, long_sleeves=bool(rng.uniform() < 0.65), long_hair=bool(rng.uniform() < 0.4),
        hem=float(rng.uniform(0.05, 0.11)), loose=float(rng.uniform()), tiles=tiles, spans=spans,
        notes={"top": top_pattern, "trousers": legs_pattern},
    )  # fmt: skip


def linear(rgb: object) -> Array:
    """Return linear light 0..1 of 8-bit display values; display = 255 sqrt(linear) throughout."""
    return (np.asarray(rgb, np.float64) / 255) ** 2


def tile_noise(rng: np.random.Generator, cells: tuple[int, int], size: int = TEXTURE_SIZE) -> Floats:
    """Return smooth noise (size, size) that tiles, mean 0, variance 1: `cells` bumps down and across."""
    coarse = rng.standard_normal(cells).astype(np.float32)
    wrapped = np.pad(coarse, 2, mode="wrap")
    step_y, step_x = size / cells[0], size / cells[1]
    y, x = np.mgrid[0:size, 0:size].astype(np.float32)
    field = cv2.remap(wrapped, x / step_x + 2, y / step_y + 2, cv2.INTER_CUBIC)
    return (field - field.mean()) / max(float(field.std()), 1e-6)


def _pick(table: tuple[tuple[int, int, int], ...], rng: np.random.Generator) -> Array:
    colour = np.array(table[int(rng.integers(len(table)))])
    tint = 1 + 0.07 * rng.uniform(-1, 1) + 0.015 * rng.standard_normal(3)
    return linear(np.clip(colour * tint, 8, 245))


def _grain(rng: np.random.Generator, depth: float) -> Floats:
    fine = tile_noise(rng, (64, 64)) + 0.7 * tile_noise(rng, (16, 16))
    return np.clip(1 + depth * fine, 0.2, 2)[..., None]


def _cloth(pattern: str, base: Array, rng: np.random.Generator) -> Floats:
    """Return a woven texture; rows run along the body."""
    second = base * rng.uniform(0.25, 0.55) if base.mean() > 0.12 else base * 2.6 + 0.1
    second = np.clip(second, 0, 1)
    y, x = np.mgrid[0:TEXTURE_SIZE, 0:TEXTURE_SIZE] / TEXTURE_SIZE
    share = np.zeros((TEXTURE_SIZE, TEXTURE_SIZE))
    if pattern == "stripes":
        count, width = int(rng.integers(4, 9)), rng.uniform(0.25, 0.5)
        share = _band((y * count) % 1.0, width)
    elif pattern == "checks":
        count = int(rng.integers(4, 8))
        share = 0.5 * _band((y * count) % 1.0, 0.45) + 0.5 * _band((x * count) % 1.0, 0.45)
    elif pattern == "weave":
        blotch = tile_noise(rng, (7, 7)) + 0.6 * tile_noise(rng, (19, 19))
        share = np.clip(0.5 + 1.5 * blotch, 0, 1) * 0.8
    colour = base + share[..., None] * (second - base)
    if pattern == "denim":
        threads = 1 + 0.16 * tile_noise(rng, (6, 90)) + 0.10 * tile_noise(rng, (90, 6))
        colour = colour * np.clip(threads, 0.5, 1.6)[..., None]
    folds = 1 + 0.10 * tile_noise(rng, (9, 4)) + 0.06 * tile_noise(rng, (4, 9))
    shaded = np.clip(colour, 0, 1) * np.clip(folds, 0.6, 1.4)[..., None]
    return (shaded * _grain(rng, 0.05)).astype(np.float32)


def _band(x: Array, width: float) -> Array:
    """Return 1 where 0 < x < width, with soft edges."""
    edge = 0.04
    return np.clip(x / edge, 0, 1) * np.clip((width - x) / edge, 0, 1)


def _face(skin: Array, hair: Array, rng: np.random.Generator) -> Floats:
    """Paint a face: lids, brows, mouth and cheeks; u = 0.5 is the front, v runs from the chin up."""
    face = np.tile(skin.astype(np.float32), (TEXTURE_SIZE, TEXTURE_SIZE, 1)) * _grain(rng, 0.03)
    picture = np.ascontiguousarray(face)

    def spot(u: float, v: float, ru: float, rv: float, colour: Array, share: float) -> None:
        mask = np.zeros((TEXTURE_SIZE, TEXTURE_SIZE), np.float32)
        centre = (round(u * TEXTURE_SIZE), round(v * TEXTURE_SIZE))
        radii = (max(round(ru * TEXTURE_SIZE), 1), max(round(rv * TEXTURE_SIZE), 1))
        cv2.ellipse(mask, centre, radii, 0, 0, 360, 1.0, -1, cv2.LINE_AA)
        mask = cv2.GaussianBlur(mask, (0, 0), 1.2)[..., None] * share
        picture[:] = picture * (1 - mask) + mask * colour.astype(np.float32)

    dark = np.full(3, 0.012)
    for sign in (-1, 1):
        spot(0.5 + sign * 0.060, 0.505, 0.034, 0.028, skin * 0.55, 0.8)
        spot(0.5 + sign * 0.060, 0.50, 0.022, 0.014, np.full(3, 0.6), 0.9)
        spot(0.5 + sign * 0.060, 0.50, 0.010, 0.014, dark, 1.0)
        spot(0.5 + sign * 0.062, 0.57, 0.034, 0.010, hair * 0.8, 0.9)
        spot(0.5 + sign * 0.075, 0.30, 0.040, 0.060, skin * [1.05, 0.8, 0.78], 0.5)
    spot(0.5, 0.165, 0.042, 0.014, skin * [0.75, 0.38, 0.36], 0.9)
    spot(0.5, 0.255, 0.022, 0.010, skin * 0.45, 0.6)
    return picture
