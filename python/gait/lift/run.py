"""Lift files of 2-D keypoints for `gait lift` and `gait report lift`: read, repair, lift, and warn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gait.bindings.segment_prior import SegmentPrior
from gait.bindings.state import state_range
from gait.camera.camera import Camera
from gait.camera.synchronise import Film, no_shared_frame, same_person, synchronise
from gait.counts import count_of
from gait.errors import UserError
from gait.io import keypoints_file
from gait.io.detections import Clip
from gait.io.keypoints_file import LONGEST_KEYPOINT_GAP_S, Keypoints
from gait.lift.keypoints import noise, swaps
from gait.lift.keypoints.corrections import Edits, corrected, pins, read_edits
from gait.lift.keypoints.joined import joined
from gait.lift.segment.view import AnyView, Parallel, Perspective, Several, View, looking_along
from gait.lift.smooth import motion, size
from gait.lift.smooth.motion import Motion
from gait.lift.smooth.options import Options
from gait.lift.view_sides import best_sides
from gait.progress import note, progress
from gait.reproducible import one_thread
from gait.track.from_walk import Calibration

if TYPE_CHECKING:  # imports PyAV, not needed for files of keypoints
    from gait.io.video import Video

#: Recordings; with two of one person, 90 % intervals for other people contained as little as 70 %.
FEW_RECORDINGS = 4
MOST_NAMED = 5  # most spikes and changes of person that a message lists
MOST_SPANS = 4  # most intervals that a message lists
#: Share of points outside the picture; with fewer, the picture's edge cuts the person off.
MOST_OUTSIDE_SHARE = 0.1
SHAKY = 1.3  # ratio of jitter to standard deviation from which a warning is printed
FAR_SDS = 4.0  # standard deviations of a median distance; noise alone gives 1.2
OUTLIER_FRAMES = 3  # frames in which a point is an outlier; correct points are in one of a few thousand
TOO_MANY = 0.18  # share of wrong points; one in seven does little harm, one in five may
MANY_SWAPPED = 0.1  # share of pairs that seem swapped; of correct points none do
UNUSUAL = 2.5  # standard deviations of a stature; one person in 80 is as unusual

Warn = Callable[[str], None]


@dataclass(frozen=True)
class Request:
    """How to lift a file.

    Attributes
    ----------
    options : Options
        Settings of the method; `pixel_sd` is used only if `pixel_sd_given`, otherwise jitter is measured.
    camera : str, optional
        Camera file; without one the view is orthographic.
    size : (int, int), optional
        Size of the video, to which a camera of another resolution is resized.
    calibration : Calibration, optional
        Camera estimated from the walk instead; its uncertainty is added to the standard deviations.
    view : View, optional
        View to use instead of one by `camera`, `calibration` or `axis`.
    axis : str, optional
        Direction of an orthographic view; by default level, with a slowly changing scale.
    metres : float, optional
        Length of a unit of u and v along `axis`; by default unknown.
    ignore_unknown : bool
        Ignore points that the model does not know.
    keep_sides, keep_spikes : bool
        Do not undo swaps of left and right; do not remove spikes.
    all_markers : bool
        Estimate all markers of the prior.
    stabilised : bool
        The keypoints are from a stabilised clip, which may extend beyond the camera's picture.
    hints : bool
        Mention options of `gait lift` in warnings.
    clip : Clip
        What a keypoint file of another tool may lack: the person to use, times, the size of the picture.
    corrections : str, optional
        File of corrections by hand.
    """

    options: Options
    pixel_sd_given: bool = False
    camera: str | None = None
    size: tuple[int, int] | None = None
    calibration: Calibration | None = None
    view: View | None = None
    axis: str | None = None
    metres: float | None = None
    ignore_unknown: bool = False
    keep_sides: bool = False
    keep_spikes: bool = False
    all_markers: bool = False
    stabilised: bool = False
    hints: bool = True
    clip: Clip = Clip()
    corrections: str | None = None


@dataclass(frozen=True)
class FilmedView:
    """One of several views of a person.

    Attributes
    ----------
    path : str
        Film, or file of keypoints.
    camera : str
        Camera file.
    people : mapping of id to Keypoints, optional
        Those found in the film, the person seen most first; None to read them from `path`.
    clip : Clip
        What a keypoint file of another tool may lack, as in `Request`.
    video : Video, optional
        The film, if its camera stands still.
    """

    path: str
    camera: str
    people: Mapping[str, Keypoints] | None = None
    clip: Clip = Clip()
    video: Video | None = None


@dataclass(frozen=True)
class Prepared:
    """Keypoints ready for lifting, before any correction by hand; see `Lifted`."""

    keypoints: Keypoints
    view: AnyView
    options: Options
    repairs: dict[str, Any]


@dataclass(frozen=True)
class Lifted:
    """A lifted file.

    Attributes
    ----------
    keypoints : Keypoints
        Without spikes and swaps.
    view : View
    options : Options
        With the standard deviation that was used; of several views, its median over the points.
    motion : Motion
    repairs : dict
        Repairs of the keypoints, as in the ``--json`` summary.
    edits : Edits
        Corrections by hand.
    films : tuple of str
        Files of several views.
    """

    keypoints: Keypoints
    view: AnyView
    options: Options
    motion: Motion
    repairs: dict[str, Any] = field(default_factory=dict)
    edits: Edits = Edits()
    films: tuple[str, ...] = ()


def load_prior(model: str | None, warn: Warn) -> SegmentPrior:
    """Load the prior of a model (None: the shipped one); warn if it was learnt from few recordings."""
    prior = SegmentPrior.load(model)
    if 0 < prior.recordings < FEW_RECORDINGS:
        warn(
            f"{model}: learnt from {count_of(prior.recordings, 'recording')}, too few to learn how people "
            "differ: standard deviations may be too small; learn it from more"
        )
    return prior


def lift_file(path: str, prior: SegmentPrior, request: Request, warn: Warn, quiet: bool) -> Lifted:
    """Read keypoints, undo swaps of left and right, remove spikes, and lift the rest.

    Raises
    ------
    UserError
        One line that names the file.
    """
    keypoints, ignored = keypoints_file.read(path, prior.names, request.ignore_unknown, request.clip)
    if ignored:
        warn(f"ignored, unknown to the model: {' '.join(ignored)}")
    _compare_video(path, keypoints, request, warn)
    return lift_keypoints(path, keypoints, prior, request, warn, quiet)


def _compare_video(path: str, keypoints: Keypoints, request: Request, warn: Warn) -> None:
    """Raise UserError if keypoints cannot be of the video that the request names; warn if times differ."""
    if request.clip.times is None:
        return
    if words := keypoints.compare_times(path, request.clip.times):
        warn(f"{path}: {words}")
    if request.clip.size is not None and not request.stabilised:
        keypoints.require_inside(path, request.clip.size)


def lift_keypoints(
    path: str, keypoints: Keypoints, prior: SegmentPrior, request: Request, warn: Warn, quiet: bool
) -> Lifted:
    """Lift keypoints of the prior's markers as `lift_file` does; errors name `path` as their source."""
    edits = Edits()
    if request.corrections:  # to fail before long work
        frames = range(int(keypoints.frame[0]), int(keypoints.frame[-1]) + 1)
        view = _view(keypoints, request, lambda _: None)
        size = {"size": view.camera.size} if isinstance(view, Perspective) else {}
        edits = read_edits(request.corrections, prior, frames, **size)
    prepared = prepare(path, keypoints, prior, request, warn, quiet)
    return lift_prepared(path, prepared, edits, prior, request, quiet)


