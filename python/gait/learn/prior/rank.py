"""Choose the number of components that predicts held-out entries best."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gait.learn.arrays import Floats, Indices, Mask, by_rows, release, stored
from gait.learn.cycles.fourier import CYCLE_HARMONICS, fourier_basis
from gait.learn.prior.imputation import Posterior, Problem, Rows, climb, column_mean, without_component

MOST_TRIED_COMPONENTS = 12  # components tried
HELD_OUT = 0.05  # share of the observed entries held out if there are too few people
BLOCKS_PER_CYCLE = 8  # blocks of one channel that are held out
FEWEST_PEOPLE = 4
MOST_FOLDS = 8
HIDDEN_DRAWS = 4  # draws of the hidden parts of a person's cycles
COMPARISON_TOLERANCE, COMPARISON_PASSES = 3e-2, 30  # of the fits, which are only compared with each other


def choose(
    values: Floats,
    mask: Mask,
    rng: np.random.Generator,
    groups: Indices | None = None,
    harmonics: int = CYCLE_HARMONICS,
    largest: int = MOST_TRIED_COMPONENTS,
) -> tuple[int, Floats]:
    """Choose the number of components (>= 1) by held-out data; also return the rmse with 0, 1 ... of them.

    Values and mask are (R, T, M); `groups` (R,) is the person of each row.  With at least FEWEST_PEOPLE, the
    people of one fold after the other are left out, and the model predicts half of the channels over half of
    each of their cycles from the rest of the cycle.  Otherwise short blocks of known cycles are predicted.
    The smallest number is chosen whose mean square error is within one standard error (over folds or blocks)
    of the least (Breiman et al. 1984).
    """
    basis = fourier_basis(values.shape[1], harmonics)
    people = np.zeros(0) if groups is None else np.unique(groups)
    if groups is not None and len(people) >= FEWEST_PEOPLE:
        fold = np.searchsorted(people, groups) % MOST_FOLDS
        squares = _of_people(values, mask, fold, rng, basis, largest)
    else:
        squares = _of_blocks(values, mask, rng, basis, largest)
    mean = squares.mean(axis=0)
    best = int(np.argmin(mean))
    error = float(np.std(squares[:, best])) / np.sqrt(max(len(squares) - 1, 1))
    return max(int(np.argmax(mean <= mean[best] + error)), 1), np.sqrt(mean)


def _of_people(
    values: Floats, mask: Mask, fold: Indices, rng: np.random.Generator, basis: Floats, largest: int
) -> Floats:
    """Return mean square errors (folds, 1 + components) on rows of people who were left out."""
    result = []
    fewest = min(int(np.sum(fold != f)) for f in np.unique(fold))
    for f in np.unique(fold):
        # Each draw is a copy of the person's cycles with other parts hidden.
        out, rest = np.tile(np.flatnonzero(fold == f), HIDDEN_DRAWS), np.flatnonzero(fold != f)
        truth, visible = _picked(values, out), mask[out]
        hidden = _half(truth.shape, rng)
        there, held, errors = Problem(truth, visible & ~hidden, basis), visible & hidden, []
        for posterior in _descending(_picked(values, rest), mask[rest], basis, min(largest, fewest - 1)):
            errors.append(sum(float(np.sum(d)) for _, d in _squares(there.expect(posterior), truth, held)))
        result.append(np.array(errors[::-1]) / max(int(held.sum()), 1))
    return np.array(result)


def _of_blocks(values: Floats, mask: Mask, rng: np.random.Generator, basis: Floats, largest: int) -> Floats:
    """Return mean square errors (blocks, 1 + components) on blocks of entries that were left out."""
    blocks = hold_out(mask, HELD_OUT, rng)
    visible = mask & (blocks < 0)
    problem, result = Problem(values, visible, basis), []
    held = mask & (blocks >= 0)
    count = np.bincount(blocks[held])
    for posterior in _descending(values, visible, basis, min(largest, len(values) - 1)):
        total = np.zeros(len(count))
        for part, squares in _squares(problem.expect(posterior), values, held):
            total += np.bincount(blocks[part][held[part]], squares, len(count))
        result.append(total[count > 0] / count[count > 0])
    return np.array(result[::-1]).T


def _picked(values: Floats, rows: Indices) -> Floats:
    """Copy some rows to disk."""

    def parts() -> Iterator[Floats]:
        for part in by_rows(rows):
            yield values[rows[part]]
            release(values)

    return stored(parts(), values.shape[1:])


def _squares(rows: Rows, values: Floats, held: Mask) -> Iterator[tuple[slice, Floats]]:
    """Yield blocks of rows and the squared errors (n,) of the model where entries are held out."""
    for part in by_rows(values):
        model = rows.some(part).reshape(-1, *values.shape[1:])
        yield part, (model - values[part])[held[part]] ** 2


def hold_out(mask: Mask, share: float, rng: np.random.Generator) -> NDArray[np.int32]:
    """Draw blocks of one channel, `BLOCKS_PER_CYCLE` in a cycle: their numbers (R, T, M), -1 outside."""
    rows, samples, channels = mask.shape
    length = samples // BLOCKS_PER_CYCLE
    chosen: NDArray[np.int32] = np.full(mask.shape, -1, np.int32)
    for k in range(max(int(share * mask.sum() / length), 1)):
        r, m, t = int(rng.integers(rows)), int(rng.integers(channels)), int(rng.integers(samples))
        chosen[r, (t + np.arange(length)) % samples, m] = k
    return chosen


def _half(shape: tuple[int, ...], rng: np.random.Generator) -> Mask:
    """Hide half of the channels over half of the cycle, different halves in each row."""
    rows, samples, channels = shape
    hidden = np.zeros(shape, bool)
    for row in hidden:
        some = rng.permutation(channels)[: (channels + 1) // 2]
        row[np.ix_((int(rng.integers(samples)) + np.arange(samples // 2)) % samples, some)] = True
    return hidden


def _descending(values: Floats, mask: Mask, basis: Floats, largest: int) -> Iterator[Posterior]:
    """Yield fits with `largest`, one fewer ... 0 components, each from the one before without its weakest."""
    problem = Problem(values, mask, basis)
    posterior = problem.begin(column_mean(values, mask), largest)
    for count in range(largest, -1, -1):
        if len(posterior.precision) > count:
            weakest = int(np.argmin(np.sum(posterior.loadings[1:] ** 2, axis=1)))
            posterior = without_component(posterior, weakest)
        posterior = climb(problem, posterior, COMPARISON_TOLERANCE, COMPARISON_PASSES).posterior
        yield posterior
