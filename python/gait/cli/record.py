"""Record the estimates of gait-trackd from LCM into a track file.

Ends after --frames estimates, when none has come for --until-idle seconds, at the end of a log, when another
stream begins (the numbers of its frames start again), or with an interrupt (Ctrl-C, SIGTERM); the file is
complete in every case.  Two trackers on one URL end it too, as a failure.

Figures: frames written; frames the tracker dropped; estimates lost on the way here; the time of a step; the
latency from capture to arrival here.

To record everything, frames included, use lcm-logger (in the same environment): lcm-logger -l URL FILE.log;
play it with gait-trackd --url file://FILE.log?speed=0.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
from typing import Any

from gait.cli import values
from gait.io.files import require_outputs
from gait.lcm.link import is_log, lcm_url, log_of
from gait.lcm.record import ESTIMATE, LAGGED, Recorder

LISTENING = "listening"
"""First word on stderr once every estimate from now on will be recorded."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("-o", "--output", required=True, metavar="OUT.csv", help="the track")
    parser.add_argument("--url", metavar="URL", help="LCM (LCM_DEFAULT_URL or multicast on this machine)")
    parser.add_argument("--frames", type=values.whole(1), metavar="N", help="end after N estimates")
    parser.add_argument(
        "--until-idle", type=values.seconds, metavar="S", help="end when none has come for S seconds"
    )
    parser.add_argument(
        "--patience", type=values.seconds, metavar="S", help="fail if none has come at all after S seconds"
    )
    parser.add_argument(
        "--lagged", action="store_true", help="each frame as it looked some frames later (gait-trackd --lag)"
    )
    parser.add_argument(
        "--log", metavar="E.log", help="also write the messages to an LCM log, for gait report"
    )


def run(args: argparse.Namespace) -> int:
    """Record and report."""
    url = lcm_url(args.url)
    require_outputs((args.output, args.log), (log_of(url)[0] if is_log(url) else None,))
    recorder = Recorder(url, args.output, args.log, LAGGED if args.lagged else ESTIMATE)

    def stop(number: int, frame: Any) -> None:
        recorder.stop = True

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    if not args.quiet:
        print(f"{LISTENING} on {url}", file=sys.stderr, flush=True)
    recorder.run(args.frames, args.until_idle, args.patience)
    if recorder.other and not args.quiet:
        print(f"gait record: ended, as {recorder.other}; record it into another file", file=sys.stderr)
    figures = recorder.summary()
    if recorder.damage and not args.quiet:
        print(
            f"gait record: messages left out: {figures['damaged']}, first: {recorder.damage}", file=sys.stderr
        )
    print(json.dumps(figures) if args.json else text(figures))
    return 0


def text(figures: dict[str, Any]) -> str:
    """Lay the figures out for people."""
    lines = [
        f"{figures['frames']} frames, {figures['dropped']} dropped by the tracker, "
        f"{figures['lost']} estimates lost on the way",
        _times("step", figures["step_ms"]),
    ]
    if figures["latency_ms"]:
        lines.append(_times("latency", figures["latency_ms"]))
    if figures["fps"]:
        lines.append(f"{figures['fps']:.2f} estimates per second")
    return "\n".join([*lines, f"model {figures['model_digest']}, digest {figures['digest']}"])


def _times(what: str, values: dict[str, float]) -> str:
    return f"{what} ms: median {values['median']:.2f}, p99 {values['p99']:.2f}, max {values['max']:.2f}"
