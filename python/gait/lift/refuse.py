"""What lifting refuses: tracks that show too little, and estimates that are no person."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gait.core.segment_prior import SegmentPrior
from gait.errors import UserError
from gait.lift.grid import Grid
from gait.lift.heading import Explanation
from gait.lift.start import FEWEST

Floats = npt.NDArray[np.float64]


class Unlike(UserError):
    """The tracks show a motion unlike the prior's: a wider prior may do."""


SIZES = (0.6, 1.6)  # of the usual extent: no person is smaller or larger


def require_seen(found: list[list[Explanation]], grid: Grid, alone: bool) -> None:
    """Refuse tracks that show next to nothing, or nothing in a segment if each is estimated `alone`."""
    if not any(found):
        raise UserError(f"fewer than {FEWEST} points are seen in every segment; give more of the tracks")
    empty = next((s for s, choices in enumerate(found) if not choices), None)
    if alone and empty is not None:
        at = grid.time[empty * grid.frames]
        raise UserError(f"next to nothing is seen from {at:.2f} s on; use --method smooth across the gap")


def require_size(places: Floats, prior: SegmentPrior, stature: float) -> None:
    """Refuse an estimate that shrank or grew to fit a motion unlike the prior's."""
    ratio = _extent(places) / (stature * _extent(prior.mean[0]))
    if not SIZES[0] < ratio < SIZES[1]:
        raise Unlike(
            f"the estimate came out {ratio:.2f} times a person's size: the motion is unlike the model's, or "
            "the camera wrong; learn a model with such motions, or use --method blend"
        )


def _extent(places: Floats) -> float:
    """Mean distance of markers (T, J, 3) from their middle."""
    apart = places - places.mean(axis=1, keepdims=True)
    return float(np.linalg.norm(apart, axis=2).mean())
