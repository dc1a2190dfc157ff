"""Find the 2-D joints of people in a video with a landmark network.

Writes the keypoints of one person: the one in view longest and tallest, or --person ID.  gait lift reads the
file.  Download the network's weights once: gait detect --fetch.

--lcm detects joints in frames that arrive over LCM (GAIT_IMAGE_<i>), in as many as the machine can process,
and sends them: those of person N on GAIT_TRACKS_<i>_<N> for gait-trackd --people, and those of the person
in view longest, until out of view for a second, on GAIT_TRACKS_<i> for gait-trackd --keypoints-term and
--lift.  Messages without joints are for people not in view.  Numbers are 1 to --people; a person who is out
of view for ten seconds may lose the number to another.  Ctrl-C ends it.
"""

from __future__ import annotations

import argparse
import contextlib
import json
from functools import partial

from gait.cli import values
from gait.detect import weights
from gait.errors import UsageError, UserError
from gait.io.files import require_outputs
from gait.progress import note, progress, warning
from gait.signals import Interruptible

_TURN = 0.1  # seconds that a call waits for a message

EXAMPLES = """\
examples:
  gait detect --fetch
  gait detect walk.mp4 -o keypoints.csv
  gait lift keypoints.csv --camera camera.json -o motion.csv
  gait detect --lcm --network lite
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("video", nargs="?", metavar="VIDEO", help="video file")
    parser.add_argument(
        "-o", "--output", type=values.named(".csv"), metavar="KEYPOINTS.csv", help="the keypoints"
    )
    parser.add_argument("--fetch", action="store_true", help="download the weights (38 MB) and check them")
    parser.add_argument(
        "--network",
        choices=list(weights.LANDMARK_NETWORKS),
        default="full",
        help="landmark network (default: full)",
    )
    parser.add_argument(
        "--person",
        type=values.whole(1),
        metavar="ID",
        help="person to write (default: the one in view longest and tallest)",
    )
    parser.add_argument(
        "--people",
        type=values.whole(1, 8),
        default=8,
        metavar="N",
        help="people followed at a time (default: 8)",
    )
    parser.add_argument("--lcm", action="store_true", help="take frames from LCM and send the joints over it")
    parser.add_argument(
        "--stream", type=values.whole(*values.STREAM), metavar="I", help="number of the camera (default: 0)"
    )
    values.add_url(parser)


def _live(args: argparse.Namespace) -> int:
    """Detect joints in frames that arrive over LCM until the user ends it."""
    from gait.lcm.detect import LiveDetector  # here, as it imports OpenCV and LCM
    from gait.lcm.link import lcm_url

    if args.video or args.output or args.person is not None:
        raise UsageError("--lcm takes no VIDEO, -o or --person; it sends everyone's joints")
    url = lcm_url(args.url)
    detector = LiveDetector(url, args.stream or 0, args.network, args.people)
    note(f"listening on {url}", args.quiet)
    with Interruptible(), contextlib.suppress(KeyboardInterrupt):  # this is how the user ends it
        while True:
            detector.handle(_TURN)
    if detector.damage:
        note(f"gait detect: skipped: {detector.damage}", args.quiet)
    counts = {"frames": detector.frames, "found": detector.found}
    print(json.dumps(counts) if args.json else "{frames} frames, a person in {found}".format(**counts))
    return 0


def run(args: argparse.Namespace) -> int:
    """Download the weights, detect live, or detect in a video and write the keypoints."""
    from gait.io.keypoints_file import write
    from gait.io.video import Video, reporting_damage

    if args.fetch:
        folder = weights.fetch(partial(note, quiet=args.quiet))
        print(json.dumps({"folder": str(folder)}) if args.json else f"weights in {folder}")
        if not args.video:
            return 0
    if args.lcm:
        return _live(args)
    if args.url or args.stream is not None:
        raise UsageError("--url and --stream go with --lcm")
    if not args.video or not args.output:
        raise UsageError("give VIDEO and -o KEYPOINTS.csv, or --fetch")
    require_outputs((args.output,), (args.video,))
    # Imported here, as they import OpenCV.
    from gait.detect.people import detect, height, main_person, require_length, require_person

    video = Video(args.video)
    require_length(video, range(video.count))
    warn = partial(warning, quiet=args.quiet)
    with reporting_damage(video, warn), progress("detecting", video.count, args.quiet) as update:
        people = detect(video, args.network, args.people, update=update)
    require_person(people, video)
    chosen = main_person(people) if args.person is None else args.person
    if chosen not in people:
        ids = " ".join(map(str, people))
        raise UserError(f"{args.video}: no person {chosen}; the people found are {ids}")
    write(args.output, people[chosen])
    table = [
        {"id": n, "first": int(k.frame[0]), "last": int(k.frame[-1]), "px": round(height(k))}
        for n, k in people.items()
    ]
    if args.json:
        print(json.dumps({"person": chosen, "people": table}))
        return 0
    for row in table:
        mark = ", written" if row["id"] == chosen else ""
        print("person {id}: frames {first} to {last}, {px} pixels tall".format(**row) + mark)
    return 0
