"""One sequence against a common curve: the sum of squares at any offset, and the best offset."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gait.learn.cycles.periodic import TABLE, Curve

Floats = npt.NDArray[np.float64]

BINS = 256  # of the circular cross-correlation
FINEST = 0.01  # frames, of the last step of the search


class Shift:
    """Signals of one sequence, in memory for as long as this object is.

    Parameters
    ----------
    signals : (T, A)
        NaN where missing; whole columns may be.
    period : float
        Frames.
    """

    def __init__(self, signals: Floats, period: float) -> None:
        self.period = float(period)
        self.seen = np.isfinite(signals)
        self.values = np.where(self.seen, signals, 0.0)
        self.time = np.arange(len(signals))

    def phase(self, offset: float) -> Floats:
        """Phase (T,) of each frame."""
        return np.mod((self.time - offset) / self.period, 1.0)

    def add_to(self, curve: Curve, offset: float) -> None:
        """Let a curve be fitted to this sequence too."""
        curve.add(self.phase(offset), self.values, self.seen)

    def squares(self, table: Floats, offset: float) -> Floats:
        """Sum of squares (A,) about a tabulated curve, linear between its samples."""
        at = self.phase(offset) * TABLE
        low = at.astype(int) % TABLE
        part = (at - np.floor(at))[:, None]
        curve = table[low] * (1 - part) + table[(low + 1) % TABLE] * part
        return np.asarray((((self.values - curve) * self.seen) ** 2).sum(axis=0))

    def cost(self, table: Floats, weights: Floats, offset: float) -> float:
        """Weighted sum of squares."""
        return float(self.squares(table, offset) @ weights)

    def correlation(self, table: Floats, weights: Floats) -> Floats:
        """Approximate cost (BINS,) at offsets of whole bins, up to a constant, by circular correlation."""
        bins = np.minimum((self.phase(0.0) * BINS).astype(int), BINS - 1)
        sums, counts = np.zeros((BINS, self.values.shape[1])), np.zeros((BINS, self.values.shape[1]))
        np.add.at(sums, bins, self.values)
        np.add.at(counts, bins, self.seen)
        sums_hat, counts_hat = np.fft.rfft(sums, axis=0), np.fft.rfft(counts, axis=0)
        mean = table.reshape(BINS, -1, table.shape[1]).mean(axis=1)
        spectrum = np.conj(np.fft.rfft(mean**2 * weights, axis=0)) * counts_hat
        spectrum -= 2 * np.conj(np.fft.rfft(mean * weights, axis=0)) * sums_hat
        return np.asarray(np.fft.irfft(spectrum.sum(axis=1), BINS))

    def best_offset(self, table: Floats, weights: Floats, now: float) -> float:
        """Offset of least cost: by correlation, then smaller steps and a parabola; never worse than now."""
        coarse = float(np.argmin(self.correlation(table, weights))) * self.period / BINS
        best, cost = now, self.cost(table, weights, now)
        rough = self.cost(table, weights, coarse)
        if rough < cost:
            best, cost = coarse, rough
        step = self.period / BINS
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
