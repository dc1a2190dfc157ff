#!/usr/bin/env python3
"""The paper's tracker at its best, and what each later addition gains: frames 0 to 50 from a true start.

    paper_ladder.py [--seeds 10] [--rung-seeds 3] [--record]

The ladder from the paper to the default (gait.paper.ladder) on the development clips, with models learnt
without each clip's subject, then gait track with its detector and its own start (if the weights are there),
and the outdoor clip in paper mode.
"""

from __future__ import annotations

import argparse
import io
import json
import sys
import tempfile
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import eval_clips
import matplotlib
import numpy as np
import table
from facts import facts
from paper_runs import Footage

from gait import Model
from gait.body.skeleton import EVAL15
from gait.detect import weights
from gait.io import blob
from gait.io.files import replacing
from gait.io.track_file import read_track
from gait.motion.evaluate import root_errors
from gait.paper import ladder
from gait.paper.scene import Run, reported
from gait.paper.tracking import CRITERION, FIGURE_FRAMES
from gait.progress import progress
from gait.track.clip import ClipOptions, track_clip

PAPER = Path(__file__).resolve().parents[2] / "python" / "gait" / "data" / "paper.gait"
FOLDER = eval_clips.ROOT / "build" / "eval" / "models"
SHIPPED = {"paper": PAPER, "people": PAPER.with_name("walk.gait")}  # models of the package, by prior
TRUE_START = "+ keypoints of the detector"
#: What gait track adds to the default on the ladder: options of the command.
FILMED: dict[str, dict[str, Any]] = {
    TRUE_START: {},
    "automatic start, from these keypoints": {},
    "automatic start, from the images alone": {"detector": "none"},
}
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
    write = partial(table.publish, record=args.record)
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
    """Runs of all rungs on a clip, and errors of the baselines without images, mm, by name."""

    footage: Footage
    without: dict[str, float]
    runs: dict[str, list[Run]]
    filmed: dict[str, list[float]]  #: errors of gait track, mm

    def names(self) -> list[str]:
        """Return all names, baselines first."""
        return [*self.without, *self.runs, *self.filmed]

    def roots(self, name: str) -> list[float]:
        """Return the root-aligned errors, mm, of the seeds."""
        if name in self.runs:
            return [run.root for run in self.runs[name]]
        return self.filmed.get(name) or [self.without[name]]

    def error(self, name: str) -> float:
        """Return their median."""
        return float(np.median(self.roots(name)))


def climbed(f: Footage, paths: dict[str, dict[str, Path]], seeds: int, rung_seeds: int) -> Climbed:
    """Track a clip on each rung, by models without its subject; only in paper mode if there is no truth."""
    files = {prior: paths[prior].get(f.clip.subject or "", shipped) for prior, shipped in SHIPPED.items()}
    blobs = ladder.blobs(*(files[prior].read_bytes() for prior in SHIPPED))
    models = {name: Model(each) for name, each in blobs.items()}
    without, runs, filmed = dict[str, float](), dict[str, list[Run]](), dict[str, list[float]]()
    if f.scene is not None:
        base = {name: f.scene.baselines(blob.decode(blobs[name])) for name in ladder.COMPARED_MODELS}
        without = {ladder.FREE[name]: each["free"] for name, each in base.items()}
        without |= {ladder.STATIC_POSE: base["people"]["static"]}
    for rung in ladder.RUNGS if f.scene is not None else (ladder.PAPER_RUNG,):
        count = seeds if rung in (ladder.PAPER_RUNG, ladder.RUNGS[-1]) else rung_seeds
        runs[rung.name] = [
            f.run(models[rung.model], rung.mode, seed, rung.changes) for seed in range(1, count + 1)
        ]
    if f.scene is not None and weights.find(weights.LANDMARK_NETWORKS["full"]):
        for name in FILMED:
            filmed[name] = [tracked(f, files["people"], name, seed) for seed in range(1, rung_seeds + 1)]
    return Climbed(f, without, runs, filmed)


def tracked(f: Footage, model: Path, name: str, seed: int) -> float:
    """Median error of gait track over those of the same frames that its track has, mm."""
    assert f.scene is not None
    with tempfile.TemporaryDirectory(prefix="gait-") as folder:
        init, output = Path(folder) / "init.json", Path(folder) / "track.csv"
        start = eval_clips.noisy_start(f.clip, seed, 0.0)
        init.write_text(json.dumps(start))
        own = {"init": str(init)} if name == TRUE_START else {"height": start["stature_m"]}
        files = {"video": str(f.clip.video), "camera": str(f.clip.camera), "background": str(f.clip.plate)}
        options = {"model": str(model), "seed": seed, "stop": FIGURE_FRAMES + 1, "quiet": True}
        track_clip(ClipOptions(**files, output=str(output), **options, **own, **FILMED[name]))
        track = read_track(output)
    found = np.stack([track.places[joint] for joint in EVAL15], axis=1)
    return float(np.median(root_errors(found, f.scene.true[track.frame - f.frames[0].number])))


