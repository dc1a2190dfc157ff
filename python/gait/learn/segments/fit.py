"""Fit the segment prior: from segments to mean, modes and residual variance.

Most of the learning is done in the main directions of all segments (`Basis`), where it is cheap.  The
residuals of the training subjects are too small for another person, so a factor of their variance is fitted
to the likelihood of people left out in turn.  The variation outside the modes hardly changes within a
segment, but the prior assumes that it is independent between frames, so ten frames would count ten times.
Therefore `gamma` is that factor times the number of frames that repeat each other.  The mixture of Gaussians
over the scores, suggested by the paper, is fitted by expectation-maximisation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import logsumexp

from gait.bindings.segment_prior import SegmentPrior
from gait.errors import UserError
from gait.io import blob
from gait.learn.arrays import Floats, Indices, Mask, by_rows, stored
from gait.learn.options import SegmentOptions
from gait.learn.prior.imputation import right_singular
from gait.learn.prior.model import rounded
from gait.learn.segments.corpus import Recorded, Table, tabulate

FEWEST_SEGMENTS = 8  # fewest segments
EACH = 4  # segments per mode; with more modes they would be memorised
USUAL_STATURE = 1.70  # metres, if no recording shows one
BASIS_DIRECTIONS = 160  # directions in the basis; a prior has 50 modes
FILLING_ROUNDS = 10  # most rounds of filling missing entries
FILLED = 1e-3  # relative change of their rms at which filling stops
FOLDS = 10  # most folds; with more people, several are left out together
LEAST_VARIANCE = 3.5e-7  # squared statures, about 1 mm^2; no joint is known better
GAMMA = (1.0, 400.0)  # range of gamma; a new person is at least as unlike the others as these are
MOST_GAUSSIANS = 6  # most Gaussians that are tried
EM_ROUNDS = 60
EM_SETTLED = 1e-6  # relative gain of the log likelihood at which EM stops
LEAST_WEIGHT = 1e-3  # of a component that is kept


def fit(recordings: Sequence[Recorded], wanted: SegmentOptions) -> SegmentPrior:
    """Learn the segment prior of recordings; UserError if there are too few segments."""
    table = tabulate(recordings, wanted)
    real = int(table.real.sum()) // max(wanted.headings, 1)
    if real < FEWEST_SEGMENTS:
        seconds = wanted.frames / wanted.fps
        raise UserError(
            f"the recordings contain {real} segments of {seconds:g} s, fewer than {FEWEST_SEGMENTS}; add "
            "recordings, or leave out the prior (--segments none)"
        )
    modes = min(wanted.modes, max(1, real // EACH))
    found = basis(filled(table.rows, modes), len(table.names))
    everyone = fitted(found, np.ones(len(table.rows), bool), modes)
    folds = groups(table.subject, table.recording)
    others = (fitted(found, ~out, modes) for out in folds)
    factor = gamma([fold(found, model, out & table.real) for model, out in zip(others, folds, strict=True)])
    mixture = choose_mixture(found, everyone, folds, table.real, wanted.mixture)
    return _prior(table, found, everyone, mixture, factor, wanted, real)


def _prior(
    table: Table,
    found: Basis,
    model: Fitted,
    mixture: Mixture,
    gamma: float,
    wanted: SegmentOptions,
    real: int,
) -> SegmentPrior:
    """Assemble the prior; each component has its own modes, by variance."""
    shape, means, modes, sds = (wanted.frames, len(table.names), 3), [], [], []
    for centre, covariance in zip(mixture.means, mixture.covariances, strict=True):
        values, turn = np.linalg.eigh(covariance)
        sd = np.sqrt(np.maximum(values[::-1], 0))
        axes = found.directions @ (model.vectors @ turn[:, ::-1])
        axes = axes * np.sign(axes[np.abs(axes).argmax(axis=0), np.arange(len(sd))])
        means.append((found.mean + found.directions @ (model.mean + model.vectors @ centre)).reshape(shape))
        modes.append((axes * sd).T.reshape(-1, *shape))
        sds.append(sd)
    statures = [r.stature for r in table.recordings if np.isfinite(r.stature)]
    count = len(mixture.weights)
    return SegmentPrior(
        names=table.names,
        hop=wanted.hop,
        fps=wanted.fps,
        headings=wanted.headings,
        weights=mixture.weights,
        mean=np.array(means),
        modes=np.array(modes),
        sd=np.array(sds),
        residual=np.tile(model.residual, (count, 1)),
        gamma=gamma,
        stature=float(np.mean(statures)) if statures else USUAL_STATURE,
        segments=real,
        recordings=len(table.recordings),
    )


def sections(prior: SegmentPrior) -> dict[str, blob.Array]:
    """Return the sections of a segment prior as a model stores them, rounded."""
    exact = prior.sections()
    modes = rounded(prior.modes).reshape(exact["SGMD"].shape)
    return exact | {"SGMN": rounded(prior.mean), "SGMD": modes}


@dataclass(frozen=True)
class Basis:
    """Rows, represented as mean + scores directions' + rest."""

    mean: Floats  #: (D,)
    directions: Floats  #: (D, r) orthonormal, largest variance first
    scores: Floats  #: (N, r)
    rest: Floats  #: (N, J) squared length of each marker's part that the directions do not explain

    def variance(self, moments: Floats) -> Floats:
        """Return the diagonal (D,) of directions moments directions', for moments (r, r)."""
        return np.asarray(np.einsum("dr,rs,ds->d", self.directions, moments, self.directions, optimize=True))


