#!/usr/bin/env python3
"""Tracks with one and with two cameras, and the time offset found between films compared with the true one.

    eval_cameras.py [--record] [--seeds 501,502] [--frames 90] [--late 0.5]

Simulated walks (gait simulate --cameras 2), from the side, at 45 degrees and towards the first camera, are
tracked with the detector and all defaults.  The second film is used once as it is and once cut to begin
--late seconds later; this offset must be found.
Clips and tracks are kept in build/eval-cameras.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

import numpy as np
import table

from gait.bindings.model import read_cyclic
from gait.io.track_file import read_estimates, read_truth
from gait.io.video import Video, VideoWriter
from gait.motion.evaluate import evaluate
from gait.motion.footfalls import strikes_of
from gait.simulate.clip import CRF, simulate
from gait.simulate.scenario import Scenario
from gait.track.clip import ClipOptions, track_clip

FOLDER = Path(__file__).resolve().parents[2] / "build" / "eval-cameras"
VIEWS = "side", "oblique", "toward"
WANTED = 40.0  # mm, median over frames of the distance of joints from where they are, towards the camera


def main() -> int:
    """Make, track, compare, print; exit code 1 if walks towards the camera miss the target."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--seeds", default="501,502")
    options.add_argument("--frames", type=int, default=90)
    options.add_argument("--late", type=float, default=0.5, help="seconds")
    options.add_argument("--record", action="store_true")
    args = options.parse_args()
    seeds = [int(seed) for seed in args.seeds.split(",")]
    rows: list[list[object]] = []
    toward = []
    for view in VIEWS:
        for seed in seeds:
            folder, late = made(view, seed, args.frames, args.late)
            second = str(folder / "camera_2.json")
            one = measured(folder, "one", ())
            two = measured(folder, "two", ((str(folder / "video_2.mp4"), second),))
            cut = measured(folder, "cut", ((str(folder / "late.mp4"), second),))
            toward += [two[0]] if view == "toward" else []
            values = [round(value) for arms in zip(one[:4], two[:4], cut[:4], strict=True) for value in arms]
            rows.append([view, seed, *values, round(1000 * (cut[4] - late))])
            print(*rows[-1], file=sys.stderr)
    head = ["walk", "seed"]
    for what in ("joints mm", "pose mm", "inside %", "tracking %"):
        head += [f"{what}, one", "two", "cut"]
    head.append("offset off by ms")
    middle = float(np.median(toward))
    missed = middle > WANTED
    note = (
        f"Simulated walks of {args.frames} frames, seeds {args.seeds}, with the detector and all "
        "defaults, with one camera and with two. The second camera stands 60 degrees around the path. "
        f"Its film begins with the first one (two) or {args.late:g} s later (cut); this offset is found "
        "from the motion. Medians over the frames: joints in space; pose, with the midpoints of the hips "
        "aligned. inside: coordinates within their 90 % intervals. Towards the camera, two cameras: "
        f"median of clips {middle:.0f} mm, target at most {WANTED:.0f}{', missed' if missed else ''}."
    )
    table.publish("cameras", "One camera and two", head, rows, note, record=args.record)
    return int(missed)


def made(view: str, seed: int, frames: int, late: float = 0.5, body: str = "table") -> tuple[Path, float]:
    """Make a clip unless it exists; return its folder, and when the second film begins, seconds."""
    scenario = Scenario(view=view, seed=seed, frames=frames, cameras=2, body=body)
    name = f"{view}_{seed}" + ("" if body == "table" else f"_{body}")
    folder, cut = FOLDER / name, round(late * scenario.fps)
    if not (folder / "late.mp4").is_file():
        simulate(scenario, folder)
        with VideoWriter(folder / "late.mp4", scenario.fps, crf=CRF) as writer:
            for frame in Video(folder / "video_2.mp4").frames(cut):
                writer.write(frame.image)
    return folder, cut / scenario.fps


def measured(
    folder: Path, name: str, further: tuple[tuple[str, str], ...]
) -> tuple[float, float, float, float, float]:
    """Track; return joints and pose (mm), shares in 90 % intervals and `tracking`, and the offset found."""
    output = folder / f"{name}.csv"
    options = ClipOptions(
        str(folder / "video.mp4"), str(folder / "camera.json"), str(output), further=further, quiet=True
    )
    used = track_clip(options)["used"]
    truth = read_truth(folder / "truth.csv")
    result = evaluate(
        read_estimates(output),
        truth,
        strikes=strikes_of(truth, folder / "meta.json"),
        model=read_cyclic(None),
    )
    began = next((words for what, words in used.items() if what.startswith("further")), "")
    seconds = re.search(r"began ([\d.]+) s (after|before)", began)
    offset = 0.0
    if seconds:
        offset = float(seconds[1]) * (1 if seconds[2] == "after" else -1)
    return (
        result["abs"]["median"],
        result["root"]["median"],
        100 * result["coverage"]["90"],
        100 * result["status"]["tracking"],
        offset,
    )


if __name__ == "__main__":
    sys.exit(main())
