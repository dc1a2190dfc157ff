"""Walks with known joints for the detector's profile: the gait of each recorded person on a rendered body.

None of the people is in a development clip.  The number of the clip determines body, clothes, scene and
light; views, sizes and distances alternate.  Clips that already exist in the folder are kept.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from eval_clips import DATA

from gait.errors import UserError
from gait.learn import run as learning
from gait.learn.options import LearnOptions
from gait.simulate.clip import simulate
from gait.simulate.scenario import Scenario

PEOPLE = ("cmu_walk/02", "cmu_walk/06", *(f"more/{lab}/*" for lab in (
    "btk", "gaitalytics", "bvhtoolbox", "opensim", "cmu_more", "mcgill"
)))  # fmt: skip
VIEWS = ("side", "oblique", "toward", "above", "away")
SIZES = ((640, 480), (960, 540), (480, 640), (640, 360))
DISTANCES = (None, 7.0, 12.0)
FRAMES = 50


def recordings() -> dict[str, Path]:
    """Folder of each person's recordings."""
    folders = [folder for pattern in PEOPLE for folder in sorted((DATA / "mocap").glob(pattern))]
    return {folder.name: folder for folder in folders if folder.is_dir()}


def scenario(number: int, gait: Path) -> Scenario:
    """How a walk is filmed."""
    view = VIEWS[number % len(VIEWS)]
    return Scenario(
        view=view,
        direction="lr" if number % 2 else "rl",
        frames=FRAMES,
        size=SIZES[number % len(SIZES)],
        distance=DISTANCES[number % len(DISTANCES)],
        seed=1000 + number,
        clutter=number % 4 == 3,
        flicker=number % 3,
        noise=1.0 + number % 4,
        gait=str(gait),
    )


def make(folder: Path, update: Callable[[int], None]) -> list[Path]:
    """Make the clips that the folder lacks; return all."""
    folder.mkdir(parents=True, exist_ok=True)
    clips = []
    for number, (name, source) in enumerate(recordings().items()):
        clip, model, making = folder / name, folder / f"{name}.gait", folder / ".making"
        if not (clip / "truth.csv").is_file():
            if not model.is_file() and not learnt(source, model):
                continue
            shutil.rmtree(making, ignore_errors=True)
            simulate(scenario(number, model), making)
            making.rename(clip)
        clips.append(clip)
        update(number + 1)
    return clips


def learnt(source: Path, model: Path) -> bool:
    """Learn from one person; False if the recordings have too few cycles."""
    options = LearnOptions(sources=(str(source),), output=str(model), subjects="folder", quiet=True)
    try:
        learning.run(options, lambda line: None)
    except UserError:
        return False
    return True
