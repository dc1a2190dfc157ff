"""Periodic cubic regression splines over the phase, fitted where signals are observed."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

KNOTS = 20
TABLE = 1024  # samples of a tabulated curve


def periodic_basis(phase: Floats, knots: int = KNOTS) -> Floats:
    """Evaluate periodic cubic B-splines with uniform knots at phases (n,): (n, knots)."""
    extended = np.arange(-3, knots + 4) / knots
    basis = BSpline.design_matrix(np.mod(phase, 1.0), extended, 3).toarray()
    basis[:, :3] += basis[:, knots:]
    return np.asarray(basis[:, :knots])


class Curve:
    """Sums of a least-squares fit of one curve (A columns) to any number of signals, added one by one."""

    def __init__(self, columns: int) -> None:
        self.gram = np.zeros((columns, KNOTS, KNOTS))
        self.right = np.zeros((columns, KNOTS))

    def add(self, phase: Floats, values: Floats, seen: Mask) -> None:
        """Add values (T, A), 0 where not seen, at phases (T,)."""
        basis = periodic_basis(phase)
        self.right += (basis.T @ values).T
        if seen.all():
            self.gram += basis.T @ basis
            return
        for column, rows in enumerate(seen.T):
            self.gram[column] += basis[rows].T @ basis[rows]

    def coefficients(self) -> Floats:
        """Best coefficients (KNOTS, A), with a trace of ridge for phases that nobody saw; 0 without data."""
        trace = np.trace(self.gram, axis1=1, axis2=2) / KNOTS
        ridge = (1e-9 * trace + 1e-21)[:, None, None] * np.eye(KNOTS)
        return np.asarray(np.linalg.solve(self.gram + ridge, self.right[..., None])[..., 0].T)

    def table(self) -> Floats:
        """Tabulate the curve (TABLE, A) at phases k / TABLE."""
        return periodic_basis(np.arange(TABLE) / TABLE) @ self.coefficients()

    @property
    def known(self) -> Mask:
        """Which columns (A,) have any data."""
        return np.asarray(np.trace(self.gram, axis1=1, axis2=2) > 0)
