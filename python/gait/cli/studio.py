"""Correct the motion in a video by hand, on a page of this machine."""

from __future__ import annotations

import argparse
import json
import sys

from gait.errors import UsageError
from gait.web import parts

EXAMPLES = """\
examples:
  gait studio --fetch
  gait studio --fetch --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument(
        "--fetch", action="store_true", help="download the parts of pages (3 MB) and check them"
    )


def run(args: argparse.Namespace) -> int:
    """Fetch."""
    if not args.fetch:
        raise UsageError("give --fetch")
    folder = parts.fetch(lambda line: args.quiet or print(line, file=sys.stderr))
    print(json.dumps({"folder": str(folder)}) if args.json else f"parts of pages in {folder}")
    return 0
