"""The per-file stage of learning: one file to a sequence or to the reason why not, wherever it runs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from threadpoolctl import ThreadpoolController

from gait.errors import UserError
from gait.learn.reading import DEFAULT, Reading
from gait.learn.sequence import Sequence, load

Outcome = Sequence | UserError


def prepare(path: Path, reading: Reading = DEFAULT) -> Outcome:
    """Read and prepare one file; what its user can mend comes back as a value, so that it can travel."""
    with one_thread():
        try:
            return load(path, reading)
        except UserError as error:
            return error


@contextmanager
def one_thread() -> Iterator[None]:
    """Let the linear algebra of numpy use one thread.

    Its bits then do not depend on the number of cores, and its small matrices are faster for it.
    """
    with _algebra().limit(limits=1, user_api="blas"):
        yield


def one_thread_for_good() -> None:
    """Do so until the process ends: where files are prepared in threads, one would end the other's limit."""
    _algebra().limit(limits=1, user_api="blas")


@cache
def _algebra() -> ThreadpoolController:
    return ThreadpoolController()
