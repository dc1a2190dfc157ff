#!/usr/bin/env python3
"""Many executions of every fuzz target by libFuzzer.

    fuzz_long.py [--runs N] [--only NAME] [--keep] [--record]

``make fuzz-long`` builds them.  With --keep, inputs that reach branches which no kept input reaches are added
to tests/fuzz/corpus; they run with every ``make test``.  With --record, the row of a target replaces its
earlier one.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import re
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import table
from facts import commit, facts

ROOT = Path(__file__).resolve().parents[2]
BUILT, FOUND, CORPUS = ROOT / "build/fuzz/fuzz", ROOT / "build/fuzz/found", ROOT / "tests/fuzz/corpus"
LONGEST = 4096  # bytes of an input
KEPT_BYTES, KEPT_FILES = 2048, 40  # largest size of a kept input, and of the kept inputs of one target
HEAD = ["target", "executions", "branches", "CPU s", "a CPU second", "MB", "faults", "seed", "commit"]


def cpu_seconds() -> float:
    """CPU time of the processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def fuzz(name: str, runs: int, seed: int, seconds: int) -> list[object]:
    """Run one target; the cells of HEAD after its name."""
    found, source = FOUND / name, commit()
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
        seed,
        source,
    ]


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
        return {row[0]: row for row in csv.reader(file) if row[:1] != HEAD[:1]}


def main() -> int:
    """Fuzz, print; exit code 1 if anything was found."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--runs", type=int, default=1_000_000)
    options.add_argument("--seconds", type=int, default=0, help="longest time for each target; 0: no limit")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--only", action="append", metavar="NAME")
    options.add_argument("--keep", action="store_true")
    options.add_argument("--record", action="store_true")
    args = options.parse_args()
    title, faults = "Fuzzing", 0
    note = (
        f"{facts('tests/bench/fuzz_long.py --record')}\n\nlibFuzzer on clang's address and "
        f"undefined-behaviour sanitizers, one process, inputs of at most {LONGEST} bytes; "
        f"wanted are {1_000_000:,} executions of each target, the table states how many were run; a fault is "
        "a report of a sanitizer, a target that aborts because a promise is broken, 60 s for one input, or "
        "2 GB of memory."
    )
    rows = recorded() if args.record else {}
    for name in args.only or sorted(folder.name for folder in CORPUS.iterdir()):
        row = [name, *fuzz(name, args.runs, args.seed, args.seconds)]
        faults += row[HEAD.index("faults")]
        rows[name] = row
        if args.keep:
            keep(name)
        if args.record:
            table.publish("fuzz", title, HEAD, [rows[each] for each in sorted(rows)], note)
        else:
            print(*row, flush=True)
    if not args.record:
        table.show(title, HEAD, rows.values())
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
