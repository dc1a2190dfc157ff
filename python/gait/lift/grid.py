"""Frames of the prior's rate that a motion is estimated at, and the places between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.bindings.segment_prior import SegmentPrior

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.intp]


@dataclass(frozen=True)
class Grid:
    """Frames of the prior's rate that cover a sequence, in whole blocks.

    Attributes
    ----------
    begin, rate : float
        Seconds, frames per second.
    blocks, frames : int
        Blocks B of b frames.
    """

    begin: float
    rate: float
    blocks: int
    frames: int

    @classmethod
    def over(cls, time: Floats, prior: SegmentPrior) -> Grid:
        """Cover times (T,) with at least one segment."""
        half = prior.frames // 2
        needed = int(np.ceil((time[-1] - time[0]) * prior.fps - 1e-6)) + 1
        return cls(float(time[0]), prior.fps, max(2, -(-needed // half)), half)

    @property
    def time(self) -> Floats:
        """Seconds of the frames."""
        return self.begin + np.arange(self.blocks * self.frames) / self.rate

    def between(self, time: Floats) -> tuple[Ints, Floats]:
        """Frames (T, w) and weights (T, w) that interpolate at times: cubic, linear if blocks are short."""
        width = 4 if self.frames >= 3 else 2
        at = (time - self.begin) * self.rate
        first = np.clip(np.floor(at).astype(int) - (width // 2 - 1), 0, self.blocks * self.frames - width)
        frames = first[:, None] + np.arange(width)
        weights = np.ones(frames.shape)
        for i in range(width):
            for k in range(width):
                if k != i:
                    weights[:, i] *= (at - frames[:, k]) / (i - k)
        return frames, weights


def interpolated(values: Floats, frames: Ints, weights: Floats) -> Floats:
    """Values (T, ...) between those of a grid (grid, ...), by the frames and weights of `Grid.between`."""
    return np.asarray(np.einsum("tw,tw...->t...", weights, values[frames]))
