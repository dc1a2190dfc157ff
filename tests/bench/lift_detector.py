#!/usr/bin/env python3
"""gait lift of the detector's joints: errors, coverage of the intervals, stature and cost.

make eval-lift, or lift_detector.py

Development clips with all networks, with models learnt without their subjects; films of real people with
`full`.  Joints are kept in
build/detector-joints as the networks give them; each run moves them by the profile, as gait detect does.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import eval_clips
import lift_tracks
import numpy as np
import table
from facts import facts

from gait.body.skeleton import CHANNELS, EVAL15, JOINTS, SIDES
from gait.detect import profile
from gait.detect.networks import LANDMARK_JOINTS
from gait.detect.people import detect, main_person
from gait.detect.weights import LANDMARK_NETWORKS
from gait.export import angles
from gait.io import keypoints_file
from gait.io.keypoints_file import Keypoints
from gait.io.track_file import read_estimates, read_truth
from gait.io.video import Video
from gait.lift.smooth.options import Options
from gait.progress import progress

KEPT = Path(__file__).resolve().parents[2] / "build" / "detector-joints"
# pip compiles packages; an environment that forbids keeping the result would compile them in every run.
INSTALLED = os.environ | {
    "PYTHONDONTWRITEBYTECODE": "",
    "PYTHONPYCACHEPREFIX": str(Path("build/pycache").resolve()),
}
HEAD = ["measure", "clip", "network", "frames", "stature %", "root mm", "abs mm", "coverage", "floor known"]
FLEXIONS = ("hip_flexion", "knee_flexion", "ankle_flexion")
HEAD += [*(f"{name.split('_')[0]} deg" for name in FLEXIONS), "swapped", "CPU s per 150 frames", "warnings"]


def joints(clip: Path, network: str) -> Keypoints:
    """Joints of the clip's main person, as the network gives them."""
    kept = KEPT / f"{clip.parent.name}-{clip.name}.{network}.csv"
    if not kept.is_file():
        video = next(path for path in sorted(clip.glob("video.*")))
        people = detect(Video(str(video)), network, correct=False)
        KEPT.mkdir(parents=True, exist_ok=True)
        keypoints_file.write(kept, people[main_person(people)])
    return keypoints_file.read(kept, tuple(LANDMARK_JOINTS))[0]


def lifted(
    found: Keypoints, camera: Path, output: Path, *options: object
) -> tuple[dict[str, object], float, int]:
    """Lift with the command: its summary, seconds of CPU and number of warnings."""
    points = output.with_suffix(".points.csv")
    keypoints_file.write(points, found)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "gait", "lift", points, "--camera", camera, "-o", output, "--json"]
    command += options
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True, env=INSTALLED)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return json.loads(done.stdout), cpu, len(done.stderr.splitlines())


def row(clip: Path, network: str, folder: Path, model: Path | str = "walk") -> list[object]:
    """Measure one clip with a model."""
    found = profile.corrected(joints(clip, network), network)
    meta = json.loads((clip / "meta.json").read_text(encoding="utf-8"))
    if "window" in meta:
        begin, end = np.searchsorted(found.frame, (meta["window"][0], meta["window"][1] + 1)).tolist()
        found = found.part(slice(begin, end))
    output = folder / "out.csv"
    summary, cpu, warnings = lifted(found, clip / "camera.json", output, "-m", model)
    stature = 100 * (float(summary["stature_m"] or np.nan) / meta["stature_m"] - 1)
    judged: list[float | None] = [None] * (4 + len(FLEXIONS))
    if (truth := clip / "truth.csv").is_file():
        judged[:3] = judge(output, truth)
        judged[4:] = more_flexed(output, truth)
        lifted(found, clip / "camera.json", output, "-m", model, "--floor-sd", lift_tracks.FLOOR_KNOWN)
        judged[3] = judge(output, truth)[2]
    return [len(found.time), stature, *judged, summary["swapped"], 150 * cpu / len(found.time), warnings]


def judge(output: Path, truth: Path) -> list[float]:
    """Root-aligned and absolute median error, mm, and the share of coordinates in 90 % intervals."""
    found, known = read_estimates(output), read_truth(truth)
    true = known.eval15()[np.searchsorted(known.frame, found.frame)]
    places = found.eval15()
    hips = [EVAL15.index(name) for name in ("l_hip", "r_hip")]
    inside = np.abs(places - true) < lift_tracks.WITHIN * found.eval15_sd()
    absolute = 1000 * float(np.median(np.linalg.norm(places - true, axis=2)))
    return [lift_tracks.root_error(places, true, hips), absolute, float(inside.mean())]


