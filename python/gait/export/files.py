"""Write other tools' files, chosen by suffix."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from gait.errors import UsageError, UserError
from gait.io.files import replacing

EXPORT_SUFFIXES = (".trc", ".c3d", ".bvh", ".mot", ".parquet", ".rrd", ".mcap")
BESIDE = {".mot": ".osim"}
"""Suffixes of files that are written with a second file of the same name."""


def write(
    source: str, target: str, report: Callable[[str], None] = lambda words: None, ros2: bool = False
) -> dict[str, Any]:
    """Write a track, a motion of ``gait lift`` or an LCM log in the format of the target's suffix.

    Parameters
    ----------
    source, target : str
    report : callable
        Called with a line about anything that the format cannot represent.
    ros2 : bool
        For .mcap: write messages of ROS 2 instead of Foxglove's.

    Returns
    -------
    dict
        Figures, by their names in words.

    Raises
    ------
    UserError
        If the format is unknown, or cannot represent the source.
    """
    suffix = Path(target).suffix.lower()
    if suffix not in EXPORT_SUFFIXES:
        raise UserError(f"{target}: not a supported format; use one of {' '.join(EXPORT_SUFFIXES)}")
    if ros2 and suffix != ".mcap":
        raise UsageError(f"--ros2: is for .mcap, not for {target}")
    if suffix in (".bvh", ".mot"):
        return _fitted(source, target, suffix, report)
    return _to_ros2(source, target) if ros2 else _plain(source, target, suffix)


def _to_ros2(source: str, target: str) -> dict[str, Any]:
    from gait.export import mcap, motion, ros2

    with replacing(target) as file:
        log = mcap.is_lcm_log(source)
        counts = ros2.write_log(file, source) if log else ros2.write_motion(file, motion.read(source))
    return {"messages": sum(counts.values()), "topics": len(counts)}


def _plain(source: str, target: str, suffix: str) -> dict[str, Any]:
    """Write a format that needs no skeleton."""
    from gait.export import c3d, mcap, motion, parquet, rerun  # each imports its own packages
    from gait.io.trc import write_trc

    if suffix == ".trc":
        found = motion.read(source)
        rows, frames = found.present, found.track.frame
        write_trc(target, found.names, found.time[rows], found.places[rows], found.rate, frames)
        return {"frames": int(rows.sum())}
    with replacing(target) as file:
        if suffix == ".parquet":
            return {"rows": parquet.write(file, source)}
        if suffix == ".mcap" and mcap.is_lcm_log(source):
            counts = mcap.write_log(file, source)
            return {"messages": sum(counts.values()), "topics": len(counts)}
        found = motion.read(source)
        if suffix == ".c3d":
            return {"frames": len(found.places), "events": c3d.write(file, found)}
        to = rerun.write if suffix == ".rrd" else mcap.write_motion
        return {"frames": to(file, found)}


def _fitted(source: str, target: str, suffix: str, report: Callable[[str], None]) -> dict[str, Any]:
    """Write a format that needs a fitted skeleton."""
    from gait.export import angles, bvh, motion, opensim

    found = motion.read(source)
    fitted = angles.fit(found.places)
    with replacing(target) as file:
        if suffix == ".bvh":
            if lacking := bvh.write(file, found, fitted):
                report(f"{source}: lacks {lacking} frames, which repeat the previous frame")
        else:
            opensim.write_mot(file, found, fitted)
    if suffix in BESIDE:
        with replacing(Path(target).with_suffix(BESIDE[suffix])) as file:
            opensim.write_osim(file, found.name, fitted)
    return {"frames": len(found.places), "mm from the joints (rms)": round(1000 * fitted.rms, 2)}
