"""Watch a tracker at work: each estimate of gait-trackd is drawn into its frame.

Serves a page on this machine that any browser shows, and prints its address.  With --save the first finished
picture is written to a PNG file instead, and the command ends.
"""

from __future__ import annotations

import argparse
import contextlib
import time
from typing import TYPE_CHECKING

from gait.cli import values
from gait.cli.signals import Interruptible
from gait.errors import UserError
from gait.io.files import replacing
from gait.lcm.link import lcm_url
from gait.progress import note

if TYPE_CHECKING:
    from gait.bindings.model import Model
    from gait.camera.camera import Camera
    from gait.io.video import Image

JSON = False
_TURN = 0.1  # seconds

EXAMPLES = """\
examples:
  gait view --camera camera.json
  gait view --save estimate.png
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    values.add_url(parser)
    add, port, stream = parser.add_argument, values.whole(0, 65535), values.whole(*values.STREAM)
    add("--save", metavar="PNG", help="write one picture and end")
    add(
        "--patience",
        type=values.seconds,
        default=30.0,
        metavar="S",
        help="seconds that --save waits (default: 30)",
    )
    add("--port", type=port, default=0, metavar="N", help="port of the page (default: any free one)")
    add("--stream", type=stream, default=0, metavar="I", help="number of the camera (default: 0)")
    values.add_camera(parser, " (default: from GAIT_CAMERA_<i>)")
    values.add_model(parser, "model that is tracked")


def run(args: argparse.Namespace) -> int:
    """Show or save."""
    from gait.bindings.model import Model
    from gait.camera.camera import Camera
    from gait.lcm.viewer import Screen, Viewer

    camera = Camera.read(args.camera) if args.camera else None
    model, url = Model(args.model), lcm_url(args.url)
    if args.save:
        _save(args, url, model, camera)
        return 0
    screen = Screen(args.port)
    viewer = Viewer(url, args.stream, model, camera, screen.show)
    print(screen.address, flush=True)
    with Interruptible(), contextlib.suppress(KeyboardInterrupt):  # the user ends it so
        while viewer.handle(_TURN):
            pass
    screen.close()
    if viewer.damage:
        note(f"gait view: left out: {viewer.damage}", args.quiet)
    return 0


def _save(args: argparse.Namespace, url: str, model: Model, camera: Camera | None) -> None:
    import cv2

    from gait.lcm.viewer import Viewer

    pictures: list[Image] = []
    with replacing(args.save) as path:
        viewer = Viewer(url, args.stream, model, camera, pictures.append)
        note(f"listening on {url}", args.quiet)
        deadline = time.monotonic() + args.patience
        while not pictures and time.monotonic() < deadline and viewer.handle(_TURN):
            pass
        if not pictures:
            why = viewer.damage or "is gait-trackd tracking on this URL?"
            raise UserError(f"no estimate with its frame and camera came; {why}")
        if not cv2.imwrite(str(path), pictures[0]):
            raise UserError(f"{args.save}: cannot be written as an image; give a name that ends in .png")
