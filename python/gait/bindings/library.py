"""Find and load libgait, check that it matches this package, and turn its error codes into exceptions."""

from __future__ import annotations

import ctypes
import ctypes.util
import functools
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gait._version import __version__
from gait.bindings import abi
from gait.errors import GaitArgumentError, GaitError, GaitLimitError, LibraryError

if TYPE_CHECKING:
    import numpy as np  # otherwise imported where it is used, so that --help answers at once
    from numpy.typing import NDArray

_HERE = Path(__file__).resolve().parents[1]
_WHOLE = tuple("bBhHiIlLqQ")  # type codes of ctypes' integers
_RAISES = {abi.Result.ARG: GaitArgumentError, abi.Result.LIMIT: GaitLimitError}


def candidates() -> Iterator[str]:
    """Yield the files to try, in order; only ``$GAIT_LIBRARY`` if it is set."""
    chosen = os.environ.get("GAIT_LIBRARY")
    if chosen:
        yield chosen
        return
    yield str(_HERE / "lib" / "libgait.so")
    yield str(_HERE.parents[1] / "build" / "release" / "libgait.so")
    installed = ctypes.util.find_library("gait")
    if installed:
        yield installed


@functools.cache
def library() -> ctypes.CDLL:
    """Load libgait, once.

    Raises
    ------
    LibraryError
        Lists every file tried and why it was rejected.
    """
    failures = []
    for path in candidates():
        try:
            return open_library(path)
        except LibraryError as exc:
            failures.append(str(exc))
    raise LibraryError(
        f"cannot load libgait: {'; '.join(failures)} - run make lib, or set GAIT_LIBRARY to the file"
    )


def open_library(path: str) -> ctypes.CDLL:
    """Load one file and check that version, functions and layout match this package."""
    if os.sep in path and not Path(path).is_file():
        raise LibraryError(f"{path}: no such file")
    try:
        loaded = ctypes.CDLL(path)
    except OSError as exc:
        raise LibraryError(f"{path}: {exc}") from None
    try:
        abi.declare(loaded)
    except AttributeError as exc:
        raise LibraryError(f"{path}: not this version of libgait ({exc})") from None
    if loaded.gait_abi() != abi.ABI:
        raise LibraryError(f"{path}: ABI {loaded.gait_abi()}, this package needs {abi.ABI}")
    version = version_text(loaded.gait_version())
    if version != __version__:
        raise LibraryError(f"{path}: version {version}, this package is {__version__}")
    rows = abi.fields(loaded)
    if not any((row.of, row.name) == abi.NEWEST_FIELD for row in rows):
        lacking = ".".join(abi.NEWEST_FIELD)
        raise LibraryError(f"{path}: older than this package, without {lacking}; build it again")
    try:
        abi.define(rows)
    except KeyError as exc:
        raise LibraryError(f"{path}: a field has the type {exc}, unknown to this package") from None
    faults = abi.verify(rows)
    if faults:
        raise LibraryError(f"{path}: layout differs from gait.bindings.abi: {'; '.join(faults)}")
    return loaded


def struct_fields(struct: str) -> list[abi.Field]:
    """List the fields of a struct of the library, in order, as its header describes them."""
    return [row for row in abi.fields(library()) if row.of == struct and row.name]


def version_text(number: int) -> str:
    """Write ``gait_version()`` as MAJOR.MINOR.PATCH."""
    return f"{number // 10000}.{number // 100 % 100}.{number % 100}"


def check(status: int, error: abi.Error | None = None) -> int:
    """Raise a negative status as an exception with the library's text; return any other status."""
    if status >= 0:
        return status
    name = library().gait_result_name(status).decode()
    kind = _RAISES.get(abi.Result(status), GaitError)
    text, index = (error.text.decode(errors="replace"), error.index) if error else ("", -1)
    raise kind(status, name, text, index)


def call(name: str, *arguments: Any) -> int:
    """Call a function whose last argument is a ``gait_error *``; raise or return as `check` does.

    Pass structures as they are; ctypes makes the pointers.  ValueError for an integer that does not fit its
    type, which ctypes would truncate.
    """
    function = getattr(library(), name)  # first, since loading defines the structures
    for kind, value in zip(function.argtypes, arguments, strict=False):
        if isinstance(value, int) and getattr(kind, "_type_", "") in _WHOLE and kind(value).value != value:
            raise ValueError(f"{name}: {value} does not fit in {8 * ctypes.sizeof(kind)} bits; give less")
    error = abi.Error()
    return check(function(*arguments, error), error)


def make(kind: str, *arguments: Any) -> tuple[ctypes.c_void_p, NDArray[np.uint8]]:
    """Make an object with ``gait_KIND_bytes`` and ``gait_KIND_init``; return it and its memory."""
    size, handle = ctypes.c_size_t(), ctypes.c_void_p()
    call(f"gait_{kind}_bytes", *arguments, size)
    memory = aligned(size.value)
    call(f"gait_{kind}_init", memory, size.value, *arguments, handle)
    return handle, memory


def aligned(size: int) -> NDArray[np.uint8]:
    """Allocate `size` bytes at an address that is a multiple of GAIT_ALIGN."""
    import numpy as np

    space = np.zeros(size + abi.ALIGN, np.uint8)
    skip = -space.ctypes.data % abi.ALIGN
    return space[skip : skip + size]
