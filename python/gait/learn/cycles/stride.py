"""The period of strides: that of the motion, or the multiple of it at which the legs take turns.

A cycle fitted to a recording hardly longer than itself scores well at twice the stride, because noise, turns
and changes of speed are then part of it; and where the trunk outvotes the legs, at half of it.  What a stride
is, the legs show: left and right move alike half a stride apart.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gait.body.skeleton import ANGLES, SIDES
from gait.learn.arrays import Floats
from gait.learn.cycles import period
from gait.learn.cycles.fourier import first_harmonic

SWING = ("hip_flexion", "knee_flexion")
MULTIPLES = (1 / 3, 1 / 2, 2.0, 3.0)  # of the period found that may be the stride
#: Alternation that a multiple needs, and by how much it has to exceed that of the period found.  Strides of
#: recorded walks and runs have 0.4 to 0.95, twice and half the stride 0.15 at most.
TURNS, MORE = 0.35, 0.25
NEAR = 0.1  # of a multiple, within which the best period is taken


def find(angles: Floats, fps: float, mode: str = "refined") -> period.Period:
    """Find the period of angles (T, 24), radians, NaN where missing; parameters are those of `period.find`.

    The mode "literal" is the paper's, which does not ask the legs.
    """
    found = period.find(angles, fps, mode)
    if mode == "literal" or not np.isfinite(found.frames):
        return found
    longest = min(period.SECONDS[1] * fps, len(angles) / period.CYCLES)
    others = [_best_near(found, found.frames * multiple) for multiple in MULTIPLES]
    others = [p for p in others if period.SECONDS[0] * fps <= p <= longest]
    best = max(others, key=lambda p: alternation(angles, p), default=found.frames)
    if alternation(angles, best) < max(TURNS, alternation(angles, found.frames) + MORE):
        return found
    return replace(found, frames=period.refined(angles, best))


def _best_near(found: period.Period, frames: float) -> float:
    """Return the candidate of best score near a period, frames; the period itself if none is scored there.

    A multiple of a period that was found at the end of those looked for is only about the stride.
    """
    near = np.isfinite(found.scores) & (np.abs(found.candidates / frames - 1) < NEAR)
    return float(found.candidates[near][np.argmax(found.scores[near])]) if near.any() else frames


def alternation(angles: Floats, frames: float) -> float:
    """Return how much of the legs' motion is one swing a period (frames), half a period apart left and right.

    1 if all of it is, 0 if there is none or it is unrelated, negative if both legs swing together.
    """
    swing, whole = 0.0, 0.0
    for name in SWING:
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
    """Return the standard deviation of what is visible; 0 if nothing is."""
    visible = signal[np.isfinite(signal)]
    return float(np.std(visible)) if len(visible) else 0.0
