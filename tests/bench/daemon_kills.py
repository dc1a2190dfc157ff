#!/usr/bin/env python3
"""gait-trackd killed at random moments: what is lost, and how long the next daemon needs to continue.

    daemon_kills.py [--kills 200] [--record]

A stream of 30 frames a second of a drawn person; at random times a SIGKILL, after which another daemon is
started at once on the same snapshot.  A daemon has continued if it reports that it follows the person from a
frame and estimates follow without a START.  A frame is lost if it was sent and no daemon estimated it.  No
other program may publish on the URL.
"""

from __future__ import annotations

import argparse
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))

import lcm_rig as rig
import numpy as np
import table
from facts import facts

from gait.lcm.link import private_url
from gait.lcm.messages import image_message

RATE = 30.0
SHOWN = 60  # pictures, shown repeatedly: the person must stay in view
PERIOD_S = 1.0  # between snapshots
RESUMED = re.compile(r"following the person of frame (\d+)")
WANTED_MS = 200.0


class Stream:
    """Frames with their times, and the answers received."""

    def __init__(self, url: str) -> None:
        self.listener = rig.Listener(url)
        self.sent = 0
        self.began = time.monotonic()
        self.answered: dict[int, float] = {}

    def run(self, until: float) -> None:
        """Send the frames that are due and receive answers, until a time of the monotonic clock."""
        while (now := time.monotonic()) < until:
            due = self.began + self.sent / RATE
            if now >= due:
                picture = rig.picture(self.sent % SHOWN)
                self.listener.send(
                    [("GAIT_IMAGE_0", image_message(picture, rig.utime(self.sent), self.sent))]
                )
                if self.sent % round(2 * RATE) == 0:
                    self.listener.send(rig.opening()[:2])
                self.sent += 1
            else:
                self.listener.listen(max(1, round(1000 * min(due - now, until - now))))
            for estimate in self.listener.estimates:
                self.answered.setdefault(estimate.frame, time.monotonic())
            self.listener.estimates.clear()


def main() -> int:
    """Kill, measure, print; exit code 1 if a daemon did not continue."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--kills", type=int, default=200)
    options.add_argument("--record", action="store_true")
    args = options.parse_args()
    chance, url = random.Random(1), private_url()
    back_ms: list[float] = []
    lost: list[int] = []
    old = 0
    with tempfile.TemporaryDirectory() as folder:
        words = rig.command(
            "--url", url, "--init", "auto", "--snapshot", f"{folder}/state", "--snapshot-s", PERIOD_S
        )
        stream, log = Stream(url), Path(folder) / "log"
        daemon = start(words, log)
        begin(stream)
        for _ in range(args.kills):
            stream.run(time.monotonic() + chance.uniform(1.2, 3.0))
            daemon.send_signal(signal.SIGKILL)
            daemon.wait()
            before = log.read_text()
            known, began = max(stream.answered), time.monotonic()
            daemon = start(words, log)
            while not any(f > known for f in stream.answered) and time.monotonic() < began + 10.0:
                stream.run(time.monotonic() + 0.01)
            first = min((f for f in stream.answered if f > known), default=None)
            resumed = RESUMED.search(log.read_text())
            if first is None or resumed is None:
                print(
                    (f"daemon_kills: the daemon did not continue:\n{before}--\n{log.read_text()}"),
                    file=sys.stderr,
                )
                old += 1
                begin(stream)
                continue
            back_ms.append(1e3 * (stream.answered[first] - began))
            lost.append(first - known - 1)
        daemon.send_signal(signal.SIGTERM)
        daemon.wait()
    row = [
        args.kills,
        args.kills - old,
        *(float(np.quantile(back_ms, q)) for q in (0.5, 0.9, 1.0)),
        float(np.median(lost)),
        max(lost),
    ]
    head = ["kills", "went on", "ms median", "ms 90 %", "ms most", "frames lost, median", "most"]
    title = "A daemon that is killed"
    verdict = "reached" if max(back_ms) < WANTED_MS else f"missed: {max(back_ms):.0f} at most"
    note = (
        f"{facts('tests/bench/daemon_kills.py --record')}\n\n"
        f"SIGKILL at random moments of a stream of {RATE:.0f} frames a second; snapshots every "
        f"{PERIOD_S:.0f} s, {rig.PARTICLES} particles, 160 x 120. Milliseconds from the start of the next "
        f"daemon to its first estimate, target: below {WANTED_MS:.0f} ({verdict}); frames sent in between "
        "are lost."
    )
    if args.record:
        table.publish("daemon_kills", title, head, [row], note)
    else:
        table.show(title, head, [row])
    return int(old > 0)


def start(words: list[str], log: Path) -> subprocess.Popen[bytes]:
    """Start a daemon with an empty log."""
    with log.open("wb") as out:
        return subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=out)


def begin(stream: Stream) -> None:
    """Send camera, background and a start; then frames until the first estimate."""
    listener = stream.listener
    listener.until(lambda: bool(listener.statuses), "a first status")
    listener.ask(rig.opening()[:2], lambda s: s.background_mask, "camera and background")
    start_now = rig.start(stream.sent % SHOWN, at=rig.utime(stream.sent))
    listener.ask([("GAIT_COMMAND", start_now)], lambda s: s.state == s.ARMED, "a start")
    stream.began = time.monotonic() - stream.sent / RATE
    while not any(f >= stream.sent - 1 for f in stream.answered):
        stream.run(time.monotonic() + 0.05)


if __name__ == "__main__":
    raise SystemExit(main())
