"""Track the person in a video file, from reading the inputs to writing the outputs."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gait.bindings.abi import Mode, Term
from gait.bindings.config import TrackerConfig
from gait.bindings.estimate import Estimate
from gait.bindings.initial import Start, set_height
from gait.bindings.shipped import CLASSES, WALK
from gait.bindings.start_fit import StartFit
from gait.errors import UserError
from gait.io.trc import write_trc
from gait.io.video import Frame
from gait.progress import note, progress, warning
from gait.track.box_start import BoxStart
from gait.track.clip_background import stays
from gait.track.clip_keypoints import finds_shapes
from gait.track.clip_output import HARDLY_TRACKED, Check, Results, accept, write
from gait.track.first_state import first_state, start_in_keypoints
from gait.track.follow import Follower
from gait.track.further_cameras import require_cameras, with_further_cameras
from gait.track.measured_joints import MeasuredJoints
from gait.track.options import KEYPOINTS_SD, ClipOptions
from gait.track.own_body import FirstPass, own_model
from gait.track.person_keypoints import PersonKeypoints
from gait.track.person_shapes import PersonShapes
from gait.track.plausible import Plausibility
from gait.track.read_scene import read_scene, tracker_model
from gait.track.run_report import RunReport
from gait.track.scene import Scene
from gait.track.setup import setup
from gait.track.standing import Moved, Sink
from gait.track.tracker import Tracker

__all__ = ["KEYPOINTS_SD", "ClipOptions", "track_clip"]

#: Options of a pass that only estimates the body: what to track, and no outputs.
_OF_A_PASS = (
    "model", "init", "background", "height", "further", "offsets", "mode", "particles", "seed", "threads",
    "start", "stop", "detector", "model_reason",
)  # fmt: skip
JointsOf = Callable[[ClipOptions, Scene], Moved]
Track = Callable[[ClipOptions, Scene, Check], dict[str, Any]]
_HARDLY_FOLLOWED = "the person was lost nearly all the time; check --camera and --init with --overlay"


def track_clip(options: ClipOptions, joints_of: JointsOf | None = None) -> dict[str, Any]:
    """Track and write the files; return the figures of ``gait track --json``.

    Without a model, a person who does not only walk is tracked as `track_all_motions` does.
    `joints_of` makes, from a scene with one camera, what moves the joints of the estimates; `own_body` of one
    film needs it.

    Raises
    ------
    ValueError
        If `own_body` is set for one film without `joints_of` (`gait.lift.tracked.half_lifted`).
    UserError
        If a file cannot be read, no person can be found to start with, or no frame can be tracked.
    """
    if options.own_body and not options.further and joints_of is None:
        raise ValueError("own_body: one film needs joints_of")
    require_cameras(options)
    scene = with_further_cameras(options, read_scene(options))

    def track(options: ClipOptions, scene: Scene, check: Check) -> dict[str, Any]:
        if options.own_body and scene.further:
            scene = _with_own_body(options, scene)
        start = first_state(options, scene)
        moved = None if joints_of is None else joints_of(options, scene)
        return track_scene(options, scene, start, moved=moved, check=check)

    return track_all_motions(options, scene, track)


def track_all_motions(options: ClipOptions, scene: Scene, track: Track) -> dict[str, Any]:
    """Track with the model of `options` or, without one, with that which follows the person.

    The default model knows only walking.  If that does not follow what the person does, the scene is tracked
    again with the model of motion classes.  This one is kept unless no start is found with it, or it is
    `tracking` in fewer frames although nothing but walking was seen.  Without keypoints it is not tried, as
    images alone may show a person who walks in place as one who stands.

    `track` tracks with options and a scene, and writes nothing if its third argument, called with the
    results, raises UserError.
    """
    if options.model is not None or options.mode == Mode.PAPER or not scene.people:
        return track(options, scene, accept)
    failed: UserError | None = None
    least = 0
    try:
        return track(options, scene, _require_walk)
    except _NotOnlyWalkingError as error:
        reason, least = str(error), error.least
    except UserError as error:
        failed, reason = error, str(error)
    note(f"{reason}; tracking again with the model {CLASSES}", options.quiet)
    chosen = replace(options, model=CLASSES, model_reason=reason)

    def require_more(results: Results) -> None:
        if results.tracking < least:
            words = f"{results.tracking} frames are tracking, {least} without it"
            raise UserError(f"{options.output}: with the model {CLASSES} {words}")

    try:
        return track(chosen, replace(scene, model=tracker_model(chosen)), require_more)
    except UserError as error:
        if failed is not None:
            raise failed from None
        warning(f"{error}; tracking with the model {WALK} as before", options.quiet)
        return track(options, scene, accept)


class _NotOnlyWalkingError(UserError):
    """A model of walking does not follow the person; another one must be `tracking` in `least` frames."""

    def __init__(self, reason: str, least: int) -> None:
        super().__init__(reason)
        self.least = least


def _require_walk(results: Results) -> None:
    if reason := results.against_walk():
        raise _NotOnlyWalkingError(reason, results.tracking if reason == HARDLY_TRACKED else 0)


def _with_own_body(options: ClipOptions, scene: Scene) -> Scene:
    """Track once to estimate the person's body; return the scene with its model."""
    first = FirstPass()
    with tempfile.TemporaryDirectory() as folder:
        once = ClipOptions(
            options.video,
            options.camera,
            str(Path(folder) / "track.csv"),
            **{name: getattr(options, name) for name in _OF_A_PASS},
            quiet=True,
        )
        with progress("first pass", len(scene.frames), options.quiet) as update:

            def also(frame: Frame, estimate: Estimate) -> None:
                first.add(frame, estimate)
                update(frame.number - scene.frames.start)

            track_scene(once, scene, first_state(once, scene), also)
    return replace(scene, model=own_model(options, scene, first))


