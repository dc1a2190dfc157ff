#!/usr/bin/env python3
"""Tracks with the model's body and with estimates of the person's: from a first pass, and live.

    eval_own_body.py [--record] [--seeds 501,502] [--frames 90] [--groups table drawn]

Simulated walks by two cameras (gait simulate --cameras 2) of people with the proportions of textbooks (table)
and with those of people who were recorded (drawn).  own: the body from a first pass, as by gait track --body
auto; live: the proportions vary among the particles (setting `proportions` of the tracker).  With the
detector and all defaults, one run each.  One view: eval_one_view.py.  Clips and tracks are kept in
build/eval-cameras.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import patch

import eval_cameras
import numpy as np
import table

from gait.bindings.config import TrackerConfig
from gait.bindings.model import read_cyclic
from gait.io.track_file import read_estimates, read_truth
from gait.motion.evaluate import evaluate
from gait.motion.footfalls import strikes_of
from gait.progress import progress
from gait.track.clip import ClipOptions, track_scene
from gait.track.first_state import first_state
from gait.track.further_cameras import with_further_cameras
from gait.track.own_body import FirstPass, own_model
from gait.track.read_scene import read_scene

GROUPS = "table", "drawn"
ARMS = "model", "own", "live"
TITLE = "The person's body: the model's, and estimates of it"
MEASURES = "pose mm", "joints mm", "inside %", "tracking %"
HEAD = ["clip", "group", *(word for name in MEASURES for word in (f"{name}, model", "own", "live"))]


@dataclass(frozen=True)
class Case:
    """A clip of a group, its further films, model and stature."""

    folder: Path
    group: str
    further: tuple[tuple[str, str], ...] = ()
    model: str = "walk"
    height: float | None = None


def main() -> int:
    """Make, track, compare, print; 1 if the own body is not better in a group."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--seeds", default="501,502")
    options.add_argument("--frames", type=int, default=90)
    options.add_argument("--groups", nargs="+", choices=GROUPS, default=GROUPS)
    options.add_argument("--record", action="store_true")
    args = options.parse_args()
    cases = list(simulated(args.groups, [int(word) for word in args.seeds.split(",")], args.frames))
    found: dict[Case, dict[str, tuple[float, ...]]] = {}
    with progress("clips", len(cases)) as update:
        for case in cases:
            found[case] = measured(case)
            print(case.folder.name, case.group, found[case], file=sys.stderr)
            update(len(found))
    rows = [
        [case.folder.name, case.group] + [round(arms[arm][k]) for k in range(len(MEASURES)) for arm in ARMS]
        for case, arms in found.items()
    ]
    note, missed = words(found)
    table.publish("own_body", TITLE, HEAD, rows, note, record=args.record)
    return int(missed)


def simulated(groups: Sequence[str], seeds: list[int], frames: int) -> Iterator[Case]:
    """Yield simulated walks by two cameras, made unless they are there."""
    for body in groups:
        for view in eval_cameras.VIEWS:
            for seed in seeds:
                folder, _ = eval_cameras.made(view, seed, frames, body=body)
                yield Case(folder, body, ((str(folder / "video_2.mp4"), str(folder / "camera_2.json")),))


def measured(case: Case) -> dict[str, tuple[float, ...]]:
    """Track with each body; return the `MEASURES` of each arm."""
    output = eval_cameras.FOLDER / f"body-{case.folder.name}.csv"
    output.parent.mkdir(parents=True, exist_ok=True)
    options = ClipOptions(
        str(case.folder / "video.mp4"), str(case.folder / "camera.json"), str(output), model=case.model,
        height=case.height, further=case.further, quiet=True,
    )  # fmt: skip
    scene = with_further_cameras(options, read_scene(options))
    first, default = FirstPass(), TrackerConfig.default
    start = first_state(options, scene)

    def varied(*words: object, **more: object) -> TrackerConfig:
        return default(*words, **more).replace(proportions=-1)  # type: ignore[arg-type]

    track_scene(options, scene, start, first.add)
    found = {"model": judged(case, output)}
    own = replace(scene, model=own_model(options, scene, first))
    track_scene(options, own, first_state(options, own))
    found["own"] = judged(case, output)
    with patch.object(TrackerConfig, "default", varied):
        track_scene(options, scene, start)
    return found | {"live": judged(case, output)}


def judged(case: Case, output: Path) -> tuple[float, ...]:
    """Compare a track with the truth: the `MEASURES`."""
    truth = read_truth(case.folder / "truth.csv")
    strikes = strikes_of(truth, case.folder / "meta.json")
    result = evaluate(read_estimates(output), truth, strikes=strikes, model=read_cyclic(case.model))
    shares = result["coverage"]["90"], result["status"]["tracking"]
    return result["root"]["median"], result["abs"]["median"], *(100 * share for share in shares)


def words(found: dict[Case, dict[str, tuple[float, ...]]]) -> tuple[str, bool]:
    """Sum up each group; return whether the own body is not better in one."""
    lines, missed = [], False
    for group in dict.fromkeys(case.group for case in found):
        arms = [found[case] for case in found if case.group == group]
        parts = []
        for arm in ARMS:
            poses, plain = (np.array([one[which][0] for one in arms]) for which in (arm, "model"))
            parts.append(f"{arm} {np.median(poses):.1f}, at most {poses.max():.1f}")
            if arm != "model":
                parts[-1] += f" (better in {(poses < plain).sum()} of {len(arms)})"
            missed |= arm == "own" and bool(np.median(poses) >= np.median(plain))
        lines.append(f"- {group}: {'; '.join(parts)}")
    text = (
        "pose: joints in space, the midpoints of the hips laid on each other; joints: as they stand; medians "
        "over the frames; inside: coordinates within their 90 % intervals. Median pose of the clips, mm:\n\n"
    )
    return text + "\n".join(lines), missed


if __name__ == "__main__":
    sys.exit(main())
