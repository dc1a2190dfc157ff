"""Phases of several sequences brought to one cycle (Ormoneit 2000, section 3.2 and Fig. 3).

Alternates a periodic cubic regression spline of all sequences together and the best offset of each; both
steps lower one weighted sum of squares.  Phase of frame j of a sequence: frac((j - offset) / period).  One
sequence at a time is in memory.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import ANGLES
from gait.learn.cycles.fourier import first_harmonic
from gait.learn.cycles.periodic import Curve
from gait.learn.cycles.shift import BINS, Shift

Floats = npt.NDArray[np.float64]

ITERATIONS = 100
TOLERANCE = 1e-6  # relative change of the objective at which to stop
XCORR_ROUNDS = 3
AMBIGUOUS = 0.75  # depth of a sequence's second best phase, of its best, at which other starts are tried
APART = 0.1  # cycles between those phases, at least
STARTS = 4  # most sequences whose curve serves as the first one
#: Columns of right and left hip flexion: the phases are counted from where right minus left is largest.
HIPS = (ANGLES.index("r_hip_flexion"), ANGLES.index("l_hip_flexion"))


@dataclass
class Alignment:
    """Result of `align`.

    Attributes
    ----------
    offsets : (n,)
        Frames, in [0, period).
    objective : list of float
        Weighted sum of squares of each iteration as it came out; falls but for rounding.
    weights : (A,)
        Of the angles: one over the variance left by a smooth curve per sequence.
    converged : bool
        Whether the objective ceased to fall; not if it rose or the iterations ran out.
    """

    offsets: Floats
    objective: list[float] = field(default_factory=list)
    weights: Floats = field(default_factory=lambda: np.ones(1))
    converged: bool = False


@dataclass(frozen=True)
class _Problem:
    signals: list[Floats]
    periods: Floats
    hips: tuple[int, int] | None

    def sequences(self) -> Iterator[Shift]:
        return (Shift(z, p) for z, p in zip(self.signals, self.periods, strict=True))

    def curve(self, offsets: Floats) -> Curve:
        """Spline of all sequences together."""
        curve = Curve(self.signals[0].shape[1])
        for s, offset in zip(self.sequences(), offsets, strict=True):
            s.add_to(curve, offset)
        return curve

    def gauged(self, offsets: Floats) -> Floats:
        """Offsets with the common phase fixed: the first harmonic of right minus left hip flexion a cosine.

        It is found from the frames themselves, so that a common shift of all phases drops out exactly.
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
    start: str | Floats = "xcorr",
    weights: Floats | None = None,
    hips: tuple[int, int] | None = None,
) -> Alignment:
    """Find the offset of each sequence.

    Parameters
    ----------
    signals : list of (T_i, A)
        NaN where missing; a sequence may lack whole angles and is then aligned by the others.
    periods : (n,)
        Frames.
    start : "xcorr", "zeros" or (n,)
        Circular cross-correlation with the first sequence's curve (and with some others', if a phase is
        ambiguous); the paper's start; or offsets.
    weights : (A,), optional
        By default one over each angle's noise variance; ones is the paper's choice.
    hips : (right, left), optional
        Columns of the hips' flexion, which fix the common phase.
    """
    problem = _Problem(signals, np.asarray(periods, float), hips)
    w = _noise_weights(problem) if weights is None else np.asarray(weights, float)
    if not isinstance(start, str):
        return _descend(problem, np.asarray(start, float), w)
    if start == "zeros":
        return _descend(problem, np.zeros(len(signals)), w)
    found = [_descend(problem, offsets, w) for offsets in _xcorr_starts(problem, w)]
    return min(found, key=lambda a: a.objective[-1])


def common_curve(signals: list[Floats], periods: Floats, offsets: Floats) -> Floats:
    """Mean curve (1024, A) of aligned sequences as a periodic spline; NaN in columns that nobody has."""
    curve = _Problem(signals, periods, None).curve(offsets)
    return np.where(curve.known, curve.table(), np.nan)


