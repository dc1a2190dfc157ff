"""The same arithmetic on every x86-64 CPU, so that the same recordings give the same model to the last bit.

When they are loaded, OpenBLAS, numpy and libm choose kernels for the CPU, whose results differ in the last
bits.  Filling gaps iterates up to hundreds of times, which can amplify this to the sixth decimal.  All three
can be restricted to the instructions of every CPU on which numpy runs (SSE4.2); learning then takes a little
longer.

`dask worker --preload-nanny gait.reproducible tcp://HOST:PORT` does this in a worker.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

COMMON = {
    "OPENBLAS_CORETYPE": "Nehalem",
    "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512_SKX X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-FMA4",
}
"""Environment of a process that uses the common kernels."""

_NO_WARNING = "ignore:During parsing environment variable:ImportWarning"  # it names what the CPU lacks
_RESTARTED = "GAIT_RESTARTED"  # set in a restarted process, so that it never restarts again


def chosen() -> dict[str, str]:
    """Return the variables of COMMON that are set in this process, with their values."""
    return {name: os.environ[name] for name in COMMON if name in os.environ}


def settle() -> None:
    """Restart this program with the same command line, unless it uses the common kernels already.

    A program typed or read from stdin cannot be restarted and keeps the kernels of its CPU.
    """
    again = sys.executable and sys.argv[0] not in ("", "-") and os.environ.get(_RESTARTED) != str(os.getpid())
    if again and _to_choose() and chosen() != COMMON:
        os.environ.update({**COMMON, _RESTARTED: str(os.getpid())})
        os.environ["PYTHONWARNINGS"] = ",".join(filter(None, (os.environ.get("PYTHONWARNINGS"), _NO_WARNING)))
        with contextlib.suppress(OSError):
            os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])


def dask_setup(_: object) -> None:
    """Make the workers that a nanny starts use the common kernels."""
    if _to_choose():
        os.environ.update(COMMON)


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Restrict numpy's linear algebra to one thread within the block.

    Its results then do not depend on the number of cores, and small matrices are faster.
    """
    with _algebra().limit(limits=1, user_api="blas"):
        yield


def one_thread_for_good() -> None:
    """Restrict numpy's linear algebra to one thread until the process ends.

    For tasks in threads, where the end of one block would lift the limit for the others.
    """
    _algebra().limit(limits=1, user_api="blas")


@contextlib.contextmanager
def one_opencv_thread() -> Iterator[None]:
    """Restrict OpenCV to one thread within the block.

    With more threads its HOG detector has a race: in one search of hundreds, some windows get other votes.
    """
    import cv2

    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)


@cache
def _algebra() -> ThreadpoolController:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def _to_choose() -> bool:
    """Whether COMMON applies to this machine: a POSIX system on x86-64."""
    return os.name == "posix" and os.uname().machine == "x86_64"
