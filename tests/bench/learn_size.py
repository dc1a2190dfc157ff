#!/usr/bin/env python3
"""How large a model of five components is, and the error due to its phases and its series in section PACE.

.venv/bin/python tests/bench/learn_size.py ../shared/data/mocap/cmu_walk
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
import table

from gait.body.model_curves import series, waves
from gait.body.skeleton import default_skeleton, points
from gait.errors import UserError
from gait.io import blob
from gait.learn.cycles.fourier import CYCLE_HARMONICS
from gait.learn.cycles.sequence import load
from gait.learn.options import LearnOptions
from gait.learn.prior import fit, model, people
from gait.reproducible import one_thread

Floats = npt.NDArray[np.float64]

COMPONENTS, LIMIT = 5, 100_000  # target, bytes
TERMS = 2 * CYCLE_HARMONICS + 1  # harmonics of the curves as they are learnt; none is cut off
PHASES = (fit.CYCLE_SAMPLES, 128)  # the second is the reference's
FINE = 32  # points between two phases
COLUMNS = ("measure", "case", "figure", "value", "wanted", "met")


def interpolated(curve: Floats, phases: int) -> tuple[Floats, Floats]:
    """Evaluate a band-limited curve between so many phases, linearly and exactly, (FINE phases, M) each."""
    rows = series(curve, TERMS)
    known, true = (waves(TERMS, n).T @ rows for n in (phases, FINE * phases))
    share = (np.arange(FINE) / FINE)[:, None]
    ends = known[:, None], np.roll(known, -1, axis=0)[:, None]
    return (ends[0] * (1 - share) + ends[1] * share).reshape(true.shape), true


def distance(learned: fit.Learned, one: Floats, other: Floats) -> float:
    """Root mean square distance of the points about the pelvis, mm, of two intervals of channels (n, M)."""
    sections = default_skeleton(learned.proportions).sections()
    off = points(sections, one) - points(sections, other)
    return 1000 * people.ADULT_STATURE[0] * float(np.sqrt(np.mean(np.sum(off**2, axis=-1))))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("source", type=Path, help="folder of .amc walks")
    args = parser.parse_args()
    paths = sorted(args.source.rglob("*.amc"))
    if not paths:
        print(f"learn_size: {args.source}: no .amc files; name the folder of walks", file=sys.stderr)
        return 1
    with one_thread():
        learned = fit.fit([load(path) for path in paths], LearnOptions(components=COMPONENTS))
        size = len(blob.encode(model.sections(learned, LearnOptions())))
        paces = learned.paces[learned.cycles.sequence]
        whole = people.pace_slope(learned.components.filled, learned.row_subject, paces, TERMS)
    mean = learned.components.mean
    cut = distance(learned, mean + learned.pace_curve, mean + whole)
    rows = [
        ("size", f"{COMPONENTS} components", "bytes", size, f"< {LIMIT}", "yes" if size < LIMIT else "NO"),
        ("size", "series of PACE cut off, one sd from the mean rate", "joints, mm", cut, "", ""),
    ]
    for phases in PHASES:
        off = distance(learned, *interpolated(mean, phases))
        rows.append(("size", f"linear between {phases} phases", "joints, mm", off, "", ""))
    table.publish(
        "learn_size",
        "Size of a model",
        COLUMNS,
        rows,
        f"The cyclic model of {len(paths)} walks, without the prior over segments, and the error due to "
        "its limited size: root mean square over joints and phases, relative to the pelvis.",
    )
    return 0 if size < LIMIT else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except UserError as error:
        sys.exit(f"learn_size: {error}")
