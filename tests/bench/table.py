"""Results of the evaluations: tables on the screen, the same as .csv and .md in tests/bench/results."""

from __future__ import annotations

import csv
import io
import math
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from facts import facts

from gait.io.files import replacing

RESULTS = Path(__file__).resolve().parent / "results"
BUSY = 0.5  # load average from which figures of speed are not recorded
DIGITS = 4  # significant digits of a number that is not whole


def show(
    title: str, columns: Sequence[str], rows: Iterable[Sequence[Any]]
) -> tuple[list[str], list[list[str]], list[bool]]:
    """Print a table; return its head, its cells as text, and which columns contain numbers.

    Parameters
    ----------
    rows : iterable of sequences
        Cells: text, whole numbers, numbers (rounded to DIGITS significant digits), None or NaN (shown as -).
    """
    head, cells = [str(c) for c in columns], [[_text(v) for v in row] for row in rows]
    for row in cells:
        if len(row) != len(head):
            raise ValueError(f"{title}: {len(row)} cells {row} under {len(head)} columns")
    numbers = [all(_is_number(row[k]) for row in cells) for k in range(len(head))]
    print(f"\n{title}\n\n{aligned(head, cells, numbers)}\n", flush=True)
    return head, cells, numbers


def publish(
    name: str,
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[Any]],
    note: str = "",
    *,
    record: bool = True,
) -> None:
    """Print a table and write it to results/`name`.csv and .md, whole or not at all.

    Parameters
    ----------
    rows : iterable of sequences
        As for `show`.
    note : str
        What a reader must know to judge the numbers: data, method; paragraphs of Markdown. `facts` are added
        unless it has some.
    record : bool
        Otherwise the note is printed and nothing is written.
    """
    head, cells, numbers = show(title, columns, rows)
    if not record:
        print(note.strip())
        return
    made = "" if " at commit " in note else facts()
    parts = [f"## {title}", made, note.strip(), markdown(head, cells, numbers)]
    RESULTS.mkdir(parents=True, exist_ok=True)
    _write(RESULTS / f"{name}.csv", _csv(head, cells))
    _write(RESULTS / f"{name}.md", "\n\n".join(filter(None, parts)) + "\n")


def publish_speed(
    record: bool,
    load: float,
    name: str,
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[Any]],
    note: str,
) -> None:
    """Publish figures of speed, if asked to and if the load average before the run, `load`, is below BUSY."""
    if record and load < BUSY:
        publish(name, title, columns, rows, f"{note}\n\nLoad average before: {load:.1f}.")
        return
    show(title, columns, rows)
    if record:
        print(f"{name}: load average {load:.1f}: not recorded; wait until the host is quiet", file=sys.stderr)


def _text(value: Any) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    if isinstance(value, str | bool | int):
        return str(value)
    value = float(value)
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    before = math.floor(math.log10(abs(value))) + 1
    return f"{value:.{min(max(DIGITS - before, 0), DIGITS)}f}" if before > -2 else f"{value:.1e}"


def _is_number(text: str) -> bool:
    return text == "-" or text[:1].isdigit() or text[:2].strip("-+<>")[:1].isdigit()


def aligned(head: list[str], cells: list[list[str]], numbers: list[bool]) -> str:
    """Columns padded with blanks; those with `numbers` are aligned to the right."""
    width = [max(map(len, column)) for column in zip(head, *cells, strict=True)]
    rule = ["-" * w for w in width]
    return "\n".join(
        "  ".join(_padded(*cell) for cell in zip(row, width, numbers, strict=True)).rstrip()
        for row in [head, rule, *cells]
    )


def _padded(text: str, width: int, right: bool) -> str:
    return text.rjust(width) if right else text.ljust(width)


def markdown(head: list[str], cells: list[list[str]], numbers: list[bool]) -> str:
    """Return a table in Markdown; columns with `numbers` are aligned to the right."""
    lines = [head, ["--:" if right else "---" for right in numbers], *cells]
    return "\n".join("| " + " | ".join(c.replace("|", "\\|") for c in line) + " |" for line in lines)


def _csv(head: list[str], cells: list[list[str]]) -> str:
    text = io.StringIO()
    values = [["" if cell == "-" else cell for cell in row] for row in cells]
    csv.writer(text, lineterminator="\n").writerows([head, *values])
    return text.getvalue()


def _write(path: Path, text: str) -> None:
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
