"""Threads of the library from Python: they come, work and go."""

import gc
import os
from pathlib import Path

import pytest

from gait import GaitLimitError
from gait.bindings import abi
from gait.track.tasks import threads

LISTING = Path("/proc/self/task")


def alive() -> int:
    """Threads of this process."""
    return len(list(LISTING.iterdir()))


@pytest.mark.skipif(not LISTING.exists(), reason="no /proc to count threads in")
def test_threads_end_with_their_object():
    before = alive()
    pool = threads(4)
    assert alive() == before + 3
    del pool
    gc.collect()
    assert alive() == before


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
