#!/usr/bin/env python3
"""Speed of the detector: milliseconds per person by network and runtime, and of `gait track` with it.

    detector_speed.py [--record]

The last part of make bench.  "Per person" is one run of the landmark network on a crop; frames per second are
those of the whole command on a film of 1280 x 720, including start-up.  --record keeps the page if the host
is quiet.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import eval_clips
import numpy as np
import table
from facts import facts

from gait import Video
from gait.detect import networks, weights
from gait.detect.networks import LandmarkNetwork, whole_picture

FILM = eval_clips.DATA / "real" / "lab_side"
RUNS = 40
WANTED = 25.0  # frames per second of gait track with lite, on two cores

Row = list[object]


def main() -> int:
    """Measure, print and, if asked to, record; exit code 0 also if weights or film are absent."""
    load = os.getloadavg()[0]
    absent = [
        w.file for w in (weights.PERSON, *weights.LANDMARK_NETWORKS.values()) if weights.find(w) is None
    ]
    if absent or not FILM.is_dir():
        print(f"detector_speed: {absent[0] if absent else FILM} is not there, left out", file=sys.stderr)
        return 0
    rows = [row for name in ("lite", "full") for row in _people(name)]
    rows += [_track("lite"), _track("full")]
    head = ["what", "runtime", "ms wall", "ms CPU", "frames/s", "wanted", "reached"]
    note = (
        f"{facts()}\n\n"
        f"Median time per person of the landmark network, {RUNS} runs; LiteRT has two threads, OpenCV one "
        "for each core. gait track: time per frame of the whole command, including start-up, on a film "
        "of 1280 x 720."
    )
    title = "Speed of the detector"
    table.publish_speed("--record" in sys.argv, load, "detector_speed", title, head, rows, note)
    return 0


def _people(name: str) -> list[Row]:
    """Rows of a landmark network in each runtime."""
    frame = next(Video(FILM / "video.mp4").frames(60, 61)).image
    rows: list[Row] = []
    both: tuple[tuple[str, Callable[[bytes], networks.Network | None]], ...] = (
        ("ai-edge-litert", networks._litert),
        ("cv2.dnn", networks._opencv),
    )
    for runtime, load in both:
        network = LandmarkNetwork(name)
        loaded = load(weights.load(weights.LANDMARK_NETWORKS[name]))
        if loaded is None:
            continue
        network._network = loaded
        network(frame, whole_picture(frame))
        wall = []
        cpu = time.process_time()
        for _ in range(RUNS):
            begun = time.perf_counter()
            network(frame, whole_picture(frame))
            wall.append(1000 * (time.perf_counter() - begun))
        cpu = 1000 * (time.process_time() - cpu) / RUNS
        rows.append([f"a person, {name}", runtime, float(np.median(wall)), cpu, None, None, None])
    return rows


def _track(name: str) -> Row:
    """Row of gait track on the film."""
    count = Video(FILM / "video.mp4").count
    with tempfile.TemporaryDirectory() as folder:
        words = ["track", FILM / "video.mp4", "--camera", FILM / "camera.json", "--detector", name]
        words += ["-o", Path(folder) / "track.csv", "--threads", 2, "--quiet"]
        begun, used = time.perf_counter(), os.times()
        subprocess.run(
            [sys.executable, "-m", "gait", *map(str, words)], check=True, stdout=subprocess.DEVNULL
        )
        wall, now = time.perf_counter() - begun, os.times()
    cpu = now.children_user + now.children_system - used.children_user - used.children_system
    rate = count / wall
    wanted = WANTED if name == "lite" else None
    reached = None if wanted is None else "reached" if rate >= wanted else "MISSED"
    return [f"gait track, {name}", "-", 1000 * wall / count, 1000 * cpu / count, rate, wanted, reached]


if __name__ == "__main__":
    sys.exit(main())
