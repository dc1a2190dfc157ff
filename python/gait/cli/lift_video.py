"""The part of ``gait lift`` that starts from a video: sensors, corrections, cylinder figure."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.bindings.model import read_blob, read_cyclic
from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import JOINTS
from gait.camera.camera import Camera
from gait.cli import lift_prior, values
from gait.errors import UsageError, UserError
from gait.io.blob import decode
from gait.io.track_file import write_lifted
from gait.io.video import Video, VideoWriter, background, require_video_name
from gait.learn.corpus.stage import one_thread
from gait.lift.video.clip_segments import ClipSegments, Settings
from gait.lift.video.corrections import Correction, PhasePrior, Placement, read_corrections, read_placement
from gait.lift.video.figure import Figure, draw_figure
from gait.lift.video.fit_clip import DOUBTFUL, ENOUGH, HELD, ClipFit, fit_clip, suggest, work
from gait.lift.video.sensors import CameraView, Film, FlatView, View
from gait.progress import progress

Floats = npt.NDArray[np.float64]


SMALLEST = 20.0  # pixels of a person whose limbs can be told
LARGEST = 4.0  # heights of the picture


FILES = """\
P.json says where the person roughly is in one frame, with --camera as --init of gait track does:
  {"frame": 64, "pelvis": [-0.1, 5.5, 0.9], "heading_rad": -1.57, "stature_m": 1.65}
and without a camera in the picture; places are then in its axes (x to the right, y away, z up):
  {"frame": 64, "pelvis_px": [1376, 734], "height_px": 415, "heading_rad": 3.14, "stature_m": 1.65}