def lift_views(
    views: Sequence[FilmedView],
    offsets: Sequence[float] | None,
    prior: SegmentPrior,
    request: Request,
    warn: Warn,
    quiet: bool,
) -> Lifted:
    """Lift the keypoints of several cameras together, in the frames of the first.

    The person is the one who is seen most in the first view, and in others the one whose joints fit it best.

    Parameters
    ----------
    views : sequence of FilmedView
    offsets : sequence of float, optional
        Start of each film but the first, seconds after the first; by default estimated from the motion.

    Raises
    ------
    UserError
        One line that names the file.
    """
    prepared: list[Prepared] = []
    films: list[Film[str]] = []
    began: list[float] = []
    for number, view in enumerate(views):
        path, people = view.path, view.people
        own = replace(request, camera=view.camera, clip=view.clip)
        given = offsets[number - 1] if number and offsets is not None else None

        def named(words: str, path: str = path) -> None:
            warn(f"{path}: {words}")

        if people is None:
            people, _ = keypoints_file.read_people(path, prior.names, request.ignore_unknown, view.clip)
        person = _person(people, films, own, given, named)
        keypoints = people[person]
        step = float(np.median(np.diff(keypoints.time))) if len(keypoints.time) > 1 else 0.0
        if films and step >= LONGEST_KEYPOINT_GAP_S:
            raise UserError(
                f"{path}: its frames are {step:.2g} s apart; of several views only the first may have fewer "
                f"than {np.ceil(1 / LONGEST_KEYPOINT_GAP_S):.0f} a second"
            )
        one = prepare(path, keypoints, prior, own, named, quiet, sides_later=not request.keep_sides)
        assert isinstance(one.view, Perspective)
        sided = one.keypoints  # with left and right as this view alone shows them
        if offsets is None and not request.keep_sides:
            with suppress(UserError):  # too little may be visible in one view
                sided = prepare(path, keypoints, prior, own, lambda _: None, quiet).keypoints
        film = Film(path, one.view.camera, {person: sided}, person, view.video)
        if films:
            _, offset, words = synchronise(films, film, given)
            began.append(offset.seconds)
            note(f"{path}: {words}", quiet)
        prepared.append(one)
        films.append(film)
    noise = [one.options.pixel_sd for one in prepared]
    options = replace(request.options, pixel_sd=min(noise))
    own_errors = [_noisier(one.keypoints, sd, min(noise)) for one, sd in zip(prepared, noise, strict=True)]
    together, camera_of = joined(own_errors, began)
    _require_shared(views, together, camera_of, began)
    repairs: dict[str, Any] = {"swapped": 0, "swaps": [], "spikes": 0, "left_out": [], "offsets_s": began}
    several = Several(tuple(film.camera for film in films), camera_of)
    whole = Prepared(together, several, options, repairs)

    def lift(keypoints: Keypoints) -> Lifted:
        return lift_prepared(
            views[0].path, replace(whole, keypoints=keypoints), Edits(), prior, request, quiet
        )

    if request.keep_sides:
        lifted = lift(together)
    else:
        lifted = best_sides(prior, together, several, options, noise, lift, quiet)
    for number, (view, one) in enumerate(zip(views, prepared, strict=True)):
        path = view.path
        repairs["spikes"] += one.repairs["spikes"]
        repairs["left_out"] += [{"film": path, **point} for point in one.repairs["left_out"]]
        before, after = (each.among(camera_of == number) for each in (together, lifted.keypoints))
        if swapped := swaps.swapped_between(before, after):
            warn(f"{path}: {_named_swaps(swapped)}{' (--keep-sides)' * request.hints}")
            repairs["swaps"] += [{"film": path, **span} for span in _spans(swapped)]
            repairs["swapped"] += int((after.visible & (after.uv != before.uv).any(axis=2)).sum())
    usual = replace(options, pixel_sd=float(np.median(np.array(noise)[camera_of])))
    paths = tuple(view.path for view in views)
    return replace(lifted, options=usual, repairs=repairs, films=paths)


