"""Track the person in a video file: start, filter, smoother, and everything that is written."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np

from gait.bindings.abi import Mode, Term, TrackStatus
from gait.bindings.config import TrackerConfig
from gait.bindings.estimate import Estimate
from gait.bindings.frame import Joints
from gait.bindings.initial import OUTSIDE, Start
from gait.bindings.model import Model, read_cyclic
from gait.body.model_curves import ModelCurves
from gait.camera.camera import Camera
from gait.detect import weights
from gait.errors import UserError
from gait.io import keypoints_file
from gait.io.keypoints_file import Keypoints
from gait.io.track_file import TrackWriter
from gait.io.trc import write_trc
from gait.io.video import Frame, Image, Video, VideoWriter, background
from gait.progress import durations, note, progress
from gait.report.drawing import Overlay
from gait.track.auto_start import AutoStart, find_start
from gait.track.keypoint_start import CUE_MISS, find_keypoint_start, keypoint_noise
from gait.track.person_detection import another_scene, one_is_grey
from gait.track.smooth import Smoother
from gait.track.tracker import Tracker

KEYPOINTS_SD = 4.0  # pixels

Sink = Callable[[Frame, Estimate], None]


@dataclass(frozen=True)
class ClipOptions:
    """What to track and what to write; see ``gait track --help``.

    Attributes
    ----------
    video, camera, output : str
        The clip, its camera file and the track to write.
    model : str, optional
        The model of the package if left out.
    init, background : str
        A file, ``auto``, or for the background ``none``.
    height : float, optional
        The person's stature, metres.
    mode : Mode
    particles : int, optional
    seed, threads : int
    start, stop : int, optional
        Frames to track: start <= frame < stop.
    detector : str
        Network that finds keypoints for the start and as a cue: ``full``, ``lite``, ``heavy``, ``none``, or
        ``auto``: ``full`` if its weights are on this machine.  It is not used in paper mode.
    keypoints : str, optional
        File of 2-D keypoints found in the frames, instead of a detector.
    keypoints_sd : float
        Their standard deviation at full confidence, pixels.
    overlay, draws, trc : str, optional
        Further files to write.
    smooth : bool
        Estimate every frame from the whole clip.
    quiet : bool
        Print no notes and no progress.
    """

    video: str
    camera: str
    output: str
    model: str | None = None
    init: str = "auto"
    background: str = "auto"
    height: float | None = None
    mode: Mode = Mode.DEFAULT
    particles: int | None = None
    seed: int = 1
    threads: int = 1
    start: int | None = None
    stop: int | None = None
    detector: str = "auto"
    keypoints: str | None = None
    keypoints_sd: float = KEYPOINTS_SD
    overlay: str | None = None
    smooth: bool = False
    draws: str | None = None
    trc: str | None = None
    quiet: bool = False


def track_clip(options: ClipOptions) -> dict[str, Any]:
    """Track and write the files; return the figures of ``gait track --json``.

    Raises
    ------
    UserError
        If a file cannot be read, if no person can be found to start with, or no frame can be tracked.
    """
    video = Video(options.video)
    camera = Camera.read(options.camera, video.size)
    model = Model(options.model)
    with progress("background", video.count, options.quiet) as update:
        plate = background(options.background, video, update)
    found_keypoints = _read_keypoints(options, model) if options.keypoints else _detect(options, video)
    start = _first_state(options, video, camera, plate, model, found_keypoints)
    frames = _frames(options, video, start.frame)
    keypoints = _keypoints(options, found_keypoints, frames)
    if not camera.shows(model.pose(start.mean)[0]):
        note(f"{options.init}: {OUTSIDE}", options.quiet)
    config = TrackerConfig.default(options.mode, seed=options.seed, belt=float(start.in_place))
    if options.particles is not None:
        config = config.replace(particles=options.particles)
    if keypoints:
        config = config.replace(terms=config.terms | Term.KEYPOINTS)
    tracker = Tracker(model, camera, config, background=plate, tasks=options.threads)
    restart = None if options.smooth else AutoStart(camera, plate, model, options.height)
    found = tracker.follow(video, start, frames.stop, restart, keypoints)
    results = _write(options, video, tracker, frames, found)
    for frame, x, y in results.restarts:
        note(f"lost, and a person found at frame {frame}: x {x:.2f} y {y:.2f} m", options.quiet)
    if options.trc:
        write_trc(
            options.trc, model.joint_names, np.array(results.times), np.array(results.joints), video.fps
        )
    return results.summary(options.threads)


def _frames(options: ClipOptions, video: Video, start: int) -> range:
    """Frames to track from `start` on; UserError if there are none."""
    stop = video.count if options.stop is None else min(options.stop, video.count)
    if start >= stop:
        raise UserError(f"{video.path}: no frame from {start} up to {stop}; it has {video.count}")
    return range(start, stop)


def _first_state(
    options: ClipOptions,
    video: Video,
    camera: Camera,
    plate: Image | None,
    model: Model,
    keypoints: Keypoints | None,
) -> Start:
    """First state, from the init file or found in the clip."""
    if options.init != "auto":
        start = Start.read(options.init, model, frame=options.start, height=options.height)
        _require_scene(options, video, plate, start.frame)
        return start
    first = options.start or 0
    _frames(options, video, first)
    _require_scene(options, video, plate, first)
    start = _find_first_state(options, video, camera, plate, model, keypoints)
    at, turn, turn_sd = start.mean, np.degrees(start.mean.heading), np.degrees(start.sd.heading)
    note(
        f"start found at frame {start.frame}: x {at.pelvis[0]:.2f} y {at.pelvis[1]:.2f} m, "
        f"stature {at.stature:.2f} m, heading {turn:.0f} +- {turn_sd:.0f} deg",
        options.quiet,
    )
    if keypoints is None and options.detector == "auto" and options.mode != Mode.PAPER:
        note(f"without a detector the start is less reliable: {weights.FETCH}", options.quiet)
    if start.apparent_stature:
        remedy = "check --height and" if options.height else "give --height or check"
        note(
            f"the person appears {start.apparent_stature:.2f} m tall by the camera, taken for "
            f"{at.stature:.2f} m: {remedy} the camera",
            options.quiet,
        )
    return start


def _find_first_state(
    options: ClipOptions,
    video: Video,
    camera: Camera,
    plate: Image | None,
    model: Model,
    keypoints: Keypoints | None,
) -> Start:
    """First state from the keypoints; without any that fit, from the pictures."""
    first, stop, height = options.start or 0, options.stop, options.height
    if keypoints is not None:
        found = find_keypoint_start(keypoints, camera, model, first=first, stop=stop, height=height)
        if found is not None:
            return found
    return find_start(video, camera, plate, model, first=first, stop=stop, height=height)


def _require_scene(options: ClipOptions, video: Video, plate: Image | None, first: int) -> None:
    """Refuse a background image of another scene than the first frame, or without its colours."""
    frame = next(iter(video.frames(first, first + 1)), None)
    if plate is None or frame is None:
        return
    if one_is_grey(frame.image, plate):
        raise UserError(
            f"{options.background}: of it and {video.path} one is grey, the other in colour; take both alike"
        )
    if not another_scene(frame.image, plate):
        return
    differs = f"half of frame {first} differs from"
    if options.background != "auto":
        raise UserError(
            f"{options.background}: {differs} it; give the empty scene of this camera, auto or none"
        )
    note(
        f"{differs} the median of the clip, the background: if the camera moves, --background none",
        options.quiet,
    )


def _detect(options: ClipOptions, video: Video) -> Keypoints | None:
    """Keypoints of the main person by the detector; None without one, or if it finds no person."""
    network = options.detector
    if network == "none" or options.mode == Mode.PAPER:
        return None
    if network == "auto":
        network = "full"
        if not all(weights.find(needed) for needed in (weights.PERSON, weights.LANDMARKS[network])):
            return None
    from gait.detect.people import detect, main_person  # here, as they load the networks' runtime

    frames = _frames(options, video, options.start or 0)
    with progress("detecting", len(frames), options.quiet) as update:
        people = detect(video, network, first=frames.start, stop=frames.stop, update=update)
    return people[main_person(people)] if people else None


def _read_keypoints(options: ClipOptions, model: Model) -> Keypoints:
    """Keypoints of the model's joints from a file."""
    assert options.keypoints is not None
    read, ignored = keypoints_file.read(options.keypoints, model.joint_names, ignore_unknown=True)
    if ignored:
        note(f"left out: {' '.join(ignored)}", options.quiet)
    read.require_extent(options.keypoints, options.keypoints_sd)
    return read


