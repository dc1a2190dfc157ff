"""Estimate a camera from a walking person or from measured points.

--page shows a frame of the film on a local web page, where you click marks on the floor and type the measured
distances between them (or their x and y).  The floor's grid is drawn over the picture as you go.  Without
--lens, --fov and a focal length in the file, the marks also determine the focal length.

--walk estimates the whole camera, including focal length, from a person of known stature who walks on a level
floor in full view: a VIDEO, in which gait detect finds the joints, or its KEYPOINTS.csv with --size.  The
world has its origin on the floor below the camera and z up; the camera looks along y.  A walk towards or away
from the camera determines it best; the command reports what the walk does not determine.  Square pixels, no
lens distortion and a central principal point are assumed.

POINTS.csv has the columns u,v (pixels) and x,y[,z] (metres; z is up, and 0 by default for points on the
ground).  Give at least four points, far apart and not on one line.  --lens names a calibrated lens: the YAML
or XML of OpenCV's calibration, or a libgait camera file, whose position is ignored.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gait.cli import values
from gait.errors import UsageError, UserError
from gait.io.files import replacing, require_file, require_outputs
from gait.progress import note

if TYPE_CHECKING:
    from gait.bindings.model import Model
    from gait.camera.camera import Camera
    from gait.io.keypoints_file import Keypoints
    from gait.track.from_walk import Calibration

_OUTSIDE, _FILLED = 0.05, 0.72  # shares of the points, and of the picture's sides
_LARGE_ERROR_PX = 3.0  # pixels rms; above it the points should be checked

EXAMPLES = """\
examples:
  gait camera --walk walk.mp4 --height 1.75 -o camera.json
  gait camera --walk keypoints.csv --size 1280x720 --height 1.75 -o camera.json
  gait camera --page walk.mp4 --lens lens.json -o camera.json
  gait camera points.csv --lens lens.json -o camera.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("points", nargs="?", metavar="POINTS.csv", help="u,v,x,y[,z] of each point")
    parser.add_argument("--lens", metavar="FILE", help=values.CAMERA)
    parser.add_argument(
        "-o", "--output", required=True, type=values.named(".json"), metavar="CAMERA.json", help="the camera"
    )
    add = parser.add_argument_group("by clicking on the floor").add_argument
    add("--page", metavar="VIDEO|PICTURE", help="serve a page on which to click marks on the floor")
    add("--scale-camera", action="store_true", help="the film is resized: scale a lens of another resolution")
    add("--frame", type=values.whole(0), metavar="F", help="frame to show first (default: 0)")
    add("--port", type=values.whole(0, 65535), default=8040, metavar="P",
        help="port of the page (default: 8040; 0: any)")  # fmt: skip
    add = parser.add_argument_group("from a walk").add_argument
    add("--walk", metavar="VIDEO|KEYPOINTS.csv", help="a walking person")
    add("--height", type=values.stature, metavar="M", help="the person's stature in metres")
    add("--size", type=_size, metavar="WxH", help="size of the picture in pixels, with KEYPOINTS.csv")
    values.add_fov(parser)


def run(args: argparse.Namespace) -> int:
    """Find the camera and write it."""
    if args.page:
        return _on_page(args)
    if args.frame is not None or args.scale_camera:
        raise UsageError(f"--{'scale-camera' if args.scale_camera else 'frame'}: is for --page")
    return _from_walk(args) if args.walk else _from_points(args)


def _on_page(args: argparse.Namespace) -> int:
    """Serve the page until interrupted."""
    from gait.camera.camera import read_camera
    from gait.camera.marks import lens_of
    from gait.web import serve
    from gait.web.camera_page import Scene, application

    if args.points or args.walk or args.height or args.size:
        raise UsageError("--page: leave out POINTS.csv, --walk, --height and --size")
    if args.lens and args.fov:
        raise UsageError("--fov: the lens gives the focal length; leave out --lens or --fov")
    require_outputs((args.output,), (args.page, args.lens))
    picture, size, frames, fov = _pictures(args)
    first = args.frame or 0
    if first >= frames:
        raise UserError(f"{args.page}: no frame {first}; it has {frames}")
    if args.lens:
        lens, words = (
            read_camera(args.lens, size, placed=False, scale=args.scale_camera),
            f"Lens of {args.lens}.",
        )
    elif fov is not None:
        lens = lens_of(size, 0.5 * size[0] / math.tan(math.radians(0.5 * fov)))
        words = f"An ideal lens with a field of view of {fov:.0f} degrees; gait calibrate makes it exact."
    else:
        lens, words = None, "The focal length is estimated from at least five marks; --lens makes it exact."
    scene = Scene(Path(args.page).name, size, frames, picture, lens, words, args.output, first)
    own = serve.listen(args.port)
    opened = f"gait camera: open {serve.address(own)} (Ctrl-C ends it)"

    def report(line: str) -> None:
        print(json.dumps({"written": args.output}) if args.json else line, flush=True)

    serve.run(application(scene, own.getsockname()[1], report), own, lambda: note(opened))
    return 0  # also if no camera was written, since the user ended the page


