"""Whether a recording is cyclic, and of the activity that is learnt: the evidence and the sentence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import ANGLES, SIDES
from gait.learn.cycles.activity import NAMES, Footing
from gait.learn.cycles.fourier import first_harmonic
from gait.learn.cycles.period import CYCLES, Period

Floats = npt.NDArray[np.float64]

SHARPNESS = 3.0
REPEATS = 0.75  # the walks of CMU reach 0.88 to 0.99; punching 0.69, dances and climbing less or nothing
LEGS = 0.7  # legs within an eighth of a cycle of taking turns; the walks of CMU: 0.96 and more
LIFT = 0.02  # statures
STEPS = 0.03  # statures
AHEAD = 0.5  # the walks of CMU: 0.98 and more, with left and right swapped -0.98 and less
SWING = ("hip_flexion", "knee_flexion")


@dataclass(frozen=True)
class Evidence:
    """One measure and the limits within which it is accepted.

    Attributes
    ----------
    name : str
    value : float
        NaN if it could not be measured, which is no reason to refuse.
    least, most : float
    words : str
        What it means if it is outside.
    """

    name: str
    value: float
    least: float = -np.inf
    most: float = np.inf
    words: str = ""

    @property
    def accepted(self) -> bool:
        """Whether the value is not outside the limits."""
        return not (self.value < self.least or self.value > self.most)

    def __str__(self) -> str:
        """Words, value and limit, such as 'the cycles do not repeat (0.31, at least 0.75)'."""
        limit = f"at least {self.least:.4g}" if self.value < self.least else f"at most {self.most:.4g}"
        return f"{self.words} ({self.name} {self.value:.2g}, {limit})"


@dataclass(frozen=True)
class Verdict:
    """What a recording shows.

    Attributes
    ----------
    activity : str
        'walk', 'run', or '' where the feet do not tell.
    evidence : tuple of Evidence
    """

    activity: str
    evidence: tuple[Evidence, ...]

    @property
    def accepted(self) -> bool:
        """Whether nothing speaks against learning from it."""
        return all(e.accepted for e in self.evidence)

    @property
    def reason(self) -> str:
        """Everything that speaks against it; '' if nothing does."""
        return "; ".join(str(e) for e in self.evidence if not e.accepted)


def judge(
    angles: Floats, found: Period, feet: Footing | None, wanted: str, yaw: Floats | None = None
) -> Verdict:
    """Judge the steady part of a recording.

    Parameters
    ----------
    angles : (T, 24)
        In the order of `gait.body.skeleton.ANGLES`; NaN where missing.
    found : Period
    feet : Footing or None
        None if the feet were not seen.
    wanted : str
        The activity that is learnt; other names than those of walking and running only ask for cycles.
    yaw : (T,), optional
        Of the pelvis from the direction in which it goes, radians; NaN where missing.
    """
    kind = NAMES.get(wanted.lower(), "")
    evidence = list(_cyclic(angles, found))
    known = ""
    if kind and np.isfinite(found.frames):
        evidence.append(
            Evidence("legs", legs(angles, found.frames), LEGS, words="the legs do not take turns")
        )
    if feet is not None:
        legged = all(e.accepted for e in evidence) and feet.lift >= LIFT
        known = ("run" if feet.running else "walk") if legged else ""
        if kind:
            evidence += _footing(feet, kind)
    if kind and yaw is not None and np.isfinite(yaw).any():
        words = "it goes backwards, or left and right are swapped"
        evidence.append(Evidence("ahead", float(np.nanmean(np.cos(yaw))), AHEAD, words=words))
    return Verdict(known, tuple(evidence))


def _cyclic(angles: Floats, found: Period) -> list[Evidence]:
    """Evidence for cycles of any kind."""
    if not np.isfinite(found.frames):
        return [Evidence("cycles", 0.0, CYCLES, words="it holds no cycle")]
    return [
        Evidence("cycles", len(angles) / found.frames, CYCLES, words="too short a steady stretch"),
        Evidence("sharpness", found.sharpness, SHARPNESS, words="no period stands out"),
        Evidence("repeats", repeats(angles, found.frames), REPEATS, words="one cycle is not like the next"),
    ]


def _footing(feet: Footing, kind: str) -> list[Evidence]:
    """Evidence for walking or running."""
    result = [
        Evidence("lift", feet.lift, LIFT, words="a foot stays on the ground"),
        Evidence("steps", feet.steps, most=STEPS, words="the ground is not level"),
    ]
    if kind == "walk":
        words = "this is running: both feet leave the ground"
        return [*result, Evidence("flight", feet.flight, most=feet.limit, words=words)]
    words = "this is not running: there is a foot on the ground"
    return [*result, Evidence("flight", feet.flight, least=feet.limit, words=words)]


def repeats(angles: Floats, period: float) -> float:
    """Correlation of the angles with themselves a period later, all together; NaN if nothing overlaps.

    Each cycle is so predicted by another: unlike the ratio the period is chosen by, it does not profit from
    the choice of many means.
    """
    time = np.arange(max(0, int(np.ceil(len(angles) - 1 - period))))
    at = time + period
    low = at.astype(int)
    share = (at - low)[:, None]
    moved = _about_mean(angles)
    later = moved[low] * (1 - share) + moved[np.minimum(low + 1, len(moved) - 1)] * share
    both = np.isfinite(moved[time] + later)
    a, b = moved[time][both], later[both]
    scale = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / scale if scale > 0 else float("nan")


def legs(angles: Floats, period: float) -> float:
    """How exactly the legs take turns: 1 if half a cycle lies between them, -1 if they move together.

    It is the cosine of the lag beyond half a cycle between left and right, by the first harmonics of hips and
    knees, each joint weighed by the product of its amplitudes.  How far a leg swings does not count: people
    limp.  NaN if nothing moves or is seen.
    """
    left, right = (
        np.array([first_harmonic(angles[:, ANGLES.index(f"{s}_{name}")], period) for name in SWING])
        for s in SIDES
    )
    products = left * right.conj()
    scale = float(np.abs(products).sum())
    return -float(products.real.sum()) / scale if scale > 0 else float("nan")


def _about_mean(values: Floats) -> Floats:
    seen = np.isfinite(values)
    mean = np.where(seen, values, 0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    return np.asarray(values - mean)
