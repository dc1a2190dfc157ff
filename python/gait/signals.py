"""Signals that end a command without leaving half-written files behind."""

from __future__ import annotations

import ctypes
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType

_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None)  # loaded before any child process starts


def ending_signals() -> tuple[signal.Signals, ...]:
    """SIGINT, SIGTERM and, unless it is ignored as under nohup, SIGHUP, which a closed terminal sends."""
    ignored = signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    return (signal.SIGINT, signal.SIGTERM) if ignored else (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def die_with_parent() -> None:
    """Ask Linux to end this process when its parent dies, however that happens."""
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


def end_undisturbed() -> None:
    """Ignore the signals that end a command from now on, as when a program has done its work.

    While Python unloads its modules, one would end the process as if the work had been interrupted.
    """
    for number in ending_signals():
        signal.signal(number, signal.SIG_IGN)


class Interruptible:
    """Within this block the signals that end a command raise KeyboardInterrupt.

    With `ignored`, SIGINT is left alone: Python raises KeyboardInterrupt unless SIGINT was ignored when the
    program started, as in background jobs of some shells.
    """

    def __init__(self, *, ignored: bool = False) -> None:
        self._numbers = [n for n in ending_signals() if not (ignored and n == signal.SIGINT)]
        self._held = self._asked = False

    def __enter__(self) -> Interruptible:
        self._before = []
        if threading.current_thread() is threading.main_thread():  # only the main thread can set handlers
            self._before = [(number, signal.signal(number, self._on_signal)) for number in self._numbers]
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before:
            signal.signal(number, handler)

    @contextmanager
    def uninterrupted(self) -> Iterator[None]:
        """Delay an interrupt until this block is finished."""
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
