"""Read text files, and write outputs completely or not at all, by renaming a temporary file."""

from __future__ import annotations

import errno
import fcntl
import os
import re
import secrets
import stat
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from mmap import ACCESS_READ, mmap
from pathlib import Path

from gait.errors import UserError, unreadable
from gait.progress import note

#: Disk full, user's quota exceeded, file too large, or a disk error.
WRITE_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
#: Seconds after which an unlocked temporary file must be left over from a killed command even if it is empty:
#: a younger one may have just been created, and not locked yet.
_LEFTOVER_AGE_S = 60.0


class UnfinishedError(UserError):
    """Raised in a `replacing` block that cannot go on, to keep what it has written."""


@contextmanager
def replacing(
    path: str | os.PathLike[str],
    partial: Callable[[Path], bool] | None = None,
    cut: Callable[[Path], bool] | None = None,
) -> Iterator[Path]:
    """Yield a temporary file with the folder, suffix and mode of `path`; after success rename it to `path`.

    If `path` is a symbolic link, its target is written.  Two writers of one path do not disturb each other;
    the last one to finish wins.  A temporary file left by a killed command is renamed to
    NAME.unfinished.SUFFIX; `cut` as in `recover`.  Once the block has succeeded, the file is on the disk even
    if the power fails.

    `partial` is called with the temporary file if the block is interrupted, a disk is full, or the block
    raises `UnfinishedError`.  If it returns True, the file is worth keeping in that state, and is also
    renamed to NAME.unfinished.SUFFIX.

    UserError if no file can be written there, as in `require_writable`, or the disk is full.
    """
    require_writable(path)
    target = Path(os.path.realpath(path))
    recover(target.parent, re.escape(target.stem), target.suffix, cut)
    temporary = target.with_name(f".{target.stem}.{secrets.token_hex(8)}{target.suffix}")
    descriptor = -1
    try:
        flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
        descriptor = os.open(temporary, flags, 0o666)
        fcntl.flock(descriptor, fcntl.LOCK_EX)  # held until it is closed, so a killed command holds no lock
        if target.exists():
            os.fchmod(descriptor, stat.S_IMODE(target.stat().st_mode))
        yield temporary
        _flush(temporary)
        os.replace(temporary, target)
        fcntl.flock(descriptor, fcntl.LOCK_UN)
        _flush(target.parent)
    except BaseException as error:
        is_there = temporary.exists()  # neither if creating it failed nor after it got its name
        if is_there and partial is not None and _ends_early(error) and partial(temporary):
            keep_unfinished(temporary, target)
        if not isinstance(error, OSError):
            raise
        if error.errno not in WRITE_ERRORS and error.filename != str(temporary):
            raise
        raise UserError(f"{path}: {error.strerror}; choose another place") from error
    finally:
        temporary.unlink(missing_ok=True)
        if descriptor >= 0:
            os.close(descriptor)


