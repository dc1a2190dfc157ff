"""The number of components: what predicts entries that were held out, of people or of cycles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from gait.learn.cycles.fourier import HARMONICS, fourier_basis
from gait.learn.prior.bayes import Problem, Rows, climb
from gait.learn.prior.belief import Belief, without
from gait.learn.prior.impute import column_mean
from gait.learn.spool import by_rows, release, stored

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Groups = npt.NDArray[np.intp]

LARGEST = 12  # components tried
HELD_OUT = 0.05  # share of the observed entries held out where people are too few
BLOCK = 8  # such a block is this part of a cycle of one channel
FEWEST_PEOPLE = 4
MOST_FOLDS = 8
DRAWS = 4  # of what is hidden of a person's cycles
TOLERANCE, PASSES = 3e-2, 30  # of the fits that are only compared


def choose(
    values: Floats,
    mask: Mask,
    rng: np.random.Generator,
    groups: Groups | None = None,
    harmonics: int = HARMONICS,
    largest: int = LARGEST,
) -> tuple[int, Floats]:
    """Find the number of components that predicts held-out entries, no more than are needed.

    With `groups` of at least FEWEST_PEOPLE people, those of one fold after the other are left out of learning
    and the model predicts half of the channels over half of each of their cycles from the rest of the cycle.
    Otherwise short blocks of known cycles are predicted.  Chosen is the smallest number whose mean square
    error is within one standard error (over folds or blocks) of the least (Breiman et al. 1984).

    Parameters
    ----------
    values, mask : (R, T, M)
        Data and where they are observed.
    groups : (R,), optional
        Person of each row.

    Returns
    -------
    count : int
        At least 1.
    errors : (largest + 1,)
        Root mean square error with 0, 1 ... components.
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
    doubt = float(np.std(squares[:, best])) / np.sqrt(max(len(squares) - 1, 1))
    return max(int(np.argmax(mean <= mean[best] + doubt)), 1), np.sqrt(mean)


def _of_people(
    values: Floats, mask: Mask, fold: Groups, rng: np.random.Generator, basis: Floats, largest: int
) -> Floats:
    """Mean square errors (folds, 1 + components) on rows of people that were left out."""
    result = []
    fewest = min(int(np.sum(fold != f)) for f in np.unique(fold))
    for f in np.unique(fold):
        # Every draw is a copy of the person's cycles of which other parts are hidden.
        out, rest = np.tile(np.flatnonzero(fold == f), DRAWS), np.flatnonzero(fold != f)
        truth, seen = _picked(values, out), mask[out]
        hidden = _half(truth.shape, rng)
        there, held, errors = Problem(truth, seen & ~hidden, basis), seen & hidden, []
        for belief in _descending(_picked(values, rest), mask[rest], basis, min(largest, fewest - 1)):
            errors.append(sum(float(np.sum(d)) for _, d in _squares(there.expect(belief), truth, held)))
        result.append(np.array(errors[::-1]) / max(int(held.sum()), 1))
    return np.array(result)


def _of_blocks(values: Floats, mask: Mask, rng: np.random.Generator, basis: Floats, largest: int) -> Floats:
    """Mean square errors (blocks, 1 + components) on blocks of entries that were left out."""
    blocks = hold_out(mask, HELD_OUT, rng)
    seen = mask & (blocks < 0)
    problem, result = Problem(values, seen, basis), []
    held = mask & (blocks >= 0)
    count = np.bincount(blocks[held])
    for belief in _descending(values, seen, basis, min(largest, len(values) - 1)):
        total = np.zeros(len(count))
        for part, squares in _squares(problem.expect(belief), values, held):
            total += np.bincount(blocks[part][held[part]], squares, len(count))
        result.append(total[count > 0] / count[count > 0])
    return np.array(result[::-1]).T


def _picked(values: Floats, rows: Groups) -> Floats:
    """Put some rows on disk."""

    def parts() -> Iterator[Floats]:
        for part in by_rows(rows):
            yield values[rows[part]]
            release(values)

    return stored(parts(), values.shape[1:])


def _squares(rows: Rows, values: Floats, held: Mask) -> Iterator[tuple[slice, Floats]]:
    """Blocks of rows, and the squares (n,) of what the model misses where entries are held out."""
    for part in by_rows(values):
        model = rows.some(part).reshape(-1, *values.shape[1:])
        yield part, (model - values[part])[held[part]] ** 2


def hold_out(mask: Mask, share: float, rng: np.random.Generator) -> npt.NDArray[np.int32]:
    """Draw blocks, a BLOCK-th of a cycle of a channel and row each: their numbers, -1 outside, (R, T, M)."""
    rows, samples, channels = mask.shape
    length = samples // BLOCK
    chosen: npt.NDArray[np.int32] = np.full(mask.shape, -1, np.int32)
    for k in range(max(int(share * mask.sum() / length), 1)):
        r, m, t = int(rng.integers(rows)), int(rng.integers(channels)), int(rng.integers(samples))
        chosen[r, (t + np.arange(length)) % samples, m] = k
    return chosen


def _half(shape: tuple[int, ...], rng: np.random.Generator) -> Mask:
    """Hide half of the channels over half of the cycle, other halves in each row."""
    rows, samples, channels = shape
    hidden = np.zeros(shape, bool)
    for row in hidden:
        some = rng.permutation(channels)[: (channels + 1) // 2]
        row[np.ix_((int(rng.integers(samples)) + np.arange(samples // 2)) % samples, some)] = True
    return hidden


def _descending(values: Floats, mask: Mask, basis: Floats, largest: int) -> Iterator[Belief]:
    """Beliefs with `largest` components, one less ... 0; each begins from the one before less its weakest."""
    problem = Problem(values, mask, basis)
    belief = problem.begin(column_mean(values, mask), largest)
    for count in range(largest, -1, -1):
        if len(belief.precision) > count:
            belief = without(belief, int(np.argmin(np.sum(belief.loadings[1:] ** 2, axis=1))))
        belief = climb(problem, belief, TOLERANCE, PASSES).belief
        yield belief
