"""Lift keypoints to motion in space, by any of four methods.

- smooth: one Gaussian over the whole sequence (`gait.lift.smooth.smoother`).
- blend: overlapping segments, each estimated by itself, blended with triangular weights (Leventon and Freeman
  1998).
- segment: segments one after another.
- likelihood: like blend, but by least squares in the modes instead of with the prior, for comparison (their
  fig. 5).

Raises UserError for keypoints that show too little, and for estimates that cannot be a person.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import JOINTS
from gait.camera.camera import Camera
from gait.errors import GaitError, UsageError, UserError
from gait.io.keypoints_file import LONGEST_KEYPOINT_GAP_S, Keypoints
from gait.lift.keypoints.corrections import Pins
from gait.lift.keypoints.observations import (
    Grid,
    Observations,
    interpolated,
    resampled,
)
from gait.lift.keypoints.swaps import Reading
from gait.lift.segment import explain
from gait.lift.segment.explain import FEWEST_VISIBLE, Explanation, SegmentFit, SegmentLifter, Uncertain
from gait.lift.segment.view import AnyView, Parallel, Perspective, Several, View
from gait.lift.smooth import size, smoother, soft_constraints
from gait.lift.smooth.chain import Freedom, Prior, blended, in_turn
from gait.lift.smooth.options import Options
from gait.lift.smooth.smoother import Lifted, Observed, Start, State

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """Lifted keypoints.

    Attributes
    ----------
    names : tuple of str
        The J markers.
    places, sd : (T, J, 3)
        Positions and their posterior standard deviations, metres.
    rooted_sd : (T, J, 3)
        Standard deviations of positions relative to the middle of the hips.
    error : (T, P)
        Reprojection error of each point, pixels; NaN where it was not visible.
    stature : float
        Metres; not estimated, but expected, if segments were estimated alone.
    steps : int
        Iterations over the whole sequence; 0 for segments alone.
    settled : bool
        Whether the iteration converged.
    log_volume_ratio : float
        log10 of posterior over prior volume; for segments alone, their mean.
    uncertain : Uncertain
        Uncertainty of its segments, each estimated alone.
    evidence : float
        Log density of the observations, up to a constant; NaN for segments alone.
    chi2_per_observation : float
        Squared residual, in standard deviations, per observation, about 1; NaN for segments alone.
    wider : float
        Factor of the prior's standard deviations that the keypoints needed; 1 for motions like those in
        training.
    resized : float
        Factor by which the fit's size was changed to that of a person; 1 for motions like those in training.
    alone : bool
        Whether the motion was so unlike those in training that its segments were estimated alone instead.
    outliers : (T, P)
        Whether each point was down-weighted because it is far from its prediction; None for segments alone.
    uv : (T, J, 2)
        The markers in the picture.
    state : State
        State of the smoother, from which it can continue; None for segments alone.
    covariance : (T, 3 J, 3 J) or None
        Covariance of all coordinates of a frame's markers, square metres, if the options ask for it; None for
        segments alone.
    """

    names: tuple[str, ...]
    places: Floats
    sd: Floats
    rooted_sd: Floats
    error: Floats
    stature: float
    steps: int
    settled: bool
    log_volume_ratio: float
    uncertain: Uncertain
    evidence: float = float("nan")
    chi2_per_observation: float = float("nan")
    wider: float = 1.0
    resized: float = 1.0
    alone: bool = False
    outliers: npt.NDArray[np.bool_] | None = None
    uv: Floats | None = None
    state: State | None = None
    covariance: Floats | None = None

    @property
    def unlike(self) -> bool:
        """Whether the motion is unlike those in training."""
        return self.wider > 1 or self.alone or self.resized != 1


class Unlike(UserError):
    """The keypoints show a motion unlike the prior's; a wider prior may help."""


# Largest height of a camera that sees feet, over the distance that follows from the person's size in the
# picture.
HIGH = 4.0
EXTENT_RANGE = (0.6, 1.6)  # range of the extent over that of the mean body; no person is smaller or larger


