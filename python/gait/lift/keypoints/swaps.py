"""Left and right points that may have been swapped, from their motion between frames.

A detector that takes one leg for the other swaps two points.  Their difference then changes its sign
at once, where that of a body goes on as it did.  For every pair the signs are sought that let it go on best:
the Viterbi algorithm over frames, with a Kalman filter of constant velocity along each of two survivors.
Pairs are examined again with the results of the others, because detectors swap limbs rather than joints.

Left and right in 2-D keypoints: points that a detector swapped for some frames, put back.

How points go on from frame to frame proposes where (`gait.lift.flips`); outliers and quick steps look
like swaps too.  The motion decides: every interval is lifted with its surroundings, swapped and as it
is, and limb by limb, and what fits clearly better is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gait.io.keypoints_file import Keypoints
from gait.lift.keypoints import noise

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]

LONGEST = 0.3  # seconds without a pair after which its continuation is unknown
CAP = 20.0  # largest -log density of an observation under a sign: it may be an outlier
RARE = 9.0  # -log probability that an swap begins or ends from one observation to the next,
OFTEN = 1.0  # where another pair's does,
STAY = 0.4  # and that a observation is not as the other pairs'
ROUNDS = 3  # in which pairs hear of one another
HALF = float(np.sqrt(2 * np.log(2)))  # half of normal noise in a plane is longer, standard deviations
STEADY = 0.02  # variance of the acceleration's share in a second difference, of its noise, at the least
UNKNOWN = 1e6  # variance over that of a observation where nothing is known
SIGNS = np.array([1.0, -1.0])  # of a difference as it is seen: left and right as they are, swapped
OTHER = 1.0 - np.eye(2)


def suspected(keypoints: Keypoints, pairs: Ints, sd: float) -> Flags:
    """In which frames pairs seem swapped (T, P), against most; frames without a pair go with those before.

    Parameters
    ----------
    pairs : (P, 2)
        Columns of left and right points.
    sd : float
        Noise of a point at full confidence, pixels.
    """
    return _most_probable(
        _Pairs.of(keypoints, pairs, np.asarray(keypoints.visible[:, pairs].all(axis=2)), sd)
    )


@dataclass(frozen=True)
class _Pairs:
    """Differences of P pairs over T frames.

    Attributes
    ----------
    time : (T,)
    visible : (T, P)
    apart : (T, P, 2)
        Left less right, pixels; 0 where not seen.
    variance : (T, P)
        Of its noise along an axis.
    acceleration : (P,)
        Variance of its acceleration along an axis, (pixels / s^2)^2.
    """

    time: Floats
    visible: Flags
    apart: Floats
    variance: Floats
    acceleration: Floats

    @classmethod
    def of(cls, keypoints: Keypoints, pairs: Ints, observed: Flags, sd: float) -> _Pairs:
        """Take pairs (P, 2) of columns out of keypoints."""
        apart = np.where(
            observed[..., None], keypoints.uv[:, pairs[:, 0]] - keypoints.uv[:, pairs[:, 1]], 0.0
        )
        variance = np.where(observed, (keypoints.standard_deviations(sd)[:, pairs] ** 2).sum(axis=2), 1.0)
        moving = [
            _acceleration(keypoints.time[rows], apart[rows, k], variance[rows, k])
            for k, rows in enumerate(observed.T)
        ]
        return cls(keypoints.time, observed, apart, variance, np.array(moving))


def _acceleration(time: Floats, apart: Floats, variance: Floats) -> float:
    """Variance of the acceleration, by how far n observations lie off the line between their neighbours."""
    if len(time) < 3:
        return 0.0
    step = np.diff(time)
    share = step[:-1] / (time[2:] - time[:-2])
    line = (1 - share)[:, None] * apart[:-2] + share[:, None] * apart[2:]
    noise = np.median(variance[1:-1] + (1 - share) ** 2 * variance[:-2] + share**2 * variance[2:])
    off = np.median(np.sum((apart[1:-1] - line) ** 2, axis=1)) / HALF**2 - noise
    return float(max(off, STEADY * noise) / np.median(step[:-1] * step[1:] / 2) ** 2)


def _most_probable(pairs: _Pairs) -> Flags:
    """Which pairs are swapped in which frames (T, P)."""
    wrong = _course(pairs, np.zeros(pairs.visible.shape, bool), np.zeros(pairs.visible.shape))
    for _ in range(ROUNDS):
        flips = _flips(wrong, pairs.visible)
        others = flips.sum(axis=1, keepdims=True) > flips
        state, count = (wrong & pairs.visible).sum(axis=1), pairs.visible.sum(axis=1)
        rest = np.maximum(count[:, None] - pairs.visible, 1)
        wrong = _course(pairs, others, (state[:, None] - (wrong & pairs.visible)) / rest)
    return wrong


def _flips(wrong: Flags, observed: Flags) -> Flags:
    """From the observation before until which frames (T, P) an swap may have begun or ended."""
    found = np.zeros(observed.shape, bool)
    for k, rows in enumerate(observed.T):
        at = np.flatnonzero(rows)
        for i in np.flatnonzero(np.diff(wrong[at, k])):
            found[at[i] + 1 : at[i + 1] + 1, k] = True
    return found


def _course(pairs: _Pairs, easy: Flags, others: Floats) -> Flags:
    """Most probable states (T, P): as the share of `others`, and changing easily where `easy`."""
    count, size = pairs.visible.shape
    filters = _Filters(pairs)
    total = np.tile([0.0, STAY], (size, 1))
    back = np.tile(np.arange(2, dtype=np.int8), (count, size, 1))
    since = np.zeros(size, bool)
    for t, observed in enumerate(pairs.visible):
        since |= easy[t]
        off, square = filters.predict(t)
        flip = np.where(since, OFTEN, RARE)[:, None, None] * OTHER
        stay = STAY * np.stack([others[t], 1 - others[t]], axis=1)[:, None]
        table = total[:, :, None] + np.minimum(0.5 * square, CAP) + flip + stay
        before = np.where(observed[:, None], table.argmin(axis=1), [0, 1])
        back[t] = before
        total = np.where(observed[:, None], table.min(axis=1), total)
        filters.learn(t, before, off, square)
        since &= ~observed
    state = total.argmin(axis=1)
    found = np.empty((count, size), bool)
    for t in range(count - 1, -1, -1):
        found[t] = state == 1
        state = back[t, np.arange(size), state]
    return found


class _Filters:
    """Kalman filters of P pairs under two survivors, of the same covariance: not swapped now, swapped."""

    def __init__(self, pairs: _Pairs) -> None:
        size = pairs.visible.shape[1]
        self._pairs, self._every = pairs, np.arange(size)
        self._place, self._velocity = np.zeros((size, 2, 2)), np.zeros((size, 2, 2))
        self._last = np.full(size, -np.inf)
        self._p = self._c = self._v = np.zeros(size)

    def predict(self, t: int) -> tuple[Floats, Floats]:
        """Predict a frame: errors of its observations (P, before, now, 2), and squared in variances."""
        dt = self._pairs.time[t] - self._last
        known, noise = dt <= LONGEST, self._pairs.variance[t]
        dt = np.where(known, dt, 0.0)
        p, c, v, q = self._p, self._c, self._v, self._pairs.acceleration
        self._moved = (
            np.where(known, p + 2 * dt * c + dt**2 * v + q * dt**4 / 4, UNKNOWN * noise),
            np.where(known, c + dt * v + q * dt**3 / 2, 0.0),
            np.where(known, v + q * dt**2, UNKNOWN * noise),
        )
        self._predicted = self._place + dt[:, None, None] * self._velocity
        off = SIGNS[:, None] * self._pairs.apart[t][:, None, None] - self._predicted[:, :, None]
        return off, (off**2).sum(axis=3) / (self._moved[0] + noise)[:, None, None]

    def learn(self, t: int, before: npt.NDArray[np.intp], off: Floats, square: Floats) -> None:
        """Go on with what was seen, from the survivor `before` each of the two (P, 2)."""
        observed, noise = self._pairs.visible[t], self._pairs.variance[t]
        p, c, v = self._moved
        pick = (self._every[:, None], before, np.arange(2))
        trusted = (square[pick] < 2 * CAP)[..., None]  # others are outliers under this survivor
        gain, quick = ((x / (p + noise))[:, None, None] * trusted for x in (p, c))
        place = self._predicted[pick[:2]] + gain * off[pick]
        velocity = self._velocity[pick[:2]] + quick * off[pick]
        self._place = np.where(observed[:, None, None], place, self._place)
        self._velocity = np.where(observed[:, None, None], velocity, self._velocity)
        left = (p - p * p / (p + noise), c - p * c / (p + noise), v - c * c / (p + noise))
        self._p, self._c, self._v = (
            np.where(observed, new, old) for new, old in zip(left, (self._p, self._c, self._v), strict=True)
        )
        self._last = np.where(observed, self._pairs.time[t], self._last)


SLOWEST = 0.11  # seconds from frame to frame: with longer steps strides are steps of the other leg
MOST = 1 / 3  # of a pair's frames: of more it is open which are right
AROUND = 1.0  # seconds before and after an interval in which its readings are compared
NEAR = 0.5  # seconds between intervals that are judged as one
LIMBS = (("hip", "knee", "ankle", "heel", "toe"), ("shoulder", "elbow", "wrist", "hand"))
CLEAR = 9.0  # log-evidence that an swap must gain, each pair


class Reading(NamedTuple):
    """Keypoints as a model of motion reads them.

    Attributes
    ----------
    density : float
        Logarithm, but for a constant.
    predicted : (T, P, 2)
        Where the motion has the points, pixels.
    motion : object
        For the model to begin with from.
    """

    density: float
    predicted: Floats
    motion: Any = None


#: Read keypoints, from scratch or beginning with the motion of a reading that is nearly the same.
Evidence = Callable[[Keypoints, Reading | None], Reading]


@dataclass(frozen=True)
class Swapped:
    """Frames in which left and right of a joint were swapped.

    Attributes
    ----------
    joint : str
        Without its side.
    spans : list of (int, int)
        First and last frame of each interval.
    """

    joint: str
    spans: list[tuple[int, int]]


def undo_swaps(keypoints: Keypoints, sd: float, evidence: Evidence) -> tuple[Keypoints, list[Swapped]]:
    """Put left and right points back where they were swapped in few frames; most are taken to be right.

    Parameters
    ----------
    sd : float
        Noise of a point at full confidence, pixels.
    evidence : callable
        Model of the motion, for some frames of keypoints.
    """
    joints = [
        name[2:] for name in keypoints.names if name.startswith("l_") and f"r_{name[2:]}" in keypoints.names
    ]
    if not joints or len(keypoints.time) < 3 or np.median(np.diff(keypoints.time)) > SLOWEST:
        return keypoints, []
    pairs = np.array([[keypoints.names.index(f"{side}_{joint}") for side in "lr"] for joint in joints])
    observed = np.asarray(keypoints.visible[:, pairs].any(axis=2))
    steady = _without_spikes(keypoints, pairs, sd)
    wrong = _completed(keypoints, pairs, steady, suspected(steady, pairs, sd)) & observed
    wrong &= wrong.sum(axis=0) <= MOST * observed.sum(axis=0)
    for first, end in list(_intervals(keypoints, wrong)):
        part = _around(keypoints, first, end)
        own = slice(first - part.start, end - part.start)
        shown = steady.part(part), pairs, observed[part]
        wrong[first:end] = _judged(*shown, wrong[part], own, sd, evidence)[own]
    found = [
        Swapped(joint, _spans(keypoints.frame[observed[:, k]], wrong[observed[:, k], k]))
        for k, joint in enumerate(joints)
        if wrong[:, k].any()
    ]
    return _swapped(keypoints, pairs, wrong), found


def _without_spikes(keypoints: Keypoints, pairs: Ints, sd: float) -> Keypoints:
    """Keypoints without the points that jump whichever side they are of: they would decide the rest's."""
    kept, _ = noise.without_spikes(keypoints, sd)
    jumped = np.asarray((keypoints.visible & ~kept.visible)[:, pairs].any(axis=2))
    other, _ = noise.without_spikes(_swapped(keypoints, pairs, jumped), sd)
    some = kept.visible | _swapped(other, pairs, jumped).visible
    return replace(keypoints, uv=np.where(some[..., None], keypoints.uv, np.nan))


