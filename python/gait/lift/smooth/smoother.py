"""Motion of a whole sequence from 2-D keypoints: the exact Gaussian smoother over overlapping segments.

The chain (`gait.lift.smooth.chain`) is combined with the observations and soft constraints
(`gait.lift.smooth.soft_constraints`), all linear in the markers' positions on a time grid at the prior's
rate; positions between its frames are interpolated.  Whatever is not linear (perspective, headings, stature,
lengths of bones) is linearised around each estimate until that converges (Gauss-Newton).  Standard deviations
are those of the last linear problem.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag

from gait.bindings.lifter import weight_outliers
from gait.bindings.segment_prior import SegmentPrior
from gait.lift.keypoints.observations import Grid, Observations, interpolated
from gait.lift.segment.view import AnyView, Parallel
from gait.lift.smooth import block_arrowhead, soft_constraints
from gait.lift.smooth.balance import balance as keep_balance
from gait.lift.smooth.block_arrowhead import Information
from gait.lift.smooth.chain import (
    WHOLE_BODY_UNKNOWNS,
    Around,
    Chain,
    Freedom,
    Prior,
    blended,
    chain,
    moved,
    overlapping,
)
from gait.lift.smooth.lasting_errors import LastingErrors
from gait.lift.smooth.rows import rows_of, scale_free
from gait.lift.smooth.soft_constraints import Layout, Pins, Rows

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.intp]

HIP_JOINTS = ("l_hip", "r_hip")
MOST_STEPS = 25
SETTLED = 1e-3  # metres; rms change of the positions at which the iteration stops
FREE_STEPS = 3  # first steps, without constraints on feet and bones
SCALE_DRIFT = 5e-4  # relative change of the scale's change from one frame to the next


@dataclass(frozen=True)
class Observed:
    """Observations of a sequence.

    Attributes
    ----------
    time : (T,)
        Seconds.
    points : Observations
        Observations of P points in T frames; their noise does not include lasting errors.
    markers : (P,)
        Index of each point's marker in the prior.
    lasting_sd : (T, P) or None
        Standard deviation, along an axis, of a detector's lasting errors, in the unit of the points.
    lasting_s : float
        Seconds in which their autocorrelation falls to 1/e.
    by_hand : (T, P) or None
        Whether a point was marked by hand, so that it cannot be an outlier.
    pins : Pins or None
        Feet that stand at known positions.
    """

    time: Floats
    points: Observations
    markers: Ints
    lasting_sd: Floats | None = None
    lasting_s: float = np.inf
    by_hand: npt.NDArray[np.bool_] | None = None
    pins: Pins | None = None

    def part(self, rows: Ints) -> Observed:
        """Return some of the frames."""
        return replace(
            self,
            time=self.time[rows],
            points=Observations(self.points.uv[rows], self.points.sd[rows]),
            by_hand=None if self.by_hand is None else self.by_hand[rows],
            pins=None if self.pins is None else self.pins.part(rows),
        )


@dataclass(frozen=True)
class Start:
    """First guess on the grid of B blocks, see `Around`; `lengths` (grid,): of a unit of the picture."""

    heading: Floats
    component: Ints
    stature: float
    places: Floats
    lengths: Floats


@dataclass(frozen=True)
class Lifted:
    """Estimated motion.

    Attributes
    ----------
    places, sd : (T, J, 3)
        Positions in the frames of the video, and their standard deviations, metres.
    rooted_sd : (T, J, 3)
        Standard deviations of positions relative to the middle of the hips.
    grid : (grid, J, 3)
        Positions in the frames of the grid.
    heading : (S,)
        Headings of the segments, radians.
    stature : float
    lengths : (T,)
        Metres of a unit of the picture, if the view has a scale.
    contact : (grid - 1, feet)
        Probability that feet stand.
    steps : int
        Number of iterations.
    settled : bool
        Whether they converged.
    log_volume_ratio : float
        log10 of posterior over prior volume.
    evidence : float
        Log density of the observations, without soft constraints, up to a constant.
    outliers : (T, P)
        Whether each point is an outlier, which was down-weighted.
    chi2_per_observation : float
        Mean squared residual in standard deviations, about 1 if the motion is like the prior's.
    state : State
        The converged state, from which to continue.
    covariance : (T, 3 J, 3 J) or None
        Covariance of all coordinates of a frame, square metres, if asked for.
    """

    places: Floats
    sd: Floats
    rooted_sd: Floats
    grid: Floats
    heading: Floats
    stature: float
    lengths: Floats
    contact: Floats
    steps: int
    settled: bool
    log_volume_ratio: float
    evidence: float
    outliers: npt.NDArray[np.bool_]
    chi2_per_observation: float
    state: State
    covariance: Floats | None = None


def smooth(
    prior: SegmentPrior,
    observed: Observed,
    view: AnyView,
    freedom: Freedom,
    start: Start,
    *,
    contact: bool = True,
    bones: bool = True,
    balance: bool = False,
    covariance: bool = False,
) -> Lifted:
    """Estimate the motion of all markers of a prior (from `SegmentPrior.restricted`) over a sequence."""
    problem = Problem(prior, observed, view, freedom, start, contact, bones, balance)
    state, settled = problem.first(start), False
    while not settled and state.steps < MOST_STEPS:
        problem.weight(state)
        before, state = state, problem.step(state, constrained=state.steps >= FREE_STEPS)
        settled = state.steps > FREE_STEPS and _change(state.places - before.places) < SETTLED
    return problem.result(state, settled, covariance)


def evidence(
    prior: Prior, observed: Observed, view: AnyView, freedom: Freedom, begun: Start | State
) -> tuple[float, Floats, State]:
    """Compute the log density of the observations, up to a constant, after the steps without constraints.

    Parameters
    ----------
    begun : Start or State
        First guess, or the state for similar observations, which needs only one more step.

    Returns
    -------
    density : float
    predicted : (T, P, 2)
        Predicted points in the picture.
    state : State
    """
    problem = Problem(prior.segments, observed, view, freedom, begun, chained=prior)
    first = isinstance(begun, Start)
    state = problem.first(begun) if isinstance(begun, Start) else begun
    for _ in range(FREE_STEPS if first else 1):
        problem.weight(state)
        state = problem.step(state, constrained=False)
    problem.weight(state)
    system = problem.system(state, problem.chain(state), constrained=False)
    return problem.evidence(system), problem.predicted(state), state


@dataclass(frozen=True)
class State:
    """Estimate on the grid, and the number of steps taken."""

    around: Around
    places: Floats
    lengths: Floats
    lasting: Floats  #: lasting unknowns of the chain: stature, floor, offsets of markers
    errors: Floats  #: unknowns of `LastingErrors`
    steps: int


@dataclass(frozen=True)
class _System:
    """A linear problem and its solution."""

    found: block_arrowhead.Solution
    information: Information
    chain: Chain
    fit: float  #: y' W y of the observations

    @property
    def log_volume_ratio(self) -> float:
        """Return log10 of posterior over prior volume."""
        return (self.chain.log_det - self.found.log_det) / 2 / float(np.log(10))

    @property
    def square(self) -> float:
        """Chi2 at the mean: squared residuals of observations and prior, in standard deviations.

        Raises
        ------
        LinAlgError
            If the observations are so far from the prior that rounding errors dominate.
        """
        explained = (self.information.vector * self.found.blocks).sum()
        explained += self.information.edge @ self.found.lasting
        square = self.fit + self.chain.constant - float(explained)
        if not square > -1:  # negative only by rounding
            raise np.linalg.LinAlgError("squared standard deviations are negative")
        return max(square, 0.0)

    @property
    def evidence(self) -> float:
        """Log density of the observations, up to a constant, by Laplace's method."""
        return 0.5 * (self.chain.log_det - self.found.log_det - self.square)