def _keypoints(options: ClipOptions, keypoints: Keypoints | None, frames: range) -> dict[int, Joints]:
    """Keypoints by frame with their noise; those of a file must be of the frames to track."""
    if keypoints is None:
        return {}
    if not options.keypoints:
        return keypoint_noise(keypoints, CUE_MISS)
    if not any(frame in frames for frame in keypoints.frame.tolist()):
        raise UserError(
            f"{options.keypoints}: has no frame that is tracked; number frames as in the video, from 0"
        )
    return keypoints.joints(options.keypoints_sd)


class _Results:
    """What the report at the end needs from each step."""

    def __init__(self, tracker: Tracker) -> None:
        self._tracker = tracker
        self._steps: list[float] = []
        self._statuses: list[TrackStatus] = []
        self._begun = time.perf_counter()
        self.times: list[float] = []
        self.joints: list[np.ndarray[Any, Any]] = []
        self.restarts: list[tuple[int, float, float]] = []  # frame and place of each start but the first

    def step(self, frame: Frame, estimate: Estimate) -> None:
        """Take in a step of the tracker."""
        if self._steps and estimate.frame == 0:
            self.restarts.append((frame.number, *estimate.mean.pelvis[:2]))
        self._steps.append(1000 * self._tracker.step_seconds)
        self._wall = time.perf_counter() - self._begun

    def add(self, frame: Frame, estimate: Estimate) -> None:
        """Take in an estimate that is written."""
        self._statuses.append(estimate.status)
        self.times.append(frame.time)
        self.joints.append(estimate.joints)

    def summary(self, threads: int) -> dict[str, Any]:
        """Return the figures of ``--json``; step_ms is the time inside gait_tracker_step alone."""
        tracker = self._tracker
        return {
            "frames": len(self._steps),
            "particles": tracker.config.particles,
            "threads": threads,
            "step_ms": durations(self._steps),
            "wall_fps": len(self._steps) / self._wall,
            "lost": self._statuses.count(TrackStatus.LOST),
            "ambiguous": self._statuses.count(TrackStatus.AMBIGUOUS),
            "memory_bytes": tracker.memory_bytes,
            "digest": f"{tracker.digest():016x}",
        }


