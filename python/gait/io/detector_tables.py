"""Read keypoints in tables: CSV and HDF5 of DeepLabCut and SLEAP, TRC in pixels of Sports2D and Pose2Sim."""

from __future__ import annotations

import csv
import io
import json
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.errors import UserError, unreadable
from gait.io import plain_pickle
from gait.io.detections import Detection, Detections
from gait.io.trc import METRES, NAMED, read_trc_table

Array = NDArray[np.float64]

_PIXELS = 20.0  # if the points of a .trc without depth span more than this, they are in pixels, not metres
_DLC_LEVELS = ("scorer", "individuals", "bodyparts", "coords")


def read_dlc_csv(path: str | os.PathLike[str]) -> Detections:
    """Read DeepLabCut's CSV: three or four header lines, then one row per frame."""
    rows = _rows(path)
    levels: dict[str, list[str]] = {}
    while rows and rows[0] and rows[0][0] in _DLC_LEVELS:
        levels[rows[0][0]] = rows[0][1:]
        rows.pop(0)
    if not {"bodyparts", "coords"} <= set(levels) or not rows:
        raise UserError(f"{path}: DeepLabCut's header has lines scorer, bodyparts and coords, then frames")
    width = len(levels["coords"])
    skipped = sum(not name for name in levels["coords"])  # files of labels have them for the path
    individuals = levels.get("individuals", ["0"] * width)[skipped:]
    values = [_numbers(f"{path}: line {i}", row[1 + skipped :], width - skipped)
              for i, row in enumerate(rows, len(levels) + 1)]  # fmt: skip
    frames = [_row_frame(path, row[: 1 + skipped]) for row in rows]
    columns = [*zip(individuals, levels["bodyparts"][skipped:], levels["coords"][skipped:], strict=True)]
    return _from_columns(path, columns, np.array(frames), np.array(values))


def read_sleap_csv(path: str | os.PathLike[str]) -> Detections:
    """Read SLEAP's CSV: one row per instance, columns track, frame_idx, NODE.x, NODE.y, NODE.score."""
    head, *rows = _rows(path)
    names = [name[:-2] for name in head if name.endswith(".x")]
    if "frame_idx" not in head or not names or not all(f"{name}.y" in head for name in names):
        raise UserError(f"{path}: SLEAP's columns are track, frame_idx, NODE.x, NODE.y; export them again")
    column = {name: i for i, name in enumerate(head)}
    found = []
    for i, row in enumerate(rows, 2):
        numbers = ["" if k == column.get("track") else cell for k, cell in enumerate(row)]
        cells = _numbers(f"{path}: line {i}", numbers, len(head)) + [1.0]
        scores = [cells[column.get(f"{name}.score", -1)] for name in names]
        points = [
            [cells[column[f"{n}.x"]], cells[column[f"{n}.y"]], c] for n, c in zip(names, scores, strict=True)
        ]
        track = row[column["track"]] if "track" in column else ""
        if not np.isfinite(cells[column["frame_idx"]]):
            raise UserError(f"{path}: line {i}: frame_idx is empty; export the file again")
        found.append(Detection(int(cells[column["frame_idx"]]), track or None, np.array(points)))
    return Detections(tuple(names), found, own=True)


def read_h5(path: str | os.PathLike[str]) -> Detections:
    """Read HDF5 of DeepLabCut (a pandas table) or SLEAP (analysis).

    UserError if it is another file; ModuleNotFoundError if h5py, extra ``h5``, is missing.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            if "tracks" in file and "node_names" in file:
                return _sleap(path, file)
            if "instances" in file and "points" in file or "pred_points" in file:
                raise UserError(f"{path}: is a SLEAP project; export it as analysis HDF5 or CSV")
            for group in file.values():
                if isinstance(group, h5py.Group) and "pandas_type" in group.attrs:
                    return _pandas(path, group)
    except OSError as error:
        raise UserError(f"{path}: not a readable HDF5 file ({error}); export it again") from None
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise UserError(f"{path}: damaged HDF5 file ({error}); export it again") from None
    raise UserError(f"{path}: HDF5 from neither DeepLabCut nor SLEAP; give one of these, or CSV")


def read_pixel_trc(path: str | os.PathLike[str]) -> Detections:
    """Read a .trc of Sports2D or Pose2Sim in pixels: u to the right, v down, no depth.

    Column Time gives the frame.
    """
    labels, points, rate, _, rows = read_trc_table(Path(path), dict.fromkeys([*METRES, "px"], 1.0))
    times = np.array([row.time for row in rows])
    if not np.isfinite(times).all():
        raise UserError(f"{path}: column Time is empty; export the file again")
    flat = points[..., 2]
    visible = np.isfinite(points[..., :2]).all(axis=2) & (points[..., :2] != 0).any(axis=2)
    if not visible.any():
        raise UserError(f"{path}: no point is seen in any frame")
    span = float(np.ptp(points[..., :2][visible], axis=0).max())
    if np.nan_to_num(flat).any() or span <= _PIXELS:
        raise UserError(
            f"{path}: contains 3-D positions; keypoints are pixels without depth, as from Sports2D"
        )
    frame = np.round(times * rate).astype(int)
    found = [Detection(int(k), "0", np.column_stack([uv[:, :2], ok]))
             for k, uv, ok in zip(frame, points, visible, strict=True)]  # fmt: skip
    return Detections(tuple(labels), found, times=dict(zip(frame.tolist(), times.tolist(), strict=True)))


def is_trc(text: str) -> bool:
    """Whether text begins like a .trc file."""
    lines = text.split("\n", 3)
    return len(lines) > 2 and set(lines[1].split()) >= NAMED


def _rows(path: str | os.PathLike[str]) -> list[list[str]]:
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
        return [row for row in csv.reader(io.StringIO(text)) if row]
    except OSError as error:
        raise unreadable(path, error) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"{path}: not a CSV file in UTF-8 ({error}); export it again") from None


def _numbers(where: str, cells: Sequence[str], width: int) -> list[float]:
    """Convert cells to numbers, empty ones to NaN."""
    if len(cells) != width:
        raise UserError(f"{where} has {len(cells)} values where {width} belong; export the file again")
    try:
        return [float(cell) if cell.strip() else np.nan for cell in cells]
    except ValueError:
        bad = next(cell for cell in cells if not re.fullmatch(r"\s*[-+\d.eE]*\s*", cell))
        raise UserError(f"{where}: {bad[:40]!r} is not a number; export the file again") from None


def _row_frame(path: str | os.PathLike[str], index: Sequence[str]) -> int:
    """Return the frame of a row: its number, or the last number in its picture's name."""
    numbers = re.findall(r"\d+", re.sub(r"\.[a-zA-Z]\w*$", "", index[-1] or index[0]))
    if not numbers:
        raise UserError(f"{path}: a row is named {index[0][:40]!r}, which has no frame number")
    return int(numbers[-1])


