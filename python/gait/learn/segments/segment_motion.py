"""Markers of a recording as segments are cut from: at their rate, in statures, the floor at zero.

From joints or bones the markers are those of the default skeleton in the recording's own pose and with the
body's own lengths.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from gait.body.skeleton import ANGLES, CHANNELS, SIDES
from gait.errors import UserError
from gait.learn.mocap.angle_file import AngleTable
from gait.learn.rotations import decompose_zyx
from gait.learn.segment_options import Segments
from gait.learn.segments import segment_angles, segment_people
from gait.learn.segments.segment_people import Pose
from gait.learn.segments.virtual_markers import MARKERS
from gait.learn.solve import retarget, root
from gait.learn.solve.body import RECORDED, Body

Floats = npt.NDArray[np.float64]

PASS = 0.4  # of the segments' rate: faster motion is filtered out before sampling
ORDER = 4  # of the filter, forth and back together
STEEPEST = np.radians(2.5)  # a floor that slopes more is stairs, or somebody who climbs
TURNS = [CHANNELS.index(f"root_{name}") for name in ("yaw", "pitch", "roll")]


@dataclass(frozen=True)
class Motion:
    """Markers over T frames at the segments' rate.

    Attributes
    ----------
    names : tuple of str
        The J markers.
    places : (T, J, 3)
        Statures, floor at z = 0; NaN where missing.
    root : (T, 3)
        Place of the pelvis on the ground, statures, and the body's heading by its hips, radians; NaN where
        not known.
    stature : float
        Metres; NaN if the recording does not show it.
    people : (C, T, J, 3)
        Places of people who were not recorded but move alike; C is 0 unless wanted.
    """

    names: tuple[str, ...]
    places: Floats
    root: Floats
    stature: float
    people: Floats


def of(path: Path, read: Body | AngleTable, wanted: Segments, kept: tuple[int, int] | None = None) -> Motion:
    """Markers of what was read from a file.

    Parameters
    ----------
    kept : (start, stop), optional
        Frames of it to use, by default all.

    Raises
    ------
    UserError
        If the hips are hardly seen, or recorded markers are wanted of a file that has none.
    """
    part = slice(*(kept or (0, read.frames)))
    pose: Pose | None = None
    if isinstance(read, AngleTable):
        pose, stature, names = segment_angles.pose(_angles(read, part)), read.stature or np.nan, MARKERS
        about = pose.places()
        places = about + segment_angles.standing(about, pose.proportions)[:, None]
        hips = places[:, [MARKERS.index(f"{s}_hip") for s in SIDES]]
    else:
        body = _levelled(read, part)
        measures = retarget.measure(body)
        stature = measures.stature
        floor = np.array([0.0, 0.0, root.ground_height(body, stature)])
        hips = (np.stack([body.joints[f"{s}_hip"] for s in SIDES], axis=1) - floor) / stature
        if wanted.markers == "recorded":
            names, places = _recorded(body)
            places = (places - floor) / stature
        else:
            pose, names = _pose(body, measures), MARKERS
            places = pose.places() + ((body.joints["pelvis"] - floor) / stature)[:, None]
    if wanted.markers == "recorded" and (not names or pose is not None):
        raise UserError(f"{path}: holds no recorded markers; leave out --segment-markers recorded")
    if np.isfinite(hips).all(axis=(1, 2)).sum() < 2:
        raise UserError(f"{path}: the hips are hardly seen; leave the file out")
    sampled = resample(np.concatenate([places, hips], axis=1), read.fps, wanted.fps)
    places, left, right = sampled[:, :-2], sampled[:, -2], sampled[:, -1]
    heading = np.arctan2(right[:, 0] - left[:, 0], left[:, 1] - right[:, 1])
    others = np.zeros((0, *places.shape))
    if pose is not None and wanted.people:
        nearest = np.round(_times(len(hips), read.fps, wanted.fps)).astype(int)
        others = places + segment_people.displacements(
            replace(pose, channels=pose.channels[nearest]), path.stem
        )
    return Motion(names, places, np.column_stack([(left + right)[:, :2] / 2, heading]), stature, others)


def _angles(table: AngleTable, part: slice) -> AngleTable:
    return replace(table, angles=table.angles[part], root=None if table.root is None else table.root[part])


def _levelled(body: Body, part: slice) -> Body:
    """Frames of a body on a level floor, with the pelvis axes in their standard place."""
    joints = {name: places[part] for name, places in body.joints.items()}
    lateral = {name: axes[part] for name, axes in body.lateral.items()}
    cut = replace(body, joints=joints, pelvis=body.pelvis[part], lateral=lateral)
    level, slope = root.level(cut)
    return root.align_pelvis(level if abs(slope) < STEEPEST else cut)


def _recorded(body: Body) -> tuple[tuple[str, ...], Floats]:
    """Names and places (T, J, 3) of the markers that a file holds, metres."""
    own = {name.removeprefix(RECORDED): x for name, x in body.joints.items() if name.startswith(RECORDED)}
    return tuple(own), np.stack(list(own.values()), axis=1) if own else np.zeros((body.frames, 0, 3))


def _pose(body: Body, measures: retarget.Measures) -> Pose:
    """Pose of the default skeleton as the body's, with its lengths."""
    channels = np.zeros((body.frames, len(CHANNELS)))
    channels[:, : len(ANGLES)] = retarget.angles(body, measures)
    channels[:, TURNS] = decompose_zyx(body.pelvis)
    return Pose(retarget.generic_proportions([measures]), channels)


def _times(frames: int, fps: float, rate: float) -> Floats:
    """When to sample, in frames."""
    return np.arange(0, frames - 1 + 1e-9, fps / rate)


def resample(places: Floats, fps: float, rate: float) -> Floats:
    """Places (T, J, 3) at another rate, without what is too fast for it; NaN where they were missing.

    A Butterworth filter forth and back, then a cubic spline; gaps are bridged for these alone.
    """
    frames, flat, at = len(places), places.reshape(len(places), -1), _times(len(places), fps, rate)
    result = np.full((len(at), flat.shape[1]), np.nan)
    seen = np.isfinite(flat)
    columns = np.flatnonzero(seen.sum(axis=0) > 1)
    time = np.arange(frames, dtype=float)
    if len(columns):
        signals = [np.interp(time, time[seen[:, k]], flat[seen[:, k], k]) for k in columns]
        filled = np.stack(signals, axis=1)
        if PASS * rate < 0.5 * fps:
            low = butter(ORDER // 2, 2 * PASS * rate / fps, output="sos")
            filled = sosfiltfilt(low, filled, axis=0, padlen=min(frames - 1, round(2 * fps / rate)))
        near = np.clip(np.stack([np.floor(at), np.ceil(at)]).astype(int), 0, frames - 1)
        known = seen[near].all(axis=0)[:, columns]
        result[:, columns] = np.where(known, CubicSpline(time, filled)(at), np.nan)
    return result.reshape(len(at), *places.shape[1:])
