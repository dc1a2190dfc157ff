"""Missing entries by variational Bayesian principal components in the Fourier domain.

Model: row r is B' (mean + W' c_r) + noise, with c_r ~ N(0, I) and the coefficients of component k at harmonic
h drawn from N(0, 1 / (precision_k roughness_h)).  Scores and missing entries of a row are treated jointly and
exactly given the components (Bishop 1999; Ilin and Raiko 2010, "Practical approaches to principal component
analysis in the presence of missing values").  The precisions let components and harmonics that the data do
not support shrink to nothing, so too many of them hurt little.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.learn.cycles.fourier import decode, encode
from gait.learn.prior.accelerate import Mixer
from gait.learn.prior.belief import Belief, divergence, mixed, smoother, with_prior, without_weakest
from gait.learn.prior.impute import ROUNDING, Filling, completed
from gait.learn.prior.singular import right_singular
from gait.learn.spool import by_rows

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

ITERATIONS = 500
TOLERANCE = 1e-5  # rms change of the model between passes over the noise
LEAST_CHANGE = 1e-7  # rms change that is none, in the data's units: a tenth of the last digit stored
LEAST_GAIN = 2e-7  # of the bound in a pass, nats per observed entry
PATIENCE = 20  # passes in a row that gain less, after which what still moves is what the data leave open
LEAST_NOISE = 1e-10  # variance relative to the data's


@dataclass
class Rows:
    """What a belief implies for the rows.

    Attributes
    ----------
    scores : (R, q)
        Posterior means.
    covariance : (R, q, q)
        Posterior covariances.
    curves : (1 + q, T M)
        The mean and the components over the cycle.
    bound : float
        Lower bound of the log-likelihood of the observed entries.
    """

    scores: Floats
    covariance: Floats
    curves: Floats
    bound: float

    @property
    def model(self) -> Floats:
        """All rows, (R, T M)."""
        return self.some(slice(None))

    def some(self, part: slice) -> Floats:
        """Give some rows of the model, (n, T M)."""
        return self.curves[0] + self.scores[part] @ self.curves[1:]


class Problem:
    """The data, and the two half-steps that raise the bound."""

    def __init__(self, values: Floats, mask: Mask, basis: Floats) -> None:
        self.rows, self.shape = len(values), values.shape[1:]
        self.basis = basis
        self.values, self.mask = values.reshape(self.rows, -1), mask.reshape(self.rows, -1)
        self.observed = float(mask.sum())
        squares = sum(float(np.sum(known**2)) for _, known, _ in self.parts())
        self.least = LEAST_NOISE * squares / max(self.observed, 1.0) + 1e-30

    def parts(self) -> Iterator[tuple[slice, Floats, Floats]]:
        """Give blocks of rows: which, their data (n, T M), 0 where missing, and 1 where seen, else 0."""
        for part in by_rows(self.values):
            mask = self.mask[part]
            yield part, np.where(mask, self.values[part], 0.0), mask.astype(float)

    def encode(self, flat: Floats) -> Floats:
        """Curves (n, T M) to coefficients (n, P)."""
        return encode(flat.reshape(len(flat), *self.shape), self.basis)

    def decode(self, coded: Floats) -> Floats:
        """Coefficients (n, P) to curves (n, T M)."""
        return decode(coded, self.basis, self.shape[1]).reshape(len(coded), self.values.shape[1])

    def rmse(self, rows: Rows) -> float:
        """Root mean square of data minus model over the observed entries."""
        total = sum(float(np.sum((seen * rows.some(p) - known) ** 2)) for p, known, seen in self.parts())
        return float(np.sqrt(total / self.observed))

    def change(self, before: Rows, after: Rows) -> float:
        """Root mean square of the change of the model over all entries."""
        parts = by_rows(self.values)
        total = sum(float(np.sum((after.some(part) - before.some(part)) ** 2)) for part in parts)
        return float(np.sqrt(total / self.values.size))

    def begin(self, start: Floats, components: int) -> Belief:
        """Belief from the decomposition of the data filled with `start` (T, M)."""
        components = min(components, self.rows - 1)
        coded = np.empty((self.rows, len(self.basis) * self.shape[1]))
        for part, known, seen in self.parts():
            coded[part] = self.encode(known + (1 - seen) * start.ravel())
        mean = coded.mean(axis=0)
        singular, right = (found[:components] for found in right_singular(coded, mean))
        loadings = right * (singular / np.sqrt(max(self.rows - 1, 1)))[:, None]
        curve = self.decode(mean[None])
        rest = -float(np.sum(singular**2))
        for _, known, seen in self.parts():
            rest += float(np.sum((known + (1 - seen) * start.ravel() - curve) ** 2))
        noise = max(rest / self.values.size, self.least)
        spread = np.tile(noise / self.rows * np.eye(len(right)), (len(self.basis), 1, 1))
        prior = np.ones(len(right)), np.ones(len(self.basis))
        return with_prior(Belief(np.vstack([mean, loadings]), spread, *prior, noise))

    def expect(self, belief: Belief) -> Rows:
        """Scores of the rows from their observed entries, and the bound."""
        q = len(belief.precision)
        curves = self.decode(belief.loadings)
        mean, parts = curves[0], curves[1:]
        products, squares = _products(parts).T, 0.0
        gram, pull = np.empty((self.rows, q * q)), np.empty((self.rows, q))
        for part, known, seen in self.parts():
            off = known - seen * mean
            squares += float(np.sum(off**2))
            gram[part], pull[part] = seen @ products, off @ parts.T
        around = self.shape[1] * belief.spread.sum(axis=0) + belief.noise * np.eye(q)
        system = gram.reshape(self.rows, q, q) + around
        inverse = np.linalg.inv(system)
        scores = np.einsum("rkl,rl->rk", inverse, pull)
        fit = (squares - float(np.sum(pull * scores))) / belief.noise
        volume = float(np.sum(np.linalg.slogdet(system)[1])) - self.rows * q * np.log(belief.noise)
        bound = -0.5 * (self.observed * np.log(2 * np.pi * belief.noise) + volume + fit)
        bound -= divergence(belief)
        return Rows(scores, belief.noise * inverse, curves, bound)

    def maximise(self, belief: Belief, rows: Rows) -> Belief:
        """Components, their precision and the noise from the rows' scores."""
        q = len(belief.precision)
        design, covariance = np.column_stack([np.ones(self.rows), rows.scores]), rows.covariance
        moment, cross, squares = design.T @ design, np.zeros(belief.loadings.shape), 0.0
        moment[1:, 1:] += covariance.sum(axis=0)
        missing = np.zeros((q * q, rows.curves.shape[1]))
        for part, known, seen in self.parts():
            filled = known + (1 - seen) * rows.some(part)
            squares += float(np.sum(filled**2))
            cross += design[part].T @ self.encode(filled)
            missing += covariance[part].reshape(len(seen), q * q).T @ (1 - seen)
        # A missing entry varies with its row's scores.
        varying = np.einsum("klp,lp->kp", missing.reshape(q, *rows.curves[1:].shape), rows.curves[1:])
        cross[1:] += self.encode(varying)
        system = np.tile(moment, (len(self.basis), 1, 1))
        diagonal = np.arange(1, 1 + q)
        system[:, diagonal, diagonal] += belief.noise * np.outer(belief.roughness, belief.precision)
        by_function = cross.reshape(1 + q, len(self.basis), -1).swapaxes(0, 1)
        loadings = np.linalg.solve(system, by_function).swapaxes(0, 1).reshape(cross.shape)
        spread = belief.noise * np.linalg.inv(system[:, 1:, 1:])
        # Expected sum of squares of data minus model, missing entries included.
        total = squares + float(np.sum(varying * rows.curves[1:]))
        total += (self.values.size - self.observed) * belief.noise
        total += float(np.sum(loadings * (moment @ loadings - 2 * cross)))
        total += self.shape[1] * float(np.sum(spread.sum(axis=0) * moment[1:, 1:]))
        noise = max(total / self.values.size, self.least)
        loadings, spread = self._standard(loadings, spread, moment / self.rows, belief.roughness)
        return with_prior(Belief(loadings, spread, belief.precision, belief.roughness, noise))

    def _standard(
        self, loadings: Floats, spread: Floats, moment: Floats, roughness: Floats
    ) -> tuple[Floats, Floats]:
        """Change units so that the scores have mean 0 and covariance 1 and the components are orthogonal.

        The model stays the same, and the bound is the best of all such changes (Luttinen and Ilin 2010).

        Parameters
        ----------
        moment : (1 + q, 1 + q)
            Mean of (1, scores) (1, scores)' over the rows.
        """
        middle = moment[0, 1:]
        root = np.linalg.cholesky(moment[1:, 1:] - np.outer(middle, middle))
        mean, parts = loadings[0] + middle @ loadings[1:], loadings[1:]
        inner = (parts * np.repeat(roughness, self.shape[1])) @ parts.T
        inner += self.shape[1] * np.tensordot(roughness, spread, 1)
        _, axes = np.linalg.eigh(root.T @ inner @ root)
        turn = root @ axes[:, ::-1]
        turn *= np.where(np.diag(turn) < 0, -1.0, 1.0)
        return np.vstack([mean, turn.T @ parts]), turn.T @ spread @ turn


