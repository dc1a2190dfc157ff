"""Queues between two threads; and reading ahead, where another thread produces what is needed next."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Iterable
from queue import SimpleQueue
from typing import Generic, TypeVar

T = TypeVar("T")


class BoundedQueue(Generic[T]):
    """A queue in which at most `limit` items wait.

    An interrupt (KeyboardInterrupt) in the middle of a call leaves it usable.  That of the standard library,
    which is written in Python, may stay locked.
    """

    def __init__(self, limit: int) -> None:
        self._items: SimpleQueue[T] = SimpleQueue()
        self._places: SimpleQueue[None] = SimpleQueue()
        for _ in range(limit):
            self._places.put(None)

    def put(self, item: T) -> None:
        """Append an item; wait while the queue is full."""
        self._places.get()
        self._items.put(item)

    def get(self) -> T:
        """Remove and return the first item; wait while there is none."""
        item = self._items.get()
        self._places.put(None)
        return item

    def widen(self) -> None:
        """Let one item more wait."""
        self._places.put(None)


class _End:
    """Last entry of the queue, which states how the source ended."""

    def __init__(self, reason: BaseException | None) -> None:
        self.reason = reason


def ahead(
    source: Iterable[T], limit: int = 4, stop: Callable[[], None] = lambda: None
) -> Generator[T, None, None]:
    """Yield the items of `source`, which another thread reads up to `limit` items ahead.

    Frames are then decoded while earlier ones are tracked, and tracked while earlier ones are drawn and
    written.  An exception of the source is raised here, after the items before it.

    The end waits for the item that is being read; `stop` is called first, for a source that may wait long.
    """
    waiting: BoundedQueue[T | _End] = BoundedQueue(limit)
    left = threading.Event()

    def work() -> None:
        reason: BaseException | None = None
        try:
            for item in source:
                waiting.put(item)
                if left.is_set():
                    return
        except BaseException as exc:  # to be raised in the consumer's thread
            reason = exc
        waiting.put(_End(reason))

    thread = threading.Thread(target=work, name="ahead", daemon=True)
    thread.start()
    try:
        while not isinstance(item := waiting.get(), _End):
            yield item
        if item.reason is not None:
            raise item.reason
    finally:
        left.set()
        waiting.widen()  # the thread may wait for a place, now or at its end
        waiting.widen()
        stop()
        thread.join()
