#!/usr/bin/env python3
"""The person's body from one view: designs that estimate it, compared with the model's body.

    eval_one_view.py [--record] [--seeds 1,2] [--groups development table drawn]

The development clips, each with a model learnt without its subject, and walks of `gait simulate` by one
camera, of people with the proportions of textbooks (table) and with those of people who were recorded
(drawn).  With the detector, the stature known, and all defaults; --seeds are the tracker's.  Clips and tracks
are kept in build/eval-cameras.

- model     the model's body, as gait track does
- own       displaced joints from a first pass, as gait track --body auto does with several films
- live      proportions that vary among the particles (setting `proportions` of the tracker)
- lengths   thighs, shanks, upper arms and forearms of gait lift, half-way from the model's, as with --body
- true      the same with the true lengths
- mean      joints half-way between those of the model and those of gait lift, as gait track --body auto does
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import eval_cameras
import eval_clips
import lift_detector
import numpy as np
import table
from eval_own_body import Case
from numpy.typing import NDArray

from gait.bindings.config import TrackerConfig
from gait.bindings.model import Model
from gait.body.measured import MeasuredBody, model_of
from gait.body.skeleton import EVAL15, SIDES
from gait.errors import UserError
from gait.io.track_file import Joints, read_estimates, read_truth
from gait.lift.tracked import half_lifted
from gait.progress import progress
from gait.track.clip import ClipOptions, track_scene
from gait.track.first_state import first_state
from gait.track.own_body import FirstPass, own_model
from gait.track.read_scene import read_scene
from gait.track.scene import Scene
from gait.track.standing import Moved

GROUPS = "development", "table", "drawn"
ARMS = "model", "own", "live", "lengths", "true", "mean"
SIMULATED_SEED = 501
FRAMES = 90
LIMBS = {
    "thigh": ("hip", "knee"),
    "shank": ("knee", "ankle"),
    "upper_arm": ("shoulder", "elbow"),
    "forearm": ("elbow", "wrist"),
}
HIPS = [EVAL15.index(f"{side}_hip") for side in SIDES]
HEAD = ["clip", "group", *(f"{what} mm, {arm}" for what in ("pose", "joints") for arm in ARMS)]

Array = NDArray[np.float64]


def main() -> int:
    """Track with each design, compare, print."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--seeds", default="1,2")
    options.add_argument("--groups", nargs="+", choices=GROUPS, default=GROUPS)
    options.add_argument("--record", action="store_true")
    args = options.parse_args()
    if eval_clips.absent():
        return 0
    seeds = [int(word) for word in args.seeds.split(",")]
    found: dict[Case, Array] = {}
    cases = list(chosen(args.groups))
    with progress("clips", len(cases) * len(seeds)) as update:
        for case in cases:
            runs = []
            for seed in seeds:
                runs.append(measured(case, seed))
                update(len(found) * len(seeds) + len(runs))
            found[case] = np.mean(runs, axis=0)
            print(case.folder.name, found[case].round(1).tolist(), file=sys.stderr)
    rows = [[case.folder.name, case.group, *np.round(arms.T.ravel())] for case, arms in found.items()]
    table.publish("one_view", "The person's body from one view", HEAD, rows, words(found), record=args.record)
    return 0


def chosen(groups: Sequence[str]) -> Iterator[Case]:
    """Yield the clips of the groups; simulated ones are made unless they are there."""
    if "development" in groups:
        clips, models = eval_clips.people()
        for clip in clips:
            yield Case(clip.folder, "development", model=str(models[clip.subject or ""]))
    for body in (group for group in groups if group != "development"):
        for view in eval_cameras.VIEWS:
            folder, _ = eval_cameras.made(view, SIMULATED_SEED, FRAMES, body=body)
            yield Case(folder, body)


