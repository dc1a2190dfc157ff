"""Make every figure, table and experiment of both papers from motion capture, as one page.

The papers are Ormoneit and others (2000), whose model of walking gait learn and gait track follow, and
Leventon and Freeman (1998), whose prior over segments gait lift follows.  Each figure is made by the paper's
own algorithm (literal) and by the package (ours), with what the paper states (theirs) and a verdict.  The
page needs no other file.

Motion capture is as for gait learn: the first paper needs walks, of which three have to show two strides; the
second takes up to ten motions of all kinds, first those that are no walks.
"""

from __future__ import annotations

import argparse
import json

from gait.errors import UsageError

EXAMPLES = """\
gait paper --mocap recordings/ -o paper.html
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    add = parser.add_argument
    add("--mocap", nargs="+", action="extend", default=[], metavar="SRC",
        help="motion files or folders of them, as for gait learn")  # fmt: skip
    add("-o", "--output", required=True, metavar="PAGE.html", help="the page")


def run(args: argparse.Namespace) -> int:
    """Make the page and print the verdicts."""
    if not args.mocap:
        raise UsageError("--mocap SRC is missing; give a folder of motion capture that holds walks")
    from gait.paper import run as paper  # Matplotlib and SciPy take a second

    request = paper.Request(tuple(args.mocap), args.output, args.quiet)
    verdicts = paper.run(request)
    print(json.dumps(verdicts) if args.json else _text(verdicts))
    return 0


def _text(verdicts: dict[str, dict[str, str]]) -> str:
    return "\n".join(
        f"{paper}, {name}: {words}" for paper, each in verdicts.items() for name, words in each.items()
    )
