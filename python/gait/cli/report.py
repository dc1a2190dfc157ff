"""Show what a tracker did with a clip: overlay video and a page with figures and plots.

Reads the log that gait record --log wrote beside the track (or one of lcm-logger), and the clip.  With
--truth it also prints the errors of gait eval.  The page is one HTML file that needs nothing else.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gait.bindings.model import Model, read_cyclic
from gait.camera.camera import Camera
from gait.cli.evaluate import text as evaluation_text
from gait.durations import spread
from gait.errors import UserError
from gait.io.files import replacing, require_outputs
from gait.io.track_file import Joints, Track, read_track, read_truth
from gait.io.video import Image, Video, VideoWriter
from gait.lcm.link import break_of
from gait.lcm.plots import Comparison, compare, error_plot, gait_plot, path_plot, phase_plot, time_plot
from gait.lcm.record import Run, read_run
from gait.motion.evaluate import Measures, evaluate
from gait.motion.footfalls import Strikes, strikes_of
from gait.progress import progress
from gait.report.drawing import Overlay
from gait.report.page import Page

_PICTURES = 6


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("log", metavar="E.log", help="estimates, from gait record --log or lcm-logger")
    parser.add_argument("--track", required=True, metavar="OUT.csv", help="the track, from gait record")
    parser.add_argument("--video", required=True, metavar="VIDEO", help="the clip that was tracked")
    parser.add_argument(
        "--camera", required=True, metavar="CAM", help="JSON, OpenCV YAML/XML or FILE.toml:name"
    )
    parser.add_argument("-o", "--output", required=True, metavar="R.html", help="the page")
    parser.add_argument("--overlay", metavar="O.mp4", help="also draw the estimates into the video")
    parser.add_argument("--truth", metavar="TRUTH.csv", help="for the errors")
    parser.add_argument("-m", "--model", metavar="M.gait", help="that tracked (the shipped one)")
    parser.add_argument("--replayed", action="store_true", help="not live: a latency would mean nothing")


def run(args: argparse.Namespace) -> int:
    """Draw, write, print."""
    require_outputs(
        (args.output, args.overlay), (args.log, args.track, args.video, args.camera, args.truth, args.model)
    )
    measures = make_report(args, quiet=args.quiet)
    if measures is not None:
        print(json.dumps(measures) if args.json else evaluation_text(measures))
    damage = break_of(args.log)
    if damage:
        raise UserError(f"{args.log}: {damage}; {args.output} shows what came before")
    return 0


def make_report(args: argparse.Namespace, quiet: bool) -> Measures | None:
    """Write what `args` ask for (see `add_arguments`); return the errors, if there is a truth."""
    video = Video(args.video)
    camera, model = Camera.read(args.camera, video.size), Model(args.model)
    results, track = read_run(args.log), read_track(args.track)
    if results.remark and not quiet:
        print(f"{args.log}: {results.remark}", file=sys.stderr)
    truth = read_truth(args.truth) if args.truth else None
    measures: Measures | None = None
    errors: Comparison | None = None
    if truth is not None:
        strikes = strikes_of(truth, Path(args.truth).parent / "meta.json")
        measures = _measures(args, track, truth, strikes, camera)
        errors = compare(track, truth, strikes)
    pictures = _film(args, video, Overlay(model, camera), results, quiet)
    page = Page(f"{video.path.name}: {len(results.frame)} frames tracked")
    page.table("Figures", _figures(results, live=not args.replayed))
    if measures is not None:
        page.block("Error against the truth", evaluation_text(measures))
    page.film("Frames", pictures)
    page.words("Tinted in the plots: frames at the start (grey), ambiguous (yellow), lost (red).")
    for heading, svg in _drawings(results, errors, live=not args.replayed):
        page.figure(heading, svg)
    with replacing(args.output) as path:
        path.write_text(page.text(), encoding="utf-8")
    return measures


def _measures(
    args: argparse.Namespace, track: Track, truth: Joints, strikes: Strikes, camera: Camera
) -> Measures:
    sections = read_cyclic(args.model)
    return evaluate(track, truth, strikes=strikes, model=sections, camera=camera)


def _figures(results: Run, live: bool) -> dict[str, str]:
    rows = {
        "frames": f"{results.frame[0]} to {results.frame[-1]}, {len(results.frame)} tracked",
        "dropped": f"{results.dropped}",
        "step of the tracker": _times(results.step_ms),
        "digest": f"{results.tracker_digest:016x}",
    }
    if live:
        rows["latency, capture to estimate received"] = _times(results.latency_ms)
    if len(results.seconds) > 1:
        rows["frame rate"] = f"{(len(results.seconds) - 1) / results.seconds[-1]:.2f} per second"
    return rows


def _times(values: Any) -> str:
    s = spread(values)
    return f"median {s['median']:.1f} ms, 99th percentile {s['p99']:.1f} ms, longest {s['max']:.1f} ms"


def _drawings(results: Run, errors: Comparison | None, live: bool) -> Iterator[tuple[str, str]]:
    if errors is not None:
        yield "Error", error_plot(results, errors)
    yield "Phase", phase_plot(results, errors)
    yield "Times", time_plot(results, live)
    yield "Cadence and speed", gait_plot(results)
    yield "Way over the ground", path_plot(results, errors)


def _film(
    args: argparse.Namespace, video: Video, overlay: Overlay, results: Run, quiet: bool
) -> list[tuple[int, Image]]:
    """Draw every tracked frame into the overlay video; return a few of them."""
    last = int(results.frame[-1])
    known = dict(zip(results.frame.tolist(), results.estimates, strict=True))
    wanted = set(
        results.frame[np.linspace(0, len(results.frame) - 1, _PICTURES).round().astype(int)].tolist()
    )
    kept = []
    with ExitStack() as stack:
        film = stack.enter_context(VideoWriter(args.overlay, video.fps)) if args.overlay else None
        update = stack.enter_context(progress("overlay", last + 1, quiet))
        for frame in video.frames(int(results.frame[0]), last + 1):
            estimate = known.get(frame.number)
            if film is None and frame.number not in wanted:
                continue
            picture = frame.image
            if estimate is not None:  # the panel shows the time of the video, not of the day
                picture = overlay.draw(picture, replace(estimate, utime=frame.utime), frame.number)
            if film is not None:
                film.write(picture)
            if frame.number in wanted:
                kept.append((frame.number, picture))
            update(frame.number)
    return kept
