"""Left and right in 2-D tracks: points that a detector exchanged for some frames, put back.

How points go on from frame to frame proposes where (`gait.lift.flips`); wild points and quick steps look
like exchanges too.  The motion decides: every stretch is lifted with its surroundings, exchanged and as it
is, and limb by limb, and what fits clearly better is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gait.lift import flips, outliers
from gait.lift.flips import Flags, Floats, Ints
from gait.io.keypoints_file import Tracks

SLOWEST = 0.11  # seconds from frame to frame: with longer steps strides are steps of the other leg
MOST = 1 / 3  # of a pair's frames: of more it is open which are right
AROUND = 1.0  # seconds before and after a stretch that tell which reading of it goes on better
NEAR = 0.5  # seconds between stretches that are judged as one
LIMBS = (("hip", "knee", "ankle", "heel", "toe"), ("shoulder", "elbow", "wrist", "hand"))
CLEAR = 9.0  # log-evidence that an exchange must gain, each pair

#: Log density of tracks by the model of motion.
Evidence = Callable[[Tracks], float]


@dataclass(frozen=True)
class Exchanged:
    """Frames in which left and right of a joint were exchanged.

    Attributes
    ----------
    joint : str
        Without its side.
    spans : list of (int, int)
        First and last frame of each stretch.
    """

    joint: str
    spans: list[tuple[int, int]]


def put_back(tracks: Tracks, sd: float, evidence: Evidence) -> tuple[Tracks, list[Exchanged]]:
    """Put left and right points back where they were exchanged in few frames; most are taken to be right.

    Parameters
    ----------
    sd : float
        Noise of a point at full confidence, pixels.
    evidence : callable
        Logarithm of the density of some frames of tracks by a model of the motion, but for a constant.
    """
    joints = [name[2:] for name in tracks.names if name.startswith("l_") and f"r_{name[2:]}" in tracks.names]
    if not joints or len(tracks.time) < 3 or np.median(np.diff(tracks.time)) > SLOWEST:
        return tracks, []
    pairs = np.array([[tracks.names.index(f"{side}_{joint}") for side in "lr"] for joint in joints])
    seen = np.asarray(tracks.seen[:, pairs].any(axis=2))
    steady = _without_jumps(tracks, pairs, sd)
    wrong = _completed(tracks, pairs, steady, flips.suspected(steady, pairs, sd)) & seen
    wrong &= wrong.sum(axis=0) <= MOST * seen.sum(axis=0)
    for first, end in list(_stretches(tracks, wrong)):
        part = _around(tracks, first, end)
        own = slice(first - part.start, end - part.start)
        wrong[first:end] = _judged(_rows(steady, part), pairs, wrong[part], seen[part], own, evidence)[own]
    found = [
        Exchanged(joint, _spans(tracks.frame[seen[:, k]], wrong[seen[:, k], k]))
        for k, joint in enumerate(joints)
        if wrong[:, k].any()
    ]
    return _swapped(tracks, pairs, wrong), found


def _without_jumps(tracks: Tracks, pairs: Ints, sd: float) -> Tracks:
    """Tracks without the points that jump whichever side they are of: they would decide the rest's."""
    kept, _ = outliers.without_jumps(tracks, sd)
    jumped = np.asarray((tracks.seen & ~kept.seen)[:, pairs].any(axis=2))
    other, _ = outliers.without_jumps(_swapped(tracks, pairs, jumped), sd)
    some = kept.seen | _swapped(other, pairs, jumped).seen
    return replace(tracks, uv=np.where(some[..., None], tracks.uv, np.nan))


def _completed(tracks: Tracks, pairs: Ints, steady: Tracks, wrong: Flags) -> Flags:
    """Flag (T, P) also pairs that are not whole in steady tracks, where one before or after is wrong.

    They are as they lie nearer to the lines between those around; by distances, as one may be anywhere or
    not be seen.
    """
    found, put = wrong.copy(), _swapped(steady, pairs, wrong).uv
    for k, known in enumerate(steady.seen[:, pairs].all(axis=2).T):
        rows, others = np.flatnonzero(known), np.flatnonzero(~known)
        if not rows.size:
            continue
        lines = np.stack([_along(tracks.time, rows, put[:, side])[others] for side in pairs[k]], axis=1)
        seen = tracks.uv[np.ix_(others, pairs[k])]
        kept, other = (
            np.nansum(np.linalg.norm(seen - line, axis=2), axis=1) for line in (lines, lines[:, ::-1])
        )
        after = np.searchsorted(rows, others)
        beside = wrong[rows[np.maximum(after - 1, 0)], k] | wrong[rows[np.minimum(after, len(rows) - 1)], k]
        found[others, k] = beside & (other < kept)
    return found


