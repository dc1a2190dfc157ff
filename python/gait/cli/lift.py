"""2-D keypoints of joints, or a video, to motion in space with standard deviations.

KEYPOINTS.csv has the columns frame,time,<joint>_u,<joint>_v and, if known, <joint>_c: pixels (u to the right,
v down, centres at integers) and a confidence from 0 to 1 that divides the noise; empty cells are not seen.
Joints are those of the model's segment prior (gait info M.gait).  The prior over short segments of motion
fills in the depth and what is not seen (Leventon and Freeman 1998).

Views: --camera gives places in the camera's world.  --orthographic looks along an axis of a world with z
up from far away; the scale comes from the person's stature unless --metres-per-unit gives it.  Without either
the camera is taken to be level and far away (along y), its scale slowly changing.  Both leave out the place
along the line of sight, and the lowest feet are put on the floor.

OUT.csv: frame,time and for each joint _x,_y,_z (metres) and _sx,_sy,_sz (posterior standard deviations).

A VIDEO instead of keypoints needs --placement: see the options under "from a video".
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from gait.bindings.initial import STATURE
from gait.cli import lift_doubts, lift_prior, lift_tracks, lift_video, values
from gait.errors import UsageError, UserError
from gait.io.files import require_outputs
from gait.io.keypoints_file import FURTHEST, Keypoints
from gait.io.track_file import write_lifted
from gait.io.trc import write_trc
from gait.lift.segment.explain import Uncertain
from gait.lift.smooth import motion

_ONLY_TRACKS = (
    *("orthographic", "metres_per_unit", "height", "pixel_sd", "floor_sd", "method", "no_contact"),
    *("no_bones", "ignore_unknown", "keep_sides", "keep_spikes", "trc"),
)
_ONLY_VIDEO = ("placement", "corrections", "background", "start", "stop", "alone", "overlay", "suggest")
PIXEL_SD, FLOOR_SD = motion.Options.pixel_sd, motion.Options.floor_sd  # pixels, metres
MOVED = 3  # joints named that a displacement moves most
WHOLE = 0.5  # of its energy: what moves all joints alike is of the body
UNTOLD_MM = 1000.0  # what is less certain than that is the distance, in a view without perspective


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("input", metavar="KEYPOINTS.csv|VIDEO", help="2-D keypoints, or a video with --placement")
    parser.add_argument(
        "-o", "--output", required=True, metavar="OUT.csv", help="places and standard deviations, metres"
    )
    parser.add_argument(
        "-m", "--model", metavar="M.gait", help="model with a segment prior (default: the shipped one)"
    )
    parser.add_argument(
        "--camera", metavar="CAM", help="calibration: JSON, OpenCV YAML or XML, or FILE.toml:name"
    )
    parser.add_argument(
        "--all-markers", action="store_true", help="write all markers of the prior, not its joints alone"
    )
    add = parser.add_argument_group("from keypoints").add_argument
    add(
        "--orthographic",
        metavar="AXIS",
        help="without a camera: look from far away along x, y, z, -x, -y, -z or X,Y,Z",
    )
    add(
        "--metres-per-unit",
        type=values.between(1e-6, 1e3, "metres"),
        metavar="M",
        help="length of a unit of u and v, with --orthographic (default: told from the person's stature)",
    )
    add(
        "--height",
        type=values.stature,
        metavar="M",
        help="the person's stature in metres (default: unknown, about that of the people learnt from)",
    )
    add(
        "--pixel-sd",
        type=values.between(1e-6, FURTHEST, "a standard deviation"),
        metavar="SD",
        help="standard deviation of u and v at full confidence, in their unit (default: how much the points "
        f"shake from frame to frame, at least {PIXEL_SD:g})",
    )
    add(
        "--floor-sd",
        type=values.between(1e-4, 100, "metres"),
        metavar="M",
        help="how well the person stands at z = 0: a standard deviation in metres, with --camera and "
        f"--method smooth (default: {FLOOR_SD:g}; more on steps)",
    )
    add(
        "--method",
        choices=motion.METHODS,
        help="smooth (default): one Gaussian over the whole sequence; blend: overlapping segments, each "
        "estimated alone, mixed as in the paper; segment: one after another; likelihood: as blend without "
        "the prior of the modes (least squares), for comparison",
    )
    add("--no-contact", action="store_true", help="smooth: let feet on the ground slide")
    add("--no-bones", action="store_true", help="smooth: let bones change their length")
    add("--ignore-unknown", action="store_true", help="leave out points that the model does not know")
    add(
        "--keep-sides",
        action="store_true",
        help="keep left and right as they are where they seem exchanged for some frames",
    )
    add(
        "--keep-spikes",
        action="store_true",
        help="keep points that are far from where they were a frame before and after",
    )
    add("--trc", metavar="O.trc", help="also write the places for OpenSim")
    lift_video.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Lift keypoints, or pass a video on."""
    suffix = Path(args.input).suffix.lower()
    video = suffix not in (".csv", ".txt") and bool(suffix or args.placement)
    if video and not set("%:") & set(args.input) and not Path(args.input).exists():
        raise UserError(f"{args.input}: no such file")
    _require_own(args, video)
    require_outputs(
        (args.output, args.trc, args.overlay),
        (args.input, args.model, args.camera, args.placement, args.corrections, args.background),
    )
    if video:
        return lift_video.run(args)
    _check(args)
    prior = lift_prior.load(args.model, args.quiet)
    keypoints = lift_tracks.read(args.input, prior, args.pixel_sd or PIXEL_SD, args.ignore_unknown, args.quiet)
    pixel_sd = args.pixel_sd or lift_tracks.noise_of(keypoints, args.quiet)
    mended: dict[str, Any] = {"exchanged": 0, "put_back": [], "jumps": 0, "left_out": []}
    view = lift_tracks.view(keypoints, args.camera, args.orthographic, args.metres_per_unit, args.quiet)
    options = _options(args, pixel_sd)
    if not args.keep_sides:
        keypoints, sides = lift_tracks.with_sides(
            args.input, prior, keypoints, view, options, args.quiet, " (--keep-sides)"
        )
        mended |= sides
    if not args.keep_spikes:
        keypoints, left_out = lift_tracks.without_spikes(keypoints, pixel_sd, args.quiet, " (--keep-spikes)")
        mended |= left_out
    names = motion.output_names(prior, keypoints, args.all_markers)
    found = lift_tracks.lift(args.input, prior, keypoints, view, options, names, args.quiet)
    _require_person(args, found)
    if not args.quiet:
        camera, jumps = bool(args.camera), int(mended["jumps"])
        for words in lift_doubts.of(found, keypoints, options, prior.stature, camera, jumps):
            print(words, file=sys.stderr)
    write_lifted(args.output, keypoints.frame, keypoints.time, names, found.places, found.sd)
    if args.trc:
        write_trc(args.trc, names, keypoints.time, found.places, _rate(keypoints))
    summary = _summary(args, keypoints, found) | mended | {"pixel_sd": pixel_sd}
    print(json.dumps(summary) if args.json else _text(summary))
    return 0


