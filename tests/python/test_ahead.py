"""Reading ahead in another thread."""

import signal
import subprocess
import sys
import threading

import pytest

from gait import UserError
from gait.ahead import BoundedQueue, ahead


def test_work_ahead_keeps_order_and_raises_at_its_place():
    def source():
        yield from range(5)
        raise UserError("broken")

    items = ahead(source(), 2)
    assert [next(items) for _ in range(5)] == list(range(5))
    with pytest.raises(UserError, match="broken"):
        next(items)


def test_work_ahead_stops_when_no_more_is_wanted():
    drawn = []

    def source():
        for i in range(1000):
            drawn.append(i)
            yield i

    items = ahead(source(), 3)
    assert next(items) == 0
    items.close()
    assert len(drawn) <= 6 and not any(t.name == "ahead" for t in threading.enumerate())


def test_a_queue_holds_no_more_than_its_limit():
    queue: BoundedQueue[int] = BoundedQueue(2)
    put = []

    def work():
        for i in range(4):
            queue.put(i)
            put.append(i)

    thread = threading.Thread(target=work)
    thread.start()
    assert [queue.get(), queue.get()] == [0, 1]
    queue.widen()
    assert [queue.get(), queue.get()] == [2, 3]
    thread.join()
    assert put == [0, 1, 2, 3]


INTERRUPTED = """
import signal, threading
from gait.ahead import BoundedQueue

def interrupt(*_):
    raise KeyboardInterrupt

signal.signal(signal.SIGALRM, interrupt)
for turn in range(4000):
    queue = BoundedQueue(4)
    thread = threading.Thread(target=lambda: [None for _ in iter(queue.get, None)])
    thread.start()
    try:
        signal.setitimer(signal.ITIMER_REAL, 1e-4 + turn % 7 * 1e-5)
        while True:
            queue.put(turn)
    except KeyboardInterrupt:
        pass
    queue.widen()
    queue.put(None)
    thread.join()
print("usable")
"""


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs a timer that interrupts")
def test_an_interrupt_leaves_a_queue_usable():
    done = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, timeout=240)
    assert done.stdout == "usable\n", done.stderr
