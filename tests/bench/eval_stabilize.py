#!/usr/bin/env python3
"""Tracks of real films, and of simulated moving cameras, with and without `--stabilize auto`.

    eval_stabilize.py [--only NAME...] [--turns] [--record]

--turns: no tracks, only how far the cameras of the real films turn, and how large that is at the person.
never: --stabilize off; moving: --stabilize auto, which leaves cameras alone that stand still; always: the
same, with every camera assumed to move.  If auto finds no turns, the result is that of never, which is not
run; if it finds turns, always is the same as moving.  The command's default, pans, gives the result of moving
if the camera turns by more than a tenth of the picture's width, otherwise that of never.
Clips of `gait simulate` are kept in build/eval-stabilize.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import table
from eval_real import OUT, Result, run
from real_clip import Clip, errors_in_space, from_truth, read_cameras, read_clips, score

from gait import Camera, Video
from gait.io.keypoints_file import Keypoints
from gait.io.track_file import read_estimates
from gait.io.video import sample_frames
from gait.progress import progress
from gait.simulate.clip import simulate
from gait.simulate.scenario import PRESETS
from gait.track.stabilise import find_motion

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "build" / "eval-stabilize"
SIMULATED = [(preset, moving) for preset in ("demo", "oblique") for moving in ("pan", "shake")]
AUTO, OFF = ["--stabilize", "auto"], ["--stabilize", "off"]
ALWAYS = (
    "-c",
    "import sys; from gait.cli import main; from gait.track import stabilise; "
    "stabilise._still = lambda *_: False; sys.exit(main(sys.argv[1:]))",
)
GOOD = 0.09  # person's heights; largest error of legs that are in place in `make eval-real`
TALL = 0.9  # of a person's height, from ears to toes
_TURNS = """\
How far the camera of each film of `make eval-real` turns from its first frame, as `--stabilize auto` finds it
with the camera given.  A program that knows only that first camera draws the person at another place than in
the picture: the columns in % have that distance as a share of the person's height, in the frames judged."""
_READING = """\
The arm `auto` of `make eval-real` (camera given, detector on). never: --stabilize off; moving: --stabilize
auto; always: auto with every camera assumed to move. good, wrong under `tracking`: as there, with joints
projected by the camera of each frame. one camera: good frames if the joints are projected by the one
camera that was given, as in a program that knows no other. If auto finds no turns, because the camera stands
still or does not only turn, its track is the same as with off. The default, pans, is the same as auto if the
camera turns by more than a tenth of the picture's width, otherwise as off. Simulated: `gait simulate
--preset P --moving KIND`, with errors of 15 joints in space."""


def main() -> int:
    """Run, print, and publish if asked to."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", metavar="NAME", help="names of clips (all)")
    parser.add_argument("--turns", action="store_true", help="only measure how far the cameras turn")
    parser.add_argument("--record", action="store_true")
    args = parser.parse_args()
    clips = read_clips(ROOT.parent / "shared/data/real", args.only)
    publish = partial(table.publish, record=args.record)
    if args.turns:
        head = [
            "clip",
            "camera",
            "turns px",
            "median % of height",
            "most %",
            f"over {100 * GOOD:g} % of it %",
        ]
        turns = map(_turns, clips)
        publish("eval_stabilize_turns", "Turns of the cameras of real films", head, turns, _TURNS)
        return 0
    clips += [
        from_truth(_made(*names)) for names in SIMULATED if not args.only or "_".join(names) in args.only
    ]
    rows: list[list[object]] = []
    with progress("eval-stabilize", len(clips)) as update:
        for done, clip in enumerate(clips, 1):
            rows += _rows(clip)
            update(done)
    for kind in dict.fromkeys(tuple(row[1:3]) for row in rows):
        same = [row[3:-1] for row in rows if tuple(row[1:3]) == kind and not row[-1]]
        rows.append(["mean", *kind, *np.nanmean(np.array(same, float), axis=0).tolist(), ""])
    head = ["clip", "camera", "stabilised", "good %", "one camera, good %", "tracking", "wrong",
            "error % of height", "stride rate %", "root mm", "abs mm", "CPU s", "failed"]  # fmt: skip
    publish("eval_stabilize", "Stabilising", head, rows, _READING)
    return 0


def _turns(clip: Clip) -> list[object]:
    """Row of a film: how its camera turns, and how far that moves the person, from the checked joints."""
    video, given = Video(clip.video), _given(clip)
    names = tuple(sorted(set.intersection(*map(set, clip.reference.values()))))
    frames = np.array(sorted(clip.reference))
    uv = np.array([[clip.reference[frame][name] for name in names] for frame in frames.tolist()])
    people = {1: Keypoints(frames, frames / clip.fps, names, uv, np.ones(uv.shape[:2]))}
    motion, why = find_motion(video, given, sample_frames(video), people, first=True)
    if motion is None:
        return [clip.folder.name, "does not only turn" if why else "still", None, None, None, None]
    moved = np.hypot(*(motion.in_reference(people[1]).uv - uv).T)
    height = np.ptp(uv[..., 1], axis=1) / TALL
    off = np.nanmedian(moved, axis=0) / height
    off = off[(frames >= clip.first) & (frames <= clip.last)]
    shares = 100 * np.array([np.nanmedian(off), np.nanmax(off), np.mean(off > GOOD)])
    return [clip.folder.name, "turns", motion.furthest(), *shares.tolist()]


def _made(preset: str, moving: str) -> Path:
    """Folder of a simulated clip, which is made unless it exists."""
    folder = FOLDER / f"{preset}_{moving}"
    if not (folder / "meta.json").is_file():
        simulate(replace(PRESETS[preset], moving=moving), folder)
    return folder


def _rows(clip: Clip) -> list[list[object]]:
    """Rows of a clip: as it is, and stabilised."""
    auto = _row(clip, "moving", run(clip, "auto", AUTO))
    cameras = _cameras(clip)
    if len({camera.R.tobytes() for camera in cameras.values()}) > 1:
        return [_row(clip, "never", run(clip, "auto", OFF)), auto]
    auto[1:3] = "no turns found", "never, moving"
    always = _row(clip, "always", run(clip, "auto", AUTO, ALWAYS))
    always[1] = "no turns found"
    return [auto, always]


def _row(clip: Clip, arm: str, found: Result) -> list[object]:
    """Cells of a run, with the arm `auto` of eval-real, on a clip whose camera turns."""
    own, one, errors = found.score, 0.0, [np.nan, np.nan]
    if not found.failed:
        track, given = read_estimates(OUT / f"{clip.folder.name}_auto.csv"), _given(clip)
        if (clip.folder / "truth.csv").is_file():
            errors = errors_in_space(clip, track, np.isin(track.frame, list(clip.reference)))
        one = score(clip, track, dict.fromkeys(track.frame.tolist(), given)).share["good"]
    return [
        *(clip.folder.name, "turns", arm, 100 * own.share["good"], 100 * one, own.tracking, own.wrong),
        *(100 * own.error, 100 * own.stride_error, *errors, found.cpu, found.failed),
    ]


def _given(clip: Clip) -> Camera:
    """Camera that the command gets."""
    return Camera.read(str(clip.folder / "camera.json"), Video(clip.video).size)


def _cameras(clip: Clip) -> dict[int, Camera]:
    """Camera of each frame as the last run found it."""
    return read_cameras(OUT / f"{clip.folder.name}_auto_cameras.csv", _given(clip))


if __name__ == "__main__":
    sys.exit(main())
