"""Gait parameters of a track with their uncertainty: strides, events, angle curves, deviation from the norm.

Writes into DIR: report.html (needs nothing else), parameters.json, strides.csv, events.csv and curves.csv.
Heel strikes are where the heel is furthest ahead of the pelvis, toe-offs where the toe is furthest behind.
From `gait track --smooth --draws D.npz` the standard deviations come from whole motions.  They say how sure
the tracker is given model and camera; what these get wrong, such as a stature off by a few per cent, comes
on top.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from gait.bindings.model import read_cyclic
from gait.body.model_curves import ModelCurves
from gait.errors import UserError
from gait.io.files import filling, require_folder
from gait.io.track_file import Track, read_track
from gait.motion.footfalls import Draws
from gait.motion.parameters import (
    QUANTITIES,
    AngleCycle,
    Parameters,
    angle_cycles,
    as_json,
    curve_rows,
    measure,
    stride_rows,
    write_csv,
    write_json,
)
from gait.report.page import Page
from gait.report.parameter_plots import angle_plot, deviation_plot, footfall_plot, path_plot, stride_plot

_SHRUNK = (
    "The tracker fills in what the image does not show from the same people, so that true deviations are "
    "larger than these, the more so for small or hidden limbs."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("track", metavar="OUT.csv", help="from gait track or gait record")
    parser.add_argument("-m", "--model", metavar="M.gait", help="the norm (the shipped model)")
    parser.add_argument("-o", "--output", metavar="DIR", help="folder for the page and tables (OUT_gait)")
    parser.add_argument("--draws", metavar="D.npz", help="motions of gait track --smooth --draws")


def run(args: argparse.Namespace) -> int:
    """Measure, write, print."""
    source = Path(args.track)
    output = args.output or source.with_name(source.stem + "_gait")
    require_folder(output)
    track = read_track(args.track)
    draws = Draws.read(args.draws, track) if args.draws else None
    try:
        parameters = measure(track, draws)
    except UserError as exc:
        raise UserError(f"{args.track}: {exc}") from None
    norm = ModelCurves(read_cyclic(args.model))
    cycles = angle_cycles(track, parameters, norm, draws)
    found = as_json(track, parameters, cycles)
    with filling(output) as folder:
        write_json(folder / "parameters.json", found)
        write_csv(folder / "events.csv", found["events"])
        write_csv(folder / "strides.csv", list(stride_rows(parameters)))
        write_csv(folder / "curves.csv", list(curve_rows(cycles)))
        page = _page(source.name, track, parameters, cycles)
        (folder / "report.html").write_text(page, encoding="utf-8")
    print(json.dumps(found, allow_nan=False) if args.json else _text(parameters))
    return 0


def _page(name: str, track: Track, parameters: Parameters, cycles: dict[str, AngleCycle]) -> str:
    page = Page(f"{name}: gait parameters")
    page.words(
        f"Frames {track.frame[0]} to {track.frame[-1]}. Means over strides without lost or ambiguous frames, "
        f"plus or minus one standard deviation of the mean; in brackets the deviation between strides. "
        f"Where the deviations come from: {parameters.source}. "
        "Asymmetry is 200 (right - left) / (right + left)."
    )
    page.grid("Parameters", ("", "right", "left", "both", "asymmetry, %"), _rows(parameters))
    page.figure("Contacts of the feet", footfall_plot(track, parameters))
    page.words(
        "Ticks: heel strikes above, toe-offs below, with two deviations. Red: lost, yellow: ambiguous."
    )
    page.figure("Strides", stride_plot(track, parameters))
    page.words("Bars: two deviations. Hollow: some frames of the stride were lost or ambiguous.")
    for trunk, heading in ((False, "Angles of the limbs"), (True, "Angles of trunk and neck")):
        drawing = angle_plot(cycles, trunk)
        if drawing is not None:
            page.figure(heading, drawing)
    if cycles:
        page.figure("Deviation from the norm", deviation_plot(cycles))
        page.words("Norm: the people the model was learned from. " + _SHRUNK)
    page.figure("Seen from above", path_plot(track, parameters))
    return page.text()


def _rows(parameters: Parameters) -> list[list[str]]:
    rows = []
    for name, row in parameters.summary().items():
        cells = [_mean(row[side], name) for side in ("right", "left", "both")]
        rows.append([QUANTITIES[name], *cells, _mean(row.get("asymmetry_percent"), "percent")])
    return rows


def _mean(value: dict[str, Any] | None, name: str) -> str:
    if value is None:
        return ""
    digits = 1 if name.endswith(("percent", "spm")) else 3
    words = f"{value['mean']:.{digits}f}"
    if value["sd"] == value["sd"]:
        words += f" ± {value['sd']:.{digits}f}"
    between = value.get("between", float("nan"))
    return words + (f" ({between:.{digits}f})" if between == between else "")


def _text(parameters: Parameters) -> str:
    """Table for the terminal."""
    rows = [["", "right", "left", "both", "asymmetry, %"], *_rows(parameters)]
    widths = [max(len(row[k]) for row in rows) for k in range(5)]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    notes = f"mean ± its deviation (between strides); deviations: {parameters.source}"
    return "\n".join(line.rstrip() for line in [*lines, notes])
