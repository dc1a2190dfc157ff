"""Gaussians whose information matrix is block-tridiagonal: blocks of time, each tied to its neighbours.

Everything is exact; work and memory grow with the number of blocks.

Gaussians over blocks of time and over numbers that last: block-tridiagonal information with a border.

With x the blocks and g what lasts, the information matrix is [[A, C], [C', D]] with A block-block_arrowhead.
Eliminating x leaves S = D - C' A^-1 C of g's own size; everything is exact.
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


@dataclass(frozen=True)
class Information:
    """Information matrix and vector of B blocks of n numbers and of G that last.

    Attributes
    ----------
    diagonal : (B, n, n)
    below : (B - 1, n, n)
    border : (B, n, G)
        Of the blocks with what lasts.
    corner : (G, G)
    vector : (B, n)
        Information times mean, of the blocks.
    edge : (G,)
        The same of what lasts.
    """

    diagonal: Floats
    below: Floats
    border: Floats
    corner: Floats
    vector: Floats
    edge: Floats


@dataclass(frozen=True)
class Solution:
    """Mean of such a Gaussian and what its covariance needs.

    Attributes
    ----------
    blocks : (B, n)
    lasting : (G,)
    log_det : float
        Of the information matrix.
    """

    blocks: Floats
    lasting: Floats
    log_det: float
    _factor: Factor
    _reach: Floats  #: A^-1 C, (B, n, G)
    _free: Floats  #: S^-1

    def covariance(self) -> tuple[Floats, Floats]:
        """Blocks of the covariance of x: on the diagonal, and of each with the one before."""
        diagonal, across = self._factor.covariance()
        sds = self._reach @ self._free
        diagonal += sds @ self._reach.transpose(0, 2, 1)
        across += sds[1:] @ self._reach[:-1].transpose(0, 2, 1)
        return diagonal, across


def solve(info: Information) -> Solution:
    """Mean and factors.

    Raises
    ------
    LinAlgError
        If the information matrix is not positive definite.
    """
    inner = factor(info.diagonal, info.below)
    reach = inner.solve(info.border)
    alone = inner.solve(info.vector[..., None])[..., 0]
    corner = info.corner - np.einsum("bng,bnh->gh", info.border, reach)
    lower = np.linalg.cholesky((corner + corner.T) / 2)
    root = np.linalg.inv(lower)
    free = root.T @ root
    lasting = free @ (info.edge - np.einsum("bng,bn->g", info.border, alone))
    log_det = inner.log_det + 2 * float(np.log(np.diagonal(lower)).sum())
    return Solution(alone - reach @ lasting, lasting, log_det, inner, reach, free)
