#!/usr/bin/env python3
"""Which of two readings of an equation of Ormoneit and others (2000) tracks: paper mode with both.

    paper_readings.py [--folder build/search_paper] [--seeds 6] [--record]

The clips are those of search_paper.py, with the settings that it chose; no development clip is used.  If a
reading changes how much a grey level counts, it has its own sigma, the best of some with one seed; all
readings are judged with other seeds, which the search did not use.  Each is compared run by run with the
reading that was chosen.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import search_paper
import table
from facts import facts
from scipy import stats

from gait import TrackerConfig
from gait.bindings.abi import Mode
from gait.paper.scene import Run, reported
from gait.progress import progress

TAKEN = TrackerConfig.default(Mode.PAPER)
PIXELS = 2 * 3.0**2  # grey levels squared, the noise of both frames


Settings = dict[str, float]


def summed(sd: float) -> Settings:
    """Settings with which eq. 11 has the sum over n_s points, with this sigma, in place of their mean.

    The exponent's variance is divided by n_s, and p_occluded is multiplied by the root of n_s, so that the
    factor before the exponential, which the sum does not change, keeps its ratio to p_occluded.
    """
    points, square = TAKEN.limb_points, sd**2
    left = (PIXELS + square) / points - PIXELS
    return {
        "surface_sd": left**0.5,
        "surface_tilt": square * TAKEN.surface_tilt / points / left,
        "occluded_density": TAKEN.occluded_density * points**0.5,
    }


def tuned(changes: Settings) -> dict[str, Settings]:
    """Return the changes with some sigmas of eq. 11, by what the sigma is."""
    return {f"{k * TAKEN.surface_sd:.3g}": changes | {"surface_sd": k * TAKEN.surface_sd} for k in FACTORS}


MORE = "than taken", "95 %"  # columns of the difference between scores
FACTORS = (0.7, 1.0, 1.4)
SUMS = (20.0, 28.0, 56.0)  # sigmas of a sum over the points
FEWER = 8  # points
#: Equation, reading, settings that differ from those chosen, by sigma of eq. 11.
READINGS: tuple[tuple[str, str, dict[str, Settings]], ...] = (
    ("all", "as taken", {f"{TAKEN.surface_sd:.3g}": {}}),
    (
        "5",
        "at the start scores vary as among people (taken: by a share of that)",
        {f"{TAKEN.surface_sd:.3g}": {"coef_start": 1.0}},
    ),
    (
        "8",
        "forward motion is bound to the rate (taken: it has its own noise)",
        {f"{TAKEN.surface_sd:.3g}": {"forward_noise": TAKEN.lateral_noise}},
    ),
    (
        "10",
        f"n_s is {FEWER} (taken: {TAKEN.limb_points})",
        {f"{TAKEN.surface_sd:.3g}": {"limb_points": FEWER}},
    ),
    (
        "11",
        "the sum over n_s points (taken: their mean)",
        {f"{sd:.3g}": summed(sd) for sd in SUMS},
    ),
    ("11", "sigma is constant (taken: it grows with the angle)", tuned({"surface_tilt": 0.0})),
    (
        "12",
        "p_occluded equals a difference of 2.5 sigma (taken: near the density of a usual limb)",
        tuned({"occluded_density": 0.0018}),
    ),
)


def main() -> int:
    """Track with each reading, and publish."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--folder", type=Path, default=search_paper.FOLDER)
    parser.add_argument("--seeds", type=int, default=6, help="runs of a clip under each reading")
    parser.add_argument("--record", action="store_true", help="publish the table")
    args = parser.parse_args()
    search = search_paper.Search(args.folder)
    judged, rows, fresh = list[Judged](), list[list[Any]](), search_paper.MORE.stop
    with progress("readings", len(READINGS)) as update:
        for k, (equation, words, sigmas) in enumerate(READINGS):
            best = next(iter(sigmas))
            if len(sigmas) > 1:
                scores = {
                    sd: Judged.of(search, each, search_paper.FIRST).score for sd, each in sigmas.items()
                }
                best = min(scores, key=scores.__getitem__)
            judged.append(Judged.of(search, sigmas[best], range(fresh, fresh + args.seeds)))
            rows.append([equation, words, best, *judged[-1].row(judged[0])])
            update(k + 1)
    columns = ("eq.", "reading", "sigma", "score", *MORE, "root / free", "left", "lost", *search_paper.CLIPS)
    title = "Readings of the paper's equations"
    table.publish("paper_readings", title, columns, rows, about(args.seeds), record=args.record)
    return 0


