"""Gaussians whose information matrix is block-tridiagonal: blocks of time, each tied to its neighbours.

Everything is exact; work and memory grow with the number of blocks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import LinAlgError, lapack, solve_triangular

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Factor:
    """Cholesky factor of an information matrix of B blocks of n rows.

    Attributes
    ----------
    lower : (B, n, n)
        Its blocks on the diagonal.
    below : (B - 1, n, n)
        Its blocks below them.
    """

    lower: Floats
    below: Floats

    @property
    def log_det(self) -> float:
        """Logarithm of the determinant of the information matrix."""
        return 2 * float(np.log(np.diagonal(self.lower, axis1=1, axis2=2)).sum())

    def solve(self, vector: Floats) -> Floats:
        """Mean (B, n, c) of Gaussians with information vectors (B, n, c)."""
        result = np.empty_like(vector)
        for s, lower in enumerate(self.lower):
            rest = vector[s] if s == 0 else vector[s] - self.below[s - 1] @ result[s - 1]
            result[s] = solve_triangular(lower, rest, lower=True, check_finite=False)
        for s in reversed(range(len(vector))):
            rest = result[s]
            if s + 1 < len(vector):
                rest = rest - self.below[s].T @ result[s + 1]
            result[s] = solve_triangular(self.lower[s], rest, lower=True, trans=1, check_finite=False)
        return result

    def covariance(self) -> tuple[Floats, Floats]:
        """Blocks of the covariance: on the diagonal (B, n, n), of each with the one before (B - 1, n, n)."""
        count, size = self.lower.shape[:2]
        diagonal, across = np.empty_like(self.lower), np.empty_like(self.below)
        unit = np.eye(size)
        for s in reversed(range(count)):
            half = solve_triangular(self.lower[s], unit, lower=True, check_finite=False)
            diagonal[s] = half.T @ half
            if s + 1 < count:
                gain = self.below[s] @ half
                across[s] = -diagonal[s + 1] @ gain
                diagonal[s] -= gain.T @ across[s]
        return diagonal, across


def factor(diagonal: Floats, below: Floats) -> Factor:
    """Factor an information matrix given by its blocks (B, n, n) and (B - 1, n, n).

    Raises
    ------
    LinAlgError
        If it is not positive definite.
    """
    lower, left = np.empty_like(diagonal), np.empty_like(below)
    for s, block in enumerate(diagonal):
        rest = block if s == 0 else block - left[s - 1] @ left[s - 1].T
        lower[s], wrong = lapack.dpotrf(rest, lower=1, clean=1)
        if wrong:
            raise LinAlgError(f"block {s} of the information matrix is not positive definite")
        if s < len(below):
            left[s] = solve_triangular(lower[s], below[s].T, lower=True, check_finite=False).T
    return Factor(lower, left)
