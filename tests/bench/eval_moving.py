#!/usr/bin/env python3
"""Tracks from moving cameras, compared with the same walks in front of a camera that stands still.

    eval_moving.py [--record] [--seeds 24,41,61,62] [--frames 60]

Simulated walks (gait simulate --moving), each started from its init file, without a detector.  The arms use
exact poses; poses with errors that are drawn anew for each frame, with and without their standard deviations
in the file; and the poses that --stabilize finds.  Clips are kept in build/eval-moving.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import table
from scipy.spatial.transform import Rotation

from gait.bindings.model import read_cyclic
from gait.camera.path import CameraPath, CameraPose, write_path
from gait.io.track_file import read_estimates, read_truth
from gait.motion.evaluate import evaluate
from gait.motion.footfalls import strikes_of
from gait.simulate.clip import simulate
from gait.simulate.scenario import PRESETS, Scenario
from gait.track.clip import ClipOptions, track_clip

FOLDER = Path(__file__).resolve().parents[2] / "build" / "eval-moving"
SIZE = 320, 240
TURN_SD, PLACE_SD = np.radians(0.5), 0.02
WANTED = {"exact": 1.15, "noisy": 1.15, "estimated": 1.25}
STILL = {"follow": "away", "pan": "side", "shake": "side"}  # the view of a still camera beside each
ARMS = ("exact", "noisy", "noisy, sd not given", "estimated")


def main() -> int:
    """Make, track, compare, print; exit code 1 if a median misses its target."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--seeds", default="24,41,61,62")
    options.add_argument("--frames", type=int, default=60)
    options.add_argument("--record", action="store_true")
    args = options.parse_args()
    roots: dict[tuple[str, str], list[float]] = {}
    places: dict[tuple[str, str], list[float]] = {}
    lost: dict[tuple[str, str], int] = {}

    def add(kind: str, arm: str, folder: Path, **more: str | None) -> None:
        found = measured(folder, arm, **more)
        print(f"{folder.name} {kind} {arm}: root {found[0]:.1f} mm, abs {found[1]:.1f} mm", file=sys.stderr)
        roots.setdefault((kind, arm), []).append(found[0])
        places.setdefault((kind, arm), []).append(found[1])
        lost[kind, arm] = lost.get((kind, arm), 0) + found[2]

    for seed in map(int, args.seeds.split(",")):
        for view in sorted(set(STILL.values())):
            folder = made(replace(PRESETS["demo"], seed=seed, frames=args.frames, size=SIZE, view=view), view)
            for arm, background in (("still", "auto"), ("still, no background", "none")):
                add(view, arm, folder, background=background)
        for kind in STILL:
            folder = made(
                replace(PRESETS["demo"], seed=seed, frames=args.frames, size=SIZE, moving=kind), kind
            )
            noisy(folder, seed)
            add(kind, "exact", folder, camera_path="poses.csv")
            add(kind, "noisy", folder, camera_path="noisy.csv")
            add(kind, "noisy, sd not given", folder, camera_path="unstated.csv")
            add(kind, "estimated", folder, stabilize="auto")
    rows, missed = [], []
    for (kind, arm), values in roots.items():
        still = np.median(roots[STILL.get(kind, kind), "still"])
        ratio = float(np.median(values) / still)
        bound = WANTED.get(arm)
        if bound is not None and ratio > bound:
            missed.append(f"{kind} {arm} {ratio:.3f} (wanted {bound:.3f})")
        extremes = f"{min(values):.0f}-{max(values):.0f}"
        rows.append(
            [kind, arm, float(np.median(values)), extremes, ratio, bound, float(np.median(places[kind, arm])),
             lost[kind, arm]]
        )  # fmt: skip
    head = ["camera", "poses", "root mm", "from-to", "to still", "wanted", "abs mm", "lost"]
    title = "Cameras that move"
    note = (
        f"Simulated walks of {args.frames} frames, seeds {args.seeds}, {SIZE[0]} x {SIZE[1]}, from an "
        "init file, without a detector. root, abs: medians over clips of the median over frames; from-to: "
        "range of root over clips. to still: relative to a still camera with that view. noisy: errors of "
        f"{np.degrees(TURN_SD):.1f} degrees and {100 * PLACE_SD:.0f} cm, drawn anew for each frame; sd "
        "not given: without standard deviations in the file. follow: the camera is on a robot 1 m "
        f"behind. lost: frames with the status lost. Missed: {', '.join(missed) or 'none'}."
    )
    table.publish("moving", title, head, rows, note, record=args.record)
    return int(bool(missed))


def made(scenario: Scenario, name: str) -> Path:
    """Folder of a clip, which is made unless it exists."""
    folder = FOLDER / f"{name}-{scenario.seed}-{scenario.frames}"
    if not (folder / "meta.json").is_file():
        simulate(scenario, folder)
    return folder


def noisy(folder: Path, seed: int) -> None:
    """Write the poses with errors, with and without their standard deviations."""
    path, rng = CameraPath.read(str(folder / "poses.csv")), np.random.default_rng(seed)
    stated = []
    for pose in path.poses:
        R = Rotation.from_rotvec(TURN_SD * rng.standard_normal(3)).as_matrix() @ pose.R
        centre = pose.centre + PLACE_SD * rng.standard_normal(3)
        stated.append(CameraPose(R, -R @ centre, TURN_SD, PLACE_SD))
    unstated = [CameraPose(pose.R, pose.t) for pose in stated]
    for name, poses in (("noisy.csv", stated), ("unstated.csv", unstated)):
        write_path(folder / name, path.at.tolist(), poses, by_frame=False)


def measured(folder: Path, arm: str, **more: str | None) -> tuple[float, float, int]:
    """Track a clip: median root and absolute error, mm, and the frames lost."""
    output = folder / f"track-{arm.replace(', ', '-').replace(' ', '-')}.csv"
    if more.get("camera_path"):
        more["camera_path"] = str(folder / str(more["camera_path"]))
    camera, init = str(folder / "camera.json"), str(folder / "init.json")
    found = track_clip(
        ClipOptions(
            str(folder / "video.mp4"),
            camera,
            str(output),
            init=init,
            detector="none",
            quiet=True,
            **more,  # type: ignore[arg-type]
        )
    )
    truth = read_truth(str(folder / "truth.csv"))
    strikes = strikes_of(truth, folder / "meta.json")
    measures = evaluate(read_estimates(str(output)), truth, strikes=strikes, model=read_cyclic(None))
    return measures["root"]["median"], measures["abs"]["median"], int(found["lost"])


if __name__ == "__main__":
    sys.exit(main())
