#!/usr/bin/env python3
"""Share of coordinates that intervals would cover if they were exactly right, clip by clip.

lift_coverage.py

The errors of a lift last: much of them is one error of distance and stature, which all coordinates of a clip
share.  Even if the intervals are right, the coverage of a single clip is therefore rarely near 90 %.  Truths
drawn from the lift's own covariance show how it would vary.
"""

from __future__ import annotations

import sys
from pathlib import Path

import eval_clips
import lift_detector
import lift_tracks
import numpy as np
import table
from facts import facts
from numpy.typing import NDArray

from gait.body.skeleton import EVAL15
from gait.detect import profile
from gait.io.track_file import read_truth
from gait.lift import run as lift_run
from gait.lift.keypoints.corrections import Edits
from gait.lift.smooth.options import Options
from gait.progress import progress

FRAMES, DRAWS = 6, 4000  # frames of a clip, evenly spaced; truths drawn for each
LOW, HIGH = 0.8, 0.95  # target for the coverage of a clip
HEAD = [
    "clip",
    "coverage",
    "drawn: mean",
    "median",
    "10 to 90 %",
    "in 0.8 to 0.95 %",
    "above %",
    "3 directions %",
]


def main() -> int:
    """Publish the table; exit code 0 also if the data are absent."""
    clips = sorted(path.parent for path in (eval_clips.DATA / "eval" / "dev").glob("*/truth.csv"))
    if not clips:
        print(f"lift_coverage: {eval_clips.DATA} is not there, left out", file=sys.stderr)
        return 0
    rows = []
    with progress("clips", len(clips)) as update:
        for done, clip in enumerate(clips, 1):
            rows.append(_row(clip))
            update(done)
    right, above = (float(np.mean([row[k] for row in rows])) for k in (5, 6))
    note = (
        "Joints of the detector (full), lifted as by `gait lift` with all defaults. coverage: share of "
        "the clip's true coordinates in their 90 % intervals. drawn: the same if the intervals are "
        f"right, for truths drawn from the covariance of a frame, {DRAWS} in each of {FRAMES} frames: "
        "mean, median and quantiles of the share of a frame's coordinates that is covered, how often it "
        f"is from {LOW:g} to {HIGH:g}, and how often above. 3 directions: share of the variance in the "
        "three principal directions of the joints together.\n\n"
        f"If the intervals are right, {right:.0f} % of the frames have a coverage from {LOW:g} to "
        f"{HIGH:g}, and {above:.0f} % a higher one; as far as errors last, a whole clip behaves like one "
        "frame."
    )
    table.publish(
        "lift_coverage",
        "Coverage of right intervals",
        HEAD,
        rows,
        f"{facts()}\n\n{note}",
    )
    return 0


def _row(clip: Path) -> list[object]:
    """Lift a clip, and draw truths from the result."""
    points = profile.corrected(lift_detector.joints(clip, "full"), "full")
    prior = lift_run.load_prior(None, print)
    request = lift_run.Request(Options(covariance=True), camera=str(clip / "camera.json"))
    prepared = lift_run.prepare(clip.name, points, prior, request, lambda _: None, True)
    found = lift_run.lift_prepared(clip.name, prepared, Edits(), prior, request, True).motion
    assert found.covariance is not None
    of = [found.names.index(name) for name in EVAL15]
    truth = read_truth(clip / "truth.csv")
    true = truth.eval15()[np.searchsorted(truth.frame, points.frame)]
    inside = np.abs(found.places[:, of] - true) < lift_tracks.WITHIN * found.sd[:, of]
    coordinates = (3 * np.array(of)[:, None] + np.arange(3)).ravel()
    frames = np.linspace(0, len(found.covariance) - 1, FRAMES).astype(int)
    covariances = found.covariance[frames][:, coordinates[:, None], coordinates]
    shares = np.concatenate([_drawn(one, seed) for seed, one in enumerate(covariances)])
    variances = np.linalg.eigvalsh(covariances)
    low, middle, high = np.quantile(shares, (0.1, 0.5, 0.9))
    return [
        *(clip.name, float(inside.mean()), float(shares.mean()), float(middle), f"{low:.2f} to {high:.2f}"),
        100 * float(((shares >= LOW) & (shares <= HIGH)).mean()),
        100 * float((shares > HIGH).mean()),
        100 * float((variances[:, -3:].sum(axis=1) / variances.sum(axis=1)).mean()),
    ]


def _drawn(covariance: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
    """Share of coordinates in their 90 % intervals, of errors drawn from a covariance."""
    values, vectors = np.linalg.eigh(covariance)
    normal = np.random.default_rng(seed).normal(size=(DRAWS, len(values)))
    errors = normal * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
    return np.asarray((np.abs(errors) < lift_tracks.WITHIN * np.sqrt(np.diag(covariance))).mean(axis=1))


if __name__ == "__main__":
    sys.exit(main())
