"""Make bodies from markers on the skin, by fitting the skeleton to them.

A joint, an axis or the pelvis is missing (NaN) in frames whose markers do not determine it, that is, if its
standard deviation from the fit's covariance is too large.  Nothing is interpolated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from gait.body.skeleton import JOINTS, SIDES, default_skeleton
from gait.errors import UserError
from gait.learn.arrays import Floats
from gait.learn.mocap.markers import Landmark, MarkerMap, known_landmarks, plain, segment_axes
from gait.learn.solve import skeleton_fit
from gait.learn.solve.body import MIRRORED, RECORDED, Body, level_pelvis
from gait.learn.solve.kinematics import HINGES, SEGMENTS, pose_skeleton, segment_origins, segment_scales
from gait.learn.solve.skeleton_fit import LengthInformation

FEWEST_LABELS = 6
EXTENT = 0.2, 4.0  # metres; range of the extent of a person's markers
UNKNOWN_JOINT_SD = 0.03  # metres; standard deviation from which a joint is unknown
AXIS_SD = np.radians(15)  # standard deviation from which a direction is unknown
WORST_RMS = 0.05  # metres; with a larger rms, markers are not where their labels place them
USUAL_RMS = 0.01  # metres; those of right-handed recordings are smaller
MIRROR_RMS_SHARE = 0.6  # if a mirror image has less than this share of the rms, the axes are left-handed
UNKNOWN = 1e6  # variance, square metres or radians, of what a frame does not show
FRAMES_AT_ONCE = 512  # frames processed at once
#: Further remedy for unknown labels.
STATIC_REMEDY = ", or give the trial in which knees and ankles were marked as --static"
LEG_JOINTS = [f"{s}_{joint}" for s in SIDES for joint in ("hip", "knee", "ankle")]


def from_markers(
    path: Path,
    labels: list[str],
    points: Floats,
    fps: float,
    marker_map: MarkerMap | None = None,
    log_scales: Floats | None = None,
) -> Body:
    """Fit the skeleton to markers (T, M, 3): metres, any axis up, NaN where missing.

    Without a marker map the labels of known sets are used.  `log_scales` (S,): the person's, if known from
    several recordings; by default they are fitted.  UserError if too few labels are known, or the markers do
    not fit a body.
    """
    points = np.where(np.isfinite(points).all(axis=2, keepdims=True), points, np.nan)
    columns, places = _placed(path, labels, points, marker_map)
    fit = skeleton_fit.fit(points[:, columns], places, log_scales)
    rms = skeleton_fit.usual_rms(fit.residual)
    _require_right_handed(path, points[:, columns], places, rms)
    if not rms < WORST_RMS:
        worst = labels[columns[int(np.nanargmax(np.nanmedian(fit.residual, axis=0)))]]
        raise UserError(
            f"{path}: the markers do not fit a body (rms {1000 * rms:.0f} mm, worst {worst!r})"
            "; check labels and units, or give a --markers file"
        )
    own = {labels[k].rsplit(":", 1)[-1]: points[:, k] for k in columns}
    body = from_fit(path.stem, fps, _without_bad_frames(fit), own)
    unknown = [name for name in LEG_JOINTS if not np.isfinite(body.joints[name]).any()]
    if unknown:
        raise UserError(
            f"{path}: the known markers do not determine {unknown[0]!r}; name more in a --markers "
            f"file{STATIC_REMEDY}"
        )
    return body


def _without_bad_frames(fit: skeleton_fit.Fit) -> skeleton_fit.Fit:
    """Return the fit without the frames in which half of the markers are far from the body.

    In these everything is unknown.  There are few of them; most have few markers, or another person's.
    """
    shown = np.flatnonzero(np.isfinite(fit.residual).any(axis=1))
    bad = shown[np.nanmedian(fit.residual[shown], axis=1) > WORST_RMS]
    covariance, residual = fit.covariance.copy(), fit.residual.copy()
    covariance[bad], residual[bad] = UNKNOWN * np.eye(covariance.shape[1]), np.nan
    return replace(fit, covariance=covariance, residual=residual)


def _require_right_handed(path: Path, observed: Floats, places: skeleton_fit.Points, rms: float) -> None:
    """Raise UserError for markers (T, K, 3) whose mirror image fits far better than `rms`, metres."""
    if rms < USUAL_RMS:
        return
    _, mirrored = skeleton_fit.length_information(observed * [1.0, 1.0, -1.0], places)
    if mirrored < MIRROR_RMS_SHARE * rms:
        raise UserError(f"{path}: {MIRRORED}")


def length_information(
    path: Path, labels: list[str], points: Floats, marker_map: MarkerMap | None = None
) -> LengthInformation | None:
    """Return what markers show of the person's length scales; None if they do not fit a body.

    Parameters and errors are those of `from_markers`.
    """
    columns, places = _placed(path, labels, points, marker_map)
    found, rms = skeleton_fit.length_information(points[:, columns], places)
    return found if rms < WORST_RMS else None


def _placed(
    path: Path, labels: list[str], points: Floats, marker_map: MarkerMap | None
) -> tuple[list[int], skeleton_fit.Points]:
    """Return columns and positions of the known markers; UserError if no frame can be fitted."""
    places = assign(path, labels, points, marker_map)
    columns, at = as_points(places)
    if not skeleton_fit.has_enough(points[:, columns]):
        raise UserError(f"{path}: fewer than three known markers in every frame; see --markers")
    _require_size(path, points[:, columns])
    for side, word in zip(SIDES, ("left", "right"), strict=True):
        if not {f"{side}_thigh", f"{side}_shank"} & {mark.segment for mark in places.values()}:
            raise UserError(
                f"{path}: no known marker is on the {word} thigh or shank; name those that are in a "
                f"--markers file{STATIC_REMEDY}"
            )
    return columns, at


def _require_size(path: Path, observed: Floats) -> None:
    """Raise UserError for markers (T, K, 3) whose extent is impossible for a person."""
    shown = observed[np.isfinite(observed).all(axis=2).sum(axis=1) >= 2]
    extent = float(np.median(np.nanmax(np.nanmax(shown, axis=1) - np.nanmin(shown, axis=1), axis=1)))
    if not EXTENT[0] < extent < EXTENT[1]:
        raise UserError(f"{path}: the known markers lie within {extent:.3g} m: correct the unit of the file")


def as_points(places: Mapping[int, Landmark]) -> tuple[list[int], skeleton_fit.Points]:
    """Return the columns of markers, and their positions as `Points` for the fit."""
    marks = list(places.values())
    return list(places), skeleton_fit.Points(
        segment=np.array([SEGMENTS.index(mark.segment) for mark in marks], np.intp),
        at=np.array([mark.at for mark in marks]),
        sd=np.array([mark.sd for mark in marks]),
    )


def assign(
    path: Path, labels: list[str], points: Floats, marker_map: MarkerMap | None
) -> dict[int, Landmark]:
    """Return the landmark of each column whose marker is known and sometimes visible.

    In a file with several subjects ("Anna:LASI") the one with most known markers is used.
    """
    axes = segment_axes(labels, points)
    ever = np.asarray(np.isfinite(points).all(axis=2).any(axis=0))
    visible = [k for k in range(len(labels)) if ever[k] and k not in axes]
    best: dict[int, Landmark] = {}
    for subject in sorted({_subject(labels[k]) for k in visible}):
        own = [k for k in visible if _subject(labels[k]) == subject]
        known = marker_map.landmarks if marker_map else known_landmarks([labels[k] for k in own])
        columns = {plain(labels[k]): k for k in reversed(own)}
        places = {columns[label]: known[label] for label in columns if label in known}
        best = max(best, places, key=len)
    if len(best) < FEWEST_LABELS:
        examples = ", ".join(labels[k] for k in visible[:5])
        if len(best) == len(visible):
            raise UserError(
                f"{path}: {len(best)} markers ({examples}) do not show a body: {FEWEST_LABELS} are needed, "
                "and on each leg some on thigh or shank; record more"
            )
        remedy = (
            'name more in it, or its "set"' if marker_map else f"name them in a --markers file{STATIC_REMEDY}"
        )
        where = f" with {marker_map.path}" if marker_map else ""
        raise UserError(
            f"{path}: {len(best)} of {len(visible)} marker labels are known{where} ({examples} ...); {remedy}"
        )
    return dict(sorted(best.items()))


def _subject(label: str) -> str:
    return label.rsplit(":", 1)[0] if ":" in label else ""


def from_fit(
    name: str, fps: float, fit: skeleton_fit.Fit, markers: Mapping[str, Floats] | None = None
) -> Body:
    """Return the body of a fitted skeleton, with markers (T, 3) by label, z up, uncertain parts missing."""
    positions, axes = _certain(fit)
    joints = {joint: positions[:, k] for k, joint in enumerate(JOINTS)}
    joints["head"] = joints.pop("head_top")
    joints |= {RECORDED + label: places for label, places in (markers or {}).items()}
    rotation_sd = np.sqrt(np.trace(fit.covariance[:, 3:6, 3:6], axis1=1, axis2=2))
    known = rotation_sd < AXIS_SD
    legs = joints["l_hip"] + joints["r_hip"] - joints["l_ankle"] - joints["r_ankle"]
    up = _z_up(fit.pose.rotation[known, :, 2] if known.any() else legs[np.isfinite(legs[:, 0])])
    joints = {joint: place @ up.T for joint, place in joints.items()}
    pelvis = np.where(known[:, None, None], up @ fit.pose.rotation, np.nan)
    return Body(
        name,
        fps,
        joints,
        pelvis if known.any() else level_pelvis(joints["l_hip"] - joints["r_hip"]),
        {hinge: axes[:, k] @ up.T for k, hinge in enumerate(HINGES)},
        residual=float(np.sqrt(np.nanmean(fit.residual**2))),
    )


def _certain(fit: skeleton_fit.Fit) -> tuple[Floats, Floats]:
    """Return joints (T, P, 3) and axes of `HINGES` (T, 5, 3), NaN where their sd is too large."""
    skeleton, origins = default_skeleton(), segment_origins(fit.log_scales)
    segment = np.array(skeleton.point_frames, np.intp)
    local = segment_scales(fit.log_scales)[segment] * skeleton.point_positions
    hinged = np.array([SEGMENTS.index(part) for part in HINGES.values()])
    points, axes = [], []
    for first in range(0, len(fit.pose), FRAMES_AT_ONCE):
        chunk = slice(first, first + FRAMES_AT_ONCE)
        posed, covariance = pose_skeleton(fit.pose[chunk], origins), fit.covariance[chunk]
        place, left = posed.points(local, segment), posed.rotations[:, hinged][..., 1]
        unsure = _sd(posed.by_pose(place, segment), covariance) > UNKNOWN_JOINT_SD
        points.append(np.where(unsure[..., None], np.nan, place))
        unsure = _sd(posed.directions_by_pose(left, hinged), covariance) > AXIS_SD
        axes.append(np.where(unsure[..., None], np.nan, left))
    return np.concatenate(points), np.concatenate(axes)


def _sd(slopes: Floats, covariance: Floats) -> Floats:
    """Return the standard deviations (T, P) of vectors with derivatives (T, P, 3, 30)."""
    frames, count = slopes.shape[:2]
    rows = slopes.reshape(frames, 3 * count, -1)
    return np.sqrt(((rows @ covariance) * rows).sum(axis=2).reshape(frames, count, 3).sum(axis=2))


def _z_up(axes: Floats) -> Floats:
    """Return the rotation to z up; up is the file's axis nearest to the body's own, (T, 3)."""
    up = axes.mean(axis=0) if len(axes) else np.array([0.0, 0, 1])
    k = int(np.argmax(np.abs(up)))
    z = np.eye(3)[k] * np.sign(up[k])
    x = np.eye(3)[(k + 1) % 3]
    return np.stack([x, np.cross(z, x), z])
