"""Array types of the learner, and arrays on disk, so that a corpus of any size fits in memory."""

from __future__ import annotations

import mmap
import tempfile
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.errors import UserError

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]

ROWS = 64  # rows (cycles, segments) in memory at a time


def same_columns(visible: Mask) -> list[list[int]]:
    """Group the columns of (T, M) with the same observed rows, which can share a design matrix."""
    groups: dict[bytes, list[int]] = {}
    for k, column in enumerate(visible.T):
        groups.setdefault(column.tobytes(), []).append(k)
    return list(groups.values())


def column_means(values: Floats) -> Floats:
    """Return the mean (M,) of each column of (T, M) over its finite values; NaN without any."""
    visible = np.isfinite(values)
    total = np.where(visible, values, 0).sum(axis=0)
    return np.asarray(np.where(visible.any(axis=0), total / np.maximum(visible.sum(axis=0), 1), np.nan))


def disk_full(error: OSError) -> UserError:
    """Return the error for temporary files that cannot be written."""
    return UserError(
        f"{tempfile.gettempdir()}: {error.strerror} while writing temporary files; "
        "set TMPDIR to a folder with more space"
    )


class ArrayFile:
    """A temporary file of float arrays: a context in which to write them; `views` remain valid after it.

    The file is in the folder TMPDIR.  It has no name, so the system removes it however the process ends.  The
    views are memory-mapped, and the system drops their pages when memory is short.
    """

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile(prefix="gait-")  # noqa: SIM115 (closed by __exit__)
        self._places: list[tuple[int, tuple[int, ...]]] = []
        self._size = 0

    def __enter__(self) -> ArrayFile:
        return self

    def __exit__(self, *problem: object) -> None:
        self._file.close()

    def put(self, array: Floats) -> None:
        """Append an array; UserError if the disk is full."""
        try:
            self._places.append((self._size, array.shape))
            self._size += self._file.write(np.ascontiguousarray(array, float).tobytes())
            self._file.flush()
        except OSError as error:
            raise disk_full(error) from error

    def views(self) -> list[Floats]:
        """Return all arrays in the order of `put`, read-only."""
        if not self._size:
            return [np.zeros(shape) for _, shape in self._places]
        pages = mmap.mmap(self._file.fileno(), 0, access=mmap.ACCESS_READ)
        return [
            np.frombuffer(pages, float, int(np.prod(shape)), start).reshape(shape)
            for start, shape in self._places
        ]


def stored(blocks: Iterable[Floats], row: tuple[int, ...]) -> Floats:
    """Write blocks of rows to disk and return them as one read-only array (R, *row)."""
    with ArrayFile() as file:
        for block in blocks:
            file.put(block)
        views = file.views()
    if not views:
        return np.zeros((0, *row))
    pages = _pages(views[0])
    return np.zeros((0, *row)) if pages is None else np.frombuffer(pages, float).reshape(-1, *row)


def by_rows(*arrays: npt.NDArray[Any]) -> Iterator[slice]:
    """Yield slices of ROWS rows of arrays of equal length, and `release` the arrays after each."""
    for first in range(0, len(arrays[0]), ROWS):
        yield slice(first, first + ROWS)
        release(*arrays)


def release(*arrays: npt.NDArray[Any]) -> None:
    """Drop the pages of arrays on disk from this process's memory until they are read again."""
    for array in arrays:
        pages = _pages(array)
        if pages is not None and hasattr(mmap, "MADV_DONTNEED"):
            pages.madvise(mmap.MADV_DONTNEED)


def _pages(array: npt.NDArray[Any]) -> mmap.mmap | None:
    """Find the memory map of which an array is a view; None if the array is in memory."""
    base: Any = array
    while isinstance(base, np.ndarray):
        base = base.base
    base = base.obj if isinstance(base, memoryview) else base
    return base if isinstance(base, mmap.mmap) else None
