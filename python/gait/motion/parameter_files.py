"""What `gait report track` writes beside its page: JSON for programs, CSV for tables."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gait.io.files import replacing
from gait.io.track_file import Track
from gait.motion.angle_cycles import PERCENT, AngleCycle
from gait.motion.footfalls import SIDES
from gait.motion.parameters import QUANTITIES, Parameters


def as_json(track: Track, parameters: Parameters, cycles: Mapping[str, AngleCycle]) -> dict[str, Any]:
    """Everything but the curves, for JSON: what is not known is null."""
    found = {
        "frames": [int(track.frame[0]), int(track.frame[-1])],
        "uncertainty": parameters.source,
        "summary": parameters.summary(),
        "events": list(events(track, parameters)),
        "strides": list(strides(parameters)),
        "angles": {name: cycle.summary() for name, cycle in cycles.items()},
    }
    clean: dict[str, Any] = _without_nan(found)
    return clean


def events(track: Track, parameters: Parameters) -> Iterator[dict[str, Any]]:
    """Strikes and toe-offs in the order of time."""
    rows: list[dict[str, Any]] = []
    for side in SIDES:
        for kind in ("strike", "off"):
            times = getattr(parameters.events, kind)[side]
            for time, sd in zip(times, getattr(parameters.event_sd, kind)[side], strict=True):
                frame = float(np.interp(time, track.time, track.frame))
                rows.append(
                    {
                        "event": f"{side}_{_EVENT[kind]}",
                        "time_s": float(time),
                        "frame": frame,
                        "sd_s": float(sd),
                    }
                )
    yield from sorted(rows, key=lambda row: row["time_s"])


_EVENT = {"strike": "heel_strike", "off": "toe_off"}


def strides(parameters: Parameters) -> Iterator[dict[str, Any]]:
    """Strides in the order of their start, each quantity with its deviation."""
    rows = []
    for side in SIDES:
        s = parameters.strides[side]
        for k in range(len(s.start)):
            row: dict[str, Any] = {"side": side, "start_s": float(s.start[k]), "end_s": float(s.end[k])}
            row["sure"] = bool(s.sure[k])
            for name in QUANTITIES:
                row[name], row[f"{name}_sd"] = float(s.values[name][k]), float(s.sd[name][k])
            rows.append(row)
    yield from sorted(rows, key=lambda row: row["start_s"])


def curves(cycles: Mapping[str, AngleCycle]) -> Iterator[dict[str, Any]]:
    """Mean, deviation, norm and its deviation of every angle at each percent of the stride, degrees."""
    for i, percent in enumerate(PERCENT):
        row: dict[str, Any] = {"percent": int(percent)}
        for name, c in cycles.items():
            for part in ("mean", "sd", "norm_mean", "norm_sd"):
                row[f"{name}_{part}_deg"] = float(getattr(c, part)[i])
        yield row


def write_json(path: str | os.PathLike[str], found: Mapping[str, Any]) -> None:
    """Write a JSON file."""
    with replacing(path) as temporary:
        text = json.dumps(found, indent=1, allow_nan=False) + "\n"
        Path(temporary).write_text(text, encoding="utf-8")


def write_csv(path: str | os.PathLike[str], rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows of the same keys; what is not known is left empty."""
    with replacing(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(rows[0] if rows else ())
        for row in rows:
            table.writerow([_cell(value) for value in row.values()])


def _cell(value: Any) -> Any:
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value:.5f}"
    return int(value) if isinstance(value, bool) else value


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and np.isnan(value) else value