def hip_phase(curve: Floats) -> float:
    """Phase at which the first harmonic of right minus left hip flexion is largest in a curve (n, >= 24).

    Where the feet are not known it stands in for the right heel strike: in the mean of CMU's walks they are
    0.02 of a cycle apart.
    """
    right, left = HIPS
    return float(-np.angle(np.fft.fft(curve[:, right] - curve[:, left])[1]) / (2 * np.pi) % 1.0)


def _descend(problem: _Problem, offsets: Floats, weights: Floats) -> Alignment:
    """Alternate both steps until the objective stops falling; keep the better offsets if it rises."""
    now = before = problem.gauged(offsets)
    result = Alignment(now, weights=weights)
    for _ in range(ITERATIONS):
        table = problem.curve(now).table()
        cost = sum(s.cost(table, weights, o) for s, o in zip(problem.sequences(), now, strict=True))
        result.objective.append(cost)
        if len(result.objective) > 1 and cost > result.objective[-2] * (1 - TOLERANCE):
            result.converged = cost <= result.objective[-2] * (1 + TOLERANCE)
            now = before if cost > result.objective[-2] else now
            break
        steps = zip(problem.sequences(), now, strict=True)
        moved = np.array([s.best_offset(table, weights, o) for s, o in steps])
        before, now = now, _without_drift(moved, now, problem.periods)
    result.offsets = problem.gauged(now)
    return result


def _without_drift(offsets: Floats, before: Floats, periods: Floats) -> Floats:
    """Take the common part of a change off the offsets.

    It leaves the fit as it is but for the places of the knots, towards which all phases would creep for ever.
    """
    turn = np.angle(np.mean(np.exp(2j * np.pi * (offsets - before) / periods))) / (2 * np.pi)
    return np.asarray((offsets - turn * periods) % periods)


def _noise_weights(problem: _Problem) -> Floats:
    """One over the variance that a periodic spline of each sequence alone leaves, mean 1; 0 if never seen."""
    columns = problem.signals[0].shape[1]
    rest, count = np.zeros(columns), np.zeros(columns)
    for s in problem.sequences():
        alone = Curve(columns)
        s.add_to(alone, 0.0)
        rest += s.squares(alone.table(), 0.0)
        count += s.seen.sum(axis=0)
    known = count > 0
    variance = rest[known] / count[known]
    floor = 1e-3 * float(np.mean(variance)) + 1e-12
    weights = np.zeros(columns)
    weights[known] = 1 / np.maximum(variance, floor)
    return weights / weights[known].mean()


def _xcorr_starts(problem: _Problem, weights: Floats) -> Iterator[Floats]:
    """Offsets from the first sequence's curve, and from some others' if a sequence has an ambiguous phase."""
    offsets, ambiguous = _xcorr_start(problem, weights, 0)
    yield offsets
    if ambiguous:
        others = np.linspace(0, len(offsets), STARTS, endpoint=False)[1:].astype(int)
        for first in sorted(set(others.tolist()) - {0}):
            yield _xcorr_start(problem, weights, first)[0]


def _xcorr_start(problem: _Problem, weights: Floats, first: int) -> tuple[Floats, bool]:
    """Offsets by circular cross-correlation in some rounds, the first against one sequence's curve.

    Returns the offsets and whether some sequence fits another phase nearly as well.
    """
    offsets, ambiguous = np.zeros(len(problem.signals)), False
    alone = _Problem([problem.signals[first]], problem.periods[[first]], None)
    reference = alone.curve(np.zeros(1)).table()
    for _ in range(XCORR_ROUNDS):
        ambiguous = False
        for i, s in enumerate(problem.sequences()):
            cost = s.correlation(reference, weights)
            offsets[i] = np.argmin(cost) * s.period / BINS
            ambiguous |= _second(cost) > AMBIGUOUS
        reference = problem.curve(offsets).table()
    return offsets, ambiguous


def _second(cost: Floats) -> float:
    """Depth below the mean cost (BINS,) of the best valley away from the deepest, over the depth of that."""
    reach, best = round(APART * BINS), int(np.argmin(cost))
    far = np.roll(cost, -best)[reach : BINS - reach]
    valley = int(np.argmin(far))
    depth = float(cost.mean() - cost[best])
    if depth <= 0 or valley in (0, len(far) - 1):
        return 0.0
    return float(cost.mean() - far[valley]) / depth
