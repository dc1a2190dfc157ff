"""What benchmarks measured against their targets, over several runs: a busy host spoils some, seldom most."""

from __future__ import annotations

import re
from collections.abc import Sequence
from statistics import median
from typing import NamedTuple

ROW = re.compile(r"(\s*\S.*?)\s+(>=|<=|<)\s+([\d.]+)\s+([\d.]+)\s+.*(?:reached|MISSED)$")


class Wanted(NamedTuple):
    """A line of the benchmark: what was measured, `relation` to the target, the target, and the figure."""

    what: str
    relation: str
    wanted: float
    figure: float

    def met(self, figure: float) -> bool:
        """Whether another figure would meet the target."""
        if self.relation == ">=":
            return figure >= self.wanted
        return figure < self.wanted or (self.relation == "<=" and figure == self.wanted)


def wanted(printed: str) -> list[Wanted]:
    """Lines that end with a verdict, in order."""
    found = (ROW.match(line) for line in printed.splitlines())
    return [Wanted(m[1], m[2], float(m[3]), float(m[4])) for m in found if m]


def summary(runs: Sequence[str]) -> str:
    """Median, minimum and maximum of each figure, how many runs meet the target, and whether the median does.

    Parameters
    ----------
    runs : sequence of str
        What the same program printed on the same machine, run by run.
    """
    rows = [wanted(printed) for printed in runs]
    lines = [f"{f'{len(runs)} runs':62}    {'wanted':>8} {'median':>10} {'least':>10} {'most':>10}  runs"]
    for row in zip(*rows, strict=True):
        first, figures = row[0], [run.figure for run in row]
        middle = median(figures)
        spread = " ".join(f"{v:10.2f}" for v in (middle, min(figures), max(figures)))
        runs_met = f"{sum(first.met(v) for v in figures)} of {len(runs)}"
        verdict = "reached" if first.met(middle) else "MISSED"
        lines.append(
            f"{first.what:62} {first.relation:2} {first.wanted:8.2f} {spread}  {runs_met}  {verdict}"
        )
    return "\n".join(lines)
