"""Run tasks in several processes of this machine; outcomes are in the order of the files.

Workers write outcomes to files and send only the names through the pipe.  If a worker were killed within a
message, the reader would wait forever, but such short messages are written completely or not at all.
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
from gait.learn.arrays import disk_full
from gait.learn.corpus import forkserver
from gait.learn.corpus.stage import Prepared, Task

#: Seconds to start the workers, which import the package again (measured: 0.4 to 0.6).
START = 0.6
FILES_PER_WORKER = 4  # files in flight per worker, which limits the outcomes that wait


def prepared(tasks: Sequence[Task], jobs: int) -> Generator[Prepared, None, None]:
    """Yield the outcomes of tasks in their order.

    Tasks run in this process until their time shows that a pool of up to `jobs` workers would finish the rest
    sooner; the outcomes are the same.
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
        outcome = task.run()
        spent, done = spent + time.perf_counter() - begun, done + sizes[i]
        yield outcome


def _size(path: Path) -> int:
    try:
        return max(1, path.stat().st_size)
    except OSError:  # it has disappeared; its reader reports that
        return 1


def _pooled(tasks: Sequence[Task], workers: int) -> Generator[Prepared, None, None]:
    """Yield outcomes from a pool; if a worker dies, the tasks then in flight run one by one."""
    waiting, flying = deque(tasks), deque[tuple[Task, Future[str]]]()
    while waiting:
        try:
            with _pool(workers) as (pool, folder):
                while waiting or flying:
                    while waiting and len(flying) < FILES_PER_WORKER * workers:
                        flying.append((waiting[0], _submit(pool, waiting[0], folder)))
                        waiting.popleft()
                    outcome = _fetched(flying[0][1].result())
                    flying.popleft()
                    yield outcome
        except BrokenProcessPool:
            yield from (_alone(task) for task, _ in flying)
            flying.clear()


def _alone(task: Task) -> Prepared:
    """Run one task in its own process, so that a crash can be attributed to it."""
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
    """Provide workers and their folder; both are removed at the end, immediately after an exception."""
    others = set(multiprocessing.active_children())
    with tempfile.TemporaryDirectory(prefix="gait-") as folder:
        context = forkserver.context()
        pool = ProcessPoolExecutor(count, context, initializer=_follow_parent, initargs=(folder,))
        try:
            yield pool, folder
        except BaseException:
            with forkserver.held_back():
                for child in set(multiprocessing.active_children()) - others:
                    child.kill()
            raise
        finally:
            pool.shutdown(cancel_futures=True)


def _submit(pool: ProcessPoolExecutor, task: Task, folder: str) -> Future[str]:
    """Submit a task; workers started by this ignore Ctrl-C, which only their parent handles."""
    with forkserver.held_back():
        return pool.submit(_stored, task, folder)


def _stored(task: Task, folder: str) -> str:
    """Run a task in a worker and return the name of the file in `folder` with the outcome."""
    outcome = task.run()
    try:
        with tempfile.NamedTemporaryFile(dir=folder, delete=False) as file:
            pickle.dump(outcome, file)
    except OSError as error:
        raise disk_full(error) from error
    return file.name


def _fetched(name: str) -> Prepared:
    """Read the outcome from its file and remove the file."""
    with open(name, "rb") as file:
        outcome: Prepared = pickle.load(file)
    os.unlink(name)
    return outcome


def _follow_parent(folder: str) -> None:
    """End this worker and remove its folder when its parent has ended, even if that was killed."""

    def watch() -> None:
        parent = multiprocessing.parent_process()
        if parent is not None:
            parent.join()
            shutil.rmtree(folder, ignore_errors=True)
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
