"""The end of commands that go on until somebody ends them."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Ending:
    """Makes SIGINT, which jobs of a script (``&``) ignore, and SIGTERM a KeyboardInterrupt in the block."""

    def __init__(self) -> None:
        self._busy = self._asked = False

    def __enter__(self) -> Ending:
        self._before = [(number, signal.signal(number, self._on_signal)) for number in _SIGNALS]
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before:
            signal.signal(number, handler)

    @contextmanager
    def whole(self) -> Iterator[None]:
        """Let what is in this block be done before the interrupt comes."""
        self._busy = True
        try:
            yield
        finally:
            self._busy = False
        if self._asked:
            raise KeyboardInterrupt

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self._asked = True
        if not self._busy:
            raise KeyboardInterrupt
