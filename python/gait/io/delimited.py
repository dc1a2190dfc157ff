"""Tables as text: cells separated by commas, tabs, or semicolons with decimal commas."""

from __future__ import annotations

import csv

DELIMITERS = ",;\t"


def rows(text: str) -> list[tuple[int, list[str]]]:
    """Cells of each row, with its line number; what occurs most in the first line separates them.

    Where that is a semicolon, commas below the header are decimal points.

    Raises
    ------
    csv.Error
        If it is no such text.
    """
    first = text.split("\n", 1)[0]
    delimiter = max(DELIMITERS, key=first.count)
    reader = csv.reader(text.splitlines(), delimiter=delimiter)
    found = [(reader.line_num, row) for row in reader]
    if delimiter == ";":
        found[1:] = [(line, [cell.replace(",", ".") for cell in row]) for line, row in found[1:]]
    return found