def paper_row(found: Climbed) -> list[Any]:
    """Return the row of a clip in paper mode."""
    runs, root = found.runs[ladder.PAPER_RUNG.name], np.array(found.roots(ladder.PAPER_RUNG.name))
    return [
        found.footage.clip.name,
        f"{sum(r.held for r in runs)} of {len(runs)}",
        reported(runs, held=False),
        reported(runs, held=True),
        round(float(np.median(root)), 1),
        round(float(root.min()), 1),
        round(float(root.max()), 1),
        round(found.without.get(ladder.FREE["paper"], np.nan), 1),
        round(float(np.median([r.px for r in runs])), 1),
    ]


def ladder_row(name: str, median: dict[str, float], found: list[Climbed]) -> list[Any]:
    """Return the row of a rung: median of the clips, gain, each clip's median and range over the seeds."""
    known = {*found[0].runs, *found[0].filmed}
    errors = {one: [each.error(one) for each in found] for one in (name, ladder.own_cycle(name))}
    gain = round(ladder.gain(errors, name), 1) if name in known else None
    cells = list[Any]()
    for each in found:
        roots = each.roots(name)
        spread = f" ({min(roots):.0f}-{max(roots):.0f})" if len(roots) > 1 else ""
        cells.append(f"{each.error(name):.1f}{spread}")
    return [name, round(median[name], 1), gain, *cells]


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
    runs = [run for each in found for run in each.runs[ladder.PAPER_RUNG.name]]
    return f"""{facts()}

Frames 0 to 50 (outdoor: from the first frame in full view), 10,000 particles, models of 19 angles and 5
components learnt without the clip's subject. The start is the truth with noise (pelvis 3 cm, phase 0.03, rate
0.03 per second, heading 0.05 rad); outdoors it is the clip's own. The settings are those of
[search_paper](search_paper.md), which used no development clips.

A run is held if {CRITERION}.
Target for every clip: 9 of 10 runs are held, and the error is below that of the free-running cycle; outdoors
only the first applies. Met on {reached(found)}. Lost: number of runs reported as lost in some frame, among
those that leave the person (correct) and among those that are held (wrong); in total
{reported(runs, held=False)} and {reported(runs, held=True)}. root mm: root-aligned error, median over the
frames, then over the seeds. free: the mean cycle of the same model running free from the exact truth, without
images."""


def reached(found: list[Climbed]) -> str:
    """State on how many clips the target is met."""
    paper = ladder.PAPER_RUNG.name
    free = ladder.FREE["paper"]
    both = [
        each.footage.clip.name
        for each in found
        if 10 * sum(run.held for run in each.runs[paper]) >= 9 * len(each.runs[paper])
        and (each.footage.scene is None or each.error(paper) < each.without[free])
    ]
    return f"{len(both)} of {len(found)} clips ({', '.join(both) or 'none'})"


def about_ladder(seeds: int, rung_seeds: int) -> str:
    """State how the ladder was made."""
    return f"""{facts()}

Root-aligned error in mm of frames 0 to 50: median over the frames, then over the seeds (in brackets the range
over the seeds). The paper's filter and the default have {seeds} seeds, every other rung {rung_seeds}; models
are learnt without the clip's subject. Each rung adds one thing to the rung above, except that robust texture
also brings systematic resampling and checks that a true start does not need. All rungs have 5 components, and
10,000 particles until a rung has fewer.

The last three rows are gait track on these frames: with keypoints of its detector, from the same starts; with
keypoints, from its automatic start; and without keypoints, from its automatic start by images. Automatic
starts are given only the stature. Two left/right hypotheses and more particles at first occur only in the
last row. Errors are medians over the frames that the track has.

Static pose (of the model of people) and free-running cycles need no image. Gain: how much smaller a rung's
error is than that of its own model running free, which is what the images contribute; median of the clips'
differences. The cycles start from the exact truth and the rungs from the truth with noise (pelvis 3 cm, phase
0.03, rate 0.03 per second, heading 0.05 rad), so the comparison favours the cycles. The outdoor clip, which
has no 3-D truth, is in [paper_mode](paper_mode.md).

![the ladder](paper_ladder.svg)"""


if __name__ == "__main__":
    sys.exit(main())
