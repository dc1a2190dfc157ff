"""Work that is done ahead of time, so that a frame that was hard to decode is not sent late."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")
_TURN = 0.1  # seconds until a full queue is looked at again


class _End:
    """Last entry of the queue: how the source ended."""

    def __init__(self, reason: BaseException | None) -> None:
        self.reason = reason


def ahead(source: Iterable[T], room: int) -> Iterator[T]:
    """Yield the items of `source`, which another thread draws up to `room` items early.

    An exception of the source is raised here, after the items before it.
    """
    waiting: queue.Queue[T | _End] = queue.Queue(room)
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
        except BaseException as exc:  # whatever it is belongs to the one who asked
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
        thread.join()
