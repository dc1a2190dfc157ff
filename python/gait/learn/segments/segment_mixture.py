"""Mixture of Gaussians over the scores of the modes, as the paper suggests, by expectation-maximisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import logsumexp

from gait.learn.segments.segment_basis import Basis
from gait.learn.segments.segment_heldout import Fitted

Floats = npt.NDArray[np.float64]
Rows = npt.NDArray[np.bool_]

MOST = 6  # components that are tried
ROUNDS = 60
SETTLED = 1e-6  # relative gain of the log likelihood
FEWEST = 1e-3  # weight below which a component is no use


@dataclass(frozen=True)
class Mixture:
    """Weights (K,), means (K, k) and covariances (K, k, k) of scores about the mean of all."""

    weights: Floats
    means: Floats
    covariances: Floats

    def log_density(self, scores: Floats) -> Floats:
        """Of each component times its weight at scores (n, k), (n, K)."""
        columns = []
        for weight, mean, covariance in zip(self.weights, self.means, self.covariances, strict=True):
            root = np.linalg.cholesky(covariance)
            apart = np.linalg.solve(root, (scores - mean).T)
            spread = 2 * np.log(np.diag(root)).sum() + len(mean) * np.log(2 * np.pi)
            columns.append(np.log(weight) - 0.5 * (np.sum(apart**2, axis=0) + spread))
        return np.stack(columns, axis=1)


def choose(
    basis: Basis,
    model: Fitted,
    folds: Sequence[Rows],
    real: Rows,
    components: int | None,
) -> Mixture:
    """Mixture of so many components, or (None) of as many as describe the people left out best.

    Parameters
    ----------
    model : Fitted
        Of all rows: its modes are those of the mixture.
    folds : sequence of (N,)
        Rows that are left out together.
    real : (N,)
        Whether a row was recorded: only these are described, those of people made up are left out as well.
    """
    scores = np.asarray((basis.scores - model.mean) @ model.vectors)
    if components is None:
        gains = [_held_out(scores, folds, real, count) for count in range(1, MOST + 1)]
        components = 1 + int(np.argmax(gains)) if folds else 1
    return fit(scores, components)


def _held_out(scores: Floats, folds: Sequence[Rows], real: Rows, count: int) -> float:
    """Mean log density of recorded scores left out, every fold counting alike."""
    found = []
    for gone in folds:
        learnt = fit(scores[~gone], count)
        found.append(float(logsumexp(learnt.log_density(scores[gone & real]), axis=1).mean()))
    return float(np.mean(found)) if found else 0.0


def fit(scores: Floats, components: int) -> Mixture:
    """Fit components whose covariances are drawn towards the one that they share (k segments' worth).

    They start from slices along the first mode, so that the result has no chance in it.
    """
    count, size = scores.shape
    shared = np.cov(scores.T, bias=True).reshape(size, size) * count / max(count - 1, 1)
    if components == 1:
        return Mixture(np.ones(1), scores.mean(axis=0)[None], shared[None])
    shared = shared + 1e-9 * np.trace(shared) / size * np.eye(size)
    order = np.argsort(scores[:, 0], kind="stable")
    share = np.zeros((count, components))
    for k, part in enumerate(np.array_split(order, components)):
        share[part, k] = 1
    mixture, before = _maximised(scores, share, shared), -np.inf
    for _ in range(ROUNDS):
        density = mixture.log_density(scores)
        total = logsumexp(density, axis=1)
        share = np.exp(density - total[:, None])
        mixture = _maximised(scores, share, shared)
        if float(total.sum()) - before <= SETTLED * abs(before):
            break
        before = float(total.sum())
    return mixture


def _maximised(scores: Floats, share: Floats, shared: Floats) -> Mixture:
    """Parameters by the shares (n, K) of the components in each segment; components without a share go."""
    share = share[:, share.mean(axis=0) > FEWEST]
    mass, size = share.sum(axis=0), scores.shape[1]
    means = share.T @ scores / mass[:, None]
    covariances = []
    for k, mean in enumerate(means):
        apart = scores - mean
        covariances.append((apart.T @ (apart * share[:, k, None]) + size * shared) / (mass[k] + size))
    return Mixture(mass / mass.sum(), means, np.array(covariances))
