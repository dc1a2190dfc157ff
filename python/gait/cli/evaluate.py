"""Compare a track, or lifted motion, with the truth.

Prints, over the frames that both have: the 3-D error of 15 joints in mm, as they are (abs) and with
the hip midpoints laid on each other (root); the share of frames far off or lost; the error of the phase,
half-cycle flips counted apart; the distance in the picture; how often the 50 % and 90 % intervals hold
the truth; and the same for two baselines that look at no image: the mean pose at the true place
(static) and the mean cycle running free from the true start (free).

Heel strikes come from meta.json beside the truth, else from the truth itself: where a heel is furthest
ahead of the pelvis.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from gait.bindings.model import read_cyclic
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.track_file import Joints, read_estimates, read_truth
from gait.motion.evaluate import LOST_MM, Measures, evaluate
from gait.motion.footfalls import strikes_of

DRIFT = 0.1  # seconds by which times of paired frames may run apart

MEANING = (
    "abs: 15 joints as they stand; root: hip midpoints laid on each other; static: the mean pose, given the "
    "true place and heading of every frame, so compare its root, not its abs; free: the mean cycle, given "
    "the true first state; root12: as root, of the 12 joints that 2-D pose networks have; proc: after the "
    "best rotation, scale and shift of each frame, to compare with literature only"
)
"""One line for readers of the table."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("track", metavar="OUT.csv", help="what gait track or gait lift wrote")
    parser.add_argument("--truth", required=True, metavar="TRUTH.csv", help="frame, time and <joint>_x _y _z")
    parser.add_argument(
        "--camera", metavar="CAM", help="for the error in pixels (camera.json beside the truth)"
    )
    parser.add_argument("-m", "--model", metavar="M.gait", help="for the baselines (the shipped model)")


def run(args: argparse.Namespace) -> int:
    """Read, compare, print."""
    if os.path.realpath(args.track) == os.path.realpath(args.truth):
        raise UserError(f"{args.track}: is given as the track and as its truth; give two files")
    truth = read_truth(args.truth)
    beside = Path(args.truth).parent
    camera = args.camera or (beside / "camera.json" if (beside / "camera.json").is_file() else None)
    track = read_estimates(args.track)
    apart = _drift(track, truth)
    if apart > DRIFT and not args.quiet:
        print(
            f"{args.track}: frames are paired by number, but their times run apart by {apart:.2f} s: number "
            "them as the truth does",
            file=sys.stderr,
        )
    measures = evaluate(
        track,
        truth,
        strikes=strikes_of(truth, beside / "meta.json"),
        model=read_cyclic(args.model),
        camera=Camera.read(str(camera)) if camera else None,
    )
    print(json.dumps(measures) if args.json else text(measures))
    return 0


def _drift(track: Joints, truth: Joints) -> float:
    """Seconds by which the times of frames of the same numbers run apart, whatever both count from."""
    _, ours, theirs = np.intersect1d(track.frame, truth.frame, return_indices=True)
    return float(np.ptp(track.time[ours] - truth.time[theirs])) if ours.size else 0.0


def text(m: Measures) -> str:
    """Lay the measures out for people."""
    lines = [f"{'':14}{'median':>9}{'mean':>9}{'p90':>9}"]
    for label, part in (("", m), ("static ", m["static"]), ("free ", m["free"])):
        if part is not None:
            lines += [_row(f"{label}{key} mm", part[key], ".1f") for key in ("abs", "root")]
    if m["px"] is not None:
        lines.append(_row("px", m["px"], ".2f"))
    if m["phase"] is not None:
        lines.append(_row("phase cycles", m["phase"], ".4f"))
        lines.append(f"phase bias {m['phase']['bias']:+.4f}, flipped {m['phase']['flips']:.1%} of the frames")
    lines += [_row(f"{key} mm", m[key], ".1f") for key in ("root12", "proc")]
    covered = ", ".join(f"{share:.0%} in the {level} % intervals" for level, share in m["coverage"].items())
    honest = m["calibration"]
    lines.append(f"coverage: {covered}; width of the 90 % intervals {honest['width_mm']:.0f} mm")
    lines.append(
        f"squared error in variances {honest['z2']:.2f} (1 is right), score {honest['crps_mm']:.1f} mm (CRPS)"
    )
    lines.append(
        "status: " + ", ".join(f"{word} {share:.1%}" for word, share in m["status"].items() if share)
    )
    lines.append(
        f"far off (root over {LOST_MM:.0f} mm) or lost: {m['lost']:.1%} of {m['frames']} frames; "
        f"far off while it says tracking: {m['trust']['wrong_tracking']:.1%}"
    )
    return "\n".join([*lines, MEANING])


def _row(label: str, values: dict[str, Any], form: str) -> str:
    return f"{label:14}" + "".join(f"{values[key]:>9{form}}" for key in ("median", "mean", "p90"))
