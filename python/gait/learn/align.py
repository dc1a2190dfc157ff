"""Phases of several sequences brought to one cycle (Ormoneit 2000, section 3.2 and Fig. 3).

Alternates a periodic cubic regression spline of all sequences together and the best offset of each; both
steps lower one weighted sum of squares.  Phase of frame j of a sequence: frac((j - offset) / period).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline

Floats = npt.NDArray[np.float64]

KNOTS = 20
BINS = 256  # of the circular cross-correlation that starts the search
TABLE = 1024
ITERATIONS = 100
TOLERANCE = 1e-6  # relative decrease of the objective at which to stop
XCORR_ROUNDS = 3


@dataclass
class Alignment:
    """Result of `align`.

    Attributes
    ----------
    offsets : (n,)
        Frames, in [0, period).
    objective : list of float
        Weighted sum of squares after each iteration; never increases.
    weights : (A,)
        Of the angles: one over the variance left by a smooth curve per sequence.
    """

    offsets: Floats
    objective: list[float] = field(default_factory=list)
    weights: Floats = field(default_factory=lambda: np.ones(1))


def periodic_basis(phase: Floats, knots: int = KNOTS) -> Floats:
    """Evaluate periodic cubic B-splines with uniform knots at phases (n,): (n, knots)."""
    extended = np.arange(-3, knots + 4) / knots
    basis = BSpline.design_matrix(np.mod(phase, 1.0), extended, 3).toarray()
    basis[:, :3] += basis[:, knots:]
    return np.asarray(basis[:, :knots])


def align(
    signals: list[Floats], periods: Floats, start: str = "xcorr", weights: Floats | None = None
) -> Alignment:
    """Find the offset of each sequence.

    Parameters
    ----------
    signals : list of (T_i, A)
        NaN where missing.
    periods : (n,)
        Frames.
    start : "xcorr" or "zeros"
        Zeros is the paper's start.
    weights : (A,), optional
        By default one over each angle's noise variance; ones is the paper's choice.
    """
    problem = [_Sequence(z, p) for z, p in zip(signals, periods, strict=True)]
    w = _noise_weights(problem) if weights is None else np.asarray(weights, float)
    offsets = _xcorr_start(problem, w) if start == "xcorr" else np.zeros(len(problem))
    result = Alignment(offsets, weights=w)
    for _ in range(ITERATIONS):
        table, cost = _common_curve(problem, result.offsets, w)
        if result.objective and cost > result.objective[-1] * (1 - TOLERANCE):
            break
        result.objective.append(cost)
        result.offsets = np.array(
            [s.best_offset(table, w, o) for s, o in zip(problem, result.offsets, strict=True)]
        )
    return result


class _Sequence:
    """One sequence with its observed mask and its sums per phase bin."""

    def __init__(self, signals: Floats, period: float) -> None:
        self.period = float(period)
        self.seen = np.isfinite(signals)
        self.values = np.where(self.seen, signals, 0.0)
        self.time = np.arange(len(signals))
        bins = self.bins(0.0)
        member = np.zeros((BINS, len(signals)))
        member[bins, self.time] = 1
        self.counts, self.sums = member @ self.seen, member @ self.values
        self.counts_hat = np.fft.rfft(self.counts, axis=0)
        self.sums_hat = np.fft.rfft(self.sums, axis=0)

    def phase(self, offset: float) -> Floats:
        """Phase (T,) of each frame."""
        return np.mod((self.time - offset) / self.period, 1.0)

    def bins(self, offset: float) -> npt.NDArray[np.intp]:
        """Phase bin (T,) of each frame."""
        return np.minimum((self.phase(offset) * BINS).astype(int), BINS - 1)

    def cost(self, table: Floats, weights: Floats, offset: float) -> float:
        """Weighted sum of squares against a tabulated curve."""
        at = self.phase(offset) * TABLE
        low = at.astype(int) % TABLE
        part = (at - np.floor(at))[:, None]
        curve = table[low] * (1 - part) + table[(low + 1) % TABLE] * part
        return float(np.sum(((self.values - curve) * self.seen) ** 2 @ weights))

    def correlation(self, table: Floats, weights: Floats) -> Floats:
        """Approximate cost (BINS,) at offsets of whole bins, up to a constant, by circular correlation."""
        curve = table.reshape(BINS, -1, table.shape[1]).mean(axis=1) * weights
        square = curve * table.reshape(BINS, -1, table.shape[1]).mean(axis=1)
        spectrum = np.conj(np.fft.rfft(square, axis=0)) * self.counts_hat
        spectrum -= 2 * np.conj(np.fft.rfft(curve, axis=0)) * self.sums_hat
        return np.asarray(np.fft.irfft(spectrum.sum(axis=1), BINS))

    def best_offset(self, table: Floats, weights: Floats, now: float) -> float:
        """Offset of least cost: by correlation, then smaller steps and a parabola; never worse than now."""
        coarse = float(np.argmin(self.correlation(table, weights))) * self.period / BINS
        best, cost = now, self.cost(table, weights, now)
        rough = self.cost(table, weights, coarse)
        if rough < cost:
            best, cost = coarse, rough
        step = self.period / BINS
        while step > 0.01:
            left, right = (self.cost(table, weights, best + d) for d in (-step, step))
            bend = left - 2 * cost + right
            shift = 0.5 * step * (left - right) / bend if bend > 0 else 0.0
            options = [(cost, best), (left, best - step), (right, best + step)]
            if 0 < abs(shift) < step:
                options.append((self.cost(table, weights, best + shift), best + shift))
            cost, best = min(options)
            step /= 4 if abs(shift) < step else 1.5
        return best % self.period


def _noise_weights(problem: list[_Sequence]) -> Floats:
    """One over the variance that a periodic spline of each sequence alone leaves, mean 1."""
    rest = sum(_residual(s) for s in problem)
    count = sum(s.seen.sum(axis=0) for s in problem)
    variance = rest / np.maximum(count, 1)
    floor = 1e-3 * float(np.mean(variance)) + 1e-12
    weights = 1 / np.maximum(variance, floor)
    return np.asarray(weights / weights.mean())


def _residual(s: _Sequence) -> Floats:
    """Sum of squares (A,) left by a periodic spline of one sequence."""
    basis = periodic_basis(s.phase(0.0))
    fitted = basis @ _solve(basis.T @ basis, basis.T @ s.values)
    return np.asarray((((s.values - fitted) * s.seen) ** 2).sum(axis=0))


def _solve(gram: Floats, right: Floats) -> Floats:
    """Least squares from the normal equations with a trace of ridge, for phases that nobody saw."""
    return np.linalg.solve(gram + 1e-9 * (np.trace(gram) / len(gram) + 1e-12) * np.eye(len(gram)), right)


def _common_curve(problem: list[_Sequence], offsets: Floats, weights: Floats) -> tuple[Floats, float]:
    """Periodic spline of all sequences, tabulated (TABLE, A), and its weighted sum of squares."""
    angles = problem[0].values.shape[1]
    gram, right = np.zeros((angles, KNOTS, KNOTS)), np.zeros((angles, KNOTS))
    for s, offset in zip(problem, offsets, strict=True):
        basis = periodic_basis(s.phase(offset))
        right += (basis.T @ s.values).T
        if s.seen.all():
            gram += basis.T @ basis
        else:
            gram += np.einsum("tk,ta,tl->akl", basis, s.seen, basis, optimize=True)
    curve = np.stack([_solve(g, r) for g, r in zip(gram, right, strict=True)], axis=1)
    table = periodic_basis(np.arange(TABLE) / TABLE) @ curve
    return table, sum(s.cost(table, weights, o) for s, o in zip(problem, offsets, strict=True))


def common_curve(signals: list[Floats], periods: Floats, offsets: Floats) -> Floats:
    """Mean curve (1024, A) of aligned sequences as a periodic spline."""
    problem = [_Sequence(z, p) for z, p in zip(signals, periods, strict=True)]
    return _common_curve(problem, offsets, np.ones(signals[0].shape[1]))[0]


def _xcorr_start(problem: list[_Sequence], weights: Floats) -> Floats:
    """Offsets against sequence 1, then against the mean of all, by circular cross-correlation."""
    offsets = np.zeros(len(problem))
    reference, _ = _common_curve(problem[:1], offsets[:1], weights)
    for _ in range(XCORR_ROUNDS):
        for i, s in enumerate(problem):
            offsets[i] = np.argmin(s.correlation(reference, weights)) * s.period / BINS
        reference, _ = _common_curve(problem, offsets, weights)
    return offsets
