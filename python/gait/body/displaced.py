"""A model whose joints are elsewhere in the limbs before them, the same on both sides."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.body import skeleton
from gait.body.measured import raised
from gait.body.skeleton import SIDES
from gait.io import blob

Floats = npt.NDArray[np.float64]

#: Frames, or points, that are displaced in their parent's frame.
PARTS = ("thigh", "shank", "foot", "upper_arm", "forearm", "wrist", "toe", "heel")
_SOLES = ("toe", "heel")
_TRUNK = ("pelvis", "torso")  # their solids are not those of a limb that ends at a joint


def effects(sections: Mapping[str, Any], channels: Floats) -> Floats:
    """Change of all joints (T, P, 3, 3 x `PARTS`), statures, by displacements, for channel values (T, M)."""
    frames, points = blob.unpack_names(sections["FRNM"]), blob.unpack_names(sections["PTNM"])
    parents, at = np.asarray(sections["FRMI"])[:, 0], np.asarray(sections["PTNI"])
    turns = skeleton.frames(sections, channels)[0]
    out = np.zeros((len(channels), len(points), 3, len(PARTS), 3))
    for k, part in enumerate(PARTS):
        for side in SIDES:
            name, mirror = f"{side}_{part}", _mirror(side)
            if name in frames:
                own = frames.index(name)
                moved = [p for p, frame in enumerate(at) if own in _chain(frame, parents)]
                turn = turns[:, parents[own]]
            else:
                moved = [points.index(name)]
                turn = turns[:, at[moved[0]]]
            out[:, moved, :, k] = turn * mirror  # the joints come first
    return out.reshape(*out.shape[:3], -1)


def displaced(sections: Mapping[str, Any], moves: Floats) -> dict[str, Any]:
    """Return the sections of a model with `PARTS` displaced.

    `moves` (n, 3): statures, in the axes of the parent on the left; the right side mirrors it.  The feet stay
    on the floor, and the solid of a limb ends at the joint as before.
    """
    frames, points = blob.unpack_names(sections["FRNM"]), blob.unpack_names(sections["PTNM"])
    parents, at = np.asarray(sections["FRMI"])[:, 0], np.asarray(sections["PTNI"])
    origins, places = np.array(sections["FRMF"], float), np.array(sections["PTNF"], float)
    limbs, of = np.array(sections["LIMF"], float), np.asarray(sections["LIMI"])[:, 0]
    for part, move in zip(PARTS, moves, strict=True):
        for side in SIDES:
            name, way = f"{side}_{part}", move * _mirror(side)
            if name in frames:
                own = frames.index(name)
                origins[own] += way
                before = parents[own]
            else:
                places[points.index(name)] += way
                before = at[points.index(name)]
            if frames[before] not in _TRUNK and part not in _SOLES:
                limbs[of == before, 3:6] += way
    out = {**sections, "FRMF": origins, "PTNF": places, "LIMF": limbs}
    cycle = np.asarray(sections["CURV"], float)[0]
    soles = [points.index(f"{side}_{part}") for side in SIDES for part in _SOLES]
    low = [skeleton.points(each, cycle)[:, soles, 2].min(axis=1).mean() for each in (sections, out)]
    out |= raised(sections, float(low[0] - low[1]))
    return {
        tag: values.astype(np.float32) if values.dtype == float else values for tag, values in out.items()
    }


def _mirror(side: str) -> Floats:
    return np.array([1.0, -1.0 if side == "r" else 1.0, 1.0])


def _chain(frame: int, parents: npt.NDArray[np.int32]) -> list[int]:
    """Frame and all frames before it."""
    out = []
    while frame >= 0:
        out.append(int(frame))
        frame = int(parents[frame])
    return out