def basis(rows: Floats, markers: int, most: int = BASIS_DIRECTIONS) -> Basis:
    """Find the main directions of rows (N, F * J * 3), frame by frame, marker by marker."""
    mean = np.sum([rows[part].sum(axis=0) for part in by_rows(rows)], axis=0) / len(rows)
    singular, right = right_singular(rows, mean)
    directions = right[: int(np.sum(singular[:most] ** 2 > 1e-10 * singular[0] ** 2))].T
    scores, rest = np.empty((len(rows), directions.shape[1])), np.empty((len(rows), markers))
    for part in by_rows(rows):
        centred = rows[part] - mean
        scores[part] = centred @ directions
        left = (centred - scores[part] @ directions.T).reshape(len(centred), -1, markers, 3)
        rest[part] = np.sum(left**2, axis=(1, 3))
    return Basis(mean, directions, scores, rest)


def filled(rows: Floats, modes: int) -> Floats:
    """Fill missing entries of rows (N, D) with their conditional means, on disk.

    A Gaussian with this many modes and an isotropic rest is learnt from the filled rows, alternately.
    """
    gaps = [k for part in by_rows(rows) for k in _with_gaps(rows, part)]
    if not gaps:
        return rows
    visible = np.sum([np.isfinite(rows[part]).sum(axis=0) for part in by_rows(rows)], axis=0)
    total = np.sum([np.nansum(rows[part], axis=0) for part in by_rows(rows)], axis=0)
    guess = {k: np.where(np.isnan(rows[k]), total / np.maximum(visible, 1), rows[k]) for k in gaps}
    for _ in range(FILLING_ROUNDS):
        whole = _with(rows, guess)
        found = basis(whole, 1, modes)
        before, guess = guess, {k: _expected(rows[k], found) for k in gaps}
        change = sum(float(np.sum((guess[k] - before[k]) ** 2)) for k in gaps)
        size = sum(float(np.sum((guess[k] - found.mean)[np.isnan(rows[k])] ** 2)) for k in gaps)
        if change <= FILLED**2 * size:
            break
    return _with(rows, guess)


def _with_gaps(rows: Floats, part: slice) -> list[int]:
    """Return the numbers of the rows with gaps in a part."""
    return (part.start + np.flatnonzero(np.isnan(rows[part]).any(axis=1))).tolist()


def _with(rows: Floats, guess: dict[int, Floats]) -> Floats:
    """Copy rows to disk, some replaced by guesses."""
    blocks = (
        np.array([guess.get(k, rows[k]) for k in range(part.start, min(part.stop, len(rows)))])
        for part in by_rows(rows)
    )
    return stored(blocks, rows.shape[1:])


def _expected(row: Floats, found: Basis) -> Floats:
    """Fill the gaps of a row with their mean given the rest of it."""
    known = np.isfinite(row)
    count = max(len(found.scores) - 1, 1)
    variance = np.sum(found.scores**2, axis=0) / count
    even = max(float(found.rest.sum()) / count / len(row), 1e-8)
    design = found.directions[known]
    precision = design.T @ design / even + np.diag(1 / np.maximum(variance, 1e-12))
    scores = np.linalg.solve(precision, design.T @ (row - found.mean)[known] / even)
    return np.where(known, row, found.mean + found.directions @ scores)


@dataclass(frozen=True)
class Fitted:
    """Gaussian of scores: eigenvalues `variance` (k,), `vectors` (r, k), and `residual` variance (J,)."""

    mean: Floats
    variance: Floats
    vectors: Floats
    residual: Floats


def fitted(basis: Basis, rows: Mask, modes: int) -> Fitted:
    """Fit mean, modes and residual variances to some of the rows (N,)."""
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
    return Fitted(mean, np.maximum(values, 0), vectors, np.maximum(residual, LEAST_VARIANCE))


