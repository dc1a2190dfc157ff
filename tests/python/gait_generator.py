"""Synthetic walking with known truth (G1): normative joint angles, random modes of variation, noise and gaps.

Degrees; 19 channels: neck x, y, z; right shoulder flexion, abduction, rotation; right elbow; right hip
flexion, abduction, rotation; right knee; the same eight of the left side.
"""

from dataclasses import dataclass

import numpy as np

FLEXIONS = {  # values at 0, 10, ... 90 % of the cycle, phase 0 = right heel strike
    "hip_flexion": (28, 25, 15, 5, -4, -10, -4, 14, 26, 30),
    "hip_abduction": (-2, -6, -6, -4, -3, 0, 5, 6, 3, 0),
    "hip_rotation": (-2, 1, 2, 3, 3, 2, -2, -4, -4, -3),
    "knee": (4, 14, 16, 9, 4, 8, 36, 62, 52, 16),
    "shoulder_flexion": (-18, -16, -10, -1, 8, 12, 11, 5, -5, -14),
    "shoulder_abduction": (-9, -8, -7, -6, -6, -6, -7, -8, -9, -9),
    "shoulder_rotation": (2, 2, 1, 0, -1, -2, -2, -1, 0, 1),
    "elbow": (16, 16, 18, 24, 32, 38, 36, 30, 23, 18),
    "neck_x": (4, 5, 4, 3, 3, 4, 5, 4, 3, 3),
    "neck_y": (3, 2, 1, -1, -2, -3, -2, -1, 1, 2),
    "neck_z": (1, 2, 2, 1, -1, -1, -2, -2, -1, 0),
}
SIDE = (
    "shoulder_flexion", "shoulder_abduction", "shoulder_rotation", "elbow",
    "hip_flexion", "hip_abduction", "hip_rotation", "knee",
)  # fmt: skip
MIRRORED = ("abduction", "rotation")
SCORE_SD = (6.0, 4.5, 3.5, 2.5, 1.8)  # rms degrees per entry
GRID = 128


def mean_curves(phase):
    """Mean angles (n, 19) at phases (n,), by trigonometric interpolation of the ten samples."""
    left = np.asarray(phase) + 0.5
    columns = [_interpolate(FLEXIONS[f"neck_{axis}"], phase) for axis in "xyz"]
    columns += [_interpolate(FLEXIONS[name], phase) for name in SIDE]
    columns += [_interpolate(FLEXIONS[name], left) * (-1 if name.endswith(MIRRORED) else 1) for name in SIDE]
    return np.stack(columns, axis=1)


def _interpolate(samples, phase):
    coefficients = np.fft.rfft(samples) / len(samples)
    coefficients[1:-1] *= 2
    turns = np.exp(2j * np.pi * np.outer(phase, np.arange(len(coefficients))))
    return (turns @ coefficients).real


@dataclass
class Modes:
    """Orthonormal modes over 19 channels and GRID phases, as Fourier coefficients."""

    cosine: np.ndarray  # (q, 4, 19)
    sine: np.ndarray

    def curves(self, phase):
        """Modes (q, n, 19) of rms 1 per entry at phases (n,)."""
        angle = 2 * np.pi * np.outer(phase, np.arange(1, 5))
        return np.einsum("nh,qhc->qnc", np.cos(angle), self.cosine) + np.einsum(
            "nh,qhc->qnc", np.sin(angle), self.sine
        )


def random_modes(rng, count=5):
    """Smooth random modes: four harmonics with amplitudes falling as 1/k."""
    raw = rng.normal(size=(count, 2, 4, 19)) / np.arange(1, 5)[None, None, :, None]
    flat, _ = np.linalg.qr(raw.reshape(count, -1).T)
    coefficients = flat.T.reshape(count, 2, 4, 19) * np.sqrt(2 * 19)
    return Modes(coefficients[:, 0], coefficients[:, 1])


