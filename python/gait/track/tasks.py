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
        """The structure for the library; whatever it points to lives as long as this object."""

    def reraise(self) -> None:
        """Raise the exception of a callback since the last call, if any."""


class PythonTasks:
    """Run the library's tasks through a Python callable.

    If the callable raises an exception, the calling thread does the remaining tasks, so that the tracker
    stays valid, and `reraise` raises the exception after the C call.  Tasks that still run in other threads
    when the callable returns are waited for; a task that is called later raises RuntimeError in its thread.
    """

    def __init__(self, runner: Runner) -> None:
        self._runner = runner
        self._failure: BaseException | None = None
        library()  # loading it defines the structures
        self._callback = abi.RunFn(self._run)
        self.struct = abi.Tasks(self._callback, None)

    def reraise(self) -> None:
        """Raise the callable's exception, once."""
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def _run(self, user: int | None, function: Any, context: int | None, count: int) -> None:
        left, running, ended = set(range(count)), 0, False
        changed = threading.Condition()

        def task(i: int) -> None:
            nonlocal running
            with changed:
                if ended:  # the frame of this task no longer exists
                    raise RuntimeError("a task was called after its runner returned")
                left.remove(i)  # raises if the runner calls the same i twice
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
        except BaseException as exc:  # exceptions must not pass through C frames
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
    """Threads of the library (``gait_pool``), which end with this object or with the program."""

    def __init__(self, count: int) -> None:
        lib = library()
        handle, self._memory = make("pool", count)
        self.struct: abi.Tasks = lib.gait_pool_tasks(handle)
        # The memory must outlive the threads, so the finaliser refers to it too.
        weakref.finalize(self, _stop, lib, handle, self._memory, os.getpid())

    def reraise(self) -> None:
        """Do nothing: no Python code runs in these threads."""


def _stop(lib: ctypes.CDLL, handle: ctypes.c_void_p, memory: object, owner: int) -> None:
    if os.getpid() == owner:  # a child process does not have the threads
        lib.gait_pool_stop(handle)
    del memory  # not freed before this


def threads(count: int) -> PoolTasks | None:
    """Make tasks for `count` threads; None for 1, where the calling thread does the work."""
    if count < 1:
        raise ValueError("threads: at least 1")
    return PoolTasks(count) if count > 1 else None