"phase" (of walking, 0 as the right heel strikes, 0.5 as the left one does) tells which leg is ahead;
without it, and seen from the side, left and right may come out exchanged.
C.json says where joints (or other markers of the model) are, and if wanted how exactly (4 pixels):
  {"corrections": [{"frame": 70, "joint": "l_knee", "uv": [1285.5, 812], "sd_px": 5}]}
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that only a video has."""
    group = parser.add_argument_group("from a video", FILES)
    group.add_argument(
        "--placement", metavar="P.json", help="where the person roughly is in one frame; a video needs it"
    )
    group.add_argument("--corrections", metavar="C.json", help="joints pointed at in any frames")
    group.add_argument(
        "--background",
        metavar="PNG|auto|none",
        help="empty scene, whose edges the sensors leave out: an image; auto (default), the median of the "
        "clip; or none",
    )
    group.add_argument(
        "--start", type=values.whole(0), metavar="F", help="first frame to use (default: the placement's)"
    )
    group.add_argument(
        "--stop", type=values.whole(0), metavar="F", help="first frame not to use (default: to the end)"
    )
    group.add_argument(
        "--alone",
        action="store_true",
        help="estimate segments one after the other, as in the paper (default: together)",
    )
    group.add_argument("--overlay", metavar="O.mp4", help="draw the cylinder figure into the video")
    group.add_argument(
        "--suggest",
        type=values.whole(0),
        metavar="N",
        help="name the N corrections that would tell most (default: 0)",
    )


def run(args: argparse.Namespace) -> int:
    """Estimate the motion in a video and report."""
    if not args.placement:
        raise UsageError("--placement: a video needs it; say where the person roughly is in one frame")
    if args.overlay:
        require_video_name(args.overlay)
    video, prior = Video(args.input), lift_prior.load(args.model, args.quiet)
    camera = Camera.read(args.camera, video.size) if args.camera else None
    placement = read_placement(args.placement, prior, camera is not None)
    if placement.unused and not args.quiet:
        keys = " and ".join(placement.unused)
        print(
            f"{args.placement}: not used {'with' if camera else 'without'} --camera: {keys}", file=sys.stderr
        )
    first, stop = _frames(args, video, placement)
    corrections = []
    if args.corrections:
        corrections = read_corrections(args.corrections, prior, stop, first, video.size)
    view = CameraView(camera) if camera else _flat(placement, prior)
    film = _film(args, video, view, placement, prior, (first, stop))
    used = [c for c in corrections if first <= c.frame < first + len(film.times)]
    if len(used) < len(corrections) and not args.quiet:
        print(f"{len(corrections) - len(used)} corrections of frames that are not used", file=sys.stderr)
    phase_prior = PhasePrior.of(prior, _cycle(args.model), placement)
    clip = ClipSegments(prior, view, film, placement, used, Settings(joined=not args.alone), phase_prior)
    free, fit = _fits(clip, args.quiet)
    if fit.fit_correlation < DOUBTFUL and not args.quiet:
        print(_doubt(args, fit.fit_correlation), file=sys.stderr)
    figure = Figure.fit(fit.places, prior.names)
    shown = [i for i, name in enumerate(prior.names) if name in JOINTS or args.all_markers]
    names = [prior.names[i] for i in shown]
    write_lifted(args.output, fit.frame, fit.time, names, fit.places[:, shown], fit.sd[:, shown])
    if args.overlay:
        _draw(args, video, clip, fit, figure)
    summary = _summary(clip, free, fit, figure, args.suggest or 0)
    print(json.dumps(summary) if args.json else _text(summary))
    return 0


def _doubt(args: argparse.Namespace, fit_correlation: float) -> str:
    remedy = "--background or --corrections" if args.background == "none" else "--corrections"
    return (
        f"{args.input}: little of what the sensors read is the person (it correlates by {fit_correlation:.2f} with "
        f"the stick figure, by {HELD:g} before a known background): the figure may have left, deviations are "
        f"widened; look with --overlay and give {remedy}"
    )


def _frames(args: argparse.Namespace, video: Video, placement: Placement) -> tuple[int, int]:
    """First frame, and the first not used."""
    first = placement.frame if args.start is None else args.start
    stop = video.count if args.stop is None else min(args.stop, video.count)
    if first >= stop:
        raise UserError(
            f"{args.input}: has no frame from {first} to before {stop}; its frames are 0 to "
            f"{video.count - 1}, give other --start and --stop, or another frame in the placement"
        )
    if not first <= placement.frame < stop:
        raise UserError(
            f"{args.placement}: frame {placement.frame} is not among the frames {first} to {stop - 1}; "
            "place the person in one of them"
        )
    return first, stop


def _flat(placement: Placement, prior: SegmentPrior) -> FlatView:
    """View without a camera: as many pixels per metre as the placement says."""
    assert placement.pelvis_px is not None and placement.height_px is not None
    pixels = placement.height_px / placement.stature
    pelvis = placement.stature * prior.mean[0, 0, prior.index(["pelvis"])[0], 2]
    return FlatView(pixels, (placement.pelvis_px[0], placement.pelvis_px[1] + pixels * pelvis))


def _cycle(model: str | None) -> Mapping[str, Any]:
    """Sections with a cyclic model: the model's own, or those of the shipped one."""
    sections = decode(read_blob(model))
    return sections if "CURV" in sections else read_cyclic(None)


def _film(
    args: argparse.Namespace,
    video: Video,
    view: View,
    placement: Placement,
    prior: SegmentPrior,
    frames: tuple[int, int],
) -> Film:
    """Sensors of the frames used."""
    pelvis = np.append(placement.ground, placement.stature * prior.mean[0, 0, prior.index(["pelvis"])[0], 2])
    if not view.visible(pelvis):
        raise UserError(
            f"{args.placement}: pelvis is behind the camera; give its place in the camera's world"
        )
    height = placement.stature * view.scale(pelvis)
    _require_in_picture(args.placement, video, view.project(pelvis)[0], height)
    with progress("background", video.count, args.quiet) as update:
        plate = background(args.background or "auto", video, update)
    with progress("sensors", frames[1] - frames[0], args.quiet) as update:
        return Film.make(video.frames(*frames), height, plate, update)


def _require_in_picture(path: str, video: Video, pelvis: Floats, height: float) -> None:
    """Refuse a placement of nobody in the picture: `pelvis` (2,) and `height` in pixels."""
    wide, high = video.size
    if not SMALLEST <= height <= LARGEST * high:
        raise UserError(
            f"{path}: the person would be {height:.3g} px tall in a picture of {wide}x{high}; give the place "
            f"and stature, or height_px, of a person of {SMALLEST:g} to {LARGEST * high:g} px"
        )
    if (np.maximum(-pelvis, pelvis - (wide - 1, high - 1)) > height / 2).any():
        raise UserError(
            f"{path}: the pelvis falls at pixel ({pelvis[0]:.0f}, {pelvis[1]:.0f}) of a picture of "
            f"{wide}x{high}; place the person where the picture shows some of it"
        )


