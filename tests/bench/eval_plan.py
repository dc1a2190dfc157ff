"""What to run: clips, arms (ways of running the tracker) and jobs (a clip, an arm, a seed)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Changes = tuple[tuple[str, Any], ...]


@dataclass(frozen=True)
class Clip:
    """A video with its camera and what is known of it.

    Attributes
    ----------
    name : str
    folder, video, camera : Path
        `camera` as in `gait.Camera.read`.
    plate : Path or None
        The empty scene.
    truth, marks : Path or None
        Joints in 3-D (truth.csv) or marked by hand in the picture (reference2d.json).
    init : Path or None
        First state; if None it is the truth plus noise.
    first, stop : int
        Frames to use, `first` <= frame < `stop`.
    height : float or None
        Stature given to ``auto``, metres.
    subject : str or None
        Left out of learning; None: the shipped model.
    steady : bool
        A person walks throughout, so that the phase means something.
    empty : bool
        No person is there.
    """

    name: str
    folder: Path
    video: Path
    camera: Path
    plate: Path | None = None
    truth: Path | None = None
    marks: Path | None = None
    init: Path | None = None
    first: int = 0
    stop: int | None = None
    height: float | None = None
    subject: str | None = None
    steady: bool = True
    empty: bool = False


@dataclass(frozen=True)
class Arm:
    """A way of running the tracker.

    Attributes
    ----------
    name : str
    init : str
        ``truth`` (with noise drawn by the seed), ``auto`` (as ``gait track`` does by itself) or ``images``
        (the same without the detector).
    mode : str
        ``default`` or ``paper``.
    background : str
        ``plate``, ``auto`` (median of the clip) or ``none``.
    every : int
        Use each n-th frame.
    stature_error : float
        Share by which the start's stature is wrong.
    seeds : int
        Runs per clip.
    changes : tuple of (str, value)
        Settings of `gait.TrackerConfig` that differ from the mode's.
    """

    name: str
    init: str = "truth"
    mode: str = "default"
    background: str = "plate"
    every: int = 1
    stature_error: float = 0.0
    seeds: int = 3
    changes: Changes = ()


@dataclass(frozen=True)
class Job:
    """One run.  `model`: file or name of a shipped one; `pictures` asks for overlays beside the track."""

    clip: Clip
    arm: Arm
    seed: int
    model: Path | str | None
    folder: Path
    pictures: bool = False

    @property
    def stem(self) -> str:
        """Name of the run's files."""
        words = f"{self.clip.name}.{self.arm.name}.{self.seed}"
        return "".join(c if c.isalnum() or c in "._+-" else "_" for c in words)

    @property
    def track(self) -> Path:
        """File of the track."""
        return self.folder / f"{self.stem}.csv"


BASE = "default/truth"
INITS = ("truth", "auto", "images")


def main_arms(modes: Sequence[str], inits: Sequence[str], seeds: int | None) -> list[Arm]:
    """Each mode from each kind of start: 3 seeds, 4 for the default mode without a given start.

    Paper mode uses no detector, so its ``images`` would repeat its ``auto``.
    """
    usual = {("default", "auto"): 4, ("default", "images"): 4}
    return [
        Arm(f"{mode}/{init}", init=init, mode=mode, seeds=seeds or usual.get((mode, init), 3))
        for mode in modes
        for init in inits
        if (mode, init) != ("paper", "images")
    ]


def varied_arms(
    *,
    seeds: int,
    stature_error: float | None = None,
    backgrounds: Iterable[str] = (),
    every: Iterable[int] = (),
    particles: Sequence[int] = (),
    rejuvenation: Iterable[float] = (),
    switches: dict[str, dict[str, Any]] | None = None,
) -> list[Arm]:
    """Default mode from the truth, with one difference in each arm.

    Parameters
    ----------
    seeds : int
    stature_error : float, optional
        Two arms: the start's stature too large and too small by this share.
    backgrounds, every, particles
        An arm for each value.
    rejuvenation
        Seconds; an arm for each, with each of `particles`.
    switches : dict
        Name of an ablation: the settings that switch its feature off.
    """
    arms = []
    if stature_error:
        for sign, word in ((1, "+"), (-1, "-")):
            name = f"stature {word}{100 * stature_error:g} %"
            arms.append(Arm(name, stature_error=sign * stature_error, seeds=seeds))
    arms += [Arm(f"background {b}", background=b, seeds=seeds) for b in backgrounds if b != "plate"]
    arms += [Arm(f"every {k}", every=k, seeds=seeds) for k in every if k != 1]
    arms += [Arm(f"N {n}", seeds=seeds, changes=(("particles", n),)) for n in particles]
    for time in rejuvenation:
        settings = [(("particles", n), ("rejuvenation_time", time)) for n in particles]
        arms += [Arm(f"N {s[0][1]}, rejuvenation {time:g} s", seeds=seeds, changes=s) for s in settings]
    arms += [
        Arm(f"no {name}", seeds=seeds, changes=tuple(values.items()))
        for name, values in (switches or {}).items()
    ]
    return arms
