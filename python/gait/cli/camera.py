"""Find where a camera stands from points on or above the ground whose places are measured.

POINTS.csv has the columns u,v (pixels) and x,y[,z] (metres; z is up and 0 on the ground, where it may be
left out).  Give four points or more that are far apart and not on one line.  --lens names a calibration of
the lens: the YAML or XML of OpenCV's calibration, or a camera file of gait, whose position is ignored.
"""

from __future__ import annotations

import argparse
import json

import numpy as np

from gait.camera.camera import Camera, read_camera
from gait.camera.placing import place, read_points
from gait.cli import values
from gait.io.files import replacing, require_outputs
from gait.progress import note

_LARGE = 3.0  # pixels, rms, above which the points should be checked

EXAMPLES = """\
examples:
  gait camera points.csv --lens lens.yaml -o camera.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("points", metavar="POINTS.csv", help="u,v,x,y[,z] of each point")
    parser.add_argument("--lens", required=True, metavar="FILE", help=values.CAMERA)
    parser.add_argument("-o", "--output", required=True, metavar="CAMERA.json", help="the camera")


def run(args: argparse.Namespace) -> int:
    """Read, place, write."""
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


def _write(path: str, camera: Camera) -> None:
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(camera.to_dict(), indent=1) + "\n")
