#!/usr/bin/env python3
"""All evaluations of learning, one after another; their tables joined in tests/bench/results/learn.md.

    make eval-learn

Each part is a script of its own that publishes tables (table.py) and fails if a bound is missed.  All parts
are run; those that fail are named in learn.md and at the end.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import table
from facts import facts

from gait.files import replacing

HERE = Path(__file__).resolve().parent
PARTS = ("learn_period.py", "learn_impute.py", "learn_floor.py", "learn_size.py", "learn_speed.py")
WITH_MOCAP = PARTS[1:]  # parts that want the folder of walks as argument
JOINED = "learn.md"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("mocap", type=Path, help="folder of .amc walks")
    parser.add_argument("--only", choices=PARTS, action="append", help="run this part only (may be repeated)")
    args = parser.parse_args()
    tables: list[Path] = []
    missed: list[str] = []
    took: list[str] = []
    for part in args.only or PARTS:
        print(f"== {part}", flush=True)
        before, begun = _stamps(), time.perf_counter()
        command = [sys.executable, str(HERE / part), *([str(args.mocap)] if part in WITH_MOCAP else [])]
        code = subprocess.run(command, check=False).returncode
        took.append(f"{part} {time.perf_counter() - begun:.0f} s")
        fresh = [path for path, stamp in _stamps().items() if before.get(path) != stamp]
        tables = [path for path in tables if path not in fresh] + fresh
        if code:
            missed.append(f"{part} ({'a bound is missed' if fresh else 'no table: run it by itself'})")
    if not args.only:
        head = ["# Evaluation of learning", facts("make eval-learn"), f"Took: {', '.join(took)}."]
        head += [f"**Failed: {', '.join(missed)}.**"] if missed else []
        pages = [*head, _summary(tables), *[t.read_text().strip() for t in tables]]
        with replacing(table.RESULTS / JOINED) as path:
            path.write_text("\n\n".join(pages) + "\n")
    if missed:
        print(f"eval-learn: failed: {', '.join(missed)}", file=sys.stderr)
    return bool(missed)


def _summary(tables: list[Path]) -> str:
    """Bounds kept and missed by measure, from the tables that have a column `met`."""
    counts: dict[str, Counter[str]] = {}
    for path in tables:
        with path.with_suffix(".csv").open(newline="") as file:
            for row in csv.DictReader(file):
                name = row.get("measure") or path.stem.removeprefix("learn_")
                if row.get("met") in ("yes", "NO"):
                    counts.setdefault(name, Counter())[row["met"]] += 1
    order = sorted(counts, key=_place)
    cells = [[name, str(counts[name]["yes"]), str(counts[name]["NO"])] for name in order]
    head = ["measure", "bounds kept", "missed"]
    return "## Bounds by measure\n\n" + table.markdown(head, cells, [False, True, True])


def _place(measure: str) -> tuple[bool, int, str]:
    """L measures by their number first, those by style after their own, then all others."""
    code = measure.split()[0]
    return (False, int(code[1:]), measure) if code[0] == "L" else (True, 0, "")


def _stamps() -> dict[Path, int]:
    """Published tables and when they were written, oldest first."""
    found = {p: p.stat().st_mtime_ns for p in table.RESULTS.glob("*.md") if p.name != JOINED}
    return dict(sorted(found.items(), key=lambda item: item[1]))


if __name__ == "__main__":
    sys.exit(main())
