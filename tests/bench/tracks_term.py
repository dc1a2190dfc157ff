#!/usr/bin/env python3
"""What a detector's joints (gait track --tracks) add to the pictures, on the development clips.

    tracks_term.py [CLIP...]

The detector is simulated: the truth in the picture with 3 px of noise and 10 % missing.  Models leave out the
person's subject; every clip is tracked from three starts.  A part of make eval-lift.
"""

from __future__ import annotations

import contextlib
import io
import json
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import eval_clips
import lift_tracks
import numpy as np
import table
from eval_plan import Clip

from gait.camera.camera import Camera
from gait.cli import main as gait
from gait.io import keypoints_file as tracks_file
from gait.io.track_file import read_truth
from gait.progress import progress

SEEDS = (1, 2, 3)
PIXEL_SD = 4.0
#: Cues, and the options that choose them.
ARMS = {
    "pictures": [],
    "with joints": ["--tracks"],
    "one picture term": ["--mode", "paper"],
    "that, with joints": ["--mode", "paper", "--tracks"],
}


def main() -> int:
    """Track and publish the table."""
    if eval_clips.absent():
        return 0
    clips, paths = eval_clips.people(sys.argv[1:] or None)
    rows: list[list[object]] = []
    with tempfile.TemporaryDirectory() as folder, progress("clips", len(clips)) as update:
        for done, clip in enumerate(clips, 1):
            rows += _rows(clip, paths[str(clip.subject)], Path(folder))
            update(done)
    note = (
        f"True joints in the picture, {lift_tracks.NOISE:g} px of noise, {lift_tracks.GAPS:.0%} missing, "
        f"--tracks-sd {PIXEL_SD:g}. Median mm over frames, mean of {len(SEEDS)} starts. {_losses(rows)}"
    )
    head = ["clip", "cues", "root mm", "abs mm", "px", "lost %"]
    table.publish("tracks_term", "Joints of a detector beside the pictures", head, rows, note)
    return 0


def _losses(rows: Sequence[Sequence[Any]]) -> str:
    """Name the errors that are larger with the joints than with the pictures alone."""
    arms = {(row[0], row[1]): row[2:5] for row in rows}
    worse = [
        f"{clip} {what} ({before:.3g} to {after:.3g})"
        for clip, cues in arms
        if cues == "pictures"
        for what, before, after in zip(
            ("root", "abs", "px"), arms[clip, cues], arms[clip, "with joints"], strict=True
        )
        if after > before
    ]
    return f"Worse with joints: {', '.join(worse)}." if worse else "Nothing is worse with joints."


def _rows(clip: Clip, model: Path, folder: Path) -> list[list[object]]:
    """One row per arm."""
    joints, camera = read_truth(str(clip.truth)), Camera.read(str(clip.camera))
    found = folder / "tracks.csv"
    tracks_file.write(found, lift_tracks.tracked(joints, camera, lift_tracks.NOISE, lift_tracks.GAPS))
    out: list[list[object]] = []
    for arm, options in ARMS.items():
        words = [
            w for o in options for w in ([o, found, "--tracks-sd", PIXEL_SD] if o == "--tracks" else [o])
        ]
        errors = [_errors(clip, model, words, seed, folder) for seed in SEEDS]
        out.append([clip.name, arm, *np.mean(errors, axis=0).tolist()])
    return out


def _errors(clip: Clip, model: Path, options: list[object], seed: int, folder: Path) -> list[float]:
    """Median root and absolute errors (mm), in the picture (px), and lost frames (%)."""
    start, out = folder / "init.json", folder / "out.csv"
    start.write_text(json.dumps(eval_clips.noisy_start(clip, seed, 0.0)))
    words = ["track", clip.video, "--camera", clip.camera, "-o", out, "-m", model, "--init", start, "--quiet"]
    words += ["--background", clip.plate or "auto", "--seed", seed, *options, "--json"]
    _predicted(words)
    found = json.loads(_predicted(["eval", out, "--truth", clip.truth, "-m", model, "--json"]))
    return [found["root"]["median"], found["abs"]["median"], found["px"]["median"], 100 * found["lost"]]


def _predicted(words: list[object]) -> str:
    """What a command of gait prints."""
    with contextlib.redirect_stdout(io.StringIO()) as predicted:
        if gait([str(w) for w in words]):
            raise RuntimeError(f"gait {words[0]} failed")
    return predicted.getvalue()


if __name__ == "__main__":
    sys.exit(main())