@dataclass(frozen=True)
class Judged:
    """Runs with a reading, by clip and seed."""

    free: list[float]  #: error of the free-running cycle of each clip, mm
    runs: list[list[Run]]

    @classmethod
    def of(cls, search: search_paper.Search, changes: Settings, seeds: range) -> Judged:
        """Track every clip."""
        runs = [
            [f.run(search.model, Mode.PAPER, 100 * k + seed, changes) for seed in seeds]
            for k, f in enumerate(search.footage, 1)
        ]
        return cls(search.free, runs)

    @property
    def roots(self) -> list[float]:
        """Error of each clip, mm."""
        return [float(np.mean([r.root for r in each])) for each in self.runs]

    @property
    def ratio(self) -> float:
        """Error divided by that of the free-running cycle, mean of the clips."""
        return float(np.mean([root / free for root, free in zip(self.roots, self.free, strict=True)]))

    @property
    def scores(self) -> np.ndarray:
        """As in the search, by clip and seed: the ratio, plus 1 for a run that leaves the person."""
        pairs = zip(self.runs, self.free, strict=True)
        return np.array([[r.root / free + (not r.held) for r in each] for each, free in pairs])

    @property
    def score(self) -> float:
        """Mean of the runs."""
        return float(np.mean(self.scores))

    def row(self, taken: Judged) -> list[Any]:
        """Return cells of the table; `taken`: runs with the same seeds and the readings that were chosen."""
        every = [r for each in self.runs for r in each]
        left = f"{sum(not r.held for r in every)} of {len(every)}"
        numbers = (round(self.score, 2), *self._apart(taken), round(self.ratio, 2))
        return [*numbers, left, reported(every, held=False), *(round(root, 1) for root in self.roots)]

    def _apart(self, taken: Judged) -> tuple[Any, Any]:
        """Mean difference of the scores, run by run, and its 95 % interval by Student's t within clips."""
        apart = self.scores - taken.scores
        clips, seeds = apart.shape
        if self is taken or seeds < 2:
            return None, None
        sd = np.sqrt(apart.var(axis=1, ddof=1).sum() / seeds) / clips
        low, high = stats.t.interval(0.95, clips * (seeds - 1), apart.mean(), sd)
        return f"{apart.mean():+.2f}", f"{low:+.2f} to {high:+.2f}"


def about(seeds: int) -> str:
    """State how the readings were compared, and which could not be compared."""
    same = summed(SUMS[-1])["surface_sd"]
    return f"""{facts()}

Some equations of the filter can be read in two ways.  The table compares paper mode with both readings on the
clips of [search_paper](search_paper.md), frames 0 to 50: root-aligned error, mm, mean of {seeds} seeds; root
/ free: the error divided by that of the free-running cycle, mean of the clips; runs that leave the person,
and how many of these are reported as lost; score: that ratio plus the share of the runs that leave, as in the
search. Than taken: difference of the score from the first row's, paired by run with the same starts and
random numbers, and its 95 % interval over seeds on these clips, for each row separately.  sigma: that of eq.
11, in grey levels; if a reading changes how much it counts, the best of three, chosen with a separate seed. A
constant sigma is not a reading: the paper lets it increase with narrow angles, in a form that it does not
give.

The two readings of the sum in eq. 11 are one likelihood with two sigmas, except for the noise of a pixel: the
sum over {TAKEN.limb_points} points with a sigma of {SUMS[-1]:g} equals their mean with {same:.1f}.  The sigma
that the search chooses therefore serves both.

Not run, because one reading cannot work: eq. 1 with the number of the cycle as the group, as printed
(each group is then a whole cycle); eq. 6 without the rate, as printed (the phase stands still); eq. 8
without the length of a stride (its units do not match); eq. 13 as a product of densities (it underflows;
logarithms are equivalent).  Each particle keeps its own texture of the previous frame, as in eq. 10; with a
mean texture the likelihood would not be that of a particle."""


if __name__ == "__main__":
    sys.exit(main())
