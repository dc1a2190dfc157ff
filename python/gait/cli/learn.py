"""Learn a cyclic model of motion from motion capture.

Sources are files or folders of them: .amc with its .asf beside it, .bvh, .c3d, .trc, and .csv of joint
positions or angles, separated by ',', ';' (with decimal commas) or tabs.  Each recording is retargeted to the
default skeleton and cut into cycles by its own period; functional principal components of all cycles give the
mean curves and the variation between people (Ormoneit and others, 2000).  In a folder, files that cannot be
used are skipped with one line each.  gait info lists the sequences of a model; --report shows everything.

Only the cycles of the recordings are in memory; their signals are on disk, in the folder TMPDIR.  The model
does not depend on --jobs or --dask, nor on the x86-64 CPU.  The workers of a Dask cluster (pip install
'libgait[dask]') need the same package version and the files under the same paths; start them with
dask worker --preload-nanny gait.reproducible.

Columns of .csv and marker names of .c3d and .trc are described in libgait/doc/reference/files.md.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import fields
from functools import partial
from pathlib import Path

from gait.cli import values
from gait.errors import UsageError
from gait.learn.corpus import forkserver
from gait.learn.options import (
    DEFAULT_COMPONENTS,
    HEADINGS_BY_NAME,
    JOINT_CENTRES,
    MOST_READ_COMPONENTS,
    PAPER_COMPONENTS,
    PERIOD_MODES,
    PRIORS,
    SEGMENT_MARKERS,
    SEGMENT_SOURCES,
    SUBJECT_RULES,
    LearnOptions,
    SegmentOptions,
)
from gait.progress import note

EXAMPLES = """\
examples:
  gait learn recordings/ -o model.gait --report report
  gait learn walk_01.trc walk_02.trc -o model.gait --markers map.json
  gait learn walks runs -o all.gait --class stand --class backwards --class run
