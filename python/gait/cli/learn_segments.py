"""Options of gait learn for the prior over segments."""

from __future__ import annotations

import argparse

from gait.cli import values
from gait.errors import UsageError
from gait.learn import segment_options
from gait.learn.segment_options import Segments

FRAMES, FPS, MODES, MIXTURE = (4, 60), (5, 240), (1, 120), (1, 16)  # what can be asked for
AUTO = "auto"
_WHAT = ("frames", "hop", "fps", "modes", "headings", "mixture", "markers")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    usual = Segments()
    add = parser.add_argument
    add(
        "--segments",
        choices=segment_options.SOURCES,
        default=usual.source,
        help="of what the prior over short segments is learnt, which gait lift uses. learnt (default): "
        "the recordings of the cyclic model; all: whole recordings, also those that it refuses; none: no "
        "prior; only: as all, but without a cyclic model, so that gait track cannot use the file",
    )
    add(
        "--segment-frames",
        type=values.whole(*FRAMES),
        metavar="F",
        help=f"frames of a segment (default: {usual.frames})",
    )
    add(
        "--segment-hop",
        type=values.whole(1, FRAMES[1]),
        metavar="H",
        help="frames from one segment to the next (default: half of F)",
    )
    add(
        "--segment-fps",
        type=values.whole(*FPS),
        metavar="R",
        help=f"frames of a segment per second (default: {usual.fps:g})",
    )
    add(
        "--segment-modes",
        type=values.whole(*MODES),
        metavar="K",
        help=f"modes kept, at most a quarter of the segments (default: {usual.modes})",
    )
    add(
        "--segment-headings",
        choices=list(segment_options.TURNS),
        help="free (default): gait lift finds the heading. 2: every segment also turned by 90 degrees, "
        "as in the paper; 8: by each of 45; people's headings in the world are then part of the prior",
    )
    add(
        "--segment-mixture",
        type=_components,
        metavar="auto|K",
        help=f"Gaussians in the prior (default: {usual.mixture}); auto: as many as describe people left out "
        "best",
    )
    add(
        "--segment-markers",
        choices=segment_options.MARKERS,
        help="virtual (default): 37 of the default skeleton; recorded: those that most of the files hold "
        "(.c3d, .trc)",
    )


def _components(text: str) -> int | str:
    return AUTO if text == AUTO else values.whole(*MIXTURE)(text)


def options(args: argparse.Namespace) -> Segments:
    """Options as the learner takes them."""
    given = {name: getattr(args, f"segment_{name}") for name in _WHAT}
    given = {name: value for name, value in given.items() if value is not None}
    if args.segments == "none" and given:
        raise UsageError(f"--segment-{next(iter(given))} says what a segment is; not with --segments none")
    frames = given.get("frames", Segments.frames)
    hop = given.setdefault("hop", max(1, frames // 2))
    if hop > frames:
        raise UsageError(f"--segment-hop {hop}: at most the {frames} of --segment-frames")
    if "headings" in given:
        given["headings"] = segment_options.TURNS[given["headings"]]
    if given.get("mixture") == AUTO:
        given["mixture"] = None
    return Segments(source=args.segments, people=args.prior == "people", **given)
