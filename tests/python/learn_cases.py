"""Cycles with known truth for tests and evaluations of imputation and components (L7-L12).

`walks` are those of generator G1 with people; `reference` is the small problem on which other packages are
compared.  Both come with the best linear prediction from the known generator (the oracle).
"""

from dataclasses import dataclass

import gait_generator as g
import numpy as np

from gait.learn.cycles import cutting

SUBJECT_SD, CYCLE_SD = 1.0, 0.44  # of the scores, shares of SCORE_SD
REFERENCE = {"rows": 80, "samples": 64, "sd": (2.0, 1.2, 0.7), "noise": 0.45, "missing": 0.13}
BLOCK = (6, 20)  # samples of a block missing from the reference problem
LIMBS = {"right arm": (3, 7), "right leg": (7, 11), "left arm": (11, 15), "left leg": (15, 19)}


@dataclass
class Case:
    """Cycles (R, T, M), the mask of observed entries, and the generator behind them."""

    values: np.ndarray
    mask: np.ndarray
    mean: np.ndarray  # (T, M)
    modes: np.ndarray  # (q, T, M)
    sd: np.ndarray  # (q,) of the generator's scores
    noise: float
    scores: np.ndarray  # (R, q)
    subject: np.ndarray  # (R,)

    def oracle(self):
        """Data whose missing entries are predicted from the known mean, modes, their sd and the noise."""
        result = self.values.copy()
        for row, visible in zip(result, self.mask, strict=True):
            design = self.modes[:, visible].T
            precision = design.T @ design / self.noise**2 + np.diag(1 / np.square(self.sd))
            scores = np.linalg.solve(precision, design.T @ (row - self.mean)[visible] / self.noise**2)
            row[~visible] = (self.mean + np.tensordot(scores, self.modes, 1))[~visible]
        return result

    def error(self, filled, where=None):
        """Root mean square error on missing entries, noise included."""
        return rms(filled, self.values, ~self.mask if where is None else where)


def rms(a, b, where):
    """Root mean square of a - b over the known entries."""
    return float(np.sqrt(np.mean((a - b)[where] ** 2)))


def walks(rng, rows=80, missing=0.2, noise=1.0):
    """Cycles of G1 with gaps in blocks."""
    modes = g.random_modes(rng)
    values, mask, scores = g.cycle_matrix(rng, rows, modes, noise, missing)
    return _walking(values, mask, modes, noise, scores, np.arange(rows))


def people(rng, subjects=8, cycles_each=10, missing=0.2, noise=1.0):
    """Cycles of people, each with their own style: score = subject's + 0.44 x cycle's."""
    modes, rows = g.random_modes(rng), subjects * cycles_each
    style = SUBJECT_SD * rng.normal(size=(subjects, 5)).repeat(cycles_each, axis=0)
    scores = (style + CYCLE_SD * rng.normal(size=(rows, 5))) * g.SCORE_SD
    values, mask, _ = g.cycle_matrix(rng, rows, modes, noise, missing)
    phase = np.arange(g.GRID) / g.GRID
    values = g.mean_curves(phase) + np.tensordot(scores, modes.curves(phase), 1)
    values = values + rng.normal(scale=noise, size=values.shape)
    return _walking(values, mask, modes, noise, scores, np.repeat(np.arange(subjects), cycles_each))


def _walking(values, mask, modes, noise, scores, subject):
    phase = np.arange(g.GRID) / g.GRID
    sd = np.array(g.SCORE_SD)
    return Case(values, mask, g.mean_curves(phase), modes.curves(phase), sd, noise, scores, subject)