def _options(args: argparse.Namespace, pixel_sd: float) -> motion.Options:
    return motion.Options(
        args.method or motion.METHODS[0],
        args.height,
        pixel_sd,
        args.floor_sd or FLOOR_SD,
        not args.no_contact,
        not args.no_bones,
    )


def _require_own(args: argparse.Namespace, video: bool) -> None:
    """Refuse options of a video for keypoints and of keypoints for a video, which would do nothing."""
    kind, other = ("is a video", "keypoints") if video else ("holds keypoints", "a video")
    for option in _ONLY_TRACKS if video else _ONLY_VIDEO:
        value = getattr(args, option)
        if value is not None and value is not False:
            raise UsageError(f"--{option.replace('_', '-')} is for {other}, and {args.input} {kind}")


def _require_person(args: argparse.Namespace, found: motion.Motion) -> None:
    """Refuse an estimate that no person can be."""
    if not np.isfinite(found.error).any():
        raise UserError(f"{args.input}: the estimate lies behind the camera; check the camera and the names")
    low, high = STATURE
    if not low <= found.stature <= high:
        view = "the camera (metres; R, t: world to camera)" if args.camera else "the direction of view"
        raise UserError(
            f"{args.input}: the person came out {found.stature:.3g} m tall; check {view} and the names"
        )


