#!/usr/bin/env python3
"""The paper's tracker at its best, and what each later addition buys: frames 0 to 50 from a true start.

    paper_ladder.py [--seeds 10] [--rung-seeds 3] [--record]

First the development clips and the outdoor clip in paper mode, then the ladder from the paper to the default
(gait.paper.ladder) on the development clips, with models learnt without each clip's subject.
"""

from __future__ import annotations

import argparse
import io
import sys
from pathlib import Path
from typing import Any

import eval_clips
import matplotlib
import numpy as np
import table
from facts import facts
from paper_runs import Footage

from gait import Mode, Model
from gait.io.files import replacing
from gait.paper import ladder
from gait.paper.scene import TAIL, Run
from gait.progress import progress

PAPER = Path(__file__).resolve().parents[2] / "python" / "gait" / "data" / "paper.gait"
FOLDER = eval_clips.ROOT / "build" / "eval" / "models"
COLUMNS = ("clip", "held", "root mm", "least", "most", "free mm", "static mm", "px", "lost %")


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=10, help="runs of a clip in paper mode")
    parser.add_argument("--rung-seeds", type=int, default=3, help="runs of a clip on each rung")
    parser.add_argument("--record", action="store_true", help="publish the tables")
    args = parser.parse_args()
    clips = eval_clips.shared_clips(None)
    with progress("learning", None) as update:
        paths = {p: eval_clips.models(clips, FOLDER, 1, update, p) for p in ("paper", "people")}
    footage = [Footage(clip) for clip in clips]
    write = table.publish if args.record else lambda name, *rest, note="": table.show(*rest)
    if args.seeds:
        write(
            "paper_mode",
            "Paper mode at its best",
            COLUMNS,
            measured(footage, paths, args.seeds),
            note=about(),
        )
    if args.rung_seeds:
        rows, errors, range_of = climbed(footage, paths, args.rung_seeds)
        names = [f.clip.name for f in footage if f.scene is not None]
        write(
            "paper_ladder",
            "From the paper to the default",
            ["rung", "median", "gain", *names],
            rows,
            note=about_ladder(args.rung_seeds),
        )
        if args.record:
            draw(errors, range_of)
    return 0


def _models(f: Footage, paths: dict[str, dict[str, Path]]) -> tuple[Model, Model, Path | None]:
    """Paper's and people's model without the clip's subject, and the file of the first."""
    subject = f.clip.subject or ""
    paper = paths["paper"].get(subject)
    return Model(paper or "paper"), Model(paths["people"].get(subject)), paper


def measured(footage: list[Footage], paths: dict[str, dict[str, Path]], seeds: int) -> list[list[Any]]:
    """Track each clip in paper mode from `seeds` starts."""
    rows = list[list[Any]]()
    with progress("paper mode", len(footage)) as update:
        for k, f in enumerate(footage):
            model, _, path = _models(f, paths)
            runs = [f.run(model, Mode.PAPER, seed) for seed in range(1, seeds + 1)]
            rows.append(_row(f, runs, f.baselines(path or PAPER)))
            update(k + 1)
    return rows


def _row(f: Footage, runs: list[Run], base: dict[str, float]) -> list[Any]:
    root = np.array([r.root for r in runs])
    return [
        f.clip.name,
        f"{sum(r.held for r in runs)} of {len(runs)}",
        round(float(np.median(root)), 1),
        round(float(root.min()), 1),
        round(float(root.max()), 1),
        round(base["free"], 1),
        round(base["static"], 1),
        round(float(np.median([r.px for r in runs])), 1),
        round(100 * float(np.mean([r.lost for r in runs])), 1),
    ]


def climbed(
    footage: list[Footage], paths: dict[str, dict[str, Path]], seeds: int
) -> tuple[list[list[Any]], dict[str, float], dict[str, tuple[float, float]]]:
    """Track each clip on each rung; return rows, and medians and ranges over the clips by rung."""
    known = [f for f in footage if f.scene is not None]
    by_rung: dict[str, list[float]] = {}
    with progress("ladder", len(known) * len(ladder.RUNGS)) as update:
        done = 0
        for f in known:
            paper, people, _ = _models(f, paths)
            for prior, path in (("paper", PAPER), ("people", PAPER.with_name("walk.gait"))):
                base = f.baselines(paths[prior].get(f.clip.subject or "", path))
                by_rung.setdefault(ladder.FREE[prior == "people"], []).append(base["free"])
            by_rung.setdefault(ladder.STATIC, []).append(base["static"])
            for rung in ladder.RUNGS:
                model = people if rung.people else paper
                runs = [f.run(model, rung.mode, seed, rung.changes).root for seed in range(1, seeds + 1)]
                by_rung.setdefault(rung.name, []).append(float(np.median(runs)))
                update(done := done + 1)
    median = {name: float(np.median(v)) for name, v in by_rung.items()}
    gains = {r.name: round(ladder.own_free(median, r) - median[r.name], 1) for r in ladder.RUNGS}
    rows = [
        [name, round(median[name], 1), gains.get(name), *(round(x, 1) for x in v)]
        for name, v in by_rung.items()
    ]
    return (
        rows,
        median,
        {name: (min(v), max(v)) for name, v in by_rung.items()},
    )


def draw(errors: dict[str, float], range_of: dict[str, tuple[float, float]]) -> None:
    """Write the plot beside the table."""
    text = io.StringIO()
    figure = ladder.plot(errors, range_of)
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "gait"}):
        figure.savefig(text, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    with replacing(table.RESULTS / "paper_ladder.svg") as path:
        path.write_text("\n".join(line.rstrip() for line in text.getvalue().splitlines()) + "\n")


def about() -> str:
    """State how the runs were made."""
    return f"""{facts("paper_ladder.py --record")}

Frames 0 to 50 (outdoor: from the first frame in full view), 10,000 particles, models of 19 angles and 5
components without the clip's subject; the start is the truth with noise (pelvis 3 cm, phase 0.03, rate 0.03
per second, heading 0.05 rad), outdoor the clip's own. Settings are those of
[search_paper](search_paper.md); no development clip was looked at before. Held: in the last {TAIL} frames
the joints are on average within a tenth of the person's height in the picture (outdoor: 0.15, of the clear
marks). root mm: root-aligned, median over the frames and then over the seeds. free, static: the mean cycle
of the same model running on from the exact truth, and its mean pose at the true place, which need no
image."""


def about_ladder(seeds: int) -> str:
    """State how the ladder was made."""
    return f"""{facts(f"paper_ladder.py --record --rung-seeds {seeds}")}

Root-aligned error, mm, of frames 0 to 50 from a true start with noise, median over the frames and then over
the seeds; models without the clip's subject. Each rung adds to the one above it. Static pose (of the model
of people) and free-running cycles need no image. Gain: how far a rung is below the free-running cycle of
its own model, which is all that the images give it; medians of the clips. The cycles start from the exact
truth, the rungs from the truth with noise (pelvis 3 cm, phase 0.03, rate 0.03 per second, heading 0.05
rad), so the comparison favours no image.

![the ladder](paper_ladder.svg)"""


if __name__ == "__main__":
    sys.exit(main())