def require_metres(
    camera: Camera, keypoints: Keypoints, prior: SegmentPrior, stature: float, options: Options
) -> None:
    """Raise UserError if a camera is much higher than the person is away, since its t is not in metres."""
    points = Observations(keypoints.uv, keypoints.standard_deviations(options.pixel_sd))
    observed = points.among(prior.index(keypoints.names), len(prior.names))
    flat = Parallel(camera.R, None, np.zeros(2))
    try:
        lengths = flat.lengths(observed, prior.mean[0].mean(axis=0), stature)
    except UsageError:  # too few points at any time to show a size
        return
    away, height = float((camera.fx + camera.fy) / 2 * lengths[0]), float(camera.centre[2])
    if abs(height) > HIGH * away + stature + 3 * options.floor_sd:
        raise UserError(
            f"the camera is {height:.0f} m above the floor but sees a person {away:.2g} m away: give its "
            "t in metres (R, t: world to camera, z up, floor at z = 0)"
        )


def require_visible(found: list[list[Explanation]], grid: Grid, keypoints: Keypoints, alone: bool) -> None:
    """Raise UserError if almost nothing is visible, or nothing in a segment if each is estimated `alone`."""
    if not any(found):
        step = float(np.median(np.diff(keypoints.time[keypoints.visible.any(axis=1)], append=np.inf)))
        if LONGEST_KEYPOINT_GAP_S <= step < np.inf:
            raise UserError(
                f"{1 / step:.2g} frames per second with points are too few to follow a motion; give "
                f"{np.ceil(1 / LONGEST_KEYPOINT_GAP_S):.0f} or more (and check time: seconds)"
            )
        raise UserError(
            f"fewer than {FEWEST_VISIBLE} points are visible in every segment; give more keypoints"
        )
    empty = next((s for s, choices in enumerate(found) if not choices), None)
    if alone and empty is not None:
        at = grid.time[empty * grid.frames]
        raise UserError(
            f"almost no points are visible from {at:.2f} s on; use --method smooth across the gap"
        )


def require_size(places: Floats, prior: SegmentPrior, stature: float) -> None:
    """Raise Unlike for an estimate that shrank or grew to fit a motion unlike the prior's."""
    ratio = _extent(places) / (stature * _extent(prior.mean[0]))
    if not EXTENT_RANGE[0] < ratio < EXTENT_RANGE[1]:
        raise Unlike(
            f"the estimate is {ratio:.2f} times a person's size: the motion is unlike the model's, or "
            "the camera wrong (R, t: world to camera, t in metres?); learn a model with such motions, or use "
            "--method blend"
        )


def _extent(places: Floats) -> float:
    """Mean distance of markers (T, J, 3) from their middle."""
    apart = places - places.mean(axis=1, keepdims=True)
    return float(np.linalg.norm(apart, axis=2).mean())


KNOWN_SD, PEOPLE_SD = 0.04, 0.09  # metres; sd of a given stature, and of people's statures
ANY_HEIGHT = 10.0  # metres; standard deviation of the floor's height without a camera
# Factors of the prior's standard deviations, tried in turn while the keypoints do not fit.
WIDER = (1.0, 2.0, 4.0, 8.0)
FLOATS = 4.0  # standard deviations of the floor's height from which a person does not stand on it
POOR_FIT = 1.3  # chi2 per observation from which a wider prior is tried


def output_names(prior: SegmentPrior, keypoints: Keypoints, everything: bool = False) -> tuple[str, ...]:
    """List the markers to estimate, in the prior's order: joints and those in the keypoints, or all."""
    return tuple(n for n in prior.names if everything or n in JOINTS or n in keypoints.names)


def segments_of(prior: SegmentPrior, keypoints: Keypoints) -> int:
    """Count the overlapping segments of keypoints."""
    return Grid.over(keypoints.time, prior).blocks - 1


