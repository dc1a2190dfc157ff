#!/usr/bin/env python3
"""What `gait view` and browsers cost a running tracker.

    live_view.py [--seconds 20] [--browsers 10] [--record]

gait-trackd follows a simulated walk that `gait capture` sends at its 30 frames a second, first by itself,
then with `gait view`, then with clients that take every event and picture, as browsers do.  The clip is
made once in build/bench.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path

import table
from facts import facts

from gait.lcm.link import private_url

ROOT = Path(__file__).resolve().parents[2]
CLIP = ROOT / "build/bench/live_view"
GAIT = [str(ROOT / ".venv/bin/gait")]
SUMMARY = re.compile(
    r"frames (\d+) dropped (\d+) .*step_ms median ([\d.]+) .*latency_ms median ([\d.]+) p99 ([\d.]+)"
)


def main() -> int:
    """Measure the three cases, print, and record if asked to; 1 if browsers cost frames."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--seconds", type=float, default=20.0)
    options.add_argument("--browsers", type=int, default=10)
    options.add_argument("--record", action="store_true")
    args = options.parse_args()
    if not (CLIP / "video.mp4").is_file():
        subprocess.run([*GAIT, "simulate", "-o", CLIP, "--size", "640x480", "--quiet"], check=True)
    cases = (
        ("tracker alone", None),
        ("with gait view", 0),
        (f"with {args.browsers} clients", args.browsers),
    )
    rows = [[name, *measure(args.seconds, browsers)] for name, browsers in cases]
    head = ["case", "frames", "dropped", "step ms", "latency ms", "latency p99", "pictures/s a browser"]
    note = f"{facts('tests/bench/live_view.py --record')}\n\n{args.seconds:.0f} s at 30 frames a second, "
    note += "640 x 480; a frame is dropped where the tracker answered none."
    if args.record:
        table.publish("live_view", "The live page beside a tracker", head, rows, note)
    else:
        table.show("The live page beside a tracker", head, rows)
    return int(rows[-1][2] > rows[0][2] + 3)


def measure(seconds: float, browsers: int | None) -> list[object]:
    """Frames, drops, median step, latency and its p99, pictures a second that a browser got."""
    url = private_url()
    trackd = subprocess.Popen(
        [ROOT / "build/bin/gait-trackd", "-m", ROOT / "python/gait/data/walk.gait", "--url", url],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    others: list[subprocess.Popen[str]] = []
    pictures, stop = [0] * (browsers or 0), threading.Event()
    try:
        if browsers is not None:
            view = subprocess.Popen([*GAIT, "view", "--url", url], stdout=subprocess.PIPE, text=True)
            others.append(view)
            address = view.stdout.readline().strip() if view.stdout else ""
            for k in range(browsers):
                threading.Thread(target=browse, args=(address, pictures, k, stop), daemon=True).start()
        words = [
            f"--{name}={CLIP / file}" for name, file in (("camera", "camera.json"), ("init", "init.json"))
        ]
        words += [f"--background={CLIP / 'background.png'}", f"--url={url}", "--loop", "--wait=30", "--quiet"]
        others.append(subprocess.Popen([*GAIT, "capture", str(CLIP / "video.mp4"), *words], text=True))
        time.sleep(seconds)
    finally:
        stop.set()
        for process in reversed(others):
            process.terminate()
            process.wait()
        trackd.terminate()
        printed, _ = trackd.communicate()
    found = SUMMARY.search(printed)
    if found is None:
        sys.exit(f"live_view: gait-trackd printed {printed!r}")
    rate = sum(pictures) / len(pictures) / seconds if pictures else float("nan")
    return [int(found[1]), int(found[2]), float(found[3]), float(found[4]), float(found[5]), rate]


def browse(address: str, counts: list[int], mine: int, stop: threading.Event) -> None:
    """Take in events as a page does, and each picture that they announce."""
    with urllib.request.urlopen(f"{address}events", timeout=60) as events:
        while not stop.is_set() and (line := events.readline()):
            if line == b"event: picture\n":
                with urllib.request.urlopen(f"{address}frame/0.jpg", timeout=60) as picture:
                    picture.read()
                counts[mine] += 1


if __name__ == "__main__":
    raise SystemExit(main())
