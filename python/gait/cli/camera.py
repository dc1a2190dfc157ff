"""Find where a camera stands, from a person who walks or from measured points.

--walk finds the whole camera, focal length included, from a person of known stature who walks on a level
floor in full view: a VIDEO, in which gait detect finds the joints, or its KEYPOINTS.csv with --size.  The
world has the origin on the floor below the camera, z up, and the camera looks along y.  A walk towards or
away from the camera determines it best; the command reports what the walk leaves open.  Square pixels and a
lens without distortion are assumed, with the optical axis through the middle of the picture.

POINTS.csv has the columns u,v (pixels) and x,y[,z] (metres; z is up and 0 on the ground, where it may be
left out).  Give four points or more that are far apart and not on one line.  --lens names a calibration of
the lens: the YAML or XML of OpenCV's calibration, or a camera file of gait, whose position is ignored.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from gait.cli import values
from gait.errors import UsageError
from gait.io.files import replacing, require_outputs
from gait.progress import note

if TYPE_CHECKING:
    from gait.bindings.model import Model
    from gait.camera.camera import Camera
    from gait.track.from_walk import Calibration

_LARGE = 3.0  # pixels, rms, above which the points should be checked

EXAMPLES = """\
examples:
  gait camera --walk walk.mp4 --height 1.75 -o camera.json
  gait camera --walk keypoints.csv --size 1280x720 --height 1.75 -o camera.json
  gait camera points.csv --lens lens.yaml -o camera.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("points", nargs="?", metavar="POINTS.csv", help="u,v,x,y[,z] of each point")
    parser.add_argument("--lens", metavar="FILE", help=values.CAMERA)
    parser.add_argument("-o", "--output", required=True, metavar="CAMERA.json", help="the camera")
    add = parser.add_argument_group("from a walk").add_argument
    add("--walk", metavar="VIDEO|KEYPOINTS.csv", help="a person who walks")
    add("--height", type=values.stature, metavar="M", help="the person's stature in metres")
    add("--size", type=_size, metavar="WxH", help="size of the picture in pixels, with KEYPOINTS.csv")
    values.add_fov(parser)


def run(args: argparse.Namespace) -> int:
    """Find the camera and write it."""
    return _from_walk(args) if args.walk else _from_points(args)


def _from_points(args: argparse.Namespace) -> int:
    import numpy as np

    from gait.camera.camera import read_camera
    from gait.camera.placing import place, read_points

    if not args.points or not args.lens:
        raise UsageError("give POINTS.csv and --lens FILE, or --walk VIDEO and --height M")
    if args.height or args.size or args.fov:
        raise UsageError("--height, --size and --fov go with --walk")
    require_outputs((args.output,), (args.points, args.lens))
    points = read_points(args.points)
    camera, off = place(read_camera(args.lens, placed=False), points)
    _write(args.output, camera)
    worst, rms = int(off.argmax()), float(np.sqrt((off**2).mean()))
    if rms > _LARGE:
        text = f"{args.points}: missed by {rms:.1f} px rms; check line {points.line[worst]} and the lens"
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
        raise UsageError("--walk finds the camera by itself; leave out POINTS.csv and --lens")
    if args.height is None:
        raise UsageError("--walk: needs --height M, the person's stature in metres")
    require_outputs((args.output,), (args.walk,))
    model = Model()
    found = _calibrate(args, model)
    _write(args.output, found.camera)
    print(json.dumps(found.figures()) if args.json else "\n".join(found.describe()))
    return 0


def _calibrate(args: argparse.Namespace, model: Model) -> Calibration:
    """Find the camera of a film, or of a file of keypoints."""
    from gait.io import keypoints_file
    from gait.io.video import Video
    from gait.track.from_walk import calibrate
    from gait.track.walk_camera import calibrate_film, find_person

    if Path(args.walk).suffix.lower() == ".csv":
        if args.size is None:
            raise UsageError(f"{args.walk}: give the size of the picture in pixels, as --size 1280x720")
        keypoints, _ = keypoints_file.read(args.walk, model.joint_names, ignore_unknown=True)
        return calibrate(keypoints, args.size, model, args.height, fov=args.fov, where=args.walk)
    if args.size:
        raise UsageError("--size: is for KEYPOINTS.csv; a video has its own")
    video = Video(args.walk)
    keypoints = find_person(video, args.quiet)
    return calibrate_film(video, keypoints, model, args.height, args.fov, args.quiet)


def _size(text: str) -> tuple[int, int]:
    """Width and height as 1280x720."""
    from gait.camera.camera import MAX_PIXELS

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
