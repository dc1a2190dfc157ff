#!/usr/bin/env python3
"""The paper's tracker at its best, and what each later addition buys: frames 0 to 50 from a true start.

    paper_ladder.py [--seeds 10] [--rung-seeds 3] [--record]

The ladder from the paper to the default (gait.paper.ladder) on the development clips, with models learnt
without each clip's subject, and the outdoor clip in paper mode.
"""

from __future__ import annotations

import argparse
import io
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import eval_clips
import matplotlib
import numpy as np
import table
from facts import facts
from paper_runs import Footage

from gait.io.files import replacing
from gait.paper import ladder
from gait.paper.scene import TAIL, Run, reported
from gait.progress import progress

PAPER = Path(__file__).resolve().parents[2] / "python" / "gait" / "data" / "paper.gait"
FOLDER = eval_clips.ROOT / "build" / "eval" / "models"
SHIPPED = {"paper": PAPER, "people": PAPER.with_name("walk.gait")}  # models of the package, by prior
COLUMNS = ("clip", "held", "lost, left", "lost, held", "root mm", "least", "most", "free mm", "px")


def main() -> int:
    """Track, and publish."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=10, help="runs of a clip in paper mode and by default")
    parser.add_argument("--rung-seeds", type=int, default=3, help="runs of a clip on each rung between")
    parser.add_argument("--record", action="store_true", help="publish the tables")
    args = parser.parse_args()
    clips = eval_clips.shared_clips(None)
    with progress("learning", None) as update:
        paths = {p: eval_clips.models(clips, FOLDER, 1, update, p) for p in SHIPPED}
    found = list[Climbed]()
    footage = [Footage(clip) for clip in clips]
    with progress("ladder", len(footage) * len(ladder.RUNGS)) as update:
        for f in footage:
            found.append(climbed(f, paths, args.seeds, args.rung_seeds))
            update(len(found) * len(ladder.RUNGS))
    write = table.publish if args.record else lambda name, *rest, note="": table.show(*rest)
    rows = [paper_row(each) for each in found]
    write("paper_mode", "Paper mode at its best", COLUMNS, rows, note=about(args.seeds, found))
    known = [each for each in found if each.footage.scene is not None]
    median = {name: float(np.median([each.error(name) for each in known])) for name in known[0].names()}
    head = ["rung", "median", "gain", *(each.footage.clip.name for each in known)]
    note = about_ladder(args.seeds, args.rung_seeds)
    rows = [ladder_row(name, median, known) for name in median]
    write("paper_ladder", "From the paper to the default", head, rows, note=note)
    if args.record:
        errors = {name: [each.error(name) for each in known] for name in median}
        draw(median, {name: (min(each), max(each)) for name, each in errors.items()})
    return 0


@dataclass(frozen=True)
class Climbed:
    """Runs on the rungs on a clip, and errors of what needs no image, mm, both by name."""

    footage: Footage
    without: dict[str, float]
    runs: dict[str, list[Run]]

    def names(self) -> list[str]:
        """Return all names, of what needs no image first."""
        return [*self.without, *self.runs]

    def roots(self, name: str) -> list[float]:
        """Return the root-aligned errors, mm, of the seeds."""
        return [run.root for run in self.runs[name]] if name in self.runs else [self.without[name]]

    def error(self, name: str) -> float:
        """Return their median."""
        return float(np.median(self.roots(name)))


def climbed(f: Footage, paths: dict[str, dict[str, Path]], seeds: int, rung_seeds: int) -> Climbed:
    """Track a clip on each rung, with models without its subject; without a truth, in paper mode alone."""
    files = {prior: paths[prior].get(f.clip.subject or "", shipped) for prior, shipped in SHIPPED.items()}
    models = ladder.models({prior: path.read_bytes() for prior, path in files.items()})
    base = {prior: f.baselines(path) for prior, path in files.items()}
    without = {ladder.FREE[prior]: each["free"] for prior, each in base.items()}
    runs = dict[str, list[Run]]()
    for rung in ladder.RUNGS if f.scene is not None else (ladder.PAPER,):
        count = seeds if rung in (ladder.PAPER, ladder.RUNGS[-1]) else rung_seeds
        runs[rung.name] = [
            f.run(models[rung.model], rung.mode, seed, rung.changes) for seed in range(1, count + 1)
        ]
    return Climbed(f, without | {ladder.STATIC: base["people"]["static"]}, runs)


def paper_row(found: Climbed) -> list[Any]:
    """Return the row of a clip in paper mode."""
    runs, root = found.runs[ladder.PAPER.name], np.array(found.roots(ladder.PAPER.name))
    return [
        found.footage.clip.name,
        f"{sum(r.held for r in runs)} of {len(runs)}",
        reported(runs, held=False),
        reported(runs, held=True),
        round(float(np.median(root)), 1),
        round(float(root.min()), 1),
        round(float(root.max()), 1),
        round(found.without[ladder.FREE["paper"]], 1),
        round(float(np.median([r.px for r in runs])), 1),
    ]


def ladder_row(name: str, median: dict[str, float], found: list[Climbed]) -> list[Any]:
    """Return the row of a rung: median of the clips, gain, each clip's median and range over the seeds."""
    gains = {r.name: round(ladder.own_free(median, r) - median[r.name], 1) for r in ladder.RUNGS}
    cells = list[Any]()
    for each in found:
        roots = each.roots(name)
        spread = f" ({min(roots):.0f}-{max(roots):.0f})" if len(roots) > 1 else ""
        cells.append(f"{each.error(name):.1f}{spread}")
    return [name, round(median[name], 1), gains.get(name), *cells]