def more_flexed(output: Path, truth: Path) -> list[float]:
    """Means over frames and both sides of FLEXIONS minus the true ones, degrees, all fitted to joints."""
    found, known = read_estimates(output), read_truth(truth)
    _, ours, theirs = np.intersect1d(found.frame, known.frame, return_indices=True)
    fitted, true = (
        angles.fit(np.stack([motion.places[name][rows] for name in JOINTS], axis=1)).angles
        for motion, rows in ((found, ours), (known, theirs))
    )
    both = [[CHANNELS.index(f"{side}_{name}") for side in SIDES] for name in FLEXIONS]
    return [float(np.degrees((fitted - true)[:, columns]).mean()) for columns in both]


def note(rows: list[list[Any]]) -> str:
    """Explain the table, with the mean coverage of the rendered clips."""
    columns = [[row[HEAD.index(name)] for row in rows] for name in ("coverage", "floor known")]
    usual, known = (np.mean([share for share in column if share is not None]) for column in columns)
    slow = sum(row[HEAD.index("CPU s per 150 frames")] > 4 for row in rows)
    rendered = {path.parent.name for path in (eval_clips.DATA / "eval" / "dev").glob("*/truth.csv")}
    offsets = np.array(
        [row[HEAD.index("hip deg") :][:3] for row in rows if row[1] in rendered and row[2] == "full"]
    )
    flexed = [f"{m:.1f} ({sd:.1f})" for m, sd in zip(offsets.mean(0), offsets.std(0, ddof=1), strict=True)]
    wrong = sum(row[1] in rendered and abs(row[HEAD.index("stature %")]) > 6 for row in rows)
    return (
        "`gait lift` with the joints of `gait detect`, all defaults, stature unknown. The rows are the "
        "development clips with all networks (none of their people is in the detector's profile, nor among "
        "the learners of the model), then "
        "films of real people, whose cameras are guessed from an assumed stature: there the stature only "
        "shows how well the lift agrees with the camera. Coverage: share of coordinates in their 90 % "
        "intervals; target from 0.8 to 0.95. Floor known: the same with `--floor-sd "
        f"{lift_tracks.FLOOR_KNOWN:g}`; the floor of rendered clips is exact, while the default assumes a "
        f"standard deviation of {Options.floor_sd:g} m. The mean coverages are {usual:.3f} and "
        f"{known:.3f}. CPU: seconds of the whole command including start-up, with packages compiled as by "
        f"pip, in some rows with other programs running; target below 4 s for 150 frames, missed in {slow} "
        f"of {len(rows)} rows. Stature: target within 6 % if the camera is right, missed in {wrong} of the "
        "rendered ones; no figure: the lift states no stature. Hip, knee, ankle deg: mean flexion minus the "
        f"true one; with `full` {', '.join(flexed)} over the rendered clips (standard deviation in brackets)."
    )


def main() -> int:
    """Publish the table."""
    clips = sorted(path.parent for path in (eval_clips.DATA / "eval" / "dev").glob("*/truth.csv"))
    films = sorted(path.parent for path in (eval_clips.DATA / "real").glob("*/camera.json"))
    if not clips:
        print(f"eval-lift: {eval_clips.DATA} is not there, left out", file=sys.stderr)
        return 0
    known, without = eval_clips.people()
    models = {clip.folder: without[clip.subject or ""] for clip in known}
    jobs = [(network, clip) for network in LANDMARK_NETWORKS for clip in clips]
    jobs += [("full", film) for film in films]
    rows = []
    with tempfile.TemporaryDirectory() as folder, progress("clips", len(jobs)) as update:
        row(clips[0], "full", Path(folder))  # compiles what is not compiled yet
        for done, (network, clip) in enumerate(jobs, 1):
            rows.append(
                ["detector", clip.name, network, *row(clip, network, Path(folder), models.get(clip, "walk"))]
            )
            update(done)
    table.publish("lift_detector", "Joints of the detector", HEAD, rows, f"{facts()}\n\n{note(rows)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
