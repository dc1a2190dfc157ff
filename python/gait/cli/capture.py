"""Send the frames of a video file, a camera or a network stream over LCM, as a camera in the field would.

A file is sent at its recorded rate, with time stamps that start now, or at --begin-at: two files of one scene
need the same --begin-at, a few seconds from now, as each would start at its own time.  Each frame has its
number, so that receivers can count missed frames.  Calibration and empty scene are announced at the start
and every two seconds.  With --init the tracker gets a START for the right frame.

Time stamps advance as in the file, whatever the --rate: at another rate than the true one, gait-trackd and
gait record report latencies that are not those of the machine.

--wait makes sure that a tracker is listening: the stream begins when gait-trackd has confirmed the camera,
the empty scene and START.  Without it the stream begins at once.  With trackers of several people, --person N
sends START to that of person N.

--url file:///PATH.log?mode=w writes an LCM log instead, from which gait-trackd drops no frame; ?mode=a
appends to one.  A log is replayed in the order of its messages, so a second camera's film cannot come after
that of the first: send both at once, with --begin-at, and record them with lcm-logger.

If a stream (RTSP, HTTP) breaks, the command reconnects within seconds; frames are stamped as they arrive.

The command ends after the last frame, or when interrupted (Ctrl-C, SIGTERM), never within a frame.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from contextlib import suppress
from itertools import chain
from typing import TYPE_CHECKING

from gait.cli import values
from gait.errors import UsageError, UserError
from gait.io.files import require_unread
from gait.lcm.link import buffer_warning, is_log, lcm_url, log_of, publisher
from gait.progress import note, progress, warning
from gait.signals import Interruptible

if TYPE_CHECKING:
    from gait.bindings.initial import Start
    from gait.camera.camera import Camera
    from gait.io.video import Frame
    from gait.lcm.capture import DeviceSource, FileSource, Pacer, Publisher, Setup

EXAMPLES = """\
examples:
  gait capture walk.mp4 --camera camera.json --background auto --init auto --wait 30
  gait capture /dev/video0 --camera camera.json --background empty.png
  gait capture rtsp://10.0.0.5/live --camera camera.json --background empty.png --jpeg 90
  gait capture walk.mp4 --camera camera.json --init init.json --rate max --url file:///data/walk.log?mode=w