def _products(parts: Floats) -> Floats:
    """Products (q q, T M) of every two of q curves (q, T M)."""
    return (parts[:, None] * parts[None]).reshape(-1, parts.shape[1])


@dataclass
class Climb:
    """The best that the passes led to, and the Filling's figures on the way, each pass as it came out."""

    belief: Belief
    rows: Rows
    rmse: list[float]
    objective: list[float]
    converged: bool


def climb(problem: Problem, belief: Belief, tolerance: float, passes: int = ITERATIONS) -> Climb:
    """Raise the bound by turns: scores of the rows, then components; until it, or the model, hardly moves.

    Parameters
    ----------
    tolerance : float
        Rms change of the model between two passes, over the noise, at which to stop.
    passes : int
        At most.
    """
    at = Climb(belief, problem.expect(belief), [], [], False)
    mixer, slow = Mixer(), 0
    while not at.converged and len(at.rmse) < passes:
        after, found = _pass(problem, mixer, at.belief, at.rows)
        enough = max(tolerance * np.sqrt(after.noise), LEAST_CHANGE)
        slow = slow + 1 if found.bound - at.rows.bound < LEAST_GAIN * problem.observed else 0
        at.converged = problem.change(at.rows, found) <= enough or slow >= PATIENCE
        at.objective.append(-found.bound / problem.observed)
        falls = not found.bound >= at.rows.bound
        if falls:  # by rounding nothing is left to gain; more than that is a mistake
            at.converged = at.rows.bound - found.bound <= ROUNDING * abs(at.rows.bound)
        else:
            at.belief, at.rows = after, found
        at.rmse.append(problem.rmse(at.rows))
        if falls:
            break
    return at


