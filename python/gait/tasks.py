"""Threads for the tracker: anything with a ``gait_tasks`` structure serves; these are Python's."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Protocol

from gait import _abi

Runner = Callable[[Callable[[int], None], int], None]
"""Called with (task, count): must call ``task(i)`` once for each i in range(count) and then return."""


class TaskSource(Protocol):
    """What a tracker needs; a pool written in C fits as well."""

    @property
    def struct(self) -> _abi.Tasks:
        """The structure given to the library; whatever it points to lives as long as this object."""

    def reraise(self) -> None:
        """Raise what went wrong in a callback since the last call."""


class PythonTasks:
    """Run the library's tasks through a Python callable.

    An exception in the callable is kept, the tasks it left undone are done in the calling thread (so the
    tracker stays sound), and `reraise` raises it after the C call.
    """

    def __init__(self, runner: Runner) -> None:
        self._runner = runner
        self._failure: BaseException | None = None
        self._callback = _abi.RunFn(self._run)
        self.struct = _abi.Tasks(self._callback, None)

    def reraise(self) -> None:
        """Raise what the callable raised, once."""
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def _run(self, user: int | None, function: Any, context: int | None, count: int) -> None:
        left = set(range(count))

        def task(i: int) -> None:
            left.remove(i)  # a second call for the same i is an error of the runner, and raises here
            function(context, i)

        try:
            self._runner(task, count)
            if left:
                raise RuntimeError(f"task runner returned with {len(left)} of {count} tasks not called")
        except BaseException as exc:  # nothing may pass through the C frames
            self._failure = exc
            for i in sorted(left):
                function(context, i)


def threads(count: int) -> PythonTasks | None:
    """Tasks on `count` threads; None for 1, where the calling thread does the work.

    The threads really run side by side: ctypes lets go of the interpreter's lock during each task.
    """
    if count < 1:
        raise ValueError("threads: at least 1")
    if count == 1:
        return None
    pool = ThreadPoolExecutor(count, thread_name_prefix="gait")

    def run(task: Callable[[int], None], tasks: int) -> None:
        for _ in pool.map(task, range(tasks)):
            pass

    return PythonTasks(run)
