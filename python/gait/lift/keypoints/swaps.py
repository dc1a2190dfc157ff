"""Find left and right points that a detector swapped for some frames, and put them back.

A detector that mistakes one leg for the other swaps two points.  Their difference then suddenly changes its
sign, while that of a body continues smoothly.  `suspected` finds for every pair the signs with the smoothest
motion, by the Viterbi algorithm over frames, with a Kalman filter of constant velocity for each of the two
survivors.  Pairs are examined again with the results of the others, since detectors swap limbs rather than
joints.

Outliers and quick steps look like swaps too, so in `undo_swaps` the motion decides: every interval is lifted
with its surroundings, as it is, swapped, and with single limbs swapped, and the best is kept if it is clearly
better.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import side_pairs
from gait.io.keypoints_file import Keypoints
from gait.lift.keypoints import noise

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]

LONGEST_BREAK_S = 0.3  # seconds without a pair after which its continuation is unknown
CAP = 20.0  # largest -log density of an observation, which may be an outlier
RARE = 9.0  # -log probability that a swap begins or ends between two observations,
SWAP_RATE_AFTER_OTHER = 1.0  # the same where another pair's does,
STAY = 0.4  # and -log probability that an observation differs from the other pairs'
PAIR_PASSES = 3  # passes, in each of which pairs use the others' results
HALF = float(np.sqrt(2 * np.log(2)))  # median length of normal noise in a plane, standard deviations
#: Least variance of the acceleration in second differences, relative to that of the noise.
LEAST_ACCELERATION = 0.02
UNKNOWN = 1e6  # variance, relative to an observation's, where nothing is known
SIGNS = np.array([1.0, -1.0])  # of an observed difference: as it is, swapped
SWITCHED = 1.0 - np.eye(2)


def suspected(keypoints: Keypoints, pairs: Ints, sd: float) -> Flags:
    """Find frames (T, P) in which pairs seem swapped, unlike in most; frames without a pair follow the last.

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
        Left minus right, pixels; 0 where not seen.
    variance : (T, P)
        Variance of its noise along an axis.
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
        """Extract pairs (P, 2) of columns from keypoints."""
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
    """Estimate the variance of the acceleration from distances of observations to their neighbours' line."""
    if len(time) < 3:
        return 0.0
    step = np.diff(time)
    share = step[:-1] / (time[2:] - time[:-2])
    line = (1 - share)[:, None] * apart[:-2] + share[:, None] * apart[2:]
    noise = np.median(variance[1:-1] + (1 - share) ** 2 * variance[:-2] + share**2 * variance[2:])
    off = np.median(np.sum((apart[1:-1] - line) ** 2, axis=1)) / HALF**2 - noise
    return float(max(off, LEAST_ACCELERATION * noise) / np.median(step[:-1] * step[1:] / 2) ** 2)


def _most_probable(pairs: _Pairs) -> Flags:
    """Find the most probable frames (T, P) in which pairs are swapped."""
    wrong = _course(pairs, np.zeros(pairs.visible.shape, bool), np.zeros(pairs.visible.shape))
    for _ in range(PAIR_PASSES):
        flips = _flips(wrong, pairs.visible)
        others = flips.sum(axis=1, keepdims=True) > flips
        state, count = (wrong & pairs.visible).sum(axis=1), pairs.visible.sum(axis=1)
        rest = np.maximum(count[:, None] - pairs.visible, 1)
        wrong = _course(pairs, others, (state[:, None] - (wrong & pairs.visible)) / rest)
    return wrong


def _flips(wrong: Flags, observed: Flags) -> Flags:
    """Mark the frames (T, P) in which a swap may have begun or ended, since the observation before."""
    found = np.zeros(observed.shape, bool)
    for k, rows in enumerate(observed.T):
        at = np.flatnonzero(rows)
        for i in np.flatnonzero(np.diff(wrong[at, k])):
            found[at[i] + 1 : at[i + 1] + 1, k] = True
    return found


