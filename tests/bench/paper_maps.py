#!/usr/bin/env python3
"""What eqs. 10-13 of Ormoneit and others (2000) prefer: log-likelihoods of one step, as printed.

    paper_maps.py [--folder build/search_paper] [--record]

On the clips of search_paper.py, the mean cycle is put at the true place and phase in one frame, or displaced
from it, and then either walks to the next frame as the person does or stays.  The tables give the
log-likelihood of that next frame: in total with the settings before the search, and by term with the settings
that the search chose.  Maps over displacement and speed are drawn beside the clips.
"""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import search_paper
import table
from eval_clips import meta_of
from facts import facts
from matplotlib.figure import Figure
from paper_runs import Footage

from gait import Mode, Model
from gait.paper import freeze, preference
from gait.progress import progress

SETTINGS = {
    k: search_paper.BEFORE[k] for k in ("occluded_density", "surface_sd", "surface_tilt", "limb_points")
}
SPEEDS = np.linspace(0, 2, 13)
ALONG, LATE = np.linspace(-1, 1, 21), np.linspace(-0.5, 0.5, 17)


def probe_of(f: Footage, model: Model) -> preference.Probe:
    """The likelihood of one body in a clip, with the settings before the search."""
    assert f.scene is not None
    config = preference.config(Mode.PAPER, stayed_nats=0.0, **SETTINGS)
    return preference.Probe(f.scene, model, config, float(meta_of(f.clip.folder)["stature_m"]))


def frozen(f: Footage, model: Model) -> freeze.Freeze:
    """Terms of the true body and of the best motionless one in a clip, with the settings of paper mode."""
    assert f.scene is not None
    size = float(meta_of(f.clip.folder)["stature_m"])
    rows = preference.Probe(f.scene, model, preference.config(Mode.PAPER), size).table()
    return freeze.examine(f.scene, model, size, rows)


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
    rows, found = list[list[Any]](), list[freeze.Freeze]()
    with progress("clips", len(search.footage)) as update:
        for k, f in enumerate(search.footage):
            probe = probe_of(f, search.model)
            view = search_paper.CLIPS[f.clip.name].view
            rows += [[f.clip.name, view, name, *(round(x, 1) for x in nats)] for name, *nats in probe.table()]
            found.append(frozen(f, search.model))
            if args.draw:
                draw(probe, args.folder / f"map_{f.clip.name}.png")
            update(k + 1)
    write = partial(table.publish, record=args.record)
    columns = ("clip", "view", "the body is", "walks, nats", "rests, nats")
    terms = [
        [name, *(f"{x:+.1f}" for f in found for x in (f.walks.terms[name], f.rests.terms[name]))]
        for name in found[0].walks.terms
    ]
    terms.append(["log-likelihood", *(f"{x:+.1f}" for f in found for x in (f.walks.total, f.rests.total))])
    heads = ("nats", *(word for f in found for word in (f"{f.scene.name} walks", "rests")))
    write("paper_terms", "Which term of the likelihood prefers rest", heads, terms, note=about_terms(found))
    write("paper_maps", "What the likelihood as printed prefers", columns, rows, note=about())
    return 0


def draw(probe: preference.Probe, path: Path) -> None:
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
    return f"""{facts()}

Mean log-likelihood (eqs. 10-13) of a frame given the one before, over 11 frames. The body has the mean cycle,
at the true state or displaced from it; between the two frames it walks on with the person or stands still.
The settings are those before the search. A motionless limb on a static background is predicted perfectly,
except for noise."""


def about_terms(found: list[freeze.Freeze]) -> str:
    """State what the table of terms shows."""
    places = ", ".join(f"{f.scene.name} {f.place}" for f in found)
    gains = ", ".join(f"{f.scene.name} {e:+.1f} and {rest:+.1f}" for f in found for e, rest in (f.causes(),))
    return f"""{facts()}

Log-likelihood in nats of a frame given the one before, in paper mode, relative to limbs that face the camera,
are fully visible and do not change: for the true, walking body and for the best body at rest on the
background ({places}). Terms are added in the order of the rows (q, p_occluded, sigma(alpha), then E limb by
limb); the last row is their sum. By how much all E together, and all other terms, prefer the body at rest:
{gains}."""


if __name__ == "__main__":
    sys.exit(main())