def _completed(keypoints: Keypoints, pairs: Ints, steady: Keypoints, wrong: Flags) -> Flags:
    """Flag (T, P) also pairs that are not whole in steady keypoints, where one before or after is wrong.

    They are as they lie nearer to the lines between those around; by distances, as one may be anywhere or
    not be seen.
    """
    found, put = wrong.copy(), _swapped(steady, pairs, wrong).uv
    for k, known in enumerate(steady.visible[:, pairs].all(axis=2).T):
        rows, others = np.flatnonzero(known), np.flatnonzero(~known)
        if not rows.size:
            continue
        lines = np.stack([_along(keypoints.time, rows, put[:, side])[others] for side in pairs[k]], axis=1)
        observed = keypoints.uv[np.ix_(others, pairs[k])]
        kept, other = (
            np.nansum(np.linalg.norm(observed - line, axis=2), axis=1) for line in (lines, lines[:, ::-1])
        )
        after = np.searchsorted(rows, others)
        beside = wrong[rows[np.maximum(after - 1, 0)], k] | wrong[rows[np.minimum(after, len(rows) - 1)], k]
        found[others, k] = beside & (other < kept)
    return found


def _along(time: Floats, rows: Ints, uv: Floats) -> Floats:
    """Places (T, 2) of a point on the lines between those of some rows."""
    return np.stack([np.interp(time, time[rows], axis[rows]) for axis in uv.T], axis=1)


