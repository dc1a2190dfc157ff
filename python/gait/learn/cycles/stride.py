"""Find the period of strides: that of the motion, or the multiple at which the legs alternate.

In a recording that is little longer than two strides, twice the stride also scores well, as noise, turns and
changes of speed are then part of the cycle; so does half the stride if the trunk dominates the legs.  The
legs show what a stride is: left and right move alike, half a stride apart.

This also gives the period of trials that are too short to repeat, which are common in laboratories, since a
step of one side repeats that of the other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gait.body.skeleton import ANGLES, SIDES
from gait.learn.arrays import Floats, column_means
from gait.learn.cycles import period
from gait.learn.cycles.fourier import first_harmonic

SWING_ANGLES = ("hip_flexion", "knee_flexion")
MULTIPLES = (1 / 3, 1 / 2, 2.0, 3.0)  # of the period found that may be the stride
#: Alternation that a multiple needs, and by how much it must exceed that of the period found.  Strides of
#: recorded walks and runs have 0.4 to 0.95, twice and half the stride at most 0.15.
LEAST_ALTERNATION, MORE = 0.35, 0.25
#: Angles whose left and right move alike half a stride apart, and harmonics of the stride in their difference
#: and their sum.
PAIRED = ("hip_flexion", "knee_flexion", "ankle_flexion", "shoulder_flexion", "elbow_flexion")
UNEVEN, EVEN = (1, 3, 5), (2, 4, 6)
FEWEST_STRIDES = 1.05  # strides of a trial whose steps repeat each other
PERIOD_STEP_S = 0.005  # seconds between periods tried
MULTIPLE_TOLERANCE = 0.1  # relative distance from a multiple within which the best period is used


def find(angles: Floats, fps: float, mode: str = "refined") -> period.Period:
    """Find the period of angles (T, 24), radians, NaN where missing; parameters are those of `period.find`.

    The mode "literal" is the paper's, which does not use the legs.
    """
    found = period.find(angles, fps, mode)
    if mode == "literal" or not np.isfinite(found.frames):
        return found
    longest = min(period.SECONDS[1] * fps, len(angles) / period.FEWEST_CYCLES)
    others = [_best_near(found, found.frames * multiple) for multiple in MULTIPLES]
    others = [p for p in others if period.SECONDS[0] * fps <= p <= longest]
    best = max(others, key=lambda p: alternation(angles, p), default=found.frames)
    if alternation(angles, best) < max(LEAST_ALTERNATION, alternation(angles, found.frames) + MORE):
        return found
    return replace(found, frames=period.refined(angles, best))


def _best_near(found: period.Period, frames: float) -> float:
    """Return the best-scoring candidate near a period, frames; the period itself if there is none.

    A multiple of a period at the end of the range searched is only roughly the stride.
    """
    near = np.isfinite(found.scores) & (np.abs(found.candidates / frames - 1) < MULTIPLE_TOLERANCE)
    return float(found.candidates[near][np.argmax(found.scores[near])]) if near.any() else frames


def find_by_steps(angles: Floats, fps: float) -> period.Period:
    """Find the period of angles (T, 24) of little more than a stride, from what both sides have in common.

    The difference of left and right consists of every second harmonic of the stride, from the first, their
    sum of the even ones.  Candidates are periods of which `FEWEST_STRIDES` are visible; their score is the
    mean log of total over remaining variance.
    """
    low, high = period.SECONDS
    candidates = np.arange(low, min(high, len(angles) / FEWEST_STRIDES / fps) + 1e-9, PERIOD_STEP_S) * fps
    signals = _sums_and_differences(angles)
    if not signals or not len(candidates):
        return period.Period(float("nan"), candidates, np.full(len(candidates), np.nan), 0.0)
    scores = np.array([np.mean([_explained(z, p, h) for z, h in signals]) for p in candidates])
    sharpness = float(scores.max() / max(float(np.median(scores)), 1e-9))
    return period.Period(float(candidates[np.argmax(scores)]), candidates, scores, sharpness)


def step_repeats(angles: Floats, frames: float) -> float:
    """Return the correlation of each side with the other side half a period later; NaN without overlap."""
    columns = [[ANGLES.index(f"{s}_{name}") for name in PAIRED] for s in SIDES]
    left, right = (angles[:, k] - column_means(angles[:, k]) for k in columns)
    pairs = [with_later(*sides, frames / 2) for sides in ((left, right), (right, left))]
    return correlation(*(np.concatenate(each) for each in zip(*pairs, strict=True)))


def with_later(one: Floats, other: Floats, frames: float) -> tuple[Floats, Floats]:
    """Return values of `one` and, `frames` later, of `other`, both (T, M), where both are visible (k,)."""
    time = np.arange(max(0, int(np.ceil(len(one) - 1 - frames))))
    at = time + frames
    low = at.astype(int)
    share = (at - low)[:, None]
    later = other[low] * (1 - share) + other[np.minimum(low + 1, len(other) - 1)] * share
    both = np.isfinite(one[time] + later)
    return one[time][both], later[both]


def correlation(a: Floats, b: Floats) -> float:
    """Return the correlation of values (k,) whose means are 0; NaN if either is always 0."""
    scale = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / scale if scale > 0 else float("nan")


def _sums_and_differences(angles: Floats) -> list[tuple[Floats, tuple[int, ...]]]:
    """Return sums and differences (T,) of left and right that are mostly visible, with their harmonics."""
    signals: list[tuple[Floats, tuple[int, ...]]] = []
    for name in PAIRED:
        left, right = (angles[:, ANGLES.index(f"{s}_{name}")] for s in SIDES)
        if 2 * np.isfinite(left + right).sum() > len(angles):
            signals += [(left - right, UNEVEN), (left + right, EVEN)]
    return signals


def _explained(signal: Floats, frames: float, harmonics: tuple[int, ...]) -> float:
    """Return the log of a signal's variance over that about a constant and harmonics of a period."""
    visible = np.flatnonzero(np.isfinite(signal))
    angle = 2 * np.pi * np.outer(visible / frames, harmonics)
    design = np.concatenate([np.ones((len(visible), 1)), np.cos(angle), np.sin(angle)], axis=1)
    values = signal[visible] - signal[visible].mean()
    weights = np.linalg.lstsq(design, values, rcond=None)[0]
    total = float(values @ values)
    rest = float(np.sum((values - design @ weights) ** 2))
    return float(np.log(max(total, 1e-30) / max(rest, 1e-6 * total, 1e-30)))


