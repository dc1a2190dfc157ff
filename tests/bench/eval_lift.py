#!/usr/bin/env python3
"""All evaluations of lifting, one after another; their tables joined in tests/bench/results/lift.md.

    make eval-lift

Each part is a script of its own that publishes tables (table.py) and fails if a bound is missed.  The exact
identities (F1-F3, F5-F7) are tests (decisions.md states which), speeds are make bench-lift.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

import table
from facts import facts

from gait.io.files import replacing

HERE = Path(__file__).resolve().parent
PARTS = {
    "lift_mocap.py": ("lift_mocap", "lift_missing"),
    "lift_modes.py": ("lift_modes",),
    "lift_volume.py": ("lift_volume",),
    "lift_directions.py": ("lift_directions",),
    "lift_tracks.py": ("lift_dev", "lift_balancing"),
    "lift_parts.py": ("lift_parts",),
    "lift_sides.py": ("lift_sides",),
    "lift_stream.py": ("lift_stream", "lift_unknown"),
    "lift_people.py": ("lift_people",),
    "lift_images.py": ("lift_sticks", "lift_clips", "lift_outdoor"),
    "tracks_term.py": ("tracks_term",),
}


def main() -> int:
    """Run the parts; 1 if one fails."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--only", choices=PARTS, action="append", help="run this part only (may be repeated)")
    args = parser.parse_args()
    missed, took = [], []
    for part in args.only or PARTS:
        print(f"== {part}", flush=True)
        begun = time.perf_counter()
        code = subprocess.run([sys.executable, str(HERE / part)], check=False).returncode
        took.append(f"{part} {time.perf_counter() - begun:.0f} s")
        missed += [part] if code else []
    _join(took, missed)
    if missed:
        print(f"eval-lift: failed: {', '.join(missed)}", file=sys.stderr)
    return bool(missed)


def _join(took: list[str], missed: list[str]) -> None:
    """Join the tables that are there into one page."""
    tables = [table.RESULTS / f"{name}.md" for names in PARTS.values() for name in names]
    head = ["# Evaluation of lifting", facts("make eval-lift"), f"Took: {', '.join(took)}."]
    head += [f"**A bound is missed in: {', '.join(missed)}.**"] if missed else []
    pages = [*head, *[path.read_text().strip() for path in tables if path.is_file()]]
    with replacing(table.RESULTS / "lift.md") as path:
        path.write_text("\n\n".join(pages) + "\n")


if __name__ == "__main__":
    sys.exit(main())
