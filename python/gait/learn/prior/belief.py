"""What is held about components and the noise while missing entries are filled (`bayes`)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gait.learn.prior.accelerate import Mixer

Floats = npt.NDArray[np.float64]

QUENCHED = 1e9  # roughness from which on the components have no part in a harmonic
MOST_LOG = 200.0  # of an extrapolated precision or noise


@dataclass
class Belief:
    """What is held about the model.

    Attributes
    ----------
    loadings : (1 + q, P)
        Fourier coefficients of the mean and of the components.
    spread : (B, q, q)
        Posterior covariance of the components' coefficients of a basis function, the same for all channels.
    precision : (q,)
        Of the components' prior.
    roughness : (B,)
        Factor of the prior's precision for each basis function.
    noise : float
        Variance of an entry about the model.
    """

    loadings: Floats
    spread: Floats
    precision: Floats
    roughness: Floats
    noise: float


def strength(belief: Belief) -> Floats:
    """Give the squares (q, B) of the components' coefficients, summed over channels."""
    q, functions = len(belief.precision), len(belief.roughness)
    channels = belief.loadings.shape[1] // functions
    return np.sum(belief.loadings[1:].reshape(q, functions, channels) ** 2, axis=2)


def doubt(belief: Belief) -> Floats:
    """Give the posterior variances (q, B) of the components' coefficients, summed over channels."""
    channels = belief.loadings.shape[1] // len(belief.roughness)
    return channels * np.diagonal(belief.spread, axis1=1, axis2=2).T


def _harmonics(functions: int) -> npt.NDArray[np.intp]:
    """Give the harmonic of each basis function: constant, then cosine and sine of each."""
    return (np.arange(functions) + 1) // 2


def with_prior(belief: Belief) -> Belief:
    """Replace the precisions by the best for these components, then the roughness."""
    q, size = len(belief.precision), belief.loadings.shape[1]
    if not q:
        return belief
    second, functions = strength(belief) + doubt(belief), len(belief.roughness)
    precision = size / (second @ belief.roughness + 1e-300)
    harmonic = _harmonics(functions)
    mean = np.bincount(harmonic, precision @ second) / np.bincount(harmonic)
    roughness = q * (size // functions) / (mean[harmonic] + 1e-300)
    return replace(belief, precision=precision, roughness=roughness)


def divergence(belief: Belief) -> float:
    """Kullback-Leibler divergence of the components' posterior from their prior."""
    q, size = len(belief.precision), belief.loadings.shape[1]
    channels = size // len(belief.roughness)
    second = strength(belief) + doubt(belief)
    volume = channels * np.sum(np.linalg.slogdet(belief.spread)[1])
    volume += size * (np.sum(np.log(belief.precision)) + q)
    volume += q * channels * np.sum(np.log(belief.roughness))
    return 0.5 * float(belief.precision @ second @ belief.roughness - volume)


def without_weakest(belief: Belief) -> Belief | None:
    """Drop the weakest component if it is weaker than the doubt about it, else None."""
    ratio = strength(belief).sum(axis=1) / doubt(belief).sum(axis=1)
    return without(belief, int(np.argmin(ratio))) if len(ratio) and ratio.min() < 1 else None


def smoother(belief: Belief) -> Belief | None:
    """Quench the harmonics of the components that are weaker than the doubt about them; None if none are."""
    harmonic = _harmonics(len(belief.roughness))
    strong, unsure = (np.bincount(harmonic, part.sum(axis=0)) for part in (strength(belief), doubt(belief)))
    weak = (strong < unsure)[harmonic] & (belief.roughness < QUENCHED)
    if not weak.any() or not len(belief.precision):
        return None
    loadings, spread, roughness = belief.loadings.copy(), belief.spread.copy(), belief.roughness.copy()
    roughness[weak] = 1e3 * QUENCHED
    loadings[1:].reshape(len(belief.precision), len(weak), -1)[:, weak] = 0
    spread[weak] = np.diag(1 / (belief.precision * 1e3 * QUENCHED))
    return replace(belief, loadings=loadings, spread=spread, roughness=roughness)


def without(belief: Belief, k: int) -> Belief:
    """Drop component k."""
    spread = np.delete(np.delete(belief.spread, k, axis=1), k, axis=2)
    loadings, precision = np.delete(belief.loadings, 1 + k, axis=0), np.delete(belief.precision, k)
    return Belief(loadings, spread, precision, belief.roughness, belief.noise)


def mixed(mixer: Mixer, before: Belief, after: Belief) -> Belief:
    """Belief extrapolated from this step and those before it."""
    vector = mixer.step(_vector(before), _vector(after), before.loadings.size)
    q, size = len(before.precision), before.loadings.size
    loadings, logs = vector[:size].reshape(before.loadings.shape), np.clip(vector[size:], -MOST_LOG, MOST_LOG)
    precision, roughness, noise = np.split(np.exp(logs), [q, len(logs) - 1])
    return Belief(loadings, after.spread, precision, roughness, float(noise[0]))


def _vector(belief: Belief) -> Floats:
    logs = np.log([*belief.precision, *belief.roughness, belief.noise])
    return np.concatenate([belief.loadings.ravel(), logs])
