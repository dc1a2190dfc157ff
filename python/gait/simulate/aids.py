"""Sticks and crutches: held in the hand, and planted beside the other side's foot while that stands.

The shaft is rigid and points at its position on the floor.  As the arm does not adapt to it, its tip may be
some centimetres above or below the floor.
"""

from __future__ import annotations

import numpy as np

from gait.simulate.body import BONE_INDEX, SIDES, Anatomy, Part, loft
from gait.simulate.geometry import Array, unit
from gait.simulate.walk import Walk, smoothstep
from gait.simulate.wardrobe import SHOE

_STANDS = 0.55  # share of the other foot's stride, from its strike, in which the tip is planted
_ASIDE = 0.12  # metres from the hand outwards
_RADIUS = 0.011  # metres
_CUFF = 0.24  # metres by which a crutch extends above the hand
_FLOOR = 0.01  # metres below the hand's lowest position at rest


def hands(aid: str, asymmetry: float) -> tuple[str, ...]:
    """Return the sides whose hand holds an aid; a stick is opposite the spared leg, or on the right."""
    if aid == "none":
        return ()
    return SIDES if aid == "crutches" else ("l",) if asymmetry < 0 else ("r",)


def length(body: Anatomy) -> float:
    """Length from the hand to the tip, metres: the height of a standing person's wrist."""
    return float(body.rest["l_wrist"][2] - (body.rest["l_ankle"][2] - body["ankle_height"])) - _FLOOR


def parts(aid: str, sides: tuple[str, ...], body: Anatomy) -> list[Part]:
    """Return the shafts, which at rest are upright below the wrist."""
    out = []
    for side in sides:
        x, y, z = body.rest[f"{side}_wrist"]
        top = _CUFF if aid == "crutches" else 0.02
        rings = [(x, y, z + up, r, r, 2.0) for up, r in ((top, 0.001), (top - 0.01, _RADIUS))]
        rings += [(x, y, z - length(body) + up, r, r, 2.0) for up, r in ((0.03, _RADIUS), (0, 1.6 * _RADIUS))]
        out.append(loft(rings, 24, 10, SHOE, X, -Y).bind(f"{side}_aid"))
    return out


X, Y = np.eye(3)[:2]


def carry(walk: Walk, sides: tuple[str, ...]) -> None:
    """Set the bones of the aids, in place."""
    for side, other in ((s, "r" if s == "l" else "l") for s in sides):
        wrist = walk.origins[:, BONE_INDEX[f"{side}_hand"]]
        shaft = unit(wrist - _tip(walk, wrist, side, other))
        ahead = np.column_stack([np.cos(walk.heading), np.sin(walk.heading), np.zeros(len(wrist))])
        left = unit(np.cross(shaft, ahead))
        walk.origins[:, BONE_INDEX[f"{side}_aid"]] = wrist
        walk.turns[:, BONE_INDEX[f"{side}_aid"]] = np.stack([np.cross(left, shaft), left, shaft], axis=-1)


def _tip(walk: Walk, wrist: Array, side: str, other: str) -> Array:
    """Compute the point (T, 3) at which the shaft points: fixed on the floor while the other foot stands."""
    sign = 1.0 if side == "l" else -1.0
    aside = sign * np.column_stack([-np.sin(walk.heading), np.cos(walk.heading)])
    beside = wrist[:, :2] + _ASIDE * aside
    phase = walk.timing.of_side(other)
    stride, part = np.floor(phase).astype(int), phase % 1.0
    first = int(stride.min())
    places = []
    for number in range(first, int(stride.max()) + 2):
        spans = phase[(phase >= number) & (phase <= number + _STANDS)]
        middle = number + 0.5 * _STANDS
        inside = len(spans) and phase[0] <= middle <= phase[-1]
        row = [np.interp(middle, phase, column) for column in beside.T] if inside else [np.nan, np.nan]
        places.append(row)
    planted = np.array(places)
    for column in planted.T:  # before the first and after the last whole stance
        known = np.flatnonzero(np.isfinite(column))
        slope = (column[known[-1]] - column[known[0]]) / max(known[-1] - known[0], 1)
        numbers = np.arange(len(column))
        column[: known[0]] = column[known[0]] - slope * (known[0] - numbers[: known[0]])
        column[known[-1] + 1 :] = column[known[-1]] + slope * (numbers[known[-1] + 1 :] - known[-1])
    share = smoothstep(part, _STANDS, 1.0)[:, None]
    now, after = planted[stride - first], planted[stride - first + 1]
    return np.column_stack([now + share * (after - now), 0.06 * np.sin(np.pi * share[:, 0])])
