"""Read and prepare the files of a run; unusable files in folders are skipped.

All recordings of a person with markers share one body: their information about the length scales is added,
together with that about people in general (the optimum of a joint fit, by one Gauss-Newton step).  Each
recording has its own marker positions, since markers are attached anew.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gait.errors import UserError
from gait.learn.arrays import ArrayFile, Floats
from gait.learn.corpus import cluster, processes, sources
from gait.learn.corpus.stage import Prepared, Task
from gait.learn.cycles.period import FEWEST_CYCLES
from gait.learn.cycles.sequence import Sequence
from gait.learn.mocap import points
from gait.learn.mocap.recording import FileNotes
from gait.learn.options import DEFAULT, LearnOptions
from gait.learn.segments.corpus import Corpus
from gait.learn.solve import static_trial
from gait.learn.solve.retarget import Measures, known_parts
from gait.learn.solve.skeleton_fit import (
    LENGTHS_OF_PEOPLE,
    NO_INFORMATION,
    LengthInformation,
    log_bayes_factor,
)

Files = list[tuple[Path, bool]]  #: paths, and whether each was found in a folder

USED = " (its segments are used nevertheless)"
ONLY = "for gait lift only, give --segments only: all also needs recordings for a cyclic model"
NOT_YET = np.zeros((0, 0))  # channels of a sequence until they are read back from disk
SAME_PERSON = np.log(10)  # prior log odds that files with the same person's name are of one person: 10 to 1
MOST_NAMED_FILES = 4  # most names of files in a line


class NothingLeft(UserError):
    """No file can be used for a cyclic model; `refused` has one line about each."""

    def __init__(self, refused: list[str]) -> None:
        self.refused = [words.removesuffix(USED) for words in refused]
        others = f" (and none of the other {len(refused) - 1} files can be used)" if refused[1:] else ""
        remedy = "" if self.refused == refused else f"; {ONLY}"
        super().__init__(self.refused[0] + others + remedy)


@dataclass
class RunNotes:
    """Observations of the readers in the files of a run."""

    labels: set[str] = field(default_factory=set)
    zeros: list[tuple[Path, str]] = field(default_factory=list)
    lacking: list[tuple[Path, tuple[str, ...]]] = field(default_factory=list)
    belts: list[tuple[Path, float]] = field(default_factory=list)  #: speeds, of recordings learnt from
    parts: list[tuple[Path, str]] = field(default_factory=list)  #: learnt from, of several motions

    def add(self, path: Path, notes: FileNotes, learnt: Sequence | None) -> None:
        """Add the notes of a file; `learnt`: what is learnt from it."""
        if learnt and notes.belt is not None:
            self.belts.append((path, notes.belt))
        if learnt and learnt.part:
            self.parts.append((path, learnt.part))
        self.labels |= notes.labels
        if notes.zeros:
            self.zeros.append((path, notes.zeros))
        if notes.lacking:
            self.lacking.append((path, notes.lacking))


@dataclass(frozen=True)
class SharedLengths:
    """Log length scales (S,) of a person, and the number of recordings from which they were measured."""

    log_scales: Floats
    recordings: int


class Loaded(NamedTuple):
    """Results of reading a run's files; the signals of the sequences are on disk."""

    sequences: list[Sequence]
    refused: list[str]  #: one line about each file that was left out
    others: list[Measures]  #: bodies of people without usable files, in the order of their names


def load_all(
    files: Files,
    options: LearnOptions = DEFAULT,
    progress: Callable[[int], None] = lambda done: None,
    *,
    corpus: Corpus | None = None,
    shared: list[SharedLengths | None] | None = None,
    notes: RunNotes | None = None,
) -> Loaded:
    """Read and prepare files; the result does not depend on the processes that do it.

    `progress` is called with the number of files done; `corpus` receives the motions for the segment prior (a
    file that gave one is no error), `notes` the readers' observations.  `shared`: result of `shared_lengths`
    for these files; without it each file is fitted by itself.  UserError if a file named explicitly, or every
    file, cannot be used.
    """
    paths = [path for path, _ in files]
    shared = shared or [None] * len(paths)
    names, persons = sources.names(paths), sources.subjects(paths, options.subjects)
    tasks = _tasks(paths, options, shared)
    sequences, refused, used = list[Sequence](), list[str](), False
    measures: list[Measures | None] = []
    with closing(_outcomes(tasks, options)) as outcomes, ArrayFile() as signals:
        for i, outcome in enumerate(outcomes):
            found, error = outcome.sequence, outcome.refused
            generic = any(sources.matches(paths[i], glob) for glob in options.generic_lengths)
            measures.append(None if generic else outcome.body)
            if notes is not None:
                notes.add(paths[i], outcome.notes, found)
            if corpus is not None and outcome.motion is not None:
                corpus.put(names[i], persons[i], paths[i], outcome.motion)
                used = True
            if found is not None:
                signals.put(found.channels)
                one = None if outcome.alone else shared[i]
                count = one.recordings if one else found.recordings
                own = None if generic else found.measures
                sequences.append(
                    replace(
                        found,
                        name=names[i],
                        subject=persons[i],
                        channels=NOT_YET,
                        measures=own,
                        recordings=count,
                    )
                )
            elif error is not None and (files[i][1] or outcome.motion is not None):
                left_out = outcome.motion is None or corpus is None
                refused.append(f"{error}" if left_out else f"{error}{USED}")
            elif error is not None:
                raise error
            progress(i + 1)
        views = signals.views()
    for sequence, channels in zip(sequences, views, strict=True):
        sequence.channels = channels
    lonely = _lonely(sequences)
    for short in (s for s in sequences if s.name in lonely):
        measures[names.index(short.name)] = short.measures
    sequences = [s for s in sequences if s.name not in lonely]
    refused += [words for name, words in lonely.items()]
    if not sequences and not (used and options.segments.source == "only"):
        raise NothingLeft(refused)
    if named := [name for name in lonely if not files[names.index(name)][1]]:
        raise UserError(lonely[named[0]])
    return Loaded(sequences, refused, _other_bodies(persons, measures, {s.subject for s in sequences}))


