"""Markers of a recording from which segments are cut: at the segments' rate, in statures, floor at z = 0.

From joints or bones, the markers are those of the default skeleton in the recording's pose and with the
body's lengths; a file with only angles has the default body, standing on its lower foot.

A few dozen recordings show only a few people, and a prior of only these is far too certain about the next
person. Therefore each recording is also used as it would be of people who hold their joints a little
differently throughout and have longer or shorter limbs, in pairs of opposite changes.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from gait.body.skeleton import ANGLES, CHANNELS, ROOTS, SIDES, Proportions, points
from gait.errors import UserError
from gait.learn.arrays import Floats
from gait.learn.mocap.tables import AngleTable
from gait.learn.options import SegmentOptions
from gait.learn.prior.lengths import GROUPS
from gait.learn.rotations import decompose
from gait.learn.segments.virtual_markers import MARKERS, marked_skeleton
from gait.learn.solve import retarget
from gait.learn.solve.body import RECORDED, Body

PASS = 0.4  # of the segments' rate; faster motion is filtered out before sampling
ORDER = 4  # of the filter, forward and backward together
STEEPEST_FLOOR = np.radians(2.5)  # a steeper floor is stairs or climbing
ROTATION_COLUMNS = [CHANNELS.index(f"root_{name}") for name in ("yaw", "pitch", "roll")]
ARMS = tuple(f"{s}_{joint}" for s in SIDES for joint in ("shoulder", "elbow"))
PAIRS = 4  # pairs of people per recording
#: Variation of people's joint angles in the same gait, degrees: about the residual of a held-out person in
#: the cyclic model (section CHST).  Keys are a joint, or a joint and axis, which take precedence.
WALKING_POSTURE_SD_DEG = {
    "neck": 6.0, "torso": 3.0, "shoulder_rotation": 12.0, "shoulder": 4.0, "elbow": 6.0, "hip_rotation": 4.0,
    "hip": 2.0, "knee": 3.0, "ankle": 3.0,
}  # fmt: skip
LENGTH = 0.05  # relative sd of each length at the same stature
FOOT_COLUMNS = [MARKERS.index(f"{s}_{part}") for s in SIDES for part in ("toe", "heel")]


@dataclass(frozen=True)
class BodyPose:
    """A body's proportions and its channels (T, 30) over time, as in `gait.body.skeleton`."""

    proportions: Proportions
    channels: Floats

    def places(self) -> Floats:
        """Return the markers (T, J, 3) about the pelvis, statures."""
        return points(marked_skeleton(self.proportions).sections(), self.channels)


@dataclass(frozen=True)
class Motion:
    """J markers over T frames at the segments' rate."""

    names: tuple[str, ...]
    places: Floats  #: (T, J, 3) statures, floor at z = 0; NaN where missing
    #: (T, 3) position of the pelvis on the ground, statures, and heading by the hips, radians; NaN if
    #: unknown.
    root: Floats
    stature: float  #: metres; NaN if the recording does not show it
    people: Floats  #: (C, T, J, 3) positions for people who were not recorded; C is 0 unless wanted


def of(
    path: Path, read: Body | AngleTable, wanted: SegmentOptions, kept: tuple[int, int] | None = None
) -> Motion:
    """Return the markers of a file's contents, in all frames or in the frames [start, stop) `kept`.

    UserError if the hips are hardly visible, or recorded markers are wanted from a file that has none.
    """
    read = read.part(*kept) if kept else read
    pose: BodyPose | None = None
    if isinstance(read, AngleTable):
        pose, stature, names = _pose_of_angles(read), read.stature or np.nan, MARKERS
        about = pose.places()
        places = about + standing(about, pose.proportions)[:, None]
        hips = places[:, [MARKERS.index(f"{s}_hip") for s in SIDES]]
    else:
        body = retarget.levelled(read, STEEPEST_FLOOR)
        measures = retarget.measure(body)
        stature = measures.stature
        floor = np.array([0.0, 0.0, retarget.ground_height(body, stature)])
        hips = (np.stack([body.joints[f"{s}_hip"] for s in SIDES], axis=1) - floor) / stature
        if wanted.markers == "recorded":
            names, places = _recorded(body)
            places = (places - floor) / stature
        else:
            pose, names = _pose_of_body(body, measures), MARKERS
            places = pose.places() + ((body.joints["pelvis"] - floor) / stature)[:, None]
    if wanted.markers == "recorded" and (not names or pose is not None):
        raise UserError(f"{path}: has no recorded markers; leave out --segment-markers recorded")
    if np.isfinite(hips).all(axis=(1, 2)).sum() < 2:
        raise UserError(f"{path}: the hips are hardly visible; leave out the file")
    sampled = resample(np.concatenate([places, hips], axis=1), read.fps, wanted.fps)
    places, left, right = sampled[:, :-2], sampled[:, -2], sampled[:, -1]
    heading = np.arctan2(right[:, 0] - left[:, 0], left[:, 1] - right[:, 1])
    others = np.zeros((0, *places.shape))
    if pose is not None and wanted.people:
        nearest = np.round(_times(len(hips), read.fps, wanted.fps)).astype(int)
        others = places + displacements(replace(pose, channels=pose.channels[nearest]), path.stem)
    return Motion(names, places, np.column_stack([(left + right)[:, :2] / 2, heading]), stature, others)


def _recorded(body: Body) -> tuple[tuple[str, ...], Floats]:
    """Return names and places (T, J, 3) of the markers of a file, metres."""
    own = {name.removeprefix(RECORDED): x for name, x in body.joints.items() if name.startswith(RECORDED)}
    return tuple(own), np.stack(list(own.values()), axis=1) if own else np.zeros((body.frames, 0, 3))


