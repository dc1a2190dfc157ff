#!/usr/bin/env python3
"""gait lift if the tracks contain only a part of the body: errors and coverage of the intervals.

make eval-lift, or lift_parts.py
"""

from __future__ import annotations

import sys
from dataclasses import replace

import eval_clips
import lift_tracks
import numpy as np
import table

from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import EVAL15
from gait.camera.camera import Camera
from gait.io.keypoints_file import Keypoints
from gait.io.track_file import read_truth
from gait.lift.smooth.size import shows_distance
from gait.progress import progress
from gait.reproducible import one_thread

PARTS = {
    "all": EVAL15,
    "one side": [name for name in EVAL15 if name.startswith("r_")],
    "hips to ankles": [n for n in EVAL15 if n.endswith(("_hip", "_knee", "_ankle"))],
    "knees, ankles": [n for n in EVAL15 if n.endswith(("_knee", "_ankle"))],
    "hips and above": [n for n in EVAL15 if not n.endswith(("_knee", "_ankle"))],
    "hips, shoulders": [n for n in EVAL15 if n.endswith(("_hip", "_shoulder"))],
    "arms": [n for n in EVAL15 if n.endswith(("_shoulder", "_elbow", "_wrist"))],
}


def main() -> int:
    """Publish the table; it has no targets."""
    if eval_clips.absent():
        return 0
    clips, models = eval_clips.people()
    measured: dict[str, list[list[float]]] = {part: [] for part in PARTS}
    reported = {}
    with one_thread(), progress("clips", len(clips)) as update:
        for done, clip in enumerate(clips, 1):
            prior = SegmentPrior.load(models[str(clip.subject)])
            joints, camera = read_truth(str(clip.truth)), Camera.read(str(clip.camera))
            whole = lift_tracks.tracked(joints, camera, lift_tracks.NOISE, lift_tracks.GAPS)
            for part, names in PARTS.items():
                tracks = _part(whole, names)
                found = lift_tracks.lifted(prior, tracks, camera, lift_tracks.NOISE)
                measured[part].append(lift_tracks.judged(found, joints.eval15()))
                reported[part] = shows_distance(tracks)
            update(done)
    _publish(measured, reported)
    return 0


def _part(whole: Keypoints, names: list[str]) -> Keypoints:
    """Keypoints of some joints only."""
    kept = [i for i, name in enumerate(whole.names) if name in names]
    return replace(
        whole,
        names=tuple(whole.names[i] for i in kept),
        uv=whole.uv[:, kept],
        confidence=whole.confidence[:, kept],
    )


def _publish(measured: dict[str, list[list[float]]], reported: dict[str, bool]) -> None:
    rows = []
    for part, clips in measured.items():
        root, far, share = np.array(clips).T
        worst = [root.max(), far.max(), share.min()]
        middle = [np.median(root), np.median(far), np.median(share)]
        rows.append(["parts", part, *np.ravel([middle, worst], order="F"), "" if reported[part] else "yes"])
    head = ["root mm", "worst root", "abs mm", "worst abs", "coverage", "least coverage"]
    note = (
        "The development clips with only these joints in the tracks; all 15 joints are judged. Medians "
        "and the worst over the clips: root-aligned and absolute error, share of coordinates in their 90 "
        "% intervals. warns: whether gait lift warns that the tracks hardly show how far away the person "
        "is."
    )
    table.publish("lift_parts", "Parts of the body", ["measure", "seen", *head, "warns"], rows, note)


if __name__ == "__main__":
    sys.exit(main())
