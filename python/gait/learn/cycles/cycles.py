"""Sequences cut into cycles and resampled on the reference grid (Ormoneit 2000, Fig. 5 step 1)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline

from gait.learn.cycles.patterns import same_columns
from gait.learn.spool import release, stored

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

INTERVALS = 16  # knot intervals per cycle
PENALTY = 1e-3  # of the second differences, relative to the data's trace
BRACKET = 0.75  # knot intervals within which an observed sample must lie on both sides
NEXT = 1 + 1e-9  # frame intervals that this is at least: at low rates the next frame is farther away
OBSERVED = 0.4  # share of entries a cycle must have to be used, of the channels that its sequence has
END = 0.05  # share of the cycle over which its end levels are estimated


@dataclass
class Cycles:
    """R cycles on T phases.

    Attributes
    ----------
    values : (R, T, M)
        Channel values, defined where observed; on disk, read-only.
    mask : (R, T, M)
        Whether observed.
    ramp : (R, M)
        Rise over the cycle that was taken off so that it closes.
    sequence, cycle : (R,)
        Where each row comes from.
    """

    values: Floats
    mask: Mask
    ramp: Floats
    sequence: npt.NDArray[np.intp]
    cycle: npt.NDArray[np.intp]

    @property
    def seen(self) -> Mask:
        """Channels (M,) that some cycle shows."""
        return np.asarray(self.mask.any(axis=(0, 1)))


def slice_cycles(
    signals: list[Floats], periods: Floats, offsets: Floats, samples: int, observed: float = OBSERVED
) -> Cycles:
    """Cut sequences (T_i, M) into cycles and resample each on `samples` phases.

    Slice k covers frames from offset + (k - 1) period to offset + k period; slices with less than the share
    `observed` of their entries, in the channels that the sequence has, are dropped.
    """
    channels, rest = signals[0].shape[1], list[tuple[Mask, Floats, int, int]]()

    def closed() -> Iterator[Floats]:
        for i, (z, period, offset) in enumerate(zip(signals, periods, offsets, strict=True)):
            for k, values, mask in _slices(z, float(period), float(offset), samples, observed):
                flat, ramp = _close(values, mask)
                rest.append((mask, ramp, i, k))
                yield flat
            release(z)

    values = stored(closed(), (samples, channels))
    mask = np.array([row[0] for row in rest], bool).reshape(values.shape)
    ramp = np.array([row[1] for row in rest], float).reshape(-1, channels)
    return Cycles(values, mask, ramp, *(np.array([row[k] for row in rest], int) for k in (2, 3)))


def _slices(
    z: Floats, period: float, offset: float, samples: int, observed: float
) -> Iterator[tuple[int, Floats, Mask]]:
    """Give the slices of one sequence that are used: number, values and mask."""
    channels = int(np.isfinite(z).any(axis=0).sum())
    for k in range(int(np.ceil((len(z) - offset) / period)) + 1):
        u = np.asarray((np.arange(len(z)) - offset) / period - (k - 1), float)
        values, mask = resample(u, z, samples, 1 / period)
        if channels and mask.sum() >= observed * samples * channels:
            yield k, values, mask


def fewest(z: Floats, period: float, samples: int) -> int:
    """Count the cycles that `slice_cycles` finds in a sequence (T, M) at least, wherever they begin."""
    u, seen = np.arange(len(z)) / period, np.isfinite(z)
    channels, reach = int(seen.any(axis=0).sum()), max(BRACKET / INTERVALS, NEXT / period)
    grid = np.arange(-samples, (int(np.ceil(u[-1])) + 1) * samples) / samples
    entries = np.zeros(len(grid))
    for columns in same_columns(seen):
        if seen[:, columns[0]].any():
            entries += len(columns) * _bracketed(grid, u[seen[:, columns[0]]], reach)
    total = np.concatenate([[0.0], np.cumsum(entries)])
    enough = total[samples:] - total[:-samples] >= OBSERVED * samples * max(channels, 1)
    return min(int(enough[first::samples].sum()) for first in range(samples))


def resample(u: Floats, z: Floats, samples: int, interval: float = 0.0) -> tuple[Floats, Mask]:
    """Penalised cubic splines of one cycle at phases j / samples.

    Parameters
    ----------
    u : (T,)
        Positions in the cycle, increasing; those a little outside [0, 1) support its ends.
    z : (T, M)
        NaN where missing.
    interval : float
        Share of the cycle between two frames.

    Returns
    -------
    values : (samples, M)
    mask : (samples, M)
        True where an observed sample lies near on both sides.
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
    seen = np.isfinite(z)
    for columns in same_columns(seen):
        rows = seen[:, columns[0]]
        if rows.sum() < 4:
            continue
        x, y = basis[rows], z[rows][:, columns]
        values[:, columns] = at_grid @ np.linalg.solve(x.T @ x + _penalty(x), x.T @ y)
        mask[:, columns] = _bracketed(grid, u[rows], reach)[:, None]
    return values, mask


def _basis(u: Floats, margin: int) -> Floats:
    """Cubic B-splines (T, n) on the cycle and `margin` intervals to either side of it."""
    knots = np.arange(-3 - margin, INTERVALS + margin + 4) / INTERVALS
    return np.asarray(BSpline.design_matrix(u, knots, 3).toarray())


def _penalty(x: Floats) -> Floats:
    """Second-difference penalty, scaled to the data."""
    difference = np.diff(np.eye(x.shape[1]), 2, axis=0)
    gram = difference.T @ difference
    return gram * (PENALTY * float(np.sum(x**2)) / np.trace(gram)) + 1e-10 * np.eye(x.shape[1])


def _bracketed(grid: Floats, u: Floats, reach: float) -> Mask:
    """Grid points with an observed sample within reach on both sides."""
    after = np.searchsorted(u, grid, side="left")
    left = grid - u[np.maximum(np.searchsorted(u, grid, side="right") - 1, 0)]
    right = u[np.minimum(after, len(u) - 1)] - grid
    return (left >= -1e-12) & (left <= reach) & (right >= -1e-12) & (right <= reach)


def _close(values: Floats, mask: Mask) -> tuple[Floats, Floats]:
    """Take off the line joining the two end levels of each channel observed at both ends.

    Each end's level is a line through its last END of the cycle, taken at the end.
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
