"""Who is who: names of recordings and of the people in them, by the names of all files of a run."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

RULES = ("auto", "prefix", "folder", "file")


def names(paths: Sequence[Path]) -> list[str]:
    """Name recordings, each differently: the stem if it has a '_' and is there once, else with its folder."""
    places = _without_suffix([_place(path) for path in paths])
    stems = Counter(place.name for place in places)
    ends = _ends(places, 2)
    return [
        place.name if "_" in place.name and stems[place.name] == 1 else end
        for place, end in zip(places, ends, strict=True)
    ]


def subjects(paths: Sequence[Path], rule: str = "auto") -> list[str]:
    """Name the person of each recording.

    Parameters
    ----------
    rule : one of RULES
        prefix: the part of the file's stem before '_', else the whole stem; folder: each folder is a person;
        file: each file is one.  auto: the prefix, or the folder where there is no '_'; but if a prefix
        occurs in several folders that are not named like it (Anna/walk_01, Ben/walk_01), it names no person
        and each folder is one.
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
    """Whether a prefix occurs in several folders, one of which at least has another name."""
    folders: dict[str, set[Path]] = {}
    for path in paths:
        if "_" in path.stem:
            folders.setdefault(path.stem.split("_")[0], set()).add(_place(path).parent)
    return any(
        len(found) > 1 and any(folder.name != prefix for folder in found) for prefix, found in folders.items()
    )


def _place(path: Path) -> Path:
    """Whole path, however it is spelt; links keep their names."""
    return Path(os.path.abspath(path))


def _without_suffix(paths: list[Path]) -> list[Path]:
    """Paths without suffix, unless that makes two the same."""
    count = Counter(path.with_suffix("") for path in paths)
    return [path if count[path.with_suffix("")] > 1 else path.with_suffix("") for path in paths]


def _ends(paths: list[Path], least: int) -> list[str]:
    """Shortest ends of paths, of `least` parts or more, that tell different paths apart."""
    found: dict[Path, str] = {}
    waiting, parts = set(paths), least
    while waiting:
        ends = {path: "/".join(path.parts[-parts:]) for path in waiting}
        count = Counter(ends.values())
        alone = {path for path in waiting if count[ends[path]] == 1 or parts >= len(path.parts)}
        found.update((path, ends[path]) for path in alone)
        waiting, parts = waiting - alone, parts + 1
    return [found[path] for path in paths]
