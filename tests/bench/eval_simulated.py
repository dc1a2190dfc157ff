"""Hard cases by `gait simulate`: paces, statures, views and light that the development clips lack.

Motions that simulate does not have are made from its clips (see `eval_edits`): standing still, walking
backwards, a second person, an occlusion, leaving the picture, no person.  Running is learnt from an OpenSim
recording.
Not made: sitting, stairs, carried things, a moving camera, sharp turns on the spot.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import eval_edits
from eval_clips import DATA

from gait.errors import UserError
from gait.simulate.clip import simulate
from gait.simulate.scenario import Scenario

RUNNER = DATA / "mocap" / "trc" / "motion_capture_run.trc"

CASES: dict[str, Scenario] = {
    "turning": Scenario(view="circle", frames=150, seed=41),
    "slow": Scenario(direction="rl", speed=0.6, frames=150, seed=42),
    "fast": Scenario(view="oblique", speed=1.9, frames=75, seed=43),
    "child": Scenario(view="oblique", stature=1.25, frames=100, seed=44),
    "tall": Scenario(view="above", stature=2.0, frames=90, seed=45),
    "away": Scenario(view="away", direction="rl", frames=110, seed=46),
    "dusk": Scenario(clutter=True, flicker=4.0, noise=8.0, frames=100, seed=47),
    "walk": Scenario(view="oblique", frames=110, seed=48),
    "side": Scenario(frames=110, seed=49),
    "crossing": Scenario(direction="rl", frames=110, seed=50),
}
RUN = Scenario(view="side", speed=2.45, stride_hz=1.33, frames=60, seed=51)
EDITS: dict[str, tuple[eval_edits.Edit, tuple[str, ...]]] = {
    "standing": (eval_edits.standing, ("walk",)),
    "stopping": (eval_edits.stopping, ("walk",)),
    "backwards": (eval_edits.backwards, ("walk",)),
    "hidden_1s": (eval_edits.hidden, ("side",)),
    "leaves": (eval_edits.leaves, ("side",)),
    "second_person": (eval_edits.second_person, ("side", "crossing")),
    "no_person": (eval_edits.no_person, ("side",)),
}


def make(folder: Path, jobs: int, update: Callable[[int], None]) -> None:
    """Make the cases that `folder` lacks; a case exists if its meta.json does."""
    folder.mkdir(parents=True, exist_ok=True)
    missing = {name: case for name, case in (CASES | running(folder)).items() if not _made(folder / name)}
    done = 0
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for _ in pool.map(_simulate, missing.values(), [folder / name for name in missing]):
            update(done := done + 1)
        edits = [name for name in EDITS if not _made(folder / name)]
        for _ in pool.map(_edit, edits, [folder] * len(edits)):
            update(done := done + 1)


def count() -> int:
    """Number of cases."""
    return len(CASES) + 1 + len(EDITS)


def _made(folder: Path) -> bool:
    return (folder / "meta.json").is_file()


def running(folder: Path) -> dict[str, Scenario]:
    """The runner's scenario, whose model is learnt first; nothing if the recording is absent."""
    if not RUNNER.is_file():
        return {}
    model = folder / "run.gait"
    if not model.is_file():
        words = ["learn", RUNNER, "-o", model, "--activity", "run", "--quiet"]
        done = subprocess.run(
            [sys.executable, "-m", "gait", *map(str, words)], capture_output=True, text=True
        )
        if done.returncode:
            raise UserError(f"gait learn of the runner: {done.stderr.strip()}")
    return {"running": replace(RUN, gait=str(model))}


def _simulate(scenario: Scenario, target: Path) -> None:
    """Make a clip beside its final place, then move it there as a whole."""
    making = target.with_name(f".{target.name}")
    simulate(scenario, making)
    shutil.rmtree(target, ignore_errors=True)
    making.rename(target)


def _edit(name: str, folder: Path) -> None:
    edit, sources = EDITS[name]
    making, target = folder / f".{name}", folder / name
    making.mkdir(exist_ok=True)
    changes = edit([folder / source for source in sources], making)
    meta = json.loads((folder / sources[0] / "meta.json").read_text()) | {"clip": name, **changes}
    (making / "meta.json").write_text(json.dumps(meta, indent=1) + "\n")
    shutil.rmtree(target, ignore_errors=True)
    making.rename(target)
