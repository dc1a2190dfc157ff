"""Learning as in Ormoneit and others (2000), literally and by the package, on the same walks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gait.body.skeleton import ANGLES, PAPER_ANGLES
from gait.errors import UserError
from gait.learn.arrays import Floats, Mask
from gait.learn.cycles import align, period
from gait.learn.cycles.sequence import Sequence as Walk
from gait.learn.options import LearnOptions
from gait.learn.prior import components, fit, iterated_svd, rank
from gait.learn.prior.fit import Learned
from gait.learn.prior.imputation import column_mean
from gait.paper import recordings

EIGHT = 8  # walking sequences of their figure 4
PAPER_FPS = 120.0  # at which their 126 frames are a usual stride
LONG_PERIOD, LONG_FRAMES, LONG_NOISE = 80.3, 5000, 5.0  # frames, and degrees: what whole periods cannot fold
REMOVED = 0.2  # of the entries, in blocks
HOLD_OUT_SEED = 1
PAPER_ANGLE_COUNT = len(PAPER_ANGLES)


@dataclass(frozen=True)
class Aligned:
    """Walks with their offsets."""

    walks: list[Walk]
    found: align.Alignment
    angles: int  #: so many of the channels were used

    @property
    def phases(self) -> Floats:
        """Offsets as shares of the periods, (n,)."""
        return np.asarray(self.found.offsets / [w.period.frames for w in self.walks])

    def curve(self) -> Floats:
        """Return the common periodic spline (1024, A), degrees."""
        signals = [w.channels[:, : self.angles] for w in self.walks]
        periods = np.array([w.period.frames for w in self.walks])
        return np.degrees(align.common_curve(signals, periods, self.found.offsets))


@dataclass(frozen=True)
class Removal:
    """Errors on blocks of entries that were removed, degrees rms."""

    share: float  #: removed
    mean: float  #: of the mean of each column
    literal: float
    ours: float
    passes: list[float]  #: error of the iterated SVD on what was left, after each


@dataclass(frozen=True)
class Learning:
    """Results of both ways of learning."""

    walks: list[Walk]  #: with refined periods
    literal_walks: list[Walk]  #: the same walks with the periods found as in the paper
    literal: Learned
    ours: Learned
    eight: Aligned
    eight_ours: Aligned
    removal: Removal
    long: tuple[float, float]  #: periods found of a long sequence, literal and refined, frames

    @property
    def agreeing(self) -> int:
        """Number of walks of which both searches find the same cycle."""
        pairs = zip(self.literal_walks, self.walks, strict=True)
        return sum(recordings.agrees(found, walk) for found, walk in pairs)

    @property
    def shown(self) -> Walk:
        """Walk with most cycles, with the paper's period."""
        return max(self.literal.sequences, key=lambda w: w.cycles)

    def refined(self, walk: Walk) -> Walk:
        """Return a walk with its refined period."""
        return next(w for w in self.walks if w.source == walk.source)


def learn(walks: list[Walk], update: Callable[[int], None] = lambda done: None) -> Learning:
    """Learn both ways; UserError if the paper's search finds no cycle in most walks."""
    literal_walks = [recordings.literal(walk) for walk in walks]
    update(1)
    usable = [f for f, w in zip(literal_walks, walks, strict=True) if recordings.agrees(f, w)]
    if len(usable) < recordings.FEWEST_WALKS:
        raise UserError(
            f"{len(usable)} walks have a cycle that the paper's search finds; add walks of two strides or "
            "more"
        )
    literal = fit.fit(usable, LearnOptions(prior="paper", period_mode="literal"))
    update(2)
    ours = fit.fit(walks)
    update(3)
    some = recordings.by_person(usable, EIGHT)
    refined = [next(w for w in walks if w.source == s.source) for s in some]
    result = Learning(
        walks,
        literal_walks,
        literal,
        ours,
        _aligned(some, PAPER_ANGLE_COUNT, literally=True),
        _aligned(refined, len(ANGLES), literally=False),
        _removal(literal),
        _long(literal),
    )
    update(4)
    return result


