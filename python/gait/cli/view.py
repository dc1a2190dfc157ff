"""Watch a running tracker, in a browser on this machine.

Serves a page and prints its address.  The page shows each estimate of gait-trackd drawn into its frame, the
figure in space, status, rate, latency and drops, and plots of the last 20 seconds.  It can be paused, save a
picture, and record all messages into an LCM log.  With --save the first complete picture is written to a PNG
file instead, and the command ends.
"""

from __future__ import annotations

import argparse
import contextlib
import time
from typing import TYPE_CHECKING

from gait.cli import values
from gait.errors import UsageError, UserError
from gait.io.files import replacing, require_folder
from gait.lcm.link import lcm_url, silence
from gait.progress import note
from gait.signals import Interruptible

if TYPE_CHECKING:
    from gait.bindings.model import Model
    from gait.camera.camera import Camera
    from gait.io.video import Image

JSON = False
_TURN = 0.1  # seconds between polls

EXAMPLES = """\
examples:
  gait view --camera camera.json
  gait view --save estimate.png
  gait view --person 1 --person 2
  gait view --person 'udpm://239.255.76.67:7671?ttl=0' --person 'udpm://239.255.76.67:7672?ttl=0'
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    values.add_url(parser)
    add, port, stream = parser.add_argument, values.whole(0, 65535), values.whole(*values.STREAM)
    add("--save", type=values.named(*values.PICTURES), metavar="PNG", help="write one picture and end")
    add(
        "--patience",
        type=values.seconds,
        default=30.0,
        metavar="S",
        help="how many seconds --save waits (default: 30)",
    )
    add("--port", type=port, default=0, metavar="N", help="port of the page (default: any free one)")
    add(
        "--stream",
        type=stream,
        action="append",
        metavar="I",
        help="number of a camera; repeat for several (default: 0)",
    )
    add(
        "--person",
        type=values.tracker,
        action="append",
        metavar="N|URL",
        help="number of a person (gait-trackd --people), or URL on which a tracker publishes (its --out); "
        "repeat for each person (default: the one on --url)",
    )
    add(
        "--record-to",
        metavar="FOLDER",
        help="folder for recordings, created if needed (default: the current one)",
    )
    values.add_camera(parser, ", for the first --stream (default: from GAIT_CAMERA_<i>)", scale=True)
    values.add_model(parser, "model that is tracked")


def run(args: argparse.Namespace) -> int:
    """Serve the page, or save one picture."""
    from gait.bindings.model import Model
    from gait.camera.camera import Camera

    streams = tuple(args.stream or [0])
    for option, given in (("--stream", streams), ("--person", args.person or ())):
        for each in given:
            if given.count(each) > 1:
                raise UsageError(f"{option} {each}: is given twice; give each once")
    if args.record_to:
        require_folder(args.record_to)
    cameras = {streams[0]: Camera.read(args.camera)} if args.camera else {}
    model, url = Model(args.model), lcm_url(args.url)
    if args.save:
        _save(args, url, streams, model, cameras)
    else:
        _serve(args, url, streams, model, cameras)
    return 0


def _serve(
    args: argparse.Namespace, url: str, streams: tuple[int, ...], model: Model, cameras: dict[int, Camera]
) -> None:
    from gait.live.feed import Feed, answers
    from gait.live.server import Page

    people = args.person or []
    page = Page(args.port, streams, url, args.record_to or ".", [one.url for one in answers(url, people)])
    try:
        feed = Feed(
            url, streams, model, cameras, page.show, page.report, args.scale_camera, page.watched, people
        )
        page.begin(feed.page_data, feed.scene)
        with Interruptible(), contextlib.suppress(KeyboardInterrupt):  # this is how the user ends it
            print(page.address, flush=True)
            while feed.handle(_TURN):
                pass
    finally:
        page.close()
    if feed.damage:
        note(f"gait view: left out: {feed.damage}", args.quiet)


def _save(
    args: argparse.Namespace, url: str, streams: tuple[int, ...], model: Model, cameras: dict[int, Camera]
) -> None:
    from gait.io.video import write_picture
    from gait.live.feed import Feed

    pictures: list[Image] = []
    with replacing(args.save) as path:
        feed = Feed(
            url,
            streams[:1],
            model,
            cameras,
            lambda stream, image: pictures.append(image),
            scale=args.scale_camera,
        )
        note(f"listening on {url}", args.quiet)
        deadline = time.monotonic() + args.patience
        while not pictures and time.monotonic() < deadline and feed.handle(_TURN):
            pass
        if not pictures:
            why = feed.damage or silence(url)
            raise UserError(f"received no estimate with its frame and camera; {why}")
        write_picture(path, pictures[0])
