#!/usr/bin/env python3
"""Corrections by hand: how many are needed, proposed against random ones, and how long solving one takes.

make eval-studio, or studio_corrections.py

The experiment of Leventon and Freeman (1998), section 4, who made about one correction per frame in a
sequence of 100 frames.  The user is simulated: when asked for a joint in a frame, the user points at its true
place.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import eval_clips
import lift_detector
import numpy as np
import studio_page
import table
from facts import facts
from numpy.typing import NDArray

from gait.body.skeleton import EVAL15
from gait.detect import profile
from gait.io.track_file import read_truth
from gait.lift import picture
from gait.lift import run as lift_run
from gait.lift.keypoints.corrections import Correction, Edits, corrected
from gait.lift.run import Lifted, Prepared, Request
from gait.lift.smooth.interactive import Interactive
from gait.lift.smooth.options import Options
from gait.motion.evaluate import root_errors
from gait.progress import progress
from gait.reproducible import one_thread

Array = NDArray[np.float64]

CLIPS = ("side_rl_16", "above_38", "toward300_08")
"""Not the clips on which the rule for proposals was chosen: oblique45_07, side_lr_35, oblique45_pole_05.

On these clips the rule was compared with the one before it."""
LONG = "toward300_08"
FRAMES = 100
COUNTS = (5, 10, 20, 40, 70, 100)
SEEDS = 3
POINTING = 0.008  # of the person's height in the picture: standard deviation of a click
SOLVED = 30  # corrections that are timed
WANTED_S = 0.3


class Clip:
    """A clip with the detector's joints and the truth."""

    def __init__(self, folder: Path, frames: int) -> None:
        points = profile.corrected(lift_detector.joints(folder, "full"), "full").part(slice(frames))
        self.points = points
        self.prior = lift_run.load_prior(None, print)
        self.request = Request(Options(covariance=True), camera=str(folder / "camera.json"))
        self.prepared: Prepared = lift_run.prepare(
            folder.name, points, self.prior, self.request, lambda _: None, True
        )
        truth = read_truth(folder / "truth.csv")
        self.true = truth.eval15()[np.searchsorted(truth.frame, points.frame)]
        view = self.prepared.view
        assert isinstance(view, lift_run.Perspective)
        self.camera = view.camera
        self.uv = np.stack([self.camera.project(one) for one in self.true])
        self.tall = float(np.median(np.ptp(self.uv[..., 1], axis=1)))

    def lift(self, edits: Edits) -> Lifted:
        """Lift as the command does."""
        return lift_run.lift_prepared("", self.prepared, edits, self.prior, self.request, True)

    def click(self, row: int, joint: str, rng: np.random.Generator) -> Correction:
        """Point at the true place of a joint."""
        sd = POINTING * self.tall
        at = self.uv[row, EVAL15.index(joint)] + sd * rng.standard_normal(2)
        frame = int(self.prepared.keypoints.frame[row])
        return Correction(frame, joint, (float(at[0]), float(at[1])), sd)

    def errors(self, lifted: Lifted) -> tuple[float, float]:
        """Median error about the hips, mm, and in the picture, pixels."""
        motion = lifted.motion
        own = [motion.names.index(joint) for joint in EVAL15]
        assert motion.uv is not None
        off = np.linalg.norm(motion.uv[:, own] - self.uv, axis=2)
        return float(np.median(root_errors(motion.places[:, own], self.true))), float(
            np.median(off.mean(axis=1))
        )

    def proposed(self, lifted: Lifted, most: int) -> list[tuple[int, str]]:
        """Rows and joints that are suggested."""
        frame = lifted.keypoints.frame
        asked = [s for s in picture.suggestions(lifted, 3 * most) if s.joint in EVAL15]
        return [(int(np.searchsorted(frame, s.frame)), s.joint) for s in asked[:most]]


