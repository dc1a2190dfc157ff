"""One run of `gait paper`: read, learn, track, lift, write the page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gait.io.files import replacing, require_writable
from gait.learn.prior import model
from gait.paper import entry, leventon, leventon_figures, ormoneit, ormoneit_figures, recordings
from gait.paper.entry import Paper
from gait.progress import progress
from gait.reproducible import one_thread

ORMONEIT = "Ormoneit and others 2000", "Learning and tracking human motion using functional analysis"

LEVENTON = "Leventon and Freeman 1998", "Bayesian estimation of 3-D human motion from an image sequence"


@dataclass(frozen=True)
class Request:
    """What to make the page from."""

    mocap: tuple[str, ...]
    output: str
    quiet: bool = False


def run(request: Request) -> dict[str, Any]:
    """Make the page; return verdicts by entry.  UserError with one line if it cannot be done."""
    require_writable(request.output)
    with one_thread():
        found = recordings.read(request.mocap, request.quiet)
        with progress("learning both ways", 4, request.quiet) as update:
            learning = ormoneit.learn(found.walks, update)
        first = list(ormoneit_figures.entries(learning))
        with progress("leaving motions out", len(found.motions), request.quiet) as update:
            held = leventon.hold_out(found.motions, update)
        second = list(leventon_figures.entries(leventon_figures.study(found.motions, held)))
    papers = [Paper(*ORMONEIT, first), Paper(*LEVENTON, second)]
    text = entry.page("Both papers, figure by figure", _about(found), papers)
    with replacing(request.output) as path:
        path.write_text(text, encoding="utf-8")
    return {p.short: {e.heading: e.verdict for e in p.entries} for p in papers}


def _about(found: recordings.Recordings) -> list[str]:
    people = len({walk.subject for walk in found.walks})
    lines = [
        f"Made by gait paper from {len(found.walks)} walks of {people} people (first paper) and "
        f"{len(found.motions)} motions (second paper): {', '.join(m.name for m in found.motions)}.",
        "theirs: what the paper states. literal: its algorithm as printed, errors of print resolved. "
        "ours: what the package does by default, on the same data.",
    ]
    return lines + ([model.CMU] if model.from_cmu([Path(w.source) for w in found.walks]) else [])
