"""Write a track, a lifted motion or an LCM log in the format of another tool, which the suffix of FILE names.

  .trc      joints as markers, metres, y up (OpenSim)
  .c3d      joints in millimetres, z up, with heel strikes and toe-offs as events; extra mocap
  .bvh      a skeleton of constant lengths fitted to the joints, centimetres, y up (Blender)
  .mot      its joint angles for OpenSim, and beside it FILE.osim, the model of the person's size
  .parquet  all columns of the table; extra parquet
  .rrd      joints, bones and state for the Rerun viewer; extra rerun
  .mcap     the same for Foxglove; of an LCM log every message at its time; extra mcap

World axes are those of the track but for .trc, .mot and .bvh, where x is the track's y, y its z and z its x.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from gait.errors import UserError
from gait.io.files import replacing, require_outputs
from gait.progress import note

EXAMPLES = """\
examples:
  gait export track.csv -o walk.c3d
  gait export motion.csv -o walk.mot
  gait export session.lcm -o session.mcap
"""
SUFFIXES = (".trc", ".c3d", ".bvh", ".mot", ".parquet", ".rrd", ".mcap")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument(
        "input", metavar="TRACK", help="a track, a motion of gait lift, or for .mcap an LCM log"
    )
    parser.add_argument("-o", "--output", required=True, metavar="FILE", help=f"one of {' '.join(SUFFIXES)}")


def run(args: argparse.Namespace) -> int:
    """Export and report."""
    suffix = Path(args.output).suffix.lower()
    if suffix not in SUFFIXES:
        raise UserError(f"{args.output}: not a format that is written; use one of {' '.join(SUFFIXES)}")
    beside = str(Path(args.output).with_suffix(".osim")) if suffix == ".mot" else None
    require_outputs((args.output, beside), (args.input,))
    figures = _fitted(args, suffix, beside) if suffix in (".bvh", ".mot") else _plain(args, suffix)
    print(
        json.dumps(figures) if args.json else ", ".join(f"{value:g} {key}" for key, value in figures.items())
    )
    return 0


def _plain(args: argparse.Namespace, suffix: str) -> dict[str, float]:
    """Write what needs no skeleton; the figures."""
    from gait.export import c3d, mcap, motion, parquet, rerun
    from gait.io.trc import write_trc

    if suffix == ".trc":
        found = motion.read(args.input)
        rows = found.present
        write_trc(args.output, found.names, found.time[rows], found.places[rows], found.rate)
        return {"frames": int(rows.sum())}
    with replacing(args.output) as file:
        if suffix == ".parquet":
            return {"rows": parquet.write(file, args.input)}
        if suffix == ".mcap" and mcap.is_lcm_log(args.input):
            counts = mcap.write_log(file, args.input)
            return {"messages": sum(counts.values()), "topics": len(counts)}
        found = motion.read(args.input)
        if suffix == ".c3d":
            return {"frames": len(found.places), "events": c3d.write(file, found)}
        write = rerun.write if suffix == ".rrd" else mcap.write_motion
        return {"frames": write(file, found)}


def _fitted(args: argparse.Namespace, suffix: str, beside: str | None) -> dict[str, Any]:
    """Write the motion of a skeleton; the figures."""
    from gait.export import angles, bvh, motion, opensim

    found = motion.read(args.input)
    fitted = angles.fit(found.places)
    with replacing(args.output) as file:
        if suffix == ".bvh":
            if lacking := bvh.write(file, found, fitted):
                note(f"{args.input}: lacks {lacking} frames, which repeat the one before", args.quiet)
        else:
            opensim.write_mot(file, found, fitted)
    if beside:
        with replacing(beside) as file:
            opensim.write_osim(file, found.name, fitted)
    return {"frames": len(found.places), "mm from the joints (rms)": round(1000 * fitted.rms, 2)}
