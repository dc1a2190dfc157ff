"""Segments in few numbers: the main directions of all of them, in which the rest of the learning is cheap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh

from gait.learn.spool import by_rows, stored

Floats = npt.NDArray[np.float64]

MOST = 160  # directions kept for what follows; a prior has 50 modes
ROUNDS = 10  # of filling in missing entries
SETTLED = 1e-3  # relative change of their rms between rounds


@dataclass(frozen=True)
class Basis:
    """Rows as mean + scores directions' + rest.

    Attributes
    ----------
    mean : (D,)
    directions : (D, r)
        Orthonormal, most variance first.
    scores : (N, r)
    rest : (N, J)
        Squared length of what the directions leave of each marker.
    """

    mean: Floats
    directions: Floats
    scores: Floats
    rest: Floats

    def variance(self, moments: Floats) -> Floats:
        """Diagonal (D,) of directions moments directions', for moments (r, r)."""
        return np.asarray(np.einsum("dr,rs,ds->d", self.directions, moments, self.directions, optimize=True))


def basis(rows: Floats, markers: int, most: int = MOST) -> Basis:
    """Find the main directions of rows (N, F * J * 3), frame by frame, marker by marker."""
    mean = np.sum([rows[part].sum(axis=0) for part in by_rows(rows)], axis=0) / len(rows)
    values, directions = _eigen(rows, mean, most)
    directions = directions[:, values > 1e-10 * values[0]]
    scores, rest = np.empty((len(rows), directions.shape[1])), np.empty((len(rows), markers))
    for part in by_rows(rows):
        centred = rows[part] - mean
        scores[part] = centred @ directions
        left = (centred - scores[part] @ directions.T).reshape(len(centred), -1, markers, 3)
        rest[part] = np.sum(left**2, axis=(1, 3))
    return Basis(mean, directions, scores, rest)


def _eigen(rows: Floats, mean: Floats, most: int) -> tuple[Floats, Floats]:
    """Largest eigenvalues and eigenvectors (D, r) of the scatter of rows, from its smaller form."""
    count, size = rows.shape
    if count <= size:
        centred = rows - mean
        values, left = _largest(centred @ centred.T, most)
        return values, centred.T @ left / np.sqrt(np.maximum(values, 1e-300))
    scatter = np.zeros((size, size))
    for part in by_rows(rows):
        centred = rows[part] - mean
        scatter += centred.T @ centred
    return _largest(scatter, most)


def _largest(matrix: Floats, most: int) -> tuple[Floats, Floats]:
    size = len(matrix)
    values, vectors = eigh(matrix, subset_by_index=(max(0, size - most), size - 1))
    return values[::-1], vectors[:, ::-1]


def filled(rows: Floats, modes: int) -> Floats:
    """Rows (N, D) with missing entries as their segment's others let expect, on disk.

    Conditional means under a Gaussian of so many modes and an even rest, learnt from the filled rows in turn.
    """
    gaps = [k for part in by_rows(rows) for k in _with_gaps(rows, part)]
    if not gaps:
        return rows
    seen = np.sum([np.isfinite(rows[part]).sum(axis=0) for part in by_rows(rows)], axis=0)
    total = np.sum([np.nansum(rows[part], axis=0) for part in by_rows(rows)], axis=0)
    guess = {k: np.where(np.isnan(rows[k]), total / np.maximum(seen, 1), rows[k]) for k in gaps}
    for _ in range(ROUNDS):
        whole = _with(rows, guess)
        found = basis(whole, 1, modes)
        before, guess = guess, {k: _expected(rows[k], found) for k in gaps}
        change = sum(float(np.sum((guess[k] - before[k]) ** 2)) for k in gaps)
        size = sum(float(np.sum((guess[k] - found.mean)[np.isnan(rows[k])] ** 2)) for k in gaps)
        if change <= SETTLED**2 * size:
            break
    return _with(rows, guess)


def _with_gaps(rows: Floats, part: slice) -> list[int]:
    """Find the numbers of the rows with gaps in a part."""
    return (part.start + np.flatnonzero(np.isnan(rows[part]).any(axis=1))).tolist()


def _with(rows: Floats, guess: dict[int, Floats]) -> Floats:
    """Put rows with guesses in place of some of them on disk."""
    blocks = (
        np.array([guess.get(k, rows[k]) for k in range(part.start, min(part.stop, len(rows)))])
        for part in by_rows(rows)
    )
    return stored(blocks, rows.shape[1:])


def _expected(row: Floats, found: Basis) -> Floats:
    """Fill the gaps of a row with their mean given the rest of it."""
    known = np.isfinite(row)
    count = max(len(found.scores) - 1, 1)
    variance = np.sum(found.scores**2, axis=0) / count
    even = max(float(found.rest.sum()) / count / len(row), 1e-8)
    design = found.directions[known]
    precision = design.T @ design / even + np.diag(1 / np.maximum(variance, 1e-12))
    scores = np.linalg.solve(precision, design.T @ (row - found.mean)[known] / even)
    return np.where(known, row, found.mean + found.directions @ scores)
