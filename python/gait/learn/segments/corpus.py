"""Cut recordings into segments, and normalise them for learning; motions are on disk."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

import numpy as np

from gait.body.skeleton import axis_rotation
from gait.learn.arrays import ArrayFile, Floats, Indices, Mask, release, stored
from gait.learn.options import SegmentOptions
from gait.learn.segments.motion import Motion

MISSING = 0.2  # share of a segment's entries that may be missing
USUAL = 0.5  # share of the frames, and of the recordings, in which a marker must be visible


@dataclass(frozen=True)
class Recorded:
    """The motion of a recording."""

    name: str
    subject: str
    source: Path
    names: tuple[str, ...]
    stature: float
    table: Floats  #: (T, 3 J + 3) positions and root, on disk
    people: list[Floats] = field(default_factory=list)  #: such tables of imaginary people

    @property
    def places(self) -> Floats:
        """Markers (T, J, 3), statures."""
        return self.table[:, :-3].reshape(len(self.table), len(self.names), 3)

    @property
    def root(self) -> Floats:
        """Position of the pelvis and heading, (T, 3)."""
        return self.table[:, -3:]


class Corpus:
    """Motions of recordings on disk: a context in which to add them; `recordings` remain valid after it."""

    def __init__(self) -> None:
        self._file = ArrayFile()
        self._heads: list[tuple[str, str, Path, tuple[str, ...], float]] = []
        self._counts: list[int] = []

    def __enter__(self) -> Corpus:
        return self

    def __exit__(self, *problem: object) -> None:
        self._file.__exit__(*problem)

    def put(self, name: str, subject: str, source: Path, motion: Motion) -> None:
        """Append the motion of a recording."""
        for places in (motion.places, *motion.people):
            self._file.put(np.concatenate([places.reshape(len(places), -1), motion.root], axis=1))
        self._heads.append((name, subject, source, motion.names, motion.stature))
        self._counts.append(1 + len(motion.people))

    def recordings(self) -> list[Recorded]:
        """Return all recordings."""
        views = iter(self._file.views())
        tables = [list(islice(views, count)) for count in self._counts]
        return [Recorded(*head, own, rest) for head, (own, *rest) in zip(self._heads, tables, strict=True)]


@dataclass(frozen=True)
class Table:
    """N segments of F frames and J markers, one per row."""

    names: tuple[str, ...]  #: names of the markers
    rows: Floats  #: (N, F * J * 3) on disk; statures, NaN where missing
    recording: Indices  #: (N,) index into `recordings`, which are those with segments
    real: Mask  #: (N,) whether it was recorded rather than made for another person
    recordings: list[Recorded]

    @property
    def subject(self) -> Indices:
        """Index of the person of each row."""
        people = np.unique([r.subject for r in self.recordings], return_inverse=True)[1]
        return np.asarray(people[self.recording], np.intp)


def usual_markers(recordings: Sequence[Recorded]) -> tuple[str, ...]:
    """Return the markers that most recordings show most of the time, in their order."""
    count: Counter[str] = Counter()
    for r in recordings:
        visible = np.isfinite(r.places).all(axis=2).mean(axis=0)
        count.update(dict.fromkeys(r.names, 0))
        count.update(name for name, share in zip(r.names, visible, strict=True) if share >= USUAL)
        release(r.table)
    return tuple(name for name, times in count.items() if times > USUAL * len(recordings))


def tabulate(recordings: Sequence[Recorded], wanted: SegmentOptions) -> Table:
    """Cut all recordings; with `headings` there are that many rotated copies of each segment."""
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


def segments(recorded: Recorded, names: Sequence[str], wanted: SegmentOptions, every: int = 1) -> Floats:
    """Cut a recording into segments (n, F, J, 3) that are nearly complete, above the origin and facing +x.

    Only every `every`-th segment is used.
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


def _of_others(recorded: Recorded, names: Sequence[str], wanted: SegmentOptions) -> Floats:
    """Cut the motions of people who were not recorded; each pair has its own segments of the recording."""
    pairs = max(len(recorded.people) // 2, 1)
    found = [np.zeros((0, wanted.frames, len(names), 3))]
    for k, table in enumerate(recorded.people):
        later = replace(recorded, table=table[wanted.hop * (k // 2 % pairs) :], people=[])
        found.append(segments(later, names, wanted, pairs))
        release(table)
    return np.concatenate(found)


def _turned(cut: Floats, headings: int) -> list[Floats]:
    """Return copies of segments: unrotated; for 2 also rotated by 90 degrees; for 8 by multiples of 45."""
    step = {0: 0.0, 2: np.pi / 2, 8: np.pi / 4}[headings]
    return [cut @ axis_rotation(2, step * k).T for k in range(max(headings, 1))]
