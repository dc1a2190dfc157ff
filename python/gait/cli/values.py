"""Values of options with their ranges, as types of `argparse`: a fault is a usage error naming the range."""

from __future__ import annotations

from argparse import ArgumentTypeError
from collections.abc import Callable

from gait.bindings.initial import STATURE
from gait.errors import UsageError

PARTICLES = (16, 1 << 20)  # as in gait.h and gait-trackd, like those below
THREADS = (1, 256)  # GAIT_POOL_MAX
SEED = (0, (1 << 64) - 1)
STREAM = (0, 30)


def whole(low: int, high: int | None = None) -> Callable[[str], int]:
    """Whole numbers in [low, high]."""

    def value(text: str) -> int:
        try:
            number = int(text)
        except ValueError:
            number = low - 1
        if number < low or (high is not None and number > high):
            wanted = f"from {low} up" if high is None else f"from {low} to {high}"
            raise ArgumentTypeError(f"{text}: give a whole number {wanted}")
        return number

    return value


def between(low: float, high: float, unit: str) -> Callable[[str], float]:
    """Numbers in [low, high], in `unit`."""

    def value(text: str) -> float:
        number = _number(text)
        if not low <= number <= high:
            raise ArgumentTypeError(f"{text}: give {unit} from {low:g} to {high:g}")
        return number

    return value


def stature(text: str) -> float:
    """Height of a person in metres."""
    low, high = STATURE
    metres = _number(text)
    if not low <= metres <= high:
        raise ArgumentTypeError(f"{text}: is not a stature; give metres from {low} to {high}")
    return metres


def positive(text: str) -> float:
    """Finite numbers above 0."""
    value = _number(text)
    if not 0 < value < float("inf"):
        raise ArgumentTypeError(f"{text}: give a number above 0")
    return value


def seconds(text: str) -> float:
    """Finite times, none or more, in seconds."""
    value = _number(text)
    if not 0 <= value < float("inf"):
        raise ArgumentTypeError(f"{text}: give seconds from 0 up")
    return value


def require_order(start: int, stop: int) -> None:
    """Raise UsageError unless there are frames from `start` up to, without, `stop`."""
    if stop <= start:
        raise UsageError(f"--stop {stop}: must be greater than --start {start}")


def _number(text: str) -> float:
    """Read a number, NaN if the text is none."""
    try:
        return float(text)
    except ValueError:
        return float("nan")
