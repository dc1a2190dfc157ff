#!/usr/bin/env python3
"""The live lifter (gait-trackd --lift, gait.Lifter) on tracks of the development clips.

make eval-lift, or lift_stream.py
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import eval_clips
import lift_tracks
import numpy as np
import numpy.typing as npt
import table
from eval_plan import Clip

from gait import TrackStatus
from gait.bindings.lifter import LiftConfig, Lifter
from gait.camera.camera import Camera
from gait.io.keypoints_file import Keypoints
from gait.io.track_file import read_truth

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

LEAST = 0.80  # coverage
WRONG = 0.05  # share of wrong points
MANY = 0.15  # share of wrong points with which the status shows what to rely on
SWAPPED = 10  # frames
STRICT = 4.0  # fit_threshold below the default


def main() -> int:
    """Publish the table; exit code 1 if the intervals of a clip cover too little."""
    if eval_clips.absent():
        return 0
    clips, paths = eval_clips.people()
    rows = [_row(clip, paths[str(clip.subject)]) for clip in clips]
    head = ["clip", "root mm", "abs mm", "coverage"]
    head += ["given: root mm", "given: abs mm", "given: coverage", "exact"]
    head += [f"{name}: {what}" for name in SPOILT for what in ("abs mm", "worst", "coverage")]
    head += [f"many: {what}" for what in ("tracked", "abs mm", "worst", "coverage")] + ["met"]
    note = (
        f"As for lift_dev, frame by frame with a lag of {LiftConfig.default().lag}. The stature is "
        "unknown, or given (the true one); exact: coverage if the mean stature is assumed to be the "
        f"person's (stature_sd 0). wrong: {WRONG:.0%} of the points are off by {lift_tracks.OFF:g} px "
        f"(standard deviation); legs: left and right swapped for {SWAPPED} frames; worst: largest error "
        f"of a frame, mm. many: {MANY:.0%} of the points are wrong; tracked: share of the frames reported "
        "as TRACKING, the only ones that count in these columns. Coverage of the 90 % intervals of "
        f"places in the world. Target: at least {LEAST:g} with unknown stature. Six people are too few to "
        "show whether the intervals are too large; see lift_people."
    )
    table.publish("lift_stream", "Live tracks of the development clips", head, rows, note)
    _unknown()
    return any("NO" in row for row in rows)


def _unknown() -> None:
    """Publish live results for a motion that the prior does not contain."""
    joints, cameras = lift_tracks.balancing()
    rows = []
    for name, camera in cameras.items():
        tracks = lift_tracks.tracked(joints, camera, lift_tracks.BALANCING_NOISE, 0.0)
        true = np.stack([joints.places[joint] for joint in tracks.names], axis=1)
        row: list[object] = [name]
        for threshold in (LiftConfig.default().fit_threshold, STRICT):
            config = LiftConfig.default(fit_threshold=threshold)
            at, found, sd, tracked = streamed(tracks, camera, None, config)
            apart = np.linalg.norm(found - true[at], axis=2).mean(axis=1)
            inside = np.mean(np.abs(found - true[at]) < lift_tracks.WITHIN * sd)
            row += [1000 * float(np.median(apart)), float(inside), float(tracked.mean())]
        rows.append(row)
    note = (
        "The balancing man with the shipped prior of walks, frame by frame, "
        f"{lift_tracks.BALANCING_NOISE:g} px of noise, with the default config and with fit_threshold "
        f"{STRICT:g}: median mm in the world, coverage of the 90 % intervals, share of the frames that "
        "are TRACKING. There is no target."
    )
    head = [f"{which}: {what}" for which in ("usual", "strict") for what in ("abs mm", "coverage", "tracked")]
    table.publish("lift_unknown", "A motion that no prior knows, live", ["camera", *head], rows, note)


def _wrong(tracks: Keypoints, share: float = WRONG) -> Keypoints:
    """Keypoints of a detector that puts single points elsewhere."""
    return lift_tracks.with_outliers(tracks, share, np.random.default_rng(2))


def _legs(tracks: Keypoints) -> Keypoints:
    """Keypoints of a detector that confuses the legs in the middle of the clip."""
    left, right = (
        [tracks.names.index(f"{side}_{joint}") for joint in ("hip", "knee", "ankle")] for side in "lr"
    )
    uv, begin = tracks.uv.copy(), (len(tracks.time) - SWAPPED) // 2
    uv[begin : begin + SWAPPED, left + right] = tracks.uv[begin : begin + SWAPPED, right + left]
    return replace(tracks, uv=uv)


SPOILT = {"wrong": _wrong, "legs": _legs}


def _row(clip: Clip, model: Path) -> list[object]:
    joints, camera = read_truth(str(clip.truth)), Camera.read(str(clip.camera))
    tracks = lift_tracks.tracked(joints, camera, lift_tracks.NOISE, lift_tracks.GAPS)
    usual, stature = LiftConfig.default(), eval_clips.meta_of(clip.folder)["stature_m"]

    def lifted(config: LiftConfig, observed: Keypoints = tracks) -> list[float]:
        return _judged(*streamed(observed, camera, model, config)[:3], joints.eval15())

    root, apart, _, share = lifted(usual)
    given = lifted(LiftConfig.default(stature=stature))
    exact = lifted(LiftConfig.default(stature_sd=0.0))
    spoilt = [value for spoil in SPOILT.values() for value in lifted(usual, spoil(tracks))[1:]]
    many = _many(tracks, camera, model, joints.eval15())
    met = min(share, *spoilt[2::3], many[3]) >= LEAST
    figures = [root, apart, share, *given[:2], given[3], exact[3], *spoilt, *many]
    return [clip.name, *figures, "yes" if met else "NO"]


def _many(tracks: Keypoints, camera: Camera, model: Path, true: Floats) -> list[float]:
    """Share of frames tracked with many wrong points; their median and worst error in mm, and coverage."""
    at, found, sd, tracked = streamed(_wrong(tracks, MANY), camera, model, LiftConfig.default())
    relied = at[tracked], found[tracked], sd[tracked]
    return [float(tracked.mean()), *_judged(*relied, true)[1:]]


def _judged(at: Ints, found: Floats, sd: Floats, true: Floats) -> list[float]:
    """Root-aligned and absolute error, median mm, the worst frame's, and coverage."""
    apart = 1000 * np.linalg.norm(found - true[at], axis=2).mean(axis=1)
    inside = np.mean(np.abs(found - true[at]) < lift_tracks.WITHIN * sd)
    root = lift_tracks.root_error(found, true[at], lift_tracks.HIPS)
    return [root, float(np.median(apart)), float(apart.max()), float(inside)]


def streamed(
    tracks: Keypoints, camera: Camera, model: Path | None, config: LiftConfig
) -> tuple[Ints, Floats, Floats, Flags]:
    """Frames (n) that the live lifter returns, joints and sd (n, P, 3), whether TRACKING (n)."""
    lifter = Lifter(model, camera, config)
    index = [lifter.names.index(name) for name in tracks.names]
    utimes = np.round(1e6 * tracks.time).astype(int)
    at, places, sds, tracked = [], [], [], []
    uv = np.full((len(lifter.names), 2), np.nan)
    for utime, observed in zip(utimes.tolist(), tracks.uv, strict=True):
        uv[index] = observed
        lifter.push(utime, uv)
        frame = lifter.estimate()
        if frame is not None and frame.status != TrackStatus.INIT:
            at.append(int(np.searchsorted(utimes, frame.utime)))
            places.append(frame.markers[index])
            sds.append(frame.sd[index])
            tracked.append(frame.status == TrackStatus.TRACKING)
    return np.array(at), np.array(places), np.array(sds), np.array(tracked)


if __name__ == "__main__":
    sys.exit(main())