def by_bayes(
    values: Floats, mask: Mask, components: int, basis: Floats, start: Floats, tolerance: float = TOLERANCE
) -> Filling:
    """Fill with what is to be expected given the observed entries; see `climb`.

    Parameters
    ----------
    values, mask : (R, T, M)
        Data and where they are observed.
    basis : (B, T)
        Fourier basis of means and components.
    start : (T, M)
        Starting value of missing entries.
    tolerance : float
        Rms change of the model between two passes, over the noise, at which to stop.
    """
    problem = Problem(values, mask, basis)
    end = climb(problem, problem.begin(start, components), tolerance)
    filled = completed(values, mask, lambda part: end.rows.some(part).reshape(-1, *problem.shape))
    return Filling(filled, end.rmse, end.objective, float(np.sqrt(end.belief.noise)), end.converged)


def _pass(problem: Problem, mixer: Mixer, belief: Belief, rows: Rows) -> tuple[Belief, Rows]:
    """Extrapolate, or take the plain step where that is better; drop a component that does not help."""
    plain = problem.maximise(belief, rows)
    after = mixed(mixer, belief, plain)
    after.noise = max(after.noise, problem.least)
    found = problem.expect(after)
    if not found.bound >= rows.bound:
        mixer.forget()
        after, found = plain, problem.expect(plain)
    for less in (without_weakest, smoother):
        lesser = less(after)
        if lesser is not None and (fewer := problem.expect(lesser)).bound > found.bound:
            mixer.forget()
            after, found = lesser, fewer
    return after, found
