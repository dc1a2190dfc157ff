"""Make a one-page report of a run: verdict, film with the figure, 3-D figure, gait, angles, errors.

RUN is a track from gait track, or a log from gait record --log (or lcm-logger).  With a log, --track names
the track that was recorded with it, and the page also shows dropped frames and latency.  The camera is
--camera, or camera.json beside the track or the film; without one the film is shown without the figure.  With
--truth the errors of gait eval are printed too.  The page is one self-contained file.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from gait.cli import values
from gait.errors import UsageError, UserError
from gait.io.files import require_outputs

EXAMPLES = """\
examples:
  gait report run.csv --video walk.mp4 -o run.html
  gait report run.csv --video walk.mp4 --camera camera.json --truth truth.csv --overlay overlay.mp4
  gait report estimates.log --track track.csv --video walk.mp4 --camera camera.json -o report.html
  gait report all.log --track track.csv --video walk.mp4 --camera camera.json -o report.html --replayed
"""
_FILMS = (".mp4", ".mov", ".m4v", ".mkv", ".avi", ".webm", ".3gp")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    add = parser.add_argument
    add(
        "source", metavar="RUN", help="OUT.csv from gait track, or E.log from gait record --log or lcm-logger"
    )
    add("--track", metavar="OUT.csv", help="with a log: the track, from gait record")
    add(
        "--person",
        type=values.whole(*values.PERSON),
        metavar="N",
        help="with a log: of several people, the one with this number",
    )
    add("--video", metavar="VIDEO", help="the clip that was tracked (required)")
    values.add_camera(parser, " (default: camera.json beside the track or the film)", scale=True)
    add(
        "-o",
        "--output",
        type=values.named(*values.PAGES),
        metavar="R.html",
        help="the page (default: RUN.html)",
    )
    add(
        "--overlay",
        type=values.named(*values.FILMS),
        metavar="O.mp4",
        help="also draw the estimates into the video",
    )
    add("--truth", metavar="TRUTH.csv", help="true motion, to report errors against")
    add("--draws", metavar="D.npz", help="motions from gait track --smooth --draws")
    values.add_model(parser, "model that was tracked", values.TRACKED)
    values.add_norms(parser)
    add("--replayed", action="store_true", help="with a log: not tracked live, show no latency")


def run(args: argparse.Namespace) -> int:
    """Write the page and print the verdict and errors."""
    from gait.report.error_table import as_text
    from gait.report.run_files import RunFiles, write_report

    suffix = Path(args.source).suffix.lower()
    if suffix in _FILMS:
        track = f"gait track {args.source} --height 1.75 -o track.csv --report run.html"
        raise UsageError(
            f"{args.source}: is a film, not a track; track it first, which makes the page: {track}"
        )
    if not args.video:
        raise UsageError("give --video VIDEO, the clip that was tracked")
    is_track = suffix == ".csv"
    if is_track and (args.track or args.person):
        raise UsageError(f"--{'track' if args.track else 'person'}: goes with a log; RUN is already a track")
    if not is_track and not args.track:
        raise UsageError(f"{args.source}: is not a track OUT.csv; with a log, also give --track")
    values.require_age(args.age, args.sex)
    output = args.output or str(Path(args.source).with_suffix(".html"))
    if not args.output and Path(output).exists():
        raise UserError(f"{output}: exists already; give -o {output} to replace it, or another name")
    inputs = (args.source, args.track, args.video, args.camera, args.truth, args.draws, args.model)
    require_outputs((output, args.overlay), inputs)
    files = RunFiles(
        track=args.source if is_track else args.track,
        video=args.video,
        page=output,
        camera=args.camera,
        scale_camera=args.scale_camera,
        overlay=args.overlay,
        truth=args.truth,
        draws=args.draws,
        model=args.model,
        age=args.age,
        sex=args.sex,
        quiet=args.quiet,
    )
    damage = None
    if is_track:
        verdict, measures = write_report(files)
    else:
        from gait.lcm import link, report  # here, as reports of tracks do not need LCM

        verdict, measures = report.write_report(
            args.source, files, live=not args.replayed, person=args.person
        )
        damage = link.break_of(args.source)
    if args.json:
        print(json.dumps({"verdict": verdict.sentence()} | (measures or {})))
    else:
        lines = [f"{verdict.sentence()}.", verdict.statuses(), f"written: page {output}"]
        lines += [f"warning: {verdict.warning()}"] if verdict.warning() else []
        print("\n".join(lines + ([as_text(measures)] if measures is not None else [])))
    if damage:
        raise UserError(f"{args.source}: {damage}; {output} shows the part before")
    return 0
