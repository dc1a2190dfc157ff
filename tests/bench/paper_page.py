"""Show the statements of `gait paper`, and record them: tests/bench/results/paper.md.

paper_page.py build/paper/paper.json [--record]
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import table
from facts import facts

NOTE = """{facts}

What stands on the page build/paper/paper.html, which has the pictures and every choice that the papers leave
open. Walks and motions: CMU's; the clip: the outdoor one, with joints marked by hand. Theirs: what the paper
states. Literal: its algorithm as printed, errors of print resolved. Ours: the package's default, on the same
data."""


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
    table.publish("paper", title, head, whole, NOTE.format(facts=facts("make paper ARGS=--record")))


if __name__ == "__main__":
    main()
