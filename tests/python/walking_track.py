"""A track of a walk whose events and parameters are known: the feet move by simple rules."""

import csv

import numpy as np

from gait.body.skeleton import JOINTS
from gait.io.track_file import Track, header

FPS = 30.0
STEP = {"right": 0.0, "left": 0.52}  # phase at which each foot strikes
STANCE = 0.62  # share of the stride


def foot(time, side, hz, length, width, heading):
    """Heel and toe (n, 3) of a foot that stands still for STANCE, then swings to its next place."""
    cycles = hz * time - STEP[side]
    number, part = np.floor(cycles), cycles - np.floor(cycles)
    swing = np.clip((part - STANCE) / (1 - STANCE), 0, 1)
    along = length * (number + STEP[side] + swing) + 0.25 * length
    aside = np.full(len(time), (0.5 if side == "left" else -0.5) * width)
    up = 0.05 * np.sin(np.pi * swing)
    heel = np.stack([along, aside, up], axis=1)
    toe = heel + [0.18, 0, 0]
    turn = np.array(
        [[np.cos(heading), np.sin(heading), 0], [-np.sin(heading), np.cos(heading), 0], [0, 0, 1]]
    )
    return heel @ turn, toe @ turn


def walking_track(seconds=5.0, hz=0.9, length=1.3, width=0.12, heading=0.4, sd=0.01, phase_sd=0.004):
    """Track of a steady walk; `numbers` as those of `gait.io.track_file.read_track`."""
    time = np.arange(round(seconds * FPS)) / FPS
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    pelvis = (length * hz * time)[:, None] * ahead + [0, 0, 0.9]
    places = {name: pelvis.copy() for name in JOINTS}
    for side in STEP:
        heel, toe = foot(time, side, hz, length, width, heading)
        places |= {
            f"{side[0]}_heel": heel,
            f"{side[0]}_toe": toe,
            f"{side[0]}_ankle": heel + 0.3 * (toe - heel),
        }
    n = len(time)
    numbers = {"stride_hz": np.full(n, hz), "phase_sd": np.full(n, phase_sd)}
    numbers |= {f"c_{k}": np.zeros(n) for k in range(1, 6)}
    numbers |= {f"c_{k}_sd": np.full(n, 0.3) for k in range(1, 6)}
    return Track(
        frame=np.arange(n) + 7,
        time=time,
        places=places,
        status=["tracking"] * n,
        phase=(hz * time) % 1.0,
        sd={name: np.full((n, 3), sd) for name in JOINTS},
        numbers=numbers | {"phase": (hz * time) % 1.0},
    )


def write_track(path, track, angles=("r_hip_flexion", "l_hip_flexion", "torso_x"), classes=()):
    """Put a track into a file of the contract's columns."""
    columns = {"frame": track.frame, "time": track.time, "status": track.status} | track.numbers
    for name, place in track.places.items():
        for k, axis in enumerate("xyz"):
            columns[f"{name}_{axis}"], columns[f"{name}_s{axis}"] = place[:, k], track.sd[name][:, k]
    if classes:
        columns["motion_class"] = track.motion_class
    names = header(5, angles, classes)
    with open(path, "w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(names)
        nothing = np.zeros(len(track.time))
        rows.writerows(zip(*(columns.get(name, nothing) for name in names), strict=True))
