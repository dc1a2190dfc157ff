#!/usr/bin/env python3
"""Lifting people of any stature on floors that are not exactly where the camera file has them.

    make eval-lift, or lift_people.py

The development clips show six people near the mean stature on exact floors.  That is too few to judge
intervals of places, because an error of the stature or of the floor moves a whole clip.  Here other walks of
the same people, who are not in their priors, are made taller or shorter and placed higher or lower, and seen
by the cameras of the clips.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import eval_clips
import lift_stream
import lift_tracks
import numpy as np
import numpy.typing as npt
import table
from eval_plan import Clip

from gait.bindings.lifter import LiftConfig
from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import EVAL15, axis_rotation
from gait.camera.camera import Camera
from gait.io.track_file import Joints, read_truth
from gait.learn.options import SegmentOptions
from gait.learn.segments import motion as segment_motion
from gait.learn.solve import readers
from gait.lift.smooth import motion
from gait.progress import progress
from gait.reproducible import one_thread

Floats = npt.NDArray[np.float64]

RATE = 30.0  # frames per second
SHORTEST, LONGEST = 45, 150  # frames of a walk
WALKS, TIMES = 3, 2  # greatest number per person, and how often each is used
STATURE_SD, FLOOR_SD = motion.PEOPLE_SD, 0.03  # metres; what lifting assumes
COVERAGE = (0.80, 0.95)
SEED = 1


@dataclass(frozen=True)
class Walk:
    """A person's joints EVAL15 (T, 15, 3) in the world, and the camera."""

    clip: str
    places: Floats
    camera: Camera
    model: Path
    prior: SegmentPrior


@dataclass(frozen=True)
class Outcome:
    """Relative error and standard deviation of the distance, coverage in the world and about the hips."""

    off: float
    sd: float
    inside: float
    about: float


def main() -> int:
    """Publish the table; exit code 1 if the intervals of all together cover too little or too much."""
    if eval_clips.absent():
        return 0
    everyone, found = walks(np.random.default_rng(SEED)), []
    with one_thread(), progress("people", len(everyone)) as update:
        for done, walk in enumerate(everyone, 1):
            found.append((walk.clip, *_lifted(walk)))
            update(done)
    names = dict.fromkeys(walk.clip for walk in everyone)
    of = {name: [one for one in found if one[0] == name] for name in names}
    rows = [_row(name, its) for name, its in of.items()]
    rows.append(_row("all", found))
    _publish(rows)
    return "NO" in rows[-1]


def walks(rng: np.random.Generator) -> list[Walk]:
    """Walks of all clips' people, each of them `TIMES` in succession."""
    clips, paths = eval_clips.people()
    return [walk for clip in clips for walk in _walks(clip, paths[str(clip.subject)], rng)]


def _walks(clip: Clip, model: Path, rng: np.random.Generator) -> Iterator[Walk]:
    """Walks of the clip's person along the clip's path, other than the clip's own."""
    camera, prior = Camera.read(str(clip.camera)), SegmentPrior.load(model)
    own = str(eval_clips.meta_of(clip.folder)["mocap_trial"])
    middle, ahead = _way(read_truth(str(clip.truth)).eval15())
    for places in _recorded(str(clip.subject), own):
        start, heading = _way(places)
        turned = (places - start) @ axis_rotation(2, ahead - heading).T
        for _ in range(TIMES):
            stature = prior.stature + STATURE_SD * rng.normal()
            yield Walk(
                clip.name, stature * turned + [*middle[:2], FLOOR_SD * rng.normal()], camera, model, prior
            )