"""


_LATEST = 1e11  # seconds; milliseconds since 1970 are more


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    add = parser.add_argument
    add(
        "source",
        metavar="VIDEO|DEVICE|URL",
        help="file that FFmpeg reads, or camera: 0, /dev/video0, rtsp://..., http://...",
    )
    values.add_camera(parser, ", to announce", scale=True)
    add(
        "--camera-path",
        metavar="POSES.csv",
        help="with a file: poses of a moving camera, sent with the frames for gait-trackd --moving-camera",
    )
    values.add_clip(parser, "send", init="none", background="none")
    parser.set_defaults(init=None, start=0)
    values.add_model(parser, "model whose prior supplies what --init does not give")
    add(
        "--rate",
        default="true",
        metavar="true|max|HZ",
        help="frames per second to send: the true rate (default), max, or a number",
    )
    add(
        "--begin-at",
        type=values.seconds,
        metavar="T",
        help="capture time of a file's first frame, seconds since 1970 (date +%%s); default: now",
    )
    add("--jpeg", type=values.whole(1, 100), metavar="Q", help="compress frames with this quality, 1 to 100")
    add("--grey", action="store_true", help="send grey frames")
    add("--loop", action="store_true", help="repeat the file until interrupted")
    stream = values.whole(*values.STREAM)
    add("--stream", type=stream, default=0, metavar="I", help="number of the camera (default: 0)")
    add(
        "--wait",
        type=values.seconds,
        default=0.0,
        metavar="S",
        help="wait at most S seconds for a tracker (default: 0)",
    )
    add(
        "--person",
        type=values.whole(*values.PERSON),
        metavar="N",
        help="with gait-trackd --people or --person: the person that --init describes, whose tracker answers",
    )
    values.add_url(parser)


def run(args: argparse.Namespace) -> int:
    """Send the frames and print a summary."""
    from gait.lcm.capture import Publisher, parse_rate

    url, rate = lcm_url(args.url), parse_rate(args.rate)
    _require_sense(args, url)
    with Interruptible() as signals:
        source = _source(args)
        setup = _setup(args, source)
        few = buffer_warning(url)
        if few:
            note(f"gait capture: {few}", args.quiet)
        with publisher(url) as out:
            sender = Publisher(out, setup)
            pacer = _send(args, source, sender, rate, signals)
    _report(args, source, sender, pacer)
    return 0


def _require_sense(args: argparse.Namespace, url: str) -> None:
    """Raise unless the options go together and the log to write is not a file to read."""
    if args.stop is not None:
        values.require_order(args.start, args.stop)
    if args.height is not None and not args.init:
        raise UsageError("--height: is for --init; give an init file, or auto")
    if args.person is not None and not (args.init or args.wait > 0):
        raise UsageError("--person: is for --init and --wait; frames are everyone's")
    if args.begin_at is not None and args.begin_at > _LATEST:
        raise UsageError(f"--begin-at {args.begin_at:g}: give seconds since 1970")
    if not is_log(url):
        return
    if args.wait > 0:
        raise UsageError(f"--wait: no tracker listens to the log {url}; leave out --wait")
    require_unread(
        log_of(url)[0], (args.source, args.camera, args.camera_path, args.background, args.init, args.model)
    )


def _send(
    args: argparse.Namespace,
    source: FileSource | DeviceSource,
    publisher: Publisher,
    rate: float | None,
    signals: Interruptible,
) -> Pacer:
    """Send all frames, or until an interrupt, which is how to end a camera or a loop."""
    from gait.lcm.capture import DeviceSource

    if args.wait > 0:
        publisher.meet(args.wait)
    frames = _primed(source)
    pacer = publisher.begin(source, float("inf") if source.live else rate, args.wait)
    total = None if isinstance(source, DeviceSource) or args.loop else (args.stop or source.video.count)
    with progress("sending", total, args.quiet) as update, suppress(KeyboardInterrupt):
        stop = source.stop if isinstance(source, DeviceSource) else lambda: None
        publisher.send(frames, pacer, update, signals.uninterrupted, stop)
    return pacer


def _primed(source: FileSource | DeviceSource) -> Iterator[Frame]:
    """Iterate over the source's frames, after decoding a file's first one, which may take long to find."""
    from gait.lcm.capture import DeviceSource

    frames = source.frames()
    if isinstance(source, DeviceSource):
        return frames
    return chain([next(frames)], frames)


def _source(args: argparse.Namespace) -> FileSource | DeviceSource:
    from gait.lcm.capture import DeviceSource, FileSource, is_device
    from gait.lcm.streams import StreamSource, is_stream

    stream = is_stream(args.source)
    if not stream and not is_device(args.source):
        return FileSource(args.source, args.start, args.stop, grey=args.grey, loop=args.loop)
    timed = args.start or args.stop is not None or args.begin_at is not None
    if timed or args.loop or args.rate != "true" or args.background == "auto":
        raise UsageError(
            f"{args.source}: is a camera: --start --stop --begin-at --loop --rate and --background auto are "
            f"for files"
        )
    if stream:
        return StreamSource(args.source, grey=args.grey, quiet=args.quiet)
    return DeviceSource(args.source, grey=args.grey)


def _setup(args: argparse.Namespace, source: FileSource | DeviceSource) -> Setup:
    import cv2
    import numpy as np

    from gait.camera.camera import Camera
    from gait.io.video import background, read_plate
    from gait.lcm.capture import DeviceSource, FileSource, Setup

    setup = Setup(stream=args.stream, jpeg=args.jpeg, person=args.person)
    setup.begin_at = None if args.begin_at is None else round(1e6 * args.begin_at)
    if args.camera and not args.camera_path:
        setup.camera = Camera.read(args.camera, source.size, args.scale_camera)
    if args.camera_path:
        setup.camera, setup.cameras = _moving(args, source)
    if isinstance(source, DeviceSource):
        setup.plate = None if args.background == "none" else read_plate(args.background, source.size)
    else:
        with progress("background", source.video.count, args.quiet) as update:
            setup.plate = background(args.background, source.video, update)
    if args.init:
        setup.start = _start(args, source, setup)
        if isinstance(source, FileSource):
            setup.start_time = source.time_of(setup.start.frame)
        if setup.start.frame < args.start:
            raise UserError(
                f"{args.init}: frame {setup.start.frame} comes before --start {args.start}; begin earlier"
            )
        if args.stop is not None and setup.start.frame >= args.stop:
            raise UserError(
                f"{args.init}: frame {setup.start.frame} is not sent with --stop {args.stop}; end later"
            )
    if args.grey and setup.plate is not None and setup.plate.ndim == 3:
        setup.plate = np.asarray(cv2.cvtColor(setup.plate, cv2.COLOR_BGR2GRAY), np.uint8)
    return setup


def _moving(args: argparse.Namespace, source: FileSource | DeviceSource) -> tuple[Camera, dict[int, Camera]]:
    """Return the camera of the first frame, and those of all frames, of a moving camera."""
    from gait.camera.camera import read_camera
    from gait.camera.path import CameraPath
    from gait.lcm.capture import FileSource

    if not args.camera or not isinstance(source, FileSource) or args.loop or args.init == "auto":
        raise UsageError(
            "--camera-path: needs --camera for the lens, and a file without --loop and --init auto"
        )
    if args.background != "none":
        raise UsageError("--camera-path: a moving camera has no empty scene to send; give --background none")
    frames = source.video.span(args.start, args.stop)
    lens = read_camera(args.camera, source.size, placed=False, scale=args.scale_camera)
    poses = CameraPath.read(args.camera_path).at_times(
        source.video.times[frames.start : frames.stop], frames.start
    )
    found = {number: pose.camera(lens) for number, pose in zip(frames, poses, strict=True)}
    return found[frames.start], found


def _start(args: argparse.Namespace, source: FileSource | DeviceSource, setup: Setup) -> Start:
    from gait.bindings.initial import OUTSIDE_PICTURE, Start
    from gait.bindings.model import Model
    from gait.lcm.capture import DeviceSource

    model = Model(args.model)
    if args.init != "auto":
        start = Start.read(args.init, model, height=args.height)
        if setup.camera and not setup.camera.shows(model.pose(start.mean)[0]):
            note(f"{args.init}: {OUTSIDE_PICTURE}", args.quiet)
        return start
    if isinstance(source, DeviceSource) or setup.camera is None:
        raise UsageError("--init auto: needs a video file and --camera; give an init file")
    from gait.track.box_start import find_start  # slow to import, and only needed here

    return find_start(
        source.video, setup.camera, setup.plate, model, first=args.start, stop=args.stop, height=args.height
    )


def _report(
    args: argparse.Namespace, source: FileSource | DeviceSource, publisher: Publisher, pacer: Pacer
) -> None:
    from gait.lcm.capture import DeviceSource

    if not isinstance(source, DeviceSource) and (broken := source.video.broken):
        warning(broken, args.quiet)
    late = round(pacer.late * 1000, 2)
    if args.json:
        print(json.dumps({"frames": publisher.sent, "late_ms": late}))
    elif not args.quiet:
        print(f"{publisher.sent} frames sent, at most {late:g} ms late")