def course(clip: Clip, kind: str, seed: int, update: Callable[[], None]) -> list[tuple[float, float]]:
    """Errors after 0 and each of COUNTS corrections."""
    rng = np.random.default_rng(seed)
    lifted, edits = clip.lift(Edits()), Edits()
    found = [clip.errors(lifted)]
    for count in COUNTS:
        wanted = count - len(edits.corrections)
        asked = clip.proposed(lifted, wanted) if kind == "proposed" else []
        taken = {(c.frame, c.joint) for c in edits.corrections}
        rows = len(clip.true)
        while len(asked) < wanted:  # random ones, or all proposals are used up
            row, joint = int(rng.integers(rows)), EVAL15[rng.integers(len(EVAL15))]
            known = {(int(clip.prepared.keypoints.frame[r]), j) for r, j in asked} | taken
            if (int(clip.prepared.keypoints.frame[row]), joint) not in known:
                asked.append((row, joint))
        edits = Edits((*edits.corrections, *(clip.click(row, joint, rng) for row, joint in asked)))
        lifted = clip.lift(edits)
        found.append(clip.errors(lifted))
        update()
    return found


def solving(clip: Clip) -> tuple[Array, Array]:
    """Processor time and wall clock time of corrections of a long clip, seconds."""
    rng = np.random.default_rng(0)
    lifted, edits = clip.lift(Edits()), Edits()
    live = Interactive(
        clip.prior, clip.prepared.view, clip.prepared.options, lifted.keypoints.names, lifted.motion
    )
    spent = []
    for row, joint in clip.proposed(lifted, SOLVED):
        edits = Edits((*edits.corrections, clip.click(row, joint, rng)))
        frame = edits.corrections[-1].frame
        cpu, clock = time.process_time(), time.perf_counter()
        with one_thread():
            live.solve(
                corrected(clip.prepared.keypoints, edits, clip.prepared.options.pixel_sd),
                None,
                range(frame, frame + 1),
            )
        spent.append((time.process_time() - cpu, time.perf_counter() - clock))
    cpu_s, clock_s = np.array(spent).T
    return cpu_s, clock_s


def main() -> int:
    """Publish the table."""
    folder = eval_clips.DATA / "eval" / "dev"
    if not folder.is_dir():
        print(f"eval-studio: {folder} is not there, left out", file=sys.stderr)
        return 0
    rows, done = [], 0
    with progress("clips", len(CLIPS) * (1 + SEEDS) * len(COUNTS)) as show:

        def update() -> None:
            nonlocal done
            done += 1
            show(done)

        for name in CLIPS:
            clip = Clip(folder / name, FRAMES)
            for kind, seeds in (("proposed", 1), ("random", SEEDS)):
                runs = np.array([course(clip, kind, seed, update) for seed in range(seeds)]).mean(axis=0)
                for measure, values in zip(("mm", "px"), runs.T, strict=True):
                    rows.append([name, len(clip.true), kind, measure, *values])
    long = Clip(folder / LONG, 10_000)
    cpu, clock = solving(long)
    rng, frame = np.random.default_rng(0), long.prepared.keypoints.frame
    asked = long.proposed(long.lift(Edits()), SOLVED)
    drags = [(int(frame[row]), joint, long.click(row, joint, rng).uv) for row, joint in asked]
    painted = studio_page.seconds(folder / LONG, long.points, drags)
    verdict = "met" if cpu.max() <= WANTED_S else "MISSED"
    note = (
        f"{facts()}\n\n"
        f"The first {FRAMES} frames of clips on which the rule for proposals was compared with the one "
        "before it (it was chosen on other clips), with the detector's joints (`full`) and corrections "
        f"at the true joint with a noise of {100 * POINTING:g} % of the height. mm: median error about "
        "the hips; px: median error in the picture. proposed: joints that the studio lists, updated "
        f"after each column; random: any joint in any frame, mean of {SEEDS} runs. Leventon and Freeman "
        f"made about one correction per frame (last column). One correction of the {len(long.true)} "
        f"frames of {LONG} takes {np.median(cpu):.2f} s of one processor (longest {cpu.max():.2f}; wall "
        f"clock on this machine, {np.median(clock):.2f} and {clock.max():.2f}); target {WANTED_S:g} s "
        f"({verdict} in processor time)."
    )
    note += studio_page.words(painted, WANTED_S)
    head = ["clip", "frames", "corrections", "error", "0", *map(str, COUNTS)]
    table.publish("studio", "Corrections by hand", head, rows, note)
    return 0


if __name__ == "__main__":
    sys.exit(main())
