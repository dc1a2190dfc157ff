"""When steps happen: jittered stride times, the phase they define, and variation from stride to stride."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from gait.simulate.arrays import Array

STRIDE_TIME_CV = 0.02
MARGIN_STRIDES = 2  # whole strides simulated before and after the clip, so that no foot is planned at an edge


@dataclass(frozen=True)
class Timing:
    """Fine time grid and the gait phase on it.

    Attributes
    ----------
    time : ndarray of shape (T,)
        Seconds, uniform, 0 = first frame of the clip; the frames lie on the grid.
    phase : ndarray of shape (T,)
        Unwrapped strides of the right foot; whole numbers are right heel strikes.
    scores : ndarray of shape (T, modes)
        Smooth stride-to-stride scores, unit variance.
    per_frame : int
        Grid steps per frame, a multiple of 4 so that a half shutter opens and closes on the grid.
    """

    time: Array
    phase: Array
    scores: Array
    per_frame: int

    @property
    def step(self) -> float:
        """Grid step, seconds."""
        return float(self.time[1] - self.time[0])

    def of_side(self, side: str) -> Array:
        """Return the unwrapped phase of a foot, whole at its own heel strikes."""
        return self.phase + (0.5 if side == "l" else 0.0)


def draw_timing(stride_hz: float, fps: float, frames: int, modes: int, rng: np.random.Generator) -> Timing:
    """Draw stride times with a coefficient of variation of 2 % and a random phase at the first frame."""
    per_frame = 4 * int(np.ceil(60 / fps))
    step = 1 / (fps * per_frame)
    period = 1 / stride_hz
    before = int(np.ceil(MARGIN_STRIDES * period / step))
    count = before + (frames - 1) * per_frame + before + 1
    time = (np.arange(count, dtype=np.float64) - before) * step
    strides = int(np.ceil((time[-1] - time[0]) / period)) + 4
    lengths = period * (1 + STRIDE_TIME_CV * np.clip(rng.standard_normal(strides), -2.5, 2.5))
    strikes = time[0] - period * (1 + rng.uniform()) + np.concatenate([[0], np.cumsum(lengths)])
    phase = PchipInterpolator(strikes, np.arange(strides + 1.0) - 2, extrapolate=True)(time)
    knots: Array = rng.standard_normal((strides + 1, modes))
    scores = PchipInterpolator(strikes, np.clip(knots, -2, 2), extrapolate=True)(time)
    return Timing(time, np.asarray(phase, np.float64), np.asarray(scores, np.float64), per_frame)
