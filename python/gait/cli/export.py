"""Convert a track, a lifted motion or an LCM log to another tool's format; the suffix of FILE selects it.

  .trc      joints as markers, metres, y up (OpenSim)
  .c3d      joints in millimetres, z up, with heel strikes and toe-offs as events; extra mocap
  .bvh      a skeleton of constant lengths fitted to the joints, centimetres, y up (Blender)
  .mot      its joint angles for OpenSim, and the scaled model in FILE.osim
  .parquet  all columns of the table; extra parquet
  .rrd      joints, bones and state for the Rerun viewer; extra rerun
  .mcap     the same for Foxglove; for an LCM log every message at its time; extra mcap
            with --ros2 messages of ROS 2: TF and bodies of REP 155; extra ros2

World axes are the track's, except in .trc, .mot and .bvh, where x is the track's y, y its z and z its x.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from gait.export import files
from gait.io.files import require_outputs
from gait.progress import note

EXAMPLES = """\
examples:
  gait export track.csv -o walk.c3d
  gait export motion.csv -o walk.mot
  gait export session.log -o session.mcap
  gait export session.log -o session.mcap --ros2
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    suffixes = " ".join(files.EXPORT_SUFFIXES)
    parser.add_argument(
        "input", metavar="TRACK", help="a track, a motion of gait lift, or for .mcap an LCM log"
    )
    parser.add_argument("-o", "--output", required=True, metavar="FILE", help=f"one of {suffixes}")
    parser.add_argument("--ros2", action="store_true", help="write .mcap with messages of ROS 2")


def run(args: argparse.Namespace) -> int:
    """Export the file and print a summary."""
    beside = files.BESIDE.get(Path(args.output).suffix.lower())
    outputs = (args.output, str(Path(args.output).with_suffix(beside)) if beside else None)
    require_outputs(outputs, (args.input,))
    figures = files.write(args.input, args.output, lambda words: note(words, args.quiet), args.ros2)
    print(
        json.dumps(figures) if args.json else ", ".join(f"{value:g} {key}" for key, value in figures.items())
    )
    return 0