def _intervals(keypoints: Keypoints, wrong: Flags) -> Iterator[tuple[int, int]]:
    """First row, and the one after the last, of intervals with `wrong` pairs further apart than `NEAR`."""
    rows = np.flatnonzero(wrong.any(axis=1))
    parts = np.split(rows, np.flatnonzero(np.diff(keypoints.time[rows]) > NEAR) + 1)
    return ((int(part[0]), int(part[-1]) + 1) for part in parts if part.size)


def _around(keypoints: Keypoints, first: int, end: int) -> slice:
    """Rows of an interval and its surroundings."""
    begin = np.searchsorted(keypoints.time, keypoints.time[first] - AROUND)
    return slice(int(begin), int(np.searchsorted(keypoints.time, keypoints.time[end - 1] + AROUND, "right")))


def _swapped(keypoints: Keypoints, pairs: Ints, wrong: Flags) -> Keypoints:
    """Keypoints with the two points of pairs (P, 2) swapped where `wrong` (T, P)."""
    uv, confidence = keypoints.uv.copy(), keypoints.confidence.copy()
    for pair, rows in zip(pairs, wrong.T, strict=True):
        for values in (uv, confidence):
            values[np.ix_(rows, pair)] = values[np.ix_(rows, pair[::-1])]
    return replace(keypoints, uv=uv, confidence=confidence)


