#!/usr/bin/env python3
"""What `gait view` and browsers cost a running tracker.

    live_view.py [--seconds 20] [--clients 10] [--pages 1,3,10] [--record]

gait-trackd follows a simulated walk that `gait capture` sends at 30 frames a second.  The cases are: the
tracker by itself; with `gait view`; with clients that receive every event and picture as browsers do; with
two cameras, of which the page shows both; and with pages open in a headless Chromium, which draws on the same
cores.  In the last case gait-trackd and `gait capture` have real-time priority, if the user may set it.  The
clips are made once in build/bench.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import table

from gait.lcm.link import private_url

ROOT = Path(__file__).resolve().parents[2]
CLIP = ROOT / "build/bench/live_view_two"
GAIT = [str(ROOT / ".venv/bin/gait")]
REAL_TIME = ("chrt", "--rr", "10")
RATE = 30  # frames a second
BEGIN_S = 4.0  # seconds in which the page finds its rate; pictures are counted from then on
SPARED = 3  # frames that may be dropped beside those of the tracker alone
SUMMARY = re.compile(
    r"frames (\d+) dropped (\d+) .*step_ms median ([\d.]+) .*latency_ms median ([\d.]+) p99 ([\d.]+)"
)
COUNT = """() => {
  window.loaded = 0;
  for (const image of document.querySelectorAll('#pictures img')) {
    image.addEventListener('load', () => { window.loaded += 1; });
  }
}"""
HEAD = ("case", "frames", "dropped", "step ms", "tracker's CPU ms a frame", "latency ms", "latency p99")


def main() -> int:
    """Measure all cases, print, and record if asked to; exit code 1 if browsers cost frames."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--seconds", type=float, default=20.0)
    options.add_argument("--clients", type=int, default=10)
    options.add_argument("--pages", default="1,3,10", help="numbers of Chromium's pages")
    options.add_argument("--record", action="store_true")
    args = options.parse_args()
    if not (CLIP / "video.mp4").is_file():
        size = ["--size", "640x480", "--cameras", "2", "--quiet"]
        subprocess.run([*GAIT, "simulate", "-o", CLIP, *size], check=True)
    measure, both = Case(args.seconds).measure, (0, 1)
    rows = [
        measure("tracker alone"),
        measure("with gait view", streams=(0,)),
        measure("with 1 client", streams=(0,), clients=1),
        measure(f"with {args.clients} clients", streams=(0,), clients=args.clients),
        measure("two cameras, tracker alone", sent=both),
        measure("two cameras on the page of a client", sent=both, streams=both, clients=1),
    ]
    opened = [int(word) for word in args.pages.split(",")] if shutil.which("chromium") else []
    for pages in opened:
        rows.append(measure(f"with {pages} Chromium page{'s' * (pages > 1)}", streams=(0,), pages=pages))
    if opened and subprocess.run([*REAL_TIME, "true"], stderr=subprocess.DEVNULL).returncode == 0:
        name = f"with {opened[-1]} Chromium pages, real-time priority"
        rows.append(measure(name, streams=(0,), pages=opened[-1], first=REAL_TIME))
    head = [*HEAD, "pictures/s of a camera and browser", "cores busy"]
    note = f"{args.seconds:.0f} s at {RATE} frames a second, "
    note += "640 x 480; a frame is dropped if the tracker answered none. "
    note += f"Pictures are counted after {BEGIN_S:.0f} s, in which the page finds its rate. Chromium is "
    note += "headless and has no graphics card: it draws on the cores that track and send, with the priority "
    note += "of a user; as root it would raise itself above the tracker. If the tracker alone leaves no core "
    note += "idle, other programs were running; browsers then get pictures at the lowest rate. "
    most, watched = rows[0][2] + SPARED, rows[1:4] + rows[6:]
    missed = [f"{row[0]} ({row[2] / (row[1] + row[2]):.1%})" for row in watched if row[2] > most]
    note += f"Target, with one camera: at most {most} frames dropped; "
    note += f"MISSED {', '.join(missed)}." if missed else "met."
    table.publish("live_view", "The live page beside a tracker", head, rows, note, record=args.record)
    return int(bool(missed))


