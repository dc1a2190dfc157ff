#!/usr/bin/env python3
"""coverage.py BUILD [--least-library P] [--least-tools P] [--all] [--record]: branches taken, by gcov.

Counts of a source that was compiled several times (kernels by instruction set, parts of the daemon inside
tests) are added up.  Prints each file of which less than 97 % is taken, with --all every file, and fails
below the least shares.  --record writes the shares of each folder to tests/bench/results.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PARTS = {"library": "libgait/src/", "tools": "tools/trackd/"}
AT_ONCE = 100  # files given to one gcov
NOTE = (
    "gcc and gcov; kernels with -O1, all else with -O0. Tests: those in C, the kept inputs of the fuzz "
    "targets, and the Python tests that run the daemon. A branch is one outcome of a condition; those of an "
    "instruction set that the machine lacks are not taken. Targets: library 97 %, tools 92 %."
)


def merged(build: Path) -> tuple[dict[str, dict], dict[str, dict]]:
    """Counts by file: of (line, index) of a branch, and of a line."""
    branches: dict[str, dict] = defaultdict(lambda: defaultdict(int))
    lines: dict[str, dict] = defaultdict(lambda: defaultdict(int))
    data = sorted(str(file) for file in build.rglob("*.gcda"))
    for first in range(0, len(data), AT_ONCE):
        words = [
            "gcov",
            "--json-format",
            "--stdout",
            "--branch-probabilities",
            *data[first : first + AT_ONCE],
        ]
        done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT, check=True)
        for text in done.stdout.splitlines():
            for file in json.loads(text)["files"]:
                name = Path(file["file"])
                name = (
                    str(name.resolve().relative_to(ROOT))
                    if (ROOT / name).resolve().is_relative_to(ROOT)
                    else ""
                )
                if not name.startswith(tuple(PARTS.values())):
                    continue
                for line in file["lines"]:
                    lines[name][line["line_number"]] += line["count"]
                    for index, branch in enumerate(line["branches"]):
                        branches[name][line["line_number"], index] += branch["count"]
    return branches, lines


def share(counts: dict) -> float:
    """Per cent of them that are not 0."""
    return 100.0 * sum(n > 0 for n in counts.values()) / len(counts) if counts else 100.0


def folders(branches: dict[str, dict]) -> set[str]:
    """Folders of the library's sources."""
    return {name.split("/")[2] for name in branches if name.startswith(PARTS["library"])}


def row(folder: str, branches: dict[str, dict], lines: dict[str, dict]) -> tuple[str, int, float, float]:
    """Folder, number of branches, per cent taken, per cent of lines run."""

    def under(counts: dict[str, dict]) -> dict:
        return {
            (name, key): n for name in counts if name.startswith(folder) for key, n in counts[name].items()
        }

    of = under(branches)
    return folder, len(of), share(of), share(under(lines))


def record(rows: list[tuple[str, int, float, float]]) -> None:
    """Write the page of the results."""
    sys.path.insert(0, str(ROOT / "tests/bench"))
    import table
    from facts import facts

    note = f"{facts('make coverage ARGS=--record')}\n\n{NOTE}"
    head = ["folder", "branches", "% taken", "% of lines"]
    table.publish("coverage", "What the tests of library and daemon run", head, rows, note)


def main() -> int:
    """Print; exit code 1 if a part is below its least share."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("build", type=Path)
    options.add_argument("--least-library", type=float, default=0.0)
    options.add_argument("--least-tools", type=float, default=0.0)
    options.add_argument("--all", action="store_true")
    options.add_argument("--record", action="store_true")
    options.add_argument(
        "--missing", metavar="FILE", help="print the lines of this file with branches not taken"
    )
    args = options.parse_args()
    branches, lines = merged(args.build)
    for name in sorted(branches):
        taken = share(branches[name])
        if args.all or taken < 97.0:
            missing = sum(n == 0 for n in branches[name].values())
            of_lines = share(lines[name])
            print(f"{name:46} {taken:5.1f} % of branches, {missing:4} missing, {of_lines:5.1f} % of lines")
    if args.missing:
        missed = sorted({line for (line, _), n in branches[args.missing].items() if n == 0})
        text = (ROOT / args.missing).read_text().splitlines()
        print(*(f"{line:5} {text[line - 1]}" for line in missed), sep="\n")
    rows = [row(f"libgait/src/{part}/", branches, lines) for part in sorted(folders(branches))]
    wholes = {part: row(folder, branches, lines) for part, folder in PARTS.items()}
    for part, (_, count, taken, of_lines) in wholes.items():
        print(f"coverage of {part}: {taken:.1f} % of {count} branches, {of_lines:.1f} % of lines")
    if args.record:
        record([*rows, *wholes.values()])
    low = wholes["library"][2] < args.least_library or wholes["tools"][2] < args.least_tools
    return int(low)


if __name__ == "__main__":
    sys.exit(main())
