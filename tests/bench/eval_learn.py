#!/usr/bin/env python3
"""All evaluations of learning, one after another; their tables joined in tests/bench/results/learn.md.

    make eval-learn

Each part is a script of its own that publishes tables (table.py) and fails if a bound is missed.  All parts
are run; those that fail are named in learn.md and at the end.  `--only PART` runs one and joins it with the
last tables of the others; learn.md names which commit made which.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import table
from facts import facts

from gait.io.files import replacing

HERE = Path(__file__).resolve().parent
PARTS = (
    "learn_period.py",
    "learn_impute.py",
    "learn_floor.py",
    "learn_lengths.py",
    "learn_size.py",
    "learn_speed.py",
)
WITH_MOCAP = PARTS[1:]  # parts that want the folder of walks as argument
JOINED, RUNS = "learn.md", "learn_runs.csv"


class Run(NamedTuple):
    """What a part published (names of tables), made with what, in how many seconds, and what failed."""

    tables: str
    made: str
    seconds: int
    failed: str


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("mocap", type=Path, help="folder of .amc walks")
    parser.add_argument("--only", choices=PARTS, action="append", help="run this part only (may be repeated)")
    args = parser.parse_args()
    runs = _known()
    for part in args.only or PARTS:
        print(f"== {part}", flush=True)
        runs[part] = _run(part, args.mocap)
        _write(runs)
    failed = [f"{part} ({runs[part].failed})" for part in args.only or PARTS if runs[part].failed]
    if failed:
        print(f"eval-learn: failed: {', '.join(failed)}", file=sys.stderr)
    return bool(failed)


def _run(part: str, mocap: Path) -> Run:
    before, begun = _stamps(), time.perf_counter()
    command = [sys.executable, str(HERE / part), *([str(mocap)] if part in WITH_MOCAP else [])]
    code = subprocess.run(command, check=False).returncode
    fresh = [path.stem for path, stamp in _stamps().items() if before.get(path) != stamp]
    failed = ("a bound is missed" if fresh else "no table: run it by itself") if code else ""
    return Run(" ".join(fresh), facts("make eval-learn"), round(time.perf_counter() - begun), failed)


def _known() -> dict[str, Run]:
    """Runs of the parts that were recorded, in their order."""
    path = table.RESULTS / RUNS
    if not path.is_file():
        return {}
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {r["part"]: Run(r["tables"], r["made"], int(r["seconds"]), r["failed"]) for r in rows}


def _write(runs: dict[str, Run]) -> None:
    """Record the runs and join their tables, whatever part was run last."""
    rows = [(part, runs[part]) for part in PARTS if part in runs]
    with replacing(table.RESULTS / RUNS) as path, path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("part", *Run._fields))
        writer.writerows((part, *run) for part, run in rows)
    tables = [table.RESULTS / f"{name}.md" for _, run in rows for name in run.tables.split()]
    made = dict.fromkeys(run.made for _, run in rows)
    head = ["# Evaluation of learning"]
    for facts_of in made:
        parts = ", ".join(f"{part} {run.seconds} s" for part, run in rows if run.made == facts_of)
        head.append(f"{facts_of} Took: {parts}.")
    failed = [f"{part} ({run.failed})" for part, run in rows if run.failed]
    head += [f"**Failed: {', '.join(failed)}.**"] if failed else []
    pages = [*head, _summary(tables), *(t.read_text().strip() for t in tables)]
    with replacing(table.RESULTS / JOINED) as path:
        path.write_text("\n\n".join(pages) + "\n")


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
