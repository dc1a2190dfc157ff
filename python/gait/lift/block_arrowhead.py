"""Gaussians over blocks of time and over numbers that last: block-tridiagonal information with a border.

With x the blocks and g what lasts, the information matrix is [[A, C], [C', D]] with A block-tridiagonal.
Eliminating x leaves S = D - C' A^-1 C of g's own size; everything is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.lift import tridiagonal

Floats = npt.NDArray[np.float64]


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
    _factor: tridiagonal.Factor
    _reach: Floats  #: A^-1 C, (B, n, G)
    _free: Floats  #: S^-1

    def covariance(self) -> tuple[Floats, Floats]:
        """Blocks of the covariance of x: on the diagonal, and of each with the one before."""
        diagonal, across = self._factor.covariance()
        spread = self._reach @ self._free
        diagonal += spread @ self._reach.transpose(0, 2, 1)
        across += spread[1:] @ self._reach[:-1].transpose(0, 2, 1)
        return diagonal, across


def solve(info: Information) -> Solution:
    """Mean and factors.

    Raises
    ------
    LinAlgError
        If the information matrix is not positive definite.
    """
    factor = tridiagonal.factor(info.diagonal, info.below)
    reach = factor.solve(info.border)
    alone = factor.solve(info.vector[..., None])[..., 0]
    corner = info.corner - np.einsum("bng,bnh->gh", info.border, reach)
    lower = np.linalg.cholesky((corner + corner.T) / 2)
    root = np.linalg.inv(lower)
    free = root.T @ root
    lasting = free @ (info.edge - np.einsum("bng,bn->g", info.border, alone))
    log_det = factor.log_det + 2 * float(np.log(np.diagonal(lower)).sum())
    return Solution(alone - reach @ lasting, lasting, log_det, factor, reach, free)
