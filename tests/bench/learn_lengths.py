#!/usr/bin/env python3
"""Lengths of limbs from markers: each recording of a person separately, and all of them together.

.venv/bin/python tests/bench/learn_lengths.py ../shared/data/mocap/cmu_walk
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import table

from gait.errors import UserError
from gait.learn.corpus import load
from gait.learn.options import DEFAULT, LearnOptions
from gait.learn.solve import readers
from gait.learn.solve.body import Body
from gait.learn.solve.retarget import Measures, measure
from gait.reproducible import one_thread

MARKERS = "trc"  # folder beside the walks: a walk and a run of one person, markers of OpenSim
LIMBS = ("upper_arm", "forearm", "thigh", "shank", "foot")
NAMES = ("run", "walk")
COLUMNS = ("figure", "fitted", *NAMES, "apart")
NOTE = """\
A person's walk and run, {files}: each recording fitted separately,
and both with shared lengths (each recording keeps its own places of markers).  Left and right are averaged;
apart: difference between the two recordings.  Residual: root mean square distance of the markers from their
places on the fitted body.  Seconds: to read and fit both files one after the other, including the measuring
beforehand.
"""


def limbs(found: Measures) -> dict[str, float]:
    """Lengths by name, mm; left and right averaged."""
    return {name: 1000 * float(np.mean(getattr(found, name))) for name in LIMBS}


def rows(alone: list[Body], together: list[Body], seconds: tuple[float, float]) -> Iterable[list[Any]]:
    """Cells of the table."""
    kinds = {"each by itself": alone, "together": together}
    for limb in LIMBS:
        for kind, bodies in kinds.items():
            run, walk = (limbs(measure(body))[limb] for body in bodies)
            name = f"{limb.replace('_', ' ')}, mm"
            yield [name, kind, *(f"{mm:.1f}" for mm in (run, walk, abs(run - walk)))]
    for kind, bodies in kinds.items():
        yield ["residual, mm", kind, *(f"{1000 * (body.residual or np.nan):.2f}" for body in bodies), None]
    for kind, spent in zip(kinds, seconds, strict=True):
        yield ["seconds for both", kind, f"{spent:.1f}", None, None]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("source", type=Path, help="folder of walks; the markers are beside it")
    args = parser.parse_args()
    folder = args.source.parent / MARKERS
    paths = [folder / f"motion_capture_{name}.trc" for name in NAMES]
    with one_thread():
        begun = time.perf_counter()
        alone = [readers.read(path) for path in paths]
        middle = time.perf_counter()
        bodies = load.shared_lengths([(path, True) for path in paths], LearnOptions(subjects="folder"))
        held = [body.log_scales if body else None for body in bodies]
        together = [readers.read(path, DEFAULT, scales) for path, scales in zip(paths, held, strict=True)]
        seconds = middle - begun, time.perf_counter() - middle
    table.publish(
        "learn_lengths",
        "Lengths of limbs from two recordings of a person with markers",
        COLUMNS,
        rows(alone, together, seconds),
        NOTE.format(files=" and ".join(path.name for path in paths)),
    )
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except UserError as error:
        sys.exit(f"learn_lengths: {error}")
