"""Show the statements of `gait paper`, and record them: tests/bench/results/paper.md.

paper_page.py build/paper/paper.json [--record]
"""

from __future__ import annotations

import argparse
import csv
import json
from pathlib import Path

import table
from facts import facts

from gait.paper.verdicts import KINDS, kind

NOTE = """{facts}

What stands on the page build/paper/paper.html, which has the pictures and every choice that the papers leave
open. Walks and motions: CMU's; the clip: the outdoor one, with joints marked by hand. Theirs: what the paper
states. Literal: its algorithm as printed, errors of print resolved. Ours: the package's default, on the same
data. {verdicts}.

The paper's filter on the target's seven clips of real motion ([paper_mode](paper_mode.md), recorded apart):
runs that end on the person, and the error against that of its own mean cycle running on without any image:
{clips}. By term,
what prefers rest on the background: [paper_terms](paper_terms.md); the readings of equations that were tried:
[paper_readings](paper_readings.md)."""


def counted(verdicts: list[str]) -> str:
    """Return how many verdicts there are of each kind."""
    kinds = [kind(each) for each in verdicts]
    return ", ".join(f"{kinds.count(each)} {each}" for each in KINDS)


def seven() -> str:
    """Return what the recorded runs on the target's clips came to."""
    with open(table.RESULTS / "paper_mode.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return "; ".join(
        f"{row['clip']} in {row['held']} runs (reported as lost: {row['lost, left']} that leave, "
        f"{row['lost, held']} that hold)"
        + (
            f", {row['root mm']} against {row['free mm']} mm"
            if row["root mm"]
            else ", without a truth in space"
        )
        for row in rows
    )


def main() -> None:
    """Show verdicts; record all."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("statements", type=Path, help="what gait paper --json printed")
    parser.add_argument("--record", action="store_true", help="publish the table")
    args = parser.parse_args()
    found = json.loads(args.statements.read_text(encoding="utf-8"))
    rows = [(p.split()[0], name, each) for p, entries in found.items() for name, each in entries.items()]
    title = "Both papers, figure by figure"
    if not args.record:
        table.show(title, ("paper", "figure", "verdict"), [(p, name, e["verdict"]) for p, name, e in rows])
        return
    head = ("paper", "figure", *rows[0][2])
    whole = [(p, name, *each.values()) for p, name, each in rows]
    verdicts = counted([e["verdict"] for _, _, e in rows])
    note = NOTE.format(facts=facts("make paper ARGS=--record"), verdicts=verdicts, clips=seven())
    table.publish("paper", title, head, whole, note)


if __name__ == "__main__":
    main()
