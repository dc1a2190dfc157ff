#!/usr/bin/env python3
"""gait track without --camera: the camera that it finds on the development clips, and the track with it.

    camera_walk.py [CLIP...]

Each clip is tracked with its true camera, and without a camera but with the stature.  The truth is
transformed into the world of the camera that is found: the origin is on the floor below it, and it looks
along y.  Exit code 1 if a bound is missed.
"""

from __future__ import annotations

import contextlib
import io
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import eval_clips
import numpy as np
import numpy.typing as npt
import table
from facts import facts

from gait.body.skeleton import EVAL15
from gait.camera.camera import Camera, read_camera
from gait.cli import main as gait
from gait.io.track_file import read_track, read_truth

Floats = npt.NDArray[np.float64]
WITHIN = 1.645  # standard deviations that hold 90 %
FOCAL, HEIGHT, SPEED = 15.0, 8.0, 8.0  # per cent that these may be off
TILT = 1.5  # degrees
WORSE = 1.15  # root-aligned error over that with the true camera
COVERAGE = (0.80, 0.97)  # of 90 % intervals: pelvis of a clip, camera parameters of all clips
HIPS = [EVAL15.index("l_hip"), EVAL15.index("r_hip")]


def main() -> int:
    """Track every clip twice and publish; exit code 1 if a bound is missed, 0 also if the data are absent."""
    if eval_clips.absent():
        return 0
    folder = eval_clips.DATA / "eval" / "dev"
    clips = eval_clips.chosen(folder.iterdir())
    rows, held = [], []
    for clip in clips:
        row, inside = _clip(clip)
        rows.append([*row, ", ".join(missed(row)) or "-"])
        held += inside
    covered = sum(held) / len(held)
    honest = COVERAGE[0] <= covered <= COVERAGE[1]
    head = ["clip", "focal %", "focal sd %", "tilt deg", "tilt sd", "roll deg", "height %", "height sd %"]
    head += ["joints mm", "with camera", "speed %", "with camera %", "pelvis in 90 %", "missed"]
    note = (
        f"{facts()}\n\n"
        "Errors of focal length, tilt, roll and height of the camera that is found, with their reported "
        "standard deviations; root-aligned error of the 15 joints and error of the speed, without a "
        "camera and with the true one; share of frames in which the pelvis is inside its 90 % interval "
        f"(x and y). Of the camera parameters, {sum(held)} of {len(held)} are inside their intervals. "
        f"Targets: focal length within {FOCAL:g} %, tilt {TILT:g} degrees, height {HEIGHT:g} %, speed "
        f"{SPEED:g} %; joints at most {100 * (WORSE - 1):.0f} % worse than with the camera; "
        f"{COVERAGE[0]:.0%} to {COVERAGE[1]:.0%} of the pelvis positions and of the parameters "
        f"({'' if honest else 'not '}met) inside their intervals."
    )
    table.publish("camera_walk", "A camera found from the walk", head, rows, note)
    return int(not honest or any(row[-1] != "-" for row in rows))


def missed(row: list[Any]) -> list[str]:
    """Bounds that a clip's row misses, by name."""
    _, focal, _, tilt, _, _, height, _, joints, given, speed, _, pelvis = row
    bounds = {
        "focal": abs(focal) <= FOCAL,
        "tilt": abs(tilt) <= TILT,
        "height": abs(height) <= HEIGHT,
        "joints": joints <= WORSE * given,
        "speed": abs(speed) <= SPEED,
        "pelvis": COVERAGE[0] <= pelvis / 100 <= COVERAGE[1],
    }
    return [name for name, met in bounds.items() if not met]


