"""2-D tracks of joints, or a video, to motion in space with standard deviations.

TRACKS.csv has the columns frame,time,<joint>_u,<joint>_v and, if known, <joint>_c: pixels (u to the right,
v down, centres at integers) and a confidence from 0 to 1 that divides the noise; empty cells are not seen.
Joints are those of the model's segment prior (gait info M.gait).  The prior over short segments of motion
fills in the depth and what is not seen (Leventon and Freeman 1998).

Views: --camera gives places in the camera's world.  --orthographic looks along an axis of a world with z
up from far away; the scale comes from the person's stature unless --metres-per-unit gives it.  Without either
the camera is taken to be level and far away (along y), its scale slowly changing.  Both leave out the place
along the line of sight, and the lowest feet are put on the floor.

OUT.csv: frame,time and for each joint _x,_y,_z (metres) and _sx,_sy,_sz (posterior standard deviations).

A VIDEO instead of tracks needs --placement: see the options under "from a video".
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from gait.camera import Camera
from gait.cli import lift_video, values
from gait.errors import UsageError, UserError
from gait.files import require_writable
from gait.learn.stage import one_thread
from gait.lift import lifted_file, motion, outliers, tracks_file
from gait.lift.equations import Parallel, Perspective, View, looking_along
from gait.lift.prior import SegmentPrior
from gait.lift.tracks_file import Tracks
from gait.progress import progress
from gait.trc import write_trc

NAME = "lift"
HELP = "2-D joint tracks, or a video, to 3-D"

_ONLY_TRACKS = ("orthographic", "metres_per_unit", "trc", "ignore_unknown", "keep_jumps", "height")
MOST_JUMPS = 5  # named
FAR = 4.0  # noise alone gives a median of 1.2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("input", metavar="TRACKS.csv|VIDEO", help="2-D tracks, or a video with --placement")
    parser.add_argument("-o", "--output", required=True, metavar="OUT.csv", help="places and deviations")
    parser.add_argument("-m", "--model", metavar="M.gait", help="with a segment prior (the shipped model)")
    parser.add_argument("--camera", metavar="CAM", help="JSON, OpenCV YAML/XML or FILE.toml:name")
    parser.add_argument("--all-markers", action="store_true", help="write all markers of the prior")
    group = parser.add_argument_group("from tracks")
    group.add_argument(
        "--orthographic", metavar="AXIS", help="view along x, y, z, -x, -y, -z or X,Y,Z from far away"
    )
    group.add_argument(
        "--metres-per-unit", type=values.positive, metavar="M", help="scale of u and v with --orthographic"
    )
    group.add_argument("--height", type=values.stature, metavar="M", help="stature (unknown: of most people)")
    group.add_argument(
        "--pixel-sd",
        type=values.positive,
        default=3.0,
        metavar="SD",
        help="noise of u and v, in their unit (3)",
    )
    group.add_argument(
        "--floor-sd",
        type=values.positive,
        default=0.03,
        metavar="M",
        help="smooth with --camera: how well the person stands at z = 0, metres (0.03; more on steps)",
    )
    group.add_argument(
        "--method",
        choices=motion.METHODS,
        default=motion.METHODS[0],
        help="smooth (the default): one Gaussian over the whole sequence; blend: overlapping segments alone, "
        "mixed as in the paper; segment: one after another",
    )
    group.add_argument("--no-contact", action="store_true", help="smooth: feet on the ground may slide")
    group.add_argument("--no-bones", action="store_true", help="smooth: bones may change their length")
    group.add_argument("--ignore-unknown", action="store_true", help="leave out points the model has not")
    group.add_argument(
        "--keep-jumps",
        action="store_true",
        help="keep points that are far from where they were a frame before and after",
    )
    group.add_argument("--trc", metavar="O.trc", help="also write the places for OpenSim")
    lift_video.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Lift tracks, or pass a video on."""
    if args.placement or Path(args.input).suffix.lower() not in (".csv", ".txt", ""):
        for option in _ONLY_TRACKS:
            if getattr(args, option):
                raise UsageError(f"--{option.replace('_', '-')} is for tracks, and {args.input} is a video")
        return lift_video.run(args)
    _check(args)
    prior = SegmentPrior.load(args.model)
    tracks, ignored = tracks_file.read(args.input, prior.names, args.ignore_unknown)
    tracks.require_spread(args.input, args.pixel_sd)
    if ignored and not args.quiet:
        print(f"left out: {' '.join(ignored)}", file=sys.stderr)
    jumps: list[tuple[int, str]] = []
    if not args.keep_jumps:
        tracks, jumps = outliers.without_jumps(tracks, args.pixel_sd)
    if jumps and not args.quiet:
        print(_jumped(jumps), file=sys.stderr)
    names = motion.output_names(prior, tracks, args.all_markers)
    options = motion.Options(
        args.method, args.height, args.pixel_sd, args.floor_sd, not args.no_contact, not args.no_bones
    )
    with one_thread(), progress("segments", motion.segments_of(prior, tracks), args.quiet) as update:
        found = motion.lift(prior, tracks, _view(args, tracks), options, names, update)
    if not np.isfinite(found.error).any():
        raise UserError(f"{args.input}: the estimate lies behind the camera; check the camera and the names")
    if not args.quiet:
        for words in _doubts(found, args.pixel_sd):
            print(words, file=sys.stderr)
    lifted_file.write(args.output, tracks.frame, tracks.time, names, found.places, found.sd)
    if args.trc:
        write_trc(args.trc, names, tracks.time, found.places, _rate(tracks))
    summary = _summary(args, tracks, found) | {"jumps": len(jumps)}
    print(json.dumps(summary) if args.json else _text(summary))
    return 0


