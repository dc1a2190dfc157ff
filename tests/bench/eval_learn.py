#!/usr/bin/env python3
"""All evaluations of learning, one after another; their tables joined in tests/bench/results/learn.md.

    make eval-learn

Each part is a script of its own that publishes tables (table.py); a part that fails is named at the end.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

import table
from facts import facts

from gait.files import replacing

HERE = Path(__file__).resolve().parent
PARTS = ("learn_period.py", "learn_impute.py", "learn_floor.py")
WITH_MOCAP = ("learn_impute.py", "learn_floor.py")  # parts that want the folder of walks as argument
JOINED = "learn.md"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("mocap", type=Path, help="folder of .amc walks")
    parser.add_argument("--only", choices=PARTS, action="append", help="run this part only (may be repeated)")
    args = parser.parse_args()
    begun, tables, failed = time.perf_counter(), [], []
    for part in args.only or PARTS:
        print(f"== {part}", flush=True)
        before = _stamps()
        command = [sys.executable, str(HERE / part), *([str(args.mocap)] if part in WITH_MOCAP else [])]
        if subprocess.run(command, check=False).returncode:
            failed.append(part)
        fresh = [path for path, stamp in _stamps().items() if before.get(path) != stamp]
        tables = [path for path in tables if path not in fresh] + fresh
    if not args.only:
        took = f"Took {time.perf_counter() - begun:.0f} s."
        head = ["# Evaluation of learning", facts("make eval-learn"), took]
        head += [f"**Failed: {', '.join(failed)}.**"] if failed else []
        with replacing(table.RESULTS / JOINED) as path:
            path.write_text("\n\n".join([*head, *[t.read_text().strip() for t in tables]]) + "\n")
    if failed:
        print(f"eval-learn: failed: {', '.join(failed)}; run that script by itself", file=sys.stderr)
    return bool(failed)


def _stamps() -> dict[Path, int]:
    """Published tables and when they were written, oldest first."""
    found = {p: p.stat().st_mtime_ns for p in table.RESULTS.glob("*.md") if p.name != JOINED}
    return dict(sorted(found.items(), key=lambda item: item[1]))


if __name__ == "__main__":
    sys.exit(main())
