"""The prior over segments as gait learn makes it: beside a cyclic model, or alone."""

from __future__ import annotations

import argparse
import json
import sys

from gait.cli import segment_text
from gait.bindings.segment_prior import SegmentPrior
from gait.errors import UserError
from gait.io import blob
from gait.learn.prior import model
from gait.learn.segment_options import Segments
from gait.learn.segments import segment_fit, segment_sections
from gait.learn.segments.segment_corpus import Corpus


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
    names = [model.shortened(r.name) for r in recordings[: model.MOST_ROWS]]
    sources = [r.source for r in recordings]
    meta = model.meta_section(model.origin(args.activity, args.seed, sources) | {"recordings": names})
    data = blob.write(args.output, {"META": meta, **segment_sections.sections(prior)})
    figures, size, crc = segment_text.summary(prior), len(data), f"{blob.checksum(data):08x}"
    if args.json:
        print(json.dumps({"bytes": size, "crc32": crc, "left_out": refused, "segments": figures}))
    else:
        print(f"{segment_text.text(figures)}\n{args.output}: {size} bytes, checksum {crc}")
    return 0