def _person(
    people: Mapping[str, Keypoints],
    films: Sequence[Film[str]],
    request: Request,
    given: float | None,
    warn: Warn,
) -> str:
    """Choose the person of a view: who is seen most, or whose joints fit the first of `films` best."""
    person = next(iter(people))
    if len(people) == 1:
        return person
    why = ""
    if films:
        assert request.camera is not None
        camera = Camera.read(request.camera, request.size, scale=True)
        person, offset = same_person(films[0], Film("", camera, people, person), given)
        if np.isfinite(offset.mismatch):
            why = f", whose joints fit {films[0].path} best ({offset.mismatch:.1f} deg)"
    warn(f"has {keypoints_file.listed(people)}; took {person}{why}")
    return person


def _noisier(keypoints: Keypoints, sd: float, least: float) -> Keypoints:
    """Add noise `sd` at full confidence to a view's own errors, apart from the `least` noise of all views."""
    if sd == least:
        return keypoints
    more = np.sqrt(sd**2 - least**2) / np.maximum(keypoints.confidence, keypoints_file.LEAST_CONFIDENCE)
    return replace(
        keypoints, sd=more if keypoints.sd is None else np.hypot(np.nan_to_num(keypoints.sd), more)
    )


def _require_shared(
    views: Sequence[FilmedView], together: Keypoints, camera_of: NDArray[np.intp], began: Sequence[float]
) -> None:
    """Raise UserError if a view has no point at the time of a frame of the first."""
    for number, view in enumerate(views[1:], 1):
        if not together.among(camera_of == number).visible.any():
            raise no_shared_frame(view.path, views[0].path, began[number - 1], float(together.time[-1]))


