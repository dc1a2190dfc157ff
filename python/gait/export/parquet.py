"""Parquet: all columns of one of the package's tables (.csv), with their types, without rounding."""

from __future__ import annotations

import csv
import os
from pathlib import Path

from gait._version import __version__
from gait.errors import UserError, unreadable
from gait.io.track_file import TEXT_COLUMNS, WHOLE_COLUMNS

#: Columns of words: of a track, and of the tables of a report.
_TEXT = (*TEXT_COLUMNS, "event", "side")


def write(path: Path, table: str | os.PathLike[str]) -> int:
    """Write the table of a CSV file; return the number of rows. Empty cells are null."""
    import pyarrow as pa
    from pyarrow import parquet

    try:
        with open(table, newline="", encoding="utf-8-sig") as file:
            head, *rows = list(csv.reader(file))
    except OSError as error:
        raise unreadable(table, error) from error
    except (ValueError, csv.Error) as error:
        raise UserError(f"{table}: not a CSV file ({error}); give a track or a motion") from None
    if any(len(row) != len(head) for row in rows):
        raise UserError(f"{table}: rows of different lengths; give a track or a motion")
    columns = {}
    for i, name in enumerate(head):
        cells = [row[i] or None for row in rows]
        try:
            if name in _TEXT:
                columns[name] = pa.array(cells, pa.string())
            elif name in WHOLE_COLUMNS and not any("." in cell for cell in cells if cell):
                columns[name] = pa.array([int(cell) if cell else None for cell in cells], pa.int64())
            else:  # also the frames of events, which are between frames
                columns[name] = pa.array([float(cell) if cell else None for cell in cells], pa.float64())
        except ValueError as error:
            raise UserError(f"{table}: column {name}: {error}; give a track or a motion") from None
    content = pa.table(columns).replace_schema_metadata(
        {"creator": f"libgait {__version__}", "axes": "z up", "unit": "m, s"}
    )
    parquet.write_table(content, path)
    return len(rows)
