"""Places in 2-D tracks that are none: what detectors write where they see nothing."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gait.errors import UserError

Array = NDArray[np.float64]

MANY = 10  # points at exactly one place that no noise puts there
COINCIDE = 4  # names at one place: from the side hips and pelvis meet, or shoulders and neck, but not more
APART = 0.5  # of what the other points span: so far beside them feet do not meet


def refuse(path: str | os.PathLike[str], names: Sequence[str], uv: Array) -> None:
    """Raise UserError at points (T, J, 2) at 0, 0 or -1, -1; one name at 0 may be the origin of all."""
    zero, minus = (uv == 0).all(axis=2), (uv == -1).all(axis=2)
    origin = zero.all(axis=0) & (zero.sum(axis=1) == 1)[:, None]
    wrong = (zero & ~origin) | minus
    if wrong.any():
        t, j = np.argwhere(wrong)[0]
        raise UserError(
            f"{path}: line {t + 2}: {names[j]} is at exactly {uv[t, j, 0]:g}, {uv[t, j, 1]:g}, as detectors "
            f"put what they do not see; leave both cells empty, or give {names[j]}_c 0"
        )


def suspected(uv: Array) -> tuple[Array, int] | None:
    """Find the place (2,) that several names of (T, J, 2) share exactly, and how often; None if none do.

    Joints meet in the picture now and then: it is one beside all other points, or of more than can meet.
    """
    seen = np.isfinite(uv).all(axis=2)
    pairs, which, counts = np.unique(uv[seen], axis=0, return_inverse=True, return_counts=True)
    column = np.nonzero(seen)[1]
    for k in np.argsort(-counts)[: len(counts[counts >= MANY])]:
        at = which.ravel() == k
        shared = len(set(column[at].tolist()))
        if shared >= COINCIDE or (shared > 1 and _beside(pairs[k], uv[seen][~at])):
            return pairs[k], int(counts[k])
    return None


def _beside(place: Array, others: Array) -> bool:
    """Whether a place (2,) is clearly outside of what the others (n, 2) span."""
    if not len(others):
        return False
    low, high = others.min(axis=0), others.max(axis=0)
    return bool((np.maximum(low - place, place - high) > APART * (high - low).max()).any())