@dataclass(frozen=True)
class Fold:
    """Sums over the segments of people left out, which are sufficient for their likelihood."""

    signal: Floats  #: (k,) squared singular values of the modes in units of the residual
    along: Floats  #: (k,) mean squared coordinates of the segments along them
    beside: float  #: mean squared length of the rest
    size: int  #: number of coordinates D
    units: float  #: log determinant of the residual variances
    alike: float  #: frames that repeat each other: 1 if the rest is new in each, F if it is constant

    def deviance(self, gamma: float) -> float:
        """Return twice the negative log likelihood of a segment, without constants."""
        variance, rest = self.signal + gamma, self.size - len(self.signal)
        inside = np.sum(np.log(variance) + self.along / variance)
        return float(self.units + inside + rest * np.log(gamma) + self.beside / gamma)


def fold(basis: Basis, model: Fitted, rows: Mask) -> Fold:
    """Compute the sums of some rows (N,) under a model of others."""
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


def groups(subject: Indices, recording: Indices) -> list[Mask]:
    """Return the rows to leave out together: of a person, or of a recording if there is only one person."""
    of = subject if len(np.unique(subject)) > 1 else recording
    labels = np.unique(of)
    if len(labels) < 2:
        return []
    return [np.isin(of, part) for part in np.array_split(labels, min(FOLDS, len(labels)))]


def gamma(folds: list[Fold]) -> float:
    """Return the factor of the residual variance, with equal weights of folds; 1 without folds."""
    if not folds:
        return 1.0

    def deviance(x: float) -> float:
        return float(np.mean([f.deviance(np.exp(x)) for f in folds]))

    found = minimize_scalar(deviance, bounds=np.log(GAMMA), method="bounded", options={"xatol": 1e-6})
    return float(np.exp(found.x) * np.mean([f.alike for f in folds]))


@dataclass(frozen=True)
class Mixture:
    """Weights (K,), means (K, k) and covariances (K, k, k) of scores about the mean of all."""

    weights: Floats
    means: Floats
    covariances: Floats

    def log_density(self, scores: Floats) -> Floats:
        """Return the log density of each component times its weight, (n, K), at scores (n, k)."""
        columns = []
        for weight, mean, covariance in zip(self.weights, self.means, self.covariances, strict=True):
            root = np.linalg.cholesky(covariance)
            apart = np.linalg.solve(root, (scores - mean).T)
            constant = 2 * np.log(np.diag(root)).sum() + len(mean) * np.log(2 * np.pi)
            columns.append(np.log(weight) - 0.5 * (np.sum(apart**2, axis=0) + constant))
        return np.stack(columns, axis=1)


def choose_mixture(
    basis: Basis, model: Fitted, folds: Sequence[Mask], real: Mask, components: int | None
) -> Mixture:
    """Fit a mixture with this many components, or (None) with the number that predicts people left out best.

    `model`: of all rows; its modes are those of the mixture.  `folds`: rows (N,) that are left out together.
    Only `real` (recorded) rows are predicted, but those of other people made from them are left out too.
    """
    scores = np.asarray((basis.scores - model.mean) @ model.vectors)
    if components is None:
        gains = [_held_out(scores, folds, real, count) for count in range(1, MOST_GAUSSIANS + 1)]
        components = 1 + int(np.argmax(gains)) if folds else 1
    return fit_mixture(scores, components)


def _held_out(scores: Floats, folds: Sequence[Mask], real: Mask, count: int) -> float:
    """Return the mean log density of recorded scores left out, with equal weights of folds."""
    found = []
    for out in folds:
        learnt = fit_mixture(scores[~out], count)
        found.append(float(logsumexp(learnt.log_density(scores[out & real]), axis=1).mean()))
    return float(np.mean(found)) if found else 0.0


def fit_mixture(scores: Floats, components: int) -> Mixture:
    """Fit components whose covariances shrink towards their common one (worth k segments).

    They start from slices along the first mode, so that the result is deterministic.
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
    for _ in range(EM_ROUNDS):
        density = mixture.log_density(scores)
        total = logsumexp(density, axis=1)
        share = np.exp(density - total[:, None])
        mixture = _maximised(scores, share, shared)
        if float(total.sum()) - before <= EM_SETTLED * abs(before):
            break
        before = float(total.sum())
    return mixture


def _maximised(scores: Floats, share: Floats, shared: Floats) -> Mixture:
    """Compute parameters from the shares (n, K) of the components; components without a share are dropped."""
    share = share[:, share.mean(axis=0) > LEAST_WEIGHT]
    mass, size = share.sum(axis=0), scores.shape[1]
    means = share.T @ scores / mass[:, None]
    covariances = []
    for k, mean in enumerate(means):
        apart = scores - mean
        covariances.append((apart.T @ (apart * share[:, k, None]) + size * shared) / (mass[k] + size))
    return Mixture(mass / mass.sum(), means, np.array(covariances))
