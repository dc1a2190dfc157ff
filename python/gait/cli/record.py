"""Record the estimates of gait-trackd from LCM into a track file.

Ends after --frames estimates, after --until-idle seconds without any, at the end of a log, when another
stream begins (its frame numbers restart), or when interrupted (Ctrl-C, SIGTERM, SIGHUP); the file is complete
in every case.  It also ends, as a failure, when two trackers use one URL.

The figures are: frames written; frames dropped by the tracker; estimates lost in transit; the duration of a
step; the latency from capture to arrival.

To record everything, including frames, use lcm-logger (in the same environment): lcm-logger -l URL FILE.log;
replay it with gait-trackd --url file://FILE.log?speed=0.
"""

from __future__ import annotations

import argparse
import json
import signal
from typing import Any

from gait.cli import values
from gait.io.files import require_outputs
from gait.lcm.link import is_log, lcm_url, log_of
from gait.progress import note
from gait.signals import ending_signals

EXAMPLES = """\
examples:
  gait record -o track.csv --log estimates.log --until-idle 5
  gait record -o track.csv --url file:///data/estimates.log?speed=0
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    add = parser.add_argument
    add("-o", "--output", required=True, type=values.named(".csv"), metavar="OUT.csv", help="the track")
    values.add_url(parser)
    add("--frames", type=values.whole(1), metavar="N", help="end after N estimates")
    add("--until-idle", type=values.seconds, metavar="S", help="end after S seconds without an estimate")
    add("--patience", type=values.seconds, metavar="S", help="fail if there is no estimate within S seconds")
    add(
        "--person",
        type=values.whole(*values.PERSON),
        metavar="N",
        help="of several people, the one with this number",
    )
    add("--lagged", action="store_true", help="record the lagged estimate of each frame (gait-trackd --lag)")
    add(
        "--log",
        type=values.named(".log", ".lcm"),
        metavar="E.log",
        help="also write the messages to an LCM log, for gait report",
    )


def run(args: argparse.Namespace) -> int:
    """Record the estimates and print the figures."""
    from gait.lcm.record import ESTIMATE, LAGGED, LISTENING, Recorder

    url = lcm_url(args.url)
    require_outputs((args.output, args.log), (log_of(url)[0] if is_log(url) else None,))
    recorder = Recorder(url, args.output, args.log, LAGGED if args.lagged else ESTIMATE, args.person)

    def stop(number: int, frame: Any) -> None:
        recorder.stop = True

    before = {number: signal.signal(number, stop) for number in ending_signals()}
    try:
        note(f"{LISTENING} on {url}", args.quiet)
        recorder.run(args.frames, args.until_idle, args.patience)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if recorder.other:
        note(f"gait record: ended, as {recorder.other}; record it into another file", args.quiet)
    figures = recorder.summary()
    if recorder.damage:
        note(f"gait record: messages skipped: {figures['damaged']}, first: {recorder.damage}", args.quiet)
    print(json.dumps(figures) if args.json else text(figures))
    return 0


def text(figures: dict[str, Any]) -> str:
    """Format the figures for people."""
    lines = [
        f"{figures['frames']} frames, {figures['dropped']} dropped by the tracker, "
        f"{figures['lost']} estimates lost in transit",
        _times("step", figures["step_ms"]),
    ]
    if figures["latency_ms"]:
        lines.append(_times("latency", figures["latency_ms"]))
    if figures["fps"]:
        lines.append(f"{figures['fps']:.2f} estimates per second")
    return "\n".join([*lines, f"model {figures['model_digest']}, digest {figures['digest']}"])


def _times(what: str, values: dict[str, float]) -> str:
    return f"{what} ms: median {values['median']:.2f}, p99 {values['p99']:.2f}, max {values['max']:.2f}"
