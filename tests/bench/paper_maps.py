#!/usr/bin/env python3
"""What eqs. 10-13 of Ormoneit and others (2000) prefer: log-likelihoods of one step, as printed.

    paper_maps.py [--folder build/search_paper] [--record]

On the clips of search_paper.py the mean cycle is put at the true place and phase, or displaced, in one frame,
and either walks on as the person does to the next frame or stays.  The tables give the log-likelihood of that
next frame; maps over displacement and speed are drawn beside the clips.
"""

from __future__ import annotations

import argparse
import csv
import sys
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import search_paper
import table
from eval_clips import meta_of
from facts import facts
from matplotlib.figure import Figure
from paper_runs import Footage

from gait import Mode, Model, State, Tracker, TrackerConfig
from gait.motion.footfalls import strikes_of
from gait.progress import progress

FRAMES = range(4, 48, 4)
SETTINGS = {
    k: search_paper.BEFORE[k] for k in ("occluded_density", "surface_sd", "surface_tilt", "limb_points")
}
STILL = {name: 0.0 for name in search_paper.SPACE if name.endswith("_noise")} | {"stayed_nats": 0.0}
STEP = 33_333  # microseconds from frame to frame
#: Displacement along the way (m), across it (m), of the phase (strides).
PLACES = {
    "on the person": (0.0, 0.0, 0.0),
    "a quarter stride late": (0.0, 0.0, -0.25),
    "half a stride late": (0.0, 0.0, -0.5),
    "0.7 m behind": (-0.7, 0.0, 0.0),
    "0.7 m beside": (0.0, 0.7, 0.0),
}
SPEEDS = np.linspace(0, 2, 13)
ALONG, LATE = np.linspace(-1, 1, 21), np.linspace(-0.5, 0.5, 17)


class Probe:
    """The likelihood of one body in a clip."""

    def __init__(self, f: Footage, model: Model) -> None:
        config = TrackerConfig.default(Mode.PAPER, particles=16, **SETTINGS, **STILL)
        self.f, self.tracker = f, Tracker(model, f.camera, config)
        self.mean, sd = model.prior()
        self.exactly = replace(sd, **{x.name: np.zeros_like(getattr(sd, x.name)) for x in fields(sd)})
        with open(f.clip.truth, newline="", encoding="utf-8") as file:
            self.heading = [float(row["heading_rad"]) for row in csv.DictReader(file)]
        self.cycles = strikes_of(f.truth, f.clip.folder / "meta.json").cycles(f.truth.frame)
        self.stature = float(meta_of(f.clip.folder)["stature_m"])

    def state(self, k: int, along: float, across: float, late: float) -> State:
        """Mean cycle at the true place of frame k, displaced."""
        turn = self.heading[k]
        way = np.array([np.cos(turn), np.sin(turn), 0.0])
        left = np.array([-way[1], way[0], 0.0])
        return replace(
            self.mean,
            phase=float((self.cycles[k] + late) % 1.0),
            stride_hz=float((self.cycles[k + 1] - self.cycles[k]) * 1e6 / STEP),
            stature=self.stature,
            heading=turn,
            pelvis=self.f.truth.places["pelvis"][k] + along * way + across * left,
        )

    def nats(self, place: tuple[float, float, float], speed: float) -> float:
        """Mean log-likelihood of the next frame, having gone on at so many times the person's speed."""
        total = []
        for k in FRAMES:
            self.tracker.start(self.state(k, *place), self.exactly, STEP)
            self.tracker.step(self.f.frames[k].image, STEP)
            later = 2 * STEP if speed == 1 else STEP + max(1, round(speed * STEP))
            total.append(self.tracker.step(self.f.frames[k + 1].image, later).log_evidence)
        return float(np.mean(total))


def main() -> int:
    """Probe, draw and publish."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--folder", type=Path, default=search_paper.FOLDER)
    parser.add_argument("--record", action="store_true", help="publish the table")
    parser.add_argument("--draw", action="store_true", help="draw the maps, which takes some minutes")
    args = parser.parse_args()
    search = search_paper.Search(args.folder)
    rows = list[list[Any]]()
    with progress("clips", len(search.footage)) as update:
        for k, f in enumerate(search.footage):
            probe = Probe(f, search.model)
            view = search_paper.CLIPS[f.clip.name].view
            for name, place in PLACES.items():
                rows.append([f.clip.name, view, name, *(round(probe.nats(place, s), 1) for s in (1.0, 0.0))])
            if args.draw:
                draw(probe, args.folder / f"map_{f.clip.name}.png")
            update(k + 1)
    write = table.publish if args.record else lambda name, *rest, note="": table.show(*rest)
    columns = ("clip", "view", "the body is", "walks, nats", "rests, nats")
    write("paper_maps", "What the likelihood as printed prefers", columns, rows, note=about())
    return 0


def draw(probe: Probe, path: Path) -> None:
    """Draw the log-likelihood over speed and place, and over speed and phase."""
    figure = Figure(figsize=(11, 4.5), layout="constrained")
    along = [[probe.nats((d, 0.0, 0.0), s) for s in SPEEDS] for d in ALONG]
    late = [[probe.nats((0.0, 0.0, d), s) for s in SPEEDS] for d in LATE]
    for axes, values, at, words in zip(
        figure.subplots(1, 2),
        (along, late),
        (ALONG, LATE),
        ("m along the way", "strides of phase"),
        strict=True,
    ):
        shown = axes.imshow(values, origin="lower", aspect="auto", extent=(0, 2, at[0], at[-1]))
        figure.colorbar(shown, ax=axes, label="nats")
        axes.plot([1], [0], "r+", ms=14)
        axes.set_xlabel("speed / that of the person")
        axes.set_ylabel(f"displaced by, {words}")
    figure.savefig(path, dpi=80)


def about() -> str:
    """State what the table shows."""
    return f"""{facts("paper_maps.py --record")}

Mean log-likelihood (eqs. 10-13) of a frame given the one before, over {len(FRAMES)} frames, for the mean
cycle at the true state or displaced from it, which walks on with the person or rests between the two
frames.  The settings are those before the search.  A limb that lies on a static background and rests is
predicted best of all."""


if __name__ == "__main__":
    sys.exit(main())
