"""Gaussians with a block arrowhead information matrix: blocks of time, and lasting unknowns.

With x the blocks, each coupled with its neighbours, and g the lasting unknowns, the information matrix is
[[A, C], [C', D]], where A is block-tridiagonal.  Eliminating x leaves S = D - C' A^-1 C of the size of g.
Everything is exact; work and memory are proportional to the number of blocks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import LinAlgError, blas, lapack

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Factor:
    """Cholesky factor of a block-tridiagonal information matrix with B blocks of n rows.

    Attributes
    ----------
    lower : (B, n, n)
        Blocks on the diagonal of the factor.
    below : (B - 1, n, n)
        Blocks below the diagonal.
    """

    lower: Floats
    below: Floats

    @property
    def log_det(self) -> float:
        """Logarithm of the determinant of the information matrix."""
        return 2 * float(np.log(np.diagonal(self.lower, axis1=1, axis2=2)).sum())

    def forward(self, right: Floats) -> Floats:
        """Multiply (B, n, c) by the inverse of the factor."""
        result = np.empty(right.shape)
        for s, lower in enumerate(self.lower):
            rest = right[s] if s == 0 else right[s] - self.below[s - 1] @ result[s - 1]
            result[s] = blas.dtrsm(1.0, lower, rest, lower=1)
        return result

    def backward(self, right: Floats) -> Floats:
        """Multiply (B, n, c) by the inverse of the factor's transpose."""
        result = np.empty(right.shape)
        for s in reversed(range(len(right))):
            rest = right[s] if s + 1 == len(right) else right[s] - self.below[s].T @ result[s + 1]
            result[s] = blas.dtrsm(1.0, self.lower[s], rest, lower=1, trans_a=1)
        return result

    def solve(self, vector: Floats) -> Floats:
        """Compute the means (B, n, c) of Gaussians with information vectors (B, n, c)."""
        return self.backward(self.forward(vector))

    def covariance(self) -> tuple[Floats, Floats]:
        """Compute blocks of the covariance: diagonal (B, n, n), and with the one before (B - 1, n, n)."""
        diagonal, across = np.empty(self.lower.shape), np.empty(self.below.shape)
        for s in reversed(range(len(diagonal))):
            half = lapack.dtrtri(self.lower[s], lower=1)[0]
            diagonal[s] = half.T @ half
            if s < len(across):
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
    # column-major, as in LAPACK, so that nothing is copied
    lower, left = np.empty(diagonal.shape).transpose(0, 2, 1), np.empty(below.shape)
    for s, block in enumerate(diagonal):
        rest = block.T
        if s:  # only the lower triangle of symmetric matrices is computed and read
            rest = blas.dsyrk(-1.0, left[s - 1].T, beta=1.0, c=rest, trans=1, lower=1)
        lower[s], wrong = lapack.dpotrf(rest, lower=1, clean=1)
        if wrong:
            raise LinAlgError(f"block {s} of the information matrix is not positive definite")
        if s < len(below):
            left[s] = blas.dtrsm(1.0, lower[s], below[s].T, lower=1).T
    return Factor(lower, left)


@dataclass(frozen=True)
class Information:
    """Information matrix and vector of B blocks of n unknowns, and of G lasting unknowns.

    Attributes
    ----------
    diagonal : (B, n, n)
    below : (B - 1, n, n)
    border : (B, n, G)
        Information between blocks and lasting unknowns.
    corner : (G, G)
    vector : (B, n)
        Information times mean of the blocks.
    edge : (G,)
        Information times mean of the lasting unknowns.
    """

    diagonal: Floats
    below: Floats
    border: Floats
    corner: Floats
    vector: Floats
    edge: Floats


@dataclass(frozen=True)
class Solution:
    """Mean of such a Gaussian, and the factors from which its covariance is computed.

    Attributes
    ----------
    blocks : (B, n)
    lasting : (G,)
    log_det : float
        Log determinant of the information matrix.
    """

    blocks: Floats
    lasting: Floats
    log_det: float
    _factor: Factor
    _half: Floats  #: L^-1 C, (B, n, G), of A = L L'
    _lower: Floats  #: factor of S

    def covariance(self) -> tuple[Floats, Floats]:
        """Compute blocks of the covariance of x: on the diagonal, and of each with the one before."""
        diagonal, across = self._factor.covariance()
        reach = self._factor.backward(self._half) @ np.linalg.inv(self._lower).T
        diagonal += reach @ reach.transpose(0, 2, 1)
        across += reach[1:] @ reach[:-1].transpose(0, 2, 1)
        return diagonal, across


def solve(info: Information) -> Solution:
    """Compute mean and factors.

    Raises
    ------
    LinAlgError
        If the information matrix is not positive definite.
    """
    inner = factor(info.diagonal, info.below)
    both = inner.forward(np.concatenate([info.border, info.vector[..., None]], axis=2))
    flat = both.reshape(-1, both.shape[2])
    half, alone = flat[:, :-1], flat[:, -1]
    lower = np.linalg.cholesky(info.corner - half.T @ half)
    lasting = lapack.dpotrs(lower.T, info.edge - half.T @ alone)[0]
    blocks = inner.backward((alone - half @ lasting).reshape(*info.vector.shape, 1))[..., 0]
    log_det = inner.log_det + 2 * float(np.log(np.diagonal(lower)).sum())
    return Solution(blocks, lasting, log_det, inner, both[..., :-1], lower)
