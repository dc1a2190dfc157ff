"""Segments of a corpus: motions on disk, cut and normalised when they are learnt from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import axis_rotation
from gait.learn.segment_options import Segments
from gait.learn.segments.segment_motion import Motion
from gait.learn.spool import Spool, release, stored

Floats = npt.NDArray[np.float64]

MISSING = 0.2  # share of a segment's entries that may be missing; more, and it is left out
USUAL = 0.5  # share of the frames, and of the recordings, in which a marker must be seen to be learnt


@dataclass(frozen=True)
class Recorded:
    """A recording's motion.

    Attributes
    ----------
    table : (T, 3 J + 3)
        Places and root, on disk.
    people : list of (T, 3 J + 3)
        The same of people who were not recorded.
    """

    name: str
    subject: str
    source: Path
    names: tuple[str, ...]
    stature: float
    table: Floats
    people: list[Floats] = field(default_factory=list)

    @property
    def places(self) -> Floats:
        """Markers (T, J, 3), statures."""
        return self.table[:, :-3].reshape(len(self.table), len(self.names), 3)

    @property
    def root(self) -> Floats:
        """Place of the pelvis and heading, (T, 3)."""
        return self.table[:, -3:]


class Corpus:
    """Motions of recordings: a context in which they are put; `recordings` outlive it."""

    def __init__(self) -> None:
        self._spool = Spool()
        self._heads: list[tuple[str, str, Path, tuple[str, ...], float]] = []
        self._counts: list[int] = []

    def __enter__(self) -> Corpus:
        return self

    def __exit__(self, *problem: object) -> None:
        self._spool.__exit__(*problem)

    def put(self, name: str, subject: str, source: Path, motion: Motion) -> None:
        """Append a recording's motion."""
        for places in (motion.places, *motion.people):
            self._spool.put(np.concatenate([places.reshape(len(places), -1), motion.root], axis=1))
        self._heads.append((name, subject, source, motion.names, motion.stature))
        self._counts.append(1 + len(motion.people))

    def recordings(self) -> list[Recorded]:
        """All that were put."""
        views = iter(self._spool.views())
        tables = [list(islice(views, count)) for count in self._counts]
        return [Recorded(*head, own, rest) for head, (own, *rest) in zip(self._heads, tables, strict=True)]


@dataclass(frozen=True)
class Table:
    """Segments of a corpus, one a row.

    Attributes
    ----------
    names : tuple of str
        The J markers.
    rows : (N, F * J * 3)
        On disk; statures, NaN where missing.
    recording : (N,)
        Index into `recordings`, which are those that have segments.
    real : (N,)
        Whether it was recorded, and not of a person who was made up.
    """

    names: tuple[str, ...]
    rows: Floats
    recording: npt.NDArray[np.intp]
    real: npt.NDArray[np.bool_]
    recordings: list[Recorded]

    @property
    def subject(self) -> npt.NDArray[np.intp]:
        """Index of each row's person."""
        people = np.unique([r.subject for r in self.recordings], return_inverse=True)[1]
        return np.asarray(people[self.recording], np.intp)


def usual_markers(recordings: Sequence[Recorded]) -> tuple[str, ...]:
    """Names of the markers that most of the recordings show for most of the time, in their order."""
    count: Counter[str] = Counter()
    for r in recordings:
        seen = np.isfinite(r.places).all(axis=2).mean(axis=0)
        count.update(dict.fromkeys(r.names, 0))
        count.update(name for name, share in zip(r.names, seen, strict=True) if share >= USUAL)
        release(r.table)
    return tuple(name for name, times in count.items() if times > USUAL * len(recordings))


def tabulate(recordings: Sequence[Recorded], wanted: Segments) -> Table:
    """Cut all recordings; with `headings` every segment is there as many times, turned."""
    names = usual_markers(recordings)
    used: list[Recorded] = []
    recording: list[int] = []
    real: list[bool] = []

    def blocks() -> Iterator[Floats]:
        for r in recordings if names else ():
            cut = segments(r, names, wanted)
            made_up = _of_others(r, names, wanted) if len(cut) else np.zeros((0, *cut.shape[1:]))
            release(r.table)
            if not len(cut):
                continue
            used.append(r)
            for turn in _turned(np.concatenate([cut, made_up]), wanted.headings):
                recording.extend([len(used) - 1] * len(turn))
                real.extend([True] * len(cut) + [False] * len(made_up))
                yield turn.reshape(len(turn), -1)

    rows = stored(blocks(), (wanted.frames * len(names) * 3,))
    return Table(names, rows, np.array(recording, np.intp), np.array(real, bool), used)


def segments(recorded: Recorded, names: Sequence[str], wanted: Segments, every: int = 1) -> Floats:
    """Segments (n, F, J, 3) of a recording that are nearly whole: over the origin, looking along +x.

    Parameters
    ----------
    every : int
        Take each of so many alone.
    """
    columns = [recorded.names.index(name) if name in recorded.names else -1 for name in names]
    padded = np.concatenate([recorded.places, np.full((len(recorded.table), 1, 3), np.nan)], axis=1)
    found = []
    for start in range(0, len(padded) - wanted.frames + 1, every * wanted.hop):
        x, y, heading = recorded.root[start]
        part = padded[start : start + wanted.frames, columns]
        if np.isfinite(heading) and np.mean(np.isnan(part)) <= MISSING:
            found.append((part - (x, y, 0.0)) @ axis_rotation(2, -heading).T)
    return np.array(found).reshape(-1, wanted.frames, len(names), 3)


def _of_others(recorded: Recorded, names: Sequence[str], wanted: Segments) -> Floats:
    """Segments of the people who were not recorded: each pair's at places of their own in the recording."""
    pairs = max(len(recorded.people) // 2, 1)
    found = [np.zeros((0, wanted.frames, len(names), 3))]
    for k, table in enumerate(recorded.people):
        later = replace(recorded, table=table[wanted.hop * (k // 2 % pairs) :], people=[])
        found.append(segments(later, names, wanted, pairs))
        release(table)
    return np.concatenate(found)


def _turned(cut: Floats, headings: int) -> list[Floats]:
    """Copy segments: as they are; for 2 also turned by 90 degrees, for 8 by each of 45."""
    step = {0: 0.0, 2: np.pi / 2, 8: np.pi / 4}[headings]
    return [cut @ axis_rotation(2, step * k).T for k in range(max(headings, 1))]
