"""Correct the motion in a video by hand, on a page of this machine.

The page shows the film with the figure over it, a 3-D view that turns, and curves with their 90 % intervals.
Drag a joint to where it is: the motion around it is solved again at once.  Every correction is saved as it is
made, in VIDEO.studio/corrections.json unless --corrections names another file; gait lift --corrections gives
the same motion from it.  Leventon and Freeman (1998) correct motions so in section 4.

The person's joints come from the detector, from --keypoints, or from --track, what gait track wrote.  With
--camera the motion is in the camera's world and feet can be put on its floor; with --height the camera is
found from the walk; without either it is assumed to be level and far away.

The folder VIDEO.studio beside the video keeps what takes long to make.  The page can be opened from this
machine alone.  Ctrl-C ends the command; nothing is lost.
"""

from __future__ import annotations

import argparse
import json
import sys

from gait.cli import values
from gait.errors import UsageError, UserError
from gait.progress import note
from gait.web import parts

EXAMPLES = """\
examples:
  gait studio --fetch
  gait studio walk.mp4 --height 1.75
  gait studio walk.mp4 --camera camera.json --corrections corrections.json
  gait studio walk.mp4 --camera camera.json --track track.csv
"""
_PORT = 8730


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("video", nargs="?", metavar="VIDEO", help="video file")
    values.add_camera(parser, "; without it see --height")
    parser.add_argument(
        "--height", type=values.stature, metavar="M", help="the person's stature in metres; finds the camera"
    )
    parser.add_argument("--keypoints", metavar="K.csv", help="2-D keypoints instead of the detector's")
    parser.add_argument("--track", metavar="OUT.csv", help="what gait track wrote, instead of keypoints")
    parser.add_argument("--corrections", metavar="C.json", help="file of the corrections, read and written")
    parser.add_argument(
        "-m", "--model", metavar="M.gait", help="model with a segment prior (default: the shipped one)"
    )
    parser.add_argument(
        "--port", type=values.whole(0, 65535), default=_PORT, help=f"port (default: {_PORT}; 0: any free one)"
    )
    parser.add_argument("--no-browser", action="store_true", help="do not open the page, print its address")
    parser.add_argument(
        "--fetch", action="store_true", help="download the parts of pages (3 MB) and check them"
    )


def run(args: argparse.Namespace) -> int:
    """Fetch, or serve until interrupted."""
    if args.fetch:
        folder = parts.fetch(lambda line: args.quiet or print(line, file=sys.stderr))
        print(json.dumps({"folder": str(folder)}) if args.json else f"parts of pages in {folder}")
        if not args.video:
            return 0
    if not args.video:
        raise UsageError("give VIDEO, or --fetch")
    if args.keypoints and args.track:
        raise UsageError("--keypoints and --track exclude each other; give one of them")
    if args.camera and args.height and args.track:
        raise UsageError("--height: the track has the stature; leave it out")
    for part in parts.STORE.files:  # before anything takes long
        parts.load(part)
    # Imported here, as they load numpy, OpenCV and the server.
    from gait.io.files import require_writable
    from gait.studio import server
    from gait.studio.session import Session
    from gait.studio.source import Wanted, open_source
    from gait.web import serve

    if args.corrections:
        require_writable(args.corrections)
    own = serve.listen(args.port)
    wanted = Wanted(
        args.video, args.camera, args.height, args.keypoints, args.track, args.corrections, args.model
    )
    source = open_source(wanted, lambda words: note(words, args.quiet), args.quiet)
    session = Session(source, args.model)
    url = serve.address(own)
    figures = {"url": url, "corrections": str(source.corrections)}
    print(json.dumps(figures) if args.json else f"{url}  (corrections in {source.corrections})", flush=True)
    if not args.no_browser:
        _open(url)
    server.run(session, own)
    return 0


def _open(url: str) -> None:
    """Open the page, if there is a browser."""
    import webbrowser

    try:
        webbrowser.open(url)
    except webbrowser.Error as error:
        raise UserError(f"{url}: no browser ({error}); open it by hand, with --no-browser") from error
