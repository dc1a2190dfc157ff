"""Measure the gait parameters of a track, with their uncertainty, against the norm of a model.

Writes into DIR: report.html (the self-contained page of gait report, without the film), parameters.json,
strides.csv, events.csv and curves.csv.  A heel strike is where the heel is furthest in front of the pelvis, a
toe-off where the toe is furthest behind it.

With the draws of gait track --smooth --draws, the standard deviations come from whole motions.  They assume
that model and camera are correct: errors of these, such as a stature that is wrong by a few per cent, come on
top.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from gait.cli import values
from gait.errors import UserError
from gait.io.files import filling, require_folder

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gait.motion.norms import Compared
    from gait.motion.parameters import Parameters

EXAMPLES = """\
examples:
  gait report track track.csv -o gait_report
  gait report track track.csv -m my.gait -o gait_report
  gait report track track.csv --draws draws.npz -o gait_report
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("track", metavar="OUT.csv", help="from gait track or gait record")
    values.add_model(parser, "model with the norm", values.TRACKED)
    parser.add_argument(
        "-o", "--output", metavar="DIR", help="folder for the page and tables (default: OUT_gait)"
    )
    values.add_norms(parser)
    parser.add_argument("--draws", metavar="D.npz", help="motions from gait track --smooth --draws")


def run(args: argparse.Namespace) -> int:
    """Measure the parameters, write page and tables, and print a summary."""
    from gait.bindings.model import read_cyclic
    from gait.io.track_file import read_track
    from gait.motion.footfalls import Draws
    from gait.motion.norms import beside_norms
    from gait.motion.parameters import as_json, measure, without_norm, write_tables
    from gait.motion.tracked_model import model_for
    from gait.motion.verdict import verdict_of
    from gait.report.run_page import Run, cycles_of, run_page

    values.require_age(args.age, args.sex)
    source = Path(args.track)
    output = args.output or source.with_name(source.stem + "_gait")
    require_folder(output)
    track = read_track(args.track)
    draws = Draws.read(args.draws, track) if args.draws else None
    try:
        parameters = measure(track, draws)
    except UserError as exc:
        raise UserError(f"{args.track}: {exc}") from None
    name = model_for(track, args.track, args.model)
    model = read_cyclic(name)
    cycles = cycles_of(track, parameters, model, draws)
    norms = beside_norms(track, parameters, model, args.age, args.sex)
    verdict, reason = verdict_of(track, parameters=parameters), without_norm(parameters, model)
    found = as_json(track, parameters, cycles)
    found |= {"model": name, "norms": [norm.as_json() for norm in norms]}
    with filling(output) as folder:
        write_tables(folder, found, parameters, cycles)
        page = run_page(Run(source.name, track, verdict, parameters, cycles, norms, reason, name))
        (folder / "report.html").write_text(page, encoding="utf-8")
    print(
        json.dumps(found, allow_nan=False)
        if args.json
        else f"{verdict.sentence()}.\n{_text(parameters, norms, reason, name)}"
    )
    return 0


def _text(parameters: Parameters, norms: Sequence[Compared], without: str, model: str) -> str:
    """Format tables for the terminal."""
    from gait.report.gait_parts import NORM_HEAD, PARAMETER_HEADER, norm_people, norm_rows, parameter_rows

    lines = []
    if parameters.counting:
        lines = _table([list(PARAMETER_HEADER), *parameter_rows(parameters)])
        notes = f"mean ± its standard deviation (between strides) over {parameters.counted()}"
        lines.append(f"{notes}; uncertainty from {parameters.source}")
    lines += [parameters.warning()] * bool(parameters.warning())
    if norms:
        lines += ["", *_table([list(NORM_HEAD), *norm_rows(norms)]), norm_people(model, parameters)]
    lines += [f"no norm: {without}"] * bool(without)
    return "\n".join(lines)


def _table(rows: list[list[str]]) -> list[str]:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    return [line.rstrip() for line in lines]
