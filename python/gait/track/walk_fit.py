"""Find the most probable camera and walk by Gauss-Newton steps, and the part of the clip that is a walk."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gait.track.walk_model import WalkModel
from gait.track.walk_start import WalkStart

Array = NDArray[np.float64]

_GROWTH = 1.0  # seconds by which the fitted part grows at either end
_FIT_CHI2 = 9.0  # squared robust error per coordinate up to which further frames fit the walk


class WalkFit:
    """Camera and walk over a part of the clip.

    Attributes
    ----------
    model : WalkModel
        Its keypoints are those of that part.
    q : ndarray of shape (P,)
        The most probable parameters so far.
    """

    def __init__(self, model: WalkModel, start: WalkStart) -> None:
        """Begin at `start`; `model` has the keypoints near it."""
        self.model = model
        state = start.walk.mean
        ahead = model.knot_time - start.time
        speed = 0.0 if model.in_place else start.walk.speed
        knots = np.stack([
            state.pelvis[0] + speed * ahead * np.cos(state.heading),
            state.pelvis[1] + speed * ahead * np.sin(state.heading),
            np.full(len(ahead), state.heading),
            state.phase + state.stride_hz * ahead,
        ], axis=1)  # fmt: skip
        self.q = np.concatenate([start.camera, np.zeros(model.fixed - 4), knots.ravel()])

    @property
    def rate(self) -> float:
        """Average strides per second."""
        return float(self.model.rates(self.q).mean())

    @property
    def chi2_per_observation(self) -> float:
        """Squared robust error per coordinate."""
        return float(np.mean(self.model.frame_chi2(self.q)))

    @property
    def cost_per_frame(self) -> float:
        """Cost for comparing fits of different windows of the clip."""
        return self.model.cost(self.q) / len(self.model.time)

    def refine(self, most: int) -> None:
        """Take at most `most` Levenberg-Marquardt steps."""
        cost, damping = self.model.cost(self.q), 1e-3
        for _ in range(most):
            matrix, gradient = self.model.normal(self.q)
            before = cost
            for _ in range(5):
                step = np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), -gradient)
                trial = self.q + step
                if np.abs(step[:4]).max() < 2.0 and (now := self.model.cost(trial)) < cost:
                    self.q, cost = trial, now
                    damping *= 0.2
                    break
                damping *= 6.0
            if before - cost < 1e-3 * (1.0 + cost):
                break

    def grow(self) -> WalkFit:
        """Extend the fit at either end, by one second at a time, as long as the new frames fit the walk."""
        low, high = self.model.time[0], self.model.time[-1]
        first, last = self.model.clip
        open_ = {-1, 1}
        while open_:
            before, ends = (self.q.copy(), self.model.knot_time), (low, high)
            low = max(first, low - _GROWTH) if -1 in open_ else low
            high = min(last, high + _GROWTH) if 1 in open_ else high
            self._extend(low, high, *before)
            self.refine(4)
            self._swap_sides()
            chi2 = self.model.frame_chi2(self.q)
            early, late = self.model.time < ends[0] - 1e-9, self.model.time > ends[1] + 1e-9
            bad = {
                -1: early.any() and chi2[early].mean() > _FIT_CHI2,
                1: late.any() and chi2[late].mean() > _FIT_CHI2,
            }
            if bad[-1] or bad[1]:
                low, high = (ends[0] if bad[-1] else low), (ends[1] if bad[1] else high)
                self._extend(low, high, *before)
                self.refine(4)
                self._swap_sides()
                open_ -= {side for side, wrong in bad.items() if wrong}
            if low <= first:
                open_ -= {-1}
            if high >= last:
                open_ -= {1}
        self.refine(15)
        return self

    def _swap_sides(self) -> None:
        """Swap left and right in frames in which the detector confused them."""
        if (model := self.model.swapped(self.q)) is not None:
            self.model = model
            self.refine(4)

    def _extend(self, low: float, high: float, q: Array, time: Array) -> None:
        """Use another interval; beyond the old knots the walk continues straight."""
        self.model = self.model.over(low, high)
        knots = self.model.knots(q)
        slopes = (knots[-1] - knots[0]) / (time[-1] - time[0])
        inside = np.stack([np.interp(self.model.knot_time, time, column) for column in knots.T], axis=1)
        beyond = self.model.knot_time - np.clip(self.model.knot_time, time[0], time[-1])
        self.q = np.concatenate([q[: self.model.fixed], (inside + beyond[:, None] * slopes).ravel()])

    def covariance(self) -> Array:
        """Covariance of the parameters, from the curvature, scaled by the error of the fit."""
        matrix, _ = self.model.normal(self.q)
        return np.asarray(np.linalg.inv(matrix) * max(self.chi2_per_observation, 1.0))