def _lonely(sequences: list[Sequence]) -> dict[str, str]:
    """Return names of trials that are too short without others of the same person, and a line about each."""
    count = Counter(s.subject for s in sequences)
    return {
        s.name: f"{s.source}: the trial is too short by itself: {s.cycles:.2f} cycles (at least "
        f"{FEWEST_CYCLES}); add more trials of {s.subject!r} (gait learn has --subjects), or leave it out"
        for s in sequences
        if s.short and count[s.subject] == 1
    }


def _tasks(paths: list[Path], options: LearnOptions, shared: list[SharedLengths | None]) -> list[Task]:
    """Return the task for each file, with its person's static trial, or else with the shared lengths."""
    trials = static_trials(paths, options)
    found = {path: static_trial.calibrate(path, options) for path in dict.fromkeys(filter(None, trials))}
    tasks = []
    for path, trial, one in zip(paths, trials, shared, strict=True):
        if trial is not None:
            own = found[trial]
            tasks.append(Task(path, replace(options, markers=own.markers), own.log_scales))
        else:
            tasks.append(Task(path, replace(options, static=()), one.log_scales if one else None))
    return tasks


def static_trials(paths: list[Path], options: LearnOptions) -> list[Path | None]:
    """Return the static trial for each file, or None."""
    statics = [Path(name) for name in options.static]
    people = sources.subjects([*paths, *statics], options.subjects)
    return static_trial.serving(paths, people[: len(paths)], statics, people[len(paths) :])


def _outcomes(tasks: list[Task], options: LearnOptions) -> Generator[Prepared, None, None]:
    """Yield the outcomes of tasks in their order, from this machine or a cluster."""
    if options.dask:
        return cluster.prepared(tasks, options.dask)
    return processes.prepared(tasks, options.jobs)


def _other_bodies(persons: list[str], bodies: list[Measures | None], known: set[str]) -> list[Measures]:
    """Return the best-known body of each person without sequences, in the order of their names."""
    best: dict[str, Measures] = {}
    for person, body in zip(persons, bodies, strict=True):
        if body is not None and person not in known and known_parts(body) > known_parts(best.get(person)):
            best[person] = body
    return [best[person] for person in sorted(best)]


@dataclass
class _Body:
    """Information of recordings about a body, and their files (indices)."""

    found: LengthInformation = NO_INFORMATION
    files: list[int] = field(default_factory=list)

    def add(self, file: int, found: LengthInformation) -> None:
        self.found += found
        self.files.append(file)


def shared_lengths(
    files: Files,
    options: LearnOptions = DEFAULT,
    progress: Callable[[int], None] = lambda done: None,
    warn: Callable[[str], None] = lambda line: None,
) -> list[SharedLengths | None]:
    """Measure people with several recordings of markers; None for files that are fitted by themselves.

    The result does not depend on the order of the files.  `progress` gets the number of files done, `warn` a
    line about recordings that cannot be of one body.
    """
    paths = [path for path, _ in files]
    persons = sources.subjects(paths, options.subjects)
    result: list[SharedLengths | None] = [None] * len(paths)
    trials = static_trials(paths, options)
    marked = [
        i
        for i, (path, trial) in enumerate(zip(paths, trials, strict=True))
        if path.suffix.lower() in points.SUFFIXES and trial is None
    ]
    count = Counter(persons[i] for i in marked)
    order = [(persons[i], os.path.abspath(path)) for i, path in enumerate(paths)]
    several = sorted((i for i in marked if count[persons[i]] > 1), key=lambda i: order[i])
    tasks = [Task(paths[i], options, measuring=True) for i in several]
    with closing(_outcomes(tasks, options)) as outcomes:
        for person, numbered in groupby(enumerate(several, 1), key=lambda item: persons[item[1]]):
            bodies: list[_Body] = []
            for number, file in numbered:
                found = next(outcomes).lengths
                if found is not None:
                    _most_likely(bodies, found).add(file, found)
                progress(number)
            for body in bodies:
                if len(body.files) > 1:
                    shared = SharedLengths((LENGTHS_OF_PEOPLE + body.found).mean(), len(body.files))
                    for i in body.files:
                        result[i] = shared
            for line in _other_lengths(person, [[paths[i] for i in body.files] for body in bodies]):
                warn(line)
    return result


def _most_likely(bodies: list[_Body], found: LengthInformation) -> _Body:
    """Return the most likely body of a recording, which may be a new one."""
    each = [log_bayes_factor(body.found, found) for body in bodies]
    if not each or max(each) < -SAME_PERSON:
        bodies.append(_Body())
        return bodies[-1]
    return bodies[int(np.argmax(each))]


def _other_lengths(person: str, bodies: list[list[Path]]) -> list[str]:
    """Return lines about recordings whose body is not that of the majority."""
    most = max(bodies, key=len, default=[])
    return [
        f"{' '.join(map(str, files[:MOST_NAMED_FILES]))}{' ...' * (len(files) > MOST_NAMED_FILES)}: limb "
        f"lengths differ from {most[0]}, which also counts as {person!r}; measured separately. "
        "If these are two people, give each a folder (gait learn has --subjects)"
        for files in bodies
        if files is not most
    ]