def _pictures(args: argparse.Namespace) -> tuple[Callable[[int], Any], tuple[int, int], int, float | None]:
    """Return a function from frame number to picture; size; number of frames; horizontal view if known."""
    import cv2

    from gait.io.lens_tag import equivalent_mm, lens_tag, view_across
    from gait.io.video import Video

    if Path(args.page).suffix.lower() in values.PICTURES:
        require_file(args.page, "picture")
        image = cv2.imread(args.page)
        if image is None:
            raise UserError(f"{args.page}: cannot be read as a picture; give JPEG or PNG, or a film")
        size = image.shape[1], image.shape[0]
        return lambda number: image, size, 1, args.fov
    video = Video(args.page)
    tag = None if args.fov else lens_tag(video.path)
    mm = equivalent_mm(tag) if tag else None
    fov = args.fov if mm is None else view_across(mm, video.size)
    return lambda number: next(iter(video.pick([number]))).image, video.size, video.count, fov


def _from_points(args: argparse.Namespace) -> int:
    import numpy as np

    from gait.camera.camera import read_camera
    from gait.camera.placing import place, read_points

    if not args.points or not args.lens:
        raise UsageError("give POINTS.csv and --lens FILE, or --walk VIDEO and --height M, or --page VIDEO")
    if args.height or args.size or args.fov:
        raise UsageError("--height, --size and --fov go with --walk")
    require_outputs((args.output,), (args.points, args.lens))
    points = read_points(args.points)
    camera, off = place(read_camera(args.lens, placed=False), points)
    _write(args.output, camera)
    worst, rms = int(off.argmax()), float(np.sqrt((off**2).mean()))
    if rms > _LARGE_ERROR_PX:
        line = points.line[worst]
        text = f"{args.points}: reprojection error {rms:.1f} px rms; check line {line} and the lens"
        note(text, args.quiet)
    if args.json:
        place_m = camera.centre.tolist()
        print(
            json.dumps({"points": len(off), "rms_px": rms, "worst_px": float(off[worst]), "place": place_m})
        )
    else:
        print(f"{len(off)} points, {rms:.2f} px rms, {off[worst]:.2f} px at worst")
        print("camera at x {:.2f} y {:.2f} m, {:.2f} m above the ground".format(*camera.centre))
    return 0


def _from_walk(args: argparse.Namespace) -> int:
    from gait.bindings.model import Model

    if args.points or args.lens:
        raise UsageError("--walk estimates the whole camera; leave out POINTS.csv and --lens")
    if args.height is None:
        raise UsageError("--walk: needs --height M, the person's stature in metres")
    require_outputs((args.output,), (args.walk,))
    model = Model()
    found = _calibrate(args, model)
    _write(args.output, found.camera)
    print(json.dumps(found.figures()) if args.json else "\n".join(found.describe()))
    return 0


def _calibrate(args: argparse.Namespace, model: Model) -> Calibration:
    """Estimate the camera of a film or a file of keypoints."""
    from gait.io import keypoints_file
    from gait.io.video import Video
    from gait.track.from_walk import calibrate
    from gait.track.walk_camera import calibrate_film, find_people

    if Path(args.walk).suffix.lower() == ".csv":
        if args.size is None:
            raise UsageError(f"{args.walk}: give the size of the picture in pixels, as --size 1280x720")
        keypoints, _ = keypoints_file.read(args.walk, model.joint_names, ignore_unknown=True)
        _check_size(args, keypoints)
        return calibrate(keypoints, args.size, model, args.height, fov=args.fov, where=args.walk)
    if args.size:
        raise UsageError("--size: is for KEYPOINTS.csv; a video has its own size")
    video = Video(args.walk)
    people = find_people(video, args.quiet)
    return calibrate_film(video, people, model, args.height, args.fov, args.quiet)[1]


def _check_size(args: argparse.Namespace, keypoints: Keypoints) -> None:
    """Raise UserError if points are outside the picture; print a note if they fill only a part of it."""
    width, height = args.size
    outside = keypoints.outside(args.size)
    if outside > _OUTSIDE:
        raise UserError(
            f"{args.walk}: {outside:.0%} of the points are outside --size {width}x{height}; give the "
            "size of the video in which they were found"
        )
    u, v = keypoints.reach()
    if u < _FILLED * width and v < _FILLED * height:
        note(
            f"{args.walk}: all points are in the upper left {u:.0f}x{v:.0f} of --size {width}x{height}: is "
            "that the size of the video in which they were found?",
            args.quiet,
        )


def _size(text: str) -> tuple[int, int]:
    """Parse width and height, such as 1280x720."""
    from gait.bindings.abi import MAX_PIXELS

    width, cross, height = text.lower().partition("x")
    if not cross or not (width.isdigit() and height.isdigit()):
        raise argparse.ArgumentTypeError(f"{text}: give width and height in pixels, as 1280x720")
    size = int(width), int(height)
    if not all(1 <= n <= MAX_PIXELS for n in size):
        raise argparse.ArgumentTypeError(f"{text}: give width and height from 1 to {MAX_PIXELS} pixels")
    return size


def _write(path: str, camera: Camera) -> None:
    from gait.camera.camera import write_camera

    with replacing(path) as temporary:
        write_camera(temporary, camera)
