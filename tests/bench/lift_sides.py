#!/usr/bin/env python3
"""gait lift where a detector exchanges left and right for some frames.

make eval-lift, or lift_sides.py
"""

from __future__ import annotations

import sys
from dataclasses import replace

import eval_clips
import lift_people
import lift_tracks
import numpy as np
import table

from gait.body.skeleton import EVAL15
from gait.learn.stage import one_thread
from gait.lift import sides
from gait.lift.tracks_file import Tracks
from gait.motion.trackfile import Joints
from gait.progress import progress

LEGS = ("hip", "knee", "ankle")
PARTS = {"legs": LEGS, "legs and arms": (*LEGS, "shoulder", "elbow", "wrist")}
LENGTHS = (5, 10, 20)  # frames; most frames of a walk are right
SEED = 11


def main() -> int:
    """Publish the table; nothing is wanted of it."""
    if not eval_clips.DATA.is_dir():
        print(f"lift_sides: {eval_clips.DATA} is not there, left out", file=sys.stderr)
        return 0
    rng = np.random.default_rng(SEED)
    walks = lift_people.walks(rng)[:: lift_people.TIMES]
    cases = [(part, length) for part in PARTS for length in LENGTHS]
    found: dict[tuple[str, int], list[list[float]]] = {case: [] for case in cases}
    with one_thread(), progress("walks", len(walks)) as update:
        for done, walk in enumerate(walks, 1):
            for part, length in (cases[done % len(cases)], cases[(done + 3) % len(cases)]):
                found[part, length].append(_case(walk, PARTS[part], length, rng))
            update(done)
    _publish(found)
    return 0


def _case(
    walk: lift_people.Walk, joints: tuple[str, ...], length: int, rng: np.random.Generator
) -> list[float]:
    """Root errors of a walk as seen, exchanged and put back; points exchanged, left so and moved in vain."""
    frames = np.arange(len(walk.places))
    true = Joints(
        frames, frames / lift_people.RATE, dict(zip(EVAL15, walk.places.transpose(1, 0, 2), strict=True))
    )
    tracks = lift_tracks.tracked(true, walk.camera, lift_tracks.NOISE, lift_tracks.GAPS)
    begin = int(rng.integers(1, len(frames) - length))
    spoilt = exchanged(tracks, joints, begin, begin + length)
    back, _ = sides.put_back(spoilt, lift_tracks.NOISE)
    none, _ = sides.put_back(tracks, lift_tracks.NOISE)
    errors = []
    for seen in (tracks, spoilt, back):
        motion = lift_tracks.lifted(walk.prior, seen, walk.camera, lift_tracks.NOISE)
        order = [motion.names.index(name) for name in EVAL15]
        errors.append(
            lift_tracks.root_error(
                motion.places[:, order][begin : begin + length],
                walk.places[begin : begin + length],
                lift_tracks.HIPS,
            )
        )
    return [*errors, _differ(spoilt, tracks), _differ(back, tracks), _differ(none, tracks)]


def exchanged(tracks: Tracks, joints: tuple[str, ...], begin: int, end: int) -> Tracks:
    """Tracks with left and right of joints exchanged in some rows."""
    left, right = ([tracks.names.index(f"{side}_{joint}") for joint in joints] for side in "lr")
    uv = tracks.uv.copy()
    uv[begin:end, left + right] = tracks.uv[begin:end, right + left]
    return replace(tracks, uv=uv)


def _differ(one: Tracks, other: Tracks) -> float:
    """Points that are not where the other tracks have them."""
    return float((one.seen & (one.uv != other.uv).any(axis=2)).sum())


def _publish(found: dict[tuple[str, int], list[list[float]]]) -> None:
    rows = []
    for (part, length), walks in found.items():
        values = np.array(walks)
        errors, points = values[:, :3], values[:, 3:]
        rows.append(
            [part, length, len(walks), *np.median(errors, axis=0), *points.sum(axis=0).astype(int).tolist()]
        )
    note = (
        "Other walks of the clips' people as in lift_people, 3 px of noise, 10 % missing; in one stretch of "
        "frames left and right are exchanged. Root-aligned error in that stretch, median mm: as seen, "
        "exchanged (--keep-sides), put back (gait lift by itself). Points exchanged; of these and others, "
        "those still wrong after putting back, and those moved where nothing was exchanged."
    )
    head = [
        "exchanged",
        "frames",
        "walks",
        "right mm",
        "exchanged mm",
        "put back mm",
        "points",
        "left",
        "false",
    ]
    table.publish("lift_sides", "Left and right exchanged", head, rows, note)


if __name__ == "__main__":
    sys.exit(main())