def _doubts(found: motion.Motion, pixel_sd: float) -> list[str]:
    """Why the result may be wrong, a line each."""
    far = float(np.nanmedian(found.error)) / pixel_sd
    doubts = {
        f"not a motion like those learnt: the prior was widened {found.wider:g} times": found.wider > 1,
        f"the motion's size was told by the bones ({found.resized:.2f} times the fit's): it is unlike those "
        "learnt, or the camera is wrong; deviations are wide, do not rely on the places": found.resized != 1,
        f"the estimate did not rest in {found.steps} iterations: do not rely on it": not found.settled,
        f"the estimate is {far:.0f} times --pixel-sd from what was seen: do not rely on it; check camera, "
        "the names of the points and --pixel-sd": far > FAR,
    }
    return [words for words, holds in doubts.items() if holds]


def _jumped(jumps: list[tuple[int, str]]) -> str:
    """Name the points that were taken out."""
    named = ", ".join(f"{name} in frame {frame}" for frame, name in jumps[:MOST_JUMPS])
    more = f" and {len(jumps) - MOST_JUMPS} more" if len(jumps) > MOST_JUMPS else ""
    return f"left out, far from where they were a frame before and after: {named}{more} (--keep-jumps)"


def _check(args: argparse.Namespace) -> None:
    """Refuse before the work what would fail after it."""
    if args.camera and args.orthographic:
        raise UsageError("--camera and --orthographic are two views; give one of them")
    if args.metres_per_unit and not args.orthographic:
        raise UsageError("--metres-per-unit goes with --orthographic")
    if args.method != "smooth" and (args.no_contact or args.no_bones):
        raise UsageError("--no-contact and --no-bones go with --method smooth")
    for path in filter(None, (args.output, args.trc)):
        require_writable(path)


def _view(args: argparse.Namespace, tracks: Tracks) -> View:
    if args.camera:
        return Perspective(Camera.read(args.camera))
    middle = np.nanmean(tracks.uv, axis=(0, 1))
    axes = looking_along(args.orthographic or "y")
    return Parallel(axes, args.metres_per_unit, middle, steady=bool(args.orthographic))


def _rate(tracks: Tracks) -> float:
    """Frames per second."""
    return float((len(tracks.time) - 1) / (tracks.time[-1] - tracks.time[0])) if len(tracks.time) > 1 else 1.0


def _summary(args: argparse.Namespace, tracks: Tracks, found: motion.Motion) -> dict[str, Any]:
    """Figures of ``--json``."""
    return {
        "frames": len(tracks.frame),
        "method": args.method,
        "markers": {"seen": list(tracks.names), "estimated": list(found.names)},
        "seen_share": float(tracks.seen.mean()),
        "reprojection_px": float(np.nanmedian(found.error)),
        "sd_mm": 1000 * float(np.median(found.sd)),
        "stature_m": found.stature,
        "iterations": found.steps,
        "settled": found.settled,
        "log10_volume_ratio": found.log_volume_ratio,
        "misfit": found.misfit if np.isfinite(found.misfit) else None,
        "prior_widened": found.wider,
        "resized": found.resized,
    }


def _text(s: dict[str, Any]) -> str:
    markers = s["markers"]
    lines = [
        f"{s['frames']} frames, {len(markers['seen'])} points seen in {s['seen_share']:.0%} of them, "
        f"{len(markers['estimated'])} estimated",
        f"{s['reprojection_px']:.2f} px from what was seen, median sd {s['sd_mm']:.0f} mm, "
        f"stature {s['stature_m']:.2f} m",
    ]
    if s["method"] == "smooth":
        lines.append(
            f"{s['iterations']} iterations; posterior volume 1e{s['log10_volume_ratio']:.0f} of the prior's"
        )
    return "\n".join(lines)
