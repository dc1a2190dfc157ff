#!/usr/bin/env python3
"""gait lift of one camera's and of several cameras' keypoints, on a real motion that no prior contains.

    lift_views.py [--record]

The keypoints are the reference joints of the balancing man in the picture of each camera, with noise.  The
films are lifted too, with the detector; their rows have whatever ``gait lift`` warns of in the note.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import eval_clips
import lift_tracks
import numpy as np
import numpy.typing as npt
import table
from facts import facts

from gait.bindings.segment_prior import SegmentPrior
from gait.camera.camera import Camera, write_camera
from gait.io.track_file import Joints, read_estimates
from gait.io.video import Video
from gait.lift.keypoints.joined import joined
from gait.lift.segment.view import Perspective, Several
from gait.lift.smooth import motion
from gait.reproducible import one_thread

Floats = npt.NDArray[np.float64]

VIEWS = (("cam_01",), ("cam_01", "cam_03"), ("cam_02", "cam_04"), ("cam_01", "cam_02", "cam_03", "cam_04"))
FILMS = (((3, 4), 40), ((3, 4), 100), ((1, 2, 3, 4), 100))  # numbers of films, and frames
ANGLES = tuple(
    tuple(f"{side}_{part}" for part in parts)
    for side in "lr"
    for parts in (("shoulder", "elbow", "wrist"), ("shoulder", "hip", "knee"), ("hip", "knee", "ankle"))
)
"""Angles at the middle joint."""


def angles(places: Floats, names: list[str]) -> Floats:
    """Angles (T, A) at elbows, hips and knees of places (T, J, 3), degrees."""
    found = []
    for upper, middle, lower in ANGLES:
        ends = [places[:, names.index(end)] - places[:, names.index(middle)] for end in (upper, lower)]
        a, b = (end / np.linalg.norm(end, axis=1, keepdims=True) for end in ends)
        found.append(np.degrees(np.arccos(np.clip((a * b).sum(axis=1), -1, 1))))
    return np.stack(found, axis=1)


def measures(places: Floats, sd: Floats, truth: Floats, names: list[str]) -> list[object]:
    """Cells of root-aligned and absolute error, angles' errors and median sd; mm and degrees."""
    hips = [names.index(name) for name in ("l_hip", "r_hip")]
    apart = np.linalg.norm(places - truth, axis=2).mean(axis=1)
    off = np.abs(angles(places, names) - angles(truth, names))
    errors = lift_tracks.root_error(places, truth, hips), 1000 * float(np.median(apart))
    return [*errors, float(off.mean()), float(np.median(off)), 1000 * float(np.median(sd))]


def films(
    numbers: tuple[int, ...], stop: int, joints: Joints, cameras: dict[str, Camera], names: list[str]
) -> tuple[list[object], str]:
    """Row of ``gait lift`` of films up to a frame, and the command's warnings."""
    offsets = ",".join(["0"] * (len(numbers) - 1))
    words: list[object] = [sys.executable, "-m", "gait", "lift", "--offsets", offsets, "--stop", stop]
    files = [lift_tracks.BALANCING / "videos" / f"cam{k:02}.mp4" for k in numbers]
    head = f"films {' '.join(f'cam_{k:02}' for k in numbers)}, {stop} frames"
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "motion.csv"
        words += files
        for k, file in zip(numbers, files, strict=True):
            camera = Path(folder) / f"{k}.json"
            write_camera(camera, replace(cameras[f"cam_{k:02}"], width=Video(file).width))
            words += ["--camera", camera]
        done = subprocess.run([*map(str, words), "-o", str(out)], capture_output=True, text=True, check=False)
        warnings = "; ".join(re.findall(r"the estimate(?:d stature)? is .*", done.stderr))
        if done.returncode:
            return [head, *[None] * 8], f"{head}: refused: {warnings or done.stderr}"
        found = read_estimates(out)
    places, sd = (np.stack([of[name] for name in names], axis=1) for of in (found.places, found.sd))
    truth = np.stack([joints.places[name][found.frame] for name in names], axis=1)
    inside = float((np.abs(places - truth) < lift_tracks.WITHIN * sd).mean())
    return [head, *measures(places, sd, truth, names), inside, None, None], f"{head}: {warnings or 'none'}"


def main() -> int:
    """Lift, compare, print."""
    if eval_clips.absent():
        return 0
    record = sys.argv[1:] == ["--record"]
    joints, cameras = lift_tracks.balancing()
    prior, noise = SegmentPrior.load(), lift_tracks.BALANCING_NOISE
    tracks = {
        name: lift_tracks.tracked(joints, camera, noise, 0.0, seed)
        for seed, (name, camera) in enumerate(cameras.items(), 1)
    }
    names = list(next(iter(tracks.values())).names)
    truth = np.stack([joints.places[name] for name in names], axis=1)
    rows: list[list[object]] = []
    for views in VIEWS:
        together, camera_of = joined([tracks[name] for name in views], [0.0] * (len(views) - 1))
        several = Several(tuple(cameras[name] for name in views), camera_of)
        view = several if len(views) > 1 else Perspective(cameras[views[0]])
        options = motion.Options(pixel_sd=noise, floor_sd=lift_tracks.BEAM)
        with one_thread():
            found = motion.lift(prior, together, view, options, motion.output_names(prior, tracks[views[0]]))
        order = [found.names.index(name) for name in names]
        cells = measures(found.places[:, order], found.sd[:, order], truth, names)
        rows.append([" ".join(views), *cells, *lift_tracks.coverage(found, truth, order), found.wider])
    warnings = []
    for numbers, stop in FILMS:
        row, words = films(numbers, stop, joints, cameras, names)
        rows.append(row)
        warnings.append(words)
    head = [
        "views",
        "root mm",
        "abs mm",
        "angles off, mean",
        "median",
        "median sd mm",
        "coverage",
        "about hips",
    ]
    head += ["prior widened"]
    note = (
        f"{facts()}\n\n"
        "The balancing man ([one camera](lift_balancing.md)): reference joints, which were triangulated "
        f"from four views, in the picture of each camera with {noise:g} px of noise; prior of walks, "
        "stature unknown. The errors are medians over frames of the mean over 14 joints, root-aligned "
        "and in the world; errors of the angles at elbows, hips and knees are in degrees, over frames "
        "and joints. Coverage is that of 90 % intervals. Pose2Sim's published errors of joint angles are "
        "2 to 6 degrees; they are for other motions and relative to markers, so only the order of "
        "magnitude can be compared. films: gait lift of the films themselves, with the "
        f"detector, and its warnings. {'. '.join(warnings)}. The films of cam_01 and cam_02 are cut to 1080 "
        "columns while their calibration is for 1088: the last ones are taken to be missing, as the rays of "
        "all four cameras then miss each other least."
    )
    title = "A real motion by one camera and by several"
    table.publish("lift_views", title, head, rows, note) if record else table.show(title, head, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
