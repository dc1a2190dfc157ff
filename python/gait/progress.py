"""Progress on stderr for work of more than two seconds; nothing when stderr is not a terminal."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import Progress

_PATIENCE = 2.0  # seconds of work before a bar appears


@contextmanager
def progress(words: str, total: int | None, quiet: bool = False) -> Iterator[Callable[[int], None]]:
    """Yield a function to call with the count done so far.

    Parameters
    ----------
    words : str
        What is being done.
    total : int or None
        Count when finished; None if unknown.
    quiet : bool
        Show nothing.
    """
    console = Console(stderr=True)
    bar = Progress(console=console, transient=True, disable=quiet or not console.is_terminal)
    begun = time.monotonic()
    task = None

    def update(done: int) -> None:
        nonlocal task
        if task is None and time.monotonic() - begun > _PATIENCE:
            bar.start()
            task = bar.add_task(words, total=total)
        if task is not None:
            bar.update(task, completed=done)

    try:
        yield update
    finally:
        if task is not None:
            bar.stop()
