"""Show how a stream was tracked: an overlay video, and an HTML page with figures and plots.

Reads the log that gait record --log wrote beside the track (or one of lcm-logger), and the clip.  With
--truth the errors of gait eval are printed as well.  The page is one file that needs nothing else.
"""

from __future__ import annotations

import argparse
import json

from gait.cli import values
from gait.errors import UserError
from gait.io.files import require_outputs
from gait.lcm.link import break_of

EXAMPLES = """\
examples:
  gait report estimates.log --track track.csv --video walk.mp4 --camera camera.json -o report.html \\
      --overlay overlay.mp4
  gait report all.log --track track.csv --video walk.mp4 --camera camera.json -o report.html --replayed
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("log", metavar="E.log", help="estimates, from gait record --log or lcm-logger")
    parser.add_argument("--track", required=True, metavar="OUT.csv", help="the track, from gait record")
    parser.add_argument("--video", required=True, metavar="VIDEO", help="the clip that was tracked")
    values.add_camera(parser, required=True)
    parser.add_argument("-o", "--output", required=True, metavar="R.html", help="the page")
    parser.add_argument("--overlay", metavar="O.mp4", help="also draw the estimates into the video")
    parser.add_argument("--truth", metavar="TRUTH.csv", help="true motion, to report errors against")
    values.add_model(parser, "model that was tracked")
    parser.add_argument("--replayed", action="store_true", help="not tracked live: show no latency")


def run(args: argparse.Namespace) -> int:
    """Draw, write, print."""
    from gait.lcm.report import write_report
    from gait.motion.evaluate import as_text

    require_outputs(
        (args.output, args.overlay), (args.log, args.track, args.video, args.camera, args.truth, args.model)
    )
    measures = write_report(
        args.log,
        args.track,
        args.video,
        args.camera,
        args.output,
        overlay=args.overlay,
        truth=args.truth,
        model=args.model,
        live=not args.replayed,
        quiet=args.quiet,
    )
    if measures is not None:
        print(json.dumps(measures) if args.json else as_text(measures))
    damage = break_of(args.log)
    if damage:
        raise UserError(f"{args.log}: {damage}; {args.output} shows what came before")
    return 0
