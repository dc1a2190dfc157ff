"""What lifting refuses: tracks that show too little, and estimates that are no person."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gait.bindings.segment_prior import SegmentPrior
from gait.errors import UsageError, UserError
from gait.camera.camera import Camera
from gait.lift.equations import Parallel
from gait.lift.grid import Grid
from gait.lift.explain import FEWEST, Explanation
from gait.lift.observe import LONGEST_GAP, Observations
from gait.lift.result import Options
from gait.io.keypoints_file import Tracks

Floats = npt.NDArray[np.float64]


class Unlike(UserError):
    """The tracks show a motion unlike the prior's: a wider prior may do."""


HIGH = (
    4.0  # times the distance that the person's size in the picture tells: no lens that sees feet is so high
)
SIZES = (0.6, 1.6)  # of the usual extent: no person is smaller or larger


def require_metres(
    camera: Camera, tracks: Tracks, prior: SegmentPrior, stature: float, options: Options
) -> None:
    """Refuse a camera that stands far higher than the person is away: its t is no metres."""
    points = Observations(tracks.uv, tracks.deviations(options.pixel_sd))
    seen = points.among(prior.index(tracks.names), len(prior.names))
    flat = Parallel(camera.R, None, np.zeros(2))
    try:
        lengths = flat.lengths(seen, prior.mean[0].mean(axis=0), stature)
    except UsageError:  # too few points at a time to tell a size
        return
    away, height = float((camera.fx + camera.fy) / 2 * lengths[0]), float(camera.centre[2])
    if abs(height) > HIGH * away + stature + 3 * options.floor_sd:
        raise UserError(
            f"the camera stands {height:.0f} m over the floor but sees somebody {away:.2g} m away: give its "
            "t in metres (R, t: world to camera, z up, floor at z = 0)"
        )


def require_seen(found: list[list[Explanation]], grid: Grid, tracks: Tracks, alone: bool) -> None:
    """Refuse tracks that show next to nothing, or nothing in a segment if each is estimated `alone`."""
    if not any(found):
        step = float(np.median(np.diff(tracks.time[tracks.seen.any(axis=1)], append=np.inf)))
        if LONGEST_GAP <= step < np.inf:
            raise UserError(
                f"{1 / step:.2g} frames per second with points are too few to follow a motion; give "
                f"{np.ceil(1 / LONGEST_GAP):.0f} or more (and check time: seconds)"
            )
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
            "the camera wrong (R, t: world to camera, t in metres?); learn a model with such motions, or use "
            "--method blend"
        )


def _extent(places: Floats) -> float:
    """Mean distance of markers (T, J, 3) from their middle."""
    apart = places - places.mean(axis=1, keepdims=True)
    return float(np.linalg.norm(apart, axis=2).mean())
