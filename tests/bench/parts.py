"""An evaluation in parts: scripts that publish tables, joined on one page that names what made each table.

Each part is a separate script that publishes tables (table.py) and fails if a bound is missed.  All parts are
run; those that fail are named on the page and at the end.  `--only PART` runs one part and joins its tables
with the latest ones of the others; the page names the commit that made each.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import table
from facts import facts

from gait.io.files import replacing

HERE = Path(__file__).resolve().parent


class Run(NamedTuple):
    """What a part published (names of tables), how it was made, in how many seconds, and what failed."""

    tables: str
    made: str
    seconds: int
    failed: str


class Evaluation(NamedTuple):
    """Parts that make one page.

    Attributes
    ----------
    name : str
        Target of make; the page is results/`page`.md, the runs of its parts results/`page`_runs.csv.
    page, title : str
    parts : mapping of str to sequence of str
        Scripts in this folder, in the order of the page, and their arguments.
    """

    name: str
    page: str
    title: str
    parts: Mapping[str, Sequence[str]]

    def main(self, only: Sequence[str] | None) -> int:
        """Run all parts, or some of them; exit code 1 if one fails."""
        runs, chosen = self.known(), only or list(self.parts)
        for part in chosen:
            print(f"== {part}", flush=True)
            runs[part] = self._run(part, runs.get(part))
            self.write(runs)
        failed = [f"{part} ({runs[part].failed})" for part in chosen if runs[part].failed]
        if failed:
            print(f"{self.name}: failed: {', '.join(failed)}", file=sys.stderr)
        return bool(failed)

    def _run(self, part: str, before: Run | None) -> Run:
        stamps, begun = self._stamps(), time.perf_counter()
        code = subprocess.run([sys.executable, str(HERE / part), *self.parts[part]], check=False).returncode
        fresh = [path.stem for path, stamp in self._stamps().items() if stamps.get(path) != stamp]
        failed = ("a bound is missed" if fresh else "no table: run it by itself") if code else ""
        if failed and not fresh and before:  # the tables that it published stay on the page
            return before._replace(failed=f"{failed}; its tables are older")
        return Run(" ".join(fresh), facts(f"make {self.name}"), round(time.perf_counter() - begun), failed)

    def _stamps(self) -> dict[Path, int]:
        """Published tables and when they were written, oldest first."""
        found = {p: p.stat().st_mtime_ns for p in table.RESULTS.glob("*.md") if p.stem != self.page}
        return dict(sorted(found.items(), key=lambda item: item[1]))

    def known(self) -> dict[str, Run]:
        """Runs of the parts that were recorded, in their order."""
        path = table.RESULTS / f"{self.page}_runs.csv"
        if not path.is_file():
            return {}
        with path.open(newline="") as file:
            rows = list(csv.DictReader(file))
        return {r["part"]: Run(r["tables"], r["made"], int(r["seconds"]), r["failed"]) for r in rows}

    def write(self, runs: Mapping[str, Run]) -> None:
        """Record the runs and join the tables, whatever part was run last."""
        rows = [(part, runs[part]) for part in self.parts if part in runs]
        with replacing(table.RESULTS / f"{self.page}_runs.csv") as path, path.open("w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(("part", *Run._fields))
            writer.writerows((part, *run) for part, run in rows)
        head = [f"# {self.title}"]
        for made in dict.fromkeys(run.made for _, run in rows):
            took = ", ".join(f"{part} {run.seconds} s" for part, run in rows if run.made == made)
            head.append(f"{made} Took: {took}.")
        failed = [f"{part} ({run.failed})" for part, run in rows if run.failed]
        head += [f"**Failed: {', '.join(failed)}.**"] if failed else []
        tables = [table.RESULTS / f"{name}.md" for _, run in rows for name in run.tables.split()]
        pages = [*head, summary(tables), *(t.read_text().strip() for t in tables)]
        with replacing(table.RESULTS / f"{self.page}.md") as path:
            path.write_text("\n\n".join(pages) + "\n")


def options(text: str, parts: Sequence[str]) -> argparse.ArgumentParser:
    """Command line of an evaluation described by `text`."""
    parser = argparse.ArgumentParser(description=text.split("\n")[0])
    parser.add_argument("--only", choices=parts, action="append", help="run this part only (may be repeated)")
    return parser


def summary(tables: Sequence[Path]) -> str:
    """Bounds kept and missed by measure, from the tables that have a column `met`."""
    counts: dict[str, Counter[str]] = {}
    for path in tables:
        with path.with_suffix(".csv").open(newline="") as file:
            for row in csv.DictReader(file):
                name = row.get("measure") or path.stem.partition("_")[2]
                if row.get("met", "").lower() in ("yes", "no"):
                    counts.setdefault(name, Counter())[row["met"].lower()] += 1
    order = sorted(counts, key=_place)
    cells = [[name, str(counts[name]["yes"]), str(counts[name]["no"])] for name in order]
    head = ["measure", "bounds kept", "missed"]
    return "## Bounds by measure\n\n" + table.markdown(head, cells, [False, True, True])


def _place(measure: str) -> tuple[bool, str, int, str]:
    """Sort key: numbered measures (F4, L2) by number, those by style after their own, then all others."""
    code = measure.split()[0]
    numbered = code[:1].isalpha() and code[1:].isdigit()
    return (False, code[0], int(code[1:]), measure) if numbered else (True, "", 0, "")
