"""Missing entries of cycles by variational Bayesian principal components in the Fourier domain.

Model: row r is B' (mean + W' c_r) + noise, with c_r ~ N(0, I) and the coefficients of component k at harmonic
h drawn from N(0, 1 / (precision_k roughness_h)).  Given the components, scores and missing entries of a row
are treated jointly and exactly (Bishop 1999; Ilin and Raiko 2010, "Practical approaches to principal
component analysis in the presence of missing values").  The precisions shrink components and harmonics that
the data do not support to zero, so too many of them do little harm.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from gait.learn.arrays import Floats, Indices, Mask, by_rows, stored
from gait.learn.cycles.fourier import decode, encode

MOST_POSTERIOR_PASSES = 2000  # 29 people, 10 of them recorded without arms and trunk, take 1216
MODEL_TOLERANCE = 1e-5  # rms change of the model between passes over the noise
LEAST_CHANGE = 1e-7  # rms change that counts as none, in the data's units; a tenth of the last digit stored
LEAST_GAIN = 2e-7  # of the bound in a pass, nats per observed entry
#: Consecutive passes of smaller gain, after which the data do not determine what still changes.
SLOW_PASSES = 20
LEAST_NOISE = 1e-10  # variance relative to the data's
ROUNDING = 1e-9  # relative increase of the objective that rounding may cause
QUENCHED = 1e9  # roughness above which the components do not use a harmonic
MOST_LOG = 200.0  # of an extrapolated precision or noise
MEMORY = 5  # steps that the extrapolation combines
RELATIVE_RIDGE = 1e-10  # of its normal equations, relative to their trace
LEAST_SQUARED_VALUE = 1e-14  # of the largest squared singular value; smaller ones are rounding errors


@dataclass
class Filling:
    """Cycles with their missing entries filled."""

    filled: Floats  #: (R, T, M) the data where observed, the model elsewhere; on disk, read-only
    rmse: list[float]  #: data minus model over the observed entries, after each pass
    objective: list[float]  #: the objective after each pass; decreases except for rounding
    noise: float  #: standard deviation of the data about the model
    converged: bool  #: False if the objective increased or the passes ran out


def column_mean(values: Floats, mask: Mask) -> Floats:
    """Return the mean (T, M) of the observed rows; a line across phases, and 0 in channels, without data."""
    count = mask.sum(axis=0)
    total = np.zeros(values.shape[1:])
    for part in by_rows(values):
        total += np.where(mask[part], values[part], 0).sum(axis=0)
    mean = total / np.maximum(count, 1)
    phases = np.arange(len(mean))
    for m in np.flatnonzero((count == 0).any(axis=0) & (count > 0).any(axis=0)):
        visible = np.flatnonzero(count[:, m])
        mean[:, m] = np.interp(phases, visible, mean[visible, m], period=len(mean))
    return mean


def complete(
    values: Floats, mask: Mask, components: int, basis: Floats, start: Floats | None = None
) -> Filling:
    """Fill missing entries with their expectation given the observed ones.

    Values and mask are (R, T, M); `basis` (B, T) is the Fourier basis of means and components; missing
    entries start from `start` (T, M), by default the column mean.
    """
    problem = Problem(values, mask, basis)
    end = climb(problem, problem.begin(column_mean(values, mask) if start is None else start, components))
    parts = (
        np.where(mask[part], values[part], end.rows.some(part).reshape(-1, *problem.shape))
        for part in by_rows(values)
    )
    filled = stored(parts, values.shape[1:])
    return Filling(filled, end.rmse, end.objective, float(np.sqrt(end.posterior.noise)), end.converged)


@dataclass
class Climb:
    """The best model that the passes found, and `Filling`'s figures of each pass."""

    posterior: Posterior
    rows: Rows
    rmse: list[float]
    objective: list[float]
    converged: bool