def _pose_of_body(body: Body, measures: retarget.Measures) -> BodyPose:
    """Return the pose of the default skeleton with the lengths of the body."""
    channels = np.zeros((body.frames, len(CHANNELS)))
    channels[:, : len(ANGLES)] = retarget.observed_angles(body, measures, unknown=0.0)
    channels[:, ROTATION_COLUMNS] = decompose(body.pelvis, "zyx")
    return BodyPose(retarget.generic_proportions([measures]), channels)


def _times(frames: int, fps: float, rate: float) -> Floats:
    """Return the sampling times in frames."""
    return np.arange(0, frames - 1 + 1e-9, fps / rate)


def resample(places: Floats, fps: float, rate: float) -> Floats:
    """Resample positions (T, J, 3), NaN where missing, at another rate, without motion too fast for it.

    Applies a Butterworth filter forward and backward, then a cubic spline.  Gaps are bridged for filter and
    spline, but remain gaps in the result.
    """
    frames, flat, at = len(places), places.reshape(len(places), -1), _times(len(places), fps, rate)
    result = np.full((len(at), flat.shape[1]), np.nan)
    visible = np.isfinite(flat)
    columns = np.flatnonzero(visible.sum(axis=0) > 1)
    time = np.arange(frames, dtype=float)
    if len(columns):
        signals = [np.interp(time, time[visible[:, k]], flat[visible[:, k], k]) for k in columns]
        filled = np.stack(signals, axis=1)
        if PASS * rate < 0.5 * fps:
            low = butter(ORDER // 2, 2 * PASS * rate / fps, output="sos")
            filled = sosfiltfilt(low, filled, axis=0, padlen=min(frames - 1, round(2 * fps / rate)))
        near = np.clip(np.stack([np.floor(at), np.ceil(at)]).astype(int), 0, frames - 1)
        known = visible[near].all(axis=0)[:, columns]
        result[:, columns] = np.where(known, CubicSpline(time, filled)(at), np.nan)
    return result.reshape(len(at), *places.shape[1:])


def _pose_of_angles(table: AngleTable) -> BodyPose:
    """Return the pose of a person who faces +x; joints without angles are at rest, or missing in arms."""
    channels = np.zeros((table.frames, len(CHANNELS)))
    channels[:, : len(ANGLES)] = _at_rest(table.angles)
    if table.root is not None:
        names = [name for name in ROOTS if name.endswith(("roll", "pitch", "yaw"))]
        columns = [ROOTS.index(name) for name in names]
        channels[:, [CHANNELS.index(name) for name in names]] = np.nan_to_num(table.root[:, columns])
    return BodyPose(Proportions(), channels)


def _at_rest(angles: Floats) -> Floats:
    """Set angles (T, A) that are never known to 0, except of arm joints without any known angle."""
    result = angles.copy()
    joints = [name.rsplit("_", 1)[0] for name in ANGLES]
    visible = [bool(column.any()) for column in np.isfinite(angles).T]
    known = {joint for joint, there in zip(joints, visible, strict=True) if there}
    for k, joint in enumerate(joints):
        if not visible[k] and (joint in known or joint not in ARMS):
            result[:, k] = 0.0
    return result


def standing(place: Floats, body: Proportions) -> Floats:
    """Return the path (T, 3) of the pelvis that keeps the lowest of toes and heels fixed on the floor.

    `place` (T, J, 3) are markers about the pelvis, statures.
    """
    over = {"toe": body.sole + body.toe[2], "heel": body.sole + body.heel[2]}
    feet = place[:, [MARKERS.index(f"{s}_{part}") for part in over for s in SIDES]]
    height = feet[..., 2] - np.repeat(list(over.values()), len(SIDES))
    visible = np.isfinite(height).all(axis=1)
    lowest = np.argmin(np.where(visible[:, None], height, 0.0), axis=1)
    rows = np.arange(len(place))
    step = feet[rows[:-1], lowest[:-1], :2] - feet[rows[1:], lowest[:-1], :2]
    way = np.concatenate([np.zeros((1, 2)), np.cumsum(np.nan_to_num(step), axis=0)])
    return np.column_stack([way, np.where(visible, -height[rows, lowest], np.nan)])


def displacements(pose: BodyPose, name: str) -> Floats:
    """Return displacements (2 PAIRS, T, J, 3), statures, of other people's markers from a person's.

    `name`: of the recording, which determines the people.
    """
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    skeleton = marked_skeleton(pose.proportions)
    groups = (*GROUPS, "head")
    member = np.array([[frame.endswith(group) for frame in skeleton.frames] for group in groups], float)
    posture = np.radians(
        [next(v for part, v in WALKING_POSTURE_SD_DEG.items() if part in angle) for angle in ANGLES]
    )
    sections, own = skeleton.sections(), pose.places()
    found = []
    for _ in range(PAIRS):
        turns, lengths = rng.normal(size=len(ANGLES)) * posture, rng.normal(size=len(groups)) * LENGTH
        table = np.append(lengths @ member, 0.0)[None]
        for sign in (1.0, -1.0):
            channels = pose.channels + np.pad(sign * turns, (0, len(CHANNELS) - len(ANGLES)))
            other = points({**sections, "PROP": table}, channels, [sign])
            found.append(other - own - _sunk(other, own))
    return np.array(found)


def _sunk(other: Floats, own: Floats) -> Floats:
    """Return the vector (3,) by which another's lowest foot is higher than this person's on average."""
    lowest = [places[:, FOOT_COLUMNS, 2].min(axis=1) for places in (other, own)]
    difference = lowest[0] - lowest[1]
    visible = difference[np.isfinite(difference)]
    return np.array([0.0, 0.0, visible.mean() if len(visible) else 0.0])
