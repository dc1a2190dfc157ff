#!/usr/bin/env python3
"""Change each equation of both papers once; a test that is about its meaning must fail.

    make mutants

A mutant is one changed line in a copy of the sources.  The tests named with it are built and run there; they
state what the equation means (golden digests are not among them, because they notice every change).  The list
is in mutant_list.py, the table goes to tests/bench/results/mutants.md; exit code 1 if a mutant survives.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import table
from facts import facts
from mutant_list import MUTANTS, Mutant

from gait.progress import progress

ROOT = Path(__file__).resolve().parents[2]
LIMIT = 1800  # seconds for a test; a busy machine takes ten times as long as an idle one


class Copy:
    """A copy of the sources in its own folder, in which mutants are tried."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        shutil.rmtree(folder, ignore_errors=True)
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout
        for name in filter(None, listed.decode().split("\0")):
            if (ROOT / name).is_file():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, folder / name)
        (folder / ".venv").symlink_to(ROOT / ".venv")

    def verdict(self, mutant: Mutant) -> tuple[str, str]:
        """Try a mutant: "caught" and the test, "survived", "does not build", or "does not end"."""
        path = self.folder / mutant.file
        text = path.read_text()
        path.write_text(text.replace(mutant.before, mutant.after))
        try:
            for test in mutant.tests.split():
                c_test = ".py" not in test
                target = f"unit/{test}" if c_test else "libgait.so"
                if not self._run("make", "--no-print-directory", f"build/release/{target}"):
                    return "does not build", test
                if not (self._run(f"build/release/unit/{test}") if c_test else self._pytest(test)):
                    return "caught", test
            return "survived", mutant.tests
        except subprocess.TimeoutExpired:
            return "does not end", test
        finally:
            path.write_text(text)

    def _pytest(self, test: str) -> bool:
        options = ["-q", "-x", "-c", "python/pyproject.toml", "--rootdir", ".", f"tests/python/{test}"]
        return self._run(sys.executable, "-m", "pytest", *options)

    def _run(self, *command: str) -> bool:
        env = {**os.environ, "PYTHONPATH": str(self.folder / "python")}
        done = subprocess.run(
            command, cwd=self.folder, env=env, capture_output=True, timeout=LIMIT, check=False
        )
        return done.returncode == 0


def stale(mutants: tuple[Mutant, ...] = MUTANTS) -> Iterator[Mutant]:
    """Mutants whose line is not in the sources exactly once, or whose tests are missing."""
    for mutant in mutants:
        once = (ROOT / mutant.file).read_text().count(mutant.before) == 1
        if not once or not all(map(_is_there, mutant.tests.split())):
            yield mutant


def _is_there(test: str) -> bool:
    """Whether the file of a test exists, and the function named in it."""
    name, _, function = test.partition("::")
    path = ROOT / "tests" / (f"python/{name}" if name.endswith(".py") else f"unit/{name}.c")
    return path.is_file() and f"def {function}(" * bool(function) in path.read_text()


def main() -> int:
    """Try all mutants, or some; exit code 1 if one survives, 2 if the list does not match the sources."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument(
        "--only", default="", help="only mutants whose equation begins with this; records nothing"
    )
    args = parser.parse_args()
    for mutant in stale():
        print(f"mutants: {mutant.file}: no single line {mutant.before!r}, or a test is gone", file=sys.stderr)
        return 2
    chosen = [m for m in MUTANTS if m.equation.startswith(args.only)]
    begun, copy, rows = time.perf_counter(), Copy(ROOT / "build" / "mutants"), []
    with progress("mutants", len(chosen)) as done:
        for mutant in chosen:
            verdict, test = copy.verdict(mutant)
            rows.append([mutant.equation, mutant.change, Path(mutant.file).name, verdict, test])
            done(len(rows))
    columns = ["equation", "change", "file", "verdict", "test"]
    note = (
        f"{facts()} Took {time.perf_counter() - begun:.0f} s.\n\nEach equation of both papers "
        "(O: Ormoneit et al. 2000, L: Leventon & Freeman 1998) changed once, and the test that noticed. No "
        "golden digest is among the tests."
    )
    if args.only:
        table.show("Mutants", columns, rows)
    else:
        table.publish("mutants", "Mutants", columns, rows, note)
    return int(any(row[3] != "caught" for row in rows))


if __name__ == "__main__":
    sys.exit(main())
