"""Surfaces of the trunk, neck, head and hair.  Tables are centimetres for a stature of 1.75 m."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from gait.simulate.anatomy import Anatomy
from gait.simulate.mesh import Part, loft
from gait.simulate.wardrobe import FACE, HAIR, LEGS, SKIN, TOP, Look

X, Y, Z = np.eye(3)

# height over the pelvis joint, forward shift, depth, width, exponent, share of hips' and shoulders' girth
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
# height over the neck joint, forward shift, depth, width
_NECK = (
    (-2.5, 0.4, 4.6, 5.2),
    (1, 0.1, 4.9, 5.0),
    (4, 0.5, 5.3, 5.2),
    (8, 0.7, 5.6, 5.4),
    (11, 0.4, 5.0, 5.0),
)
_HEAD = (
    (4.4, 4.6, 2.2, 2.2), (5.2, 4.1, 5.0, 3.9), (7.2, 3.0, 7.1, 5.3), (10.5, 2.2, 8.4, 6.5),
    (14.2, 1.7, 9.2, 7.2),
    (18, 1.3, 9.6, 7.5), (21.5, 1.0, 9.4, 7.4), (24.3, 0.8, 8.0, 6.3), (26.2, 0.7, 5.2, 4.2),
    (27.0, 0.7, 2.0, 1.7),
    (27.2, 0.7, 0.1, 0.1),
)  # fmt: skip
_NOSE = (
    (10.6, 16.6, 0.4, 0.6),
    (11.1, 14, 0.9, 1.0),
    (11.7, 12.2, 1.5, 1.5),
    (11.4, 11.2, 1.0, 1.4),
    (10.8, 10.8, 0.2, 0.5),
)
_EAR = ((11.2, 0.1, 0.1), (12, 1.2, 0.8), (14.5, 1.9, 1.0), (16.4, 1.8, 0.9), (17.2, 0.1, 0.1))
# azimuth from the front, degrees: where the hair ends, height over the neck joint
_LINE_AT = (0, 35, 60, 80, 100, 130, 180)
_SHORT, _LONG = (22.5, 22.0, 19.5, 16.0, 12.0, 8.5, 7.0), (22.5, 21.5, 16.0, 5.0, 1.0, -2.0, -3.0)


def trunk_parts(body: Anatomy, look: Look) -> list[Part]:
    """Return the top, the seat of the trousers, neck, head, nose, ears and hair."""
    cm = 0.01 * body.stature / 1.75
    return [_top(body, look, cm), _seat(body, look, cm), *_head(body, look, cm), _hair(body, look, cm)]


def _top(body: Anatomy, look: Look, cm: float) -> Part:
    """Return the shirt or jacket from its hem to the collar, stretched to this person's trunk."""
    tall = body["neck_up"] / (52.9 * cm)
    hem = 100 * look.hem
    rows = [(-hem, -0.2, 14.0, 18.9, 2.3, 1, 0), (-hem / 2, -0.4, 13.4, 18.3, 2.3, 1, 0), *_TOP]
    broad = body["shoulder_half"] / (17.7 * cm)
    thigh = 9.2 * look.limbs + look.loose
    wide = body["hip_half"] / cm + 0.9 * thigh
    stations = []
    for z, x, d, w, n, low, high in rows:
        girth = look.trunk * (1 + low * (look.hips - 1))
        d, w = d * girth, w * (girth + high * (broad - girth))
        if z < 5:  # the hem hangs outside the moving thighs
            room = np.interp(z, (0, 5), (1, 0.4))
            d, w = max(d, thigh + 4.5 * room), max(w, wide + 1.5 * room)
        stations.append((x * cm, 0, z * cm * (tall if z > 0 else 1), d * cm, w * cm, n))
    part = loft(stations, 44, 36, TOP, -X, -Y)
    return part.bind_chain(["pelvis", "torso"], body, Z, 16 * cm)


def _seat(body: Anatomy, look: Look, cm: float) -> Part:
    girth = 0.94 * look.trunk * look.hips
    stations = [(x * cm, 0, z * cm, d * cm * girth, w * cm * girth, 2.3) for z, x, d, w in _SEAT]
    return loft(stations, 16, 30, LEGS, -X, -Y).bind_chain(["pelvis", "torso"], body, Z, 16 * cm)


def _head(body: Anatomy, look: Look, cm: float) -> list[Part]:
    neck = body.rest["neck"]
    cm = cm * body["head_up"] / (27.6 * cm)

    def ring(x: float, y: float, z: float, d: float, w: float) -> tuple[float, ...]:
        return (neck[0] + x * cm, y * cm, neck[2] + z * cm, d * cm, w * cm, 2.1)

    throat = loft([ring(x, 0, z, d, w) for z, x, d, w in _NECK], 10, 18, SKIN, X, Y)
    throat.bind_chain(["torso", "head"], body, Z, 6 * cm)
    skull = loft([ring(x, 0, z, d, w) for z, x, d, w in _HEAD], 26, 28, FACE, -X, -Y)
    angle = np.arange(29) / 28
    skull.uv[:, 0] = np.tile(angle, 26)
    skull.uv[:, 1] = (skull.vertices[:, 2] - neck[2]) / (27.2 * cm) * 1.18 - 0.18
    nose = loft([ring(x, 0, z, d, w) for x, z, d, w in _NOSE], 8, 8, SKIN, X, -Y)
    parts = [skull, nose]
    for sign in () if look.long_hair else (1.0, -1.0):  # long hair covers the ears
        parts.append(loft([ring(0.6, sign * 7.4, z, d, w) for z, d, w in _EAR], 8, 8, SKIN, X, Y))
    return [throat, *(part.bind("head") for part in parts)]


def _hair(body: Anatomy, look: Look, cm: float) -> Part:
    """Return a cap a little larger than the skull that dives under the skin below the hairline."""
    neck = body.rest["neck"]
    cm = cm * body["head_up"] / (27.6 * cm)
    rows = [(z, x, d, w) for z, x, d, w in _HEAD if z > 9]
    low = ((-3.5, -1.8, 6.5, 7.2), (2, -0.8, 7.2, 7.4)) if look.long_hair else ((6.5, 0.5, 7.2, 6.4),)
    stations = [
        (neck[0] + (x - 0.25) * cm, 0, neck[2] + z * cm, d * cm, w * cm, 2.1) for z, x, d, w in (*low, *rows)
    ]
    part = loft(stations, 26, 30, HAIR, -X, -Y)
    centre = np.array([neck[0] + 0.6 * cm, 0, 0])
    flat = part.vertices - centre
    azimuth = np.degrees(np.abs(np.arctan2(flat[:, 1], flat[:, 0])))
    line = PchipInterpolator(_LINE_AT, _LONG if look.long_hair else _SHORT)(azimuth)
    above = (part.vertices[:, 2] - neck[2]) / cm - line
    cover = np.clip(above / 1.2, 0, 1)
    thick = (0.9 if not look.long_hair else 1.3) * cm
    outward = flat * [1, 1, 0]
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
    crown = np.clip(((part.vertices[:, 2] - neck[2]) / cm - 22) / 5, 0, 1)[:, None]
    part.vertices += (cover * thick)[:, None] * (outward * (1 - crown) + Z * crown * 0.9)
    part.vertices -= ((1 - cover) * 1.6 * cm)[:, None] * outward
    return part.bind("head")
