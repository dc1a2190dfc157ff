#!/usr/bin/env python3
"""gait lift with a detector that swaps left and right for some frames.

make eval-lift, or lift_sides.py
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace

import eval_clips
import lift_people
import lift_tracks
import numpy as np
import numpy.typing as npt
import table

from gait.body.skeleton import EVAL15
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.io.track_file import Joints
from gait.lift.keypoints import noise, swaps
from gait.lift.segment.view import Perspective
from gait.lift.smooth import motion
from gait.lift.smooth.motion import Options
from gait.progress import progress
from gait.reproducible import one_thread

Floats = npt.NDArray[np.float64]

LEGS = ("hip", "knee", "ankle")
PARTS = {"legs": LEGS, "legs and arms": (*LEGS, "shoulder", "elbow", "wrist"), "nothing": ()}
SEED = 11
EACH, APART = 3, 4  # cases of a walk, and their distance in the list


@dataclass(frozen=True)
class Case:
    """What is swapped, for how many frames, at how many frames per second, with what share of outliers."""

    part: str
    length: int
    rate: float = lift_people.RATE
    outliers: float = 0.0


CASES = (
    Case("legs", 5),
    Case("legs", 10),
    Case("legs", 20),
    Case("legs and arms", 5),
    Case("legs and arms", 10),
    Case("legs and arms", 20),
    Case("legs", 10, outliers=0.05),
    Case("legs", 5, rate=15.0),
    Case("legs", 5, rate=10.0),
    Case("nothing", 20, outliers=0.05),
    Case("nothing", 20, outliers=0.1),
)


def main() -> int:
    """Publish the table; it has no targets."""
    if eval_clips.absent():
        return 0
    rng = np.random.default_rng(SEED)
    walks = lift_people.walks(rng)[:: lift_people.TIMES]
    found: dict[Case, list[list[float]]] = {case: [] for case in CASES}
    with one_thread(), progress("walks", len(walks)) as update:
        for done, walk in enumerate(walks, 1):
            for k in range(done, done + EACH * APART, APART):
                case = CASES[k % len(CASES)]
                found[case].append(_case(walk, case, rng))
            update(done)
    _publish(found)
    return 0


def _case(walk: lift_people.Walk, case: Case, rng: np.random.Generator) -> list[float]:
    """Root errors of a walk as seen, swapped and put back, and the time of putting back in lifts.

    Then the numbers of points swapped, left wrong and moved although they were right.
    """
    places = walk.places[:: round(lift_people.RATE / case.rate)]
    frames = np.arange(len(places))
    true = Joints(frames, frames / case.rate, dict(zip(EVAL15, places.transpose(1, 0, 2), strict=True)))
    tracks = lift_tracks.tracked(true, walk.camera, lift_tracks.NOISE, lift_tracks.GAPS)
    tracks = lift_tracks.with_outliers(tracks, case.outliers, rng)
    begin = int(rng.integers(1, len(frames) - case.length))
    spoilt = swapped(tracks, PARTS[case.part], begin, begin + case.length)
    clock = [time.perf_counter()]
    back = undo_swaps(walk, spoilt)
    clock.append(time.perf_counter())
    errors = []
    for observed in (tracks, spoilt, back):
        errors.append(_error(walk, observed, places, slice(begin, begin + case.length)))
        clock.append(time.perf_counter())
    judging, lifting = clock[1] - clock[0], clock[2] - clock[1]
    right = spoilt.visible & (spoilt.uv == tracks.uv).all(axis=2)
    moved = (_differ(back, tracks, among) for among in (~right, right))
    return [*errors, judging / lifting, (spoilt.visible & ~right).sum(), *moved]


def _error(walk: lift_people.Walk, observed: Keypoints, places: Floats, rows: slice) -> float:
    """Root error of a walk in some rows, mm; infinite if its lift fails."""
    steady, _ = noise.without_spikes(observed, lift_tracks.NOISE)
    try:
        lifted = lift_tracks.lifted(walk.prior, steady, walk.camera, lift_tracks.NOISE)
    except UserError:
        return float("inf")
    order = [lifted.names.index(name) for name in EVAL15]
    return lift_tracks.root_error(lifted.places[:, order][rows], places[rows], lift_tracks.HIPS)


def undo_swaps(walk: lift_people.Walk, tracks: Keypoints) -> Keypoints:
    """Keypoints with sides put back as by gait lift."""
    view, options = Perspective(walk.camera), Options(pixel_sd=lift_tracks.NOISE)
    evidence = motion.Evidence(walk.prior, tracks.names, view, options)
    return swaps.undo_swaps(tracks, options.pixel_sd, evidence)[0]


def swapped(tracks: Keypoints, joints: tuple[str, ...], begin: int, end: int) -> Keypoints:
    """Keypoints with left and right of joints swapped in some rows."""
    left, right = ([tracks.names.index(f"{side}_{joint}") for joint in joints] for side in "lr")
    uv = tracks.uv.copy()
    uv[begin:end, left + right] = tracks.uv[begin:end, right + left]
    return replace(tracks, uv=uv)


def _differ(one: Keypoints, other: Keypoints, among: npt.NDArray[np.bool_]) -> int:
    """Number of the chosen points that differ from those of the other tracks."""
    return int((among & one.visible & (one.uv != other.uv).any(axis=2)).sum())


def _publish(found: dict[Case, list[list[float]]]) -> None:
    rows = []
    for case, walks in found.items():
        values = np.array(walks)
        medians, points = np.median(values[:, :4], axis=0), values[:, 4:].sum(axis=0).astype(int)
        rows.append(
            [
                *(case.part, case.length, case.rate, f"{case.outliers:.0%}", len(walks), *medians),
                *(*points.tolist(), int(np.isinf(values[:, 1]).sum()), int(np.isinf(values[:, 2]).sum())),
            ]
        )
    note = (
        "Other walks of the clips' people as in lift_people, 3 px of noise, 10 % missing, some of the "
        f"rest outliers ({lift_tracks.OFF:g} px); left and right are swapped in one interval of frames. "
        "Root-aligned error in that interval, median mm: as observed; swapped (--keep-sides); put back (the "
        "default of gait lift). Lifts: time of putting back, as a multiple of the time of a lift of the "
        "tracks as seen, median. Then the number of points swapped, of these the number still wrong "
        "after putting back, and the number of right points that were moved. Refused: walks for which no "
        "size of a person fits, swapped and put back; their error counts as infinite."
    )
    head = [
        "swapped",
        "frames",
        "frames/s",
        "outliers",
        "walks",
        "right mm",
        "swapped mm",
        "put back mm",
        "lifts",
        "points",
        "left",
        "false",
        "refused",
        "put back refused",
    ]
    table.publish("lift_sides", "Left and right swapped", head, rows, note)


if __name__ == "__main__":
    sys.exit(main())
