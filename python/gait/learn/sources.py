"""Which files to learn from, and their reading: folders are searched, bad files in them are left out."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from gait.errors import UserError
from gait.learn import cluster, pool, subjects
from gait.learn.readers import KINDS
from gait.learn.reading import DEFAULT, Reading
from gait.learn.sequence import Sequence
from gait.learn.spool import Spool

NOT_YET = np.zeros((0, 0))  # channels of a sequence while they go to disk


def find(sources: Iterable[str], exclude: Iterable[str] = ()) -> list[tuple[Path, bool]]:
    """Motion files of files and folders, sorted; whether each was found in a folder.

    Parameters
    ----------
    exclude : iterable of str
        Globs that the tail of a file's path matches, such as '02_*.amc' or 'cmu_walk/02/*'.

    Raises
    ------
    UserError
        If a source is missing, of an unknown kind, or nothing is left.
    """
    found: dict[Path, bool] = {}
    for source in map(Path, sources):
        if source.is_dir():
            inside = sorted(p for p in source.rglob("*") if p.suffix.lower() in KINDS and p.is_file())
            if not inside:
                raise UserError(f"{source}: no motion files ({_kinds()}) in this folder; name another one")
            found.update((path, True) for path in inside if path not in found)
        elif not source.is_file():
            raise UserError(f"{source}: no such file or folder; check the name")
        elif source.suffix.lower() not in KINDS:
            raise UserError(
                f"{source}: {source.suffix or 'no suffix'} is not learnt from; convert it to {_kinds()}"
            )
        else:
            found[source] = False
    globs = list(exclude)
    kept = [(p, inside) for p, inside in found.items() if not any(p.match(glob) for glob in globs)]
    if not kept:
        raise UserError(f"--exclude {' '.join(globs)}: leaves none of {len(found)} files; exclude less")
    return kept


def load_all(
    files: list[tuple[Path, bool]],
    reading: Reading = DEFAULT,
    progress: Callable[[int], None] = lambda done: None,
    *,
    jobs: int = 1,
    dask: str | None = None,
    people: str = "auto",
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

    Raises
    ------
    UserError
        If a file named by itself cannot be used, or none can.
    """
    paths = [path for path, _ in files]
    outcomes = cluster.prepared(paths, reading, dask) if dask else pool.prepared(paths, reading, jobs)
    names, persons = subjects.names(paths), subjects.subjects(paths, people)
    sequences, refused = [], []
    with closing(outcomes), Spool() as spool:
        for i, outcome in enumerate(outcomes):
            if not isinstance(outcome, UserError):
                spool.put(outcome.channels)
                sequences.append(replace(outcome, name=names[i], subject=persons[i], channels=NOT_YET))
            elif files[i][1]:
                refused.append(str(outcome))
            else:
                raise outcome
            progress(i + 1)
        views = spool.views()
    if not sequences:
        others = f" (and none of the other {len(refused) - 1} files can be used)" if refused[1:] else ""
        raise UserError(refused[0] + others)
    for sequence, channels in zip(sequences, views, strict=True):
        sequence.channels = channels
    return sequences, refused


def _kinds() -> str:
    return " ".join(sorted(KINDS))
