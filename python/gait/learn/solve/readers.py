"""Files to bodies: which reader takes which kind of file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import SIDES
from gait.errors import UserError
from gait.io.trc import read_trc
from gait.learn.mocap import angle_file, c3d_file, marker_sets, mocap_asf, mocap_bvh, remarks
from gait.learn.mocap.angle_file import AngleTable
from gait.learn.mocap.recording import FARTHEST, Y_UP, require_frames, require_range
from gait.learn.reading import DEFAULT, Reading
from gait.learn.solve import joint_file, marker_body, root, torn_joint
from gait.learn.solve.body import Body, body
from gait.learn.solve.stretch_information import Information

Floats = npt.NDArray[np.float64]

RECORDINGS = {".amc": mocap_asf.read, ".bvh": mocap_bvh.read}
LEG = 0.25, 1.5  #: metres from hip over knee to ankle, from small children to more than the tallest man
MARKED = (".c3d", ".trc")  #: suffixes of files that may hold markers
#: Suffixes that are learnt from.
KINDS = (*RECORDINGS, *MARKED, ".csv")


def read(path: Path, reading: Reading = DEFAULT, stretch: Floats | None = None) -> Body | AngleTable:
    """Read a motion file by its suffix; a .csv may hold angles alone.

    Parameters
    ----------
    stretch : (S,), optional
        Of the person, for files of markers (`gait.learn.solve.marker_body.body`).

    Raises
    ------
    UserError
        If the file is malformed or lacks a joint; it names file, place and remedy.
    """
    suffix = path.suffix.lower()
    if suffix == ".csv" and angle_file.holds_angles(path):
        return angle_file.read(path, reading.fps, reading.zero_runs)
    if suffix in RECORDINGS:
        walker = body(RECORDINGS[suffix](path, reading.fps, reading.zero_runs))
    elif suffix == ".csv":
        walker = joint_file.read_csv(path, reading.fps, reading.zero_runs)
    else:
        walker = _points(path, reading, stretch)
    _require_size(path, walker)
    return root.overground(walker)


def _require_size(path: Path, walker: Body) -> None:
    """Refuse a body that is no human's, which positions in other units than metres make.

    Raises
    ------
    UserError
    """
    hip, knee, ankle = (
        np.stack([walker.joints[f"{s}_{joint}"] for s in SIDES]) for joint in ("hip", "knee", "ankle")
    )
    legs = np.linalg.norm(hip - knee, axis=2) + np.linalg.norm(knee - ankle, axis=2)
    if not np.isfinite(legs).any():  # what is not seen is judged by what comes after
        return
    leg, (least, most) = float(np.nanmedian(legs)), LEG
    if not least <= leg <= most:
        raise UserError(
            f"{path}: legs of {leg:.3g} m, {least:g} to {most:g} are plausible; correct the file's units"
        )


def information(path: Path, reading: Reading = DEFAULT) -> Information | None:
    """Find what a file of a kind of `MARKED` tells of the person's stretches; None if no markers do.

    Raises
    ------
    UserError
        If the file is malformed, or its markers are not known.
    """
    labels, points, _ = _labelled(path)
    if _of_joints(labels, reading):
        return None
    return marker_body.information(path, labels, points, reading.markers)


def _points(path: Path, reading: Reading, stretch: Floats | None) -> Body:
    """Read labelled points: centres of all joints (y up, as `gait track --trc` writes them), or markers."""
    labels, points, rate = _labelled(path)
    fps = reading.fps or rate
    if _of_joints(labels, reading):
        upright = points @ Y_UP.T
        places = {name: upright[:, k] for k, name in enumerate(labels)}
        torn_joint.refuse(places, joint_file.find(labels), lambda frame: f"{path}: frame {frame + 1}")
        return joint_file.body(path, places, fps)
    walker = marker_body.body(path, labels, points, fps, reading.markers, stretch)
    known = map(marker_sets.plain, labels) if reading.markers else ()
    return replace(walker, remarks=remarks.Remarks(frozenset(known)))


def _of_joints(labels: list[str], reading: Reading) -> bool:
    """Whether points are centres of joints."""
    return reading.markers is None and set(joint_file.NEEDED) <= set(joint_file.find(labels))


def _labelled(path: Path) -> tuple[list[str], Floats, float]:
    """Labels, points (T, M, 3) and frames per second.

    A point at exactly (0, 0, 0) is missing: so these formats write gaps.
    """
    labels, points, rate = (read_trc if path.suffix.lower() == ".trc" else c3d_file.read)(path)
    require_frames(path, len(points))
    for k, label in enumerate(labels):
        require_range(path, f"point {label!r} at", points[:, k], FARTHEST, "metres")
    points[(points == 0).all(axis=2)] = np.nan
    return labels, points, rate
