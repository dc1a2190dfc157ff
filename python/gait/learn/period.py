"""Length of the cycle by its signal-to-noise ratio (Ormoneit 2000, eq. 1), exactly the F of one-way analysis of variance.

`literal` is the paper's: whole frames, one bin per frame.  `refined` scores half frames with a fixed number of
bins, prefers divisors (a multiple of the period fits as well), then maximises the F of a harmonic regression.
Signals are (T, A) with NaN for missing entries; periods are in frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

BINS = 50
HARMONICS = 8
DIVISORS = (5, 4, 3, 2)
DIVISOR_SHARE = 0.5  # of the best score that a divisor of the best period must reach
CYCLES = 1.5  # cycles a sequence must hold for a candidate to be scored
CYCLIC = 3.0  # sharpness, peak over median score, of a sequence that counts as cyclic
SECONDS = (0.4, 2.1)


@dataclass(frozen=True)
class Period:
    """Result of `find`.

    Attributes
    ----------
    frames : float
        Length of the cycle.
    candidates, scores : (n,)
        Signal-to-noise ratio, summed over the angles, of each candidate; NaN where invalid.
    sharpness : float
        Best score over the median one.
    cyclic : bool
        Whether the sequence looks cyclic at all.
    """

    frames: float
    candidates: Floats
    scores: Floats
    sharpness: float
    cyclic: bool


def snr_literal(signals: Floats, period: int) -> Floats:
    """Signal-to-noise ratio (A,) of folding at a whole number of frames (R1-R3); NaN if too few observations."""
    return _anova(signals, np.arange(len(signals)) % period, period)


def snr_binned(signals: Floats, period: float, bins: int = BINS) -> Floats:
    """Signal-to-noise ratio (A,) with a fixed number of phase bins (R4)."""
    phase = np.arange(len(signals)) / period % 1.0
    return _anova(signals, np.minimum((bins * phase).astype(int), bins - 1), bins)


def _anova(signals: Floats, group: npt.NDArray[np.intp], groups: int) -> Floats:
    """Unbalanced one-way F per column: mean square between groups over mean square within."""
    seen = np.isfinite(signals)
    total = seen.sum(axis=0)
    mean = np.where(seen, signals, 0).sum(axis=0) / np.maximum(total, 1)
    values = np.where(seen, signals - mean, 0)
    member = np.zeros((groups, len(signals)))
    member[group, np.arange(len(signals))] = 1
    counts, sums = member @ seen, member @ values
    effective = (counts > 0).sum(axis=0)
    between = (sums**2 / np.maximum(counts, 1)).sum(axis=0)
    within = (values**2).sum(axis=0) - between
    valid = (total - effective >= effective) & (effective > 1) & (within > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        score = between / (effective - 1) / (within / (total - effective))
    return np.where(valid, score, np.nan)


def patterns(signals: Floats) -> list[tuple[npt.NDArray[np.bool_], Floats]]:
    """Columns grouped by which rows are observed: (rows (T,), centred values of the group)."""
    seen = np.isfinite(signals)
    groups: dict[bytes, list[int]] = {}
    for k, column in enumerate(seen.T):
        groups.setdefault(column.tobytes(), []).append(k)
    result = []
    for columns in groups.values():
        rows = seen[:, columns[0]]
        values = signals[np.ix_(rows, columns)]
        result.append((rows, values - values.mean(axis=0)))
    return result


def harmonic_f(
    groups: list[tuple[npt.NDArray[np.bool_], Floats]], period: float, harmonics: int = HARMONICS
) -> float:
    """F of the regression on a constant and harmonics of the period, summed over columns; observed samples only."""
    frames = len(groups[0][0])
    angle = 2 * np.pi / period * np.outer(np.arange(frames), np.arange(1, harmonics + 1))
    design = np.concatenate([np.ones((frames, 1)), np.cos(angle), np.sin(angle)], axis=1)
    terms, score = design.shape[1], 0.0
    for rows, values in groups:
        x, count = design[rows], int(rows.sum())
        if count <= terms + 1:
            continue
        projected = x.T @ values
        explained = (projected * np.linalg.lstsq(x.T @ x, projected, rcond=1e-12)[0]).sum(axis=0)
        total = (values**2).sum(axis=0)
        rest = np.maximum(total - explained, 1e-9 * total)
        score += float(np.sum(explained / (terms - 1) / (rest / (count - terms))))
    return score


def find(signals: Floats, fps: float, mode: str = "refined", bounds: tuple[float, float] | None = None) -> Period:
    """Find the period of a sequence.

    Parameters
    ----------
    mode : "refined" or "literal"
    bounds : (low, high), optional
        Frames; by default 0.4 to 2.1 s, or 50 to 250 frames in the literal mode, as the paper has it.
    """
    moving = signals[:, _moving(signals)]
    literal = mode == "literal"
    low, high = bounds or ((50.0, 250.0) if literal else (SECONDS[0] * fps, SECONDS[1] * fps))
    candidates = np.arange(np.ceil(low), high + 0.1, 1.0 if literal else 0.5)
    if literal:
        scores = np.array([_total(snr_literal(moving, int(p))) for p in candidates])
    else:
        longest = len(signals) / CYCLES
        scores = np.array([_total(snr_binned(moving, p)) if p <= longest else np.nan for p in candidates])
    if not moving.shape[1] or np.isnan(scores).all():
        return Period(float("nan"), candidates, scores, 0.0, False)
    best = float(candidates[np.nanargmax(scores)])
    if not literal:
        best = _refine(moving, _divisor(candidates, scores, best))
    sharpness = float(np.nanmax(scores) / np.nanmedian(scores))
    return Period(best, candidates, scores, sharpness, sharpness >= CYCLIC)


def _moving(signals: Floats) -> npt.NDArray[np.bool_]:
    """Columns that are observed and not constant."""
    seen = np.isfinite(signals)
    spread = np.where(seen, signals, -np.inf).max(axis=0) - np.where(seen, signals, np.inf).min(axis=0)
    return (seen.sum(axis=0) > 2) & (spread > 1e-9)


def _total(scores: Floats) -> float:
    """Sum over the valid columns, scaled up to all of them; NaN if half or more are invalid."""
    valid = np.isfinite(scores)
    return float(scores[valid].sum() * len(scores) / valid.sum()) if 2 * valid.sum() > len(scores) else float("nan")


def _divisor(candidates: Floats, scores: Floats, best: float) -> float:
    """The smallest period best/5 ... best/2 whose score nearby comes near the best one's, else the best."""
    for divisor in DIVISORS:
        near = np.abs(candidates - best / divisor) <= 1.0
        if near.any() and np.nanmax(np.append(scores[near], -np.inf)) >= DIVISOR_SHARE * np.nanmax(scores):
            return float(candidates[near][np.nanargmax(scores[near])])
    return best


def _refine(signals: Floats, period: float) -> float:
    """Maximise the harmonic F on +-1 frame in steps of 0.05, then +-0.1 in steps of 0.005."""
    groups = patterns(signals)
    for width, step in ((1.0, 0.05), (0.1, 0.005)):
        grid = period + np.arange(-width, width + step / 2, step)
        period = float(grid[np.argmax([harmonic_f(groups, p) for p in grid])])
    return period