def _along(time: Floats, rows: Ints, uv: Floats) -> Floats:
    """Places (T, 2) of a point on the lines between those of some rows."""
    return np.stack([np.interp(time, time[rows], axis[rows]) for axis in uv.T], axis=1)


def _stretches(tracks: Tracks, wrong: Flags) -> Iterator[tuple[int, int]]:
    """First row, and the one after the last, of stretches with `wrong` pairs further apart than `NEAR`."""
    rows = np.flatnonzero(wrong.any(axis=1))
    parts = np.split(rows, np.flatnonzero(np.diff(tracks.time[rows]) > NEAR) + 1)
    return ((int(part[0]), int(part[-1]) + 1) for part in parts if part.size)


def _around(tracks: Tracks, first: int, end: int) -> slice:
    """Rows of a stretch and its surroundings."""
    begin = np.searchsorted(tracks.time, tracks.time[first] - AROUND)
    return slice(int(begin), int(np.searchsorted(tracks.time, tracks.time[end - 1] + AROUND, "right")))


def _rows(tracks: Tracks, part: slice) -> Tracks:
    """Take some frames of tracks."""
    columns = {name: getattr(tracks, name)[part] for name in ("frame", "time", "uv", "confidence")}
    return replace(tracks, **columns)


def _swapped(tracks: Tracks, pairs: Ints, wrong: Flags) -> Tracks:
    """Tracks with the two points of pairs (P, 2) exchanged where `wrong` (T, P)."""
    uv, confidence = tracks.uv.copy(), tracks.confidence.copy()
    for pair, rows in zip(pairs, wrong.T, strict=True):
        for values in (uv, confidence):
            values[np.ix_(rows, pair)] = values[np.ix_(rows, pair[::-1])]
    return replace(tracks, uv=uv, confidence=confidence)


def _judged(tracks: Tracks, pairs: Ints, wrong: Flags, seen: Flags, own: slice, evidence: Evidence) -> Flags:
    """Take in `own` rows of a proposal (T, P) what the motion confirms: all or nothing, then each limb.

    Where something was exchanged, other pairs may have been along with it for as long.
    """

    def score(flags: Flags) -> float:
        return evidence(_swapped(tracks, pairs, flags)) - CLEAR * int(flags[own].any(axis=0).sum())

    best = wrong.copy()
    best[own] = False
    most = score(best)
    if (proposed := score(wrong)) > most:
        best, most = wrong.copy(), proposed
    for limb in _limbs(tracks, pairs):
        for flags in _others(best[own], wrong[own], seen[own], limb):
            other = best.copy()
            other[own] = flags
            if (other != best).any() and (changed := score(other)) > most:
                best, most = other, changed
    return best


def _limbs(tracks: Tracks, pairs: Ints) -> list[Ints]:
    """Pairs of legs, of arms and of the rest."""
    joints = [tracks.names[left][2:] for left in pairs[:, 0]]
    limb = np.array([next((k for k, limb in enumerate(LIMBS) if joint in limb), -1) for joint in joints])
    return [np.flatnonzero(limb == k) for k in np.unique(limb)]


def _others(best: Flags, wrong: Flags, seen: Flags, limb: Ints) -> Iterator[Flags]:
    """Vary the best reading: with none of a limb, with it as proposed, and with all of it."""
    proposed = np.asarray(wrong[:, limb].any(axis=1))
    whole = seen[:, limb] & np.asarray(proposed if proposed.any() else wrong.any(axis=1))[:, None]
    none = np.zeros_like(whole)
    for flags in (none, wrong[:, limb], whole) if best.any() else (wrong[:, limb],):
        other = best.copy()
        other[:, limb] = flags
        yield other


def _spans(frames: npt.NDArray[np.int64], wrong: Flags) -> list[tuple[int, int]]:
    """First and last of the frames (n,) in each stretch of `wrong` ones."""
    edges = np.flatnonzero(np.diff(np.pad(wrong.astype(int), 1))).reshape(-1, 2)
    return [(int(frames[first]), int(frames[end - 1])) for first, end in edges]