@dataclass(frozen=True)
class _Sequence:
    """Keypoints, with everything needed to lift them, and the grid of times."""

    prior: SegmentPrior
    keypoints: Keypoints
    view: AnyView
    options: Options
    grid: Grid
    update: Callable[[int], None] = lambda done: None
    pins: Pins | None = None

    @property
    def markers(self) -> npt.NDArray[np.intp]:
        """Index of each keypoint's marker in the prior."""
        return self.prior.index(self.keypoints.names)

    def alone(self) -> tuple[_Sequence, View]:
        """Return the observations of one camera; of several, the one that sees most points."""
        if not isinstance(self.view, Several):
            return self, self.view
        counts = np.bincount(self.view.of_point, self.keypoints.visible.sum(axis=0))
        number = int(counts.argmax())
        own, view = self.keypoints.among(self.view.of_point == number), self.view.alone(number)
        return replace(self, keypoints=own, view=view), view


def lift(
    prior: SegmentPrior,
    keypoints: Keypoints,
    view: AnyView,
    options: Options,
    names: tuple[str, ...],
    update: Callable[[int], None] = lambda done: None,
    pins: Pins | None = None,
) -> Motion:
    """Estimate markers of a prior over all frames of keypoints; `pins`: feet at known positions.

    Raises
    ------
    UserError
        If segments are too short, or too little is visible.
    """
    require(prior, keypoints, view, options)
    prior = prior.restricted(names)
    of = _Sequence(prior, keypoints, view, options, Grid.over(keypoints.time, prior), update, pins)
    if options.method != "smooth":
        return _lift(of)
    best = _widest_needed(of)
    several = isinstance(view, Several)  # segments alone use one view
    return _unlike(of, best) if (best.wider > 1 or not best.settled) and not several else best


def problem_of(
    prior: SegmentPrior, keypoints: Keypoints, view: AnyView, options: Options, pins: Pins | None
) -> tuple[Observed, Freedom]:
    """Set up the smoother's problem for keypoints."""
    of = _Sequence(prior, keypoints, view, options, Grid.over(keypoints.time, prior), pins=pins)
    return _observed(of), _freedom(of)


def require(prior: SegmentPrior, keypoints: Keypoints, view: AnyView, options: Options) -> None:
    """Raise UserError for a prior with too short segments, or a camera that is not in metres."""
    if prior.frames < 4:
        raise UserError(f"the model's segments have {prior.frames} frames; lifting needs 4 or more")
    if isinstance(view, Perspective):
        require_metres(view.camera, keypoints, prior, believed_stature(options, prior.stature)[0], options)


def _widest_needed(of: _Sequence) -> Motion:
    """Estimate with the prior, or with a wider one if the keypoints do not fit."""
    best: Motion | None = None
    refused: Unlike | None = None
    for wider in WIDER:
        try:
            found = _lift(replace(of, prior=of.prior.widened(wider)))
        except Unlike as error:
            refused = refused or error
            if best is None:
                continue
            break
        if best is not None and found.evidence <= best.evidence:
            break
        best = replace(found, wider=wider)
        if not found.chi2_per_observation > POOR_FIT:
            break
    if best is None:
        assert refused is not None
        raise refused
    return best


def _unlike(of: _Sequence, found: Motion) -> Motion:
    """Estimate a motion that the prior does not know from its segments alone, as their chain would fail.

    Size and standard deviations are then corrected by the bones and by the chi2 of the whole, which single
    segments do not show.
    """
    try:
        alone = _lift(replace(of, options=replace(of.options, method="blend"), update=lambda done: None))
    except UserError:  # segments in which almost nothing is visible
        return found
    chi2 = max(found.chi2_per_observation, 1.0) * found.wider**2
    sized = _sized(of, alone, chi2)
    return replace(
        alone,
        places=sized.places,
        sd=sized.sd,
        rooted_sd=sized.rooted_sd,
        evidence=found.evidence,
        chi2_per_observation=found.chi2_per_observation,
        wider=found.wider,
        resized=sized.factor,
        outliers=found.outliers,
        state=found.state,
        alone=True,
    )


