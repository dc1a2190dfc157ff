"""From tracks of points in one view to motion in space, by any of four methods.

smooth: one Gaussian over the whole sequence (`gait.lift.sequence`).  blend: overlapping segments estimated
alone and mixed by triangular weights (Leventon and Freeman 1998).  segment: segments one after another.
likelihood: as blend, by least squares in the modes instead of the prior, for comparison (their fig. 5).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import JOINTS
from gait.bindings.segment_prior import SegmentPrior
from gait.errors import GaitError, UserError
from gait.lift import explain, sequence, size
from gait.lift.chain import Freedom, blended, in_turn
from gait.lift.equations import Parallel, Perspective, View
from gait.lift.grid import Grid, interpolated
from gait.lift.explain import SegmentFit, SegmentLifter
from gait.lift.observe import Observations, resampled
from gait.lift.refuse import Unlike, require_metres, require_seen, require_size
from gait.lift.result import Motion, Options
from gait.lift.sequence import Lifted, Seen, Start
from gait.io.keypoints_file import Tracks

Floats = npt.NDArray[np.float64]

KNOWN_SD, PEOPLE_SD = 0.04, 0.09  # metres, of a stature that is given, and among people
ANY_HEIGHT = 10.0  # metres, deviation of the floor's height without a camera
WIDER = (1.0, 2.0, 4.0, 8.0)  # factors of the prior's deviations, tried in turn while the tracks ask for it
FLOATS = 4.0  # deviations of the floor's height from which somebody does not stand on it
MISFIT = 1.3  # squared deviations per number seen from which a wider prior is tried


def output_names(prior: SegmentPrior, tracks: Tracks, everything: bool = False) -> tuple[str, ...]:
    """Markers to estimate, in the prior's order: joints, those in the tracks, or all."""
    return tuple(n for n in prior.names if everything or n in JOINTS or n in tracks.names)


def segments_of(prior: SegmentPrior, tracks: Tracks) -> int:
    """Count the overlapping segments of tracks."""
    return Grid.over(tracks.time, prior).blocks - 1


def lift(
    prior: SegmentPrior,
    tracks: Tracks,
    view: View,
    options: Options,
    names: tuple[str, ...],
    update: Callable[[int], None] = lambda done: None,
) -> Motion:
    """Estimate markers of a prior over all frames of tracks.

    Raises
    ------
    UserError
        If segments are too short, or too little is seen.
    """
    require(prior, tracks, view, options)
    prior = prior.restricted(names)
    grid = Grid.over(tracks.time, prior)
    if options.method != "smooth":
        return _lift(prior, tracks, view, options, grid, update)
    best = _widest_needed(prior, tracks, view, options, grid, update)
    if best.wider > 1 or not best.settled:
        return _unlike(prior, tracks, view, options, grid, best)
    return best


def require(prior: SegmentPrior, tracks: Tracks, view: View, options: Options) -> None:
    """Refuse a prior of too short segments, and a camera that is not in metres."""
    if prior.frames < 4:
        raise UserError(f"the model's segments have {prior.frames} frames; lifting needs 4 or more")
    if isinstance(view, Perspective):
        require_metres(view.camera, tracks, prior, believed_stature(options, prior.stature)[0], options)


def evidence(prior: SegmentPrior, tracks: Tracks, view: View, options: Options) -> float:
    """Log density of tracks by the prior and the smoother, but for a constant; -inf if it refuses them."""
    names = tuple(name for name in prior.names if name in {*tracks.names, *sequence.HIPS})
    smooth = replace(options, method="smooth")
    try:
        prior = prior.restricted(names)
        return _lift(prior, tracks, view, smooth, Grid.over(tracks.time, prior), lambda done: None).evidence
    except UserError:
        return -np.inf


def _widest_needed(
    prior: SegmentPrior,
    tracks: Tracks,
    view: View,
    options: Options,
    grid: Grid,
    update: Callable[[int], None],
) -> Motion:
    """Estimate by the prior, or by a wider one if the tracks ask for it."""
    best: Motion | None = None
    refused: Unlike | None = None
    for wider in WIDER:
        try:
            found = _lift(prior.widened(wider), tracks, view, options, grid, update)
        except Unlike as error:
            refused = refused or error
            if best is None:
                continue
            break
        if best is not None and found.evidence <= best.evidence:
            break
        best = replace(found, wider=wider)
        if not found.misfit > MISFIT:
            break
    if best is None:
        assert refused is not None
        raise refused
    return best


