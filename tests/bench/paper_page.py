"""Show the statements of `gait paper`, and record them: tests/bench/results/paper.md.

paper_page.py build/paper/paper.json [--record]
"""

from __future__ import annotations

import argparse
import csv
import json
from pathlib import Path
from typing import Any

import table
from facts import facts

from gait.paper.tracking import CRITERION
from gait.paper.verdicts import KINDS, MOSTLY, kind

HEAD = "| --- | --: | --: | --: | --- |"
NOTE = """{facts}

The page itself, build/paper/paper.html, has the pictures and all choices that the papers leave open. It was
made from CMU's walks and motions and the outdoor clip with joints marked by hand. Theirs: what the paper
reports. Literal: the paper's algorithm as printed, with misprints corrected. Ours: the package's default
method on the same data. {verdicts}.

The target for the paper's filter on seven clips of real motion: {most} of 10 runs stay on the person, and the
error is below that of the filter's own mean cycle running free, without images. It is met on {reached} of
{clips} clips ([paper_mode](paper_mode.md), recorded separately; outdoors there is no 3-D truth):

{table}

A run stays on the person, there and on the page, if {criterion}.

For the outdoor clip, the page learns its model from the recordings and uses about one mark per frame;
paper_mode uses the shipped model and all clear marks. [paper_terms](paper_terms.md) shows which term of the
likelihood prefers a motionless body on the background, and [paper_readings](paper_readings.md) which readings
of the equations were tried."""


def counted(verdicts: list[str]) -> str:
    """Return the number of verdicts of each kind."""
    kinds = [kind(each) for each in verdicts]
    return ", ".join(f"{kinds.count(each)} {each}" for each in KINDS)


def seven() -> dict[str, Any]:
    """Return the recorded results on the seven clips with the targets."""
    with open(table.RESULTS / "paper_mode.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    lines, reached = ["| clip | on the person | error, mm | target, below mm | met |", HEAD], 0
    for row in rows:
        held, count = map(int, row["held"].split(" of "))
        near = not row["root mm"] or float(row["root mm"]) < float(row["free mm"])
        both = held >= MOSTLY * count and near
        reached += both
        numbers = f"{row['root mm'] or '-'} | {row['free mm'] or '-'}"
        lines.append(f"| {row['clip']} | {row['held']} | {numbers} | {'yes' if both else 'no'} |")
    return {"table": "\n".join(lines), "reached": reached, "clips": len(rows), "most": round(10 * MOSTLY)}


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
    made = facts()
    note = NOTE.format(facts=made, verdicts=verdicts, criterion=CRITERION, **seven())
    table.publish("paper", title, head, whole, note)


if __name__ == "__main__":
    main()
