"""Left and right in the keypoints of several views, which the motion that is lifted from all of them shows.

A detector swaps the limbs of a person it sees from the side or from behind, in up to half of a film's frames.
A swapped limb of one view does not fit the motion that the other frames and views show.  So the views are
lifted together, limbs are swapped where that fits the motion better, and all is lifted again, until nothing
changes.  If swaps are suspected in a view alone, or the motion fits poorly, too many may have been wrong to
begin with: the view with the fewest suspects is lifted alone and shows the sides in the others, and the
motion with the larger evidence is kept.  At most, one view is lifted alone and all together 12 times.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import mistaken_sides, other_sides
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.lift.keypoints import swaps
from gait.lift.segment.view import Perspective, Several
from gait.lift.smooth import motion
from gait.lift.smooth.motion import Motion
from gait.lift.smooth.options import Options
from gait.progress import progress
from gait.reproducible import one_thread

Floats = npt.NDArray[np.float64]

#: In each of which limbs are swapped and the views lifted again; sides where limbs meet may change for ever.
_ROUNDS = 5


class _Result(Protocol):
    @property
    def motion(self) -> Motion:
        """The motion lifted."""


LiftedAs = TypeVar("LiftedAs", bound=_Result)


def best_sides(
    prior: SegmentPrior,
    keypoints: Keypoints,
    several: Several,
    options: Options,
    noise: Sequence[float],
    lift: Callable[[Keypoints], LiftedAs],
    quiet: bool,
) -> LiftedAs:
    """Lift the joined keypoints of several views by `lift`, with left and right as the motion shows them.

    `noise`: standard deviation of each view's points at full confidence, pixels.

    UserError of `lift` only if it lifts from neither start.
    """
    found: list[LiftedAs] = []
    refused: list[UserError] = []

    def attempt(start: Keypoints) -> None:
        try:
            found.append(_with_sides(start, several, lift))
        except UserError as error:
            refused.append(error)

    attempt(keypoints)
    suspected = [
        swaps.share_suspected(keypoints.among(several.of_point == view), sd) for view, sd in enumerate(noise)
    ]
    if found and found[0].motion.chi2_per_observation <= motion.POOR_FIT and not any(suspected):
        return found[0]
    begun = _sides_of(prior, keypoints, several, int(np.argmin(suspected)), options, quiet)
    if begun is not None:
        attempt(begun)
    if not found:
        raise refused[0]
    return max(found, key=lambda one: one.motion.evidence)


def _with_sides(keypoints: Keypoints, several: Several, lift: Callable[[Keypoints], LiftedAs]) -> LiftedAs:
    """Lift, swap left and right where that fits the motion better, and lift again until nothing changes.

    A motion that is refused after a swap does not count: the one before is returned.
    """
    lifted = lift(keypoints)
    for _ in range(_ROUNDS):
        expected = [camera.project(lifted.motion.places) for camera in several.cameras]
        swapped = _on_nearer_sides(keypoints, several, expected, lifted.motion.names)
        if swapped is None:
            break
        try:
            lifted = lift(swapped)
        except UserError:
            break
        keypoints = swapped
    return lifted


def _sides_of(
    prior: SegmentPrior, keypoints: Keypoints, several: Several, view: int, options: Options, quiet: bool
) -> Keypoints | None:
    """Swap left and right in other views where they then fit the motion that one view shows; None if nowhere.

    Its place is wrong in depth, so only differences from the middle of a frame's points are compared.
    """
    own = keypoints.among(several.of_point == view)
    try:
        with one_thread(), progress("sides", motion.segments_of(prior, own), quiet) as update:
            names = motion.output_names(prior, keypoints)  # also those that only other views show
            alone = motion.lift(prior, own, Perspective(several.cameras[view]), options, names, update)
    except UserError:
        return None
    expected = []
    for number, camera in enumerate(several.cameras):
        points = keypoints.among(several.of_point == number)
        there = camera.project(alone.places)
        off = points.uv - there[:, [alone.names.index(name) for name in points.names]]
        rows = np.isfinite(off).any(axis=(1, 2))
        there[rows] += np.nanmedian(off[rows], axis=1, keepdims=True)
        expected.append(there)
    return _on_nearer_sides(keypoints, several, expected, alone.names)


def _on_nearer_sides(
    keypoints: Keypoints, several: Several, expected: Sequence[Floats], known: Sequence[str]
) -> Keypoints | None:
    """Swap left and right of each limb in each frame of a view where that is nearer; None if nowhere.

    Parameters
    ----------
    expected : sequence of (T, J, 2)
        Points expected in each view, with the names `known`, pixels.
    """
    uv, confidence = keypoints.uv.copy(), keypoints.confidence.copy()
    sd = None if keypoints.sd is None else keypoints.sd.copy()
    for number, points in enumerate(expected):
        own = np.flatnonzero(several.of_point == number)
        tall = float(np.nanmedian(np.ptp(points[..., 1], axis=1)))
        for limb in swaps.LIMB_JOINTS:
            columns = [k for k in own.tolist() if keypoints.names[k][2:] in limb]
            names = [keypoints.names[k] for k in columns]
            if len(names) != 2 * len({name[2:] for name in names}):
                continue  # some joints have one side only
            there = points[:, [known.index(name) for name in names]]
            wrong = mistaken_sides(keypoints.uv[:, columns], there, names, tall)
            other = [columns[k] for k in other_sides(names)]
            for values, before in (
                (uv, keypoints.uv),
                (confidence, keypoints.confidence),
                (sd, keypoints.sd),
            ):
                if values is not None and before is not None:
                    values[np.ix_(wrong, columns)] = before[np.ix_(wrong, other)]
    changed = not np.array_equal(uv, keypoints.uv, equal_nan=True)
    return replace(keypoints, uv=uv, confidence=confidence, sd=sd) if changed else None
