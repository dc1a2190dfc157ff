"""Which files to learn from, and their reading: folders are searched, bad files in them are left out."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from gait.errors import UserError
from gait.learn.readers import KINDS
from gait.learn.reading import DEFAULT, Reading
from gait.learn.sequence import Sequence, load


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
) -> tuple[list[Sequence], list[str]]:
    """Read and prepare files; those in folders that cannot be used give one line each and are left out.

    Parameters
    ----------
    progress : callable
        Gets the number of files done.

    Raises
    ------
    UserError
        If a file named by itself cannot be used, or none can.
    """
    sequences, refused = [], []
    for i, (path, inside) in enumerate(files):
        try:
            sequences.append(load(path, reading))
        except UserError as error:
            if not inside:
                raise
            refused.append(str(error))
        progress(i + 1)
    if not sequences:
        raise UserError(f"{refused[0]} (and none of the other {len(refused) - 1} files can be used)")
    return sequences, refused


def _kinds() -> str:
    return " ".join(sorted(KINDS))
