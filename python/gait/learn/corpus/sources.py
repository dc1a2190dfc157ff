"""Which files to learn from, and their reading: folders are searched, bad files in them are left out."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from gait.errors import UserError, unreadable
from gait.learn.corpus import cluster, pool, subjects
from gait.learn.corpus.shared_stretches import Shared, shared
from gait.learn.corpus.stage import Prepared, Task
from gait.learn.cycles.sequence import Sequence
from gait.learn.mocap.remarks import Noticed
from gait.learn.reading import DEFAULT, Reading
from gait.learn.segments.segment_corpus import Corpus
from gait.learn.solve.readers import KINDS
from gait.learn.solve.retarget import Measures, known_parts
from gait.learn.spool import Spool

KEPT = " (its segments are used all the same)"
ONLY = "for gait lift alone give --segments only: all needs recordings for a cyclic model, too"
NOT_YET = np.zeros((0, 0))  # channels of a sequence while they go to disk


class NothingLeft(UserError):
    """No file can be used for a cyclic model; `refused` has one line about each.

    If some have segments, the remedy is named.
    """

    def __init__(self, refused: list[str]) -> None:
        self.refused = [words.removesuffix(KEPT) for words in refused]
        others = f" (and none of the other {len(refused) - 1} files can be used)" if refused[1:] else ""
        remedy = "" if self.refused == refused else f"; {ONLY}"
        super().__init__(self.refused[0] + others + remedy)


def find(
    sources: Iterable[str],
    exclude: Iterable[str] = (),
    idle: Callable[[str], None] = lambda glob: None,
    closed: Callable[[str], None] = lambda words: None,
) -> list[tuple[Path, bool]]:
    """Motion files of files and folders, sorted; whether each was found in a folder.

    Parameters
    ----------
    exclude : iterable of str
        Globs that the tail of a file's path matches, such as '02_*.amc' or 'cmu_walk/02/*'; names of folders
        without wildcards, such as 'cmu_walk/02', for all that is inside.
    idle : callable
        Gets each glob that no file matches.
    closed : callable
        Gets a line about each folder in a source that cannot be read.

    Raises
    ------
    UserError
        If a source is missing, of an unknown kind, or nothing is left.
    """
    found: dict[str, tuple[Path, bool]] = {}  # by the whole path, however it is spelt
    for name in sources:
        source = Path(name)
        if not name:
            raise UserError("'': is no name of a file or folder; use . for this folder")
        if source.is_dir():
            inside = sorted(_inside(source, closed))
            if not inside:
                raise UserError(f"{source}: no motion files ({_kinds()}) in this folder; name another one")
            for path in inside:
                found.setdefault(os.path.abspath(path), (path, True))
        elif not source.is_file():
            raise UserError(f"{source}: no such file or folder; check the name")
        elif source.suffix.lower() == ".asf":
            raise UserError(f"{source}: is a skeleton without motion; name the .amc files beside it")
        elif source.suffix.lower() not in KINDS:
            raise UserError(
                f"{source}: {source.suffix or 'no suffix'} is not learnt from; convert it to {_kinds()}"
            )
        else:
            found[os.path.abspath(source)] = source, False
    globs = list(exclude)
    for glob in globs:
        if not any(_matches(path, glob) for path, _ in found.values()):
            idle(glob)
    kept = [(p, inside) for p, inside in found.values() if not any(_matches(p, glob) for glob in globs)]
    if not kept:
        raise UserError(f"--exclude {' '.join(globs)}: leaves none of {len(found)} files; exclude less")
    return kept


def _inside(folder: Path, closed: Callable[[str], None]) -> Iterator[Path]:
    """Motion files of a folder and those in it, but for hidden ones; links are followed, each folder once."""
    entered = {os.path.realpath(folder)}

    def tell(error: OSError) -> None:
        if Path(error.filename) == folder:
            raise unreadable(folder, error)
        closed(str(unreadable(error.filename, error)))

    for at, folders, files in os.walk(folder, onerror=tell, followlinks=True):
        shown = sorted((name for name in folders if name[0] != "."), reverse=True)
        new = {os.path.realpath(Path(at, name)): name for name in shown}  # of several names the first
        folders[:] = [name for real, name in new.items() if real not in entered]
        entered |= set(new)
        for path in (Path(at, name) for name in files if name[0] != "."):
            if path.suffix.lower() in KINDS and (path.is_file() or path.is_symlink()):
                yield path


def _matches(path: Path, glob: str) -> bool:
    """Whether a glob leaves a file out."""
    folder = glob.rstrip("/")
    return bool(folder) and (
        path.match(folder) or (not set(folder) & set("*?[") and any(p.match(folder) for p in path.parents))
    )


def load_all(
    files: list[tuple[Path, bool]],
    reading: Reading = DEFAULT,
    progress: Callable[[int], None] = lambda done: None,
    *,
    jobs: int = 1,
    dask: str | None = None,
    people: str = "auto",
    corpus: Corpus | None = None,
    others: list[Measures] | None = None,
    bodies: list[Shared | None] | None = None,
    noticed: Noticed | None = None,
) -> tuple[list[Sequence], list[str]]:
    """Read and prepare files; those in folders that cannot be used give one line each and are left out.

    The result does not depend on where the files are prepared.  The signals of the sequences are on disk and
    come into memory when they are used.

    Parameters
    ----------
    progress : callable
        Gets the number of files done.
    jobs : int
        Processes at most.
    dask : str, optional
        Address of the scheduler of a Dask cluster that shall do it.
    people : one of subjects.RULES
        Which files are of one person.
    corpus : Corpus, optional
        Gets the motions for the prior over segments; a file that gave one is no error.
    others : list, optional
        Gets the bodies of people none of whose files can be used: the one of which most was seen.
    bodies : list, optional
        What `measured` gave for these files; without it each is fitted by itself.
    noticed : Noticed, optional
        Gets what the readers noticed besides.

    Raises
    ------
    UserError
        If a file named by itself cannot be used, or none can.
    """
    paths = [path for path, _ in files]
    known = bodies or [None] * len(paths)
    outcomes = _done(
        [
            Task(path, reading, body.stretch if body else None)
            for path, body in zip(paths, known, strict=True)
        ],
        jobs,
        dask,
    )
    names, persons = subjects.names(paths), subjects.subjects(paths, people)
    sequences, refused, used = [], [], False
    measures: list[Measures | None] = []
    with closing(outcomes), Spool() as spool:
        for i, outcome in enumerate(outcomes):
            found, told = outcome.sequence, outcome.refused
            measures.append(outcome.body)
            if noticed is not None:
                noticed.add(paths[i], outcome.remarks)
            if corpus is not None and outcome.motion is not None:
                corpus.put(names[i], persons[i], paths[i], outcome.motion)
                used = True
            if found is not None:
                spool.put(found.channels)
                found = replace(found, name=names[i], subject=persons[i], channels=NOT_YET)
                sequences.append(replace(found, recordings=body.recordings) if (body := known[i]) else found)
            elif told is not None and (files[i][1] or outcome.motion is not None):
                whole = outcome.motion is None or corpus is None
                refused.append(f"{told}" if whole else f"{told}{KEPT}")
            elif told is not None:
                raise told
            progress(i + 1)
        views = spool.views()
    if not sequences and not (used and reading.segments.source == "only"):
        raise NothingLeft(refused)
    for sequence, channels in zip(sequences, views, strict=True):
        sequence.channels = channels
    if others is not None:
        others += _left_over(persons, measures, {s.subject for s in sequences})
    return sequences, refused


def measured(
    files: list[tuple[Path, bool]],
    reading: Reading = DEFAULT,
    progress: Callable[[int], None] = lambda done: None,
    *,
    jobs: int = 1,
    dask: str | None = None,
    people: str = "auto",
    tell: Callable[[str], None] = lambda words: None,
) -> list[Shared | None]:
    """Bodies of people with several recordings of markers, for each file; None where it is fitted by itself.

    Parameters are those of `load_all`; `tell` gets a line about recordings that cannot be of one body.
    """
    paths = [path for path, _ in files]
    return shared(
        paths,
        subjects.subjects(paths, people),
        reading,
        lambda tasks: _done(tasks, jobs, dask),
        tell,
        progress,
    )


def _done(tasks: list[Task], jobs: int, dask: str | None) -> Generator[Prepared, None, None]:
    """Outcomes of tasks in their order, wherever they are done."""
    return cluster.prepared(tasks, dask) if dask else pool.prepared(tasks, jobs)


def _left_over(persons: list[str], bodies: list[Measures | None], known: set[str]) -> list[Measures]:
    """One body of each person who is not known, in the order of their names."""
    best: dict[str, Measures] = {}
    for person, body in zip(persons, bodies, strict=True):
        if body is not None and person not in known and known_parts(body) > known_parts(best.get(person)):
            best[person] = body
    return [best[person] for person in sorted(best)]


def _kinds() -> str:
    return " ".join(sorted(KINDS))
