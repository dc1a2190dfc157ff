"""Surfaces of arms, hands, legs and shoes.  Tables are centimetres for a stature of 1.75 m."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gait.simulate.anatomy import SIDES, Anatomy
from gait.simulate.mesh import Part, loft
from gait.simulate.wardrobe import LEGS, SHOE, SKIN, SOCK, SOLE, TOP, Look

X, Y, Z = np.eye(3)


def limb_parts(body: Anatomy, look: Look) -> list[Part]:
    """Return both arms and both legs."""
    parts = []
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        parts += _arm(side, sign, body, look) + _leg(side, sign, body, look) + _shoe(side, sign, body)
    return parts


def _scale(body: Anatomy) -> float:
    """Return metres per centimetre of the tables."""
    return 0.01 * body.stature / 1.75


def _down(
    side_at: np.ndarray, rows: Sequence[tuple[float, ...]], unit: float, girth: float, exponent: float
) -> np.ndarray:
    """Turn rows (height above the origin in metres, x shift, depth, width) into rings beside a joint."""
    out = [
        (side_at[0] + x * unit, side_at[1], z, d * unit * girth, w * unit * girth, exponent)
        for z, x, d, w in rows
    ]
    return np.array(out)


def _arm(side: str, sign: float, body: Anatomy, look: Look) -> list[Part]:
    cm, rest = _scale(body), body.rest
    shoulder = rest[f"{side}_shoulder"]
    s, e, w = (rest[f"{side}_{name}"][2] for name in ("shoulder", "elbow", "wrist"))
    chain = [f"{side}_{bone}" for bone in ("upper_arm", "forearm", "hand")]
    cap = [(s + 2.9 * cm, 0, 0.3, 0.3), (s + 2.5 * cm, 0, 2.4, 2.3), (s + 1.1 * cm, 0, 4.3, 4.0)]
    upper = [(s - 2.0 * cm, 0, 5.4, 4.8), (s - 6 * cm, 0, 5.4, 4.9), (s - 15 * cm, 0, 4.9, 4.6)]
    lower = [
        (e + 3 * cm, 0, 4.6, 4.4), (e, -0.2, 4.5, 4.3), (e - 6 * cm, 0, 4.6, 4.3),
        (e - 15 * cm, 0, 4.0, 3.7), (w + 4 * cm, 0, 3.6, 3.3), (w + 0.5 * cm, 0, 3.6, 3.3),
    ]  # fmt: skip
    short = [(s - 19 * cm, 0, 5.3, 5.2)]
    sleeve = cap + upper + (lower if look.long_sleeves else short)
    skin = [
        (s - 12 * cm, 0, 4.1, 3.8), (e + 4 * cm, 0, 3.8, 3.6), (e, -0.2, 3.8, 3.6),
        (e - 6 * cm, 0.1, 4.2, 3.7),
        (e - 15 * cm, 0, 3.4, 3.0), (w + 3 * cm, 0, 2.8, 2.2), (w - 1 * cm, 0, 2.8, 2.0),
    ]  # fmt: skip
    parts = [
        loft(_down(shoulder, sleeve, cm, look.limbs, 2.1), 34 if look.long_sleeves else 18, 16, TOP, -X, Y),
        loft(
            _down(shoulder, skin[5:] if look.long_sleeves else skin, cm, look.limbs, 2), 26, 14, SKIN, -X, Y
        ),
    ]
    for part in parts:
        part.bind_chain(chain, body, -Z, 7 * cm)
    return parts + _hand(side, sign, body)


def _hand(side: str, sign: float, body: Anatomy) -> list[Part]:
    cm, wrist = _scale(body) * body["hand"] / (0.104 * body.stature), body.rest[f"{side}_wrist"]
    rows = [
        (0, 0, 0.5, 2.7, 1.9), (0.2, 0, -3, 3.6, 1.9), (0.3, 0, -6.5, 4.1, 1.7), (0.2, 0.3, -10, 4.0, 1.4),
        (-0.1, 1.0, -13.5, 3.5, 1.2), (-0.6, 2.0, -16, 2.7, 1.0), (-0.9, 2.7, -17.4, 1.4, 0.6),
        (-1, 2.8, -17.7, 0.1, 0.1),
    ]  # fmt: skip
    thumb = [
        (1.6, 0.3, -2.2, 1.2, 1.1), (3.6, 0.9, -4.5, 1.5, 1.3), (4.8, 1.4, -7.5, 1.2, 1.1),
        (5.1, 1.7, -9.6, 0.8, 0.7),
        (5.1, 1.8, -10.2, 0.1, 0.1),
    ]  # fmt: skip
    parts = []
    for table, rings, segments in ((rows, 14, 14), (thumb, 8, 8)):
        stations = [
            (wrist[0] + x * cm, wrist[1] - sign * y * cm, wrist[2] + z * cm, a * cm, b * cm, 2.3)
            for x, y, z, a, b in table
        ]
        parts.append(loft(stations, rings, segments, SKIN, X, -Y).bind(f"{side}_hand"))
    return parts


def _leg(side: str, sign: float, body: Anatomy, look: Look) -> list[Part]:
    cm, rest, loose = _scale(body), body.rest, look.loose
    hip = rest[f"{side}_hip"]
    h, k, a = (rest[f"{side}_{name}"][2] for name in ("hip", "knee", "ankle"))
    rows = [
        (h + 3 * cm, -0.8, 4.6, 4.4), (h - 0.5 * cm, -0.5, 8.0, 7.2), (h - 5 * cm, -0.2, 9.1, 8.3),
        (h - 14 * cm, 0.3, 8.6, 8.0), (h - 27 * cm, 0.5, 7.3, 7.0), (k + 5 * cm, 0.5, 6.4, 6.2),
        (k, 0.4, 6.2, 6.0),
        (k - 6 * cm, -0.4, 6.1, 5.9), (k - 13 * cm, -1.1, 6.3, 5.9), (a + 14 * cm, -0.8, 5.4, 5.2),
        (a + 5 * cm, -0.4, 4.9, 4.7), (a - 1.0 * cm, 0, 5.3, 5.1),
    ]  # fmt: skip
    widen = np.interp(
        [z for z, *_ in rows], [a, k, h], [0.7 + 1.4 * loose, 0.3 + 0.8 * loose, 0.2 + 0.3 * loose]
    )
    rows = [(z, x, d + more, w + more) for (z, x, d, w), more in zip(rows, widen, strict=True)]
    trouser = loft(_down(hip, rows, cm, look.limbs, 2.15), 46, 22, LEGS, -X, Y)
    trouser.bind_chain(["pelvis", f"{side}_thigh", f"{side}_shank"], body, -Z, 12 * cm)
    sock = [(a + 7 * cm, -0.3, 4.2, 3.8), (a, -0.2, 4.2, 3.7), (a - 3 * cm, -0.2, 4.0, 3.6)]
    ankle = loft(_down(hip, sock, cm, 1.0, 2), 8, 14, SOCK, X, -Y)
    return [trouser, ankle.bind_chain([f"{side}_shank", f"{side}_foot"], body, -Z, 5 * cm)]


def _shoe(side: str, sign: float, body: Anatomy) -> list[Part]:
    """Return upper and sole; the tables follow this person's heel, ball and toe tip."""
    cm, ankle = _scale(body), body.rest[f"{side}_ankle"]
    ground = ankle[2] - body["ankle_height"]
    heel, ball, tip = -body["heel_back"] / cm, body["ball_forward"] / cm, body["toe_forward"] / cm
    high = body["ankle_height"] / cm
    upper = [
        (heel - 1.2, 3.6, 0.4, 0.8), (heel - 0.8, 4.0, 2.4, 3.4), (heel + 1.2, 4.5, 3.4, 4.4),
        (-1.5, 4.6, 3.8, 4.6),
        (2.5, high / 2, 3.9, high / 2), (6, 3.7, 4.2, 3.6), (ball - 2, 3.0, 4.7, 2.9),
        (ball + 1, 2.6, 4.8, 2.5),
        (tip - 3.5, 2.3, 4.3, 2.1), (tip - 0.8, 1.9, 2.9, 1.5), (tip + 0.3, 1.6, 0.4, 0.4),
    ]  # fmt: skip
    sole = [
        (heel - 1.4, 1.2, 0.4, 0.9), (heel - 0.9, 1.25, 2.6, 1.25), (heel + 1.5, 1.3, 3.6, 1.3),
        (2.5, 1.2, 3.7, 1.2),
        (ball - 3, 1.0, 4.7, 1.0), (ball + 1, 0.9, 5.0, 0.9), (tip - 3.0, 0.9, 4.4, 0.9),
        (tip - 0.5, 1.0, 2.9, 0.9),
        (tip + 0.5, 1.1, 0.4, 0.5),
    ]  # fmt: skip
    parts = []
    for table, rings, material, exponent in ((upper, 24, SHOE, 2.3), (sole, 18, SOLE, 4.0)):
        stations = [
            (ankle[0] + x * cm, ankle[1] + sign * 0.4 * cm, ground + z * cm, w * cm, h * cm, exponent)
            for x, z, w, h in table
        ]
        part = loft(stations, rings, 16, material, Y, Z)
        parts.append(part.bind_chain([f"{side}_foot", f"{side}_toes"], body, X, 4 * cm))
    return parts
