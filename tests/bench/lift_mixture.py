#!/usr/bin/env python3
"""How many Gaussians a segment prior is lifted with: decided on sequences that are not reported.

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
from lift_modes import OTHERS

from gait.progress import progress

COUNTS = ("1", "2", "auto")  # of --segment-mixture
USES = {"decided on": OTHERS, "reported": SEQUENCES}


def main() -> int:
    """Lift all sequences with priors of one Gaussian, of two, and of as many as predict people best."""
    if eval_clips.absent():
        return 0
    rows = []
    total = len(COUNTS) * sum(map(len, USES.values()))
    with progress("mixtures", total) as update, tempfile.TemporaryDirectory() as folder:
        for row in tried(Path(folder)):
            rows.append(row)
            update(len(rows))
    for use in USES:
        for count in COUNTS:
            same = np.array([row[3:] for row in rows if row[0] == use and row[2] == count], float)
            rows.append([use, "mean", count, np.nan, *same.mean(axis=0)[1:].tolist()])
    note = (
        "Sequences left out as in lift_mocap, by priors of one Gaussian (the default), of two, and of as "
        "many as predict people left out best (auto); of a mixture the lifter takes the component with the "
        "most evidence. Bayes: error in mm per marker at 5, 20 and 50 mm of noise; coverage: of the 90 % "
        "intervals of the depth at 50 mm, as they are and scaled. The default is decided by the means of "
        "the first sequences."
    )
    head = ["use", "left out", "asked for", "Gaussians", *(f"Bayes {1000 * sd:.0f}" for sd in NOISE)]
    table.publish("lift_mixture", "How many Gaussians", [*head, "coverage", "scaled"], rows, note)
    return 0


def tried(folder: Path) -> Iterator[list[object]]:
    """Yield a row of each sequence and number of Gaussians."""
    for use, sequences in USES.items():
        for title, file in sequences.items():
            for count in COUNTS:
                known = held_out(file, folder, MODES[file.split("/")[0]], count)
                found = [errors_of(known, sd) for sd in NOISE]
                last = found[-1]
                bayes = (each.bayes for each in found)
                yield [use, title, count, len(known.prior.mean), *bayes, last.coverage, last.scaled]


if __name__ == "__main__":
    sys.exit(main())
