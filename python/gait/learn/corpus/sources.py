"""The files to learn from, their names and their subjects."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

from gait.bindings.model import is_model
from gait.bindings.shipped import SHIPPED
from gait.errors import UserError, unreadable
from gait.learn.solve.readers import SUFFIXES


def find(
    sources: Iterable[str], exclude: Iterable[str] = (), warn: Callable[[str], None] = lambda line: None
) -> tuple[list[tuple[Path, bool]], list[str]]:
    """Find the motion files of files and folders.

    `exclude`: globs for the end of a file's path, such as '02_*.amc' or 'cmu_walk/02/*', and names of folders
    without wildcards, such as 'cmu_walk/02', whose whole contents are excluded.  `warn` is called with a line
    about each glob that matches no file.

    Returns the files, sorted, each with whether it was found in a folder, and a line about each folder that
    cannot be read.  UserError if a source is missing, of an unknown kind, or nothing is left.
    """
    found: dict[str, tuple[Path, bool]] = {}  # by absolute path, however the user wrote it
    closed: list[str] = []
    for name in sources:
        source = Path(name)
        if not name:
            raise UserError("'': is not the name of a file or folder; use . for this folder")
        if source.is_dir():
            inside = sorted(_inside(source, closed))
            if not inside:
                raise UserError(f"{source}: no motion files ({_kinds()}) in this folder; name another folder")
            for path in inside:
                found.setdefault(os.path.abspath(path), (path, True))
        elif not source.is_file() and name not in SHIPPED:
            raise UserError(f"{source}: no such file or folder; check the name")
        elif source.suffix.lower() == ".asf":
            raise UserError(f"{source}: is a skeleton without motion; name the .amc files beside it")
        elif is_model(name):
            raise UserError(
                f"{source}: is a model, not a recording; to add to a model, name it as the only source, with "
                "--class or --changes"
            )
        elif source.suffix.lower() not in SUFFIXES:
            raise UserError(
                f"{source}: {source.suffix or 'no suffix'} is not supported; convert it to {_kinds()}"
            )
        else:
            found[os.path.abspath(source)] = source, False
    globs = list(exclude)
    for glob in globs:
        if not any(matches(path, glob) for path, _ in found.values()):
            warn(f"--exclude {glob}: no file's path ends like this")
    kept = [(p, inside) for p, inside in found.values() if not any(matches(p, glob) for glob in globs)]
    if not kept:
        raise UserError(f"--exclude {' '.join(globs)}: leaves none of {len(found)} files; exclude fewer")
    return kept, closed


def _inside(folder: Path, closed: list[str]) -> Iterator[Path]:
    """Yield the motion files in a folder and its subfolders, except hidden ones; follow each link once."""
    entered = {os.path.realpath(folder)}

    def note(error: OSError) -> None:
        if Path(error.filename) == folder:
            raise unreadable(folder, error)
        closed.append(str(unreadable(error.filename, error)))

    for at, folders, files in os.walk(folder, onerror=note, followlinks=True):
        shown = sorted((name for name in folders if name[0] != "."), reverse=True)
        new = {os.path.realpath(Path(at, name)): name for name in shown}  # the first of several names
        folders[:] = [name for real, name in new.items() if real not in entered]
        entered |= set(new)
        for path in (Path(at, name) for name in files if name[0] != "."):
            if path.suffix.lower() in SUFFIXES and (path.is_file() or path.is_symlink()):
                yield path


def matches(path: Path, glob: str) -> bool:
    """Whether a glob, or a folder's name, matches a file."""
    folder = glob.rstrip("/")
    return bool(folder) and (
        path.match(folder) or (not set(folder) & set("*?[") and any(p.match(folder) for p in path.parents))
    )


def _kinds() -> str:
    return " ".join(sorted(SUFFIXES))


def names(paths: Sequence[Path]) -> list[str]:
    """Name recordings, each differently: the stem if it has a '_' and occurs once, else with its folder."""
    places = _without_suffix([_place(path) for path in paths])
    stems = Counter(place.name for place in places)
    ends = _ends(places, 2)
    return [
        place.name if "_" in place.name and stems[place.name] == 1 else end
        for place, end in zip(places, ends, strict=True)
    ]


def subjects(paths: Sequence[Path], rule: str = "auto") -> list[str]:
    """Name the person of each recording.

    With the rule prefix, the person is the part of the file's stem before '_', or the whole stem; with
    folder, each folder is a person, with file, each file.  auto uses the prefix, or the folder if there is no
    '_'; but if a prefix occurs in several folders that are not named like it (Anna/walk_01, Ben/walk_01),
    each folder is a person.
    """
    if rule == "file":
        return names(paths)
    folders = _ends([_place(path).parent for path in paths], 1)
    prefixes = [path.stem.split("_")[0] for path in paths]
    if rule == "folder" or (rule == "auto" and _repeated(paths)):
        return folders
    if rule == "prefix":
        return prefixes
    return [
        prefix if "_" in path.stem else folder
        for path, prefix, folder in zip(paths, prefixes, folders, strict=True)
    ]


def _repeated(paths: Sequence[Path]) -> bool:
    """Whether a prefix occurs in several folders, at least one of which has another name."""
    folders: dict[str, set[Path]] = {}
    for path in paths:
        if "_" in path.stem:
            folders.setdefault(path.stem.split("_")[0], set()).add(_place(path).parent)
    return any(
        len(found) > 1 and any(folder.name != prefix for folder in found) for prefix, found in folders.items()
    )


def _place(path: Path) -> Path:
    """Return the absolute path; links keep their names."""
    return Path(os.path.abspath(path))


def _without_suffix(paths: list[Path]) -> list[Path]:
    """Remove suffixes, unless that makes two paths the same."""
    count = Counter(path.with_suffix("") for path in paths)
    return [path if count[path.with_suffix("")] > 1 else path.with_suffix("") for path in paths]


def _ends(paths: list[Path], least: int) -> list[str]:
    """Return the shortest ends of paths, of at least `least` parts, that distinguish different paths."""
    found: dict[Path, str] = {}
    waiting, parts = set(paths), least
    while waiting:
        ends = {path: "/".join(path.parts[-parts:]) for path in waiting}
        count = Counter(ends.values())
        alone = {path for path in waiting if count[ends[path]] == 1 or parts >= len(path.parts)}
        found.update((path, ends[path]) for path in alone)
        waiting, parts = waiting - alone, parts + 1
    return [found[path] for path in paths]
