#!/usr/bin/env python3
"""How many modes a prior of mixed motions should have, chosen on sequences that are not reported.

make eval-lift, or lift_modes.py
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import eval_clips
import table
from lift_mocap import NOISE, SEQUENCES, WITHIN_SCALED, errors_of, held_out

from gait.progress import progress

#: The number of modes is chosen on these.
OTHERS = {
    "swordplay": "cmu_misc/02/02_07.amc",
    "jump": "cmu_misc/02/02_04.amc",
    "uneven ground": "cmu_misc/03/03_01.amc",
    "other dance": "cmu_misc/mjackson/131_01.amc",
    "other modern dance": "cmu_misc/moderndance/md_04.amc",
}
TRIED = (25, 50, 80)


def main() -> int:
    """Lift all sequences with all numbers of modes."""
    if eval_clips.absent():
        return 0
    rows = []
    count = len(TRIED) * (len(OTHERS) + len(SEQUENCES) - 1)
    with progress("numbers of modes", count) as update, tempfile.TemporaryDirectory() as folder:
        for row in tried(Path(folder)):
            rows.append(row)
            update(len(rows))
    _publish(rows)
    return 0


def tried(folder: Path) -> Iterator[list[object]]:
    """Rows by number of modes: for the sequences that they are chosen on, then for the reported ones."""
    eclectic = {title: file for title, file in SEQUENCES.items() if file.startswith("cmu_misc")}
    for use, sequences in (("chosen on", OTHERS), ("reported", eclectic)):
        for title, file in sequences.items():
            for modes in TRIED:
                known = held_out(file, folder, modes)
                low, high = errors_of(known, NOISE[0]), errors_of(known, NOISE[-1])
                yield [
                    *(use, title, known.prior.size, low.likelihood, low.bayes, high.likelihood, high.bayes),
                    *(high.likelihood / high.bayes, high.coverage, high.scaled),
                ]


def _publish(modes: list[list[object]]) -> None:
    note = (
        "The number of modes was chosen on the first sequences (use: chosen on), by the errors of Bayes. "
        "The ratio of likelihood to Bayes is no criterion: with few modes it is small, because few modes "
        "regularise least squares much as the prior regularises Bayes, but the errors of Bayes are lower "
        "with more modes. Errors are in mm per marker at 5 and at 50 mm of noise; ratio and coverages "
        f"are at 50 mm. The degrees of freedom of the scale (LIFT_FREEDOM) and its +- {WITHIN_SCALED} for "
        "90 % were chosen on the same sequences."
    )
    head = ["use", "left out", "modes", "likelihood 5", "Bayes 5", "likelihood 50", "Bayes 50", "ratio"]
    table.publish("lift_modes", "How many modes", [*head, "coverage", "scaled"], modes, note)


if __name__ == "__main__":
    sys.exit(main())
