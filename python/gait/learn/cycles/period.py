"""Find the length of the cycle by its signal-to-noise ratio (Ormoneit 2000, eq. 1).

The ratio is exactly the F statistic of a one-way analysis of variance grouped by phase.  The mode `literal`
is the paper's: whole frames, one bin per frame.  `refined` scores half frames with a fixed number of bins,
prefers divisors (as multiples of the period fit equally well), then maximises the F statistic of a harmonic
regression.  Signals are (T, A) with NaN for missing entries; periods are in frames.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gait.learn.arrays import Floats, Indices, Mask, same_columns

PHASE_BINS = 50
PERIOD_HARMONICS = 8
DIVISORS = (5, 4, 3, 2)
DIVISOR_ANGLES = 0.8  # share of the angles that must accept a divisor of the best period
DIVISOR_SCORE = 0.5  # share of its best score that an accepting angle has at the divisor
#: Fewest cycles of a sequence.  Three would be better for folding, but CMU's walks have 1.7 to 3.5 strides,
#: and their periods still agree with autocorrelation (tests/python/test_learn_cmu.py).
FEWEST_CYCLES = 1.5
SECONDS = (0.4, 2.1)
LONGER = 4.0  # multiple of the longest period up to which `find_longer` searches
MOST_CLIMBS = 50  # most frames from an end of the search to the best period outside it
LITERAL_SECONDS = (50 / 120, 250 / 120)  # the paper's 50 to 250 frames, assumed at 120 per second


@dataclass(frozen=True)
class Period:
    """Result of `find`."""

    frames: float  #: length of the cycle
    candidates: Floats  #: (n,) periods tried, frames
    scores: Floats  #: (n,) their signal-to-noise ratio, summed over the angles; NaN where invalid
    sharpness: float  #: best score over the median one; 0 where no score is valid

    @property
    def peak(self) -> float:
        """Best score."""
        return float(np.nanmax(self.scores))


class Folder:
    """Signals (T, A), NaN where missing, prepared for folding at many periods."""

    def __init__(self, signals: Floats) -> None:
        visible = np.isfinite(signals)
        self.total = visible.sum(axis=0)
        mean = np.where(visible, signals, 0).sum(axis=0) / np.maximum(self.total, 1)
        values = np.where(visible, signals - mean, 0)
        self.squares = (values**2).sum(axis=0)
        masks, inverse = np.unique(visible, axis=1, return_inverse=True)  # usually the same for all angles
        self.mask = inverse.ravel()  # of two dimensions with numpy 2.0.0
        self.stacked = np.concatenate([values, masks.astype(float)], axis=1)

    def literal(self, periods: ArrayLike) -> Floats:
        """Return ratios (n, A) of folding at whole numbers of frames; NaN if observations are too few."""
        frames = np.arange(len(self.stacked))
        return self._anova(frames % period for period in np.asarray(periods, int))

    def binned(self, periods: ArrayLike, bins: int) -> Floats:
        """Return signal-to-noise ratios (n, A) with a fixed number of phase bins."""
        frames = np.arange(len(self.stacked))
        phases = (frames / period % 1.0 for period in np.asarray(periods, float))
        return self._anova(np.minimum((bins * phase).astype(int), bins - 1) for phase in phases)

    def _anova(self, groupings: Iterable[Indices]) -> Floats:
        """Return the one-way F of each column: mean square between groups over mean square within."""
        folded = [self._folded(group) for group in groupings]
        between = np.array([squares for squares, _ in folded]).reshape(len(folded), len(self.total))
        groups = np.array([count for _, count in folded], int).reshape(between.shape)
        within = self.squares - between
        valid = (self.total - groups >= groups) & (groups > 1) & (within > 0)
        score = between / np.maximum(groups - 1, 1) * (self.total - groups) / np.where(within > 0, within, 1)
        return np.where(valid, score, np.nan)

    def _folded(self, group: Indices) -> tuple[Floats, Indices]:
        """Return the sum of squares between groups and the number of groups seen, per column."""
        size = np.bincount(group)
        starts = (np.cumsum(size) - size)[size > 0]
        rows = self.stacked[np.argsort(group, kind="stable")]
        sums, counts = np.split(np.add.reduceat(rows, starts), [len(self.total)], axis=1)
        between = (sums**2 / np.maximum(counts, 1)[:, self.mask]).sum(axis=0)
        return between, np.count_nonzero(counts, axis=0)[self.mask]


def _centred_groups(signals: Floats) -> list[tuple[Mask, Floats]]:
    """Group columns by which rows are observed: (rows (T,), centred values of the group)."""
    visible = np.isfinite(signals)
    result = []
    for columns in same_columns(visible):
        rows = visible[:, columns[0]]
        values = signals[rows][:, columns]
        result.append((rows, values - values.mean(axis=0)))
    return result


def _harmonic_f(groups: list[tuple[Mask, Floats]], period: float) -> float:
    """Return the F of the regression on a constant and harmonics, summed over columns."""
    frames = len(groups[0][0])
    angle = 2 * np.pi / period * np.outer(np.arange(frames), np.arange(1, PERIOD_HARMONICS + 1))
    design = np.concatenate([np.ones((frames, 1)), np.cos(angle), np.sin(angle)], axis=1)
    terms, score = design.shape[1], 0.0
    for rows, values in groups:
        x, count = design[rows], int(rows.sum())
        if count <= terms + 1:
            continue
        projected, gram = x.T @ values, x.T @ x
        explained = (projected * np.linalg.solve(gram + 1e-9 * count * np.eye(terms), projected)).sum(axis=0)
        total = (values**2).sum(axis=0)
        rest = np.maximum(total - explained, 1e-9 * total)
        score += float(np.sum(explained / (terms - 1) / (rest / (count - terms))))
    return score


def curves(signals: Floats, fps: float, mode: str = "refined") -> tuple[Floats, Floats]:
    """Return candidate periods (n,) and the signal-to-noise ratio (n, A) of each angle at them.

    The ratios are the rows of the paper's figure 2; NaN where there are too few observations for the period,
    or the angle does not move.  White noise has the law of Fisher's F and so a flat row at about 1.
    Candidates are half frames from 0.4 to 2.1 s in a fixed number of bins, or in the mode "literal" whole
    frames from 0.42 to 2.08 s (50 to 250 at 120 per s) in one bin each.
    """
    moving = _moving(signals)
    literal = mode == "literal"
    low, high = _bounds(fps, mode)
    candidates = np.arange(np.ceil(low - 1e-9), high + 0.1, 1.0 if literal else 0.5)
    folder, longest, bins = Folder(signals[:, moving]), len(signals) / FEWEST_CYCLES, _bins(low)
    ratios = np.full((len(candidates), signals.shape[1]), np.nan)
    if literal:
        ratios[:, moving] = folder.literal(candidates)
    else:
        allowed = candidates <= longest
        ratios[np.ix_(allowed, moving)] = folder.binned(candidates[allowed], bins)
    return candidates, ratios


def find(signals: Floats, fps: float, mode: str = "refined") -> Period:
    """Find the period of a sequence; parameters are those of `curves`."""
    moving = signals[:, _moving(signals)]
    candidates, ratios = curves(moving, fps, mode)
    scores = np.array([_total(row) for row in ratios])
    if np.isnan(scores).all():
        return Period(float("nan"), candidates, scores, 0.0)
    best = float(candidates[np.nanargmax(scores)])
    if mode != "literal":
        low = _bounds(fps, mode)[0]
        best = _divisor(Folder(moving), _bins(low), moving, _refine(moving, best), low)
    sharpness = float(np.nanmax(scores) / np.nanmedian(scores))
    return Period(best, candidates, scores, sharpness)


def find_longer(signals: Floats, fps: float, mode: str = "refined") -> float:
    """Find the best period, frames, among those too long for `find`; NaN if the signals are too short."""
    moving, longest = signals[:, _moving(signals)], _bounds(fps, mode)[1]
    candidates = np.arange(longest + 1, min(LONGER * longest, len(signals) / FEWEST_CYCLES), 0.5)
    if not moving.size or not len(candidates):
        return float("nan")
    scores = np.array([_total(row) for row in Folder(moving).binned(candidates, PHASE_BINS)])
    return _refine(moving, float(candidates[np.nanargmax(scores)])) if np.isfinite(scores).any() else np.nan


def refined(signals: Floats, frames: float) -> float:
    """Return the best period, frames, near one that is almost right."""
    return _refine(signals[:, _moving(signals)], frames)


def climbed(signals: Floats, fps: float, frames: float, mode: str = "refined") -> float:
    """Return the best period, frames, near one at an end of the search, where it may be outside.

    The end scores better than all periods inside if the best one is a little beyond it; a period further than
    a frame from the ends is returned as it is.
    """
    low, high = _bounds(fps, mode)
    if not np.isfinite(frames) or low + 1 <= frames <= high - 1:
        return frames
    for _ in range(MOST_CLIMBS):
        before, frames = frames, refined(signals, frames)
        if abs(frames - before) < 0.5:
            break
    return frames


def seconds(mode: str) -> tuple[float, float]:
    """Return the shortest and longest period searched for, seconds."""
    return LITERAL_SECONDS if mode == "literal" else SECONDS


def _bounds(fps: float, mode: str) -> tuple[float, float]:
    """Return the shortest and longest candidate, frames."""
    low, high = seconds(mode)
    return low * fps, high * fps


def _bins(low: float) -> int:
    """Return the number of phase bins, at most the frames of the shortest cycle."""
    return int(np.clip(1.05 * low, 8, PHASE_BINS))


def _moving(signals: Floats) -> Mask:
    """Return which columns are observed and not constant."""
    visible = np.isfinite(signals)
    spread = np.where(visible, signals, -np.inf).max(axis=0) - np.where(visible, signals, np.inf).min(axis=0)
    return (visible.sum(axis=0) > 2) & (spread > 1e-9)


def _total(scores: Floats) -> float:
    """Return the sum over the valid columns, scaled up to all; NaN if half or more are invalid."""
    valid = np.isfinite(scores)
    return float(scores[valid].mean() * len(scores)) if 2 * valid.sum() > len(scores) else float("nan")


def _divisor(folder: Folder, bins: int, signals: Floats, best: float, low: float) -> float:
    """Return the smallest of best/5 ... best/2 that most angles accept, refined; else the best.

    Each angle has one vote.  In a sum of scores the trunk, which repeats every step, could outweigh the legs,
    and a multiple that is almost as long as the recording scores a quarter more than the period (CMU 38_02).
    """
    whole, *parts = folder.binned([best, *(best / divisor for divisor in DIVISORS)], bins)
    for divisor, part in zip(DIVISORS, parts, strict=True):
        voting = np.isfinite(whole) & np.isfinite(part)
        accepting = (part >= DIVISOR_SCORE * whole)[voting]
        enough = 2 * len(accepting) > len(part) and accepting.mean() >= DIVISOR_ANGLES
        if enough and best / divisor >= low:
            return _refine(signals, best / divisor)
    return best


def _refine(signals: Floats, period: float) -> float:
    """Maximise the harmonic F: +-1 frame in steps of 0.1, +-0.1 in steps of 0.02, then a parabola."""
    groups = _centred_groups(signals)
    for width, step in ((1.0, 0.1), (0.1, 0.02)):
        grid = period + step * np.arange(-round(width / step), round(width / step) + 1)
        score = np.array([_harmonic_f(groups, p) for p in grid])
        top = int(np.clip(np.argmax(score), 1, len(grid) - 2))
        period = float(grid[top])
    left, middle, right = score[top - 1 : top + 2]
    bend = left - 2 * middle + right
    return period + (float(np.clip(0.5 * (left - right) / bend, -1, 1)) * step if bend < 0 else 0.0)