def track_scene(
    options: ClipOptions,
    scene: Scene,
    start: Start,
    also: Sink | None = None,
    moved: Moved | None = None,
    check: Check = accept,
) -> dict[str, Any]:
    """Track the person of a scene from a start; write nothing if `check`, called with the results, raises.

    `also` receives the estimates, with the joints of the model's body; or `moved` moves these, by default to
    where several cameras measure them.
    """
    if options.background == "auto" and scene.empty is not None and (start.in_place or stays(scene)):
        scene = scene.without_plate()  # the median shows the person
    used = setup(options, scene, start, scene.empty is not None)
    config = TrackerConfig.default(options.mode, seed=options.seed, belt=float(start.in_place))
    if options.particles is not None:
        config = config.replace(particles=options.particles)
    shapes = finds_shapes(options)
    if scene.people or shapes:
        config = config.replace(terms=config.terms | Term.KEYPOINTS)
    scenes = (scene, *scene.further)
    tracker = Tracker(
        scene.model,
        [one.camera for one in scenes],
        config,
        background=[one.plate for one in scenes],
        tasks=options.threads,
    )
    keypoints: PersonKeypoints | PersonShapes
    if shapes:
        fit = StartFit(scene.model, scene.camera)
        keypoints = PersonShapes(scene.camera, fit.stature, fit.set_pose)
    else:
        further = [PersonKeypoints(one.camera, one.keypoints, one.person) for one in scene.further]
        keypoints = PersonKeypoints(scene.camera, scene.keypoints, scene.person, scene.apart, further)
    model = scene.model
    plausibility = Plausibility(
        keypoints,
        *_stature(options, scene, start),
        config.belt,
        model.directions,
        tracker.cameras,
        backwards=not options.model_reason,
    )
    follower = _follower(options, scene, tracker, keypoints, plausibility)
    found = follower.follow(start, scene.frames)
    joints_found = keypoints if isinstance(keypoints, PersonKeypoints) else None
    if moved is None and scene.further and joints_found is not None:
        moved = MeasuredJoints(tracker.cameras, joints_found).moved
    results = write(options, scene, tracker, found, plausibility, joints_found, also, moved, check)
    report = RunReport(options, scene, used, tracker.config.particles, _advice(options, scene, results))
    for frame, x, y in results.starts[1:]:
        warning(f"lost, and a person found at frame {frame}: x {x:.2f} y {y:.2f} m", options.quiet)
    note("; ".join(results.coverage()), options.quiet)
    if results.hardly_followed():
        warning(f"{options.output}: {_HARDLY_FOLLOWED}")
    if options.trc:
        times, joints = np.array(results.times), np.array(results.joints)
        write_trc(options.trc, scene.model.joint_names, times, joints, scene.video.fps)
    if options.report:
        assert results.film is not None
        report.write(options.report, results.film)
    camera = {} if scene.calibration is None else {"camera": scene.calibration.figures()}
    began = {"offsets_s": list(scene.offsets)} if scene.further else {}
    counted = results.summary(options.threads, follower.step_seconds)
    return counted | camera | began | report.figures()


def _advice(options: ClipOptions, scene: Scene, results: Results) -> list[str]:
    """Suggest the other model if that of walking was given, or none could be tried, and does not suffice."""
    reason = results.against_walk()
    if not reason or options.model_name != WALK or (options.model is None and scene.people):
        return []
    return [f"{reason}; to follow other motions than walking: -m {CLASSES}"]


def _stature(options: ClipOptions, scene: Scene, start: Start) -> tuple[float, float]:
    """Return the expected stature and its sd, metres: the start's, unless these were found in the images."""
    mean, sd = start.mean, start.sd
    if options.init == "auto" and not scene.people:
        mean, sd = scene.model.prior()
        if options.height is not None:
            set_height(mean, sd, options.height)
    return mean.stature, sd.stature


def _follower(
    options: ClipOptions,
    scene: Scene,
    tracker: Tracker,
    keypoints: PersonKeypoints | PersonShapes,
    plausibility: Plausibility,
) -> Follower:
    """Make a follower that finds a lost person by keypoints or, if there are none, in the pictures."""

    def find_again(first: int, stop: int, stature: float) -> Start | None:
        if not scene.people or not isinstance(keypoints, PersonKeypoints):
            return None
        return _find_again(scene, keypoints, first, stop, stature)

    auto_start = None
    if not options.smooth and not scene.people:
        plate = None if finds_shapes(options) else scene.empty
        auto_start = BoxStart(scene.camera, plate, scene.model, options.height)
    return Follower(
        tracker,
        scene.video,
        keypoints,
        plausibility,
        find_again,
        auto_start,
        one_pass=options.smooth,
        nearest_of=scene.nearest_of(),
    )


def _find_again(
    scene: Scene, keypoints: PersonKeypoints, first: int, stop: int, stature: float
) -> Start | None:
    """Find the person by their keypoints or, if these show no walk, by those of an id that may be theirs."""
    for ids in keypoints.ids, scene.others():
        found = {id: start_in_keypoints(scene, id, first, stop, stature) for id in ids}
        walks = {
            id: start
            for id, start in found.items()
            if start is not None and (id in keypoints.ids or start.hypotheses[0].walks)
        }
        if walks:
            id, start = min(walks.items(), key=lambda one: one[1].frame)
            keypoints.add(id)
            return start
    return None