def _way(places: Floats) -> tuple[Floats, float]:
    """Position of the hips on the ground half way, (x, y, 0), and the walking direction, radians."""
    hips = places[:, lift_tracks.HIPS].mean(axis=1)
    step = hips[-1] - hips[0]
    return hips[len(hips) // 2] * (1.0, 1.0, 0.0), float(np.arctan2(step[1], step[0]))


def _recorded(subject: str, own: str) -> list[Floats]:
    """Joints (T, 15, 3), in statures, of some of a person's walks, except for one."""
    wanted, found = SegmentOptions(source="only", people=False, fps=RATE), []
    for path in sorted((eval_clips.MOCAP / subject).glob("*.amc")):
        read = segment_motion.of(path, readers.read(path), wanted)
        places = read.places[:, [read.names.index(name) for name in EVAL15]]
        places = places[np.isfinite(places).all(axis=(1, 2))]
        if path.stem != own and len(places) >= SHORTEST:
            found.append(places[:LONGEST])
    chosen = np.linspace(0, len(found) - 1, min(WALKS, len(found))).round().astype(int)
    return [found[k] for k in chosen]


def _lifted(walk: Walk) -> tuple[Outcome, Outcome]:
    """Lift a walk live and as a whole."""
    frames = np.arange(len(walk.places))
    joints = Joints(frames, frames / RATE, dict(zip(EVAL15, walk.places.transpose(1, 0, 2), strict=True)))
    tracks = lift_tracks.tracked(joints, walk.camera, lift_tracks.NOISE, lift_tracks.GAPS)
    at, places, sd, _ = lift_stream.streamed(tracks, walk.camera, walk.model, LiftConfig.default())
    live = _judged(walk, places, sd, None, walk.places[at])
    found = lift_tracks.lifted(walk.prior, tracks, walk.camera, lift_tracks.NOISE)
    order = [found.names.index(name) for name in EVAL15]
    whole = (found.places[:, order], found.sd[:, order], found.rooted_sd[:, order])
    return live, _judged(walk, *whole, walk.places)


def _judged(walk: Walk, places: Floats, sd: Floats, rooted_sd: Floats | None, truth: Floats) -> Outcome:
    ray = truth.mean(axis=1) + walk.camera.R.T @ walk.camera.t  # from the lens
    along = ray / np.linalg.norm(ray, axis=1, keepdims=True)
    far = np.linalg.norm(ray, axis=1)
    off = np.mean(((places - truth).mean(axis=1) * along).sum(axis=1) / far)
    predicted = np.mean(np.sqrt((sd.mean(axis=1) ** 2 * along**2).sum(axis=1)) / far)
    about = np.nan
    if rooted_sd is not None:
        apart = [lift_tracks.rooted(x, lift_tracks.HIPS) for x in (places, truth)]
        about = np.mean(np.abs(apart[0] - apart[1]) < lift_tracks.WITHIN * rooted_sd)
    inside = np.mean(np.abs(places - truth) < lift_tracks.WITHIN * sd)
    return Outcome(float(off), float(predicted), float(inside), float(about))


def _row(title: str, found: list[tuple[str, Outcome, Outcome]]) -> list[object]:
    """One row: mean and rms error of the distance and its standard deviation, percent, and coverage."""
    cells: list[object] = []
    for outcomes in ([live for _, live, _ in found], [whole for _, _, whole in found]):
        off = 100 * np.array([o.off for o in outcomes])
        sd = 100 * float(np.sqrt(np.mean([o.sd**2 for o in outcomes])))
        cells += [float(off.mean()), float(np.sqrt(np.mean(off**2))), sd]
        cells.append(float(np.mean([o.inside for o in outcomes])))
    about = float(np.mean([whole.about for _, _, whole in found]))
    met = all(COVERAGE[0] <= share <= COVERAGE[1] for share in (cells[3], cells[7], about))
    return [title, len(found), *cells, about, ("yes" if met else "NO") if title == "all" else ""]


def _publish(rows: list[list[object]]) -> None:
    note = (
        f"Other walks of the clips' people, made taller or shorter by {100 * STATURE_SD:g} cm and placed "
        f"higher or lower by {100 * FLOOR_SD:g} cm (standard deviations), seen by the clips' cameras with "
        f"{lift_tracks.NOISE:g} px of noise, {lift_tracks.GAPS:.0%} missing. mean, rms: error of the "
        "distance from the camera, percent (negative: too near); stated: the standard deviation of this "
        "error that the estimate reports. Coverage of the 90 % intervals of places, in the world and "
        f"about the hips; live and as a whole. Target for all together: coverage from {COVERAGE[0]:g} to "
        f"{COVERAGE[1]:g}."
    )
    head = ["clip", "walks", "live: mean %", "live: rms %", "live: stated %", "live: coverage"]
    head += ["whole: mean %", "whole: rms %", "whole: stated %", "whole: coverage", "about hips", "met"]
    table.publish("lift_people", "People of any stature", head, rows, note)


if __name__ == "__main__":
    sys.exit(main())
