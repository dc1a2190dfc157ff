"""The recordings that the page is made from: walks, and motions of all kinds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gait.body.skeleton import PAPER_ANGLES
from gait.errors import UserError
from gait.learn.arrays import Floats
from gait.learn.corpus import load, sources
from gait.learn.corpus.forkserver import cores
from gait.learn.cycles import period
from gait.learn.cycles.sequence import Sequence as Walk
from gait.learn.options import LearnOptions, SegmentOptions
from gait.learn.segments.corpus import Corpus, Recorded
from gait.progress import progress

FEWEST_WALKS, FEWEST_MOTIONS = 3, 3
ALIKE = 0.1  # share of the period within which the paper's agrees with the refined one
ECLECTIC = 10  # sequences of the second paper
FEWEST_MOTION_FRAMES, MOST_MOTION_FRAMES = 120, 240  # frames of them
EVERYTHING = SegmentOptions(source="all")


@dataclass(frozen=True)
class Recordings:
    """Walks, and motions of all kinds at 20 frames per second."""

    walks: list[Walk]  #: with their refined periods
    motions: list[Recorded]
    refused: list[str]  #: one line about each file that is no walk, or cannot be read


def read(mocap: Sequence[str], quiet: bool) -> Recordings:
    """Read files and folders of motion capture; UserError with one line if they hold too little."""
    options = LearnOptions(sources=tuple(mocap), quiet=quiet, segments=EVERYTHING, jobs=cores())
    files, closed = sources.find(mocap)
    with progress("measuring people", None, quiet) as update:
        shared = load.shared_lengths(files, options, update)
    with Corpus() as corpus:
        with progress("reading motion", len(files), quiet) as update:
            try:
                found = load.load_all(files, options, update, corpus=corpus, shared=shared)
            except load.NothingLeft as error:  # its remedy is of gait learn
                raise UserError(
                    f"{' '.join(mocap)}: holds no walk, and the first paper needs {FEWEST_WALKS}; add "
                    f"recordings of steady walking ({error.refused[0]})"
                ) from error
        motions = corpus.recordings()
    name = " ".join(mocap)
    if len(found.sequences) < FEWEST_WALKS:
        raise UserError(
            f"{name}: holds {len(found.sequences)} walks, and the first paper needs {FEWEST_WALKS}; add "
            "recordings of steady walking"
        )
    eclectic = _eclectic(motions, {walk.source for walk in found.sequences})
    long = len({motion.source for motion in eclectic})
    if long < FEWEST_MOTIONS:
        raise UserError(f"{name}: {long} recordings are long enough for segments; add recordings")
    return Recordings(found.sequences, eclectic, closed + found.refused)


def _eclectic(motions: list[Recorded], walks: set[object]) -> list[Recorded]:
    """Choose up to ECLECTIC sequences: first those as long as the paper's, and of all kinds before walks."""
    parts = [p for m in motions if len(m.table) >= 2 * EVERYTHING.frames for p in _parts(m)]
    others = [p for p in parts if p.source not in walks]
    walking = list({p.subject: p for p in reversed(parts) if p.source in walks}.values())[::-1]
    return sorted([*others, *walking], key=lambda p: len(p.table) < FEWEST_MOTION_FRAMES)[:ECLECTIC]


def _parts(motion: Recorded) -> list[Recorded]:
    """Return a motion of at most `MOST_MOTION_FRAMES`, or the equal parts of a longer one."""
    count = -(-len(motion.table) // MOST_MOTION_FRAMES)
    if count == 1:
        return [motion]
    size = len(motion.table) // count
    spans = [slice(k * size, (k + 1) * size) for k in range(count)]
    return [
        replace(
            motion,
            name=f"{motion.name} ({k} of {count})",
            table=motion.table[span],
            people=[each[span] for each in motion.people],
        )
        for k, span in enumerate(spans, 1)
    ]


def by_person(walks: list[Walk], count: int) -> list[Walk]:
    """Choose so many walks, of as many people as there are, the longest of each first."""
    groups: dict[str, list[Walk]] = {}
    for walk in sorted(walks, key=lambda w: (-w.cycles, w.name)):
        groups.setdefault(walk.subject, []).append(walk)
    order = [group[k] for k in range(len(walks)) for group in groups.values() if k < len(group)]
    return order[:count]


def literal(walk: Walk) -> Walk:
    """Return a walk with the period that the paper's search finds by the paper's angles."""
    angles = walk.channels[:, : len(PAPER_ANGLES)]
    return replace(walk, period=period.find(angles, walk.fps, "literal"))


def agrees(found: Walk, walk: Walk) -> bool:
    """Whether the paper's period is that of the refined search, not a multiple or a part of it."""
    return bool(abs(found.period.frames / walk.period.frames - 1) < ALIKE)


def degrees(walk: Walk) -> Floats:
    """Return the paper's angles (T, 19), degrees."""
    return np.degrees(walk.channels[:, : len(PAPER_ANGLES)])
