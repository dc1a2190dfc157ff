"""Watch a tracker at work: each estimate of gait-trackd drawn into its frame.

Opens a page on this machine (its address is printed) that any browser shows.  With --save the first finished
picture is written to a PNG file instead, and the command ends.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import time

import cv2

from gait.bindings.model import Model
from gait.camera.camera import Camera
from gait.cli import values
from gait.cli.ending import Ending
from gait.errors import UserError
from gait.io.files import replacing
from gait.io.video import Image
from gait.lcm.link import lcm_url
from gait.lcm.viewer import Screen, Viewer

JSON = False
_TURN = 0.1  # seconds


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("--url", metavar="URL", help="LCM (LCM_DEFAULT_URL or multicast on this machine)")
    parser.add_argument("--save", metavar="PNG", help="write one picture and end")
    parser.add_argument(
        "--patience", type=values.seconds, default=30.0, metavar="S", help="of --save, seconds (30)"
    )
    port, stream = values.whole(0, 65535), values.whole(*values.STREAM)
    parser.add_argument("--port", type=port, default=0, metavar="N", help="of the page (any that is free)")
    parser.add_argument("--stream", type=stream, default=0, metavar="I", help="number of the camera (0)")
    parser.add_argument("--camera", metavar="CAM", help="calibration (from GAIT_CAMERA_<i>)")
    parser.add_argument("-m", "--model", metavar="M.gait", help="that tracks (the shipped one)")


def run(args: argparse.Namespace) -> int:
    """Show or save."""
    camera = Camera.read(args.camera) if args.camera else None
    model, url = Model(args.model), lcm_url(args.url)
    if args.save:
        _save(args, url, model, camera)
        return 0
    screen = Screen(args.port)
    viewer = Viewer(url, args.stream, model, camera, screen.show)
    print(screen.address, flush=True)
    with Ending(), contextlib.suppress(KeyboardInterrupt):  # the way to end it
        while viewer.handle(_TURN):
            pass
    screen.close()
    if viewer.damage and not args.quiet:
        print(f"gait view: left out: {viewer.damage}", file=sys.stderr)
    return 0


def _save(args: argparse.Namespace, url: str, model: Model, camera: Camera | None) -> None:
    pictures: list[Image] = []
    with replacing(args.save) as path:
        viewer = Viewer(url, args.stream, model, camera, pictures.append)
        if not args.quiet:
            print(f"listening on {url}", file=sys.stderr, flush=True)
        deadline = time.monotonic() + args.patience
        while not pictures and time.monotonic() < deadline and viewer.handle(_TURN):
            pass
        if not pictures:
            why = viewer.damage or "is gait-trackd tracking on this URL?"
            raise UserError(f"no estimate with its frame and camera came; {why}")
        if not cv2.imwrite(str(path), pictures[0]):
            raise UserError(f"{args.save}: cannot be written as an image; give a name that ends in .png")
