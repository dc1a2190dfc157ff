#!/usr/bin/env python3
"""Find the values that Ormoneit and others (2000) call empirically determined, on simulated clips.

    search_paper.py [--folder build/search_paper] [--count 7] [--changes 20] [--record]
    search_paper.py --lost [--record]

The clips are made by `gait simulate`; no development clip is used.  The first settings are those before the
search, the second are a guess from pictures of the likelihood, and more are drawn at random, evenly in their
logarithms.  Then the best ones are changed at random in half of their settings.  The score of some settings
is the mean over clips of the root-aligned error divided by that of the mean cycle running freely from the
true start (at most 3), plus the share of runs that leave the person.  All settings are tried with one seed;
the best ones are judged again with others.  Results are kept in the folder, and a run continues where the
last one ended.

--lost chooses the threshold from which a person counts as lost, with the settings of paper mode as they are.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import detector_clips
import numpy as np
import table
from eval_clips import folder_clips
from facts import facts
from paper_runs import Footage

from gait import Mode, Model
from gait.paper import ladder
from gait.paper.scene import Run, reported
from gait.paper.tracking import FIGURE_FRAMES
from gait.progress import progress
from gait.simulate.clip import simulate
from gait.simulate.scenario import Scenario

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "build" / "search_paper"
MODEL = ROOT / "python" / "gait" / "data" / "paper.gait"
SMALL = {"size": (480, 360), "frames": 70}
#: Clips by the person whose gait is used; no person is in a development clip or in the model.
CLIPS: dict[str, Scenario] = {
    "c12": Scenario(direction="rl", seed=111, clutter=True, **SMALL),
    "c47": Scenario(view="oblique", seed=112, **SMALL),
    "m01": Scenario(view="toward", seed=113, **SMALL),
    "m06": Scenario(seed=114, **SMALL),
    "b2": Scenario(view="away", seed=115, **SMALL),
    "g1": Scenario(view="above", direction="rl", seed=116, **SMALL),
}
#: Setting: symbol in the paper, smallest and largest value.
SPACE: dict[str, tuple[str, float, float]] = {
    "phase_noise": ("sigma of psi, eq. 6", 0.002, 0.03),
    "rate_noise": ("sigma of rho, eq. 7", 0.005, 0.1),
    "forward_noise": ("sigma of tau, eq. 8", 0.01, 0.2),
    "lateral_noise": ("sigma of tau, eq. 8", 0.003, 0.1),
    "vertical_noise": ("sigma of tau, eq. 8", 0.003, 0.06),
    "heading_noise": ("sigma of theta, eq. 9", 0.01, 0.2),
    "tilt_noise": ("sigma of theta, eq. 9", 0.003, 0.1),
    "coef_noise": ("epsilon, eq. 5", 0.01, 1.0),
    "coef_start": ("epsilon at the start", 0.1, 1.0),
    "occluded_density": ("p_occluded, eq. 12", 3e-4, 0.03),
    "surface_sd": ("sigma, eq. 11", 5.0, 40.0),
    "surface_tilt": ("sigma(alpha), eq. 11", 0.1, 10.0),
    "limb_points": ("n_s, eq. 10", 4, 16),
}
#: From pictures of the likelihood: little noise, except along the path, and a flat likelihood.
GUESS = {
    "phase_noise": 0.008, "rate_noise": 0.03, "forward_noise": 0.06, "lateral_noise": 0.01,
    "vertical_noise": 0.01, "heading_noise": 0.02, "tilt_noise": 0.01, "coef_noise": 0.05, "coef_start": 0.3,
    "occluded_density": 0.015, "surface_sd": 14.0, "surface_tilt": 1.0, "limb_points": 16,
}  # fmt: skip
BEFORE = ladder.UNSEARCHED
WORST = 3.0  # largest ratio of a run's error to that of the free cycle
AGAIN = 5  # number of the best ones, which are judged with more seeds
KEPT = 3  # settings that are changed in turn
SPREAD = 0.6  # sd of the logarithm of a factor
FIRST, MORE = range(1), range(1, 4)  # seeds of all settings, and of the best
NEVER_LOST = {"stayed_nats": 0.0}
THRESHOLDS = (1.0, 1.5, 2.5, 5.0)  # values of stayed_nats; 5 is that before the search

Settings = dict[str, float]


def main() -> int:
    """Search, and publish."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--folder", type=Path, default=FOLDER)
    parser.add_argument("--count", type=int, default=7, help="settings drawn at random")
    parser.add_argument("--changes", type=int, default=20, help="changes of the best")
    parser.add_argument(
        "--lost", action="store_true", help="choose the threshold from which a person counts as lost"
    )
    parser.add_argument("--record", action="store_true", help="publish the table")
    args = parser.parse_args()
    search = Search(args.folder)
    if args.lost:
        lost(search, args.record)
        return 0
    with progress("search", args.count) as update:
        for k in range(args.count):
            search.score(("before", "guess")[k] if k < 2 else f"random {k}", drawn(k), FIRST)
            update(k + 1)
    with progress("changes", args.changes) as update:
        for k in range(args.changes):
            search.score(f"change {k}", changed(search.top(FIRST, KEPT)[k % KEPT][1], k), FIRST)
            update(k + 1)
    finalists = search.top(FIRST, AGAIN)
    with progress("best again", len(finalists)) as update:
        for k, (what, settings) in enumerate(finalists):
            search.score(what, settings, MORE)
            update(k + 1)
    [(_, best)] = search.top(MORE, 1)
    print(json.dumps(best, indent=1))
    if args.record:
        publish(search, best, f"--count {args.count} --changes {args.changes}")
    return 0