@contextmanager
def _numbers_in_range() -> Iterator[None]:
    """Raise Unlike if numbers overflow within the block."""
    try:
        yield
    except (np.linalg.LinAlgError, GaitError):
        raise Unlike(
            "the keypoints do not fit any motion that the model knows; check the camera, the points' names "
            "and that v points down"
        ) from None


@dataclass(frozen=True)
class _Task:
    """Estimates of single segments, from which the smoother starts."""

    observed: Observed
    freedom: Freedom
    stature: float
    lengths: Floats
    fits: list[SegmentFit]

    def start(self, frames: int) -> Start:
        """Blend the segments, with blocks of `frames`, to a start of the smoother."""
        return Start(
            heading=np.array([fit.heading for fit in self.fits]),
            component=np.array([fit.component for fit in self.fits]),
            stature=self.stature,
            places=blended(np.stack([fit.places for fit in self.fits]), frames),
            lengths=self.lengths,
        )


def _lifter(prior: SegmentPrior, view: View, options: Options) -> SegmentLifter:
    """Make the lifter of single segments."""
    stature, stature_sd = believed_stature(options, prior.stature)
    # a start must not shrink a motion that does not fit, as noise in the picture would then grow
    return SegmentLifter(prior, view, stature, 0.0 if options.method == "smooth" else stature_sd)


def _task(of: _Sequence, displacements: int | None, lifter: SegmentLifter | None = None) -> _Task:
    """Estimate each segment alone, with this many displacements (see `solve`), with `lifter` if given."""
    one, view = of.alone()
    prior, keypoints, options, grid = one.prior, one.keypoints, one.options, one.grid
    points = Observations(keypoints.uv, keypoints.errors(options.pixel_sd))
    sampled = resampled(points, keypoints.time, grid.time).among(one.markers, len(prior.names))
    stature, stature_sd = believed_stature(options, prior.stature)
    lengths = np.ones(len(grid.time))
    if isinstance(view, Parallel):
        lengths = view.lengths(sampled, prior.mean[0].mean(axis=0), stature)
        sampled = view.metric(sampled, lengths)
    lifter = lifter or _lifter(prior, view, options)
    found = explain.explanations(lifter, prior, sampled, of.update)
    require_visible(found, grid, keypoints, alone=options.method != "smooth")
    course = explain.course(found)
    if options.method == "likelihood":
        fits = explain.without_prior(
            prior, view, stature, believed_stature(options, prior.stature)[1], course
        )
    else:
        fits = [lifter.solve(each, displacements) for each in course]
    return _Task(_observed(of), _freedom(of), stature, lengths, fits)


def _freedom(of: _Sequence) -> Freedom:
    """Return the freedom of the whole sequence in addition to the prior's modes."""
    stature, stature_sd = believed_stature(of.options, of.prior.stature)
    return Freedom(stature, stature_sd, of.options.floor_sd if of.view.grounded else ANY_HEIGHT)


def _observed(of: _Sequence) -> Observed:
    """Return the observations for the smoother."""
    keypoints, pinned = of.keypoints, of.pins
    return Observed(
        keypoints.time,
        Observations(keypoints.uv, keypoints.changing(of.options.pixel_sd, whole=True)),
        of.markers,
        keypoints.lasting_sd,
        keypoints.lasting_s,
        None if keypoints.by_hand is None else np.isfinite(keypoints.by_hand),
        None
        if pinned is None
        else soft_constraints.Pins(pinned.row, of.prior.index(pinned.joint), pinned.place, pinned.sd),
    )


