"""Files: text read as lines; outputs complete or not at all, written beside their place, then renamed."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gait.errors import UserError, unreadable


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path of the same folder and suffix; rename it to `path` if the block succeeds.

    Through a symbolic link the file is written that it points to.

    Raises
    ------
    UserError
        If a file cannot be put there, as by `require_writable`.
    """
    require_writable(path)
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".{target.stem}.{os.getpid()}{target.suffix}")
    try:
        yield temporary
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def require_writable(path: str | os.PathLike[str]) -> None:
    """Raise UserError if a file cannot be put at `path`; for long work, call it before the work.

    The folder must exist and be writable, and `path` be new or a regular file that may be written.
    """
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise UserError(f"{path}: is a folder; give the name of a file in it")
    if target.exists() and not target.is_file():
        raise UserError(f"{path}: is a device or a pipe, not a file; give the name of a file")
    if not target.parent.is_dir():
        raise UserError(f"{path}: folder {target.parent} does not exist; create it first")
    if not os.access(target.parent, os.W_OK):
        raise UserError(f"{path}: folder {target.parent} cannot be written; choose another place")
    if target.exists() and not os.access(target, os.W_OK):
        raise UserError(f"{path}: is read-only; choose another name, or change its permissions")


def text_lines(path: Path) -> list[str]:
    """Lines of a text file in any encoding that keeps ASCII.

    Raises
    ------
    UserError
        If it cannot be read.
    """
    try:
        return path.read_text(encoding="latin-1").splitlines()
    except OSError as error:
        raise unreadable(path, error) from error
