#!/usr/bin/env python3
"""Held-out motion capture lifted with a prior of one Gaussian, and with mixtures.

make eval-lift, or lift_mixture.py
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import eval_clips
import numpy as np
import table
from lift_mocap import MODES, NOISE, SEQUENCES, errors_of, held_out

from gait.progress import progress

COUNTS = ("1", "2", "auto")  # values of --segment-mixture


def main() -> int:
    """Lift all sequences with priors of one Gaussian, of two, and of the number that predicts people best."""
    if eval_clips.absent():
        return 0
    rows = []
    total = len(COUNTS) * len(SEQUENCES)
    with progress("mixtures", total) as update, tempfile.TemporaryDirectory() as folder:
        for row in tried(Path(folder)):
            rows.append(row)
            update(len(rows))
    for count in COUNTS:
        same = np.array([row[3:] for row in rows if row[1] == count], float)
        rows.append(["mean of all", count, np.nan, *same.mean(axis=0).tolist()])
    note = (
        "Sequences are left out as in lift_mocap. The priors have one Gaussian (the default), two, or "
        "the number that predicts people left out best (auto); of a mixture the lifter uses the "
        "component with the most evidence. Bayes: error in mm per marker at 5, 20 and 50 mm of noise; "
        "coverage: of the 90 % intervals of the depth at 50 mm, unscaled and scaled."
    )
    head = ["left out", "asked for", "Gaussians", *(f"Bayes {1000 * sd:.0f}" for sd in NOISE)]
    table.publish("lift_mixture", "How many Gaussians", [*head, "coverage", "scaled"], rows, note)
    return 0


def tried(folder: Path) -> Iterator[list[object]]:
    """Yield a row of each sequence and number of Gaussians."""
    for title, file in SEQUENCES.items():
        for count in COUNTS:
            known = held_out(file, folder, MODES[file.split("/")[0]], count)
            found = [errors_of(known, sd) for sd in NOISE]
            bayes = (each.bayes for each in found)
            yield [title, count, len(known.prior.mean), *bayes, found[-1].coverage, found[-1].scaled]


if __name__ == "__main__":
    sys.exit(main())
