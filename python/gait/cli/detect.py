"""Find the 2-D joints of people in a video with a landmark network.

Writes the keypoints of one person: the one in view longest and tallest, or --person ID.  The file is what
gait lift takes.  The network's weights are fetched once: gait detect --fetch.

Examples
--------
  gait detect --fetch
  gait detect walk.mp4 -o keypoints.csv
  gait lift keypoints.csv --camera camera.json -o motion.csv
"""

from __future__ import annotations

import argparse
import json
import sys

import numpy as np

from gait.cli import values
from gait.detect import weights
from gait.errors import UsageError, UserError
from gait.io.files import require_outputs
from gait.io.keypoints_file import Keypoints, write
from gait.io.video import Video
from gait.progress import progress

_LEAST_FRAMES = 3  # in which a person must be found


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("video", nargs="?", metavar="VIDEO", help="video file")
    parser.add_argument("-o", "--output", metavar="KEYPOINTS.csv", help="the keypoints")
    parser.add_argument("--fetch", action="store_true", help="download the weights (38 MB) and check them")
    parser.add_argument(
        "--network", choices=list(weights.LANDMARKS), default="full", help="landmark network (full)"
    )
    parser.add_argument(
        "--person", type=values.whole(1), metavar="ID", help="person to write (in view longest and tallest)"
    )
    parser.add_argument(
        "--people", type=values.whole(1, 8), default=8, metavar="N", help="people followed at a time (8)"
    )


def run(args: argparse.Namespace) -> int:
    """Fetch, or detect and write."""
    if args.fetch:
        folder = weights.fetch(lambda line: args.quiet or print(line, file=sys.stderr))
        print(json.dumps({"folder": str(folder)}) if args.json else f"weights in {folder}")
        if not args.video:
            return 0
    if not args.video or not args.output:
        raise UsageError("give VIDEO and -o KEYPOINTS.csv, or --fetch")
    require_outputs((args.output,), (args.video,))
    from gait.detect.networks import JOINTS
    from gait.detect.people import Followed, PeopleDetector, main_person  # here, as they load OpenCV

    video = Video(args.video)
    detector = PeopleDetector(args.network, args.people)
    times = {}
    with progress("detecting", video.count, args.quiet) as update:
        for frame in video.frames():
            detector.step(frame)
            times[frame.number] = frame.time
            update(frame.number + 1)
    people = [one for one in detector.people if len(one.frames) >= _LEAST_FRAMES]
    if not people:
        raise UserError(
            f"{args.video}: no person found; the whole person should be in view, 80 pixels or taller"
        )
    chosen: Followed | None = main_person(people)
    if args.person is not None:
        chosen = next((one for one in people if one.id == args.person), None)
    if chosen is None:
        ids = " ".join(str(one.id) for one in people)
        raise UserError(f"{args.video}: no person {args.person}; the people found are {ids}")
    frames = np.arange(chosen.frames[0], chosen.frames[-1] + 1)
    uv = np.full((len(frames), len(JOINTS), 2), np.nan)
    confidence = np.zeros(uv.shape[:2])
    rows = np.array(chosen.frames) - frames[0]
    uv[rows] = [person.uv for person in chosen.keypoints]
    confidence[rows] = [person.confidence for person in chosen.keypoints]
    time = np.array([times[int(n)] for n in frames])
    write(args.output, Keypoints(frames, time, tuple(JOINTS), uv, confidence))
    table = [
        {
            "id": p.id,
            "frames": len(p.frames),
            "first": p.frames[0],
            "last": p.frames[-1],
            "px": round(p.height),
        }
        for p in people
    ]
    if args.json:
        print(json.dumps({"person": chosen.id, "people": table}))
    else:
        for row in table:
            mark = "written" if row["id"] == chosen.id else ""
            print("person {id}: {frames} frames from {first} to {last}, {px} pixels tall".format(**row), mark)
    return 0
