"""How well segments of people who were left out are expected: what the rest outside the modes is for them.

The residuals of everybody else are too small for another person: a factor of their variance is fitted to the
likelihood of the people left out in turn.  And what lies outside the modes hardly changes within a segment,
while the prior takes it for new in every frame: ten frames of it would count ten times.  So `gamma` is that
factor times the number of frames that tell the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar

from gait.learn.segments.segment_basis import Basis

Floats = npt.NDArray[np.float64]

FOLDS = 10  # at most; with more people several are left out together
LEAST = 3.5e-7  # squared statures, about 1 mm^2: no joint is known better
RANGE = (1.0, 400.0)  # of gamma: nobody is nearer to the rest than they to each other


@dataclass(frozen=True)
class Fitted:
    """Gaussian of scores: eigenvalues `variance` (k,), `vectors` (r, k), and `residual` (J,) of the rest."""

    mean: Floats
    variance: Floats
    vectors: Floats
    residual: Floats


def fitted(basis: Basis, rows: npt.NDArray[np.bool_], modes: int) -> Fitted:
    """Mean, modes and residual variances of some of the rows (N,)."""
    scores, markers = basis.scores[rows], basis.rest.shape[1]
    mean, count = scores.mean(axis=0), max(len(scores) - 1, 1)
    centred = scores - mean
    moments = centred.T @ centred / count
    values, vectors = np.linalg.eigh(moments)
    values, vectors = values[::-1][:modes], vectors[:, ::-1][:, :modes]
    left = np.eye(len(mean)) - vectors @ vectors.T
    inside = basis.variance(left @ moments @ left).reshape(-1, markers, 3).sum(axis=(0, 2))
    entries = len(basis.mean) / markers
    residual = (inside + basis.rest[rows].sum(axis=0) / count) / entries
    return Fitted(mean, np.maximum(values, 0), vectors, np.maximum(residual, LEAST))


@dataclass(frozen=True)
class Fold:
    """Sums over the segments of people left out, with which the likelihood is closed.

    Attributes
    ----------
    signal : (k,)
        Squared singular values of the modes in units of the residual.
    along : (k,)
        Mean squared coordinates of the segments along them.
    beside : float
        Mean squared length of the rest.
    size : int
        Number of coordinates D.
    units : float
        Log determinant of the residual variances.
    alike : float
        Frames that tell the same: 1 if the rest is new in each, F if it stays.
    """

    signal: Floats
    along: Floats
    beside: float
    size: int
    units: float
    alike: float

    def loss(self, gamma: float) -> float:
        """Twice the negative log likelihood of a segment, without constants."""
        variance, rest = self.signal + gamma, self.size - len(self.signal)
        inside = np.sum(np.log(variance) + self.along / variance)
        return float(self.units + inside + rest * np.log(gamma) + self.beside / gamma)


def fold(basis: Basis, model: Fitted, rows: npt.NDArray[np.bool_]) -> Fold:
    """Sum over some rows (N,) under a model of others."""
    markers, entries = len(model.residual), len(basis.mean) // len(model.residual) // 3
    scale = 1 / np.sqrt(np.tile(np.repeat(model.residual, 3), entries))
    modes = (basis.directions @ (model.vectors * np.sqrt(model.variance))) * scale[:, None]
    left, singular, _ = np.linalg.svd(modes, full_matrices=False)
    x = (basis.scores[rows] - model.mean) @ (basis.directions * scale[:, None]).T
    inside = x @ left
    along = np.mean(inside**2, axis=0)
    rest = (x - inside @ left.T).reshape(len(x), entries, 3 * markers)
    alike = entries**2 * np.sum(rest.mean(axis=1) ** 2) / max(float(np.sum(rest**2)), 1e-300)
    outside = basis.rest[rows] @ (1 / model.residual)
    total = np.mean(np.sum(x**2, axis=1) + outside)
    units = 3 * entries * float(np.log(model.residual).sum())
    beside = float(total - along.sum())
    return Fold(singular**2, along, beside, 3 * markers * entries, units, float(max(alike, 1.0)))


def groups(subject: npt.NDArray[np.intp], recording: npt.NDArray[np.intp]) -> list[npt.NDArray[np.bool_]]:
    """Rows to leave out together: a person's, or a recording's if there is one person; [] if there is one."""
    of = subject if len(np.unique(subject)) > 1 else recording
    labels = np.unique(of)
    if len(labels) < 2:
        return []
    return [np.isin(of, part) for part in np.array_split(labels, min(FOLDS, len(labels)))]


def gamma(folds: list[Fold]) -> float:
    """Factor of the residual variance, every fold counting alike; 1 without folds."""
    if not folds:
        return 1.0

    def loss(x: float) -> float:
        return float(np.mean([f.loss(np.exp(x)) for f in folds]))

    found = minimize_scalar(loss, bounds=np.log(RANGE), method="bounded", options={"xatol": 1e-6})
    return float(np.exp(found.x) * np.mean([f.alike for f in folds]))