def _course(pairs: _Pairs, easy: Flags, others: Floats) -> Flags:
    """Find the most probable states (T, P), preferring those of `others`, with cheap changes where `easy`."""
    count, size = pairs.visible.shape
    filters = _Filters(pairs)
    total = np.tile([0.0, STAY], (size, 1))
    back = np.tile(np.arange(2, dtype=np.int8), (count, size, 1))
    since = np.zeros(size, bool)
    for t, observed in enumerate(pairs.visible):
        since |= easy[t]
        off, square = filters.predict(t)
        flip = np.where(since, SWAP_RATE_AFTER_OTHER, RARE)[:, None, None] * SWITCHED
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
    """Kalman filters of P pairs for two survivors, not swapped now and swapped, with the same covariance."""

    def __init__(self, pairs: _Pairs) -> None:
        size = pairs.visible.shape[1]
        self._pairs, self._every = pairs, np.arange(size)
        self._place, self._velocity = np.zeros((size, 2, 2)), np.zeros((size, 2, 2))
        self._last = np.full(size, -np.inf)
        self._p = self._c = self._v = np.zeros(size)

    def predict(self, t: int) -> tuple[Floats, Floats]:
        """Predict a frame; return errors of observations (P, before, now, 2), and squares in variances."""
        dt = self._pairs.time[t] - self._last
        known, noise = dt <= LONGEST_BREAK_S, self._pairs.variance[t]
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
        """Update the two survivors with the observation, each from its predecessor `before` (P, 2)."""
        observed, noise = self._pairs.visible[t], self._pairs.variance[t]
        p, c, v = self._moved
        pick = (self._every[:, None], before, np.arange(2))
        trusted = (square[pick] < 2 * CAP)[..., None]  # others are outliers for this survivor
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


SLOWEST = 0.11  # seconds from frame to frame; with longer steps a step looks like a swap
MOST_SWAPPED_SHARE = 1 / 3  # of a pair's frames; if more are swapped, it is unknown which are right
SECONDS_AROUND = 1.0  # seconds before and after an interval that are lifted with it
NEAR_INTERVALS_S = 0.5  # seconds between intervals that are judged together
LIMB_JOINTS = (("hip", "knee", "ankle", "heel", "toe"), ("shoulder", "elbow", "wrist", "hand"))
SWAP_EVIDENCE = 9.0  # log evidence that a swap must gain for each pair


class Reading(NamedTuple):
    """Result of fitting a model of motion to keypoints.

    Attributes
    ----------
    density : float
        Log density of the keypoints, up to a constant.
    predicted : (T, P, 2)
        Predicted points, pixels.
    motion : object
        Motion from which the model can start for similar keypoints.
    """

    density: float
    predicted: Floats
    motion: Any = None


#: Fits a model of motion to keypoints, from scratch or from the motion of a reading of similar keypoints.
Evidence = Callable[[Keypoints, Reading | None], Reading]


@dataclass(frozen=True)
class Swapped:
    """Frames in which left and right of a joint were swapped.

    Attributes
    ----------
    joint : str
        Name without its side.
    spans : list of (int, int)
        First and last frame of each interval.
    """

    joint: str
    spans: list[tuple[int, int]]


def undo_swaps(keypoints: Keypoints, sd: float, evidence: Evidence) -> tuple[Keypoints, list[Swapped]]:
    """Undo swaps of left and right points in a few frames, assuming that most frames are right.

    Parameters
    ----------
    sd : float
        Noise of a point at full confidence, pixels.
    evidence : callable
        Model of the motion, called with some frames of the keypoints.
    """
    joints, pairs = _paired(keypoints)
    if not joints:
        return keypoints, []
    observed = np.asarray(keypoints.visible[:, pairs].any(axis=2))
    steady, _ = without_spikes(keypoints, sd)
    wrong = _completed(keypoints, pairs, steady, suspected(steady, pairs, sd)) & observed
    wrong &= wrong.sum(axis=0) <= MOST_SWAPPED_SHARE * observed.sum(axis=0)
    for first, end in list(_intervals(keypoints, wrong)):
        part = _around(keypoints, first, end)
        own = slice(first - part.start, end - part.start)
        shown = steady.part(part), pairs, observed[part]
        wrong[first:end] = _judged(*shown, wrong[part], own, sd, evidence)[own]
    after = _swapped(keypoints, pairs, wrong)
    return after, swapped_between(keypoints, after)


def swapped_between(before: Keypoints, after: Keypoints) -> list[Swapped]:
    """List what was swapped between two states of the same keypoints."""
    joints, pairs = _paired(before)
    observed = np.asarray(before.visible[:, pairs].any(axis=2))
    same = np.isclose(before.uv[:, pairs], after.uv[:, pairs], rtol=0, atol=0, equal_nan=True)
    wrong = ~same.all(axis=(2, 3)) & observed
    return [
        Swapped(joint, _spans(before.frame[observed[:, k]], wrong[observed[:, k], k]))
        for k, joint in enumerate(joints)
        if wrong[:, k].any()
    ]


def share_suspected(keypoints: Keypoints, sd: float) -> float:
    """Share of pairs of left and right points that seem swapped, against most; `sd` as for `undo_swaps`."""
    joints, pairs = _paired(keypoints)
    if not joints:
        return 0.0
    observed = np.asarray(keypoints.visible[:, pairs].all(axis=2))
    return float((suspected(keypoints, pairs, sd) & observed).sum() / max(observed.sum(), 1))


