#!/usr/bin/env python3
"""Status of the track of people who walk in unusual ways, with one model and other options at their defaults.

    eval_status.py [--seeds 0,100] [--only NAME...] [--model classes] [--smooth] [--record]

`gait track VIDEO --camera CAMERA -m MODEL -o OUT`, with the detector on, of clips that `gait simulate` makes
and of the development clip of a person who comes towards a long lens.  Each preset is made with its own seed
plus each of --seeds.  A model other than the default has a page of its own, and --smooth too.  Clips are kept
in build/eval-status.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import eval_clips
import numpy as np
import table
from eval_real import OUT, run
from real_clip import Clip, errors_in_space, errors_of_rows, from_truth

from gait.io.track_file import Track, read_estimates, read_truth
from gait.progress import progress
from gait.simulate.clip import simulate
from gait.simulate.scenario import PRESETS

FOLDER = Path(__file__).resolve().parents[2] / "build" / "eval-status"
NAMES = ("toward", "backwards", "limping", "stick", "crutches", "stopping", "standing")
FAR = "toward300_08"
STATUSES = ("tracking", "ambiguous", "init", "lost")
FAR_MM = 150.0  # root-aligned error of a wrong frame
_READING = """\
`gait track` with the camera, the detector on and other options at their defaults except the model and
--smooth where the command names them, on clips of `gait simulate --preset` and on a development clip.
Shares are of the frames in which all joints are in the picture. good: knees and ankles within 9 % of the
person's height on average in the picture, hips in place; swap: left and right swapped; off: hips or legs
elsewhere. wrong: share of the frames with status `tracking` that are not good; far: that are more than
150 mm off in space, root-aligned. Root-aligned and absolute error of 15 joints in space, and error of
the heading: medians over the frames with status `tracking`. Stride rate: its error over the frames that
have a phase, of people who never stand."""


def main() -> int:
    """Make, track, print; exit code always 0: the page reports."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--seeds", default="0,100", help="numbers added to the seed of each preset (default: 0,100)"
    )
    parser.add_argument("--only", nargs="+", metavar="NAME", help="presets, or the development clip (all)")
    parser.add_argument("--model", default="walk", help="model to track with (walk)")
    parser.add_argument("--smooth", action="store_true", help="also smooth the whole clip")
    parser.add_argument("--record", action="store_true")
    args = parser.parse_args()
    folders = [made(name, int(more)) for name in args.only or NAMES if name != FAR
               for more in args.seeds.split(",")]  # fmt: skip
    far = eval_clips.DATA / "eval" / "dev" / FAR
    if far.is_dir() and FAR in (args.only or (FAR,)):
        folders.append(far)
    rows, options = [], ["--model", args.model, *(["--smooth"] if args.smooth else [])]
    with progress("eval-status", len(folders)) as update:
        for done, folder in enumerate(folders, 1):
            rows.append(_row(from_truth(folder), options))
            update(done)
    head = ["clip", *(f"{status} %" for status in STATUSES), "good %", "swap %", "off %", "wrong %",
            "far %", "root mm", "abs mm", "heading deg", "stride rate %", "failed"]  # fmt: skip
    page, title = "eval_status", "Status of unusual walks"
    if args.model != "walk":
        page, title = f"{page}_{Path(args.model).stem}", f"{title}, tracked with -m {args.model}"
    if args.smooth:
        page, title = f"{page}_smooth", f"{title}, smoothed"
    table.publish(page, title, head, rows, _READING, record=args.record)
    return 0


def made(name: str, more: int) -> Path:
    """Folder of a preset's clip with another seed, which is made unless it exists."""
    scenario = replace(PRESETS[name], seed=PRESETS[name].seed + more)
    folder = FOLDER / f"{name}_{scenario.seed}"
    if not (folder / "meta.json").is_file():
        simulate(scenario, folder)
    return folder


def _row(clip: Clip, options: list[str]) -> list[object]:
    """Track a clip with options and return its row."""
    name, found = clip.folder.name, run(clip, "auto", options)
    if found.failed:
        return [name, *[None] * (len(STATUSES) + 9), found.failed]
    track = read_estimates(OUT / f"{name}_auto.csv")
    status = Counter(one for one, frame in zip(track.status, track.frame, strict=True)
                     if int(frame) in clip.reference)  # fmt: skip
    score = found.score
    rows = np.array([one == "tracking" for one in track.status]) & np.isin(track.frame, list(clip.reference))
    return [
        name,
        *(round(100 * status[one] / len(clip.reference)) for one in STATUSES),
        *(round(100 * score.share[kind]) for kind in ("good", "swap", "off")),
        100 * score.wrong / score.tracking if score.tracking else None,
        100 * np.mean(errors_of_rows(clip, track, rows)[0] > FAR_MM) if rows.any() else None,
        *errors_in_space(clip, track, rows),
        _heading(clip, track, rows),
        100 * score.stride_error,
        "",
    ]


def _heading(clip: Clip, track: Track, rows: np.ndarray) -> float:
    """Median error of the direction of the hips, degrees, over `rows` of the track."""
    truth = read_truth(clip.folder / "truth.csv")
    if not rows.any():
        return np.nan
    places = ((track, rows), (truth, np.searchsorted(truth.frame, track.frame[rows])))
    found, true = (joints.places["r_hip"][at, :2] - joints.places["l_hip"][at, :2] for joints, at in places)
    turn = np.arctan2(*found.T) - np.arctan2(*true.T)
    return float(np.degrees(np.median(np.abs(np.angle(np.exp(1j * turn))))))


if __name__ == "__main__":
    sys.exit(main())
