"""Bounds and errors by which the period and the alignment are judged; shared with tests/bench."""

import gait_generator as g
import numpy as np

ROUNDING = 1e-9  # relative; no objective may rise by more


def cramer_rao(true, frames, noise, missing):
    """Least standard deviation of a period estimate, frames, with the shape unknown up to 8 harmonics."""
    t, step = np.arange(frames), 1e-4
    slope = (g.mean_curves(t / true + step) - g.mean_curves(t / true - step)) / (2 * step)
    change = slope * (t / true**2)[:, None]
    angle = 2 * np.pi * np.outer(t / true, np.arange(1, 9))
    shape, _ = np.linalg.qr(np.concatenate([np.ones((frames, 1)), np.cos(angle), np.sin(angle)], axis=1))
    rest = change - shape @ (shape.T @ change)
    return noise / np.sqrt((1 - missing) * np.sum(rest**2))


def persons(rng, style, noise=3.0, count=8):
    """Signals, periods and true offsets of `count` people whose style has a standard deviation, degrees."""
    periods = rng.uniform(90, 150, count)
    offsets = rng.uniform(0, 1, count) * periods
    signals = []
    for period, offset in zip(periods, offsets, strict=True):
        modes = g.random_modes(rng, 5)
        scores = rng.normal(size=5) * style / np.sqrt(5)
        frames = int(rng.integers(300, 500))
        signals.append(g.walk(rng, period, frames, offset=offset, noise=noise, scores=scores, modes=modes))
    return signals, periods, offsets


def gauge_free(found, true, periods):
    """Errors of the offsets in frames after removal of the common phase."""
    phase = np.exp(2j * np.pi * (found - true) / periods)
    phase /= phase.mean() / abs(phase.mean())
    return np.angle(phase) / (2 * np.pi) * periods


def falls(objective):
    """Whether an objective never rises by more than rounding."""
    values = np.array(objective)
    return bool(np.all(np.diff(values) <= ROUNDING * np.abs(values[:-1])))
