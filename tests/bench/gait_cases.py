"""Walks of `gait simulate` for eval_gait.py: slow, fast, asymmetric, with a stick, with crutches, usual.

Bodies are drawn from the proportions of the people that the package's model was learnt from.  Design choices
are made on people with other seeds (`--first-seed`) than those that are reported.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

from gait.simulate.clip import simulate
from gait.simulate.scenario import PRESETS, Scenario

SIZE = (400, 300)  # pixels; the tracker reduces the person to a height of 192
CASES: dict[str, Scenario] = {
    **{name: PRESETS[name] for name in ("slow", "fast", "limping", "stick", "crutches")},
    "usual": Scenario(frames=120, seed=81),
    "limping_side": Scenario(direction="rl", speed=0.9, asymmetry=-15.0, frames=140, seed=83),
}


def make(folder: Path, first_seed: int, jobs: int, update: Callable[[int], None]) -> None:
    """Make the walks that `folder` lacks; a walk exists if its meta.json does.

    `first_seed`: added to the seed of every person.
    """
    folder.mkdir(parents=True, exist_ok=True)
    missing = {
        name: replace(case, seed=case.seed + first_seed, body="drawn", size=SIZE)
        for name, case in CASES.items()
        if not (folder / name / "meta.json").is_file()
    }
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        places = [folder / name for name in missing]
        for done, _ in enumerate(pool.map(_simulate, missing.values(), places), 1):
            update(done)


def _simulate(scenario: Scenario, target: Path) -> None:
    """Make a clip beside its final place, then move it there as a whole."""
    making = target.with_name(f".{target.name}")
    simulate(scenario, making)
    shutil.rmtree(target, ignore_errors=True)
    making.rename(target)
