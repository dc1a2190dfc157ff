"""Output files appear complete or not at all: written beside their place, then renamed."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gait.errors import UserError


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path of the same folder and suffix; rename it to `path` if the block succeeds.

    Raises
    ------
    UserError
        If the folder of `path` does not exist, cannot be written, or `path` is a folder.
    """
    require_writable(path)
    target = Path(path)
    temporary = target.with_name(f".{target.stem}.{os.getpid()}{target.suffix}")
    try:
        yield temporary
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def require_writable(path: str | os.PathLike[str]) -> None:
    """Raise UserError if a file cannot be put at `path`; for long work, call it before the work."""
    target = Path(path)
    if target.is_dir():
        raise UserError(f"{target}: is a folder; give the name of a file in it")
    if not target.parent.is_dir():
        raise UserError(f"{target}: folder {target.parent} does not exist; create it first")
    if not os.access(target.parent, os.W_OK):
        raise UserError(f"{target}: folder {target.parent} cannot be written; choose another place")
