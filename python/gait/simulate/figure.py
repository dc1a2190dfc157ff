"""The surface of a simulated person: trunk, head, hair, arms, hands, legs, shoes, and creases in the clothes.

Tables are in centimetres, for a stature of 1.75 m.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import PchipInterpolator

from gait.simulate.body import SIDES, Anatomy, Mesh, Part, loft, merge, vertex_normals
from gait.simulate.wardrobe import FACE, HAIR, LEGS, SHOE, SKIN, SOCK, SOLE, TOP, Appearance

X, Y, Z = np.eye(3)

# height above the pelvis joint, forward shift, depth, width, exponent, shares of hips' and shoulders' girth
_TOP = (
    (2, -0.4, 12.3, 17.2, 2.4, 1, 0), (10, 0.3, 11.3, 15.2, 2.4, 0.5, 0), (18, 0.5, 11.6, 15.6, 2.4, 0, 0.3),
    (27, 0.6, 12.3, 16.6, 2.4, 0, 0.8), (34, 0.2, 11.9, 17.2, 2.3, 0, 1), (40, -0.5, 10.4, 17.6, 2.2, 0, 1),
    (44, -0.9, 8.6, 18.0, 2.1, 0, 1), (47.0, -1.1, 7.5, 17.0, 2.0, 0, 1),
    (49.2, -1.1, 6.7, 13.8, 2.0, 0, 0.7),
    (51.0, -0.9, 6.3, 9.6, 2, 0, 0.3), (52.8, -0.6, 6.2, 7.0, 2, 0, 0), (54.6, -0.2, 6.1, 6.2, 2, 0, 0),
    (54.4, -0.2, 5.3, 5.4, 2, 0, 0),
)  # fmt: skip
_SEAT = (
    (-10.5, -0.8, 3.0, 4.0), (-9.4, -0.8, 7.6, 9.5), (-6.5, -1.2, 10.6, 14.8), (-1, -1.4, 11.5, 16.4),
    (5, -0.6, 10.9, 15.6),
    (12, 0.2, 10.0, 14.0),
)  # fmt: skip
# height above the neck joint, forward shift, depth, width
_NECK = (
    *((-2.5, 0.4, 4.6, 5.2), (1, 0.1, 4.9, 5.0), (4, 0.5, 5.3, 5.2)),
    *((8, 0.7, 5.6, 5.4), (11, 0.4, 5.0, 5.0)),
)
_HEAD_OUTLINE = (
    (4.4, 4.6, 2.2, 2.2), (5.2, 4.1, 5.0, 3.9), (7.2, 3.0, 7.1, 5.3), (10.5, 2.2, 8.4, 6.5),
    (14.2, 1.7, 9.2, 7.2),
    (18, 1.3, 9.6, 7.5), (21.5, 1.0, 9.4, 7.4), (24.3, 0.8, 8.0, 6.3), (26.2, 0.7, 5.2, 4.2),
    (27.0, 0.7, 2.0, 1.7),
    (27.2, 0.7, 0.1, 0.1),
)  # fmt: skip
_NOSE = (
    *((10.6, 16.6, 0.4, 0.6), (11.1, 14, 0.9, 1.0), (11.7, 12.2, 1.5, 1.5)),
    *((11.4, 11.2, 1.0, 1.4), (10.8, 10.8, 0.2, 0.5)),
)
_EAR = ((11.2, 0.1, 0.1), (12, 1.2, 0.8), (14.5, 1.9, 1.0), (16.4, 1.8, 0.9), (17.2, 0.1, 0.1))
# azimuth from the front, degrees: height above the neck joint at which the hair ends
_LINE_AT = (0, 35, 60, 80, 100, 130, 180)
_SHORT, _LONG = (22.5, 22.0, 19.5, 16.0, 12.0, 8.5, 7.0), (22.5, 21.5, 16.0, 5.0, 1.0, -2.0, -3.0)


def trunk_parts(body: Anatomy, appearance: Appearance) -> list[Part]:
    """Return the top, the seat of the trousers, neck, head, nose, ears and hair."""
    cm = _scale(body)
    trunk = [_top(body, appearance, cm), _seat(body, appearance, cm)]
    return [*trunk, *_head(body, appearance, cm), _hair(body, appearance, cm)]


def _top(body: Anatomy, appearance: Appearance, cm: float) -> Part:
    """Return the shirt or jacket from hem to collar, stretched to this person's trunk."""
    tall = body["neck_up"] / (52.9 * cm)
    hem = 100 * appearance.hem
    rows = [(-hem, -0.2, 14.0, 18.9, 2.3, 1, 0), (-hem / 2, -0.4, 13.4, 18.3, 2.3, 1, 0), *_TOP]
    broad = body["shoulder_half"] / (17.7 * cm)
    thigh = 9.2 * appearance.limbs + appearance.loose
    breadth = body["hip_half"] / cm + 0.9 * thigh
    stations = []
    for z, x, d, w, n, low, high in rows:
        girth = appearance.trunk * (1 + low * (appearance.hips - 1))
        d, w = d * girth, w * (girth + high * (broad - girth))
        if z < 5:  # the hem hangs outside the moving thighs
            slack = np.interp(z, (0, 5), (1, 0.4))
            d, w = max(d, thigh + 4.5 * slack), max(w, breadth + 1.5 * slack)
        stations.append((x * cm, 0, z * cm * (tall if z > 0 else 1), d * cm, w * cm, n))
    part = loft(stations, 44, 36, TOP, -X, -Y)
    return part.bind_chain(["pelvis", "torso"], body, Z, 16 * cm)


