"""Notes and progress bars on stderr, and statistics of durations."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_PATIENCE = 2.0  # seconds of work before a bar appears
_PERIOD = 0.1  # seconds between two drawings of the bar
_WIDTH = 40  # characters
WARNING = "warning: "
"""How a line on stderr begins that is a reason not to rely on a result."""


def note(text: str, quiet: bool = False) -> None:
    """Print a line on stderr unless `quiet`."""
    if not quiet:
        print(text, file=sys.stderr, flush=True)


def warning(text: str, quiet: bool = False) -> None:
    """Print a line on stderr, marked as a warning, unless `quiet`."""
    note(f"{WARNING}{text}", quiet)


@contextmanager
def progress(what: str, total: int | None, quiet: bool = False) -> Iterator[Callable[[int], None]]:
    """Yield a function that takes the count done so far and, on a terminal, draws a bar.

    Parameters
    ----------
    what : str
        What is being done.
    total : int or None
        Count when finished; None if unknown.
    quiet : bool
        Show nothing.
    """
    shown = not quiet and sys.stderr.isatty()
    start = time.monotonic()
    due = start + _PATIENCE
    drawn = False

    def update(done: int) -> None:
        nonlocal due, drawn
        now = time.monotonic()
        if shown and now >= due:
            due, drawn = now + _PERIOD, True
            sys.stderr.write(f"\r{what} {_bar(done, total, now - start)}\x1b[K")
            sys.stderr.flush()

    try:
        yield update
    finally:
        if drawn:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()


def _bar(done: int, total: int | None, elapsed: float) -> str:
    """Bar, percentage and remaining time, or only the count if the total is unknown."""
    if not total:
        return str(done)
    share = min(done / total, 1.0)
    left = round(elapsed * (1.0 / share - 1.0)) if share else 0
    return f"[{'#' * round(share * _WIDTH):<{_WIDTH}}] {share:4.0%} {left // 60}:{left % 60:02d}"


def durations(values: ArrayLike) -> dict[str, float]:
    """Median, 99th percentile and maximum of at least one duration."""
    import numpy as np  # here, so that --help answers at once

    median, p99, longest = np.percentile(np.asarray(values, float), [50, 99, 100])
    return {"median": float(median), "p99": float(p99), "max": float(longest)}
