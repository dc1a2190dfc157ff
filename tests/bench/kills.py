#!/usr/bin/env python3
"""Writers killed at random moments: what they reported as written must exist and be complete.

    kills.py [--kills 200] [--record]

A process writes one file again and again, each time with one entry more, and reports each version that is
written; at a random moment it gets a SIGKILL.  The file must then be readable and contain at least the
entries that were reported.  The unfinished version remains beside it, where the next command finds it.
Snapshots are tested in daemon_kills.py.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import table

from gait.bindings.config import TrackerConfig
from gait.bindings.model import Model
from gait.camera.camera import Camera
from gait.io.files import replacing
from gait.io.track_file import TrackWriter, read_track
from gait.io.video import Frame
from gait.lcm.link import LogWriter, events_of
from gait.lift.keypoints.corrections import Correction, Edits
from gait.studio.session import Session
from gait.track.tracker import Tracker

PICTURE = np.zeros((48, 64), np.uint8)
LONGEST = 0.05  # longest time in seconds until a kill


def track_writer() -> Callable[[Path, int], None]:
    """Write a track file with so many frames, as gait track does."""
    model = Model()
    camera = Camera(
        64, 48, 50.0, 50.0, 31.5, 23.5, np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), np.array([0, 1.0, 5])
    )
    tracker = Tracker(model, camera, TrackerConfig.default(particles=16, acquisition_particles=16))
    tracker.start(*model.prior(), utime=0)
    estimate = tracker.step(PICTURE, 33333)

    def write(path: Path, count: int) -> None:
        with TrackWriter(path, model.info.components, model.joint_names, model.angle_names) as writer:
            for number in range(count):
                writer.write(Frame(number, number / 30.0, PICTURE), estimate)

    return write


def write_log(path: Path, count: int) -> None:
    """Write a log with so many events, as gait record does."""
    with replacing(path) as temporary, closing(LogWriter(temporary, name=str(path))) as log:
        for number in range(count):
            log.write(number, "GAIT_ESTIMATE", bytes(500))


def write_corrections(path: Path, count: int) -> None:
    """Write so many corrections, as gait studio saves them."""
    edits = Edits(tuple(Correction(number, "r_ankle", (1.0, 2.0), 2.0) for number in range(count)))
    session = SimpleNamespace(source=SimpleNamespace(corrections=path))
    Session._save(session, edits)  # type: ignore[arg-type]


KINDS: dict[str, tuple[Callable[[], Callable[[Path, int], None]], Callable[[Path], int]]] = {
    "track file": (track_writer, lambda path: len(read_track(path).frame)),
    "log of messages": (lambda: write_log, lambda path: len(list(events_of(path)))),
    "corrections": (lambda: write_corrections, lambda path: path.read_text().count('"frame"')),
}


def write_until_killed(write: Callable[[Path, int], None], path: Path, chance: random.Random) -> int:
    """Kill a process that writes; return the most entries that it reported as written."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            for count in range(1, 10_000):
                write(path, count)
                os.write(writer, count.to_bytes(4, "little"))
        finally:
            os._exit(1)
    os.close(writer)
    with os.fdopen(reader, "rb") as reports:
        first = reports.read(4)
        time.sleep(chance.uniform(0.0, LONGEST))
        os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        if os.WTERMSIG(status) != signal.SIGKILL:
            raise RuntimeError(f"the writer of {path.name} ended by itself")
        sent = first + reports.read()
    return int.from_bytes(sent[-4:], "little")


def attack(kind: str, kills: int) -> list[float]:
    """Kills, entries reported, kills after which some were missing, and kills in the middle of a write."""
    make, read = KINDS[kind]
    write, chance = make(), random.Random(1)
    reported, lost, amid = 0, 0, 0
    for _ in range(kills):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "written.csv"
            written = write_until_killed(write, path, chance)
            reported += written
            lost += not read(path) >= written
            amid += len(list(Path(folder).iterdir())) > 1
    return [kills, reported, lost, amid]


def main() -> int:
    """Kill, read, print; exit code 1 if anything was lost."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--kills", type=int, default=200)
    options.add_argument("--record", action="store_true")
    args = options.parse_args()
    rows = [[kind, *attack(kind, args.kills)] for kind in KINDS]
    head = ["file", "kills", "reported as written", "files that lost some", "kills amid a write"]
    title = "Writers that are killed"
    note = (
        f"SIGKILL at random moments, up to "
        f"{1e3 * LONGEST:.0f} ms after the first report, of a process that writes a file again and again, "
        "each time with one entry more."
    )
    table.publish("kills", title, head, rows, note, record=args.record)
    return int(any(row[3] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
