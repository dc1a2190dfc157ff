"""Read ahead: another thread produces what is needed next."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Generator, Iterable
from typing import TypeVar

T = TypeVar("T")
_TURN = 0.1  # seconds between attempts to append to a full queue


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
    waiting: queue.Queue[T | _End] = queue.Queue(limit)
    left = threading.Event()

    def put(item: T | _End) -> bool:
        while not left.is_set():
            try:
                waiting.put(item, timeout=_TURN)
            except queue.Full:
                continue
            return True
        return False

    def work() -> None:
        reason: BaseException | None = None
        try:
            for item in source:
                if not put(item):
                    return
        except BaseException as exc:  # to be raised in the consumer's thread
            reason = exc
        put(_End(reason))

    thread = threading.Thread(target=work, name="ahead", daemon=True)
    thread.start()
    try:
        while not isinstance(item := waiting.get(), _End):
            yield item
        if item.reason is not None:
            raise item.reason
    finally:
        left.set()
        stop()
        thread.join()
