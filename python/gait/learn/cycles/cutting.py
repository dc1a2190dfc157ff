"""Cut sequences into cycles, and resample these on a common grid of phases (Ormoneit 2000, Fig. 5 step 1)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from gait.learn.arrays import Floats, Indices, Mask, release, same_columns, stored

INTERVALS = 16  # knot intervals per cycle
PENALTY = 1e-3  # of the second differences, relative to the data's trace
BRACKET = 0.75  # knot intervals within which there must be an observed sample on both sides
NEXT = 1 + 1e-9  # least value of that in frame intervals, for low frame rates
OBSERVED = 0.4  # least share of a cycle's entries, in the channels of its sequence, that must be observed
END = 0.05  # share of the cycle from which the levels of its ends are estimated


@dataclass
class Cycles:
    """R cycles of M channels on T phases."""

    values: Floats  #: (R, T, M) channel values, defined where observed; on disk, read-only
    mask: Mask  #: (R, T, M) whether observed
    ramp: Floats  #: (R, M) rise over the cycle that was subtracted to close it
    sequence: Indices  #: (R,) sequence of each row
    cycle: Indices  #: (R,) number of the cycle in it

    @property
    def visible(self) -> Mask:
        """Channels (M,) that any cycle has."""
        return np.asarray(self.mask.any(axis=(0, 1)))


def cut_cycles(
    signals: list[Floats], periods: Floats, offsets: Floats, samples: int, closing: bool = True
) -> Cycles:
    """Cut sequences (T_i, M) into cycles and resample each on `samples` phases.

    Cycle k is the frames from offset + (k - 1) period to offset + k period.  Cycles with less than the share
    OBSERVED of their entries, in the channels that the sequence has, are dropped.  With `closing`, the line
    that joins the ends of a cycle is subtracted from it; in the paper the ends remain apart.
    """
    channels, rest = signals[0].shape[1], list[tuple[Mask, Floats, int, int]]()

    def closed() -> Iterator[Floats]:
        for i, (z, period, offset) in enumerate(zip(signals, periods, offsets, strict=True)):
            for k, values, mask in _slices(z, float(period), float(offset), samples):
                flat, ramp = _close(values, mask) if closing else (values, np.zeros(channels))
                rest.append((mask, ramp, i, k))
                yield flat
            release(z)

    values = stored(closed(), (samples, channels))
    mask = np.array([row[0] for row in rest], bool).reshape(values.shape)
    ramp = np.array([row[1] for row in rest], float).reshape(-1, channels)
    return Cycles(values, mask, ramp, *(np.array([row[k] for row in rest], int) for k in (2, 3)))


def _slices(z: Floats, period: float, offset: float, samples: int) -> Iterator[tuple[int, Floats, Mask]]:
    """Yield the cycles of one sequence that are used: number, values and mask."""
    channels = int(np.isfinite(z).any(axis=0).sum())
    for k in range(int(np.ceil((len(z) - offset) / period)) + 1):
        u = np.asarray((np.arange(len(z)) - offset) / period - (k - 1), float)
        values, mask = resample(u, z, samples, 1 / period)
        if channels and mask.sum() >= OBSERVED * samples * channels:
            yield k, values, mask


def fewest_cycles(z: Floats, period: float, samples: int) -> int:
    """Return the least number of cycles that `cut_cycles` finds in a sequence (T, M), over all offsets."""
    u, visible = np.arange(len(z)) / period, np.isfinite(z)
    channels, reach = int(visible.any(axis=0).sum()), max(BRACKET / INTERVALS, NEXT / period)
    grid = np.arange(-samples, (int(np.ceil(u[-1])) + 1) * samples) / samples
    entries = np.zeros(len(grid))
    for columns in same_columns(visible):
        if visible[:, columns[0]].any():
            entries += len(columns) * _bracketed(grid, u[visible[:, columns[0]]], reach)
    total = np.concatenate([[0.0], np.cumsum(entries)])
    enough = total[samples:] - total[:-samples] >= OBSERVED * samples * max(channels, 1)
    return min(int(enough[first::samples].sum()) for first in range(samples))


def resample(u: Floats, z: Floats, samples: int, interval: float = 0.0) -> tuple[Floats, Mask]:
    """Resample one cycle at phases j / samples by penalised cubic splines.

    `u` (T,) are increasing positions in the cycle, those a little outside [0, 1) supporting its ends; `z` (T,
    M) is NaN where missing; `interval` is the share of the cycle between two frames.  Returns values and mask
    (samples, M); the mask is True where an observed sample lies near on both sides.
    """
    reach = max(BRACKET / INTERVALS, NEXT * interval)
    margin = int(np.ceil(reach * INTERVALS))
    near = (u > -margin / INTERVALS) & (u < 1 + margin / INTERVALS)
    u, z = u[near], z[near]
    grid = np.arange(samples) / samples
    values, mask = np.zeros((samples, z.shape[1])), np.zeros((samples, z.shape[1]), bool)
    if not len(u):
        return values, mask
    basis, at_grid = _basis(u, margin), _basis(grid, margin)
    visible = np.isfinite(z)
    for columns in same_columns(visible):
        rows = visible[:, columns[0]]
        if rows.sum() < 4:
            continue
        x, y = basis[rows], z[rows][:, columns]
        values[:, columns] = at_grid @ np.linalg.solve(x.T @ x + _penalty(x), x.T @ y)
        mask[:, columns] = _bracketed(grid, u[rows], reach)[:, None]
    return values, mask


def _basis(u: Floats, margin: int) -> Floats:
    """Evaluate cubic B-splines (T, n) on the cycle and `margin` intervals to either side."""
    knots = np.arange(-3 - margin, INTERVALS + margin + 4) / INTERVALS
    return np.asarray(BSpline.design_matrix(u, knots, 3).toarray())


def _penalty(x: Floats) -> Floats:
    """Return the second-difference penalty, scaled to the data."""
    difference = np.diff(np.eye(x.shape[1]), 2, axis=0)
    gram = difference.T @ difference
    return gram * (PENALTY * float(np.sum(x**2)) / np.trace(gram)) + 1e-10 * np.eye(x.shape[1])


def _bracketed(grid: Floats, u: Floats, reach: float) -> Mask:
    """Return which grid points have an observed sample within reach on both sides."""
    after = np.searchsorted(u, grid, side="left")
    left = grid - u[np.maximum(np.searchsorted(u, grid, side="right") - 1, 0)]
    right = u[np.minimum(after, len(u) - 1)] - grid
    return (left >= -1e-12) & (left <= reach) & (right >= -1e-12) & (right <= reach)


def _close(values: Floats, mask: Mask) -> tuple[Floats, Floats]:
    """Subtract the line that joins the end levels of each channel observed at both ends.

    The level of an end is that of a line fitted to the last END of the cycle there.
    """
    samples = len(values)
    width = max(3, round(END * samples))
    u = np.arange(samples) / samples
    both = mask[:width].all(axis=0) & mask[-width:].all(axis=0)
    first, last = (
        np.polynomial.polynomial.polyfit(u[part] - end, values[part], 1)[0]
        for part, end in ((slice(0, width), 0.0), (slice(samples - width, samples), 1.0))
    )
    ramp = np.where(both, last - first, 0.0)
    return values - (u - 0.5)[:, None] * ramp, ramp