class Problem:
    """Prior, observations and constraints of one sequence."""

    def __init__(
        self,
        prior: SegmentPrior,
        observed: Observed,
        view: AnyView,
        freedom: Freedom,
        start: Start | State,
        contact: bool = False,
        bones: bool = False,
        balance: bool = False,
        chained: Prior | None = None,
    ) -> None:
        self.prior, self.visible, self.view, self.freedom = prior, observed, view, freedom
        self._chained = Prior(prior) if chained is None else chained
        self.contact, self.bones, self.balance = contact, bones, balance
        self.points = observed.points
        self.grid = Grid.over(observed.time, prior)
        self.at = self.grid.between(observed.time)
        unit = float(np.mean(start.lengths)) if view.scaled else None
        self.errors = LastingErrors(
            observed.time,
            np.zeros(observed.points.sd.shape) if observed.lasting_sd is None else observed.lasting_sd,
            observed.lasting_s,
        )
        self.layout = Layout(self.grid.blocks, self.grid.frames, len(prior.names), unit, self.errors.count)

    def part(self, first: int, end: int) -> Problem:
        """Return the problem of blocks `first` <= block < `end`, without frames that need other blocks."""
        own, low, rows = copy(self), first * self.grid.frames, self.rows_of(first, end)
        own.grid = replace(self.grid, begin=float(self.grid.time[low]), blocks=end - first)
        own.at = self.at[0][rows] - low, self.at[1][rows]
        own.visible = self.visible.part(rows)
        own.points = Observations(self.points.uv[rows], self.points.sd[rows])
        own.errors = self.errors.part(rows)
        own.layout = replace(self.layout, blocks=end - first)
        return own

    def rows_of(self, first: int, end: int) -> Ints:
        """Find frames of the video that need only the blocks `first` <= block < `end`."""
        block = self.at[0] // self.grid.frames
        return np.flatnonzero(((block >= first) & (block < end)).all(axis=1))

    def first(self, start: Start) -> State:
        """Linearise the chain around the first guess."""
        shape = overlapping(start.places, self.grid.frames)
        around = Around(start.heading, start.component, start.stature, shape, shape)
        lasting = np.zeros(WHOLE_BODY_UNKNOWNS + 3 * len(self.prior.names))
        return State(around, start.places, start.lengths, lasting, np.zeros(self.errors.count), 0)

    def weight(self, state: State) -> None:
        """Down-weight points that are far from an estimate."""
        points, by_hand = weighted(self.visible.points, self.predicted(state)), self.visible.by_hand
        if by_hand is not None:
            points = Observations(points.uv, np.where(by_hand, self.visible.points.sd, points.sd))
        self.points = points

    def predicted(self, state: State) -> Floats:
        """Predict points (T, P, 2) in the picture."""
        places = self.at_video(state.places)[:, self.visible.markers]
        errors = self.errors.in_picture(state.errors)
        return self.view.project(places, self.at_video(state.lengths)) + errors

    def chain(self, state: State) -> Chain:
        """Return the prior, linearised around an estimate."""
        return chain(self._chained, state.around, self.freedom)

    def system(self, state: State, prior: Chain, constrained: bool) -> _System:
        """Solve the linear problem around an estimate."""
        information, fit = self.information(state, prior, constrained)
        return _System(block_arrowhead.solve(information), information, prior, fit)

    def information(self, state: State, prior: Chain, constrained: bool) -> tuple[Information, float]:
        """Set up the linear problem around an estimate; also return y' W y of the observations."""
        shape = blended(state.around.places, self.grid.frames)
        rows = Rows(self.layout)
        self._observe(rows, shape, state)
        if constrained and self.contact:
            sure = soft_constraints.contacts(rows, self.prior.names, shape, self.grid.rate)
            if self.balance:
                keep_balance(rows, self.prior.names, shape, sure, self.grid.rate)
        if constrained and self.bones:
            soft_constraints.bones(rows, self.prior.names, shape)
        observed, fit = rows.normal()
        own, used = prior.information, prior.information.diagonal.shape[1]
        observed.diagonal[:, :used, :used] += own.diagonal
        observed.below[:, :used, :used] += own.below
        observed.vector[:, :used] += own.vector
        border = np.pad(own.border, ((0, 0), (0, self.layout.size - used), (0, 0)))
        both = Information(
            observed.diagonal,
            observed.below,
            np.concatenate([border, observed.border], axis=2),
            block_diag(own.corner, np.eye(self.errors.count) + observed.corner),
            observed.vector,
            np.append(own.edge, observed.edge),
        )
        return both, fit

    def _observe(self, rows: Rows, shape: Floats, state: State) -> None:
        near, scale = self.at_video(shape), self.at_video(state.lengths)
        guess = self.at_video(state.places)[:, self.visible.markers]
        observed = rows_of(self.view, self.points, near[:, self.visible.markers], scale, guess)
        if not len(observed.frame):
            raise np.linalg.LinAlgError("no point is in front of the camera")
        factors = None
        if isinstance(self.view, Parallel) and self.view.scaled:
            observed, factors = scale_free(observed, near[:, self.visible.markers], scale)
            soft_constraints.steady_lengths(rows, state.lengths, None if self.view.steady else SCALE_DRIFT)
        numbers, pixels = self.errors.factors(observed.frame, observed.marker)
        unit = np.sqrt(observed.variance) / self.points.sd[observed.frame, observed.marker, None]
        lasting = numbers, unit[:, :, None] * pixels[:, None]
        soft_constraints.observe(rows, observed, self.visible.markers, self.at, factors, lasting)
        if self.visible.pins is not None:
            soft_constraints.pin(rows, self.visible.pins, self.at)

    def inner_step(self, state: State, held: tuple[bool, bool]) -> State:
        """Estimate a part as `step` does, given the lasting unknowns, and the end blocks if they are held."""
        prior = self.chain(state)
        found, _ = self.information(state, prior, constrained=True)
        first, end = int(held[0]), self.layout.blocks - int(held[1])
        values = self.layout.values(state.places, state.lengths)
        right = found.vector - found.border @ np.concatenate([state.lasting, state.errors])
        if held[0]:
            right[1] -= found.below[0] @ values[0]
        if held[1]:
            right[-2] -= found.below[-1].T @ values[-1]
        solved = block_arrowhead.factor(found.diagonal[first:end], found.below[first : end - 1])
        values[first:end] = solved.solve(right[first:end, :, None])[..., 0]
        places = self.layout.places(values)
        lengths = self.layout.lengths(values) if self.view.scaled else state.lengths
        around = moved(prior, state.around, self.freedom, places, state.lasting)
        return replace(state, around=around, places=places, lengths=lengths, steps=state.steps + 1)

    def at_video(self, values: Floats) -> Floats:
        """Interpolate values (grid, ...) at the frames of the video."""
        return interpolated(values, *self.at)

    def step(self, state: State, constrained: bool) -> State:
        """Make a new estimate from the linear problem around a state."""
        prior = self.chain(state)
        found = self.system(state, prior, constrained).found
        places = self.layout.places(found.blocks)
        lengths = self.layout.lengths(found.blocks) if self.view.scaled else state.lengths
        lasting, errors = np.split(found.lasting, [len(found.lasting) - self.errors.count])
        around = moved(prior, state.around, self.freedom, places, lasting)
        return State(around, places, lengths, lasting, errors, state.steps + 1)

    def evidence(self, unconstrained: _System) -> float:
        """Return the log density of the observations, up to a constant."""
        return unconstrained.evidence - _cost(self.visible.points, self.points)

    def result(self, state: State, settled: bool, covariances: bool) -> Lifted:
        """Compute covariances and figures of the final estimate."""
        prior = self.chain(state)
        system = self.system(state, prior, constrained=True)
        unconstrained = self.system(state, prior, constrained=False)
        around, places = state.around, state.places
        covariance = system.found.covariance()
        every = np.arange(self.layout.markers)
        variances = self._covariances(*covariance, every, every)
        sure = soft_constraints.contacts(Rows(self.layout), self.prior.names, places, self.grid.rate)
        return Lifted(
            places=self.at_video(places),
            sd=_roots(variances),
            rooted_sd=_roots(self._rooted(variances, *covariance)),
            grid=places,
            heading=around.heading,
            stature=around.stature,
            lengths=self.at_video(state.lengths),
            contact=sure if self.contact else np.zeros_like(sure),
            steps=state.steps,
            settled=settled,
            log_volume_ratio=unconstrained.log_volume_ratio,
            evidence=self.evidence(unconstrained),
            outliers=self.points.sd > self.visible.points.sd,
            chi2_per_observation=unconstrained.square / max(2 * int(self.visible.points.visible.sum()), 1),
            state=state,
            covariance=self._frame_covariances(*covariance) if covariances else None,
        )

    def _rooted(self, own: Floats, diagonal: Floats, across: Floats) -> Floats:
        """Compute variances (T, J, 3) relative to the middle of the hips; without hips return `own`."""
        every = np.arange(self.layout.markers)
        if not set(HIP_JOINTS) <= set(self.prior.names):
            return own
        left, right = self.prior.index(HIP_JOINTS)
        with_left, with_right = (
            self._covariances(diagonal, across, every, np.full_like(every, hip)) for hip in (left, right)
        )
        with_both = with_left + with_right
        middle = with_both[:, [left, right]].sum(axis=1, keepdims=True) / 4
        return np.asarray(own + middle - with_both)

    def _covariances(self, diagonal: Floats, across: Floats, first: Ints, second: Ints) -> Floats:
        """Compute covariances (T, n, 3), by coordinate, of interpolated markers (n,) with others (n,)."""
        frames, weights = self.at
        layout, axes = self.layout, np.arange(3)
        total = np.zeros((len(frames), len(first), 3))
        for i in range(frames.shape[1]):
            for k in range(frames.shape[1]):
                one, other = (
                    layout.place(frames[:, [at]], markers)[..., None] + axes
                    for at, markers in ((i, first), (k, second))
                )
                value = _entries(
                    diagonal, across, *np.divmod(one, layout.size), *np.divmod(other, layout.size)
                )
                total += (weights[:, i] * weights[:, k])[:, None, None] * value
        return total

    def _frame_covariances(self, diagonal: Floats, across: Floats) -> Floats:
        """Compute covariances (T, 3 J, 3 J) of the interpolated coordinates of each frame."""
        frames, weights = self.at
        every = np.arange(self.layout.markers)
        total = np.empty((len(frames), 3 * len(every), 3 * len(every)))
        for t, (nodes, shares) in enumerate(zip(frames, weights, strict=True)):
            places = self.layout.place(nodes[:, None], every)[..., None] + np.arange(3)
            block, row = np.divmod(places.reshape(-1), self.layout.size)
            near = _entries(diagonal, across, block[:, None], row[:, None], block, row)
            apart = near.reshape(len(nodes), total.shape[1], len(nodes), total.shape[1])
            total[t] = np.einsum("w,wavb,v->ab", shares, apart, shares)
        return total