def _flush(path: Path) -> None:
    """Flush a file, or the entries of a folder, to the disk; not all file systems can do the latter."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        flush(descriptor)
    finally:
        os.close(descriptor)


def flush(descriptor: int) -> None:
    """Flush an open file to the disk, unless it is of a kind that cannot be."""
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.EROFS):
            raise


def lock(descriptor: int, path: str | os.PathLike[str], kind: int = fcntl.LOCK_EX) -> None:
    """Lock an open file until it is closed; UserError if another program has, as it writes the file."""
    try:
        fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        raise UserError(f"{path}: another program is writing this file; give another name") from None


def require_unlocked(path: str | os.PathLike[str]) -> None:
    """Raise UserError if another program writes this file as gait-trackd does.

    That appends in place, and writes new logs as NAME.unfinished.SUFFIX.
    """
    target = Path(os.path.realpath(path))
    for name in (target, target.with_name(f"{target.stem}.unfinished{target.suffix}")):
        if name.is_file():
            with open(name, "rb") as file:
                lock(file.fileno(), path, fcntl.LOCK_SH)  # does not disturb others that only look


def recover(folder: Path, stem: str, suffix: str, cut: Callable[[Path], bool] | None = None) -> None:
    """Rename our files left by killed writers, and report them; remove those without contents.

    `stem`: pattern of the names of outputs without their suffix; `cut`: cuts off what is incomplete at the
    end of a file, and returns whether anything remains; tables (.csv) are cut to whole rows.
    """
    cut = end_at_a_row if suffix == ".csv" else cut
    pattern = re.compile(rf"\.({stem})\.[0-9a-f]{{16}}{re.escape(suffix)}")
    try:
        names = [name for name in os.listdir(folder) if pattern.fullmatch(name)]
    except OSError:  # a folder that may be written, but not listed
        return
    for left in filter(_is_left, map(folder.joinpath, names)):
        target = folder / f"{pattern.fullmatch(left.name)[1]}{suffix}"  # type: ignore[index]
        with suppress(OSError):  # another command was faster
            if left.stat().st_size == 0 or (cut is not None and not cut(left)):
                left.unlink()
            else:
                keep_unfinished(left, target, "the command that wrote it was killed; what it wrote")


def end_at_a_row(table: Path) -> bool:
    """Cut off an incomplete last row; return whether any rows remain below the header."""
    if table.stat().st_size == 0:
        return False
    with table.open("r+b") as file:
        with mmap(file.fileno(), 0, access=ACCESS_READ) as whole:
            first, last = whole.find(b"\n") + 1, whole.rfind(b"\n") + 1
        file.truncate(last)
    return last > first


def is_unfinished(path: str | os.PathLike[str]) -> bool:
    """Whether a file's name marks it as unfinished."""
    return re.search(r"\.unfinished(-\d+)?$", Path(path).stem) is not None


def keep_unfinished(left: Path, target: Path, what: str = "not finished; what was written") -> None:
    """Rename an unfinished `target` to NAME.unfinished.SUFFIX, or -2, -3 ... if that exists; report it."""
    names = (f"{target.stem}.unfinished{number}{target.suffix}" for number in ("", *range(-2, -1000, -1)))
    kept = next(path for path in map(target.with_name, names) if not path.exists())
    os.replace(left, kept)
    note(f"{target}: {what} is in {kept.name}")


def _ends_early(error: BaseException) -> bool:
    """Whether the error is one after which finished work is worth keeping."""
    if isinstance(error, UnfinishedError):
        return True
    cause = error.__cause__ if isinstance(error, UserError) else error
    return isinstance(cause, KeyboardInterrupt) or (
        isinstance(cause, OSError) and cause.errno in WRITE_ERRORS
    )