def _paired(keypoints: Keypoints) -> tuple[list[str], Ints]:
    """Joints that have both sides, and their columns (P, 2); none if frames are too few or too far apart."""
    slow = len(keypoints.time) < 3 or np.median(np.diff(keypoints.time)) > SLOWEST
    columns = [] if slow else side_pairs(keypoints.names)
    joints = [keypoints.names[left][2:] for left, _ in columns]
    return joints, np.array(columns, np.intp).reshape(-1, 2)


def without_spikes(keypoints: Keypoints, sd: float) -> tuple[Keypoints, list[tuple[int, str]]]:
    """Remove points that are spikes on whichever side they are, so that none is removed for being swapped.

    Returns what `noise.without_spikes` does.
    """
    _, pairs = _paired(keypoints)
    kept, spikes = noise.without_spikes(keypoints, sd)
    jumped = np.asarray((keypoints.visible & ~kept.visible)[:, pairs].any(axis=2))
    other, _ = noise.without_spikes(_swapped(keypoints, pairs, jumped), sd)
    some = kept.visible | _swapped(other, pairs, jumped).visible
    column = {name: j for j, name in enumerate(keypoints.names)}
    row = {frame: t for t, frame in enumerate(keypoints.frame.tolist())}
    spikes = [(frame, name) for frame, name in spikes if not some[row[frame], column[name]]]
    return replace(keypoints, uv=np.where(some[..., None], keypoints.uv, np.nan)), spikes


def _completed(keypoints: Keypoints, pairs: Ints, steady: Keypoints, wrong: Flags) -> Flags:
    """Also flag (T, P) pairs that are incomplete in the steady keypoints, next to a swapped pair.

    They count as swapped if their points are then nearer to the lines between those around.  Plain distances
    are compared, as one point may be anywhere or missing.
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
    """Interpolate the positions (T, 2) of a point between those of some rows."""
    return np.stack([np.interp(time, time[rows], axis[rows]) for axis in uv.T], axis=1)


def _intervals(keypoints: Keypoints, wrong: Flags) -> Iterator[tuple[int, int]]:
    """Yield first row, and row after the last, of intervals with `wrong` pairs, `NEAR_INTERVALS_S` apart."""
    rows = np.flatnonzero(wrong.any(axis=1))
    parts = np.split(rows, np.flatnonzero(np.diff(keypoints.time[rows]) > NEAR_INTERVALS_S) + 1)
    return ((int(part[0]), int(part[-1]) + 1) for part in parts if part.size)


def _around(keypoints: Keypoints, first: int, end: int) -> slice:
    """Return the rows of an interval and its surroundings."""
    begin = np.searchsorted(keypoints.time, keypoints.time[first] - SECONDS_AROUND)
    return slice(
        int(begin), int(np.searchsorted(keypoints.time, keypoints.time[end - 1] + SECONDS_AROUND, "right"))
    )


def _swapped(keypoints: Keypoints, pairs: Ints, wrong: Flags) -> Keypoints:
    """Swap the two points of pairs (P, 2) where `wrong` (T, P)."""
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
    """Accept from `own` rows of a proposal (T, P) what the motion confirms: all or nothing, then each limb.

    Where one pair was swapped, other pairs may have been swapped with it for as long.  Variations that the
    best motion so far does not explain better are not tried; the others are fitted, starting from that
    motion.
    """
    sds = keypoints.standard_deviations(sd)

    def score(flags: Flags, near: Reading | None = None) -> tuple[float, Reading]:
        found = evidence(_swapped(keypoints, pairs, flags), near)
        return found.density - SWAP_EVIDENCE * int(flags[own].any(axis=0).sum()), found

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
    """Group the pairs: legs, arms, and the others."""
    joints = [keypoints.names[left][2:] for left in pairs[:, 0]]
    limb = np.array(
        [next((k for k, limb in enumerate(LIMB_JOINTS) if joint in limb), -1) for joint in joints]
    )
    return [np.flatnonzero(limb == k) for k in np.unique(limb)]


def _others(best: Flags, wrong: Flags, observed: Flags, limb: Ints) -> Iterator[Flags]:
    """Yield variations of the best flags: none of a limb, the limb as proposed, and all of it."""
    proposed = np.asarray(wrong[:, limb].any(axis=1))
    whole = observed[:, limb] & np.asarray(proposed if proposed.any() else wrong.any(axis=1))[:, None]
    none = np.zeros_like(whole)
    for flags in (none, wrong[:, limb], whole) if best.any() else (wrong[:, limb],):
        other = best.copy()
        other[:, limb] = flags
        yield other


def _spans(frames: npt.NDArray[np.int64], wrong: Flags) -> list[tuple[int, int]]:
    """List first and last frame of each interval of `wrong` frames among `frames` (n,)."""
    edges = np.flatnonzero(np.diff(np.pad(wrong.astype(int), 1))).reshape(-1, 2)
    return [(int(frames[first]), int(frames[end - 1])) for first, end in edges]