def _write(
    options: ClipOptions,
    video: Video,
    tracker: Tracker,
    span: range,
    found: Iterable[tuple[Frame, Estimate]],
) -> _Results:
    """Write the estimates into all outputs, which appear together at the end."""
    model, results = tracker.model, _Results(tracker)
    with ExitStack() as stack:
        rows = TrackWriter(options.output, model.info.components, model.joint_names, model.angle_names)
        sinks: list[Sink] = [results.add, stack.enter_context(rows).write]
        if options.overlay:
            film = stack.enter_context(VideoWriter(options.overlay, video.fps))
            overlay = Overlay(model, tracker.cameras[0])
            sinks.append(
                lambda frame, estimate: film.write(overlay.draw(frame.image, estimate, frame.number))
            )
        smoother = None
        if options.smooth:
            smoother = stack.enter_context(Smoother(tracker, ModelCurves(read_cyclic(options.model))))
        update = stack.enter_context(progress("tracking", len(span), options.quiet))
        for done, (frame, estimate) in enumerate(found, 1):
            results.step(frame, estimate)
            for sink in sinks if smoother is None else [smoother.add]:
                sink(frame, estimate)
            update(done)
        if smoother is not None and len(smoother):
            _smooth(options, video, smoother, sinks)
        if not results.times:
            raise UserError(f"{video.path}: no frame from {span.start} on can be decoded; convert it anew")
    return results


def _smooth(options: ClipOptions, video: Video, smoother: Smoother, sinks: list[Sink]) -> None:
    """Give every frame with its smoothed estimate to the sinks, and write the draws."""
    with progress("smoothing", len(smoother), options.quiet) as update:
        rows, draws = smoother.finish(update=update)
    if options.draws:
        draws.write(options.draws)
    frames: Iterable[Frame] = (frame for frame, _ in rows)
    if options.overlay:  # decode the pictures once more
        frames = video.frames(rows[0][0].number, rows[-1][0].number + 1)
    for frame, (_, estimate) in zip(frames, rows, strict=True):
        for sink in sinks:
            sink(frame, estimate)