def _seat(body: Anatomy, appearance: Appearance, cm: float) -> Part:
    girth = 0.94 * appearance.trunk * appearance.hips
    stations = [(x * cm, 0, z * cm, d * cm * girth, w * cm * girth, 2.3) for z, x, d, w in _SEAT]
    return loft(stations, 16, 30, LEGS, -X, -Y).bind_chain(["pelvis", "torso"], body, Z, 16 * cm)


def _head(body: Anatomy, appearance: Appearance, cm: float) -> list[Part]:
    neck = body.rest["neck"]
    cm = cm * body["head_up"] / (27.6 * cm)

    def ring(x: float, y: float, z: float, d: float, w: float) -> tuple[float, ...]:
        return (neck[0] + x * cm, y * cm, neck[2] + z * cm, d * cm, w * cm, 2.1)

    throat = loft([ring(x, 0, z, d, w) for z, x, d, w in _NECK], 10, 18, SKIN, X, Y)
    throat.bind_chain(["torso", "head"], body, Z, 6 * cm)
    skull = loft([ring(x, 0, z, d, w) for z, x, d, w in _HEAD_OUTLINE], 26, 28, FACE, -X, -Y)
    angle = np.arange(29) / 28
    skull.uv[:, 0] = np.tile(angle, 26)
    skull.uv[:, 1] = (skull.vertices[:, 2] - neck[2]) / (27.2 * cm) * 1.18 - 0.18
    nose = loft([ring(x, 0, z, d, w) for x, z, d, w in _NOSE], 8, 8, SKIN, X, -Y)
    parts = [skull, nose]
    for sign in () if appearance.long_hair else (1.0, -1.0):  # long hair covers the ears
        parts.append(loft([ring(0.6, sign * 7.4, z, d, w) for z, d, w in _EAR], 8, 8, SKIN, X, Y))
    return [throat, *(part.bind("head") for part in parts)]


