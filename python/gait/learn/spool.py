"""Arrays kept on disk, so that the signals and cycles of a corpus need no memory."""

from __future__ import annotations

import mmap
import tempfile
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.errors import UserError

Floats = npt.NDArray[np.float64]

ROWS = 64  # cycles that are in memory at a time


def no_room(error: OSError) -> UserError:
    """Make the error for temporary files that cannot be written."""
    return UserError(
        f"{tempfile.gettempdir()}: {error.strerror} while sequences were put there; "
        "set TMPDIR to a folder with more room"
    )


class Spool:
    """A temporary file of arrays: a context in which they are put, then read as views that outlive it.

    The file has no name, so the system removes it however the process ends.  It lies in the folder that
    TMPDIR names.  The views are pages of the file: the system drops them from memory when it needs room.
    """

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile(prefix="gait-")  # noqa: SIM115 (closed by __exit__)
        self._places: list[tuple[int, tuple[int, ...]]] = []

    def __enter__(self) -> Spool:
        return self

    def __exit__(self, *problem: object) -> None:
        self._file.close()

    def put(self, array: Floats) -> None:
        """Append an array.

        Raises
        ------
        UserError
            If the disk is full.
        """
        try:
            self._places.append((self._file.tell(), array.shape))
            self._file.write(np.ascontiguousarray(array, float).tobytes())
            self._file.flush()
        except OSError as error:
            raise no_room(error) from error

    def views(self) -> list[Floats]:
        """All arrays in the order of `put`, read-only."""
        if not self._file.tell():
            return [np.zeros(shape) for _, shape in self._places]
        pages = mmap.mmap(self._file.fileno(), 0, access=mmap.ACCESS_READ)
        return [
            np.frombuffer(pages, float, int(np.prod(shape)), start).reshape(shape)
            for start, shape in self._places
        ]


def stored(parts: Iterable[Floats], row: tuple[int, ...]) -> Floats:
    """Put blocks of rows, one below the other, on disk; row: the shape of one.

    Returns
    -------
    rows : (R, ...)
        Read-only, as the views of a Spool.
    """
    with Spool() as spool:
        for part in parts:
            spool.put(part)
        views = spool.views()
    if not views:
        return np.zeros((0, *row))
    pages = _pages(views[0])
    return np.zeros((0, *row)) if pages is None else np.frombuffer(pages, float).reshape(-1, *row)


def by_rows(*arrays: npt.NDArray[Any]) -> Iterator[slice]:
    """Give slices of ROWS rows of arrays of one length; after each, see `release`."""
    for first in range(0, len(arrays[0]), ROWS):
        yield slice(first, first + ROWS)
        release(*arrays)


def release(*arrays: npt.NDArray[Any]) -> None:
    """Take what lies on disk out of this process's memory until it is read again."""
    for array in arrays:
        pages = _pages(array)
        if pages is not None and hasattr(mmap, "MADV_DONTNEED"):
            pages.madvise(mmap.MADV_DONTNEED)


def _pages(array: npt.NDArray[Any]) -> mmap.mmap | None:
    """Find the file's pages that an array is a view of; None if it lies in memory."""
    base: Any = array
    while isinstance(base, np.ndarray):
        base = base.base
    base = base.obj if isinstance(base, memoryview) else base
    return base if isinstance(base, mmap.mmap) else None
