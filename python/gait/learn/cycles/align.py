"""Align the phases of several sequences to a common cycle (Ormoneit 2000, section 3.2 and Fig. 3).

Alternates between fitting a periodic cubic spline to all sequences and finding the best offset of each; both
steps reduce the same weighted sum of squares.  The phase of frame j of a sequence is frac((j - offset) /
period).  Only one sequence at a time is in memory.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import BSpline

from gait.body.skeleton import ANGLES
from gait.learn.arrays import Floats, Mask
from gait.learn.cycles.fourier import first_harmonic

MOST_ALIGNMENT_PASSES = 100
ALIGNMENT_TOLERANCE = 1e-6  # relative change of the objective at which to stop
KNOTS = 20  # of the periodic spline
TABLE = 1024  # samples of a tabulated curve
CORRELATION_BINS = 256  # of the circular cross-correlation
FINEST = 0.01  # frames; last step of the search for an offset
XCORR_ROUNDS = 3
AMBIGUOUS = 0.75  # relative depth of a second-best phase from which other starts are tried
LEAST_OFFSET_CYCLES = 0.1  # least cycles between those phases
MOST_FIRST_SEQUENCES = 4  # most sequences whose curve is tried as the first one
#: Columns of right and left hip flexion; phase 0 is where right minus left is largest.
HIP_COLUMNS = (ANGLES.index("r_hip_flexion"), ANGLES.index("l_hip_flexion"))


@dataclass
class Alignment:
    """Result of `align`."""

    offsets: Floats  #: (n,) frames, in [0, period)
    #: Weighted sum of squares after each iteration, which decreases except for rounding.
    objective: list[float] = field(default_factory=list)
    #: (A,) weights of the angles: one over the variance about a smooth curve of each sequence.
    weights: Floats = field(default_factory=lambda: np.ones(1))
    #: Whether the objective converged; False if it increased or the iterations ran out.
    converged: bool = False


def _periodic_basis(phase: Floats) -> Floats:
    """Evaluate periodic cubic B-splines with uniform knots at phases (n,): (n, KNOTS)."""
    extended = np.arange(-3, KNOTS + 4) / KNOTS
    basis = BSpline.design_matrix(np.mod(phase, 1.0), extended, 3).toarray()
    basis[:, :3] += basis[:, KNOTS:]
    return np.asarray(basis[:, :KNOTS])


class _Curve:
    """A periodic spline (A columns) fitted by least squares to any number of signals, added one by one."""

    def __init__(self, columns: int) -> None:
        self.gram = np.zeros((columns, KNOTS, KNOTS))
        self.right = np.zeros((columns, KNOTS))

    def add(self, phase: Floats, values: Floats, visible: Mask) -> None:
        """Add values (T, A), 0 where missing, at phases (T,)."""
        basis = _periodic_basis(phase)
        self.right += (basis.T @ values).T
        if visible.all():
            self.gram += basis.T @ basis
            return
        for column, rows in enumerate(visible.T):
            self.gram[column] += basis[rows].T @ basis[rows]

    def coefficients(self) -> Floats:
        """Return the coefficients (KNOTS, A), with a slight ridge for phases without data; 0 without any."""
        trace = np.trace(self.gram, axis1=1, axis2=2) / KNOTS
        ridge = (1e-9 * trace + 1e-21)[:, None, None] * np.eye(KNOTS)
        return np.asarray(np.linalg.solve(self.gram + ridge, self.right[..., None])[..., 0].T)

    def table(self) -> Floats:
        """Tabulate the curve (TABLE, A) at phases k / TABLE."""
        return _periodic_basis(np.arange(TABLE) / TABLE) @ self.coefficients()

    @property
    def known(self) -> Mask:
        """Whether each column (A,) has any data."""
        return np.asarray(np.trace(self.gram, axis1=1, axis2=2) > 0)


class _Sequence:
    """Signals (T, A) of one sequence, NaN where missing, and its period in frames."""

    def __init__(self, signals: Floats, period: float) -> None:
        self.period = float(period)
        self.visible = np.isfinite(signals)
        self.values = np.where(self.visible, signals, 0.0)
        self.time = np.arange(len(signals))

    def phase(self, offset: float) -> Floats:
        """Return the phase (T,) of each frame."""
        return np.mod((self.time - offset) / self.period, 1.0)

    def add_to(self, curve: _Curve, offset: float) -> None:
        """Add this sequence to the fit of a curve."""
        curve.add(self.phase(offset), self.values, self.visible)

    def squares(self, table: Floats, offset: float) -> Floats:
        """Return the sum of squares (A,) about a tabulated curve, linear between its samples."""
        at = self.phase(offset) * TABLE
        low = at.astype(int) % TABLE
        part = (at - np.floor(at))[:, None]
        curve = table[low] * (1 - part) + table[(low + 1) % TABLE] * part
        return np.asarray((((self.values - curve) * self.visible) ** 2).sum(axis=0))

    def cost(self, table: Floats, weights: Floats, offset: float) -> float:
        """Return the weighted sum of squares."""
        return float(self.squares(table, offset) @ weights)

    def correlation(self, table: Floats, weights: Floats) -> Floats:
        """Return the cost (CORRELATION_BINS,), up to a constant, at offsets of whole bins."""
        bins = np.minimum((self.phase(0.0) * CORRELATION_BINS).astype(int), CORRELATION_BINS - 1)
        sums, counts = (
            np.zeros((CORRELATION_BINS, self.values.shape[1])),
            np.zeros((CORRELATION_BINS, self.values.shape[1])),
        )
        np.add.at(sums, bins, self.values)
        np.add.at(counts, bins, self.visible)
        sums_hat, counts_hat = np.fft.rfft(sums, axis=0), np.fft.rfft(counts, axis=0)
        mean = table.reshape(CORRELATION_BINS, -1, table.shape[1]).mean(axis=1)
        spectrum = np.conj(np.fft.rfft(mean**2 * weights, axis=0)) * counts_hat
        spectrum -= 2 * np.conj(np.fft.rfft(mean * weights, axis=0)) * sums_hat
        return np.asarray(np.fft.irfft(spectrum.sum(axis=1), CORRELATION_BINS))

    def best_offset(self, table: Floats, weights: Floats, now: float) -> float:
        """Return the offset of least cost by correlation, then smaller steps and a parabola."""
        coarse = float(np.argmin(self.correlation(table, weights))) * self.period / CORRELATION_BINS
        best, cost = now, self.cost(table, weights, now)
        rough = self.cost(table, weights, coarse)
        if rough < cost:
            best, cost = coarse, rough
        step = self.period / CORRELATION_BINS
        while step > FINEST:
            left, right = (self.cost(table, weights, best + d) for d in (-step, step))
            bend = left - 2 * cost + right
            shift = 0.5 * step * (left - right) / bend if bend > 0 else 0.0
            options = [(cost, best), (left, best - step), (right, best + step)]
            if 0 < abs(shift) < step:
                options.append((self.cost(table, weights, best + shift), best + shift))
            cost, best = min(options)
            step /= 4 if abs(shift) < step else 1.5
        return best % self.period


@dataclass(frozen=True)
class _Problem:
    signals: list[Floats]
    periods: Floats
    hips: tuple[int, int] | None

    def sequences(self) -> Iterator[_Sequence]:
        return (_Sequence(z, p) for z, p in zip(self.signals, self.periods, strict=True))

    def curve(self, offsets: Floats) -> _Curve:
        """Fit a spline to all sequences together."""
        curve = _Curve(self.signals[0].shape[1])
        for s, offset in zip(self.sequences(), offsets, strict=True):
            s.add_to(curve, offset)
        return curve

    def gauged(self, offsets: Floats) -> Floats:
        """Fix the common phase of offsets: the first harmonic of right minus left hip flexion is a cosine.

        It is computed from the frames themselves, so that a common shift of all phases cancels exactly.
        """
        if self.hips is None:
            return offsets
        right, left = self.hips
        total = sum(
            first_harmonic(z[:, right] - z[:, left], float(period), float(offset))
            for z, period, offset in zip(self.signals, self.periods, offsets, strict=True)
        )
        return np.asarray((offsets - np.angle(total) / (2 * np.pi) * self.periods) % self.periods)


def align(
    signals: list[Floats],
    periods: Floats,
    start: Floats | None = None,
    hips: tuple[int, int] | None = None,
    weights: Floats | None = None,
) -> Alignment:
    """Find the offset of each sequence.

    Signals are (T_i, A), NaN where missing; a sequence may lack whole angles and is then aligned by the
    others. Periods are frames.  `start` (n,) are offsets to start from; by default circular cross-correlation
    with the curve of the first sequence, and of some others if a phase is ambiguous.  `hips` are the columns
    of right and left hip flexion, which fix the common phase.  `weights` (A,) are those of the angles in the
    sum of squares, by default one over their noise.  The paper starts from offsets 0 with equal weights.
    """
    problem = _Problem(signals, np.asarray(periods, float), hips)
    weights = _noise_weights(problem) if weights is None else weights
    if start is not None:
        return _descend(problem, np.asarray(start, float), weights)
    found = [_descend(problem, offsets, weights) for offsets in _xcorr_starts(problem, weights)]
    return min(found, key=lambda a: a.objective[-1])


def common_curve(signals: list[Floats], periods: Floats, offsets: Floats) -> Floats:
    """Return the mean curve (1024, A) of aligned sequences as a periodic spline; NaN without data."""
    curve = _Problem(signals, periods, None).curve(offsets)
    return np.where(curve.known, curve.table(), np.nan)


def hip_phase(curve: Floats) -> float:
    """Return the phase of a curve (n, >= 24) at which the first harmonic of the hips' difference is largest.

    It replaces the right heel strike if the feet are unknown; in the mean of CMU's walks the two differ by
    0.02 of a cycle.
    """
    right, left = HIP_COLUMNS
    return float(-np.angle(np.fft.fft(curve[:, right] - curve[:, left])[1]) / (2 * np.pi) % 1.0)


def _descend(problem: _Problem, offsets: Floats, weights: Floats) -> Alignment:
    """Alternate both steps until the objective converges; if it increases, keep the better offsets."""
    now = before = problem.gauged(offsets)
    result = Alignment(now, weights=weights)
    for _ in range(MOST_ALIGNMENT_PASSES):
        table = problem.curve(now).table()
        cost = sum(s.cost(table, weights, o) for s, o in zip(problem.sequences(), now, strict=True))
        result.objective.append(cost)
        if len(result.objective) > 1 and cost > result.objective[-2] * (1 - ALIGNMENT_TOLERANCE):
            result.converged = cost <= result.objective[-2] * (1 + ALIGNMENT_TOLERANCE)
            now = before if cost > result.objective[-2] else now
            break
        steps = zip(problem.sequences(), now, strict=True)
        moved = np.array([s.best_offset(table, weights, o) for s, o in steps])
        before, now = now, _without_drift(moved, now, problem.periods)
    result.offsets = problem.gauged(now)
    return result


def _without_drift(offsets: Floats, before: Floats, periods: Floats) -> Floats:
    """Remove the common part of a change from the offsets.

    It affects the fit only through the positions of the knots, towards which all phases would drift forever.
    """
    turn = np.angle(np.mean(np.exp(2j * np.pi * (offsets - before) / periods))) / (2 * np.pi)
    return np.asarray((offsets - turn * periods) % periods)


def _noise_weights(problem: _Problem) -> Floats:
    """Return one over the variance about a spline of each sequence alone, mean 1; 0 if never visible."""
    columns = problem.signals[0].shape[1]
    rest, count = np.zeros(columns), np.zeros(columns)
    for s in problem.sequences():
        alone = _Curve(columns)
        s.add_to(alone, 0.0)
        rest += s.squares(alone.table(), 0.0)
        count += s.visible.sum(axis=0)
    known = count > 0
    variance = rest[known] / count[known]
    floor = 1e-3 * float(np.mean(variance)) + 1e-12
    weights = np.zeros(columns)
    weights[known] = 1 / np.maximum(variance, floor)
    return weights / weights[known].mean()


def _xcorr_starts(problem: _Problem, weights: Floats) -> Iterator[Floats]:
    """Yield offsets from the first sequence's curve, and from some others' if a phase is ambiguous."""
    offsets, ambiguous = _xcorr_start(problem, weights, 0)
    yield offsets
    if ambiguous:
        others = np.linspace(0, len(offsets), MOST_FIRST_SEQUENCES, endpoint=False)[1:].astype(int)
        for first in sorted(set(others.tolist()) - {0}):
            yield _xcorr_start(problem, weights, first)[0]


def _xcorr_start(problem: _Problem, weights: Floats, first: int) -> tuple[Floats, bool]:
    """Return offsets by rounds of circular cross-correlation, the first against one sequence's curve.

    Also return whether some sequence fits another phase nearly as well.
    """
    offsets, ambiguous = np.zeros(len(problem.signals)), False
    alone = _Problem([problem.signals[first]], problem.periods[[first]], None)
    reference = alone.curve(np.zeros(1)).table()
    for _ in range(XCORR_ROUNDS):
        ambiguous = False
        for i, s in enumerate(problem.sequences()):
            cost = s.correlation(reference, weights)
            offsets[i] = np.argmin(cost) * s.period / CORRELATION_BINS
            ambiguous |= _second(cost) > AMBIGUOUS
        reference = problem.curve(offsets).table()
    return offsets, ambiguous


def _second(cost: Floats) -> float:
    """Return the depth of the second-best valley of the cost (CORRELATION_BINS,) relative to the deepest."""
    reach, best = round(LEAST_OFFSET_CYCLES * CORRELATION_BINS), int(np.argmin(cost))
    far = np.roll(cost, -best)[reach : CORRELATION_BINS - reach]
    valley = int(np.argmin(far))
    depth = float(cost.mean() - cost[best])
    if depth <= 0 or valley in (0, len(far) - 1):
        return 0.0
    return float(cost.mean() - far[valley]) / depth