def _from_columns(
    path: str | os.PathLike[str], columns: list[tuple[str, str, str]], frames: Array, values: Array
) -> Detections:
    """Make detections from a table (T, C) whose columns are (individual, body part, coordinate)."""
    people = list(dict.fromkeys(individual for individual, _, _ in columns))
    parts = list(dict.fromkeys(part for _, part, _ in columns))
    where = {column: i for i, column in enumerate(columns)}
    found = []
    for person in people:
        own = [part for part in parts if (person, part, "x") in where and (person, part, "y") in where]
        points = np.full((len(frames), len(parts), 3), np.nan)
        for part in own:
            at = points[:, parts.index(part)]
            at[:, 0], at[:, 1] = values[:, where[person, part, "x"]], values[:, where[person, part, "y"]]
            at[:, 2] = values[:, k] if (k := where.get((person, part, "likelihood"))) is not None else 1.0
        found += [Detection(int(k), person, p) for k, p in zip(frames, points, strict=True)
                  if np.isfinite(p[:, :2]).any()]  # fmt: skip
    if not found:
        raise UserError(f"{path}: no point is seen in any frame")
    return Detections(tuple(parts), found, own=True)


def _sleap(path: str | os.PathLike[str], file: Any) -> Detections:
    """Read SLEAP's analysis; attribute dims names the axes, which are (track, xy, node, frame) by default."""
    tracks = file["tracks"]
    dims = json.loads(tracks.attrs["dims"]) if "dims" in tracks.attrs else ["track", "xy", "node", "frame"]
    uv = np.transpose(tracks[:], [dims.index(name) for name in ("frame", "track", "node", "xy")])
    shape = [dims.index(name) for name in ("frame", "track", "node")]
    order = np.argsort(np.argsort(shape))
    score = np.transpose(file["point_scores"][:], order) if "point_scores" in file else np.ones(uv.shape[:3])
    names = tuple(_text(name) for name in file["node_names"][:])
    people = [_text(name) for name in file["track_names"][:]] if "track_names" in file else []
    ids = [*people, *(str(k) for k in range(len(people), uv.shape[1]))]
    points = np.concatenate([uv, score[..., None]], axis=3).astype(np.float64)
    found = [Detection(t, ids[k], points[t, k]) for t in range(len(points)) for k in range(len(ids))
             if np.isfinite(points[t, k, :, :2]).any()]  # fmt: skip
    if not found:
        raise UserError(f"{path}: no point is seen in any frame")
    return Detections(names, found, own=True)


def _text(value: Any) -> str:
    return value.decode("utf-8") if isinstance(value, bytes) else str(value)


def _pandas(path: str | os.PathLike[str], group: Any) -> Detections:
    """Read DeepLabCut's table, in either of the two formats of pandas."""
    kind = _text(group.attrs["pandas_type"])
    if kind == "frame_table":
        table = group["table"][:]
        columns = plain_pickle.load(group.attrs["non_index_axes"])[0][1]
        values, frames = table["values_block_0"], table["index"]
    elif kind == "frame" and int(group.attrs["nblocks"]) == 1:
        levels = int(group.attrs["axis0_nlevels"])
        named = [[_text(v) for v in group[f"block0_items_level{k}"][:]] for k in range(levels)]
        which = [group[f"block0_items_label{k}"][:] for k in range(levels)]
        cells = [[names[i] for i in at] for names, at in zip(named, which, strict=True)]
        columns = [*zip(*cells, strict=True)]
        values = group["block0_values"][:]
        numbered = "axis1" in group and np.issubdtype(group["axis1"].dtype, np.integer)
        frames = group["axis1"][:] if numbered else np.arange(len(values))
    else:
        raise UserError(f"{path}: a table of pandas that is not DeepLabCut's; export CSV")
    if len(columns[0]) not in (3, 4):
        raise UserError(f"{path}: a table of pandas that is not DeepLabCut's; export CSV")
    triples = [(str(c[-3]) if len(c) == 4 else "0", str(c[-2]), str(c[-1])) for c in columns]
    return _from_columns(path, triples, np.asarray(frames), np.asarray(values, np.float64))
