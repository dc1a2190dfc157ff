"""Options of gait learn for the prior over segments, and what is said of it."""

from __future__ import annotations

import argparse
import json
import sys

from gait import blob
from gait.cli import segment_text, values
from gait.errors import UsageError, UserError
from gait.learn import model, segment_fit, segment_options, segment_sections
from gait.learn.segment_corpus import Corpus
from gait.learn.segment_options import Segments
from gait.lift.prior import SegmentPrior

FRAMES, FPS, MODES, MIXTURE = (2, 60), (5, 240), (1, 120), (1, 16)  # what can be asked for


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    usual = Segments()
    parser.add_argument(
        "--segments",
        choices=segment_options.SOURCES,
        default=usual.source,
        help="of what the prior over short segments is learnt, which gait lift uses. learnt (the default): "
        "the recordings of the cyclic model; all: whole recordings, also those that it refuses; none: no "
        "prior; only: as all, but without a cyclic model, so that gait track cannot use the file",
    )
    add = parser.add_argument
    add(
        "--segment-frames", type=values.whole(*FRAMES), default=usual.frames, metavar="F", help="of each (10)"
    )
    add("--segment-hop", type=values.whole(1, FRAMES[1]), metavar="H", help="frames between them (half of F)")
    add(
        "--segment-fps",
        type=values.whole(*FPS),
        default=round(usual.fps),
        metavar="R",
        help="per second (20)",
    )
    add(
        "--segment-modes",
        type=values.whole(*MODES),
        default=usual.modes,
        metavar="K",
        help="at most (50, a quarter of the segments)",
    )
    add(
        "--segment-headings",
        choices=list(segment_options.TURNS),
        default=segment_options.FREE,
        help="free (the default): gait lift finds the heading. 2: every segment also turned by 90 degrees, "
        "as in the paper; 8: by each of 45; people's headings in the world are then part of the prior",
    )
    add(
        "--segment-mixture",
        type=_components,
        default=usual.mixture,
        metavar="auto|K",
        help="Gaussians in the prior (1); auto: as many as describe people left out best",
    )
    add(
        "--segment-markers",
        choices=segment_options.MARKERS,
        default=usual.markers,
        help="virtual (the default): 37 of the default skeleton; recorded: those that most of the files hold "
        "(.c3d, .trc)",
    )


def _components(text: str) -> int | None:
    return None if text == "auto" else values.whole(*MIXTURE)(text)


def options(args: argparse.Namespace) -> Segments:
    """Options as the learner takes them."""
    hop = args.segment_hop or max(1, args.segment_frames // 2)
    if hop > args.segment_frames:
        raise UsageError(f"--segment-hop {hop}: at most the {args.segment_frames} of --segment-frames")
    return Segments(
        source=args.segments,
        frames=args.segment_frames,
        hop=hop,
        fps=float(args.segment_fps),
        modes=args.segment_modes,
        headings=segment_options.TURNS[args.segment_headings],
        mixture=args.segment_mixture,
        markers=args.segment_markers,
        people=args.prior == "people",
    )


def learn(corpus: Corpus, wanted: Segments, quiet: bool) -> SegmentPrior | None:
    """Learn the prior beside a cyclic model; if there is none, say why instead of failing."""
    if wanted.source == "none":
        return None
    try:
        return segment_fit.fit(corpus.recordings(), wanted)
    except UserError as error:
        if not quiet:
            print(f"no prior over segments: {error}", file=sys.stderr)
        return None


def write_alone(args: argparse.Namespace, corpus: Corpus, wanted: Segments, refused: list[str]) -> int:
    """Learn and write a blob that holds the prior alone, and say what it is."""
    recordings = corpus.recordings()
    prior = segment_fit.fit(recordings, wanted)
    names = [r.name for r in recordings]
    sources = [r.source for r in recordings]
    meta = model.meta_section(model.origin(args.activity, args.seed, sources) | {"recordings": names})
    data = blob.write(args.output, {"META": meta, **segment_sections.sections(prior)})
    figures, size, crc = segment_text.summary(prior), len(data), f"{blob.checksum(data):08x}"
    if args.json:
        print(json.dumps({"bytes": size, "crc32": crc, "left_out": refused, "segments": figures}))
    else:
        print(f"{segment_text.text(figures)}\n{args.output}: {size} bytes, checksum {crc}")
    return 0
