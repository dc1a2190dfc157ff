"""Track a walking person in a video file.

The start comes from --init: a JSON file that says where the person is and in which phase, or auto.
auto compares a second of frames with the background, takes the person-sized blob and puts its foot
point on the ground: this gives place, stature and heading, but not the phase, nor which leg is which.
Without a background, or where nobody is seen against it, a detector of upright people looks for somebody,
which is vaguer.  People must be in full view, feet included; of several the one who walks is taken; a long
shadow misplaces the start.
Seen from the side, left and right look alike at first: the status is ambiguous until the picture tells them
apart.  A JSON start is always better.

Who is lost is looked for near the last place, then anywhere in the picture: somebody who walks in full view
for a second starts the track anew (not with --smooth).

--tracks adds joints that a detector has found in the frames, as gait lift takes them, to what the pictures
say: points of which the model knows nothing are left out, and so are frames that the file does not hold.

Writes one row per frame to OUT.csv: frame, time (s), status (init tracking ambiguous lost), phase (of the
stride, 0 as the right heel strikes), stride rate, heading, stature, speed; effective number of particles, log
evidence; coefficients of the components; each joint's place in the world (_x _y _z, metres) and standard
deviation (_sx _sy _sz); angles (_deg); standard deviations of phase, rate, heading, stature, coefficients.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np

from gait.bindings.abi import Mode, Term, TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.frame import Joints
from gait.bindings.initial import OUTSIDE, Start
from gait.bindings.model import Model, read_cyclic
from gait.body.model_curves import ModelCurves
from gait.camera.camera import Camera
from gait.cli import defaults, values
from gait.durations import spread
from gait.errors import UsageError, UserError
from gait.io import keypoints_file as tracks_file
from gait.io.files import require_outputs
from gait.io.track_file import TrackWriter
from gait.io.trc import write_trc
from gait.io.video import Frame, Image, Video, VideoWriter, background
from gait.progress import progress
from gait.report.drawing import Overlay
from gait.track.auto_start import Spotter, find_start
from gait.track.config import TrackerConfig
from gait.track.person_detection import another_scene, one_is_grey
from gait.track.smooth import Smoother
from gait.track.tracker import Tracker

TRACKS_SD = 4.0  # pixels

Sink = Callable[[Frame, Estimate], None]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("video", metavar="VIDEO", help="any file that FFmpeg reads")
    parser.add_argument(
        "--camera", required=True, metavar="CAM", help="JSON, OpenCV YAML/XML or FILE.toml:name"
    )
    parser.add_argument("-o", "--output", required=True, metavar="OUT.csv", help="the track")
    parser.add_argument("-m", "--model", metavar="M.gait", help="walking model (the shipped one)")
    parser.add_argument("--init", default="auto", metavar="INIT.json|auto", help="first state (auto)")
    parser.add_argument(
        "--background",
        default="auto",
        metavar="PNG|auto|none",
        help="empty scene: an image, the median of the clip, or none (auto)",
    )
    parser.add_argument("--height", type=values.stature, metavar="M", help="the person's stature in metres")
    usual, paper = defaults.particles(), defaults.particles(Mode.PAPER)
    least, most = values.PARTICLES
    parser.add_argument(
        "--particles",
        type=values.whole(least, most),
        metavar="N",
        help=f"hypotheses ({usual}, paper mode {paper}; at least {least}, at most {most})",
    )
    parser.add_argument(
        "--seed", type=values.whole(*values.SEED), default=1, metavar="S", help="of the random numbers (1)"
    )
    parser.add_argument(
        "--threads",
        type=values.whole(*values.THREADS),
        default=1,
        metavar="T",
        help=f"does not change the result (1; at most {values.THREADS[1]})",
    )
    parser.add_argument("--start", type=values.whole(0), metavar="F", help="first frame to use, from 0")
    parser.add_argument("--stop", type=values.whole(0), metavar="F", help="first frame not to use")
    parser.add_argument(
        "--mode", choices=[m.name.lower() for m in Mode], default="default", help="set of settings"
    )
    parser.add_argument("--tracks", metavar="TRACKS.csv", help="2-D joints found in the frames, one more cue")
    parser.add_argument(
        "--tracks-sd",
        type=values.positive,
        metavar="PX",
        help=f"noise of these at full confidence, and what joints are to the detector and not to the model "
        f"({TRACKS_SD:g})",
    )
    parser.add_argument("--overlay", metavar="O.mp4", help="also draw the estimate into the video")
    parser.add_argument(
        "--smooth", action="store_true", help="estimates that know the whole clip, frames after them included"
    )
    parser.add_argument(
        "--draws",
        metavar="D.npz",
        help="with --smooth: also write the motions drawn, for gait report track",
    )
    parser.add_argument("--trc", metavar="O.trc", help="also write the joints for OpenSim (y up)")


def run(args: argparse.Namespace) -> int:
    """Track and report."""
    if args.stop is not None:
        values.require_order(args.start or 0, args.stop)
    if args.draws and not args.smooth:
        raise UsageError("--draws: needs --smooth")
    if args.tracks_sd and not args.tracks:
        raise UsageError("--tracks-sd: needs --tracks")
    require_outputs(
        (args.output, args.overlay, args.trc, args.draws),
        (args.video, args.camera, args.model, args.init, args.background, args.tracks),
    )
    video = Video(args.video)
    camera = Camera.read(args.camera, video.size)
    model = Model(args.model)
    with progress("background", video.count, args.quiet) as update:
        plate = background(args.background, video, update)
    start = _start(args, video, camera, plate, model)
    frames = _frames(args, video, start.frame)
    joints = _joints(args, model, frames)
    if not args.quiet and not camera.shows(model.pose(start.mean)[0]):
        print(f"{args.init}: {OUTSIDE}", file=sys.stderr)
    config = TrackerConfig.default(Mode[args.mode.upper()], **_given(args))
    if args.tracks:
        config = replace(config, terms=config.terms | Term.KEYPOINTS)
    tracker = Tracker(model, camera, config, background=plate, tasks=args.threads)
    spotter = None if args.smooth else Spotter(camera, plate, model, args.height)
    results = _track(args, video, tracker, start, frames, spotter, joints)
    for frame, x, y in () if args.quiet else results.found_anew:
        print(f"lost, and somebody found at frame {frame}: x {x:.2f} y {y:.2f} m", file=sys.stderr)
    if args.trc:
        write_trc(args.trc, model.joint_names, np.array(results.times), np.array(results.joints), video.fps)
    summary = results.summary(args.threads)
    print(json.dumps(summary) if args.json else _text(summary))
    return 0


def _require_scene(args: argparse.Namespace, video: Video, plate: Image | None, first: int) -> None:
    """Refuse a plate of another scene than the first frame, or without its colours; tell of such a median."""
    frame = next(iter(video.frames(first, first + 1)), None)
    if plate is None or frame is None:
        return
    if one_is_grey(frame.image, plate):
        raise UserError(
            f"{args.background}: of it and {video.path} one is grey, the other in colour; take both alike"
        )
    if not another_scene(frame.image, plate):
        return
    differs = f"half of frame {first} differs from"
    if args.background != "auto":
        raise UserError(f"{args.background}: {differs} it; give the empty scene of this camera, auto or none")
    if not args.quiet:
        print(
            f"{differs} the median of the clip, the background: if the camera moves, --background none",
            file=sys.stderr,
        )


def _frames(args: argparse.Namespace, video: Video, start: int) -> range:
    """Frames from `start` that are chosen; UserError if there are none."""
    stop = video.count if args.stop is None else min(args.stop, video.count)
    if start >= stop:
        raise UserError(f"{video.path}: no frame from {start} up to {stop}; it has {video.count}")
    return range(start, stop)


def _given(args: argparse.Namespace) -> dict[str, Any]:
    """Return the settings that the command line changes."""
    return {"seed": args.seed} | ({} if args.particles is None else {"particles": args.particles})


def _joints(args: argparse.Namespace, model: Model, frames: range) -> dict[int, Joints]:
    """Joints of --tracks, of which some must be in the frames to track, by frame."""
    if not args.tracks:
        return {}
    tracks, ignored = tracks_file.read(args.tracks, model.joint_names, ignore_unknown=True)
    if ignored and not args.quiet:
        print(f"left out: {' '.join(ignored)}", file=sys.stderr)
    if not any(frame in frames for frame in tracks.frame.tolist()):
        raise UserError(f"{args.tracks}: has no frame that is tracked; number frames as in the video, from 0")
    sd = args.tracks_sd or TRACKS_SD
    tracks.require_spread(args.tracks, sd)
    return tracks.joints(sd)


def _start(
    args: argparse.Namespace, video: Video, camera: Camera, plate: Image | None, model: Model
) -> Start:
    """First state by --init, --start and --height."""
    if args.init != "auto":
        start = Start.read(args.init, model, frame=args.start, height=args.height)
        _require_scene(args, video, plate, start.frame)
        return start
    _frames(args, video, args.start or 0)
    _require_scene(args, video, plate, args.start or 0)
    start = find_start(video, camera, plate, model, first=args.start or 0, stop=args.stop, height=args.height)
    if not args.quiet:
        at, turn, unsure = start.mean, np.degrees(start.mean.heading), np.degrees(start.sd.heading)
        print(
            f"start found at frame {start.frame}: x {at.pelvis[0]:.2f} y {at.pelvis[1]:.2f} m, "
            f"stature {at.stature:.2f} m, heading {turn:.0f} +- {unsure:.0f} deg",
            file=sys.stderr,
        )
        if start.looks:
            print(
                f"the person looks {start.looks:.2f} m tall by the camera, taken for {at.stature:.2f} m: "
                f"{'check --height and' if args.height else 'give --height or check'} the camera",
                file=sys.stderr,
            )
    return start


class _Results:
    """What the report at the end needs from each step."""

    def __init__(self, tracker: Tracker) -> None:
        self._tracker = tracker
        self._steps: list[float] = []
        self._statuses: list[TrackStatus] = []
        self._begun = time.perf_counter()
        self.times: list[float] = []
        self.joints: list[np.ndarray[Any, Any]] = []
        self.found_anew: list[tuple[int, float, float]] = []  # frame and place of each start but the first

    def step(self, frame: Frame, estimate: Estimate) -> None:
        if self._steps and estimate.frame == 0:
            self.found_anew.append((frame.number, *estimate.mean.pelvis[:2]))
        self._steps.append(1000 * self._tracker.step_seconds)
        self._wall = time.perf_counter() - self._begun

    def add(self, frame: Frame, estimate: Estimate) -> None:
        self._statuses.append(estimate.status)
        self.times.append(frame.time)
        self.joints.append(estimate.joints)

    def summary(self, threads: int) -> dict[str, Any]:
        """Return the figures of ``--json``; step_ms is the time inside gait_tracker_step alone."""
        steps, tracker = self._steps, self._tracker
        return {
            "frames": len(steps),
            "particles": tracker.config.particles,
            "threads": threads,
            "step_ms": spread(steps),
            "wall_fps": len(steps) / self._wall,
            "lost": self._statuses.count(TrackStatus.LOST),
            "ambiguous": self._statuses.count(TrackStatus.AMBIGUOUS),
            "memory_bytes": tracker.memory_bytes,
            "digest": f"{tracker.digest():016x}",
        }


def _track(
    args: argparse.Namespace,
    video: Video,
    tracker: Tracker,
    start: Start,
    frames: range,
    spotter: Spotter | None,
    joints: dict[int, Joints],
) -> _Results:
    """Run the tracker over the frames into all outputs, which appear together at the end."""
    model, results = tracker.model, _Results(tracker)
    with ExitStack() as stack:
        rows = TrackWriter(args.output, model.info.components, model.joint_names, model.angle_names)
        sinks: list[Sink] = [results.add, stack.enter_context(rows).write]
        smoother = stack.enter_context(_smoother(args, tracker)) if args.smooth else None
        if args.overlay:
            film = stack.enter_context(VideoWriter(args.overlay, video.fps))
            overlay = Overlay(model, tracker.cameras[0])
            sinks.append(
                lambda frame, estimate: film.write(overlay.draw(frame.image, estimate, frame.number))
            )
        update = stack.enter_context(progress("tracking", len(frames), args.quiet))
        found = tracker.follow(video, start, frames.stop, spotter, joints)
        for done, (frame, estimate) in enumerate(found, 1):
            results.step(frame, estimate)
            for sink in sinks if smoother is None else [smoother.add]:
                sink(frame, estimate)
            update(done)
        if smoother is not None and len(smoother):
            _smooth(args, video, smoother, sinks)
        if not results.times:
            raise UserError(f"{video.path}: no frame from {start.frame} on can be decoded; convert it anew")
    return results


def _smoother(args: argparse.Namespace, tracker: Tracker) -> Smoother:
    return Smoother(tracker, ModelCurves(read_cyclic(args.model)))


def _smooth(args: argparse.Namespace, video: Video, smoother: Smoother, sinks: list[Sink]) -> None:
    """Give every frame with its smoothed estimate to the sinks, and write the draws."""
    with progress("smoothing", len(smoother), args.quiet) as update:
        rows, draws = smoother.finish(update=update)
    if args.draws:
        draws.write(args.draws)
    frames: Iterable[Frame] = (frame for frame, _ in rows)
    if args.overlay:  # the pictures once more
        frames = video.frames(rows[0][0].number, rows[-1][0].number + 1)
    for frame, (_, estimate) in zip(frames, rows, strict=True):
        for sink in sinks:
            sink(frame, estimate)


def _text(summary: dict[str, Any]) -> str:
    step, threads = summary["step_ms"], summary["threads"]
    return (
        f"{summary['frames']} frames, status lost in {summary['lost']}, ambiguous in {summary['ambiguous']}\n"
        f"{summary['particles']} particles, {threads} thread{'s' if threads > 1 else ''}, "
        f"{summary['memory_bytes']} bytes\n"
        f"step {step['median']:.1f} ms median, {step['p99']:.1f} ms p99, {step['max']:.1f} ms max; "
        f"{summary['wall_fps']:.1f} frames/s in all\ndigest {summary['digest']}"
    )
