#!/usr/bin/env python3
"""gait-trackd for a long time: memory, open files and time per frame must not grow.

    soak.py [--frames 1000000] [--rate HZ] [--record]

Frames of a drawn person over LCM, each sent when the one before has been estimated, or HZ per second; 108000
at 30 per second take an hour.  Every two seconds of film the person begins again, with a START.  Time is CPU
time of all threads of the daemon, which other programs hardly affect.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))

import lcm_rig as rig
import numpy as np
import table

from gait.lcm.link import private_url
from gait.lcm.messages import image_message

SHOWN = 60  # pictures, shown repeatedly
SETTLED = 0.1  # share of the frames after which memory and files must not grow
MOST_RATIO, MOST_KB = 3.0, 256


class Process:
    """Resources of a running process."""

    def __init__(self, pid: int) -> None:
        self._folder = Path(f"/proc/{pid}")

    def cpu_ms(self) -> float:
        """CPU time of all its threads."""
        return sum(int(t.read_text().split()[0]) for t in self._folder.glob("task/*/schedstat")) / 1e6

    def held(self) -> tuple[int, int]:
        """Resident memory in kB, and open files."""
        found = re.search(r"VmRSS:\s+(\d+) kB", (self._folder / "status").read_text())
        return int(found.group(1)) if found else 0, len(list((self._folder / "fd").iterdir()))


def soak(frames: int, rate: float) -> list[float]:
    """Run; frames, CPU ms per frame (median, 99.9 %, ratio), memory and files before and at the end."""
    cost, held = np.zeros(frames), []
    with rig.daemon(private_url(), "--init", "auto") as (listener, finish):
        process = Process(listener.pid)
        listener.ask(rig.opening()[:2], lambda s: s.background_mask, "camera and background")
        begun = time.monotonic()
        for number in range(frames):
            at, used = rig.utime(number), process.cpu_ms()
            if number % SHOWN == 0:
                begin = [("GAIT_COMMAND", rig.start(0, at=at))]
                listener.ask(begin, lambda s: s.state == s.ARMED, "a start")
            while rate and (left := begun + number / rate - time.monotonic()) > 0:
                listener.listen(max(1, round(1e3 * left)))
            listener.estimates.clear()
            listener.send([("GAIT_IMAGE_0", image_message(rig.picture(number % SHOWN), at, number))])
            listener.until(lambda: bool(listener.estimates), "an estimate")
            cost[number] = process.cpu_ms() - used
            listener.statuses[:-1] = []
            if number in (int(SETTLED * frames), frames - 1):
                held.append(process.held())
        outcome = finish()
    if outcome.code or outcome.frames != frames:
        raise SystemExit(f"soak: {outcome.frames} of {frames} frames, exit {outcome.code}: {outcome.words}")
    median, most = (float(np.quantile(cost, q)) for q in (0.5, 0.999))
    (kb_before, files_before), (kb, files) = held
    return [frames, median, most, most / median, kb_before, kb, files_before, files]


def main() -> int:
    """Run, print; exit code 1 if anything grew."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--frames", type=int, default=1_000_000)
    options.add_argument("--rate", type=float, default=0.0)
    options.add_argument("--record", action="store_true")
    args = options.parse_args()
    row = soak(args.frames, args.rate)
    head = ["frames", "CPU ms, median", "99.9 %", "ratio", "kB", "kB at the end", "files", "files at the end"]
    title = "The daemon for a long time"
    pace = (
        f"{args.rate:g} frames a second" if args.rate else "each frame when the one before has been estimated"
    )
    note = (
        f"{pace}; {rig.PARTICLES} particles, 160 x 120. Memory and open files after {SETTLED:.0%} of the "
        f"frames and at the end. Targets: at most {MOST_KB} kB more and no additional open file; 99.9 % "
        f"of the frames within {MOST_RATIO:g} times the median."
    )
    table.publish("soak" if not args.rate else "soak_hour", title, head, [row], note, record=args.record)
    return int(row[3] > MOST_RATIO or row[5] > row[4] + MOST_KB or row[7] > row[6])


if __name__ == "__main__":
    sys.exit(main())
