"""Learn a cyclic model of motion from motion capture.

Sources are files or folders of them: .amc with its .asf beside it, .bvh, .c3d, .trc, and .csv of joint
positions or angles.  Each recording is retargeted to the default skeleton and cut into cycles by its own
period; functional principal components of all cycles give the mean curves and the ways in which people differ
(Ormoneit and others, 2000).  In a folder, a file that cannot be used is named in one line and the rest is
learnt.  gait info lists the sequences of a model, --report shows everything.

Recordings are read a few at a time and their signals wait on disk, in the folder that TMPDIR names; in memory
are their cycles alone.  The model does not depend on --jobs or --dask, nor on the CPU if it is x86-64.
The workers of a Dask cluster (.venv/bin/pip install -e 'python[dask]' in the repository) need this version of
the package and the files under the same paths; start them with dask worker --preload-nanny gait.kernels.

What the columns of .csv and the marker names of .c3d and .trc must be: libgait/doc/mocap-formats.md.

The model shipped with the package: gait learn ../shared/data/mocap/cmu_walk -o python/gait/data/walk.gait
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

from gait import blob
from gait.cli import learn_segments, learn_text, values
from gait.errors import UsageError
from gait.files import require_folder, require_writable
from gait.learn import activity, fit, marker_map, model, segment_sections, sources, subjects
from gait.learn.readers import KINDS
from gait.learn.reading import Reading
from gait.learn.retarget import Measures
from gait.learn.segment_corpus import Corpus
from gait.learn.sequence import Sequence
from gait.learn.stage import one_thread
from gait.progress import progress

NAME = "learn"
HELP = "learn a cyclic model from motion capture"
MOST_LINES = 20  # about files left out


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("sources", nargs="+", metavar="SRC", help="motion files or folders of them")
    parser.add_argument("-o", "--output", required=True, metavar="M.gait", help="the model")
    parser.add_argument(
        "--activity",
        default="walk",
        metavar="NAME",
        help="what the motion is called; walk leaves out runs and the reverse (walk)",
    )
    parser.add_argument(
        "--subjects",
        choices=subjects.RULES,
        default=subjects.RULES[0],
        help="which files are of one person. prefix: those whose names begin alike up to '_'. folder: those "
        "of one folder. file: each alone. auto (the default): prefix; but folder for files without '_', and "
        "for all if one prefix is in several folders, such as Anna/walk_01 and Ben/walk_01",
    )
    parser.add_argument(
        "--components",
        type=_components,
        metavar="auto|N",
        help="in how many ways the model can differ from the mean walk. N: so many, from 1 to "
        f"{fit.MOST_COMPONENTS}. auto: as many as describe data that were held out best. Without the option "
        f"{fit.DEFAULT_COMPONENTS}, or two less than there are cycles if that is fewer",
    )
    parser.add_argument(
        "--prior",
        choices=fit.KINDS,
        default=fit.KINDS[0],
        help="people (the default): also allow for people who were not recorded, with lengths of limbs and "
        "postures of their own. paper: only what the recorded cycles show, and one body for everybody",
    )
    parser.add_argument(
        "--exclude",
        nargs="+",
        action="extend",
        default=[],
        metavar="GLOB",
        help="leave out files whose path ends like this, such as 'cmu_walk/02/*', and folders so named",
    )
    parser.add_argument(
        "--period-mode",
        choices=("refined", "literal"),
        default="refined",
        help="literal: whole frames from 50 to 250, as in the paper (refined)",
    )
    parser.add_argument(
        "--fps", type=_rate, metavar="F", help="frames per second (what the file says; .amc: 120)"
    )
    parser.add_argument(
        "--markers", type=Path, metavar="MAP.json", help="which joints the markers of .c3d and .trc belong to"
    )
    parser.add_argument(
        "--zeros-missing", action="store_true", help="three or more exact zeros in a row are missing data"
    )
    parser.add_argument(
        "--no-trim", action="store_true", help="keep starts, stops and turns at the ends of recordings"
    )
    parser.add_argument(
        "--jobs", type=values.whole(1), metavar="N", help="processes that read files (one per core)"
    )
    parser.add_argument("--dask", metavar="SCHEDULER", help="read on a Dask cluster, such as tcp://host:8786")
    parser.add_argument(
        "--seed", type=values.whole(*values.SEED), default=1, metavar="S", help="of the held-out data (1)"
    )
    parser.add_argument("--report", metavar="DIR", help="also write figures and index.html into this folder")
    learn_segments.add_arguments(parser)


def _components(text: str) -> int | str:
    if text == "auto":
        return text
    if text.isdigit() and 1 <= int(text) <= fit.MOST_COMPONENTS:
        return int(text)
    raise argparse.ArgumentTypeError(f"{text!r} is neither auto nor 1 to {fit.MOST_COMPONENTS}")


def _rate(text: str) -> float:
    low, high = 10, 2000
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not low <= value <= high:
        raise argparse.ArgumentTypeError(f"{text}: give frames per second from {low} to {high}")
    return value


def run(args: argparse.Namespace) -> int:
    """Read, learn, write, report."""
    _check(args)
    wanted = learn_segments.options(args)
    with one_thread(), Corpus() as corpus:
        sequences, refused, others = _read(args, corpus)
        if wanted.source == "only":
            return learn_segments.write_alone(args, corpus, wanted, refused)
        learned = fit.fit(sequences, args.components, args.seed, args.prior, others)
        if not args.quiet:
            for note in learn_text.notes(learned, args.components):
                print(note, file=sys.stderr)
        prior = learn_segments.learn(corpus, wanted, args.quiet)
        sections = model.sections(learned, args.activity, args.seed)
        data = blob.write(args.output, sections | (segment_sections.sections(prior) if prior else {}))
        if args.report:
            from gait.learn import report  # matplotlib is slow to import

            try:
                report.write(Path(args.report), learned, args.activity, refused, args.quiet)
            except BaseException:
                print(f"{args.output}: the model is written; the report is not", file=sys.stderr)
                raise
    figures = learn_text.summary(learned, data, refused, prior, bool(args.report))
    print(json.dumps(figures) if args.json else learn_text.text(args.output, figures))
    return 0


def _check(args: argparse.Namespace) -> None:
    """Refuse before the work what would fail after it."""
    if args.dask and args.jobs:
        raise UsageError("--jobs is for this machine and --dask for a cluster; give one of them")
    if args.markers:
        marker_map.read(args.markers)
    if args.report and args.segments == "only":
        raise UsageError("--report draws the cyclic model; leave it out, or --segments only")
    if args.activity.lower() not in activity.NAMES and not args.quiet:
        names = ", ".join(activity.NAMES)
        print(f"--activity {args.activity}: none of {names}: any cyclic motion is learnt", file=sys.stderr)
    _check_output(args)
    require_writable(args.output)
    if args.report:
        require_folder(args.report)


def _check_output(args: argparse.Namespace) -> None:
    """Refuse to write the model over what is read, or where the report shall be."""
    output = Path(os.path.realpath(args.output))
    if output.suffix.lower() in (*KINDS, ".asf"):
        raise UsageError(
            f"-o {args.output}: is named like a recording; name the model M.gait, and sources before -o"
        )
    if any(os.path.realpath(p) == str(output) for p in (*args.sources, args.markers) if p):
        raise UsageError(f"-o {args.output}: is also read; name the model otherwise")
    if args.report:
        folder = Path(os.path.realpath(args.report))
        if output in (folder, *folder.parents):
            raise UsageError(
                f"--report {args.report}: the model is to be at {args.output}; name another folder"
            )


def _read(args: argparse.Namespace, corpus: Corpus) -> tuple[list[Sequence], list[str], list[Measures]]:
    """Find and prepare the files; say which were left out; bodies are of people who are in these alone."""
    others: list[Measures] = []
    idle: list[str] = []
    closed: list[str] = []
    files = sources.find(args.sources, args.exclude, idle.append, closed.append)
    for glob in idle if not args.quiet else ():
        print(f"--exclude {glob}: no file's path ends like this", file=sys.stderr)
    reading = Reading(
        args.period_mode,
        args.fps,
        args.zeros_missing,
        args.activity,
        args.markers,
        not args.no_trim,
        learn_segments.options(args),
    )
    jobs = args.jobs or len(os.sched_getaffinity(0))
    with progress("reading motion", len(files), args.quiet) as update:
        try:
            sequences, refused = sources.load_all(
                files,
                reading,
                update,
                jobs=jobs,
                dask=args.dask,
                people=args.subjects,
                corpus=corpus,
                others=others,
            )
        except sources.NothingLeft as error:
            _tell(closed + error.refused[1:], args.quiet, "")
            raise
    refused = closed + refused
    _tell(refused, args.quiet, " (see --json or --report)")
    return sequences, refused, others


def _tell(refused: list[str], quiet: bool, more: str) -> None:
    """Say which files were left out."""
    if quiet:
        return
    for line in refused[:MOST_LINES]:
        print(f"left out: {line}", file=sys.stderr)
    if len(refused) > MOST_LINES:
        print(f"left out: {len(refused) - MOST_LINES} more{more}", file=sys.stderr)