def _unlike(
    prior: SegmentPrior, tracks: Tracks, view: View, options: Options, grid: Grid, found: Motion
) -> Motion:
    """Estimate a motion that the prior does not know by its segments alone: a chain of them goes astray.

    Size and deviations are by the bones and by the misfit of the whole, which the segments do not know.
    """
    try:
        alone = _lift(prior, tracks, view, replace(options, method="blend"), grid, lambda done: None)
    except UserError:  # segments in which next to nothing is seen
        return found
    misfit = max(found.misfit, 1.0) * found.wider**2
    sized = _sized(prior, tracks, view, options, alone, misfit)
    return replace(
        alone,
        places=sized.places,
        sd=sized.sd,
        rooted_sd=sized.rooted_sd,
        evidence=found.evidence,
        misfit=found.misfit,
        wider=found.wider,
        resized=sized.factor,
        doubted=found.doubted,
        alone=True,
    )


@contextmanager
def _numbers_in_range() -> Iterator[None]:
    """Unlike if numbers leave their range on the way."""
    try:
        yield
    except (np.linalg.LinAlgError, GaitError):
        raise Unlike(
            "the tracks look like no motion that the model knows; check the camera, the points' names and "
            "that v points down"
        ) from None


@_numbers_in_range()
def _lift(
    prior: SegmentPrior,
    tracks: Tracks,
    view: View,
    options: Options,
    grid: Grid,
    update: Callable[[int], None],
) -> Motion:
    """Estimate all markers of a prior."""
    markers = prior.index(tracks.names)
    points = Observations(tracks.uv, tracks.deviations(options.pixel_sd))
    sampled = resampled(points, tracks.time, grid.time).among(markers, len(prior.names))
    stature, stature_sd = believed_stature(options, prior.stature)
    lengths = np.ones(len(grid.time))
    if isinstance(view, Parallel):
        lengths = view.lengths(sampled, prior.mean[0].mean(axis=0), stature)
        sampled = view.metric(sampled, lengths)
    # a start must not shrink a motion that does not fit: its noise in the picture would grow
    start_sd = 0.0 if options.method == "smooth" else stature_sd
    lifter = SegmentLifter(prior, view, stature, start_sd)
    found = explain.explanations(lifter, prior, sampled, update)
    require_seen(found, grid, tracks, alone=options.method != "smooth")
    course = explain.course(found)
    if options.method == "likelihood":
        fits = explain.without_prior(prior, view, stature, start_sd, course)
    else:
        fits = [lifter.solve(each) for each in course]
    if options.method != "smooth":
        return _alone(prior, fits, tracks, view, grid, lengths, stature, options.method != "segment")
    first = Start(
        heading=np.array([fit.heading for fit in fits]),
        component=np.array([fit.component for fit in fits]),
        stature=stature,
        places=blended(np.stack([fit.places for fit in fits]), grid.frames),
        lengths=lengths,
    )
    freedom = Freedom(stature, stature_sd, options.floor_sd if view.grounded else ANY_HEIGHT)
    seen = Seen(tracks.time, points, markers)
    found_motion = sequence.smooth(
        prior, seen, view, freedom, first, contact=options.contact, bones=options.bones
    )
    sized = _sized(prior, tracks, view, options, found_motion, found_motion.misfit)
    places = sized.places
    require_size(places, prior, stature)
    error = _error(view, places[:, markers], found_motion.lengths, tracks.uv)
    return Motion(
        prior.names,
        places if view.grounded else _on_floor(places, prior),
        sized.sd,
        sized.rooted_sd,
        error,
        found_motion.stature,
        found_motion.steps,
        found_motion.settled,
        found_motion.log_volume_ratio,
        explain.summarise(fits, view),
        found_motion.evidence,
        found_motion.misfit,
        resized=sized.factor,
        doubted=found_motion.doubted,
    )


def believed_stature(options: Options, usual: float) -> tuple[float, float]:
    """Give the stature before anything is seen and how well it is known, metres; `usual`: of people."""
    return options.stature or usual, KNOWN_SD if options.stature else PEOPLE_SD


