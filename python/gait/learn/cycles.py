"""Sequences cut into cycles and resampled on the reference grid (Ormoneit 2000, Fig. 5 step 1; R5, R6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

INTERVALS = 16  # knot intervals per cycle
PENALTY = 1e-3  # of the second differences, relative to the data's trace
BRACKET = 0.75  # knot intervals within which an observed sample must lie on both sides
OBSERVED = 0.4  # share of entries a cycle must have to be used, of the channels that its sequence has
END = 0.05  # share of the cycle over which its end levels are estimated


@dataclass
class Cycles:
    """R cycles on T phases.

    Attributes
    ----------
    values : (R, T, M)
        Channel values, defined where observed.
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


def slice_cycles(
    signals: list[Floats], periods: Floats, offsets: Floats, samples: int, observed: float = OBSERVED
) -> Cycles:
    """Cut sequences (T_i, M) into cycles and resample each on `samples` phases.

    Slice k covers frames from offset + (k - 1) period to offset + k period; slices with less than the share
    `observed` of their entries, in the channels that the sequence has, are dropped.
    """
    rows: list[tuple[Floats, Mask, Floats, int, int]] = []
    for i, (z, period, offset) in enumerate(zip(signals, periods, offsets, strict=True)):
        channels = int(np.isfinite(z).any(axis=0).sum())
        for k in range(int(np.ceil((len(z) - offset) / period)) + 1):
            u = (np.arange(len(z)) - offset) / period - (k - 1)
            values, mask = resample(u, z, samples)
            if channels and mask.sum() >= observed * samples * channels:
                flat, ramp = _close(values, mask)
                rows.append((flat, mask, ramp, i, k))
    columns = list(zip(*rows, strict=True)) if rows else [(), (), (), (), ()]
    values, mask, ramp = (np.array(column) for column in columns[:3])
    sequence, cycle = (np.array(column, int) for column in columns[3:])
    return Cycles(values, mask, ramp, sequence, cycle)


def resample(u: Floats, z: Floats, samples: int) -> tuple[Floats, Mask]:
    """Penalised cubic splines of one cycle at phases j / samples.

    Parameters
    ----------
    u : (T,)
        Positions in the cycle, increasing; those a little outside [0, 1) support its ends.
    z : (T, M)
        NaN where missing.

    Returns
    -------
    values : (samples, M)
    mask : (samples, M)
        True where an observed sample lies near on both sides.
    """
    near = (u > -1 / INTERVALS) & (u < 1 + 1 / INTERVALS)
    u, z = u[near], z[near]
    grid = np.arange(samples) / samples
    values, mask = np.zeros((samples, z.shape[1])), np.zeros((samples, z.shape[1]), bool)
    if not len(u):
        return values, mask
    basis, at_grid = _basis(u), _basis(grid)
    seen = np.isfinite(z)
    for columns in _same_columns(seen):
        rows = seen[:, columns[0]]
        if rows.sum() < 4:
            continue
        x, y = basis[rows], z[rows][:, columns]
        values[:, columns] = at_grid @ np.linalg.solve(x.T @ x + _penalty(x), x.T @ y)
        mask[:, columns] = _bracketed(grid, u[rows])[:, None]
    return values, mask


def _basis(u: Floats) -> Floats:
    knots = np.arange(-4, INTERVALS + 5) / INTERVALS
    return np.asarray(BSpline.design_matrix(u, knots, 3).toarray())


def _penalty(x: Floats) -> Floats:
    """Second-difference penalty, scaled to the data."""
    difference = np.diff(np.eye(x.shape[1]), 2, axis=0)
    gram = difference.T @ difference
    return gram * (PENALTY * float(np.sum(x**2)) / np.trace(gram)) + 1e-10 * np.eye(x.shape[1])


def _same_columns(seen: Mask) -> list[list[int]]:
    """Columns grouped by their pattern of observed rows."""
    groups: dict[bytes, list[int]] = {}
    for k, column in enumerate(seen.T):
        groups.setdefault(column.tobytes(), []).append(k)
    return list(groups.values())


def _bracketed(grid: Floats, u: Floats) -> Mask:
    """Grid points with an observed sample within BRACKET knot intervals on both sides."""
    reach = BRACKET / INTERVALS
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
