"""Correct the motion in a video by hand, on a local web page.

The page shows the film with the figure over it, a 3-D view, and curves with their 90 % intervals.  Drag a
joint to its true position, and the motion around it is updated at once.  Every correction is saved
immediately, in VIDEO.studio/corrections.json unless --corrections names another file; gait lift --corrections
gives the same motion from it.  This is the tool of Leventon and Freeman (1998), section 4.

The person's joints come from the detector, from --keypoints, or from --track, the output of gait track.  With
--placement the images themselves are lifted, without a detector.  With --camera the motion is in the camera's
world and feet can be put on its floor; with --height alone the camera is estimated from the walk; without
either it is assumed to be level and far away.  The camera must be static: a film whose camera turns by more
than a tenth of the picture is refused; gait lift --stabilize auto lifts it.

The command prints the address of the page; only this machine can open it.  The folder VIDEO.studio beside the
video stores intermediate results.  Ctrl-C ends the command; nothing is lost.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import fields
from functools import partial

from gait.cli import values
from gait.errors import UsageError
from gait.progress import note
from gait.web import parts

EXAMPLES = """\
examples:
  gait studio --fetch
  gait studio walk.mp4 --camera camera.json --track track.csv
  gait studio walk.mp4 --height 1.75
  gait studio walk.mp4 --camera camera.json --corrections corrections.json
  gait studio walk.mp4 --camera camera.json --placement init.json
"""
_PORT = 8730


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("video", nargs="?", metavar="VIDEO", help="video file")
    values.add_camera(parser, "; without it see --height", scale=True)
    parser.add_argument(
        "--height",
        type=values.stature,
        metavar="M",
        help="the person's stature in metres; without --camera it also estimates the camera",
    )
    values.add_fov(parser)
    parser.add_argument(
        "--start", type=values.whole(0), metavar="F", help="first frame (default: that of --placement, or 0)"
    )
    parser.add_argument(
        "--stop", type=values.whole(0), metavar="F", help="first frame not to use (default: to the end)"
    )
    parser.add_argument("--keypoints", metavar="K.csv", help="2-D keypoints instead of the detector's")
    parser.add_argument("--track", metavar="OUT.csv", help="output of gait track, instead of keypoints")
    parser.add_argument(
        "--placement",
        metavar="P.json",
        help="rough position of the person in one frame; lifts the images themselves, as gait lift does",
    )
    parser.add_argument(
        "--background", metavar="PNG|auto|none", help="empty scene, with --placement (default: auto)"
    )
    parser.add_argument(
        "--corrections",
        type=values.named(".json"),
        metavar="C.json",
        help="file of the corrections, read and written",
    )
    parser.add_argument(
        "-m", "--model", metavar="M.gait", help="model with a segment prior (default: the shipped one)"
    )
    parser.add_argument(
        "--port", type=values.whole(0, 65535), default=_PORT, help=f"port (default: {_PORT}; 0: any free one)"
    )
    parser.add_argument(
        "--fetch", action="store_true", help="download components of web pages (3 MB) and check them"
    )


def run(args: argparse.Namespace) -> int:
    """Download the components, or serve the page until interrupted."""
    if args.fetch:
        folder = parts.fetch(partial(note, quiet=args.quiet))
        print(json.dumps({"folder": str(folder)}) if args.json else f"parts of pages in {folder}")
        if not args.video:
            return 0
    if not args.video:
        raise UsageError("give VIDEO, or --fetch")
    _check(args)
    # Imported here, as they import numpy, OpenCV and the server.
    from gait.io.files import require_writable
    from gait.io.video import Video
    from gait.studio import server
    from gait.studio.session import Session
    from gait.studio.source import Wanted, folder_of, open_source
    from gait.web import serve

    for part in parts.STORE.files:  # to fail early if one is missing
        parts.load(part)
    if args.corrections:
        require_writable(args.corrections)
    wanted = Wanted(**{each.name: getattr(args, each.name) for each in fields(Wanted)})
    video = Video(args.video)
    with serve.listen(args.port) as own:
        with folder_of(video) as folder:
            source = open_source(wanted, video, folder, partial(note, quiet=args.quiet), args.quiet)
            session = Session(source)
        url = serve.address(own)
        figures = {"url": url, "corrections": str(source.corrections)}
        words = f"gait studio: open {url} (corrections in {source.corrections})"
        server.run(session, own, lambda: print(json.dumps(figures) if args.json else words, flush=True))
    return 0


def _check(args: argparse.Namespace) -> None:
    """Raise UsageError for options that do not go together."""
    given = [name for name in ("keypoints", "track", "placement") if getattr(args, name)]
    if len(given) > 1:
        raise UsageError(f"--{given[0]} and --{given[1]} exclude each other; give one of them")
    if args.background and not args.placement:
        raise UsageError("--background: goes with --placement")
    if args.camera and args.height and given and given[0] != "keypoints":
        raise UsageError(f"--height: the {given[0]} gives the stature; leave out --height or --camera")
    if args.keypoints and args.height and not args.camera:
        raise UsageError(
            f"--keypoints: needs a camera: run gait camera --walk {args.keypoints} --size WxH --height "
            f"{args.height:g} -o camera.json, then give --camera camera.json"
        )
    if args.fov and (args.camera or not args.height):
        raise UsageError("--fov: is for a camera estimated from the walk, with --height and no --camera")
    for option in ("start", "stop"):
        if getattr(args, option) is not None and args.keypoints:
            raise UsageError(
                f"--{option}: --keypoints defines the frames; cut that file, or leave out --{option}"
            )
    if args.stop is not None:
        values.require_order(args.start or 0, args.stop)
    if args.scale_camera and not args.camera:
        raise UsageError("--scale-camera: needs --camera")
