"""The process that starts the workers; it imports what they need while this process continues."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from multiprocessing import forkserver, resource_tracker
from multiprocessing.context import BaseContext

from gait.signals import ending_signals

STAGE = "gait.learn.corpus.stage"  # what workers run; by name, to avoid importing it here
WORTH = 4 << 20  # bytes of recordings from which reading takes longer than starting workers (0.6 s per MB)


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0))


def worth(sources: Iterable[str]) -> bool:
    """Whether files and folders, without their first file, are so large that workers save time."""
    total = 0
    for path in islice(_files(sources), 1, None):
        with suppress(OSError):  # its reader reports that
            total += os.stat(path).st_size
        if total > WORTH:
            return True
    return False


def _files(sources: Iterable[str]) -> Iterator[str]:
    for source in sources:
        if os.path.isdir(source):
            for folder, _, names in os.walk(source):
                yield from (os.path.join(folder, name) for name in names)
        else:
            yield source


def context() -> BaseContext:
    """Return the context that starts workers."""
    found = multiprocessing.get_context("forkserver")
    found.set_forkserver_preload([STAGE])
    return found


def start() -> None:
    """Begin the imports; a request for a worker waits for their end."""
    context()
    resource_tracker.ensure_running()  # if the server started it, it would unblock interruptions again
    with held_back():
        forkserver.ensure_running()


@contextmanager
def held_back() -> Iterator[None]:
    """Delay interruptions to the end of the block.

    A worker that is just starting is not yet in the list of those to end, and would outlive its parent.  The
    signal mask is not enough, since another thread may receive the signal, and Python would still interrupt
    this one.
    """
    came: list[int] = []
    here = ending_signals() if threading.current_thread() is threading.main_thread() else ()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    handlers = {n: signal.signal(n, lambda number, _: came.append(number)) for n in here}
    try:
        yield
    finally:
        for n, handler in handlers.items():
            signal.signal(n, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        for number in came[:1]:
            signal.raise_signal(number)
