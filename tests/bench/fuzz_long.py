#!/usr/bin/env python3
"""Many executions of every fuzz target by libFuzzer.

    fuzz_long.py [--runs N] [--seconds S] [--seed N] [--only NAME] [--keep] [--record | --add]

``make fuzz-long`` builds them.  With --keep, inputs that reach branches which no kept input reaches are added
to tests/fuzz/corpus; they run with every ``make test``.  With --record, the row of a target replaces its
earlier one; with --add, the run is added to that row, so that a million executions can be made in parts.
"""

from __future__ import annotations

import argparse
import csv
import fcntl
import hashlib
import re
import resource
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import table
from facts import commit, facts

ROOT = Path(__file__).resolve().parents[2]
BUILT, FOUND, CORPUS = ROOT / "build/fuzz/fuzz", ROOT / "build/fuzz/found", ROOT / "tests/fuzz/corpus"
LONGEST = 4096  # bytes of an input
KEPT_BYTES, KEPT_FILES = 2048, 40  # largest size of a kept input, and of the kept inputs of one target
HEAD = ["target", "executions", "branches", "CPU s", "a CPU second", "MB", "faults", "runs"]
WANTED = 1_000_000


def cpu_seconds() -> float:
    """CPU time of the processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def fuzz(name: str, runs: int, seed: int, seconds: int) -> list[Any]:
    """Run one target; the cells of HEAD after its name."""
    found, source = FOUND / name, commit()
    limits = [f"--runs {runs}"] * (runs != WANTED) + [f"--seconds {seconds}"] * (seconds > 0)
    found.mkdir(parents=True, exist_ok=True)
    options = {"runs": runs, "seed": seed, "max_total_time": seconds, "max_len": LONGEST, "timeout": 60}
    words = [f"-{key}={value}" for key, value in options.items()] + ["-print_final_stats=1"]
    began = cpu_seconds()
    done = subprocess.run(
        [str(BUILT / f"fuzz_{name}"), *words, f"-artifact_prefix={ROOT}/build/fuzz/", found, CORPUS / name],
        cwd=ROOT,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    if done.returncode:
        print(done.stderr[-4000:], file=sys.stderr)
    reached = [int(n) for n in re.findall(r"cov: (\d+)", done.stderr)]
    stats = dict(re.findall(r"stat::(\w+):\s+(\d+)", done.stderr))
    executed = int(stats.get("number_of_executed_units", 0))
    used = cpu_seconds() - began
    return [
        executed,
        reached[-1] if reached else 0,
        round(used),
        round(executed / used),
        int(stats.get("peak_rss_mb", 0)),
        int(done.returncode != 0),
        " ".join([*limits, f"--seed {seed} at {source}"]),
    ]


def together(name: str, run: list[Any], before: list[str] | None) -> list[Any]:
    """Cells of a target: those of a run, with those of the runs before it."""
    if not before:
        return [name, *run]
    executed, branches, used, _, memory, faults = (int(n) for n in before[1:-1])
    executed, used = executed + run[0], used + run[2]
    rest = [max(memory, run[4]), faults + run[5], f"{before[-1]}; {run[-1]}"]
    return [name, executed, max(branches, run[1]), used, round(executed / max(used, 1)), *rest]


def keep(name: str) -> None:
    """Add inputs for branches that the kept inputs do not reach, the smallest input for each."""
    merged = ROOT / "build/fuzz/merged" / name
    shutil.rmtree(merged, ignore_errors=True)
    merged.mkdir(parents=True)
    words = ["-merge=1", f"-max_len={KEPT_BYTES}", merged, CORPUS / name, FOUND / name]
    subprocess.run([BUILT / f"fuzz_{name}", *words], cwd=ROOT, capture_output=True, check=True)
    known = {file.read_bytes() for file in (CORPUS / name).iterdir()}
    left = KEPT_FILES - len(known)
    new = sorted((file.read_bytes() for file in merged.iterdir()), key=len)
    for data in [data for data in new if data not in known][: max(left, 0)]:
        (CORPUS / name / hashlib.sha256(data).hexdigest()[:12]).write_bytes(data)


def recorded() -> dict[str, list[str]]:
    """Rows of the recorded page, by target."""
    page = table.RESULTS / "fuzz.csv"
    if not page.exists():
        return {}
    with page.open(newline="") as file:
        head, *rows = csv.reader(file)
    return {row[0]: row for row in rows} if head == HEAD else {}


def main() -> int:
    """Fuzz, print; exit code 1 if anything was found."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--runs", type=int, default=WANTED)
    options.add_argument("--seconds", type=int, default=0, help="longest time for each target; 0: no limit")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--only", action="append", metavar="NAME")
    options.add_argument("--keep", action="store_true")
    options.add_argument("--record", action="store_true")
    options.add_argument("--add", action="store_true")
    args = options.parse_args()
    title, faults = "Fuzzing", 0
    note = (
        f"{facts()}\n\nlibFuzzer on clang's address and undefined-behaviour sanitizers, one "
        f"process, inputs of at most {LONGEST} bytes. Wanted are {WANTED:,} executions of each target; the "
        "table states how many were run, by which options (`ARGS='--only TARGET --add ...'`) and at which "
        "commit; executions and CPU time of several runs are added up. A fault is a report of a sanitizer, a "
        "target that aborts because a promise is broken, 60 s for one input, or 2 GB of memory."
    )
    rows: dict[str, list[Any]] = {}
    for name in args.only or sorted(folder.name for folder in CORPUS.iterdir()):
        run = fuzz(name, args.runs, args.seed, args.seconds)
        faults += run[HEAD.index("faults") - 1]
        if args.keep:
            keep(name)
        if not (args.record or args.add):
            rows[name] = together(name, run, None)
            print(*rows[name], flush=True)
            continue
        with Path(__file__).open() as own:
            fcntl.flock(own, fcntl.LOCK_EX)  # runs that end together wait for each other
            rows = recorded()  # with those of runs that ended meanwhile
            rows[name] = together(name, run, rows.get(name) if args.add else None)
            table.publish("fuzz", title, HEAD, [rows[each] for each in sorted(rows)], note)
    if not (args.record or args.add):
        table.show(title, HEAD, rows.values())
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
