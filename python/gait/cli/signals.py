"""Signals: SIGTERM and SIGHUP end a command as Ctrl-C does, so that no temporary file stays behind."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType

from gait.ending import ending_signals


class Interruptible:
    """In this block the signals that end a command raise KeyboardInterrupt.

    SIGINT does so anyway, unless the shell lets background jobs ignore it; `ignored` leaves it at that.
    """

    def __init__(self, *, ignored: bool = False) -> None:
        self._numbers = [n for n in ending_signals() if not (ignored and n == signal.SIGINT)]
        self._held = self._asked = False

    def __enter__(self) -> Interruptible:
        self._before = []
        if threading.current_thread() is threading.main_thread():  # only there handlers can be set
            self._before = [(number, signal.signal(number, self._on_signal)) for number in self._numbers]
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before:
            signal.signal(number, handler)

    @contextmanager
    def uninterrupted(self) -> Iterator[None]:
        """Finish this block before the interrupt is raised."""
        self._held = True
        try:
            yield
        finally:
            self._held = False
        if self._asked:
            raise KeyboardInterrupt

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self._asked = True
        if not self._held:
            raise KeyboardInterrupt