def _clip(folder: Path) -> tuple[list[Any], list[bool]]:
    """Row of a clip, and whether each parameter of the camera is in its 90 % interval."""
    truth_camera = read_camera(str(folder / "camera.json"))
    truth = read_truth(folder / "truth.csv")
    stature = json.loads((folder / "meta.json").read_text())["limb_lengths_m"]["stature"]
    turn, origin = _world(truth_camera)
    true = (np.stack([truth.places[name] for name in EVAL15], axis=1) - origin) @ turn.T
    words = ["track", str(folder / "video.mp4"), "--height", f"{stature:.3f}", "--json", "--quiet"]
    with tempfile.TemporaryDirectory() as tmp:
        found, given = Path(tmp) / "found.csv", Path(tmp) / "given.csv"
        camera = Path(tmp) / "camera.json"
        figures = _run([*words, "-o", str(found), "--camera-out", str(camera)])["camera"]
        _run([*words, "-o", str(given), "--camera", str(folder / "camera.json")])
        tracks = read_track(found), read_track(given)
        calibrated = read_camera(str(camera))
    sd = np.array([
        figures["focal_px_sd"] / figures["focal_px"],
        *np.radians([figures["tilt_deg_sd"], figures["roll_deg_sd"]]),
        figures["height_m_sd"] / figures["height_m"],
    ])  # fmt: skip
    off = np.array(_parts(calibrated)) - _parts(truth_camera)
    joints = [np.stack([track.places[name] for name in EVAL15], axis=1) for track in tracks]
    joints[1] = (joints[1] - origin) @ turn.T
    rows = [np.searchsorted(truth.frame, track.frame) for track in tracks]
    own, other = (_errors(joints[k], true[rows[k]], tracks[k].time) for k in range(2))
    pelvis = joints[0][:, HIPS].mean(axis=1) - true[rows[0]][:, HIPS].mean(axis=1)
    sd_hips = np.stack([tracks[0].sd[name] for name in ("l_hip", "r_hip")]).mean(axis=0)
    held = np.abs(pelvis[:, :2]) < WITHIN * sd_hips[:, :2]
    row = [folder.name, *_shown(off, sd), own[0], other[0], own[1], other[1], 100 * float(held.mean())]
    return row, (np.abs(off) < WITHIN * sd).tolist()


def _run(words: list[str]) -> dict[str, Any]:
    """Run a command and return what it prints."""
    with contextlib.redirect_stdout(io.StringIO()) as text:
        if gait(words):
            raise SystemExit(f"gait {' '.join(words)}: failed")
    return dict(json.loads(text.getvalue()))


def _world(camera: Camera) -> tuple[Floats, Floats]:
    """Rotation about z and origin that put a camera above the origin, looking along y."""
    x, y = camera.R[2, :2] / np.hypot(*camera.R[2, :2])
    return np.array([[y, -x, 0], [x, y, 0], [0, 0, 1.0]]), np.array([*camera.centre[:2], 0.0])


def _parts(camera: Camera) -> Floats:
    """Log focal length, tilt, roll, log height."""
    tilt = -np.arcsin(camera.R[2, 2])
    roll = np.arctan2(camera.R[0, 2], -camera.R[1, 2])
    return np.array([np.log(camera.fx), tilt, -roll, np.log(camera.centre[2])])


def _shown(off: Floats, sd: Floats) -> list[float]:
    """Errors and standard deviations of a camera's parameters in the table's units: per cent and degrees."""
    percent, degrees, tilt_sd = 100 * np.expm1(off), np.degrees(off), np.degrees(sd[1])
    values = (percent[0], 100 * sd[0], degrees[1], tilt_sd, degrees[2], percent[3], 100 * sd[3])
    return [float(v) for v in values]


def _errors(joints: Floats, true: Floats, time: Floats) -> tuple[float, float]:
    """Root-aligned error, mm, and error of the speed, per cent."""
    own, other = (j - j[:, HIPS].mean(axis=1, keepdims=True) for j in (joints, true))
    off = 1000 * float(np.linalg.norm(own - other, axis=2).mean())
    speeds = []
    for j in (joints, true):
        path = j[:, HIPS, :2].mean(axis=1)
        speeds.append(float(np.hypot(*np.polyfit(time, path, 1)[0])))
    return off, 100 * (speeds[0] / speeds[1] - 1)


if __name__ == "__main__":
    sys.exit(main())