def walk(rng, period, frames, *, offset=0.0, noise=5.0, scores=None, modes=None, missing=0.0, jitter=0.0):
    """Angles (frames, 19) of one person: phase (t - offset) / period, NaN in blocks.

    jitter : standard deviation of a stride's time, a share of the period.
    """
    phase = (np.arange(frames) - offset) / period
    if jitter:
        phase = jittered(rng, phase, jitter)
    clean = mean_curves(phase)
    if modes is not None:
        clean = clean + np.einsum("q,qnc->nc", scores, modes.curves(phase))
    angles = clean + rng.normal(scale=noise, size=clean.shape)
    return remove_blocks(rng, angles, missing)


def jittered(rng, phase, jitter):
    """Phases (n,) of strides whose times vary: `phase` counts usual stride times; each stride is uniform."""
    first = np.floor(phase[0])
    count = 2 * int(np.ceil(phase[-1] - first) + 1)  # twice as many as usual: enough if they are short
    times = 1 + jitter * rng.normal(size=count)
    strikes = first + np.concatenate([[0], np.cumsum(times)])
    return np.interp(phase, strikes, first + np.arange(count + 1))


@dataclass
class Outing:
    """A person who stands, starts, walks steadily, then turns and stops; frames [begin, end) are steady."""

    angles: np.ndarray  # (T, 19) radians
    place: np.ndarray  # (T, 2) metres
    yaw: np.ndarray  # (T,) radians
    begin: int
    end: int


def outing(rng, fps=100, period=110, strides=4, stand=1.0, start=1.0, turn=1.2, stop=1.0, noise=0.3):
    """Stand, speed up, walk `strides` of `period` frames, turn right about while slowing down, stand.

    stand, start, turn, stop : seconds of each part; noise in degrees.
    """
    begin = round((stand + start) * fps)
    end = begin + round(strides * period)
    frames = end + round((turn + stop) * fps)
    t = np.arange(frames)
    pace = np.interp(t, [stand * fps, begin, end, end + turn * fps], [0, 1, 1, 0])
    sway = 4 * np.pi * np.cumsum(pace) / period
    yaw = np.interp(t, [end, end + turn * fps], [0, np.pi]) + np.radians(4) * pace * np.sin(sway / 2)
    speed = 1.3 / fps * pace * (1 + 0.1 * np.sin(sway))
    direction = np.interp(t, [end, end + turn * fps], [0, np.pi])
    place = np.cumsum(speed[:, None] * np.stack([np.cos(direction), np.sin(direction)], axis=1), axis=0)
    phase = np.cumsum(pace) / period
    rest = mean_curves(np.arange(GRID) / GRID).mean(axis=0)
    swing = np.minimum(1, 1.5 * pace)[:, None]
    angles = rest + swing * (mean_curves(phase) - rest) + rng.normal(scale=noise, size=(frames, 19))
    return Outing(np.radians(angles), place, yaw, begin, end)


def remove_blocks(rng, values, share, low=8, high=40):
    """Copy of (T, C) with NaN in blocks of one channel each until `share` is missing."""
    result = values.copy()
    while np.isnan(result).mean() < share:
        length = int(rng.integers(low, high + 1))
        start, channel = int(rng.integers(len(result))), int(rng.integers(result.shape[1]))
        result[start : start + length, channel] = np.nan
    return result


def cycle_matrix(rng, rows, modes, noise=1.0, missing=0.2):
    """Cycles (rows, GRID, 19) of rank five, their mask with gaps in blocks, and the scores (rows, 5)."""
    phase = np.arange(GRID) / GRID
    scores = rng.normal(size=(rows, len(SCORE_SD))) * SCORE_SD
    values = mean_curves(phase) + np.einsum("rq,qnc->rnc", scores, modes.curves(phase))
    values += rng.normal(scale=noise, size=values.shape)
    mask = np.ones(values.shape, bool)
    while 1 - mask.mean() < missing:
        length = int(rng.integers(8, 41))
        at = (int(rng.integers(GRID)) + np.arange(length)) % GRID
        mask[int(rng.integers(rows)), at, int(rng.integers(19))] = False
    return values, mask, scores