def prepare(
    path: str,
    keypoints: Keypoints,
    prior: SegmentPrior,
    request: Request,
    warn: Warn,
    quiet: bool,
    sides_later: bool = False,
) -> Prepared:
    """Repair keypoints before lifting: swaps of left and right, unless `sides_later`, and spikes."""
    options, hint = request.options, request.hints
    _check(path, keypoints, options.pixel_sd, warn)
    if not request.pixel_sd_given:
        options = replace(options, pixel_sd=measured_noise(keypoints, warn))
    view = _view(keypoints, request, warn)
    repairs: dict[str, Any] = {"swapped": 0, "swaps": [], "spikes": 0, "left_out": []}
    if not (request.keep_sides or sides_later):
        keypoints, found = _without_swaps(path, prior, keypoints, view, options, warn, quiet, hint)
        repairs |= found
    if not request.keep_spikes:
        keypoints, found = _without_spikes(keypoints, options.pixel_sd, warn, hint, sides_later)
        repairs |= found
    return Prepared(keypoints, view, options, repairs)


def lift_prepared(
    path: str, prepared: Prepared, edits: Edits, prior: SegmentPrior, request: Request, quiet: bool
) -> Lifted:
    """Lift prepared keypoints with corrections by hand; errors name `path` or the file of corrections."""
    options, view = prepared.options, prepared.view
    with _naming(request.corrections or path):
        keypoints = corrected(prepared.keypoints, edits, options.pixel_sd)
        camera = view.camera if isinstance(view, Perspective) else None
        pinned = pins(keypoints, edits, camera, prior)
    names = motion.output_names(prior, keypoints, request.all_markers)
    segments = motion.segments_of(prior, keypoints)
    # matrices are too small to gain from several threads
    with one_thread(), progress("segments", segments, quiet) as update, _naming(path):
        lifted = motion.lift(prior, keypoints, view, options, names, update, pinned)
    if request.calibration is not None:
        wider = request.calibration.joint_sd(keypoints.time, lifted.places, lifted.sd)
        lifted = replace(lifted, sd=wider)
    return Lifted(keypoints, view, options, lifted, prepared.repairs, edits)


def _check(path: str, keypoints: Keypoints, sd: float, warn: Warn) -> None:
    """Raise UserError unless keypoints, with noise `sd`, show a motion; warn about what looks wrong."""
    keypoints.require_motion(path)
    keypoints.require_extent(path, sd)
    if found := keypoints_file.shared_place(keypoints.uv):
        (u, v), count = found
        warn(
            f"{count} points are at exactly {u:g}, {v:g}: if these are missing points, leave the cells empty"
        )
    if changes := noise.person_changes(keypoints)[:MOST_NAMED]:
        places = [
            f"at frame {first}" if last is None else f"in frames {first} to {last}" for first, last in changes
        ]
        warn(
            f"most points jump at once: the keypoints switch to another person {', '.join(places)}; keep "
            "only one person's points"
        )


def measured_noise(keypoints: Keypoints, warn: Warn) -> float:
    """Measure the standard deviation at full confidence: the points' jitter, if it is more than usual.

    Spikes are excluded; with a larger noise, others among them would pass as correct points.
    """
    usual = Options.pixel_sd
    shake = noise.shake(noise.without_spikes(keypoints, usual)[0])
    if not shake > SHAKY * usual:
        return usual
    warn(
        f"the points jitter by {shake:.2g} from frame to frame: this is used as their noise instead of "
        f"{usual:g} (--pixel-sd)"
    )
    return shake