def climb(
    problem: Problem,
    posterior: Posterior,
    tolerance: float = MODEL_TOLERANCE,
    passes: int = MOST_POSTERIOR_PASSES,
) -> Climb:
    """Increase the bound, alternating scores and components, until it or the model hardly changes.

    `tolerance` is the rms change of the model between two passes, over the noise, at which to stop.
    """
    at = Climb(posterior, problem.expect(posterior), [], [], False)
    history, slow = _Extrapolation(), 0
    while not at.converged and len(at.rmse) < passes:
        after, found = _pass(problem, history, at.posterior, at.rows)
        enough = max(tolerance * np.sqrt(after.noise), LEAST_CHANGE)
        slow = slow + 1 if found.bound - at.rows.bound < LEAST_GAIN * problem.observed else 0
        at.converged = problem.change(at.rows, found) <= enough or slow >= SLOW_PASSES
        at.objective.append(-found.bound / problem.observed)
        falls = not found.bound >= at.rows.bound
        if falls:  # within rounding, the climb has ended; a larger decrease is an error
            at.converged = at.rows.bound - found.bound <= ROUNDING * abs(at.rows.bound)
        else:
            at.posterior, at.rows = after, found
        at.rmse.append(problem.rmse(at.rows))
        if falls:
            break
    return at


def _pass(
    problem: Problem, history: _Extrapolation, posterior: Posterior, rows: Rows
) -> tuple[Posterior, Rows]:
    """Extrapolate, or take the plain step if it is better; drop a component that does not help."""
    plain = problem.maximise(posterior, rows)
    after = _extrapolated(history, posterior, plain)
    after.noise = max(after.noise, problem.least)
    found = problem.expect(after)
    if not found.bound >= rows.bound:
        history.forget()
        after, found = plain, problem.expect(plain)
    for less in (_without_weakest, _smoother):
        lesser = less(after)
        if lesser is not None and (fewer := problem.expect(lesser)).bound > found.bound:
            history.forget()
            after, found = lesser, fewer
    return after, found


@dataclass
class Rows:
    """What a posterior implies for the rows."""

    scores: Floats  #: (R, q) posterior means
    covariance: Floats  #: (R, q, q) of the scores
    curves: Floats  #: (1 + q, T M) the mean and the components over the cycle
    bound: float  #: lower bound of the log-likelihood of the observed entries

    @property
    def model(self) -> Floats:
        """All rows, (R, T M)."""
        return self.some(slice(None))

    def some(self, part: slice) -> Floats:
        """Return some rows of the model, (n, T M)."""
        return self.curves[0] + self.scores[part] @ self.curves[1:]


