"""Threads of the library in Python: they are started, work and end."""

import gc
import os
import threading
from pathlib import Path

import pytest

from gait import GaitLimitError
from gait.bindings import abi
from gait.bindings.library import make
from gait.track.tasks import PythonTasks, threads

LISTING = Path("/proc/self/task")


def alive() -> set[str]:
    """Threads of this process."""
    return {thread.name for thread in LISTING.iterdir()}


@pytest.mark.skipif(not LISTING.exists(), reason="no /proc to count threads in")
def test_threads_end_with_their_object():
    before = alive()
    pool = threads(4)
    started = alive() - before
    assert len(started) == 3
    del pool
    gc.collect()
    assert not alive() & started


def test_every_task_is_called_once():
    pool = threads(3)
    called = []
    function = abi.TaskFn(lambda context, i: called.append(i))
    for count in (0, 1, 100):
        called.clear()
        pool.struct.run(pool.struct.user, function, None, count)
        assert sorted(called) == list(range(count))


def test_one_thread_is_the_callers_and_too_many_are_refused():
    assert threads(1) is None
    with pytest.raises(GaitLimitError, match="give 1 to"):
        threads(100_000)


def test_a_child_process_works_and_ends():
    pool = threads(2)
    child = os.fork()
    if child == 0:
        done = []
        function = abi.TaskFn(lambda context, i: done.append(i))
        pool.struct.run(pool.struct.user, function, None, 5)
        del pool
        gc.collect()
        os._exit(len(done))
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 5


@pytest.mark.parametrize("early", ["running", "queued"])
def test_a_runner_that_returns_early_leaves_no_late_calls(early):
    """Its tasks belong to a C frame: running ones are waited for, later ones are rejected."""
    called, late, refused = [], [], []
    begun, go_on, queue_on = threading.Event(), threading.Event(), threading.Event()

    def work(context, i):
        begun.set()
        if i == 0 and early == "running":
            assert go_on.wait(60)
        assert not over, "called after the frame"
        called.append(i)

    def runner(task, count):
        def in_thread():
            if early == "queued":
                assert queue_on.wait(60)
            try:
                task(0)
            except RuntimeError as error:
                refused.append(str(error))

        late.append(threading.Thread(target=in_thread))
        late[0].start()
        if early == "running":
            assert begun.wait(60)
            threading.Timer(0.05, go_on.set).start()

    over: list[bool] = []
    tasks, function = PythonTasks(runner), abi.TaskFn(work)
    tasks.struct.run(tasks.struct.user, function, None, 3)
    over.append(True)
    queue_on.set()
    late[0].join(60)
    assert sorted(called) == [0, 1, 2]
    assert len(refused) == (early == "queued")
    with pytest.raises(RuntimeError, match="task runner returned without"):
        tasks.reraise()


@pytest.mark.parametrize("count", [2**32 + 2, -(2**31) - 1, 2**63])
def test_whole_numbers_that_do_not_fit_are_refused(count):
    with pytest.raises(ValueError, match=f"{count} does not fit in 32 bits"):
        make("pool", count)