def _view(keypoints: Keypoints, request: Request, warn: Warn) -> View:
    """Make the view of the keypoints; warn if they cannot be from the camera's picture."""
    if request.view is not None:
        return request.view
    if request.calibration is not None:
        return Perspective(request.calibration.camera)
    if request.camera:
        camera = Camera.read(request.camera, request.size, scale=True)
        camera.check_place(request.camera)
        outside = keypoints.outside(camera.size)
        if outside > MOST_OUTSIDE_SHARE and not request.stabilised:
            picture = "{}x{}".format(*camera.size)
            warn(
                f"{outside:.0%} of the points lie outside the camera's {picture} picture: is "
                f"{request.camera} the calibration for this video?"
            )
        return Perspective(camera)
    middle = np.nanmedian(keypoints.uv, axis=(0, 1))  # robust to outliers
    return Parallel(looking_along(request.axis or "y"), request.metres, middle, steady=bool(request.axis))


def _without_swaps(
    path: str,
    prior: SegmentPrior,
    keypoints: Keypoints,
    view: View,
    options: Options,
    warn: Warn,
    quiet: bool,
    hint: bool,
) -> tuple[Keypoints, dict[str, Any]]:
    """Undo swaps of left and right, and report them; also return their figures for ``--json``."""
    with _naming(path):
        motion.require(prior, keypoints, view, options)
    with one_thread(), progress("sides", len(keypoints.time), quiet) as update:
        model = motion.Evidence(prior, keypoints.names, view, options)

        def evidence(part: Keypoints, near: swaps.Reading | None) -> swaps.Reading:
            update(int(np.searchsorted(keypoints.frame, part.frame[0])))
            return model(part, near)

        found, swapped = swaps.undo_swaps(keypoints, options.pixel_sd, evidence)
    if swapped:
        warn(_named_swaps(swapped) + " (--keep-sides)" * hint)
    moved = (found.uv != keypoints.uv).any(axis=2) & keypoints.visible
    return found, {"swapped": int(moved.sum()), "swaps": _spans(swapped)}


def _spans(swapped: list[swaps.Swapped]) -> list[dict[str, Any]]:
    """List the joints and intervals of swaps for ``--json``."""
    return [
        {"joint": each.joint, "first": first, "last": last} for each in swapped for first, last in each.spans
    ]


def _named_swaps(swapped: list[swaps.Swapped]) -> str:
    """List intervals of frames, longest first, and the joints that were swapped in them."""
    joints: dict[tuple[int, int], list[str]] = {}
    for each in swapped:
        for span in each.spans:
            joints.setdefault(span, []).append(each.joint)
    spans = sorted(joints, key=lambda span: span[0] - span[1])
    named = [f"{', '.join(joints[span])} in frames {span[0]} to {span[1]}" for span in spans[:MOST_SPANS]]
    more = f" and {len(spans) - MOST_SPANS} more intervals" if len(spans) > MOST_SPANS else ""
    return f"left and right were swapped; undone: {'; '.join(named)}{more}"


def _without_spikes(
    keypoints: Keypoints, sd: float, warn: Warn, hint: bool, either_side: bool
) -> tuple[Keypoints, dict[str, Any]]:
    """Remove spikes (`either_side`: only those on both sides), and report them, also for ``--json``."""
    keypoints, spikes = (swaps if either_side else noise).without_spikes(keypoints, sd)
    if spikes:
        named = ", ".join(f"{name} in frame {frame}" for frame, name in spikes[:MOST_NAMED])
        more = f" and {len(spikes) - MOST_NAMED} more" if len(spikes) > MOST_NAMED else ""
        warn(
            f"dropped, far from their positions a frame before and after: {named}{more}"
            + " (--keep-spikes)" * hint
        )
    left_out = [{"frame": frame, "point": name} for frame, name in spikes]
    return keypoints, {"spikes": len(spikes), "left_out": left_out}


@contextmanager
def _naming(path: str) -> Iterator[None]:
    """Add the name of a file to errors within the block."""
    try:
        yield
    except UserError as error:
        raise type(error)(f"{path}: {error}") from None


