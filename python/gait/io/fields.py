"""Checked reading of JSON objects and tables of text; errors are one line naming file, key and remedy."""

from __future__ import annotations

import csv
import json
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.errors import UserError, unreadable
from gait.io.files import require_file

LAST_FRAME = 2**53
"""Largest number of a frame: floating-point numbers cannot represent all larger integers."""


class Fields:
    """A mapping read from a file, with checked access and errors that name file and key.

    `where`: name of the file (and table) for messages.
    """

    def __init__(self, where: str, data: Mapping[str, Any]) -> None:
        self.where, self._data = where, data

    def __contains__(self, key: str) -> bool:
        return key in self._data

    def fail(self, key: str, what: str, remedy: str) -> UserError:
        """Return (do not raise) an error about `key`."""
        return UserError(f"{self.where}: {key} {what}; {remedy}")

    def get(self, key: str, remedy: str) -> Any:
        """Return the raw value of a required key."""
        if key not in self._data:
            raise self.fail(key, "is missing", remedy)
        return self._data[key]

    def number(self, key: str, low: float, high: float, remedy: str) -> float:
        """Return a finite number in [low, high]."""
        value = self.get(key, remedy)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.fail(key, "is not a number", remedy)
        number = _double(value)
        if not math.isfinite(number):
            raise self.fail(key, "is not finite", remedy)
        if not low <= number <= high:
            raise self.fail(key, f"is {number:g}, outside [{low:g}, {high:g}]", remedy)
        return number

    def integer(self, key: str, low: int, high: int, remedy: str) -> int:
        """Return a whole number in [low, high]; 640.0 counts as whole."""
        value = self.number(key, low, high, remedy)
        if value != int(value):
            raise self.fail(key, f"is {value:g}, not a whole number", remedy)
        return int(value)

    def array(self, key: str, shape: Sequence[int], remedy: str) -> NDArray[np.float64]:
        """Return finite numbers of exactly this shape; a column or row matrix counts as a vector."""
        array = self._numbers(key, remedy)
        if len(shape) == 1 and array.ndim == 2 and 1 in array.shape:
            array = array.ravel()
        if array.shape != tuple(shape):
            wanted, found = ("x".join(map(str, s)) or "one number" for s in (shape, array.shape))
            raise self.fail(key, f"has shape {found}, not {wanted}", remedy)
        if not np.isfinite(array).all():
            raise self.fail(key, "is not finite", remedy)
        return array

    def count(self, key: str, remedy: str) -> int:
        """Return how many numbers a key has; 1 if it is not a list."""
        return self._numbers(key, remedy).size

    def one_or_three(self, key: str, remedy: str) -> NDArray[np.float64]:
        """Return one finite number () or three (3,)."""
        return self.array(key, (3,) if self.count(key, remedy) == 3 else (), remedy)

    def _numbers(self, key: str, remedy: str) -> NDArray[np.float64]:
        value = self.get(key, remedy)
        if value is None:
            raise self.fail(key, "is null", remedy)
        try:
            if any(isinstance(each, bool | str) for each in _leaves(value)):  # NumPy converts them
                raise TypeError
            return np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise self.fail(key, "is not an array of numbers", remedy) from None

    def only(self, known: Sequence[str]) -> None:
        """Raise UserError for unknown keys, most of which are misspelt."""
        for key in self._data:
            if key not in known:
                raise self.fail(key, "is not a known key", f"use {' '.join(known)}")

    def table(self, key: str, remedy: str) -> Fields:
        """Return the mapping under `key`, empty if absent."""
        value = self._data.get(key, {})
        if not isinstance(value, Mapping):
            raise self.fail(key, "is not a table of keys", remedy)
        return Fields(f"{self.where}: {key}", value)


def _leaves(value: Any) -> Iterator[Any]:
    """Yield the values in nested lists."""
    if isinstance(value, list | tuple):
        for each in value:
            yield from _leaves(each)
    else:
        yield value


def _double(number: float) -> float:
    """Convert to a floating-point number; integers too large for one become infinite."""
    try:
        return float(number)
    except OverflowError:
        return math.inf


def read_json(path: str | os.PathLike[str], what: str) -> Fields:
    """Read a JSON object. `what`: what the file is, for messages: ``"camera"``."""
    require_file(path, f"{what} file")
    data = json_object(
        path, f"correct it, or write the {what} file again", f"{what} files are objects of keys in braces"
    )
    return Fields(str(path), data)


def json_object(
    path: str | os.PathLike[str],
    remedy: str,
    form: str,
    pairs: Callable[[list[tuple[str, Any]]], dict[str, Any]] = dict,
) -> dict[str, Any]:
    """Read a JSON file that contains one object; see `json_of`."""
    try:
        text = Path(path).read_bytes()
    except OSError as error:
        raise unreadable(path, error) from error
    return json_of(str(path), text, remedy, form, pairs)


def json_of(
    name: str,
    text: bytes,
    remedy: str,
    form: str,
    pairs: Callable[[list[tuple[str, Any]]], dict[str, Any]] = dict,
) -> dict[str, Any]:
    """Parse UTF-8 text, with or without a byte order mark, that contains one JSON object.

    For messages: `name`: where the text is from; `remedy`: what to do if it is not JSON; `form`: what to do
    if it is not an object. `pairs`: makes the mapping from pairs of keys and values, in which a key may occur
    twice. UserError with the name and the remedy.
    """
    with parsing(name, "JSON", remedy):
        data = json.loads(text.decode("utf-8-sig"), object_pairs_hook=pairs)
    if not isinstance(data, dict):
        raise UserError(f"{name}: contains no JSON object; {form}")
    return data


@contextmanager
def parsing(name: str, kind: str, remedy: str) -> Iterator[None]:
    """Turn errors of parsing JSON or TOML within the block into a UserError of one line.

    It names the file, the expected `kind` and the remedy.
    """
    try:
        yield
    except RecursionError:
        why = "brackets nested too deeply"
        raise UserError(f"{name}: not valid {kind} ({why}); {remedy}") from None
    except ValueError as error:  # syntax, encoding, or a number with thousands of digits
        raise UserError(f"{name}: not valid {kind} ({error}); {remedy}") from None


def frame_numbers(path: str | os.PathLike[str], column: NDArray[np.float64]) -> NDArray[np.int64]:
    """Convert column `frame` of a table, whose rows start in line 2, to numbers of frames.

    UserError, with the first bad line, unless they are whole numbers that increase.
    """
    wrong = (column != column.round()) | (np.abs(column) > LAST_FRAME)
    wrong[1:] |= np.diff(column) <= 0
    if wrong.any():
        i = int(np.argmax(wrong))
        raise UserError(
            f"{path}: line {i + 2}: frame is {column[i]:g}; it must be whole numbers that increase, at most "
            f"{LAST_FRAME}"
        )
    return column.astype(np.int64)


DELIMITERS = ",;\t"


def table_rows(text: str) -> list[tuple[int, list[str]]]:
    """Yield the cells of each row and its line number; the separator most frequent in the first line is used.

    If that is a semicolon, commas below the header are decimal commas.

    csv.Error if the text is not a table.
    """
    first = text.split("\n", 1)[0]
    delimiter = max(DELIMITERS, key=first.count)
    reader = csv.reader(text.splitlines(), delimiter=delimiter)
    found = [(reader.line_num, row) for row in reader]
    if delimiter == ";":
        found[1:] = [(line, [cell.replace(",", ".") for cell in row]) for line, row in found[1:]]
    return found