def reference(rng):
    """80 cycles of one channel at 64 phases: three smooth modes, white noise, 13 % missing in blocks."""
    rows, samples, sd, noise, missing = REFERENCE.values()
    harmonics, phase = np.arange(1, 5), np.arange(samples) / samples
    angle = 2 * np.pi * np.outer(harmonics, phase)
    waves = np.sqrt(2) * np.stack([np.cos(angle), np.sin(angle)], axis=1).reshape(8, samples)
    raw = rng.normal(size=(len(sd), 8)) / harmonics.repeat(2)
    modes = np.linalg.qr(raw.T)[0].T @ waves
    mean = 3 * np.cos(2 * np.pi * phase) + np.sin(4 * np.pi * phase)
    scores = rng.normal(size=(rows, len(sd))) * sd
    values = mean + scores @ modes + rng.normal(scale=noise, size=(rows, samples))
    mask = np.ones(values.shape, bool)
    while 1 - mask.mean() < missing:
        at = int(rng.integers(samples)) + np.arange(int(rng.integers(BLOCK[0], BLOCK[1] + 1)))
        mask[int(rng.integers(rows)), at % samples] = False
    return Case(
        values[..., None], mask[..., None], mean[:, None], modes[..., None], np.array(sd), noise, scores,
        np.arange(rows),
    )  # fmt: skip


def without_limbs(case, rng):
    """Remove whole limbs over half a cycle from every other row; True where removed."""
    taken = np.zeros_like(case.mask)
    for row in taken[::2]:
        first, last = list(LIMBS.values())[int(rng.integers(len(LIMBS)))]
        at = (int(rng.integers(g.GRID)) + np.arange(g.GRID // 2)) % g.GRID
        row[np.ix_(at, np.arange(first, last))] = True
    return _take(case, taken)


def without_channel(case, channels, rows):
    """Remove channels from whole rows; True where removed."""
    taken = np.zeros_like(case.mask)
    taken[np.ix_(rows, np.arange(g.GRID), channels)] = True
    return _take(case, taken)


def _take(case, taken):
    case.mask = case.mask & ~taken
    return taken


def drifting(rng, sequences=12, rise=6.0):
    """Cycles (`cycles.Cycles`) of people whose angles drift by `rise` degrees per cycle."""
    modes, signals, periods, offsets = g.random_modes(rng), [], [], []
    for _ in range(sequences):
        period, frames = rng.uniform(100, 140), 460
        offset = rng.uniform(0, period)
        scores = rng.normal(size=5) * g.SCORE_SD
        z = g.walk(rng, period, frames, offset=offset, noise=0.5, scores=scores, modes=modes)
        signals.append(z + rise * np.arange(frames)[:, None] / period)
        periods.append(period)
        offsets.append(offset)
    return cutting.cut_cycles(signals, np.array(periods), np.array(offsets), g.GRID)


def seams(curves, neighbours=True):
    """Worst step across the seam over the usual step, for curves (T, M) and their first two differences (3,).

    The usual step is the median, as in the measure's definition; with `neighbours` it is at least as large as
    the steps next to the seam.  With the median alone, a smooth curve that is steep at phase 0 seems to have
    a seam.
    """
    worst = np.zeros(3)
    for order in range(3):
        step = np.abs(np.diff(curves, axis=0, append=curves[:1]))
        usual = np.median(step, axis=0)
        if neighbours:
            usual = np.maximum(usual, np.maximum(step[-2], step[0]))
        worst[order] = np.max(step[-1] / usual)
        curves = np.diff(curves, axis=0, append=curves[:1])
    return worst


def seam(curves):
    """Worst of `seams`."""
    return float(np.max(seams(curves)))


def principal_angles(modes, curves):
    """Angles (q,) in degrees between the spans of two sets of curves, ascending."""
    first, second = (np.linalg.qr(c.reshape(len(c), -1).T)[0] for c in (modes, curves))
    cosines = np.linalg.svd(first.T @ second, compute_uv=False)
    return np.degrees(np.arccos(np.clip(cosines, -1, 1)))


def mode_scores(case, found):
    """Scores (R, q) of the reconstruction on the generator's modes."""
    curves = case.modes.reshape(len(case.modes), -1)
    rows = (found.reconstruct() - case.mean).reshape(len(case.values), -1)
    return np.linalg.lstsq(curves.T, rows.T, rcond=None)[0].T
