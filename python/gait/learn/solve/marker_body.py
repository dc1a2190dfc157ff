"""Bodies from markers on the skin: the skeleton fitted to them stands for the person.

What the markers of a frame do not determine is missing there: a joint, an axis or the pelvis whose standard
deviation by the fit's covariance is too large is NaN.  Nothing is interpolated.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import JOINTS, SIDES, default_skeleton
from gait.errors import UserError
from gait.learn.mocap import marker_map, marker_sets
from gait.learn.mocap.marker_sets import LANDMARKS, Landmark, plain
from gait.learn.solve import articulated, skeleton_fit
from gait.learn.solve.articulated import HINGES, SEGMENTS
from gait.learn.solve.body import RECORDED, Body
from gait.learn.solve.stretch_information import Information

Floats = npt.NDArray[np.float64]

FEWEST_LABELS = 6
JOINT_SD = 0.03  # metres beyond which a joint is not known
AXIS_SD = np.radians(15)  # beyond which a direction is not known
WORST_RMS = 0.05  # metres: markers in other places than their labels say
CHUNK = 512  # frames worked on at once
LEGS = [f"{s}_{joint}" for s in SIDES for joint in ("hip", "knee", "ankle")]


def body(
    path: Path,
    labels: list[str],
    points: Floats,
    fps: float,
    markers: Path | None = None,
    stretch: Floats | None = None,
) -> Body:
    """Fit the skeleton to markers.

    Parameters
    ----------
    path : Path
        The file they come from.
    points : (T, M, 3)
        Metres, any axis up; NaN where missing.
    fps : float
        Frames per second.
    markers : Path, optional
        Mapping file; by default the labels of known sets.
    stretch : (S,), optional
        The person's stretches, if other recordings tell them too; by default those of this one.

    Raises
    ------
    UserError
        If too few labels are known, or the markers do not fit a walker.
    """
    points = np.where(np.isfinite(points).all(axis=2, keepdims=True), points, np.nan)
    columns, places = _placed(path, labels, points, markers)
    fit = skeleton_fit.fit(points[:, columns], places, stretch)
    own = {labels[k].rsplit(":", 1)[-1]: points[:, k] for k in columns}
    walker = from_fit(path.stem, fps, fit, own)
    if not walker.residual or not walker.residual < WORST_RMS:
        worst = labels[columns[int(np.nanargmax(np.nanmedian(fit.residual, axis=0)))]]
        rms = 1000 * (walker.residual or 0)
        raise UserError(
            f"{path}: the markers do not fit a body (rms {rms:.0f} mm, worst {worst!r})"
            "; check labels and units, or give a --markers file"
        )
    unknown = [name for name in LEGS if not np.isfinite(walker.joints[name]).any()]
    if unknown:
        raise UserError(
            f"{path}: the known markers do not determine {unknown[0]!r}; name more in a --markers file"
        )
    return walker


def information(
    path: Path, labels: list[str], points: Floats, markers: Path | None = None
) -> Information | None:
    """Find what markers tell of the person's stretches; None if they do not fit a body.

    Parameters and errors are those of `body`.
    """
    columns, places = _placed(path, labels, points, markers)
    found, rms = skeleton_fit.information(points[:, columns], places)
    return found if rms < WORST_RMS else None


def _placed(
    path: Path, labels: list[str], points: Floats, markers: Path | None
) -> tuple[list[int], skeleton_fit.Points]:
    """Columns of the known markers and their places on the skeleton; there are frames that can be fitted."""
    places = assign(path, labels, points, markers)
    columns = list(places)
    if not skeleton_fit.enough(points[:, columns]):
        raise UserError(f"{path}: fewer than three known markers in every frame; see --markers")
    return columns, skeleton_fit.Points(
        segment=np.array([SEGMENTS.index(places[k].segment) for k in columns], np.intp),
        at=np.array([places[k].at for k in columns]),
        sd=np.array([places[k].sd for k in columns]),
    )


def assign(path: Path, labels: list[str], points: Floats, markers: Path | None) -> dict[int, Landmark]:
    """Give the places of the markers that are known and ever seen: column to place.

    In a file of several subjects ("Anna:LASI") the one with most of them is taken.
    """
    seen = [k for k in range(len(labels)) if np.isfinite(points[:, k]).all(axis=1).any()]
    table = marker_map.read(markers) if markers else None
    best: dict[int, Landmark] = {}
    for subject in sorted({_subject(labels[k]) for k in seen}):
        own = [k for k in seen if _subject(labels[k]) == subject]
        known = table
        if known is None:
            _, names = marker_sets.find([labels[k] for k in own])
            known = {plain(label): LANDMARKS[name] for label, name in names.items()}
        columns = {plain(labels[k]): k for k in reversed(own)}
        places = {columns[label]: known[label] for label in columns if label in known}
        best = max(best, places, key=len)
    if len(best) < FEWEST_LABELS:
        examples = ", ".join(labels[k] for k in seen[:5])
        remedy = 'name more in it, or its "set"' if markers else "name them in a --markers file"
        where = f" with {markers}" if markers else ""
        raise UserError(
            f"{path}: {len(best)} of {len(seen)} marker labels are known{where} ({examples} ...); {remedy}"
        )
    return dict(sorted(best.items()))


def _subject(label: str) -> str:
    return label.rsplit(":", 1)[0] if ":" in label else ""


def from_fit(
    name: str, fps: float, fit: skeleton_fit.Fit, markers: Mapping[str, Floats] | None = None
) -> Body:
    """Body of a fitted skeleton and the markers (T, 3) by label, turned to z up, without what is unsure."""
    positions, axes = _known(fit)
    joints = {joint: positions[:, k] for k, joint in enumerate(JOINTS)}
    joints["head"] = joints.pop("head_top")
    joints |= {RECORDED + label: places for label, places in (markers or {}).items()}
    turn_sd = np.sqrt(np.trace(fit.covariance[:, 3:6, 3:6], axis1=1, axis2=2))
    pelvis = np.where((turn_sd < AXIS_SD)[:, None, None], fit.pose.turn, np.nan)
    up = _upright(fit.pose.turn[np.isfinite(pelvis[:, 0, 0])])
    rms = float(np.sqrt(np.nanmean(fit.residual**2)))
    return Body(
        name,
        fps,
        {joint: place @ up.T for joint, place in joints.items()},
        up @ pelvis,
        {hinge: axes[:, k] @ up.T for k, hinge in enumerate(HINGES)},
        residual=rms,
    )


def _known(fit: skeleton_fit.Fit) -> tuple[Floats, Floats]:
    """Joints (T, P, 3) and axes of `HINGES` (T, 5, 3), NaN where their standard deviation is too large."""
    skeleton, offsets = default_skeleton(), articulated.origins(fit.stretch)
    segment = np.array(skeleton.point_frames, np.intp)
    local = articulated.scales(fit.stretch)[segment] * skeleton.point_positions
    hinged = np.array([SEGMENTS.index(part) for part in HINGES.values()])
    points, axes = [], []
    for first in range(0, len(fit.pose), CHUNK):
        chunk = slice(first, first + CHUNK)
        posed, covariance = articulated.posed(fit.pose[chunk], offsets), fit.covariance[chunk]
        place, left = posed.points(local, segment), posed.turns[:, hinged][..., 1]
        unsure = _sd(posed.by_pose(place, segment), covariance) > JOINT_SD
        points.append(np.where(unsure[..., None], np.nan, place))
        unsure = _sd(posed.directions_by_pose(left, hinged), covariance) > AXIS_SD
        axes.append(np.where(unsure[..., None], np.nan, left))
    return np.concatenate(points), np.concatenate(axes)


def _sd(slopes: Floats, covariance: Floats) -> Floats:
    """Give the standard deviations (T, P) of vectors with derivatives (T, P, 3, 30)."""
    frames, count = slopes.shape[:2]
    rows = slopes.reshape(frames, 3 * count, -1)
    return np.sqrt(((rows @ covariance) * rows).sum(axis=2).reshape(frames, count, 3).sum(axis=2))


def _upright(turns: Floats) -> Floats:
    """Rotation to z up: up is the file's axis that is nearest to the pelvis's."""
    up = turns[:, :, 2].mean(axis=0) if len(turns) else np.array([0.0, 0, 1])
    k = int(np.argmax(np.abs(up)))
    z = np.eye(3)[k] * np.sign(up[k])
    x = np.eye(3)[(k + 1) % 3]
    return np.stack([x, np.cross(z, x), z])