def alternation(angles: Floats, frames: float) -> float:
    """Return the share of the legs' motion that is one swing per period (frames), left and right alternating.

    1: all of it; 0: none, or unrelated; negative: both legs swing together.
    """
    swing, whole = 0.0, 0.0
    for name in SWING_ANGLES:
        sides = [angles[:, ANGLES.index(f"{s}_{name}")] for s in SIDES]
        left, right = (first_harmonic(side, frames) for side in sides)
        apart = float(np.angle(left * np.conj(right)))
        swing -= np.cos(apart) * float(np.prod([_swing(side, frames) for side in sides]))
        whole += float(np.prod([_sd(side) for side in sides]))
    return swing / whole if whole > 0 else 0.0


def _swing(signal: Floats, frames: float) -> float:
    """Return the standard deviation of the first harmonic of a period over the visible frames."""
    phase = 2 * np.pi * np.flatnonzero(np.isfinite(signal)) / frames
    wave = first_harmonic(signal, frames) * np.exp(1j * phase)
    return float(np.std(wave.real)) if len(phase) else 0.0


def _sd(signal: Floats) -> float:
    """Return the standard deviation of the visible values; 0 if there are none."""
    visible = signal[np.isfinite(signal)]
    return float(np.std(visible)) if len(visible) else 0.0
