#!/usr/bin/env python3
"""Many executions of every fuzz target by libFuzzer.

    fuzz_long.py [--runs N] [--only NAME] [--keep] [--record]

``make fuzz-long`` builds them.  With --keep, inputs that reach branches which no kept input reaches are added
to tests/fuzz/corpus; they run with every ``make test``.
"""

from __future__ import annotations

import argparse
import hashlib
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import table
from facts import facts

ROOT = Path(__file__).resolve().parents[2]
BUILT, FOUND, CORPUS = ROOT / "build/fuzz/fuzz", ROOT / "build/fuzz/found", ROOT / "tests/fuzz/corpus"
LONGEST = 4096  # bytes of an input
KEPT_BYTES, KEPT_FILES = 2048, 40  # largest size of a kept input, and of the kept inputs of one target


def fuzz(name: str, runs: int, seed: int, seconds: int) -> list[int]:
    """Run one target; executions, branches reached, executions per second, peak memory in MB, faults."""
    found = FOUND / name
    found.mkdir(parents=True, exist_ok=True)
    options = {"runs": runs, "seed": seed, "max_total_time": seconds, "max_len": LONGEST, "timeout": 60}
    words = [f"-{key}={value}" for key, value in options.items()] + ["-print_final_stats=1"]
    began = time.monotonic()
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
    rate = round(executed / (time.monotonic() - began))
    return [
        executed,
        reached[-1] if reached else 0,
        rate,
        int(stats.get("peak_rss_mb", 0)),
        int(done.returncode != 0),
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
    rows = []
    for name in args.only or sorted(folder.name for folder in CORPUS.iterdir()):
        rows.append([name, *fuzz(name, args.runs, args.seed, args.seconds)])
        print(*rows[-1], flush=True)
        if args.keep:
            keep(name)
    head = ["target", "executions", "branches", "a second", "MB", "faults"]
    title = "Fuzzing"
    note = (
        f"{facts('tests/bench/fuzz_long.py --record')}\n\nlibFuzzer on clang's address and "
        f"undefined-behaviour sanitizers, one process, seed {args.seed}, {args.runs} executions or "
        f"{args.seconds or 'any number of'} seconds, inputs of at most {LONGEST} bytes; "
        "a fault is a report of a sanitizer, a target that aborts because a promise is broken, 60 s for one "
        "input, or 2 GB of memory."
    )
    if args.record:
        table.publish("fuzz", title, head, rows, note)
    else:
        table.show(title, head, rows)
    return int(any(row[-1] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
