#!/usr/bin/env python3
"""What `gait track` costs beside the tracker's steps: decoding, Python, writing; films of 1280 x 720.

    track_overhead.py [--record]

Camera, first state and keypoints are given, so that only tracking remains.  Processor time is compared,
because other programs change it less.  Exit code 1 if the tracker's thread takes more than 25 % of a step
beside it.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

import eval_clips
import numpy as np
import table
from facts import facts

import gait.track.clip
from gait import Tracker
from gait.track.clip import track_scene
from gait.track.first_state import first_state
from gait.track.options import ClipOptions
from gait.track.read_scene import read_scene

FILMS = ("cane", "lab_away_w", "lab_side")
MOST = 0.25  # share of a step


class Timed(Tracker):
    """Notes the processor time of its thread before and after each step in the C library, and of all."""

    marks: list[tuple[float, float, float]] = []

    def _call(self, name: str, *arguments: object) -> int:
        whole, begun = time.process_time(), time.thread_time()
        try:
            return super()._call(name, *arguments)
        finally:
            if name == "step":
                Timed.marks.append((begun, time.thread_time(), whole))


def main() -> int:
    """Measure, print, and record if asked to."""
    folder = eval_clips.DATA / "real"
    if not folder.is_dir():
        print(f"track_overhead: {folder} is not there, left out", file=sys.stderr)
        return 0
    gait.track.clip.Tracker = Timed  # type: ignore[misc]
    load = os.getloadavg()[0]
    rows = [_row(folder / film) for film in FILMS]
    head = ["film", "frames", "step ms", "beside ms", "other threads ms", "share", "share of all"]
    note = (
        f"{facts()} Load average before: {load:.1f}.\n\n"
        "Milliseconds of processor time per frame, 2,000 particles, one thread: of a step in the C library; "
        "of the same thread beside the steps; of the other threads, which decode the next frames, convert "
        "them to BGR, and write. Shares: relative to a step, without and with the other threads; the former "
        "is what an idle machine with a second core adds to the time of the steps. Target: a share of at "
        f"most {MOST:.2f}."
    )
    title = "What gait track costs beside its steps"
    table.publish("track_overhead", title, head, rows, note, record="--record" in sys.argv)
    return int(any(row[5] > MOST for row in rows))


def _row(film: Path) -> list[object]:
    """Name, frames, milliseconds per frame, and shares, between the first and the last step."""
    Timed.marks.clear()
    with tempfile.TemporaryDirectory() as folder:
        options = ClipOptions(
            str(film / "video.mp4"),
            str(film / "camera.json"),
            str(Path(folder) / "track.csv"),
            init=str(film / "init.json"),
            keypoints=str(film / "reference2d.csv"),
            quiet=True,
        )
        scene = read_scene(options)
        track_scene(options, scene, first_state(options, scene))
    begun, ended, whole = 1000 * np.array(Timed.marks).T
    frames = len(begun) - 1
    step = (ended - begun)[:-1].mean()
    beside, others = np.ptp(begun) / frames - step, (np.ptp(whole) - np.ptp(begun)) / frames
    return [film.name, frames, step, beside, others, beside / step, (beside + others) / step]


if __name__ == "__main__":
    sys.exit(main())
