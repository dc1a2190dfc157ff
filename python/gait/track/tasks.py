"""Threads for the tracker: the library's own, or anything that runs numbered tasks."""

from __future__ import annotations

import ctypes
import os
import threading
import weakref
from collections.abc import Callable
from typing import Any, Protocol

from gait.bindings import abi
from gait.bindings.library import library, make

Runner = Callable[[Callable[[int], None], int], None]
"""Called with (task, count): must call ``task(i)`` once for each i in range(count) and then return."""


class TaskSource(Protocol):
    """What a tracker needs; a pool written in C fits as well."""

    @property
    def struct(self) -> abi.Tasks:
        """The structure given to the library; whatever it points to lives as long as this object."""

    def reraise(self) -> None:
        """Raise what went wrong in a callback since the last call."""


class PythonTasks:
    """Run the library's tasks through a Python callable.

    An exception in the callable is kept, the tasks it left undone are done in the calling thread (so the
    tracker stays sound), and `reraise` raises it after the C call.  Tasks that still run in other threads
    when the callable returns are waited for; a task that is called later raises RuntimeError in its thread.
    """

    def __init__(self, runner: Runner) -> None:
        self._runner = runner
        self._failure: BaseException | None = None
        library()  # describes the structures
        self._callback = abi.RunFn(self._run)
        self.struct = abi.Tasks(self._callback, None)

    def reraise(self) -> None:
        """Raise what the callable raised, once."""
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def _run(self, user: int | None, function: Any, context: int | None, count: int) -> None:
        left, running, ended = set(range(count)), 0, False
        changed = threading.Condition()

        def task(i: int) -> None:
            nonlocal running
            with changed:
                if ended:  # the frame that the task belongs to is gone
                    raise RuntimeError("a task was called after its runner returned")
                left.remove(i)  # a second call for the same i is an error of the runner, and raises here
                running += 1
            try:
                function(context, i)
            finally:
                with changed:
                    running -= 1
                    changed.notify_all()

        failure: BaseException | None = None
        try:
            self._runner(task, count)
        except BaseException as exc:  # nothing may pass through the C frames
            failure = exc
        with changed:
            ended = True
            changed.wait_for(lambda: running == 0)
        if left and failure is None:
            failure = RuntimeError(f"task runner returned without calling {len(left)} of {count} tasks")
        for i in sorted(left):
            function(context, i)
        if failure is not None:
            self._failure = failure


class PoolTasks:
    """Threads of the library (``gait_pool``); they end with this object or with the program."""

    def __init__(self, count: int) -> None:
        lib = library()
        handle, self._memory = make("pool", count)
        self.struct: abi.Tasks = lib.gait_pool_tasks(handle)
        # The memory must outlive the threads: the finaliser holds it as well.
        weakref.finalize(self, _stop, lib, handle, self._memory, os.getpid())

    def reraise(self) -> None:
        """Nothing of Python runs in these threads."""


def _stop(lib: ctypes.CDLL, handle: ctypes.c_void_p, memory: object, owner: int) -> None:
    if os.getpid() == owner:  # a child process has no threads to wait for
        lib.gait_pool_stop(handle)
    del memory  # held until here


def threads(count: int) -> PoolTasks | None:
    """Tasks on `count` threads; None for 1, where the calling thread does the work."""
    if count < 1:
        raise ValueError("threads: at least 1")
    return PoolTasks(count) if count > 1 else None
