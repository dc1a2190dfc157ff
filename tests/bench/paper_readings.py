#!/usr/bin/env python3
"""Of two readings of an equation of Ormoneit and others (2000), which one tracks: paper mode under both.

    paper_readings.py [--folder build/search_paper] [--seeds 2] [--record]

On the clips of search_paper.py, with the settings that it froze; no development clip is looked at.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
import search_paper
import table
from facts import facts

from gait import TrackerConfig
from gait.bindings.abi import Mode
from gait.progress import progress

TAKEN = TrackerConfig.default(Mode.PAPER)
PIXELS = 2 * 3.0**2  # grey levels squared, the noise of both frames


def summed() -> dict[str, float]:
    """Settings under which eq. 11 has the sum over n_s points in place of their mean.

    The exponent's variance is divided by n_s, and p_occluded multiplied by the root of it, so that the factor
    before the exponential, which the sum leaves as it is, keeps its ratio to p_occluded.
    """
    points = TAKEN.limb_points
    square = TAKEN.surface_sd**2
    left = (PIXELS + square) / points - PIXELS
    return {
        "surface_sd": left**0.5,
        "surface_tilt": square * TAKEN.surface_tilt / points / left,
        "occluded_density": TAKEN.occluded_density * points**0.5,
    }


#: Equation, reading, what differs from the settings that were taken.
READINGS: tuple[tuple[str, str, dict[str, float]], ...] = (
    ("all", "as taken", {}),
    ("5", "at the start scores spread like people (taken: by a share)", {"coef_start": 1.0}),
    (
        "8",
        "the way ahead is bound to the rate (taken: noise of its own)",
        {"forward_noise": TAKEN.lateral_noise},
    ),
    ("10", "n_s is 16 (taken: 10)", {"limb_points": 16}),
    ("11", "the sum over n_s points (taken: their mean)", summed()),
    ("11", "sigma is constant (taken: grows with the angle)", {"surface_tilt": 0.0}),
    (
        "12",
        "p_occluded is a difference of 2.5 sigma (taken: near that of a usual limb)",
        {"occluded_density": 0.0018},
    ),
)


def main() -> int:
    """Track under each reading, and publish."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--folder", type=Path, default=search_paper.FOLDER)
    parser.add_argument("--seeds", type=int, default=2, help="runs of a clip under each reading")
    parser.add_argument("--record", action="store_true", help="publish the table")
    args = parser.parse_args()
    search = search_paper.Search(args.folder)
    rows = list[list[Any]]()
    with progress("readings", len(READINGS)) as update:
        for k, (equation, words, changes) in enumerate(READINGS):
            rows.append([equation, words, *measured(search, changes, args.seeds)])
            update(k + 1)
    write = table.publish if args.record else lambda name, *rest, note="": table.show(*rest)
    columns = ("eq.", "reading", "root / free", "left", *search_paper.CLIPS)
    write("paper_readings", "Readings of the paper's equations", columns, rows, note=about(args.seeds))
    return 0


def measured(search: search_paper.Search, changes: dict[str, float], seeds: int) -> list[Any]:
    """Return the error over that of the free-running cycle, the share that leaves, and errors by clip, mm."""
    runs = [
        [f.run(search.model, Mode.PAPER, seed, changes) for seed in range(1, seeds + 1)]
        for f in search.footage
    ]
    roots = [float(np.mean([r.root for r in each])) for each in runs]
    left = sum(not r.held for each in runs for r in each)
    ratio = float(np.mean([root / free for root, free in zip(roots, search.free, strict=True)]))
    return [round(ratio, 2), f"{left} of {len(runs) * seeds}", *(round(root, 1) for root in roots)]


def about(seeds: int) -> str:
    """State how the readings were compared, and which could not be."""
    return f"""{facts(f"paper_readings.py --record --seeds {seeds}")}

Where an equation of the filter can be read in two ways, paper mode under both, on the clips of
[search_paper](search_paper.md): root-aligned error, mm, frames 0 to 50, the mean of {seeds} seeds; over
that of the free-running cycle, the mean of the clips; and runs that leave the person. All else stays as
taken, so that a reading which would need other sigmas is at a disadvantage.

Not run, because one reading cannot work: eq. 1 with the number of the cycle as the group, as printed
(each group is then a whole cycle); eq. 6 without the rate, as printed (the phase stands still); eq. 8
without the length of a stride (its units do not fit); eq. 13 as a product of densities (it underflows;
logarithms are the same). The texture of the frame before is each particle's own, as eq. 10 has it; one
of the mean would be no likelihood of a particle."""


if __name__ == "__main__":
    sys.exit(main())