def _sized(
    prior: SegmentPrior, tracks: Tracks, view: View, options: Options, found: Lifted | Motion, misfit: float
) -> size.Resized:
    """Give the estimate a person's size if it has none; only a lens leaves it open.

    One that fits and stands on the floor is of its prior's kind, and prior and floor know more of its size
    than the bones do, unless joints that nobody sees were put there by the prior to suit them.
    """
    fitted = size.Resized(found.places, found.sd, found.rooted_sd)
    if isinstance(view, Parallel) or not options.bones:
        return size.widened(fitted, misfit)
    stature, stature_sd = believed_stature(options, prior.stature)
    own = float(np.hypot(stature_sd / stature, size.PROPORTION_SD))
    ratio = size.bones_ratio(prior, found.places, stature)
    floats = abs(_height(found.places, prior)) > FLOATS * options.floor_sd
    limit = size.UNLIKELY if misfit > MISFIT or floats else size.IMPOSSIBLE
    sized = size.resized(fitted, view.camera, ratio, own, misfit, limit)
    if sized.factor != 1 or size.tells_distance(tracks):
        return sized
    return size.of_any_size(sized, view.camera, own)


def _alone(
    prior: SegmentPrior,
    fits: list[SegmentFit],
    tracks: Tracks,
    view: View,
    grid: Grid,
    lengths: Floats,
    stature: float,
    blend: bool,
) -> Motion:
    """Segments estimated alone, mixed or one after another."""
    places, spread = np.stack([fit.places for fit in fits]), np.stack([fit.sd for fit in fits])
    join = blended if blend else in_turn
    at = grid.between(tracks.time)
    placed, scale = interpolated(join(places, grid.frames), *at), interpolated(lengths, *at)
    markers = prior.index(tracks.names)
    rooted, about_hips = places, spread
    if set(sequence.HIPS) <= set(prior.names):
        hips = prior.index(sequence.HIPS)
        rooted = places - places[:, :, hips].mean(axis=2, keepdims=True)
        about_hips = np.stack([fit.rooted_sd(hips) for fit in fits])
    sd, rooted_sd = (
        interpolated(_mixed(*of, join, grid.frames), at[0], np.abs(at[1]))
        for of in ((places, spread), (rooted, about_hips))
    )
    return Motion(
        names=prior.names,
        places=placed if view.grounded else _on_floor(placed, prior),
        sd=sd,
        rooted_sd=rooted_sd,
        error=_error(view, placed[:, markers], scale, tracks.uv),
        stature=stature,
        steps=0,
        settled=True,
        log_volume_ratio=float(np.mean([fit.log10_volume for fit in fits])),
        uncertain=explain.summarise(fits, view),
    )


def _mixed(places: Floats, sd: Floats, join: Callable[[Floats, int], Floats], half: int) -> Floats:
    """Deviations of overlapping segments that are mixed.

    Neighbours see the same points: together they are no surer than alone, and where they differ less sure.
    """
    apart = join(places**2, half) - join(places, half) ** 2
    return np.asarray(np.sqrt(join(sd, half) ** 2 + np.maximum(apart, 0.0)))


def _error(view: View, places: Floats, lengths: Floats, uv: Floats) -> Floats:
    """Distance of places (T, P, 3) in the picture from uv (T, P, 2); without a camera but for a shift."""
    miss = view.project(places, lengths) - uv
    if not view.grounded:
        seen = np.isfinite(miss).all(axis=2, keepdims=True)
        total = np.where(seen, miss, 0).sum(axis=1, keepdims=True)
        miss = miss - total / np.maximum(seen.sum(axis=1, keepdims=True), 1)
    return np.asarray(np.linalg.norm(miss, axis=2))


def _on_floor(places: Floats, prior: SegmentPrior) -> Floats:
    """Shift a motion of unknown height so that its lowest feet are on the floor."""
    return places - np.array([0.0, 0.0, _height(places, prior)])


def _height(places: Floats, prior: SegmentPrior) -> float:
    """How high over the floor the lowest feet stand, metres; 0 without feet."""
    feet = [i for i, name in enumerate(prior.names) if name.endswith(("_toe", "_heel", "_ankle"))]
    if not feet:
        return 0.0
    lowest = prior.stature * prior.mean[:, :, feet, 2].min()
    return float(np.quantile(places[:, feet, 2].min(axis=1), 0.1) - lowest)