class Problem:
    """The data, and the two half-steps that increase the bound."""

    def __init__(self, values: Floats, mask: Mask, basis: Floats) -> None:
        self.rows, self.shape = len(values), values.shape[1:]
        self.basis = basis
        self.values, self.mask = values.reshape(self.rows, -1), mask.reshape(self.rows, -1)
        self.observed = float(mask.sum())
        squares = sum(float(np.sum(known**2)) for _, known, _ in self.parts())
        self.least = LEAST_NOISE * squares / max(self.observed, 1.0) + 1e-30

    def parts(self) -> Iterator[tuple[slice, Floats, Floats]]:
        """Yield blocks of rows: which, their data (n, T M), 0 where missing, and 1 where observed, else 0."""
        for part in by_rows(self.values):
            mask = self.mask[part]
            yield part, np.where(mask, self.values[part], 0.0), mask.astype(float)

    def encode(self, flat: Floats) -> Floats:
        """Convert curves (n, T M) to coefficients (n, P)."""
        return encode(flat.reshape(len(flat), *self.shape), self.basis)

    def decode(self, coded: Floats) -> Floats:
        """Convert coefficients (n, P) to curves (n, T M)."""
        return decode(coded, self.basis, self.shape[1]).reshape(len(coded), self.values.shape[1])

    def rmse(self, rows: Rows) -> float:
        """Return the rms of data minus model over the observed entries."""
        total = sum(
            float(np.sum((visible * rows.some(p) - known) ** 2)) for p, known, visible in self.parts()
        )
        return float(np.sqrt(total / self.observed))

    def change(self, before: Rows, after: Rows) -> float:
        """Return the rms change of the model over all entries."""
        parts = by_rows(self.values)
        total = sum(float(np.sum((after.some(part) - before.some(part)) ** 2)) for part in parts)
        return float(np.sqrt(total / self.values.size))

    def begin(self, start: Floats, components: int) -> Posterior:
        """Start from the decomposition of the data filled with `start` (T, M)."""
        components = min(components, self.rows - 1)
        coded = np.empty((self.rows, len(self.basis) * self.shape[1]))
        for part, known, visible in self.parts():
            coded[part] = self.encode(known + (1 - visible) * start.ravel())
        mean = coded.mean(axis=0)
        singular, right = (found[:components] for found in right_singular(coded, mean))
        loadings = right * (singular / np.sqrt(max(self.rows - 1, 1)))[:, None]
        curve = self.decode(mean[None])
        rest = -float(np.sum(singular**2))
        for _, known, visible in self.parts():
            rest += float(np.sum((known + (1 - visible) * start.ravel() - curve) ** 2))
        noise = max(rest / self.values.size, self.least)
        covariance = np.tile(noise / self.rows * np.eye(len(right)), (len(self.basis), 1, 1))
        prior = np.ones(len(right)), np.ones(len(self.basis))
        return _with_prior(Posterior(np.vstack([mean, loadings]), covariance, *prior, noise))

    def expect(self, posterior: Posterior) -> Rows:
        """Compute the scores of the rows from their observed entries, and the bound."""
        q = len(posterior.precision)
        curves = self.decode(posterior.loadings)
        mean, parts = curves[0], curves[1:]
        products, squares = _products(parts).T, 0.0
        gram, pull = np.empty((self.rows, q * q)), np.empty((self.rows, q))
        for part, known, visible in self.parts():
            off = known - visible * mean
            squares += float(np.sum(off**2))
            gram[part], pull[part] = visible @ products, off @ parts.T
        around = self.shape[1] * posterior.covariance.sum(axis=0) + posterior.noise * np.eye(q)
        system = gram.reshape(self.rows, q, q) + around
        inverse = np.linalg.inv(system)
        scores = np.einsum("rkl,rl->rk", inverse, pull)
        fit = (squares - float(np.sum(pull * scores))) / posterior.noise
        volume = float(np.sum(np.linalg.slogdet(system)[1])) - self.rows * q * np.log(posterior.noise)
        bound = -0.5 * (self.observed * np.log(2 * np.pi * posterior.noise) + volume + fit)
        bound -= _divergence(posterior)
        return Rows(scores, posterior.noise * inverse, curves, bound)

    def maximise(self, posterior: Posterior, rows: Rows) -> Posterior:
        """Compute the components, their precision and the noise from the scores of the rows."""
        q = len(posterior.precision)
        design = np.column_stack([np.ones(self.rows), rows.scores])
        moment, cross, squares = design.T @ design, np.zeros(posterior.loadings.shape), 0.0
        moment[1:, 1:] += rows.covariance.sum(axis=0)
        missing = np.zeros((q * q, rows.curves.shape[1]))
        for part, known, visible in self.parts():
            filled = known + (1 - visible) * rows.some(part)
            squares += float(np.sum(filled**2))
            cross += design[part].T @ self.encode(filled)
            missing += rows.covariance[part].reshape(len(visible), q * q).T @ (1 - visible)
        # A missing entry varies with its row's scores.
        varying = np.einsum("klp,lp->kp", missing.reshape(q, *rows.curves[1:].shape), rows.curves[1:])
        cross[1:] += self.encode(varying)
        system = np.tile(moment, (len(self.basis), 1, 1))
        diagonal = np.arange(1, 1 + q)
        system[:, diagonal, diagonal] += posterior.noise * np.outer(posterior.roughness, posterior.precision)
        by_function = cross.reshape(1 + q, len(self.basis), -1).swapaxes(0, 1)
        loadings = np.linalg.solve(system, by_function).swapaxes(0, 1).reshape(cross.shape)
        covariance = posterior.noise * np.linalg.inv(system[:, 1:, 1:])
        # Expected sum of squares of data minus model, missing entries included.
        total = squares + float(np.sum(varying * rows.curves[1:]))
        total += (self.values.size - self.observed) * posterior.noise
        total += float(np.sum(loadings * (moment @ loadings - 2 * cross)))
        total += self.shape[1] * float(np.sum(covariance.sum(axis=0) * moment[1:, 1:]))
        noise = max(total / self.values.size, self.least)
        loadings, covariance = self._standard(loadings, covariance, moment / self.rows, posterior.roughness)
        return _with_prior(Posterior(loadings, covariance, posterior.precision, posterior.roughness, noise))

    def _standard(
        self, loadings: Floats, covariance: Floats, moment: Floats, roughness: Floats
    ) -> tuple[Floats, Floats]:
        """Change units so that the scores have mean 0 and covariance 1 and the components are orthogonal.

        The model is unchanged, and the bound is the best over all such changes (Luttinen and Ilin 2010).
        `moment` (1 + q, 1 + q) is the mean of (1, scores) (1, scores)' over the rows.
        """
        middle = moment[0, 1:]
        root = np.linalg.cholesky(moment[1:, 1:] - np.outer(middle, middle))
        mean, parts = loadings[0] + middle @ loadings[1:], loadings[1:]
        inner = (parts * np.repeat(roughness, self.shape[1])) @ parts.T
        inner += self.shape[1] * np.tensordot(roughness, covariance, 1)
        _, axes = np.linalg.eigh(root.T @ inner @ root)
        turn = root @ axes[:, ::-1]
        turn *= np.where(np.diag(turn) < 0, -1.0, 1.0)
        return np.vstack([mean, turn.T @ parts]), turn.T @ covariance @ turn