def draw(errors: dict[str, float], range_of: dict[str, tuple[float, float]]) -> None:
    """Write the plot beside the table."""
    text = io.StringIO()
    figure = ladder.plot(errors, range_of)
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "gait"}):
        figure.savefig(text, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    with replacing(table.RESULTS / "paper_ladder.svg") as path:
        path.write_text("\n".join(line.rstrip() for line in text.getvalue().splitlines()) + "\n")


def about(seeds: int, found: list[Climbed]) -> str:
    """State how the runs were made, and how often a run is reported as lost."""
    runs = [run for each in found for run in each.runs[ladder.PAPER.name]]
    return f"""{facts(f"paper_ladder.py --record --seeds {seeds}")}

Frames 0 to 50 (outdoor: from the first frame in full view), 10,000 particles, models of 19 angles and 5
components without the clip's subject; the start is the truth with noise (pelvis 3 cm, phase 0.03, rate 0.03
per second, heading 0.05 rad), outdoor the clip's own. Settings are those of
[search_paper](search_paper.md); chosen without development clips. Held: in the last {TAIL} frames
the joints are on average within a tenth of the person's height in the picture (outdoor: 0.15, of the clear
marks). Lost: runs that are reported as lost in some frame, of those that leave the person (right) and of
those that hold it (wrong); in all {reported(runs, held=False)} and {reported(runs, held=True)}. root mm:
root-aligned, median over the frames and then over the seeds. free: the mean cycle of the same model running
on from the exact truth, which needs no image."""


def about_ladder(seeds: int, rung_seeds: int) -> str:
    """State how the ladder was made."""
    return f"""{facts(f"paper_ladder.py --record --seeds {seeds} --rung-seeds {rung_seeds}")}

Root-aligned error, mm, of frames 0 to 50 from a true start with noise, median over the frames and then over
the seeds (least to most): {seeds} seeds of the paper and of the default, {rung_seeds} of each rung between;
models without the clip's subject. Each rung adds to the one above it; from the robust texture on there are
2,000 particles, 10,000 before. Static pose (of the model of people) and free-running cycles need no image.
Gain: how far a rung is below the free-running cycle of its own model, which is all that the images give it;
medians of the clips. The cycles start from the exact truth, the rungs from the truth with noise (pelvis 3 cm,
phase 0.03, rate 0.03 per second, heading 0.05 rad), so the comparison favours no image. Outdoors there is no
truth in space; [paper_mode](paper_mode.md) has that clip.

![the ladder](paper_ladder.svg)"""


if __name__ == "__main__":
    sys.exit(main())
