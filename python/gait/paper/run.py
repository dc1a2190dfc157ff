"""One run of `gait paper`: read, learn, track, lift, write the page."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gait.errors import UserError
from gait.io.files import replacing, require_writable
from gait.learn.corpus import sources
from gait.learn.corpus.forkserver import cores
from gait.learn.prior import model
from gait.paper import (
    clip,
    entry,
    ladder,
    leventon,
    leventon_figures,
    lifting,
    ormoneit,
    ormoneit_figures,
    recordings,
    scene,
    tracking,
)
from gait.paper.clip import Clip
from gait.paper.entry import Entry, Paper
from gait.progress import progress
from gait.reproducible import one_thread
from gait.simulate.scenario import PRESETS

ORMONEIT = "Ormoneit and others 2000", "Learning and tracking human motion using functional analysis"
LEVENTON = "Leventon and Freeman 1998", "Bayesian estimation of 3-D human motion from an image sequence"


@dataclass(frozen=True)
class Request:
    """What to make the page from."""

    mocap: tuple[str, ...]
    output: str
    clip: Clip | None = None  #: of figures 6 and 7; None: one is rendered
    quiet: bool = False


def run(request: Request) -> dict[str, Any]:
    """Make the page; return its statements by paper and heading.

    UserError with one line if it cannot be done.
    """
    require_writable(request.output)
    with one_thread(), tempfile.TemporaryDirectory(prefix="gait-") as folder:
        _require(request)
        found = recordings.read(request.mocap, request.quiet)
        used = request.clip or _rendered(Path(folder), request.quiet)
        papers = [
            Paper(*ORMONEIT, _ormoneit(found, used, Path(folder), request.quiet)),
            Paper(*LEVENTON, _leventon(found, used, Path(folder), request.quiet)),
        ]
    text = entry.page("Both papers, figure by figure", _about(found, used), papers)
    with replacing(request.output) as path:
        path.write_text(text, encoding="utf-8")
    return {p.short: {e.heading: e.statements() for e in p.entries} for p in papers}


def _require(request: Request) -> None:
    """Raise UserError with all that is found wrong before the long work."""
    checks: list[Callable[[], object]] = [lambda: sources.find(request.mocap)]
    wrong = list[str]()
    for check in checks + ([] if request.clip is None else tracking.checks(request.clip)):
        try:
            check()
        except UserError as error:
            wrong.append(str(error))
    if wrong:
        raise UserError("; ".join(dict.fromkeys(wrong)))


def _rendered(folder: Path, quiet: bool) -> Clip:
    with progress("rendering a clip", PRESETS[clip.PRESET].frames, quiet) as update:
        return clip.rendered(folder, update)


def _ormoneit(found: recordings.Recordings, used: Clip, folder: Path, quiet: bool) -> list[Entry]:
    with progress("learning both ways", 4, quiet) as update:
        learning = ormoneit.learn(found.walks, update)
    with progress("tracking both ways", 2 * tracking.SEEDS, quiet) as update:
        tracked = tracking.track(used, learning, cores(), update)
    with progress("rendering walks", len(scene.PRESET_VIEWS), quiet) as update:
        scenes = scene.rendered(folder, update)
    with progress("ladder", ladder.steps(len(scenes)), quiet) as update:
        climbed = ladder.climb(scenes, learning, update)
    with progress("drawing", None, quiet):
        figures = ormoneit_figures.entries(learning)
        return [*figures, tracking.entry(tracked), *ladder.entries(climbed)]


def _leventon(found: recordings.Recordings, used: Clip, folder: Path, quiet: bool) -> list[Entry]:
    with progress("leaving motions out", len(found.motions), quiet) as update:
        held = leventon.hold_out(found.motions, update)
    lifted = lifting.lift(used, found.motions, folder, quiet)
    with progress("drawing", None, quiet):
        study = leventon_figures.study(found.motions, held)
        return [*leventon_figures.entries(study), lifting.entry(lifted)]


def _about(found: recordings.Recordings, used: Clip) -> list[str]:
    people = len({walk.subject for walk in found.walks})
    lines = [
        f"Made by gait paper from {len(found.walks)} walks of {people} people (first paper), "
        f"{len(found.motions)} motions (second paper: {', '.join(m.name for m in found.motions)}) and "
        f"{used.name}.",
        "theirs: what the paper reports. literal: the paper's algorithm as printed, with misprints "
        "corrected, on these recordings. ours: the package's default method on the same data.",
    ]
    return lines + ([model.CMU] if model.from_cmu([Path(w.source) for w in found.walks]) else [])