class Case:
    """Runs of a given number of seconds."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds

    def measure(
        self,
        name: str,
        sent: tuple[int, ...] = (0,),
        streams: tuple[int, ...] = (),
        clients: int = 0,
        pages: int = 0,
        first: Sequence[str] = (),
    ) -> list[Any]:
        """Track camera 0 while the cameras `sent` send and the live page shows `streams`; return a table row.

        `first` are the words before the commands that track and send.
        """
        url, shown, stop = private_url(), [0] * clients, threading.Event()
        daemon = [
            *first,
            ROOT / "build/bin/gait-trackd",
            "-m",
            ROOT / "python/gait/data/walk.gait",
            "--url",
            url,
        ]
        trackd = subprocess.Popen(daemon, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        try:
            with ExitStack() as stack:
                tabs = []
                if streams:
                    words = [word for stream in streams for word in ("--stream", str(stream))]
                    view = stack.enter_context(running([*GAIT, "view", "--url", url, *words]))
                    address = view.stdout.readline().strip() if view.stdout else ""
                    stack.callback(stop.set)
                    for k in range(clients):
                        threading.Thread(target=browse, args=(address, shown, k, stop), daemon=True).start()
                    tabs = stack.enter_context(chromium(address, pages)) if pages else []
                for stream in reversed(sent):  # what the tracker waits for comes last
                    stack.enter_context(running([*first, *GAIT, "capture", *sender(stream, url)]))
                before, begin = busy(), time.monotonic()
                time.sleep(BEGIN_S)
                early = [*shown, *(tab.evaluate("window.loaded") for tab in tabs)]
                counted = time.monotonic()
                time.sleep(max(begin + self._seconds - counted, 0))
                lasted, counted = time.monotonic() - begin, time.monotonic() - counted
                cores, own = (busy() - before) / lasted, processor_seconds(trackd.pid)
                shown += [tab.evaluate("window.loaded") for tab in tabs]
        finally:
            trackd.terminate()
            printed, _ = trackd.communicate()
        found = SUMMARY.search(printed)
        if found is None:
            sys.exit(f"live_view: gait-trackd printed {printed!r}")
        frames, dropped = int(found[1]), int(found[2])
        later = [last - first for last, first in zip(shown, early, strict=True)]
        rate = sum(later) / len(later) / len(streams) / counted if later else float("nan")
        step, latency, slowest = (float(found[k]) for k in (3, 4, 5))
        return [name, frames, dropped, step, 1000 * own / max(frames, 1), latency, slowest, rate, cores]


@contextmanager
def running(words: list[Any]) -> Iterator[subprocess.Popen[str]]:
    """Run a command until the end of the block."""
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def sender(stream: int, url: str) -> list[str]:
    """Words of `gait capture` that send the film of a camera; those of the first camera include the start."""
    ending = f"_{stream + 1}" if stream else ""
    files = {"camera": f"camera{ending}.json", "background": f"background{ending}.png"}
    words = [str(CLIP / f"video{ending}.mp4"), f"--stream={stream}", f"--url={url}", "--loop", "--quiet"]
    words += [f"--{name}={CLIP / file}" for name, file in files.items()]
    return words if stream else [*words, f"--init={CLIP / 'init.json'}", "--wait=30"]


@contextmanager
def chromium(address: str, count: int) -> Iterator[list[Any]]:
    """Pages of a headless Chromium, each of which counts the pictures that it has shown."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=ordinary_chromium(), args=["--no-sandbox"])
        tabs = [browser.new_page(viewport={"width": 1280, "height": 720}) for _ in range(count)]
        for tab in tabs:
            tab.set_default_timeout(120_000)
            tab.goto(address)
            tab.wait_for_selector("#pictures figure", state="attached")
            tab.evaluate(COUNT)
        yield tabs
        browser.close()


def ordinary_chromium() -> str:
    """Chromium without root's right to raise its priority above the tracker's."""
    program = CLIP.parent / "chromium"
    program.write_text('#!/bin/sh\nexec setpriv --bounding-set=-sys_nice chromium "$@"\n', encoding="ascii")
    program.chmod(0o755)
    return str(program) if os.geteuid() == 0 else str(shutil.which("chromium"))


def busy() -> float:
    """Seconds that all cores together have worked since the machine was started."""
    user, nice, system, _, _, *interrupts = map(
        int, Path("/proc/stat").read_text(encoding="ascii").split("\n")[0].split()[1:8]
    )
    return (user + nice + system + sum(interrupts)) / os.sysconf("SC_CLK_TCK")


def processor_seconds(pid: int) -> float:
    """Seconds of processor time that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def browse(address: str, counts: list[int], mine: int, stop: threading.Event) -> None:
    """Receive events as a page does, and each picture that they announce."""
    with urllib.request.urlopen(f"{address}events", timeout=60) as events:
        while not stop.is_set() and (line := events.readline()):
            if line == b"event: picture\n":
                stream = int(events.readline().partition(b":")[2])
                with urllib.request.urlopen(f"{address}frame/{stream}.jpg", timeout=60) as picture:
                    picture.read()
                counts[mine] += 1


if __name__ == "__main__":
    raise SystemExit(main())