"""

AUTO = "auto"
#: Ranges of the options for segments.
FRAMES_RANGE, FPS_RANGE, MODES_RANGE, MIXTURE_RANGE = (4, 60), (5, 240), (1, 120), (1, 16)
SEGMENT = ("frames", "hop", "fps", "modes", "headings", "mixture", "markers")  # options --segment-...


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("sources", nargs="+", metavar="SRC", help="motion files or folders of them")
    parser.add_argument("-o", "--output", required=True, metavar="M.gait", help="the model")
    parser.add_argument("--report", metavar="DIR", help="also write figures and index.html into this folder")
    _add_recordings(parser.add_argument_group("recordings"))
    _add_model(parser.add_argument_group("cyclic model"))
    _add_segments(parser.add_argument_group("prior over short segments, which gait lift uses"))
    _add_processes(parser.add_argument_group("processes"))


def _add_recordings(group: argparse._ArgumentGroup) -> None:
    """Add options: which files to read, which people are in them, and where markers and joints are."""
    _add_globs(
        group,
        "--exclude",
        "skip files whose path ends like this, such as 'cmu_walk/02/*', and folders of that name",
    )
    group.add_argument(
        "--subjects",
        choices=SUBJECT_RULES,
        default=SUBJECT_RULES[0],
        help="which files belong to one person. prefix: those with the same name up to '_'. folder: those "
        "in one folder. file: each file. auto (the default): prefix, but folder for files without '_', and "
        "for all files if a prefix occurs in several folders, such as Anna/walk_01 and Ben/walk_01. Limb "
        "lengths are estimated from all recordings of a person with markers",
    )
    _add_globs(
        group,
        "--generic-lengths",
        "files whose path ends like this do not have the person's limb lengths, for example because several "
        "people share a skeleton: learn only the motion from them",
    )
    group.add_argument(
        "--fps",
        type=values.between(10, 2000, "frames per second"),
        metavar="F",
        help="frames per second (default: from the file; .amc: 120)",
    )
    group.add_argument(
        "--markers",
        type=Path,
        metavar="MAP.json",
        help="positions of the markers of .c3d and .trc on the body",
    )
    group.add_argument(
        "--joints",
        choices=JOINT_CENTRES,
        default=JOINT_CENTRES[0],
        help="joint centres of CMU's skeletons (.amc, .bvh made from them). recorded (default): as in the "
        "file, also in the package's walk. anatomical: where markers put them, as in its classes",
    )
    _add_globs(
        group,
        "--static",
        "static trials (.c3d, .trc): people standing with markers at knees and ankles that recordings "
        "may lack. Each gives its person's (--subjects) limb lengths and the positions of all markers, "
        "including clusters with unknown labels",
        metavar="FILE",
    )
    group.add_argument(
        "--zeros-missing",
        action="store_true",
        help="treat three or more exact zeros in a row as missing data, for systems that write 0 for missing "
        "points (empty cells of .csv, and points of .c3d and .trc at the origin, are always missing)",
    )
    group.add_argument(
        "--credit",
        action="append",
        default=[],
        metavar="TEXT",
        help="origin and licence of the recordings, stored in the model and printed by gait info; may be "
        "repeated. Recordings of CMU (.amc) are acknowledged anyway",
    )
    group.add_argument(
        "--no-trim", action="store_true", help="keep starts, stops and turns at the ends of recordings"
    )


def _add_globs(group: argparse._ArgumentGroup, option: str, help: str, metavar: str = "GLOB") -> None:
    """Add an option with one or more files, which may be repeated."""
    group.add_argument(option, nargs="+", action="extend", default=[], metavar=metavar, help=help)


def _add_model(group: argparse._ArgumentGroup) -> None:
    """Add options: which motion to learn, and how."""
    group.add_argument(
        "--activity",
        default="walk",
        metavar="NAME",
        help="name of the motion; walk rejects runs and run rejects walks (default: walk)",
    )
    group.add_argument(
        "--class",
        dest="classes",
        action="append",
        default=[],
        metavar="NAME[=SRC]",
        help="add this motion class, so that gait track follows changes; may be repeated. run, "
        "backwards and stand are learnt from the runs, the walks backwards and the people who stand "
        "throughout among the sources, or like any other NAME from the recordings in SRC; stand is their "
        "mean posture, and SRC needs people who stand still for a second. Without any, backwards and stand "
        "are derived from the walk. If SRC is a model (a .gait file, or classes, walk "
        "or paper of the package), its class of this name, or its only class, is copied. With a walking "
        "model as the only source, the classes are added to its own; they replace those of the same name",
    )
    group.add_argument(
        "--changes",
        nargs="+",
        action="extend",
        default=[],
        metavar="SRC",
        help="recordings, or folders of them, in which people change between these classes, as it "
        "happened and not cut about the changes: learn how often and at which phases people change. The "
        "usual assumptions count as 2 changes of each kind. With a model of several classes as the only "
        "source, only this is learnt",
    )
    group.add_argument(
        "--components",
        type=lambda text: _auto_or(text, MOST_READ_COMPONENTS),
        metavar="auto|N",
        help=f"number of components of the variation about the mean walk, 1 to {MOST_READ_COMPONENTS}. "
        f"auto: the number that predicts held-out data best. Default: {DEFAULT_COMPONENTS} "
        f"({PAPER_COMPONENTS} with --prior paper), or two less than the number of cycles if that is fewer",
    )
    group.add_argument(
        "--prior",
        choices=PRIORS,
        default=PRIORS[0],
        help="people (the default): allow for people who were not recorded, with other limb lengths and "
        "postures. paper: as in Ormoneit and others (2000): 19 angles, 5 components, gaps filled by an "
        "iterated SVD, trunk and ankles rigid, the same body for everyone (for the paper's whole periods, "
        "add --period-mode literal)",
    )
    group.add_argument(
        "--period-mode",
        choices=PERIOD_MODES,
        default=PERIOD_MODES[0],
        help="literal: whole frames, at 120 per second from 50 to 250, as in the paper (default: refined)",
    )
    values.add_seed(group, "the held-out data")


def _add_segments(group: argparse._ArgumentGroup) -> None:
    """Add options: source and size of the segment prior."""
    usual = SegmentOptions()
    group.add_argument(
        "--segments",
        choices=SEGMENT_SOURCES,
        default=usual.source,
        help="source of the prior. learnt (default): the recordings of the cyclic model; all: whole "
        "recordings, including those that the cyclic model rejects; none: no segment prior; only: like all, "
        "but without a cyclic model, so that gait track cannot use the file",
    )
    numbers = (
        ("frames", "F", FRAMES_RANGE, f"frames of a segment (default: {usual.frames})"),
        ("hop", "H", (1, FRAMES_RANGE[1]), "frames from one segment to the next (default: half of F)"),
        ("fps", "R", FPS_RANGE, f"frames per second of a segment (default: {usual.fps:g})"),
        (
            "modes",
            "K",
            MODES_RANGE,
            f"modes kept, at most a quarter of the segments (default: {usual.modes})",
        ),
    )
    for name, metavar, limits, help in numbers:
        group.add_argument(f"--segment-{name}", type=values.whole(*limits), metavar=metavar, help=help)
    group.add_argument(
        "--segment-headings",
        choices=list(HEADINGS_BY_NAME),
        help="free (default): gait lift estimates the heading. 2: every segment also rotated by 90 degrees, "
        "as in the paper; 8: by each multiple of 45 degrees; the prior then includes headings in the world",
    )
    group.add_argument(
        "--segment-mixture",
        type=lambda text: _auto_or(text, MIXTURE_RANGE[1]),
        metavar="auto|K",
        help=f"Gaussians in the segment prior (default: {usual.mixture}); auto: the number that predicts "
        "people left out best",
    )
    group.add_argument(
        "--segment-markers",
        choices=SEGMENT_MARKERS,
        help="virtual (default): 37 of the default skeleton; recorded: those that most of the files have "
        "(.c3d, .trc)",
    )


def _add_processes(group: argparse._ArgumentGroup) -> None:
    """Add options: where recordings are read."""
    group.add_argument(
        "--jobs",
        type=values.whole(1),
        metavar="N",
        help="processes that read files (default: one per core)",
    )
    group.add_argument("--dask", metavar="SCHEDULER", help="read on a Dask cluster, such as tcp://host:8786")


def _auto_or(text: str, most: int) -> int | str:
    if text == AUTO:
        return text
    if text.isdigit() and 1 <= int(text) <= most:
        return int(text)
    raise argparse.ArgumentTypeError(f"{text!r} is neither auto nor 1 to {most}")


def run(args: argparse.Namespace) -> int:
    """Start the processes of a large run, learn the model, and print the figures."""
    options = _options(args)
    if options.jobs > 1 and not options.dask and forkserver.worth(options.sources):
        forkserver.start()  # its imports run in parallel with ours
    from gait.learn import run as learning  # importing SciPy takes almost a second
    from gait.learn.classes import run as classes
    from gait.learn.report import summary

    learn = classes.learn if options.classes or options.changes else learning.run
    figures = learn(options, partial(note, quiet=args.quiet))
    print(json.dumps(figures) if args.json else summary.text(args.output, figures))
    return 0


def _options(args: argparse.Namespace) -> LearnOptions:
    """Collect the options of a run."""
    from gait.learn.mocap import markers

    if args.dask and args.jobs:
        raise UsageError("--jobs is for this machine and --dask for a cluster; give one of them")
    given = {field.name: vars(args)[field.name] for field in fields(LearnOptions) if field.name in vars(args)}
    return LearnOptions(
        **given
        | {
            "sources": tuple(args.sources),
            "exclude": tuple(args.exclude),
            "generic_lengths": tuple(args.generic_lengths),
            "static": tuple(args.static),
            "credit": tuple(args.credit),
            "classes": tuple(args.classes),
            "changes": tuple(args.changes),
            "markers": markers.read_map(args.markers) if args.markers else None,
            "trim": not args.no_trim,
            "segments": _segment_options(args),
            "jobs": args.jobs or forkserver.cores(),
        }
    )


def _segment_options(args: argparse.Namespace) -> SegmentOptions:
    given = {name: getattr(args, f"segment_{name}") for name in SEGMENT}
    given = {name: value for name, value in given.items() if value is not None}
    if args.segments == "none" and given:
        raise UsageError(f"--segment-{next(iter(given))} is for a segment prior; not with --segments none")
    frames = given.get("frames", SegmentOptions.frames)
    hop = given.setdefault("hop", max(1, frames // 2))
    if hop > frames:
        raise UsageError(f"--segment-hop {hop}: at most the {frames} of --segment-frames")
    if "headings" in given:
        given["headings"] = HEADINGS_BY_NAME[given["headings"]]
    if given.get("mixture") == AUTO:
        given["mixture"] = None
    return SegmentOptions(source=args.segments, people=args.prior == "people", **given)
