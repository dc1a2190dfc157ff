"""Track a clip as in the field: capture, tracker and recorder are separate processes that talk over LCM.

gait capture streams the clip at its true frame rate, gait-trackd tracks it, and gait record collects the
estimates.  Writes track.csv, estimates.log, overlay.mp4 and report.html; prints the error against the truth
(if known), the frame rate, the latency from capture to the received estimate, and the number of dropped
frames.

Without --video a clip of a walking person is rendered, with ground truth.  With it, camera.json, init.json,
background.png and truth.csv beside the video are used unless given.  If this machine has no multicast route,
the same processes run one after the other through an LCM log file, without measuring latency.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

from gait.cli import values
from gait.cli.record import text as recording_text

_ROOT = Path(__file__).resolve().parents[3]
_TRACKD = _ROOT / "build" / "bin" / "gait-trackd"
_MODEL = _ROOT / "python" / "gait" / "data" / "walk.gait"

EXAMPLES = """\
examples:
  gait demo
  gait demo --video walk.mp4 --camera camera.json --height 1.75 -o results
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("--video", metavar="VIDEO", help="the clip (default: a rendered one)")
    values.add_camera(parser)
    parser.add_argument("--truth", metavar="TRUTH.csv", help="true motion, to report errors against")
    values.add_clip(parser, "send")
    parser.set_defaults(init=None, background=None)  # those beside the video, or else auto
    values.add_filter(parser, _threads())
    parser.add_argument(
        "-m",
        "--model",
        default=str(_MODEL),
        metavar="M.gait",
        help="walking model: a file, or a model of the package: walk (default), paper or classes",
    )
    parser.add_argument(
        "--trackd",
        default=str(_TRACKD),
        metavar="PROGRAM",
        help="gait-trackd (default: the one in build/bin)",
    )
    parser.add_argument(
        "-o",
        "--output",
        default="build/demo",
        metavar="DIR",
        help="folder for the results (default: build/demo)",
    )


def _threads() -> int:
    """Return the default number of threads: all cores but one, which decodes the clip, up to four."""
    return max(1, min(4, (os.cpu_count() or 1) - 1))


def run(args: argparse.Namespace) -> int:
    """Run the demo and print its figures."""
    from gait.lcm.demo import RESULTS, Demo
    from gait.report.error_table import as_text

    given = {name: getattr(args, name) for name in Demo.__dataclass_fields__} | {"output": Path(args.output)}
    recording, measures = Demo(**given).run()
    if args.json:
        print(json.dumps({"recording": recording, "error": measures}))
        return 0
    if measures is not None:
        print(f"error against the truth\n{as_text(measures)}\n")
    print(recording_text(recording))
    print(" ".join(os.path.join(args.output, name) for name in RESULTS))
    return 0