def _aligned(walks: list[Walk], angles: int, *, literally: bool) -> Aligned:
    """Align walks; by the letter from offsets 0 and with equal weights."""
    signals = [w.channels[:, :angles] for w in walks]
    periods = np.array([w.period.frames for w in walks])
    start, weights = (np.zeros(len(walks)), np.ones(angles)) if literally else (None, None)
    return Aligned(walks, align.align(signals, periods, start, align.HIP_COLUMNS, weights), angles)


def _removal(learned: Learned) -> Removal:
    """Remove blocks of entries of the cycles, and fill them again."""
    values = np.array(learned.cycles.values[:, :, :PAPER_ANGLE_COUNT])
    mask = learned.cycles.mask[:, :, :PAPER_ANGLE_COUNT]
    blocks = rank.hold_out(mask, REMOVED, np.random.default_rng(HOLD_OUT_SEED))
    visible, held, kept = mask & (blocks < 0), mask & (blocks >= 0), len(learned.components.sd)
    literal = components.fit(values, visible, kept, fill=iterated_svd.complete)
    ours = components.fit(values, visible, kept)
    mean = np.broadcast_to(column_mean(values, visible), values.shape)

    def error(found: Floats) -> float:
        return _rms(np.degrees(found - values), held)

    return Removal(
        share=float(held.sum() / mask.sum()),
        mean=error(mean),
        literal=error(np.asarray(literal.filled)),
        ours=error(np.asarray(ours.filled)),
        passes=np.degrees(literal.rmse).tolist(),
    )


def _rms(values: Floats, where: Mask) -> float:
    return float(np.sqrt(np.mean(values[where] ** 2)))


def _long(learned: Learned) -> tuple[float, float]:
    """Find the period of many cycles of the mean walk that last no whole number of frames."""
    mean = learned.curves[0][:, :PAPER_ANGLE_COUNT]
    at = np.arange(LONG_FRAMES) / LONG_PERIOD % 1.0 * len(mean)
    closed = np.concatenate([mean, mean[:1]])
    rng = np.random.default_rng(HOLD_OUT_SEED)
    noise = np.radians(LONG_NOISE) * rng.normal(size=(LONG_FRAMES, PAPER_ANGLE_COUNT))
    signals = noise + np.stack([np.interp(at, np.arange(len(closed)), c) for c in closed.T], axis=1)
    literal, refined = (period.find(signals, PAPER_FPS, mode).frames for mode in ("literal", "refined"))
    return float(literal), float(refined)


def noise_row(walk: Walk) -> tuple[float, float]:
    """Return mean and rise of the ratio of white noise over the paper's periods."""
    noise = np.random.default_rng(0).normal(size=(len(walk.channels), 1))
    candidates, table = period.curves(noise, walk.fps, "literal")
    valid = np.isfinite(table[:, 0])
    slope, _ = np.polyfit(candidates[valid], table[valid, 0], 1)
    return float(table[valid, 0].mean()), float(slope * np.ptp(candidates[valid]))


def closure(curves: Floats) -> float:
    """Return the step of curves (T, A) from the end of a cycle to its start over their largest, at most."""
    steps = np.abs(np.diff(np.concatenate([curves, curves[:1]]), axis=0))
    largest = steps[:-1].max(axis=0)
    moving = largest > 1e-9 * max(float(largest.max()), 1e-300)
    return float(np.max(steps[-1, moving] / largest[moving]))


def printed_mean(learned: Learned) -> Floats:
    """Return the mean (T, 19) of the completed cycles as printed: not in the Fourier basis."""
    return np.asarray(np.array(learned.components.filled[:, :, :PAPER_ANGLE_COUNT]).mean(axis=0))


def left_by_mean(learned: Learned) -> float:
    """Return what the mean cycle of the others leaves of a person, degrees rms, the median of the people."""
    values, mask = (np.asarray(x[:, :, : len(ANGLES)]) for x in (learned.cycles.values, learned.cycles.mask))
    subject = learned.row_subject
    found = []
    for one in np.unique(subject):
        own = subject == one
        mean = np.broadcast_to(column_mean(values[~own], mask[~own]), values[own].shape)
        found.append(_rms(np.degrees(values[own] - mean), mask[own]))
    return float(np.median(found))