def drawn(k: int) -> Settings:
    """Draw settings; the first are those before the search, the second a guess from the pictures."""
    if k < 2:
        return (BEFORE, GUESS)[k]
    rng = np.random.default_rng([25, k])
    return {name: _whole(name, low * (high / low) ** rng.uniform()) for name, (_, low, high) in SPACE.items()}


def changed(best: Settings, k: int) -> Settings:
    """Return settings of which about half are multiplied by a random factor."""
    rng, new = np.random.default_rng([26, k]), dict(best)
    for name, (_, low, high) in SPACE.items():
        factor, change = np.exp(SPREAD * rng.standard_normal()), rng.uniform() < 0.5
        if change:
            new[name] = _whole(name, float(np.clip(best[name] * factor, low, high)))
    return new


def _whole(name: str, value: float) -> float:
    return round(value) if name == "limb_points" else float(f"{value:.3g}")


class Search:
    """Clips, and the scores of the settings tried so far."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        for name, scenario in CLIPS.items():
            gait = folder / f"{name}.gait"
            if not gait.is_file():
                detector_clips.learnt(detector_clips.recordings()[name], gait)
            if not (folder / "clips" / name / "truth.csv").is_file():
                simulate(replace(scenario, gait=str(gait)), folder / "clips" / name)
        self.model = Model(MODEL)
        self.footage = [Footage(clip) for clip in folder_clips(folder / "clips")]
        self.free = [f.baselines(MODEL)["free"] for f in self.footage]
        self._path = folder / "scores.jsonl"
        lines = self._path.read_text().splitlines() if self._path.is_file() else []
        self.rows: list[dict[str, Any]] = [json.loads(line) for line in lines]

    def score(self, what: str, settings: Settings, seeds: range) -> None:
        """Score settings, unless that has been done."""
        if any(row["settings"] == settings and row["seeds"] == list(seeds) for row in self.rows):
            return
        runs = [
            [f.run(self.model, Mode.PAPER, 100 * k + seed, settings | NEVER_LOST) for seed in seeds]
            for k, f in enumerate(self.footage, 1)
        ]
        ratios = [
            float(np.mean([min(r.root / free, WORST) for r in each]))
            for each, free in zip(runs, self.free, strict=True)
        ]
        lost = float(np.mean([not r.held for each in runs for r in each]))
        row = {
            "what": what,
            "score": float(np.mean(ratios)) + lost,
            "ratio": float(np.mean(ratios)),
            "lost": lost,
            "roots": [round(float(np.mean([r.root for r in each])), 1) for each in runs],
            "seeds": list(seeds),
            "settings": settings,
        }
        self.rows.append(row)
        with open(self._path, "a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")

    def top(self, seeds: range, count: int) -> list[tuple[str, Settings]]:
        """Return the lowest scores and the settings that were tried."""
        rows = [row for row in self.rows if row["seeds"] == list(seeds)]
        rows.sort(key=lambda row: row["score"])
        return [(row["what"], row["settings"]) for row in rows[:count]]


def publish(search: Search, best: Settings, counts: str) -> None:
    """Write the chosen settings, and every score on which the choice is based."""
    frozen = {name: frozen_value(name, value) for name, value in best.items()}
    rows = [
        [name, symbol, BEFORE[name], frozen[name], low, high] for name, (symbol, low, high) in SPACE.items()
    ]
    columns = ("setting", "in the paper", "before", "frozen", "smallest allowed", "largest allowed")
    table.publish(
        "search_paper", "What the paper determines empirically", columns, rows, note=about(search, counts)
    )
    tried = [
        [row["what"], len(row["seeds"]), row["score"], row["ratio"], row["lost"], *row["roots"]]
        for row in search.rows
    ]
    columns = ("tried", "seeds", "score", "root / free", "left", *CLIPS)
    free = ["free-running cycle", "-", 1.0, 1.0, "-", *(round(f, 1) for f in search.free)]
    note = "By [search_paper](search_paper.md), which names command and commit. Errors in mm."
    table.publish("search_paper_runs", "Settings tried", columns, [free, *tried], note)


def lost(search: Search, record: bool) -> None:
    """Show how often runs that leave the person, and runs that do not, are reported as lost, by threshold."""
    runs: dict[float, list[Run]] = {nats: [] for nats in THRESHOLDS}
    with progress("lost", len(search.footage)) as update:
        for k, f in enumerate(search.footage, 1):
            for seed in MORE:
                run: Run | None = None
                for nats in (
                    THRESHOLDS
                ):  # a run that one threshold does not report as lost is not reported by a larger one
                    if run is None or run.lost:
                        run = f.run(search.model, Mode.PAPER, 100 * k + seed, {"stayed_nats": nats})
                    runs[nats].append(run)
            update(k)
    rows = list[list[Any]]()
    for nats, each in runs.items():
        shares = [np.mean([r.lost > 0 for r in each if r.held == held] or [0]) for held in (False, True)]
        rows.append([nats, reported(each, False), reported(each, True), float(shares[0] - shares[1])])
    best = max(rows, key=lambda row: (row[-1], row[0]))[0]
    note = f"""{facts()}

