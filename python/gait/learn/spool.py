"""Arrays kept on disk, so that the signals of a corpus need no memory."""

from __future__ import annotations

import mmap
import tempfile

import numpy as np
import numpy.typing as npt

from gait.errors import UserError

Floats = npt.NDArray[np.float64]


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
