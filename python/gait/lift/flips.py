"""Left and right points that may have been exchanged, by how they go on from frame to frame.

A detector that takes one leg for the other exchanges two points.  Their difference then changes its sign
at once, where that of a body goes on as it did.  For every pair the signs are sought that let it go on best:
the Viterbi algorithm over frames, with a Kalman filter of constant velocity along each of two survivors.
Pairs are looked at again with what the others say, because detectors exchange limbs rather than joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.io.keypoints_file import Tracks

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]

LONGEST = 0.3  # seconds without a pair after which nothing tells whether it goes on
CAP = 20.0  # most that a sight says against a sign, -log density: it may be an outlier
RARE = 9.0  # -log probability that an exchange begins or ends from one sight to the next,
OFTEN = 1.0  # where another pair's does,
STAY = 0.4  # and that a sight is not as the other pairs'
ROUNDS = 3  # in which pairs hear of one another
HALF = float(np.sqrt(2 * np.log(2)))  # half of normal noise in a plane is longer, deviations
STEADY = 0.02  # variance of the acceleration's share in a second difference, of its noise, at the least
UNKNOWN = 1e6  # variance over that of a sight where nothing is known
SIGNS = np.array([1.0, -1.0])  # of a difference as it is seen: left and right as they are, exchanged
OTHER = 1.0 - np.eye(2)


def suspected(tracks: Tracks, pairs: Ints, sd: float) -> Flags:
    """In which frames pairs seem exchanged (T, P), against most; frames without a pair go with those before.

    Parameters
    ----------
    pairs : (P, 2)
        Columns of left and right points.
    sd : float
        Noise of a point at full confidence, pixels.
    """
    return _most_probable(_Pairs.of(tracks, pairs, np.asarray(tracks.seen[:, pairs].all(axis=2)), sd))


@dataclass(frozen=True)
class _Pairs:
    """Differences of P pairs over T frames.

    Attributes
    ----------
    time : (T,)
    seen : (T, P)
    apart : (T, P, 2)
        Left less right, pixels; 0 where not seen.
    variance : (T, P)
        Of its noise along an axis.
    acceleration : (P,)
        Variance of its acceleration along an axis, (pixels / s^2)^2.
    """

    time: Floats
    seen: Flags
    apart: Floats
    variance: Floats
    acceleration: Floats

    @classmethod
    def of(cls, tracks: Tracks, pairs: Ints, seen: Flags, sd: float) -> _Pairs:
        """Take pairs (P, 2) of columns out of tracks."""
        apart = np.where(seen[..., None], tracks.uv[:, pairs[:, 0]] - tracks.uv[:, pairs[:, 1]], 0.0)
        variance = np.where(seen, (tracks.deviations(sd)[:, pairs] ** 2).sum(axis=2), 1.0)
        moving = [
            _acceleration(tracks.time[rows], apart[rows, k], variance[rows, k])
            for k, rows in enumerate(seen.T)
        ]
        return cls(tracks.time, seen, apart, variance, np.array(moving))


def _acceleration(time: Floats, apart: Floats, variance: Floats) -> float:
    """Variance of the acceleration of n sights, by how far they lie off the line between their neighbours."""
    if len(time) < 3:
        return 0.0
    step = np.diff(time)
    share = step[:-1] / (time[2:] - time[:-2])
    line = (1 - share)[:, None] * apart[:-2] + share[:, None] * apart[2:]
    noise = np.median(variance[1:-1] + (1 - share) ** 2 * variance[:-2] + share**2 * variance[2:])
    off = np.median(np.sum((apart[1:-1] - line) ** 2, axis=1)) / HALF**2 - noise
    return float(max(off, STEADY * noise) / np.median(step[:-1] * step[1:] / 2) ** 2)


def _most_probable(pairs: _Pairs) -> Flags:
    """Which pairs are exchanged in which frames (T, P)."""
    wrong = _course(pairs, np.zeros(pairs.seen.shape, bool), np.zeros(pairs.seen.shape))
    for _ in range(ROUNDS):
        flips = _flips(wrong, pairs.seen)
        others = flips.sum(axis=1, keepdims=True) > flips
        state, count = (wrong & pairs.seen).sum(axis=1), pairs.seen.sum(axis=1)
        rest = np.maximum(count[:, None] - pairs.seen, 1)
        wrong = _course(pairs, others, (state[:, None] - (wrong & pairs.seen)) / rest)
    return wrong


def _flips(wrong: Flags, seen: Flags) -> Flags:
    """From the sight before until which frames (T, P) an exchange may have begun or ended."""
    found = np.zeros(seen.shape, bool)
    for k, rows in enumerate(seen.T):
        at = np.flatnonzero(rows)
        for i in np.flatnonzero(np.diff(wrong[at, k])):
            found[at[i] + 1 : at[i + 1] + 1, k] = True
    return found


def _course(pairs: _Pairs, easy: Flags, others: Floats) -> Flags:
    """Most probable states (T, P): as the share of `others`, and changing easily where `easy`."""
    count, size = pairs.seen.shape
    filters = _Filters(pairs)
    total = np.tile([0.0, STAY], (size, 1))
    back = np.tile(np.arange(2, dtype=np.int8), (count, size, 1))
    since = np.zeros(size, bool)
    for t, seen in enumerate(pairs.seen):
        since |= easy[t]
        off, square = filters.look(t)
        flip = np.where(since, OFTEN, RARE)[:, None, None] * OTHER
        stay = STAY * np.stack([others[t], 1 - others[t]], axis=1)[:, None]
        table = total[:, :, None] + np.minimum(0.5 * square, CAP) + flip + stay
        before = np.where(seen[:, None], table.argmin(axis=1), [0, 1])
        back[t] = before
        total = np.where(seen[:, None], table.min(axis=1), total)
        filters.learn(t, before, off, square)
        since &= ~seen
    state = total.argmin(axis=1)
    found = np.empty((count, size), bool)
    for t in range(count - 1, -1, -1):
        found[t] = state == 1
        state = back[t, np.arange(size), state]
    return found


class _Filters:
    """Kalman filters of P pairs under two survivors, of the same covariance: not exchanged now, exchanged."""

    def __init__(self, pairs: _Pairs) -> None:
        size = pairs.seen.shape[1]
        self._pairs, self._every = pairs, np.arange(size)
        self._place, self._velocity = np.zeros((size, 2, 2)), np.zeros((size, 2, 2))
        self._last = np.full(size, -np.inf)
        self._p = self._c = self._v = np.zeros(size)

    def look(self, t: int) -> tuple[Floats, Floats]:
        """Move on to a frame; how far its sights are off (P, before, now, 2), and squared in deviations."""
        dt = self._pairs.time[t] - self._last
        known, noise = dt <= LONGEST, self._pairs.variance[t]
        dt = np.where(known, dt, 0.0)
        p, c, v, q = self._p, self._c, self._v, self._pairs.acceleration
        self._moved = (
            np.where(known, p + 2 * dt * c + dt**2 * v + q * dt**4 / 4, UNKNOWN * noise),
            np.where(known, c + dt * v + q * dt**3 / 2, 0.0),
            np.where(known, v + q * dt**2, UNKNOWN * noise),
        )
        self._said = self._place + dt[:, None, None] * self._velocity
        off = SIGNS[:, None] * self._pairs.apart[t][:, None, None] - self._said[:, :, None]
        return off, (off**2).sum(axis=3) / (self._moved[0] + noise)[:, None, None]

    def learn(self, t: int, before: npt.NDArray[np.intp], off: Floats, square: Floats) -> None:
        """Go on with what was seen, from the survivor `before` each of the two (P, 2)."""
        seen, noise = self._pairs.seen[t], self._pairs.variance[t]
        p, c, v = self._moved
        pick = (self._every[:, None], before, np.arange(2))
        trusted = (square[pick] < 2 * CAP)[..., None]  # others are outliers under this survivor
        gain, quick = ((x / (p + noise))[:, None, None] * trusted for x in (p, c))
        place = self._said[pick[:2]] + gain * off[pick]
        velocity = self._velocity[pick[:2]] + quick * off[pick]
        self._place = np.where(seen[:, None, None], place, self._place)
        self._velocity = np.where(seen[:, None, None], velocity, self._velocity)
        left = (p - p * p / (p + noise), c - p * c / (p + noise), v - c * c / (p + noise))
        self._p, self._c, self._v = (
            np.where(seen, new, old) for new, old in zip(left, (self._p, self._c, self._v), strict=True)
        )
        self._last = np.where(seen, self._pairs.time[t], self._last)