def _entries(diagonal: Floats, across: Floats, s: Ints, row: Ints, o: Ints, column: Ints) -> Floats:
    """Return covariances of unknowns `row` of blocks `s` with unknowns `column` of blocks `o`."""
    low, high = np.minimum(s, o), np.maximum(s, o)
    later, sooner = np.where(s >= o, row, column), np.where(s >= o, column, row)
    return np.where(
        low == high, diagonal[high, later, sooner], across[np.minimum(low, len(across) - 1), later, sooner]
    )


def weighted(points: Observations, predicted: Floats) -> Observations:
    """Enlarge the standard deviations of points that are far from their predictions (T, P, 2)."""
    sd = points.sd.copy()
    square = np.sum((points.uv - predicted) ** 2, axis=2) / sd**2
    for t, observed in enumerate(points.visible):
        if observed.any():
            sd[t, observed] = weight_outliers(square[t, observed], sd[t, observed])
    return Observations(points.uv, sd)


def _cost(points: Observations, trusted: Observations) -> float:
    """Log density lost by larger standard deviations, with two coordinates per point."""
    observed = points.visible
    return 2 * float(np.log(trusted.sd[observed] / points.sd[observed]).sum())


def _roots(variances: Floats) -> Floats:
    """Square roots of variances, which are negative only by rounding."""
    return np.asarray(np.sqrt(np.maximum(variances, 0.0)))


def _change(difference: Floats) -> float:
    """Rms of a change (grid, J, 3) without its mean, which an orthographic view does not determine."""
    return float(np.sqrt(np.mean((difference - difference.mean(axis=(0, 1))) ** 2)))