def _fits(clip: ClipSegments, quiet: bool) -> tuple[ClipFit, ClipFit]:
    """Estimates without and with the corrections."""
    with one_thread(), progress("segments", work(clip), quiet) as update:
        free = fit_clip(replace(clip, corrections=()), update=update)
    if not clip.corrections:
        return free, free
    with one_thread(), progress("corrections", work(clip), quiet) as update:
        return free, fit_clip(clip, update=update)


def _marker(clip: ClipSegments, fit: ClipFit, correction: Correction) -> Floats:
    """Place (3,) of a correction's marker in an estimate."""
    found = fit.places[correction.frame - clip.film.first, clip.prior.index([correction.joint])[0]]
    return np.asarray(found)


def _draw(args: argparse.Namespace, video: Video, clip: ClipSegments, fit: ClipFit, figure: Figure) -> None:
    """Write the overlay."""
    surfaces, joints, first = figure.surfaces(), figure.joints(), clip.film.first
    with (
        VideoWriter(args.overlay, video.fps) as film,
        progress("drawing", len(fit.frame), args.quiet) as update,
    ):
        for k, frame in enumerate(video.frames(first, first + len(fit.frame))):
            corrections = [(c, _marker(clip, fit, c)) for c in clip.corrections if c.frame == frame.number]
            film.write(draw_figure(frame.image, clip.view, surfaces[k], joints[k], corrections))
            update(k + 1)


def _misses(clip: ClipSegments, fit: ClipFit) -> Floats:
    """Distances (C,) in pixels of the corrections' markers from where they were pointed at."""
    seen = [clip.view.project(_marker(clip, fit, c)[None])[0][0] - c.uv for c in clip.corrections]
    return np.linalg.norm(np.reshape(seen, (-1, 2)), axis=1)


def _summary(clip: ClipSegments, free: ClipFit, fit: ClipFit, figure: Figure, most: int) -> dict[str, Any]:
    """Figures of ``--json``."""
    frames, given = len(fit.frame), len(clip.corrections)
    pixels = float(np.median([clip.view.scale(body.mean(axis=0)) for body in fit.places]))
    enough = ENOUGH * clip.placement.stature * pixels
    before, after = _misses(clip, free), _misses(clip, fit)
    wanted = suggest(clip, fit)
    joints = clip.prior.index([j for j in JOINTS if j in clip.prior.names])
    return {
        "frames": frames,
        "segments": len(clip.starts),
        "corrections": {
            "given": given,
            "per_frame": given / frames,
            "needed": int((before > enough).sum()),
            "within_px": float(enough),
            "miss_px": {
                "without": float(np.median(before)) if given else None,
                "with": float(np.median(after)) if given else None,
            },
            "wanted": len(wanted),
            "wanted_per_frame": len(wanted) / frames,
        },
        "fit_correlation": fit.fit_correlation if np.isfinite(fit.fit_correlation) else None,
        "sd_mm": 1000 * float(np.median(fit.sd[:, joints])),
        "figure": {
            "stature_m": figure.stature,
            "residual_mm": 1000 * float(np.nanmedian(figure.residual)),
            "bones_m": figure.lengths(),
        },
        "suggest": [{"frame": s.frame, "joint": s.joint, "sd_px": s.sd_px} for s in wanted[:most]],
    }


def _text(summary: dict[str, Any]) -> str:
    c, figure = summary["corrections"], summary["figure"]
    lines = [
        f"{summary['frames']} frames in {summary['segments']} segments, median sd {summary['sd_mm']:.0f} mm",
        f"{c['given']} corrections ({c['per_frame']:.2f} per frame), {c['needed']} of them more than "
        f"{c['within_px']:.0f} px from where the picture alone puts the joint",
        f"{c['wanted']} more ({c['wanted_per_frame']:.2f} per frame) would make every joint sure to "
        f"{c['within_px']:.0f} px",
        f"figure: stature {figure['stature_m']:.2f} m, {figure['residual_mm']:.0f} mm from the markers",
    ]
    asked = [f"frame {s['frame']:5d}  {s['joint']:<11} +- {s['sd_px']:.0f} px" for s in summary["suggest"]]
    return "\n".join([*lines, *asked])
