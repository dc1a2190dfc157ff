"""Reproduce every figure, table and experiment of both papers from motion capture, on one page.

The papers are Ormoneit and others (2000), the basis of gait learn and gait track, and Leventon and Freeman
(1998), the basis of gait lift.  Each figure is made by the paper's algorithm (literal) and by the package
(ours), with the paper's result (theirs), a verdict, and what the paper does not specify.  The page is
self-contained; --json prints its statements.

Motion capture is as for gait learn: the first paper needs three walks of two strides; the second uses up to
ten motions, preferring those that are not walks.  Figures 6 and 7 need a clip of a person who walks for 51
frames, better 100, from the frame of --init.  Without one a walk is rendered.  --corrections are joints
marked by hand, as for gait lift; the second paper has about one per frame.  Every fifth is kept for
evaluation.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from gait.cli import values
from gait.errors import UsageError
from gait.io.files import require_outputs

EXAMPLES = """\
examples:
  gait paper --mocap recordings/ -o paper.html
  gait paper --mocap recordings/ --video walk.mp4 --camera camera.json --init init.json -o paper.html
"""
CLIP = ("camera", "init", "background", "corrections")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    add = parser.add_argument
    add("--mocap", nargs="+", action="extend", default=[], metavar="SRC",
        help="motion files or folders of them, as for gait learn")  # fmt: skip
    add(
        "-o",
        "--output",
        required=True,
        type=values.named(*values.PAGES),
        metavar="PAGE.html",
        help="the page",
    )
    add("--video", metavar="VIDEO", help="clip of figures 6 and 7")
    values.add_camera(parser, ", of the clip", scale=True)
    add("--init", metavar="INIT.json", help="first state, as for gait track")
    add("--background", metavar="IMAGE", help="empty scene: a picture, auto (the default) or none")
    add("--corrections", metavar="C.json",
        help="joints marked by hand in the clip, as for gait lift: figure 6 is evaluated on all of them, "
             "figure 7 uses four of five and is evaluated on the fifth (default: none, and no "
             "verdict)")  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Make the page and print the verdicts."""
    given = {name: vars(args)[name] for name in CLIP if vars(args)[name] is not None}
    wrong = []
    if not args.mocap:
        wrong.append("--mocap SRC is missing; give a folder of motion capture with walks")
    if given and not args.video:
        wrong.append(f"--{next(iter(given))} is for a clip; give it with --video")
    if args.scale_camera and not args.camera:
        wrong.append("--scale-camera: is for a --camera")
    if args.video and not {"camera", "init"} <= given.keys():
        wrong.append("--video needs --camera and --init")
    if wrong:
        raise UsageError("; ".join(wrong))
    require_outputs((args.output,), (args.video, *(path for path in given.values() if path != "auto")))
    from gait.paper import run as paper  # importing Matplotlib and SciPy takes a second
    from gait.paper.clip import Clip

    clip = None
    if args.video:
        clip = Clip(Path(args.video).name, args.video, scale_camera=args.scale_camera, **given)
    found = paper.run(paper.Request(tuple(args.mocap), args.output, clip, args.quiet))
    print(json.dumps(found) if args.json else _text(found))
    return 0


def _text(found: dict[str, dict[str, dict[str, str]]]) -> str:
    return "\n".join(
        f"{paper}, {name}: {words['verdict']}"
        for paper, each in found.items()
        for name, words in each.items()
    )