class Evidence:
    """Log density of keypoints under a prior, by the smoother, for keypoints that differ in few frames.

    Parameters
    ----------
    names : tuple of str
        Names of the points.
    """

    def __init__(self, prior: SegmentPrior, names: tuple[str, ...], view: AnyView, options: Options) -> None:
        self._view, self._options = view, replace(options, method="smooth")
        self._prior = prior.restricted(tuple(n for n in prior.names if n in {*names, *smoother.HIP_JOINTS}))

    @cached_property
    def _lifter(self) -> SegmentLifter:
        assert not isinstance(self._view, Several)  # swaps are searched for in one camera's keypoints
        return _lifter(self._prior, self._view, self._options)

    @cached_property
    def _chained(self) -> Prior:
        return Prior(self._prior)

    @_numbers_in_range()
    def _read(self, keypoints: Keypoints, near: Reading | None) -> Reading:
        grid = Grid.over(keypoints.time, self._prior)
        of = _Sequence(self._prior, keypoints, self._view, self._options, grid)
        begun: Start | State
        if near is not None and near.motion is not None:
            begun = near.motion
        else:
            begun = _task(of, displacements=0, lifter=self._lifter).start(grid.frames)
        return Reading(*smoother.evidence(self._chained, _observed(of), self._view, _freedom(of), begun))

    def __call__(self, keypoints: Keypoints, near: Reading | None = None) -> Reading:
        """Fit keypoints; -inf and NaN if the smoother fails.

        `near`: the result for similar keypoints, whose motion is the starting point.
        """
        try:
            return self._read(keypoints, near)
        except UserError:
            return Reading(-np.inf, np.full_like(keypoints.uv, np.nan))


@_numbers_in_range()
def _lift(of: _Sequence) -> Motion:
    """Estimate all markers of a prior."""
    if of.options.method != "smooth":
        return _alone(of, _task(of, displacements=None))
    task = _task(of, displacements=explain.DISPLACEMENTS)
    found = smoother.smooth(
        of.prior,
        task.observed,
        of.view,
        task.freedom,
        task.start(of.grid.frames),
        contact=of.options.contact,
        bones=of.options.bones,
        balance=of.options.balance,
        covariance=of.options.covariance,
    )
    chi2 = found.chi2_per_observation / _usual_chi2(of)
    sized = _sized(of, found, chi2)
    require_size(sized.places, of.prior, task.stature)
    return Motion(
        of.prior.names,
        _placed(of, sized.places),
        sized.sd,
        sized.rooted_sd,
        _error(of, sized.places, found.lengths),
        found.stature,
        found.steps,
        found.settled,
        found.log_volume_ratio,
        explain.summarise(task.fits, of.alone()[1]),
        found.evidence,
        chi2,
        resized=sized.factor,
        outliers=found.outliers,
        uv=of.view.alone().project(sized.places, found.lengths),
        state=found.state,
        covariance=sized.covariance,
    )


def _usual_chi2(of: _Sequence) -> float:
    """Chi2 per observation of a motion that fits.

    A detector's standard deviations are enlarged so that frames count as independent; the chi2 of a motion
    that fits is then as much smaller, and compared with 1 no motion would look unlike the prior.  With one
    camera, where a wider prior leaves the depth open, it is taken as 1.
    """
    keypoints = of.keypoints
    if not isinstance(of.view, Several) or keypoints.frame_sd is None or keypoints.lasting_sd is None:
        return 1.0
    changing = keypoints.frame_sd**2 - keypoints.lasting_sd**2
    shares = changing / keypoints.changing(of.options.pixel_sd, whole=True) ** 2
    return float(np.where(np.isfinite(shares), shares, 1.0)[keypoints.visible].mean())


def believed_stature(options: Options, usual: float) -> tuple[float, float]:
    """Return the expected stature and its standard deviation, metres; `usual`: mean stature of people."""
    return options.stature or usual, KNOWN_SD if options.stature else PEOPLE_SD