How many of the runs that leave the person, and of those that stay on it, are reported as lost in some
frame, by stayed_nats; on the clips of [search_paper](search_paper.md), {len(MORE)} seeds each.  The value
chosen has the largest difference of the two shares: {best:g}."""
    columns = ("stayed_nats", "lost of those that leave", "lost of those that hold", "difference of shares")
    title = "From when on a person counts as lost"
    table.publish("search_paper_lost", title, columns, rows, note, record=record)


def frozen_value(name: str, value: float) -> float:
    """Return a value with two significant digits: so few runs justify no more."""
    return _whole(name, float(f"{value:.2g}"))


def about(search: Search, counts: str) -> str:
    """State how the search was made."""
    people = ", ".join(CLIPS)
    tried = sum(row["seeds"] == list(FIRST) for row in search.rows)
    return f"""{facts()}

The defaults of paper mode are the best of {tried} settings in [search_paper_runs](search_paper_runs.md).  The
score is the mean over six clips of the root-aligned error divided by that of the free-running cycle, plus the
share of runs that leave the person.  All settings are tried with one seed; the best {AGAIN} are tried again
with {len(MORE)} other seeds, which alone decide between them.  phase_noise and n_s ended at a bound of the
search.

The clips (480 x 360, {FIGURE_FRAMES + 1} frames used) are made by `gait simulate` with the gaits of people
{people}, who are neither in the model nor in a development clip.  The noise of a pixel (3 grey levels)
is not searched, because only its sum with sigma matters."""


if __name__ == "__main__":
    sys.exit(main())