def _products(parts: Floats) -> Floats:
    """Return the products (q q, T M) of every two of q curves (q, T M)."""
    return (parts[:, None] * parts[None]).reshape(-1, parts.shape[1])


@dataclass
class Posterior:
    """The approximate posterior of components and noise: q components, B basis functions, P coefficients."""

    loadings: Floats  #: (1 + q, P) Fourier coefficients of the mean and of the components
    covariance: Floats  #: (B, q, q) of the components' coefficients, equal in all channels
    precision: Floats  #: (q,) of the components' prior
    roughness: Floats  #: (B,) factor of the prior's precision for each basis function
    noise: float  #: variance of an entry about the model


def _strength(posterior: Posterior) -> Floats:
    """Return the squares (q, B) of the components' coefficients, summed over channels."""
    q, functions = len(posterior.precision), len(posterior.roughness)
    channels = posterior.loadings.shape[1] // functions
    return np.sum(posterior.loadings[1:].reshape(q, functions, channels) ** 2, axis=2)


def _variance(posterior: Posterior) -> Floats:
    """Return the posterior variances (q, B) of the components' coefficients, summed over channels."""
    channels = posterior.loadings.shape[1] // len(posterior.roughness)
    return channels * np.diagonal(posterior.covariance, axis1=1, axis2=2).T


def _harmonics(functions: int) -> Indices:
    """Return the harmonic of each basis function: constant, then cosine and sine of each."""
    return (np.arange(functions) + 1) // 2


