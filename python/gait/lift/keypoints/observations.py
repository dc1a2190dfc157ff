"""2-D observations of markers, and the rows of the linear model that they are: direction . X + noise = value.

Orthographic views are linear in the markers' places.  A perspective one is too when it is multiplied by the
depth: with R, t of the camera and (a, b) the ideal image coordinates of a point X,

    (R_x - a R_z) . X = a t_z - t_x,    (R_y - b R_z) . X = b t_z - t_y,

and only the noise, sd Z / f, depends on where the point is: it is taken at a guess and iterated.  These rows
hold the observation's own noise, which draws bodies towards the camera (by the square of noise over extent);
so near a guess the derivatives of the projection there are taken instead, as the C core does.

Frames of the prior's rate that a motion is estimated at, and the places between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.bindings.segment_prior import SegmentPrior

Floats = npt.NDArray[np.float64]
LONGEST_GAP = 0.15  # seconds over which keypoints are interpolated


@dataclass(frozen=True)
class Observations:
    """Where markers were seen in T pictures.

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
        """Which were seen, (T, J)."""
        return np.asarray(np.isfinite(self.sd) & np.isfinite(self.uv).all(axis=2))

    def part(self, start: int, stop: int) -> Observations:
        """Frames start to stop."""
        return Observations(self.uv[start:stop], self.sd[start:stop])

    def where(self, known: npt.NDArray[np.bool_]) -> Observations:
        """Leave out markers that are not `known` (J,)."""
        return Observations(self.uv, np.where(known, self.sd, np.inf))

    def among(self, index: npt.NDArray[np.intp], count: int) -> Observations:
        """Take them for the markers `index` among `count`, of which the others were not seen."""
        frames = len(self.uv)
        uv, sd = np.full((frames, count, 2), np.nan), np.full((frames, count), np.inf)
        uv[:, index], sd[:, index] = self.uv, self.sd
        return Observations(uv, sd)


def resampled(points: Observations, time: Floats, at: Floats) -> Observations:
    """Interpolate what is seen at times (T,) to other times (n,), seconds; across longer gaps nothing is."""
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
        near = (share > -1e-6) & (share < 1 + 1e-6) & (gap < LONGEST_GAP)
        uv[near, j] = (points.uv[a, j] + share[:, None] * (points.uv[b, j] - points.uv[a, j]))[near]
        sd[near, j] = np.hypot((1 - share) * points.sd[a, j], share * points.sd[b, j])[near]
    return Observations(uv, sd)


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
