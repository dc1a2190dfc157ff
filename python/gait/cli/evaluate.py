"""Compare a track, or lifted motion, with the truth.

Prints, over the frames in both files, with an explanation of each line:
  the 3-D error of 15 joints in mm, unaligned and after aligning the hip midpoints (the pose);
  the share of frames that are far off or lost;
  the phase error, with swaps of left and right counted separately, within gait cycles (a person who stands
  has no phase);
  the distance in the picture;
  how often the 50 % and 90 % intervals contain the truth;
  the pose error of two baselines without images: the mean pose at the true position, and the mean stride
  continued from the true start.

The true phase is the column phase of the truth, if it has one, or else rises evenly between heel strikes.
These come from meta.json beside the truth (meta_2.json beside truth_2.csv), or else from the truth, where a
heel is furthest in front of the pelvis.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

from gait.cli import values
from gait.errors import UserError
from gait.progress import note

if TYPE_CHECKING:
    from gait.io.track_file import Joints

MOST_TIME_DRIFT_S = 0.1  # seconds by which the times of paired frames may drift apart

EXAMPLES = """\
examples:
  gait eval track.csv --truth walk/truth.csv
  gait eval lifted.csv --truth walk/truth.csv --camera walk/camera.json --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("track", metavar="OUT.csv", help="output of gait track or gait lift")
    parser.add_argument("--truth", required=True, metavar="TRUTH.csv", help="frame, time and <joint>_x _y _z")
    values.add_camera(parser, ", for the error in pixels (default: camera.json beside the truth)")
    values.add_model(parser, "model of the baselines")


def run(args: argparse.Namespace) -> int:
    """Read the files, compare them, and print the errors."""
    from gait.bindings.model import read_cyclic
    from gait.camera.camera import Camera
    from gait.io.track_file import read_estimates, read_true_phase, read_truth
    from gait.motion.evaluate import evaluate
    from gait.motion.footfalls import meta_of, strikes_of
    from gait.report.error_table import OTHER_WORLD, as_text

    if os.path.realpath(args.track) == os.path.realpath(args.truth):
        raise UserError(f"{args.track}: is given as the track and as its truth; give two files")
    truth = read_truth(args.truth)
    beside = Path(args.truth).parent
    moves = (beside / "poses.csv").is_file()  # there is no single camera for all frames
    there = (beside / "camera.json").is_file() and not moves
    camera = args.camera or (beside / "camera.json" if there else None)
    track = read_estimates(args.track)
    apart = _drift(track, truth)
    if apart > MOST_TIME_DRIFT_S:
        note(
            f"{args.track}: frames are paired by number, but their times run apart by {apart:.2f} s: number "
            "them as the truth does",
            args.quiet,
        )
    if track.camera_change is not None:
        note(f"{args.track}: {OTHER_WORLD}", args.quiet)
    measures = evaluate(
        track,
        truth,
        strikes=strikes_of(truth, meta_of(args.truth)),
        model=read_cyclic(args.model),
        camera=Camera.read(str(camera)) if camera else None,
        phase=read_true_phase(args.truth),
    )
    print(json.dumps(measures) if args.json else as_text(measures))
    return 0


def _drift(track: Joints, truth: Joints) -> float:
    """Drift in seconds between the times of frames with the same numbers; a constant offset is ignored."""
    import numpy as np

    _, ours, theirs = np.intersect1d(track.frame, truth.frame, return_indices=True)
    return float(np.ptp(track.time[ours] - truth.time[theirs])) if ours.size else 0.0