def _hair(body: Anatomy, appearance: Appearance, cm: float) -> Part:
    """Return a cap a little larger than the skull that dives under the skin below the hairline."""
    neck = body.rest["neck"]
    cm = cm * body["head_up"] / (27.6 * cm)
    rows = [(z, x, d, w) for z, x, d, w in _HEAD_OUTLINE if z > 9]
    low = ((-3.5, -1.8, 6.5, 7.2), (2, -0.8, 7.2, 7.4)) if appearance.long_hair else ((6.5, 0.5, 7.2, 6.4),)
    stations = [
        (neck[0] + (x - 0.25) * cm, 0, neck[2] + z * cm, d * cm, w * cm, 2.1) for z, x, d, w in (*low, *rows)
    ]
    part = loft(stations, 26, 30, HAIR, -X, -Y)
    centre = np.array([neck[0] + 0.6 * cm, 0, 0])
    flat = part.vertices - centre
    azimuth = np.degrees(np.abs(np.arctan2(flat[:, 1], flat[:, 0])))
    line = PchipInterpolator(_LINE_AT, _LONG if appearance.long_hair else _SHORT)(azimuth)
    above = (part.vertices[:, 2] - neck[2]) / cm - line
    cover = np.clip(above / 1.2, 0, 1)
    thick = (0.9 if not appearance.long_hair else 1.3) * cm
    outward = flat * [1, 1, 0]
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
    crown = np.clip(((part.vertices[:, 2] - neck[2]) / cm - 22) / 5, 0, 1)[:, None]
    part.vertices += (cover * thick)[:, None] * (outward * (1 - crown) + Z * crown * 0.9)
    part.vertices -= ((1 - cover) * 1.6 * cm)[:, None] * outward
    return part.bind("head")


def limb_parts(body: Anatomy, appearance: Appearance) -> list[Part]:
    """Return both arms and both legs."""
    parts = []
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        parts += _arm(side, sign, body, appearance) + _leg(side, body, appearance) + _shoe(side, sign, body)
    return parts


def _scale(body: Anatomy) -> float:
    """Return metres per centimetre of the tables."""
    return 0.01 * body.stature / 1.75


def _down(
    side_at: np.ndarray, rows: Sequence[tuple[float, ...]], unit: float, girth: float, exponent: float
) -> np.ndarray:
    """Turn rows (height above the origin in metres, x shift, depth, width) into rings beside a joint."""
    x0, y, _ = side_at
    return np.array(
        [(x0 + x * unit, y, z, d * unit * girth, w * unit * girth, exponent) for z, x, d, w in rows]
    )


def _arm(side: str, sign: float, body: Anatomy, appearance: Appearance) -> list[Part]:
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
    sleeve = cap + upper + (lower if appearance.long_sleeves else short)
    skin = [
        (s - 12 * cm, 0, 4.1, 3.8), (e + 4 * cm, 0, 3.8, 3.6), (e, -0.2, 3.8, 3.6),
        (e - 6 * cm, 0.1, 4.2, 3.7),
        (e - 15 * cm, 0, 3.4, 3.0), (w + 3 * cm, 0, 2.8, 2.2), (w - 1 * cm, 0, 2.8, 2.0),
    ]  # fmt: skip
    rings, skin_rows = (34, skin[5:]) if appearance.long_sleeves else (18, skin)
    cloth = loft(_down(shoulder, sleeve, cm, appearance.limbs, 2.1), rings, 16, TOP, -X, Y)
    under = loft(_down(shoulder, skin_rows, cm, appearance.limbs, 2), 26, 14, SKIN, -X, Y)
    parts = [part.bind_chain(chain, body, -Z, 7 * cm) for part in (cloth, under)]
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


def _leg(side: str, body: Anatomy, appearance: Appearance) -> list[Part]:
    cm, rest, loose = _scale(body), body.rest, appearance.loose
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
    trouser = loft(_down(hip, rows, cm, appearance.limbs, 2.15), 46, 22, LEGS, -X, Y)
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


def build_figure(
    body: Anatomy, appearance: Appearance, rng: np.random.Generator, carried: Sequence[Part] = ()
) -> Mesh:
    """Return the mesh of a person in clothes, with what they carry."""
    parts = trunk_parts(body, appearance) + limb_parts(body, appearance)
    for part in parts:
        if part.material in (TOP, LEGS):
            _crease(part, 0.0016 * (1 + appearance.loose), rng)
    return merge([*parts, *carried], body)


def _crease(part: Part, depth: float, rng: np.random.Generator) -> None:
    """Push the cloth in and out by smooth waves of 6 to 20 cm, `depth` metres rms."""
    waves = rng.standard_normal((10, 3)) * [28, 28, 40]
    phase = rng.uniform(0, 2 * np.pi, 10)
    height = np.cos(part.vertices @ waves.T + phase).sum(1) * depth / np.sqrt(5)
    part.vertices += height[:, None] * vertex_normals(part.vertices, part.faces)