def require_person(path: str, lifted: Lifted, request: Request) -> None:
    """Raise UserError, naming `path`, for an estimate that cannot be a person."""
    found = lifted.motion
    if not np.isfinite(found.error).any():
        raise UserError(f"{path}: the estimate is behind the camera; check the camera and the names")
    low, high = state_range("stature")
    if not low <= found.stature <= high:
        view = "the camera (metres; R, t: world to camera)" if request.camera else "the direction of view"
        raise UserError(f"{path}: the estimated stature is {found.stature:.3g} m; check {view} and the names")


def warnings_of(lifted: Lifted, prior_stature: float) -> list[str]:
    """List reasons why a result may be wrong, one line each.

    Parameters
    ----------
    prior_stature : float
        Mean stature of the training subjects, metres.
    """
    found, keypoints, options = lifted.motion, lifted.keypoints, lifted.options
    camera = not isinstance(lifted.view, Parallel)
    far = float(np.nanmedian(found.error)) / options.pixel_sd
    outliers, shake = _named_outliers(lifted), noise.shake(keypoints)
    lost = _share_lost(found, keypoints, int(lifted.repairs["spikes"]))
    believed, sd = motion.believed_stature(options, prior_stature)
    off = abs(found.stature - believed) / sd if found.steps else 0.0  # single segments do not
    strange = found.unlike or off > UNUSUAL
    one_view = not isinstance(lifted.view, Several)
    swapped = swaps.share_suspected(keypoints, options.pixel_sd) if strange and one_view else 0.0
    check = "the camera's focal length" if camera else "--metres-per-unit"
    cause = "the motion is unlike those learnt, or the camera is wrong"
    if swapped > MANY_SWAPPED:
        check, cause = "left and right of the points", "left and right of the points are swapped"
    reasons = {
        f"left and right seem swapped in {swapped:.0%} of the pairs of points: correct the keypoints, do "
        "not rely on the result": swapped > MANY_SWAPPED,
        "hips and ankles, which determine the distance, are hardly visible: the person may be metres "
        "nearer or further away": camera and not size.shows_distance(keypoints),
        f"outliers, down-weighted because they are far from their predictions: {outliers}": bool(outliers),
        f"{lost:.0%} of the points seem wrong, which is too many: do not rely on the result": lost > TOO_MANY,
        f"the points jitter by {shake:.2g} from frame to frame, not {options.pixel_sd:g}: "
        f"try --pixel-sd {shake:.2g}": shake > SHAKY * options.pixel_sd and found.wider > 1,
        f"the motion is unlike those learnt: the prior was widened {found.wider:g} times": found.wider > 1,
        "the smoother fails for such motions: segments are estimated alone (--method blend)": found.alone,
        f"the estimated stature is {found.stature:.2f} m, expected {believed:.2f}: check {check}, "
        "time (the frame rate) and --height": off > UNUSUAL,
        f"the size was taken from the bones ({found.resized:.2f} times the fit's): {cause}; "
        "standard deviations are wide, do not rely on the positions": found.resized != 1,
        f"the estimate did not converge in {found.steps} iterations: do not rely on it": not found.settled,
        f"the estimate is {far:.0f} times --pixel-sd from the keypoints: do not rely on it; check the "
        "camera, the names of the points, that v points down, and --pixel-sd": far > FAR_SDS,
    }
    return [words for words, holds in reasons.items() if holds]


def _share_lost(found: Motion, keypoints: Keypoints, spikes: int) -> float:
    """Share of the points that were removed or down-weighted."""
    outliers = 0 if found.outliers is None else int(found.outliers.sum())
    return (spikes + outliers) / max(int(keypoints.visible.sum()) + spikes, 1)


def _named_outliers(lifted: Lifted) -> str:
    """List points that were often outliers, in how many frames and, of several views, in which of them."""
    if lifted.motion.outliers is None:
        return ""
    names, view = lifted.keypoints.names, lifted.view
    of = [""] * len(names)
    if isinstance(view, Several):
        of = [f" of {lifted.films[number]}" for number in view.of_point.tolist()]
    counts = zip(names, lifted.motion.outliers.sum(axis=0).tolist(), of, strict=True)
    return ", ".join(
        f"{name} in {count} frames{film}" for name, count, film in counts if count >= OUTLIER_FRAMES
    )
