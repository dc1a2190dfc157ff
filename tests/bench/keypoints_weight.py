#!/usr/bin/env python3
"""Errors of the tracker by the weight of its keypoint term, on the development clips.

    keypoints_weight.py [CLIP...]

The keypoints are the true joints with errors of a detector's kind: one of each joint that lasts and one that
changes from frame to frame, shares of the person's height in the picture.  Their standard deviation is known,
as that of a profiled detector is.  Models leave out the person's subject.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

import eval_clips
import numpy as np
import table
from eval_plan import Clip
from facts import facts

from gait.bindings.abi import Term
from gait.bindings.config import TrackerConfig
from gait.bindings.frame import FrameKeypoints
from gait.bindings.initial import Start
from gait.bindings.model import Model
from gait.body.skeleton import EVAL15
from gait.camera.camera import Camera
from gait.io.track_file import read_truth
from gait.io.video import Video, background
from gait.motion.evaluate import root_errors
from gait.progress import progress
from gait.track.tracker import Tracker

WEIGHTS = (0.0, 2.0, 8.0, 32.0)
LASTS, CHANGES = 0.015, 0.01  # person's heights
FRAMES, PARTICLES, SEED = 60, 2000, 1


def main() -> int:
    """Track and publish the table."""
    if eval_clips.absent():
        return 0
    clips, paths = eval_clips.people(sys.argv[1:] or None)
    rows = []
    with progress("clips", len(clips)) as update:
        for done, clip in enumerate(clips, 1):
            model = Model(paths[str(clip.subject)])
            rows += [[clip.name, weight, *_errors(clip, model, weight)] for weight in WEIGHTS]
            update(done)
    for weight in WEIGHTS:
        mean = np.mean([row[2:] for row in rows if row[1] == weight], axis=0)
        rows.append(["mean", weight, *mean.tolist()])
    note = (
        f"{facts('tests/bench/keypoints_weight.py')}\n\n"
        f"The first {FRAMES} frames from a start near the truth, {PARTICLES} particles; keypoints off by "
        f"{100 * LASTS:g} % of the person's height that last and {100 * CHANGES:g} % that change. "
        "Root-aligned and absolute error of 15 joints, median over frames, mm. Weight 0: pictures alone; "
        "the default is 8."
    )
    table.publish(
        "keypoints_weight", "Weight of the keypoint term", ["clip", "weight", "root mm", "abs mm"], rows, note
    )
    return 0


def _errors(clip: Clip, model: Model, weight: float) -> list[float]:
    """Median root-aligned and absolute error, mm."""
    truth, video = read_truth(str(clip.truth)), Video(clip.video)
    camera = Camera.read(str(clip.camera), video.size)
    places = np.stack([truth.places[name] for name in EVAL15], axis=1)
    uv = camera.project(places.reshape(-1, 3)).reshape(*places.shape[:2], 2)
    tall = np.ptp(uv[..., 1], axis=1)
    rng = np.random.default_rng(SEED)
    off = LASTS * rng.normal(size=(1, len(EVAL15), 2)) + CHANGES * rng.normal(size=uv.shape)
    uv, sd = uv + tall[:, None, None] * off, np.hypot(LASTS, CHANGES) * tall
    plate = background(str(clip.plate) if clip.plate else "auto", video)
    config = TrackerConfig.default(particles=PARTICLES, keypoints_weight=weight)
    config = config.replace(terms=config.terms | Term.KEYPOINTS)
    tracker = Tracker(model, camera, config, background=plate)
    with tempfile.TemporaryDirectory() as folder:
        init = Path(folder) / "init.json"
        init.write_text(json.dumps(eval_clips.noisy_start(clip, SEED, 0.0)))
        start = Start.read(str(init), model)
    found, rows = [], []
    for frame in video.frames(start.frame, start.frame + FRAMES):
        if not found:
            tracker.start(start.mean, start.sd, frame.utime)
        row = int(np.searchsorted(truth.frame, frame.number))
        joints = FrameKeypoints(EVAL15, uv[row], float(sd[row]))
        now = tracker.step(frame.image, frame.utime, joints)
        found.append([now.joint(name) for name in EVAL15])
        rows.append(row)
    true = places[rows]
    apart = 1000 * np.linalg.norm(np.array(found) - true, axis=2).mean(axis=1)
    return [float(np.median(root_errors(np.array(found), true))), float(np.median(apart))]


if __name__ == "__main__":
    sys.exit(main())