def _is_left(temporary: Path) -> bool:
    """Whether a temporary file is ours, and no process is writing it any more."""
    try:
        descriptor = os.open(temporary, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        found = os.fstat(descriptor)
        is_ours = stat.S_ISREG(found.st_mode) and found.st_uid == os.geteuid()
        return is_ours and (found.st_size > 0 or time.time() - found.st_mtime > _LEFTOVER_AGE_S)
    except OSError:
        return False
    finally:
        os.close(descriptor)


def require_file(path: str | os.PathLike[str], what: str, remedy: str = "check the name") -> None:
    """Raise UserError unless `path` is a file that is not empty.

    For messages: `what`: what the file should be; `remedy`: what to do if it does not exist.
    """
    file = Path(path)
    if file.is_dir():
        raise UserError(f"{path}: is a folder; give the {what} itself")
    require_no_device(path, what)
    if not file.is_file():
        raise UserError(f"{path}: no such {what}; {remedy}")
    if file.stat().st_size == 0:
        raise UserError(f"{path}: is empty; copy or make the {what} again")


def require_no_device(path: str | os.PathLike[str], what: str) -> None:
    """Raise UserError if `path` is a device or a pipe, which may have no end; `what` it should be."""
    file = Path(path)
    if file.exists() and not file.is_file() and not file.is_dir():
        raise UserError(f"{path}: is a device or a pipe, not a file; write the {what} to a file first")


def require_writable(path: str | os.PathLike[str]) -> None:
    """Raise UserError if no file can be written at `path`; call it before long work.

    The folder must exist and be writable, and `path` must be new or a writable regular file.
    """
    _require_name(path)
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise UserError(f"{path}: is a folder; give the name of a file in it")
    if target.exists() and not target.is_file():
        raise UserError(f"{path}: is a device or a pipe, not a file; give the name of a file")
    if target.parent.is_file():
        raise UserError(f"{path}: {target.parent} is a file, not a folder; choose another place")
    if not target.parent.is_dir():
        raise UserError(f"{path}: folder {target.parent} does not exist; create it first")
    if not _takes_files(target.parent):
        raise UserError(f"{path}: folder {target.parent} cannot be written; choose another place")
    if target.exists() and not os.access(target, os.W_OK):
        raise UserError(f"{path}: is read-only; choose another name, or change its permissions")


def require_outputs(outputs: Sequence[str | None], inputs: Sequence[str | None]) -> None:
    """Raise UserError unless each output can be written, is named once, and is not an input.

    `outputs`, `inputs`: files, or None where the user gave none.
    """
    written: set[str] = set()
    for path in outputs:
        if path is None:
            continue
        require_writable(path)
        require_unread(path, inputs)
        real = os.path.realpath(path)
        if real in written:
            raise UserError(f"{path}: two outputs have this name; give each its own")
        written.add(real)


def require_unread(path: str, inputs: Sequence[str | None]) -> None:
    """Raise UserError if the output `path` is one of the inputs, which may be None."""
    if os.path.realpath(path) in {os.path.realpath(name) for name in inputs if name}:
        raise UserError(f"{path}: is read by this command; give the output another name")


@contextmanager
def making(folder: Path) -> Iterator[None]:
    """Make a folder and those above it; if the block fails, remove those that it made and that are empty."""
    new = _absent(folder)
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        with suppress(OSError):  # if it is not empty
            for made in new:
                made.rmdir()
        raise


def _absent(folder: Path) -> list[Path]:
    """Return those of a folder and the folders above it that do not exist, lowest first."""
    return [path for path in (folder, *folder.parents) if not path.exists()]


@contextmanager
def filling(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield an empty folder; if the block succeeds, move its files to the folder `path`, pages (.html) last.

    They are then on the disk even if the power fails; a page is not there before what it shows.
    UserError if there can be no such folder, as in `require_folder`, or the disk is full.
    """
    require_folder(path)
    try:
        with _filling(Path(path)) as new:
            yield new
    except OSError as error:
        if error.errno not in WRITE_ERRORS:
            raise
        raise UserError(f"{path}: {error.strerror}; choose another place") from error


@contextmanager
def _filling(folder: Path) -> Iterator[Path]:
    new = _absent(folder)
    beside = folder if folder.is_dir() else folder.parent
    with making(beside), tempfile.TemporaryDirectory(prefix=f".{folder.name}.", dir=beside) as name:
        yield Path(name)
        folder.mkdir(exist_ok=True)
        for made in new:
            _flush(made.parent)
        for pages in (False, True):
            for file in sorted(p for p in Path(name).iterdir() if (p.suffix == ".html") == pages):
                target = folder / file.name
                if file.is_file():
                    if target.is_file():
                        file.chmod(stat.S_IMODE(target.stat().st_mode))
                    _flush(file)
                os.replace(file, target)
            _flush(folder)


def require_folder(path: str | os.PathLike[str]) -> None:
    """Raise UserError if `path` cannot be a folder with new files; call it before long work."""
    _require_name(path)
    folder = Path(path).absolute()
    there = next(p for p in (folder, *folder.parents) if p.exists())
    if not there.is_dir():
        what = "is" if there == folder else f"{there} is"
        raise UserError(f"{path}: {what} a file; give the name of a folder")
    if not _takes_files(there):
        raise UserError(f"{path}: folder {there} cannot be written; choose another place")


def _takes_files(folder: Path) -> bool:
    """Whether a file can be created in a folder; permissions do not show it: in /proc not even root can."""
    try:
        with tempfile.TemporaryFile(dir=folder):
            return os.access(folder, os.W_OK)
    except OSError:
        return False


def _require_name(path: str | os.PathLike[str]) -> None:
    if not os.fspath(path):
        raise UserError("the output's name is empty; give one")


def text_lines(path: Path) -> list[str]:
    """Read the lines of a text file in any encoding that extends ASCII. UserError if it cannot be read."""
    try:
        return path.read_text(encoding="latin-1").splitlines()
    except OSError as error:
        raise unreadable(path, error) from error
