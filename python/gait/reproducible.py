"""The same arithmetic on every x86-64 CPU, so that the same recordings give the same model to the last bit.

OpenBLAS, numpy and libm choose their kernels by the CPU when they are loaded, and their last bits differ.
The filling of gaps takes up to hundreds of steps, each by those before, and may carry that to the sixth
decimal.  All three can be made to use what every CPU has that numpy runs on (SSE4.2); learning takes a
little longer.

`dask worker --preload-nanny gait.reproducible tcp://HOST:PORT` does so in a worker.
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

_NO_WARNING = "ignore:During parsing environment variable:ImportWarning"  # numpy names features it lacks
_RESTARTED = "GAIT_RESTARTED"  # process that was restarted: never twice, even if COMMON is reset at its start


def chosen() -> dict[str, str]:
    """Return those of COMMON's names that this process was given, with their values."""
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
    """Let the workers that a nanny starts use the common kernels."""
    if _to_choose():
        os.environ.update(COMMON)


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Let the linear algebra of numpy use one thread within the block.

    Its bits then do not depend on the number of cores, and its small matrices are faster.
    """
    with _algebra().limit(limits=1, user_api="blas"):
        yield


def one_thread_for_good() -> None:
    """Do so until the process ends: where tasks run in threads, one would end the other's limit."""
    _algebra().limit(limits=1, user_api="blas")


@contextlib.contextmanager
def one_opencv_thread() -> Iterator[None]:
    """Let OpenCV use one thread within the block.

    Its HOG detector races with more: one search in hundreds gives some windows other votes.
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
    """Whether COMMON applies to this machine."""
    return os.name == "posix" and os.uname().machine == "x86_64"
