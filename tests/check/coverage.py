#!/usr/bin/env python3
"""coverage.py BUILD [--least-library P] [--least-tools P] [--all]: branches that tests have taken, by gcov.

Counts of a source that was compiled several times (kernels by instruction set, parts of the daemon inside
tests) are added up.  Prints each file of which less than 97 % is taken, with --all every file, and fails
below the least shares.
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


def main() -> int:
    """Print; exit code 1 if a part is below its least share."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("build", type=Path)
    options.add_argument("--least-library", type=float, default=0.0)
    options.add_argument("--least-tools", type=float, default=0.0)
    options.add_argument("--all", action="store_true")
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
    low = False
    for part, folder in PARTS.items():
        of = {
            (name, key): n
            for name in branches
            if name.startswith(folder)
            for key, n in branches[name].items()
        }
        by_line = {
            (name, key): n for name in lines if name.startswith(folder) for key, n in lines[name].items()
        }
        least = args.least_library if part == "library" else args.least_tools
        print(f"coverage of {part}: {share(of):.1f} % of {len(of)} branches, {share(by_line):.1f} % of lines")
        low = low or share(of) < least
    return int(low)


if __name__ == "__main__":
    sys.exit(main())
