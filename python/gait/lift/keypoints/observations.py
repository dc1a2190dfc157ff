"""2-D observations of markers, and the time grid (at the prior's frame rate) on which motion is estimated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.bindings.segment_prior import SegmentPrior
from gait.io.keypoints_file import LONGEST_KEYPOINT_GAP_S

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Observations:
    """Observed positions of markers in T pictures.

    Attributes
    ----------
    uv : (T, J, 2)
        Pixels, or metres along the axes of an orthographic view.
    sd : (T, J)
        Standard deviation of each coordinate, in the same unit; infinite or NaN where a marker was not seen.
    """

    uv: Floats
    sd: Floats

    @property
    def visible(self) -> npt.NDArray[np.bool_]:
        """Whether each marker was seen, (T, J)."""
        return np.asarray(np.isfinite(self.sd) & np.isfinite(self.uv).all(axis=2))

    def part(self, start: int, stop: int) -> Observations:
        """Return the observations of frames start <= t < stop."""
        return Observations(self.uv[start:stop], self.sd[start:stop])

    def where(self, known: npt.NDArray[np.bool_]) -> Observations:
        """Leave out markers that are not `known` (J,)."""
        return Observations(self.uv, np.where(known, self.sd, np.inf))

    def among(self, index: npt.NDArray[np.intp], count: int) -> Observations:
        """Assign the points to the markers `index` among `count`, of which the others were not seen."""
        frames = len(self.uv)
        uv, sd = np.full((frames, count, 2), np.nan), np.full((frames, count), np.inf)
        uv[:, index], sd[:, index] = self.uv, self.sd
        return Observations(uv, sd)


def resampled(points: Observations, time: Floats, at: Floats) -> Observations:
    """Interpolate observations at times (T,) to other times (n,), seconds, but not across longer gaps."""
    count = points.uv.shape[1]
    uv, sd = np.full((len(at), count, 2), np.nan), np.full((len(at), count), np.inf)
    for j, observed in enumerate(points.visible.T):
        known = np.flatnonzero(observed)
        if len(known) < 2:
            continue
        after = np.clip(np.searchsorted(time[known], at), 1, len(known) - 1)
        a, b = known[after - 1], known[after]
        gap = time[b] - time[a]
        share = (at - time[a]) / gap
        near = (share > -1e-6) & (share < 1 + 1e-6) & (gap < LONGEST_KEYPOINT_GAP_S)
        uv[near, j] = (points.uv[a, j] + share[:, None] * (points.uv[b, j] - points.uv[a, j]))[near]
        sd[near, j] = np.hypot((1 - share) * points.sd[a, j], share * points.sd[b, j])[near]
    return Observations(uv, sd)


Ints = npt.NDArray[np.intp]


@dataclass(frozen=True)
class Grid:
    """Frames at the prior's rate that cover a sequence, in whole blocks.

    Attributes
    ----------
    begin, rate : float
        Time of the first frame, seconds; frames per second.
    blocks, frames : int
        Number B of blocks, and number b of frames in each.
    """

    begin: float
    rate: float
    blocks: int
    frames: int

    @classmethod
    def over(cls, time: Floats, prior: SegmentPrior) -> Grid:
        """Make a grid that covers times (T,) with at least one segment."""
        half = prior.frames // 2
        needed = int(np.ceil((time[-1] - time[0]) * prior.fps - 1e-6)) + 1
        return cls(float(time[0]), prior.fps, max(2, -(-needed // half)), half)

    @property
    def time(self) -> Floats:
        """Times of the frames, seconds."""
        return self.begin + np.arange(self.blocks * self.frames) / self.rate

    def between(self, time: Floats) -> tuple[Ints, Floats]:
        """Find frames (T, w) and weights (T, w) to interpolate at times: cubic, or linear in short blocks."""
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
    """Interpolate values (grid, ...) of a grid to (T, ...), with frames and weights of `Grid.between`."""
    return np.asarray(np.einsum("tw,tw...->t...", weights, values[frames]))
