"""Balance as a soft constraint: the ground's force acts where feet stand.

The ground's force acts within the polygon of the standing feet.  For an inverted pendulum it acts at
z = c - h / g c'', where c is the body's centre of mass and h its height above the feet; for a person who
stands still that is below the centre of mass.  If an estimate has z outside the polygon, a row pulls it back.

Masses and centres of mass of body segments: de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia
parameters", Journal of Biomechanics 29 (1996), table 4, mean of women and men.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import numpy.typing as npt

from gait.lift.smooth.soft_constraints import FLOOR_JOINTS, Rows, trunk

Floats = npt.NDArray[np.float64]

GRAVITY = 9.81  # m/s^2
STANDS = 0.5  # probability of standing from which a foot may bear weight
BALANCE_SD = 0.05  # metres outside the polygon, as feet are lines here and bodies are not pendulums
EDGE = 0.03  # metres outside the polygon below which a row fades, so that rows do not switch on and off
LEAST_OUTSIDE_M = 1e-3  # metres outside the polygon from which there is a row
FLAT_AREA = 1e-6  # square metres; smaller triangles are degenerate
_LIMBS = (  # from, to, share of the mass, relative position of its centre between them
    ("shoulder", "elbow", 0.0263, 0.576),
    ("elbow", "wrist", 0.0208, 0.61),  # including the hand beyond the wrist, 0.6 % of the mass
    ("hip", "knee", 0.1447, 0.385),
    ("knee", "ankle", 0.0457, 0.444),
    ("heel", "toe", 0.0133, 0.421),
)
MASS_SEGMENTS = (
    ("head_top", "neck", 0.0681, 0.594),
    ("neck", "pelvis", 0.4302, 0.432),
    *((f"{s}_{upper}", f"{s}_{lower}", mass, at) for s in "lr" for upper, lower, mass, at in _LIMBS),
)


def masses(names: Sequence[str]) -> Floats | None:
    """Share of the body's mass (J,) that each marker represents; None if an end of a segment is missing."""
    if not {name for *ends, _, _ in MASS_SEGMENTS for name in ends} <= set(names):
        return None
    share = np.zeros(len(names))
    for first, second, mass, at in MASS_SEGMENTS:
        share[names.index(first)] += (1 - at) * mass
        share[names.index(second)] += at * mass
    return np.asarray(share / share.sum())


def balance(rows: Rows, names: Sequence[str], places: Floats, sure: Floats, rate: float) -> None:
    """Add rows that pull the force into the polygon of the standing feet, where positions have it outside.

    Distances are in lengths of the trunk, as in `contacts`.

    Parameters
    ----------
    places : (grid, J, 3)
        Positions at which the rows are linearised, metres.
    sure : (grid - 1, feet)
        Probability that feet stand from each frame to the next, from `contacts`.
    """
    share, every = masses(names), np.arange(len(names))
    if share is None:
        return
    feet, middle = np.array([names.index(name) for name in FLOOR_JOINTS]), places.swapaxes(1, 2) @ share
    for t in range(1, len(places) - 1):
        on = feet[np.maximum(sure[t - 1], sure[t]) > STANDS]
        if not on.size:
            continue
        lag = (middle[t, 2] - places[t, on, 2].mean()) / GRAVITY * rate**2
        parts = np.array([-lag, 1 + 2 * lag, -lag])
        force = parts @ middle[t - 1 : t + 2, :2]
        corners = nearest(places[t, on, :2], force)
        out = force - corners @ places[t, on, :2]
        away = float(np.hypot(*out))
        if away < LEAST_OUTSIDE_M:
            continue
        size, across = trunk(rows.layout, names, places, np.array([t]))
        columns, factors = [size[0]], [-away * across[0]]
        for axis, normal in enumerate(out / away):
            for step, part in zip((-1, 0, 1), parts, strict=True):
                columns.append(rows.layout.place(np.full_like(every, t + step), every) + axis)
                factors.append(normal * part * share)
            columns.append(rows.layout.place(np.full_like(on, t), on) + axis)
            factors.append(-normal * corners)
        sd = BALANCE_SD * np.hypot(1.0, EDGE / away)
        # linear part of away / (length of the trunk), in present lengths
        rows.add(
            np.concatenate(columns)[None], np.concatenate(factors)[None], np.array([-away]), np.array([sd])
        )


def nearest(corners: Floats, point: Floats) -> Floats:
    """Weights (n,) of a convex polygon's corners (n, 2) that give its position nearest to a point."""
    count, every = len(corners), np.eye(len(corners))
    for triangle in map(list, combinations(range(count), 3)):
        system = np.vstack([corners[triangle].T, np.ones(3)])
        if abs(np.linalg.det(system)) > FLAT_AREA:
            inside = np.linalg.solve(system, np.append(point, 1.0))
            if (inside >= 0).all():
                return np.asarray(inside @ every[triangle])
    edges = list(combinations(range(count), 2)) or [(0, 0)]
    found = []
    for first, last in edges:
        along = corners[last] - corners[first]
        part = np.clip((point - corners[first]) @ along / max(float(along @ along), FLAT_AREA), 0.0, 1.0)
        found.append((1 - part) * every[first] + part * every[last])
    return min(found, key=lambda weights: float(np.hypot(*(weights @ corners - point))))
