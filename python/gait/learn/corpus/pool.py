"""The per-file stage in several processes of this machine, in the order of the files.

Outcomes come from the workers as files, and only the files' names through the pipe: whoever reads half of a
message of a worker that was killed waits for ever, but so short a message is written whole or not at all.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import shutil
import tempfile
import threading
import time
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path

from gait.errors import UserError
from gait.learn.corpus import fork_server
from gait.learn.corpus.stage import Prepared, Task
from gait.learn.spool import no_room

#: Seconds that starting the workers costs: they import the package anew (measured: 0.4 to 0.6).
START = 0.6
AHEAD = 4  # files in flight per worker: what waits its turn stays little


def prepared(tasks: Sequence[Task], jobs: int) -> Generator[Prepared, None, None]:
    """Outcomes of files in their order.

    Files are prepared here until their time says that the rest would gain from a pool of up to `jobs`
    workers; the outcomes are the same.
    """
    sizes = [_size(task.path) for task in tasks]
    spent, done = 0.0, 0
    for i, task in enumerate(tasks):
        workers = min(jobs, len(tasks) - i)
        rest = spent / max(done, 1) * sum(sizes[i:])
        if workers > 1 and rest * (1 - 1 / workers) > START:
            yield from _pooled(tasks[i:], workers)
            return
        begun = time.perf_counter()
        outcome = task.done()
        spent, done = spent + time.perf_counter() - begun, done + sizes[i]
        yield outcome


def _size(path: Path) -> int:
    try:
        return max(1, path.stat().st_size)
    except OSError:  # gone since it was found: its reader says so
        return 1


def _pooled(tasks: Sequence[Task], workers: int) -> Generator[Prepared, None, None]:
    """Outcomes from a pool; if a worker dies, the files then in flight are done one by one."""
    waiting, flying = deque(tasks), deque[tuple[Task, Future[str]]]()
    while waiting:
        try:
            with _pool(workers) as (pool, folder):
                while waiting or flying:
                    while waiting and len(flying) < AHEAD * workers:
                        flying.append((waiting[0], _submit(pool, waiting[0], folder)))
                        waiting.popleft()
                    outcome = _fetched(flying[0][1].result())
                    flying.popleft()
                    yield outcome
        except BrokenProcessPool:
            yield from (_alone(task) for task, _ in flying)
            flying.clear()


def _alone(task: Task) -> Prepared:
    """Outcome of one file in a process of its own, so that its death has a name."""
    try:
        with _pool(1) as (pool, folder):
            return _fetched(_submit(pool, task, folder).result())
    except BrokenProcessPool:
        killed = UserError(
            f"{task.path}: the process that read it was killed (out of memory?); "
            "leave it out with --exclude or cut the recording"
        )
        return Prepared(refused=killed)


@contextmanager
def _pool(count: int) -> Iterator[tuple[ProcessPoolExecutor, str]]:
    """Worker processes and their folder, gone at the end, at once if the end is an exception."""
    others = set(multiprocessing.active_children())
    with tempfile.TemporaryDirectory(prefix="gait-") as folder:
        context = fork_server.context()
        pool = ProcessPoolExecutor(count, context, initializer=_follow_parent, initargs=(folder,))
        try:
            yield pool, folder
        except BaseException:
            with fork_server.held_back():
                for child in set(multiprocessing.active_children()) - others:
                    child.kill()
            raise
        finally:
            pool.shutdown(cancel_futures=True)


def _submit(pool: ProcessPoolExecutor, task: Task, folder: str) -> Future[str]:
    """Submit a file; workers started by this inherit that Ctrl-C is not for them but for their parent."""
    with fork_server.held_back():
        return pool.submit(_stored, task, folder)


def _stored(task: Task, folder: str) -> str:
    """Prepare a file in a worker: name of the file in `folder` that holds the outcome."""
    outcome = task.done()
    try:
        with tempfile.NamedTemporaryFile(dir=folder, delete=False) as file:
            pickle.dump(outcome, file)
    except OSError as error:
        raise no_room(error) from error
    return file.name


def _fetched(name: str) -> Prepared:
    """Take the outcome out of its file."""
    with open(name, "rb") as file:
        outcome: Prepared = pickle.load(file)
    os.unlink(name)
    return outcome


def _follow_parent(folder: str) -> None:
    """End this worker, and its folder, when its parent is gone, even if that was killed."""

    def watch() -> None:
        parent = multiprocessing.parent_process()
        if parent is not None:
            parent.join()
            shutil.rmtree(folder, ignore_errors=True)
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