def _check(args: argparse.Namespace) -> None:
    """Refuse options that do not go together."""
    smooth = args.method in (None, "smooth")
    if args.camera and args.orthographic:
        raise UsageError("--camera and --orthographic are two views; give one of them")
    if args.metres_per_unit and not args.orthographic:
        raise UsageError("--metres-per-unit goes with --orthographic")
    if not smooth and (args.no_contact or args.no_bones):
        raise UsageError("--no-contact and --no-bones go with --method smooth")
    if args.floor_sd and not (smooth and args.camera):
        raise UsageError("--floor-sd goes with --camera and --method smooth")


def _rate(keypoints: Keypoints) -> float:
    """Frames per second."""
    return float((len(keypoints.time) - 1) / (keypoints.time[-1] - keypoints.time[0])) if len(keypoints.time) > 1 else 1.0


def _summary(args: argparse.Namespace, keypoints: Keypoints, found: motion.Motion) -> dict[str, Any]:
    """Figures of ``--json``."""
    return {
        "frames": len(keypoints.frame),
        "method": args.method or motion.METHODS[0],
        "markers": {"seen": list(keypoints.names), "estimated": list(found.names)},
        "seen_share": float(keypoints.seen.mean()),
        "reprojection_px": float(np.nanmedian(found.error)),
        "sd_mm": 1000 * float(np.median(found.sd)),
        "stature_m": found.stature if found.steps else None,  # segments alone keep what was believed
        "iterations": found.steps,
        "settled": found.settled,
        "log10_volume_ratio": found.log_volume_ratio,
        "segments": _segments(found.uncertain, found.names),
        "misfit": found.chi2_per_observation if np.isfinite(found.chi2_per_observation) else None,
        "prior_widened": found.wider,
        "segments_alone": found.alone,
        "doubted": 0 if found.outliers is None else int(found.outliers.sum()),
        "resized": found.resized,
    }


def _segments(left: Uncertain, names: tuple[str, ...]) -> dict[str, Any]:
    """Medians over segments, each alone: volume, the displacements least certain and what they move most."""
    most = np.argsort(-left.shares, axis=1, kind="stable")[:, :MOVED]
    figures = {
        "sd_mm": (1000 * left.sd).tolist(),
        "in_depth": left.along.tolist(),
        "rigid": left.rigid.tolist(),
        "joints": [[names[j] for j in row] for row in most],
    }
    each = [dict(zip(figures, values, strict=True)) for values in zip(*figures.values(), strict=True)]
    return {"log10_volume_ratio": left.log10_volume, "least_certain": each}


def _text(s: dict[str, Any]) -> str:
    markers = s["markers"]
    lines = [
        f"{s['frames']} frames, {len(markers['seen'])} points seen in {s['seen_share']:.0%} of them, "
        f"{len(markers['estimated'])} estimated",
        f"{s['reprojection_px']:.2f} px from what was seen, median sd {s['sd_mm']:.0f} mm"
        + (f", stature {s['stature_m']:.2f} m" if s["stature_m"] else ""),
    ]
    if s["iterations"]:
        lines.append(
            f"{s['iterations']} iterations; posterior volume 1e{s['log10_volume_ratio']:.0f} of the prior's"
        )
    return "\n".join([*lines, _left(s["segments"])])


def _left(segments: dict[str, Any]) -> str:
    """Say what segments leave uncertain."""
    modes = segments["least_certain"]
    sd = ", ".join(f"{mode['sd_mm']:.0f}" for mode in modes)
    depth = ", ".join(f"{100 * mode['in_depth']:.0f}" for mode in modes)
    volume = segments["log10_volume_ratio"]
    moved = ["the whole body" if mode["rigid"] > WHOLE else " ".join(mode["joints"]) for mode in modes]
    words = (
        f"a segment alone: volume 1e{volume:.0f} of the prior's, least certain {sd} mm ({depth} % in depth; "
        f"of {'; of '.join(moved)})"
    )
    untold = modes[0]["sd_mm"] > UNTOLD_MM
    return words + "; the first is how far away the person is, which the view does not tell" * bool(untold)