def _with_prior(posterior: Posterior) -> Posterior:
    """Set the precisions that are optimal for these components, then the roughness."""
    q, size = len(posterior.precision), posterior.loadings.shape[1]
    if not q:
        return posterior
    second, functions = _strength(posterior) + _variance(posterior), len(posterior.roughness)
    precision = size / (second @ posterior.roughness + 1e-300)
    harmonic = _harmonics(functions)
    mean = np.bincount(harmonic, precision @ second) / np.bincount(harmonic)
    roughness = q * (size // functions) / (mean[harmonic] + 1e-300)
    return replace(posterior, precision=precision, roughness=roughness)


def _divergence(posterior: Posterior) -> float:
    """Return the Kullback-Leibler divergence of the components' posterior from their prior."""
    q, size = len(posterior.precision), posterior.loadings.shape[1]
    channels = size // len(posterior.roughness)
    second = _strength(posterior) + _variance(posterior)
    volume = channels * np.sum(np.linalg.slogdet(posterior.covariance)[1])
    volume += size * (np.sum(np.log(posterior.precision)) + q)
    volume += q * channels * np.sum(np.log(posterior.roughness))
    return 0.5 * float(posterior.precision @ second @ posterior.roughness - volume)


def _without_weakest(posterior: Posterior) -> Posterior | None:
    """Drop the weakest component if it is weaker than its uncertainty; otherwise return None."""
    ratio = _strength(posterior).sum(axis=1) / _variance(posterior).sum(axis=1)
    return without_component(posterior, int(np.argmin(ratio))) if len(ratio) and ratio.min() < 1 else None


def _smoother(posterior: Posterior) -> Posterior | None:
    """Quench the harmonics of the components that are weaker than their uncertainty; None if none are."""
    harmonic = _harmonics(len(posterior.roughness))
    strong, unsure = (
        np.bincount(harmonic, part.sum(axis=0)) for part in (_strength(posterior), _variance(posterior))
    )
    weak = (strong < unsure)[harmonic] & (posterior.roughness < QUENCHED)
    if not weak.any() or not len(posterior.precision):
        return None
    loadings, covariance = posterior.loadings.copy(), posterior.covariance.copy()
    roughness = posterior.roughness.copy()
    roughness[weak] = 1e3 * QUENCHED
    loadings[1:].reshape(len(posterior.precision), len(weak), -1)[:, weak] = 0
    covariance[weak] = np.diag(1 / (posterior.precision * 1e3 * QUENCHED))
    return replace(posterior, loadings=loadings, covariance=covariance, roughness=roughness)


def without_component(posterior: Posterior, k: int) -> Posterior:
    """Drop component k."""
    covariance = np.delete(np.delete(posterior.covariance, k, axis=1), k, axis=2)
    loadings, precision = np.delete(posterior.loadings, 1 + k, axis=0), np.delete(posterior.precision, k)
    return Posterior(loadings, covariance, precision, posterior.roughness, posterior.noise)


def _extrapolated(history: _Extrapolation, before: Posterior, after: Posterior) -> Posterior:
    """Extrapolate from this step and those before it."""
    vector = history.step(_vector(before), _vector(after), before.loadings.size)
    q, size = len(before.precision), before.loadings.size
    loadings, logs = vector[:size].reshape(before.loadings.shape), np.clip(vector[size:], -MOST_LOG, MOST_LOG)
    precision, roughness, noise = np.split(np.exp(logs), [q, len(logs) - 1])
    return Posterior(loadings, after.covariance, precision, roughness, float(noise[0]))


def _vector(posterior: Posterior) -> Floats:
    logs = np.log([*posterior.precision, *posterior.roughness, posterior.noise])
    return np.concatenate([posterior.loadings.ravel(), logs])


class _Extrapolation:
    """Combines the last steps x -> g(x) of a fixed-point iteration into the next x (Anderson 1965).

    Type II of Fang and Saad (2009); the caller checks that a step helps.
    """

    def __init__(self) -> None:
        self._points: list[Floats] = []
        self._images: list[Floats] = []

    def forget(self) -> None:
        """Start again after a step that did not help."""
        self._points.clear()
        self._images.clear()

    def step(self, point: Floats, image: Floats, leading: int) -> Floats:
        """Return the next point from x and g(x), (n,); `leading` entries decide the combination."""
        self._points = [*self._points, point][-MEMORY - 1 :]
        self._images = [*self._images, image][-MEMORY - 1 :]
        if len(self._points) < 2:
            return image
        steps = np.array([(g - x)[:leading] for x, g in zip(self._points, self._images, strict=True)])
        change = np.diff(steps, axis=0)
        normal = change @ change.T
        normal += (RELATIVE_RIDGE * np.trace(normal) + 1e-300) * np.eye(len(normal))
        weight = np.linalg.solve(normal, change @ steps[-1])
        return np.asarray(image - weight @ np.diff(np.array(self._images), axis=0))


def right_singular(rows: Floats, mean: Floats, factor: Floats | None = None) -> tuple[Floats, Floats]:
    """Decompose rows (R, P) minus their mean, each times its factor (R,), without the left vectors.

    Many rows are decomposed through their products, with memory for only P x P numbers; the leading vectors
    are as accurate, but singular values below 1e-8 of the largest are noise.  Returns the singular values
    (min(R, P),), descending, and orthonormal right vectors (>= min(R, P), P).
    """
    weight = np.ones(len(rows)) if factor is None else factor
    fewer = min(rows.shape)
    if 2 * len(rows) <= rows.shape[1]:
        _, singular, right = np.linalg.svd((rows - mean) * weight[:, None], full_matrices=False)
        return singular, right
    gram = np.zeros((rows.shape[1], rows.shape[1]))
    for part in by_rows(rows):
        some = (rows[part] - mean) * weight[part, None]
        gram += some.T @ some
    squares, vectors = scipy.linalg.eigh(gram.T, overwrite_a=True, check_finite=False)
    return np.sqrt(np.maximum(squares[::-1][:fewer], 0)), vectors[:, ::-1].T


def leading_vectors(rows: Floats, mean: Floats, factor: Floats, count: int) -> Floats:
    """Return only the first right singular vectors (<= count, P).

    Few rows are decomposed through their products.  Directions in which the rows do not vary are left out.
    """
    if 2 * len(rows) > rows.shape[1]:
        return right_singular(rows, mean, factor)[1][:count]
    some = (rows - mean) * factor[:, None]
    first = max(len(rows) - count, 0)
    squares, left = scipy.linalg.eigh(some @ some.T, subset_by_index=(first, len(rows) - 1))
    kept = squares > LEAST_SQUARED_VALUE * squares[-1]
    return np.asarray(((left[:, kept] / np.sqrt(squares[kept])).T @ some)[::-1])