def measured(case: Case, seed: int) -> Array:
    """Track with each of `ARMS`; return errors of pose and joints (A, 2), mm."""
    output = eval_cameras.FOLDER / f"one-{case.folder.name}.csv"
    output.parent.mkdir(parents=True, exist_ok=True)
    options = ClipOptions(
        str(case.folder / "video.mp4"), str(case.folder / "camera.json"), str(output), model=case.model,
        height=eval_clips.meta_of(case.folder)["stature_m"], seed=seed, quiet=True,
    )  # fmt: skip
    scene, first, default = read_scene(options), FirstPass(), TrackerConfig.default
    truth = read_truth(case.folder / "truth.csv")

    def varied(*words: object, **more: object) -> TrackerConfig:
        return default(*words, **more).replace(proportions=-1)  # type: ignore[arg-type]

    def tracked(scene: Scene, moved: Moved | None = None) -> Joints:
        track_scene(options, scene, first_state(options, scene), moved=moved)
        return read_estimates(output)

    def with_lengths(lengths: dict[str, float]) -> Joints:
        body = MeasuredBody(options.height or 0.0, lengths)
        return tracked(replace(scene, model=Model(model_of(body, case.model))))

    def displaced() -> Joints | None:
        try:
            return tracked(replace(scene, model=own_model(options, scene, first)))
        except UserError:  # too few frames are `tracking`
            return None

    track_scene(options, scene, first_state(options, scene), first.add)
    plain = read_estimates(output)
    own = displaced()
    with patch.object(TrackerConfig, "default", varied):
        live = tracked(scene)
    ours, theirs = limbs(plain), limbs(lift(case, scene, options))
    halves = with_lengths({name: (ours[name] + theirs[name]) / 2 for name in LIMBS})
    true = with_lengths(limbs(truth))
    mean = tracked(scene, half_lifted(options, scene))
    return np.array([errors(motion, truth) for motion in (plain, own, live, halves, true, mean)])


def lift(case: Case, scene: Scene, options: ClipOptions) -> Joints:
    """Lift the detector's joints of the person with the same camera, model and stature."""
    output = Path(options.output).with_suffix(".lifted.csv")
    words = "-m", case.model, "--height", options.height
    lift_detector.lifted(scene.people[scene.person], case.folder / "camera.json", output, *words)
    return read_estimates(output)


def limbs(motion: Joints) -> dict[str, float]:
    """Lengths of `LIMBS`, medians over frames, means of both sides, metres."""
    return {
        name: float(np.mean([np.nanmedian(_apart(motion, f"{side}_{a}", f"{side}_{b}")) for side in SIDES]))
        for name, (a, b) in LIMBS.items()
    }


def _apart(motion: Joints, one: str, other: str) -> Array:
    """Distances (T,) of two joints, metres."""
    return np.asarray(np.linalg.norm(motion.places[one] - motion.places[other], axis=1))


def errors(motion: Joints | None, truth: Joints) -> tuple[float, float]:
    """Median errors of pose, with the midpoints of the hips laid on each other, and of joints, mm; or NaN."""
    if motion is None:
        return np.nan, np.nan
    _, rows, columns = np.intersect1d(motion.frame, truth.frame, return_indices=True)
    joints = motion.eval15()[rows] - truth.eval15()[columns]
    pose = joints - joints[:, HIPS].mean(axis=1, keepdims=True)
    first, second = (1000 * float(np.nanmedian(np.linalg.norm(off, axis=2))) for off in (pose, joints))
    return first, second


def words(found: dict[Case, Array]) -> str:
    """Sum up each group: means over the clips, and of the differences from the model's body."""
    lines = []
    for group in dict.fromkeys(case.group for case in found):
        clips = np.array([arms for case, arms in found.items() if case.group == group])
        parts = [f"model {clips[:, 0, 0].mean():.1f} and {clips[:, 0, 1].mean():.0f}"]
        for k, arm in enumerate(ARMS[1:], 1):
            more = clips[:, k] - clips[:, 0]
            more = more[np.isfinite(more[:, 0])]
            spread = more[:, 0].std(ddof=1) / np.sqrt(len(more))
            better = f"better in {(more[:, 0] < 0).sum()} of {len(more)}"
            pose, joints = more.mean(axis=0)
            parts.append(f"{arm} {pose:+.1f} (standard error {spread:.1f}, {better}) and {joints:+.0f}")
        lines.append(f"- {group}: {'; '.join(parts)}")
    arms = (__doc__ or "").split("\n\n", 3)[3]
    return (
        f"{arms}\nMedians over the frames, means over the tracker's seeds; pose: joints in space, the "
        "midpoints of the hips laid on each other; joints: as they stand. Means over the clips of pose and "
        "joints, mm, for designs what they add to the model's:\n\n" + "\n".join(lines)
    )


if __name__ == "__main__":
    sys.exit(main())