def _judged(
    keypoints: Keypoints,
    pairs: Ints,
    observed: Flags,
    wrong: Flags,
    own: slice,
    sd: float,
    evidence: Evidence,
) -> Flags:
    """Take in `own` rows of a proposal (T, P) what the motion confirms: all or nothing, then each limb.

    Where something was swapped, other pairs may have been along with it for as long.  What the best motion so
    far explains no better than before is not tried; what it explains better is fitted beginning with it.
    """
    sds = keypoints.standard_deviations(sd)

    def score(flags: Flags, near: Reading | None = None) -> tuple[float, Reading]:
        found = evidence(_swapped(keypoints, pairs, flags), near)
        return found.density - CLEAR * int(flags[own].any(axis=0).sum()), found

    def cost(flags: Flags) -> float:
        off = _swapped(keypoints, pairs, flags).uv - motion.predicted
        return float(np.nansum(np.minimum(0.5 * (off**2).sum(axis=2) / sds**2, CAP)))

    best = wrong.copy()
    best[own] = False
    most, motion = score(best)
    proposed = score(wrong)
    if proposed[0] > most:
        best, (most, motion) = wrong.copy(), proposed
    for limb in _limbs(keypoints, pairs):
        for flags in _others(best[own], wrong[own], observed[own], limb):
            other = best.copy()
            other[own] = flags
            if (other == best).all() or (other == wrong).all():
                continue
            if best.any() and not cost(other) < cost(best):
                continue
            changed = score(other, motion if best.any() else None)
            if changed[0] > most:
                best, (most, motion) = other, changed
    return best


def _limbs(keypoints: Keypoints, pairs: Ints) -> list[Ints]:
    """Pairs of legs, of arms and of the rest."""
    joints = [keypoints.names[left][2:] for left in pairs[:, 0]]
    limb = np.array([next((k for k, limb in enumerate(LIMBS) if joint in limb), -1) for joint in joints])
    return [np.flatnonzero(limb == k) for k in np.unique(limb)]


def _others(best: Flags, wrong: Flags, observed: Flags, limb: Ints) -> Iterator[Flags]:
    """Vary the best reading: with none of a limb, with it as proposed, and with all of it."""
    proposed = np.asarray(wrong[:, limb].any(axis=1))
    whole = observed[:, limb] & np.asarray(proposed if proposed.any() else wrong.any(axis=1))[:, None]
    none = np.zeros_like(whole)
    for flags in (none, wrong[:, limb], whole) if best.any() else (wrong[:, limb],):
        other = best.copy()
        other[:, limb] = flags
        yield other


def _spans(frames: npt.NDArray[np.int64], wrong: Flags) -> list[tuple[int, int]]:
    """First and last of the frames (n,) in each interval of `wrong` ones."""
    edges = np.flatnonzero(np.diff(np.pad(wrong.astype(int), 1))).reshape(-1, 2)
    return [(int(frames[first]), int(frames[end - 1])) for first, end in edges]
