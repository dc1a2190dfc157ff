"""Solve a lifted motion again near a correction, in a fraction of the time for the whole.

A correction changes the motion nearby, so the blocks around it are solved given the blocks further away and
the lasting unknowns, starting from the present estimate.  The linear problem is the same as that of the
whole, so solving the whole later moves the figure little.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gait.bindings.segment_prior import SegmentPrior
from gait.io.keypoints_file import Keypoints
from gait.lift.keypoints.corrections import Pins
from gait.lift.segment.view import View
from gait.lift.smooth import motion
from gait.lift.smooth.chain import Around, Prior
from gait.lift.smooth.motion import Motion
from gait.lift.smooth.options import Options
from gait.lift.smooth.smoother import Problem, Start, State

Floats = npt.NDArray[np.float64]

BLOCKS_AROUND = 3  # blocks before and after the corrected ones that are also solved again


@dataclass(frozen=True)
class Nearby:
    """The motion near a correction.

    Attributes
    ----------
    rows : (n,)
        Frames, as rows of the keypoints.
    places : (n, J, 3)
        Positions of the markers, metres.
    uv : (n, J, 2)
        The markers in the picture.
    """

    rows: npt.NDArray[np.intp]
    places: Floats
    uv: Floats


class Interactive:
    """Solves parts of a lifted motion.

    Parameters
    ----------
    prior : SegmentPrior
        The whole prior.
    view, options : AnyView, Options
        Those with which the motion was lifted.
    points : tuple of str
        Points of the keypoints from which it was lifted.
    found : Motion
        The motion, with the state of the smoother.
    """

    def __init__(
        self, prior: SegmentPrior, view: View, options: Options, points: tuple[str, ...], found: Motion
    ) -> None:
        assert found.state is not None
        self._prior = prior.restricted(found.names).widened(found.wider)
        self._chained = Prior(self._prior)
        self._view, self._options, self._state, self._points = view, options, found.state, points
        assert found.uv is not None
        self._places, self._uv = found.places.copy(), found.uv.copy()

    def solve(self, keypoints: Keypoints, pins: Pins | None, frames: range) -> Nearby:
        """Solve again around some frames, numbered as in the keypoints, and keep the result as the new state.

        Raises
        ------
        LinAlgError
            If the keypoints fit no motion that the prior knows.
        """
        problem = self._whole(keypoints, pins)
        state = replace(self._state, errors=self._errors(problem, keypoints.names))
        corrected = np.flatnonzero((keypoints.frame >= frames.start) & (keypoints.frame < frames.stop))
        blocks = problem.at[0][corrected] // problem.grid.frames
        first = max(int(blocks.min()) - BLOCKS_AROUND - 1, 0)
        end = min(int(blocks.max()) + BLOCKS_AROUND + 2, problem.grid.blocks)
        part, own = problem.part(first, end), _part(state, first, end, problem.grid.frames)
        held = first > 0, end < problem.grid.blocks
        before = part.at_video(own.places)
        # A pulled joint arrives in one step.  Points that are no longer corrected are judged by the moved
        # body at first, and only then by the one that moved back.
        by_hand = keypoints.by_hand is not None and np.isfinite(keypoints.by_hand[corrected]).any()
        for _ in range(1 if by_hand else 2):
            part.weight(own)
            own = part.inner_step(own, held)
        rows = problem.rows_of(first, end)
        places, lengths = part.at_video(own.places), part.at_video(own.lengths)
        self._state, self._points = _joined(state, own, first, end, problem.grid.frames), keypoints.names
        # Changes of size and floor that were made to the motion after smoothing are kept.
        self._places[rows] += places - before
        self._uv[rows] = self._view.project(places, lengths)
        return Nearby(rows, self._places[rows], self._uv[rows])

    def _whole(self, keypoints: Keypoints, pins: Pins | None) -> Problem:
        observed, freedom = motion.problem_of(self._prior, keypoints, self._view, self._options, pins)
        around, state = self._state.around, self._state
        start = Start(around.heading, around.component, around.stature, state.places, state.lengths)
        constraints = self._options.contact, self._options.bones
        known = self._chained
        return Problem(self._prior, observed, self._view, freedom, start, *constraints, chained=known)

    def _errors(self, problem: Problem, points: tuple[str, ...]) -> Floats:
        """Rearrange the unknowns of the detector's lasting errors for other points than before."""
        if not problem.errors.count or not self._state.errors.size:
            return np.zeros(problem.errors.count)
        old = dict(
            zip(
                self._points, self._state.errors.reshape(-1, len(self._points), 2).swapaxes(0, 1), strict=True
            )
        )
        none = np.zeros((problem.errors.count // (2 * len(points)), 2))
        return np.stack([old.get(name, none) for name in points], axis=1).ravel()


def _part(state: State, first: int, end: int, frames: int) -> State:
    """Cut an estimate to the blocks `first` <= block < `end`."""
    segments, grid = slice(first, end - 1), slice(first * frames, end * frames)
    around = state.around
    return replace(
        state,
        around=Around(
            around.heading[segments],
            around.component[segments],
            around.stature,
            around.places[segments],
            around.grown[segments],
        ),
        places=state.places[grid],
        lengths=state.lengths[grid],
    )


def _joined(state: State, part: State, first: int, end: int, frames: int) -> State:
    """Insert a part of an estimate into the whole."""
    segments, grid = slice(first, end - 1), slice(first * frames, end * frames)

    def put(whole: Floats, own: Floats, where: slice) -> Floats:
        found = whole.copy()
        found[where] = own
        return found

    whole, own = state.around, part.around
    around = Around(
        put(whole.heading, own.heading, segments),
        whole.component,
        whole.stature,
        put(whole.places, own.places, segments),
        put(whole.grown, own.grown, segments),
    )
    places, lengths = put(state.places, part.places, grid), put(state.lengths, part.lengths, grid)
    return replace(state, around=around, places=places, lengths=lengths)
