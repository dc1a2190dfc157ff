"""Static trials: a standing person with markers that the motion recordings lack.

Laboratories mark knees and ankles while a person stands, then remove those markers and record clusters of
others. The skeleton fitted to the static trial gives the person's lengths and the positions of all its
markers, including those with unknown labels; both are used to fit the recordings.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gait.body.skeleton import JOINTS, default_skeleton
from gait.errors import UserError
from gait.learn.arrays import Floats
from gait.learn.mocap import points
from gait.learn.mocap.markers import Landmark, MarkerMap, plain, segment_axes
from gait.learn.options import LearnOptions
from gait.learn.solve import markers, skeleton_fit
from gait.learn.solve.kinematics import SEGMENTS, pose_skeleton, segment_origins, segment_scales

STATIC_FRAMES = 60  # frames of the trial that are fitted, as all of a still person are alike
SD = 0.004  # statures by which skin moves from its position while standing
LEAST_DISTANCE_RATIO = 1.25  # least ratio of the distances to the second nearest and the nearest bone
FARTHEST_MARKER = 0.12  # statures from a bone; markers further away are on clothes, wands or the floor
#: Bones that determine the segment of markers with unknown labels: the joints at their ends.
SEGMENT_BONES = {"pelvis": ("l_hip", "r_hip"), "torso": ("pelvis", "neck"), "head": ("neck", "head_top")} | {
    f"{s}_{segment}": (f"{s}_{a}", f"{s}_{b}")
    for s in "lr"
    for segment, a, b in (
        ("thigh", "hip", "knee"),
        ("shank", "knee", "ankle"),
        ("foot", "heel", "toe"),
        ("upper_arm", "shoulder", "elbow"),
        ("forearm", "elbow", "wrist"),
    )
}


@dataclass(frozen=True)
class Calibration:
    """Result of a static trial."""

    markers: MarkerMap  #: positions of the markers on the skeleton
    log_scales: Floats  #: (S,) of the skeleton


def calibrate(path: Path, options: LearnOptions) -> Calibration:
    """Fit the skeleton to a static trial; UserError if its known markers do not determine the legs."""
    if path.suffix.lower() not in points.SUFFIXES:
        raise UserError(f"--static {path}: is not {' or '.join(points.SUFFIXES)}; give the trial's markers")
    labels, places, fps = points.read(path, options.fps)
    rows = np.unique(np.linspace(0, len(places) - 1, STATIC_FRAMES).round().astype(int))
    places = places[rows]
    try:
        markers.from_markers(path, labels, places, fps, options.markers)  # for its checks
    except UserError as error:
        words = "a static trial needs known markers at hips, knees and ankles"
        raise UserError(f"--static {error}; {words}") from None
    known = markers.assign(path, labels, places, options.markers)
    columns, at = markers.as_points(known)
    fit = skeleton_fit.fit(places[:, columns], at)
    scales = segment_scales(fit.log_scales)
    local = dict(zip(columns, fit.local, strict=True))
    found = {plain(labels[k]): Landmark(m.segment, _tuple(local[k], scales, m), SD) for k, m in known.items()}
    axes = segment_axes(labels, places)
    for k, label in enumerate(labels):
        if k not in known and k not in axes and plain(label) not in found:
            mark = _on_nearest_bone(places[:, k], fit)
            if mark is not None:
                found[plain(label)] = mark
    return Calibration(MarkerMap(path, found, ()), fit.log_scales)


def _tuple(local: Floats, scales: Floats, mark: Landmark) -> tuple[float, float, float]:
    """Convert a position in the axes of a segment from metres to statures."""
    x, y, z = (local / scales[SEGMENTS.index(mark.segment)]).tolist()
    return x, y, z


def _on_nearest_bone(place: Floats, fit: skeleton_fit.Fit) -> Landmark | None:
    """Return the position of a marker (T, 3) with unknown label; None if between bones or far from all."""
    visible = np.isfinite(place).all(axis=1)
    if not visible.any():
        return None
    skeleton, scales = default_skeleton(), segment_scales(fit.log_scales)
    segment = np.array(skeleton.point_frames, np.intp)
    posed = pose_skeleton(fit.pose[np.flatnonzero(visible)], segment_origins(fit.log_scales))
    joints = posed.points(scales[segment] * skeleton.point_positions, segment)
    away = {
        name: float(np.median(_distance(place[visible], *(joints[:, JOINTS.index(end)] for end in ends))))
        for name, ends in SEGMENT_BONES.items()
    }
    (nearest, near), (_, next_one) = sorted(away.items(), key=lambda item: item[1])[:2]
    if near > FARTHEST_MARKER * np.exp(fit.log_scales[0]) or next_one < LEAST_DISTANCE_RATIO * near:
        return None
    k = SEGMENTS.index(nearest)
    local = np.einsum("tji,tj->ti", posed.rotations[:, k], place[visible] - posed.origins[:, k])
    mark = Landmark(nearest, (0.0, 0.0, 0.0), SD)
    return mark._replace(at=_tuple(np.median(local, axis=0), scales, mark))


def _distance(place: Floats, start: Floats, end: Floats) -> Floats:
    """Return the distance (T,) of points (T, 3) from the lines between two others."""
    along = end - start
    share = np.einsum("ti,ti->t", place - start, along) / np.einsum("ti,ti->t", along, along)
    return np.linalg.norm(place - start - np.clip(share, 0, 1)[:, None] * along, axis=1)


def serving(
    paths: Sequence[Path], persons: Sequence[str], statics: Sequence[Path], owners: Sequence[str]
) -> list[Path | None]:
    """Return the static trial for each recording, or None: of its person, or else in its folder.

    Of several, it is the one whose name has the longest common beginning.  `persons`, `owners`: people of
    recordings and trials.  UserError if a trial is not used.
    """
    result: list[Path | None] = []
    for path, person in zip(paths, persons, strict=True):
        own = [trial for trial, owner in zip(statics, owners, strict=True) if owner == person]
        beside = [trial for trial in statics if os.path.abspath(trial.parent) == os.path.abspath(path.parent)]
        if not own and person not in owners:
            own = beside
        alike = [len(os.path.commonprefix([path.stem.lower(), trial.stem.lower()])) for trial in own]
        marked = path.suffix.lower() in points.SUFFIXES
        result.append(own[int(np.argmax(alike))] if own and marked else None)
    unused = next((trial for trial in statics if trial not in result), None)
    if unused is not None:
        raise UserError(
            f"--static {unused}: there is no recording of markers of its person; name it like the recordings "
            "up to '_', or put it into their folder"
        )
    return result
