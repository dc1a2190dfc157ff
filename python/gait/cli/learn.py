"""Learn a cyclic model of motion from motion capture.

Sources are files or folders of them: .amc with its .asf beside it, .bvh, and joint positions in .csv or .trc.
Each recording is retargeted to the default skeleton and cut into cycles by its own period; functional
principal components of all cycles give the mean curves and the ways in which people differ (Ormoneit and
others, 2000).  In a folder, a file that cannot be used is named in one line and the rest is learnt.

The model shipped with the package: gait learn ../shared/data/mocap/cmu_walk -o python/gait/data/walk.gait
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from gait import blob
from gait.cli.info import sequence_lines
from gait.files import require_writable
from gait.learn import fit, model, sources
from gait.learn.reading import Reading
from gait.progress import progress
from gait.skeleton import ANGLES

NAME = "learn"
HELP = "learn a cyclic model from motion capture"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("sources", nargs="+", metavar="SRC", help="motion files or folders of them")
    parser.add_argument("-o", "--output", required=True, metavar="M.gait", help="the model")
    parser.add_argument("--activity", default="walk", metavar="NAME", help="what the motion is called (walk)")
    parser.add_argument(
        "--components",
        type=_components,
        default=fit.DEFAULT_COMPONENTS,
        metavar="auto|N",
        help=f"how many, 1 to {fit.MOST_COMPONENTS}; auto: by held-out data ({fit.DEFAULT_COMPONENTS})",
    )
    parser.add_argument(
        "--exclude",
        nargs="+",
        action="extend",
        default=[],
        metavar="GLOB",
        help="leave out files whose path ends like this, such as 'cmu_walk/02/*'",
    )
    parser.add_argument(
        "--period-mode",
        choices=("refined", "literal"),
        default="refined",
        help="literal: whole frames from 50 to 250, as in the paper (refined)",
    )
    parser.add_argument(
        "--fps", type=_rate, metavar="F", help="frames per second (.amc: 120, .bvh: as it says)"
    )
    parser.add_argument(
        "--zeros-missing", action="store_true", help="three or more exact zeros in a row are missing data"
    )
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="of the held-out data (1)")
    parser.add_argument("--report", metavar="DIR", help="also write figures and index.html into this folder")


def _components(text: str) -> int | str:
    if text == "auto":
        return text
    if text.isdigit() and 1 <= int(text) <= fit.MOST_COMPONENTS:
        return int(text)
    raise argparse.ArgumentTypeError(f"{text!r} is neither auto nor 1 to {fit.MOST_COMPONENTS}")


def _rate(text: str) -> float:
    value = float(text)
    if not 10 <= value <= 2000:
        raise argparse.ArgumentTypeError(f"{text} is not between 10 and 2000")
    return value


def run(args: argparse.Namespace) -> int:
    """Read, learn, write, report."""
    require_writable(args.output)
    files = sources.find(args.sources, args.exclude)
    with progress("reading motion", len(files), args.quiet) as update:
        sequences, refused = sources.load_all(
            files, Reading(args.period_mode, args.fps, args.zeros_missing, args.activity), update
        )
    if not args.quiet:
        for line in refused:
            print(f"left out: {line}", file=sys.stderr)
    learned = fit.fit(sequences, args.components, args.seed)
    data = blob.write(args.output, model.sections(learned, args.activity, args.seed))
    if args.report:
        from gait.learn import report  # matplotlib is slow to import

        report.write(Path(args.report), learned, args.activity, refused)
    summary = _summary(learned, data, refused)
    print(json.dumps(summary) if args.json else _text(args.output, summary))
    return 0


def _summary(learned: fit.Learned, data: bytes, refused: list[str]) -> dict[str, Any]:
    """Figures of what was learnt."""
    rate, rate_sd, variation, length, length_sd, fps = model.gait_statistics(learned)[:6].tolist()
    residual = np.sqrt(np.nanmean(learned.residuals[:, :, : len(ANGLES)] ** 2))
    table = model.sequence_table(learned)
    return {
        "bytes": len(data),
        "crc32": f"{blob.checksum(data):08x}",
        "subjects": learned.subjects,
        "sequences": [dict(zip(model.SEQUENCE_COLUMNS, row, strict=True)) for row in table],
        "left_out": refused,
        "cycles": len(learned.components.scores),
        "components": len(learned.components.sd),
        "variance_explained": np.cumsum(learned.components.spectrum)[: len(learned.components.sd)].tolist(),
        "residual_deg": float(np.degrees(residual)),
        "held_out": learned.held_out.tolist(),
        "stride_hz": [rate, rate_sd],
        "stride_time_cv": variation,
        "stride_length_statures": [length, length_sd],
        "fps": fps,
        "alignment": learned.alignment.objective,
        "imputation": learned.components.rmse,
    }


def _text(path: str, s: dict[str, Any]) -> str:
    """Lay the figures out for people."""
    explained = " ".join(f"{100 * v:.0f}" for v in s["variance_explained"])
    lines = [
        *sequence_lines([list(row.values()) for row in s["sequences"]]),
        f"{len(s['sequences'])} sequences of {len(s['subjects'])} subjects, {s['cycles']} cycles",
        f"{s['components']} components explain {explained} %; residual {s['residual_deg']:.1f} deg",
        f"{s['stride_hz'][0]:.2f} strides/s of {s['stride_length_statures'][0]:.2f} statures",
        f"{path}: {s['bytes']} bytes, checksum {s['crc32']}",
    ]
    return "\n".join(lines)
