"""Learn a cyclic model of motion from motion capture.

Sources are files or folders of them: .amc with its .asf beside it, .bvh, .c3d, .trc, and .csv of joint
positions or angles, separated by ',', ';' (with decimal commas) or tabs.  Each recording is retargeted to the
default skeleton and cut into cycles by its own period; functional principal components of all cycles give the
mean curves and the ways in which people differ (Ormoneit and others, 2000).  In a folder, a file that cannot
be used is named in one line and the rest is learnt.  gait info lists the sequences of a model, --report shows
everything.

Recordings are read a few at a time and their signals wait on disk, in the folder that TMPDIR names; in memory
are their cycles alone.  The model does not depend on --jobs or --dask, nor on the CPU if it is x86-64.
The workers of a Dask cluster (pip install 'libgait[dask]') need this version of
the package and the files under the same paths; start them with dask worker --preload-nanny gait.reproducible.

What the columns of .csv and the marker names of .c3d and .trc must be: libgait/doc/reference/files.md.

The model shipped with the package: gait learn ../shared/data/mocap/cmu_walk -o python/gait/data/walk.gait
"""

from __future__ import annotations

import argparse
from pathlib import Path

from gait.cli import learn_segments, values
from gait.learn.corpus import fork_server, subjects
from gait.learn.model_options import DEFAULT_COMPONENTS, MOST_COMPONENTS, PRIORS


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
        "for all if one prefix is in several folders, such as Anna/walk_01 and Ben/walk_01. Lengths of limbs "
        "are found from all recordings of a person with markers",
    )
    parser.add_argument(
        "--components",
        type=_components,
        metavar="auto|N",
        help="in how many ways the model can differ from the mean walk. N: so many, from 1 to "
        f"{MOST_COMPONENTS}. auto: as many as describe data that were held out best. Without the option "
        f"{DEFAULT_COMPONENTS}, or two less than there are cycles if that is fewer",
    )
    parser.add_argument(
        "--prior",
        choices=PRIORS,
        default=PRIORS[0],
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
        help="literal: whole frames, at 120 per second from 50 to 250, as in the paper (refined)",
    )
    parser.add_argument(
        "--fps", type=_rate, metavar="F", help="frames per second (what the file says; .amc: 120)"
    )
    parser.add_argument(
        "--markers", type=Path, metavar="MAP.json", help="which joints the markers of .c3d and .trc belong to"
    )
    parser.add_argument(
        "--zeros-missing",
        action="store_true",
        help="three or more exact zeros in a row are missing data, for systems that write 0 for what they "
        "did not see (empty cells of .csv, and points of .c3d and .trc at the origin, always are missing)",
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
    if text.isdigit() and 1 <= int(text) <= MOST_COMPONENTS:
        return int(text)
    raise argparse.ArgumentTypeError(f"{text!r} is neither auto nor 1 to {MOST_COMPONENTS}")


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
    """Let the workers of a large run import what they need while this process does."""
    jobs = args.jobs or fork_server.cores()
    if jobs > 1 and not args.dask and fork_server.worth(args.sources):
        fork_server.start()
    from gait.cli import learn_run  # scipy takes most of a second

    return learn_run.run(args)