def _sized(of: _Sequence, found: Lifted | Motion | size.Resized, chi2: float) -> size.Resized:
    """Change the estimate's size if it cannot be a person's, which can only happen with a perspective camera.

    If a motion fits and stands on the floor, it is like the prior's, and prior and floor determine its size
    better than the bones do, unless the prior has placed joints that were not visible to suit them.
    """
    prior, view, options = of.prior, of.view, of.options
    fitted = size.Resized(found.places, found.sd, found.rooted_sd, covariance=found.covariance)
    if not isinstance(view, Perspective) or not options.bones:
        return size.widened(fitted, chi2)
    stature, stature_sd = believed_stature(options, prior.stature)
    own = float(np.hypot(stature_sd / stature, size.PROPORTION_SD))
    ratio = size.bones_ratio(prior, found.places, stature)
    floats = abs(_height(found.places, prior)) > FLOATS * options.floor_sd
    limit = size.UNLIKELY if chi2 > POOR_FIT or floats else size.IMPOSSIBLE
    sized = size.resized(fitted, view.camera, ratio, own, chi2, limit)
    if sized.factor != 1 or size.shows_distance(of.keypoints):
        return sized
    return size.of_any_size(sized, view.camera, own)


def _alone(of: _Sequence, task: _Task) -> Motion:
    """Estimate segments alone, and blend or concatenate them."""
    prior, grid, fits = of.prior, of.grid, task.fits
    places, sds = np.stack([fit.places for fit in fits]), np.stack([fit.sd for fit in fits])
    join = in_turn if of.options.method == "segment" else blended
    at = grid.between(of.keypoints.time)
    placed, scale = interpolated(join(places, grid.frames), *at), interpolated(task.lengths, *at)
    rooted, about_hips = places, sds
    if set(smoother.HIP_JOINTS) <= set(prior.names):
        hips = prior.index(smoother.HIP_JOINTS)
        rooted = places - places[:, :, hips].mean(axis=2, keepdims=True)
        about_hips = np.stack([fit.rooted_sd(hips) for fit in fits])
    sd, rooted_sd = (
        interpolated(_mixed(*of, join, grid.frames), at[0], np.abs(at[1]))
        for of in ((places, sds), (rooted, about_hips))
    )
    return Motion(
        names=prior.names,
        places=_placed(of, placed),
        sd=sd,
        rooted_sd=rooted_sd,
        error=_error(of, placed, scale),
        stature=task.stature,
        steps=0,
        settled=True,
        log_volume_ratio=float(np.mean([fit.log10_volume for fit in fits])),
        uncertain=explain.summarise(fits, of.alone()[1]),
        uv=of.view.project(placed, scale),
    )


def _mixed(places: Floats, sd: Floats, join: Callable[[Floats, int], Floats], half: int) -> Floats:
    """Return standard deviations of blended overlapping segments.

    Neighbours use the same points, so together they are not more certain than alone, and less so if they
    differ.
    """
    apart = join(places**2, half) - join(places, half) ** 2
    return np.asarray(np.sqrt(join(sd, half) ** 2 + np.maximum(apart, 0.0)))


def _error(of: _Sequence, places: Floats, lengths: Floats) -> Floats:
    """Distance (T, P) of markers from the observations in the picture; without a camera, up to a shift."""
    miss = of.view.project(places[:, of.markers], lengths) - of.keypoints.uv
    if not of.view.grounded:
        observed = np.isfinite(miss).all(axis=2, keepdims=True)
        total = np.where(observed, miss, 0).sum(axis=1, keepdims=True)
        miss = miss - total / np.maximum(observed.sum(axis=1, keepdims=True), 1)
    return np.asarray(np.linalg.norm(miss, axis=2))


def _placed(of: _Sequence, places: Floats) -> Floats:
    """Return positions; if the height is unknown, shifted so that the lowest feet are on the floor."""
    return places if of.view.grounded else places - np.array([0.0, 0.0, _height(places, of.prior)])


def _height(places: Floats, prior: SegmentPrior) -> float:
    """Height of the lowest feet above the floor, metres; 0 without feet."""
    feet = [i for i, name in enumerate(prior.names) if name.endswith(("_toe", "_heel", "_ankle"))]
    if not feet:
        return 0.0
    lowest = prior.stature * prior.mean[:, :, feet, 2].min()
    return float(np.quantile(places[:, feet, 2].min(axis=1), 0.1) - lowest)
