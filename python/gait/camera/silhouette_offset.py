"""Time offset between two films of a walk, from the person's silhouettes.

Planes through both cameras that touch a body touch its silhouette in both pictures (epipolar tangency:
Cipolla and Giblin, Visual Motion of Curves and Surfaces, 2000).  So the angles of the two outermost planes,
usually at head and feet, are the same functions of time in both films, apart from the offset.  They are more
exact than a detector's joints, whose errors depend on the view and on the pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from gait.camera.camera import Camera
from gait.io.keypoints_file import Keypoints, neighbours
from gait.io.video import Image, Video
from gait.reproducible import one_opencv_thread

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Area = tuple[slice, slice]

_SAMPLES = 31  # frames from which the empty scene is computed
_FEWEST_SHOWN = 3  # fewest of them in which the person is elsewhere
_HIDDEN = np.int16(256)  # level, above all others, where the person may be
_HEAD = 0.25  # height of the head above the joints, as a fraction of their height in the picture
_COVERED, _SEARCHED = 0.06, 0.15  # margins around a person: of what they cover, and of the area searched
_CHANGE = 24  # grey levels; least difference from the empty scene
_CLOSED_PX = 5  # pixels; narrower gaps in a silhouette are closed
_LONGEST_S = 10.0  # seconds compared
_FEWEST = 20  # fewest frames in which a plane is known in both films
_REACH_S, _STEP_S = 0.1, 0.002  # seconds around the offset to improve, and between those compared
_OUTLIER = 3.0  # robust standard deviations
_LEAST_SD = 1e-5  # radians; least standard deviation of an angle
_SURE_S = 0.005  # seconds; largest standard deviation of an offset that is used


@dataclass(frozen=True)
class Filmed:
    """A film of a person by a camera that stands still, with the keypoints found in it."""

    video: Video
    camera: Camera
    keypoints: Keypoints


def silhouette_offset(first: Filmed, other: Filmed, about: float) -> float | None:
    """Find the offset of a film near `about`.

    Parameters
    ----------
    first, other : Filmed
        The same person in two films.
    about : float
        Start of the other film after the first, seconds, to 0.1 s.

    Returns
    -------
    offset : float or None
        Seconds, to 0.1 ms.  None if the silhouettes do not show it to 5 ms.
    """
    begin = max(first.keypoints.time[0], other.keypoints.time[0] + about)
    end = min(first.keypoints.time[-1], other.keypoints.time[-1] + about)
    begin = max(begin, (begin + end - _LONGEST_S) / 2)
    end = min(end, begin + _LONGEST_S)
    axes = _axes(first.camera, other.camera, first.keypoints)
    times, angles = _angles(first, axes, begin, end)
    other_times, other_angles = _angles(other, axes, begin - about - _REACH_S, end - about + _REACH_S)
    offsets = about + np.arange(-_REACH_S, _REACH_S + _STEP_S / 2, _STEP_S)
    costs = np.zeros(len(offsets))
    for angle, other_angle in zip(angles.T, other_angles.T, strict=True):
        costs += _costs(times, angle, other_times, other_angle, offsets)
    at = int(costs.argmin())
    if not 0 < at < len(offsets) - 1:
        return None
    before, best, after = costs[at - 1 : at + 2]
    curvature = (before - 2 * best + after) / _STEP_S**2
    if curvature * _SURE_S**2 < 1:
        return None
    return round(float(offsets[at] + (before - after) / (2 * curvature * _STEP_S)), 4)


def _axes(camera: Camera, other: Camera, keypoints: Keypoints) -> Array:
    """Return two axes (2, 3) normal to the line through the cameras, the first towards the person."""
    line = other.centre - camera.centre
    line = line / np.linalg.norm(line)
    ray = camera.rays(np.nanmedian(keypoints.uv, axis=(0, 1))[None])[0]
    towards = ray - (ray @ line) * line
    towards = towards / np.linalg.norm(towards)
    return np.stack([towards, np.cross(line, towards)])


def _angles(filmed: Filmed, axes: Array, begin: float, end: float) -> tuple[Array, Array]:
    """Return times (T,), and angles (T, 2) of the outermost planes, radians, NaN where they are unknown."""
    keypoints = filmed.keypoints
    rows = np.flatnonzero((keypoints.time >= begin) & (keypoints.time <= end))
    angles = np.full((len(rows), 2), np.nan)
    if not len(rows):
        return keypoints.time[rows], angles
    row_of = {int(keypoints.frame[row]): k for k, row in enumerate(rows)}
    plate, known = _empty_scene(filmed)
    with one_opencv_thread():
        for frame in filmed.video.frames(min(row_of), max(row_of) + 1):
            if frame.number in row_of:
                k = row_of[frame.number]
                area = _area(keypoints.uv[rows[k]], _SEARCHED, known.shape)
                angles[k] = _outermost(frame.image, plate, known, area, filmed.camera, axes)
    return keypoints.time[rows], angles


def _area(uv: Array, margin: float, shape: tuple[int, ...]) -> Area | None:
    """Return rows and columns around a person with joints at `uv` (J, 2), pixels; None if not in view."""
    uv = uv[np.isfinite(uv).all(axis=1)]
    if len(uv) == 0:
        return None
    (left, top), (right, low) = uv.min(axis=0), uv.max(axis=0)
    margin_px = margin * (low - top)
    rows, columns = (
        (top - margin_px - _HEAD * (low - top), low + margin_px),
        (left - margin_px, right + margin_px),
    )
    (y0, y1), (x0, x1) = (
        np.clip(ends, 0, size).astype(int) for ends, size in zip((rows, columns), shape, strict=True)
    )
    return (slice(y0, y1), slice(x0, x1)) if y1 > y0 and x1 > x0 else None


def _empty_scene(filmed: Filmed) -> tuple[Image, Bools]:
    """Compute the median over frames in which the person is elsewhere, BGR, and where it is known (h, w)."""
    keypoints = filmed.keypoints
    samples = (
        np.linspace(0, len(keypoints.frame) - 1, min(_SAMPLES, len(keypoints.frame))).round().astype(int)
    )
    row_of = {int(keypoints.frame[row]): row for row in samples}
    frames = list(filmed.video.pick(row_of))
    plate = np.empty_like(frames[0].image)
    shown = np.ones((len(frames), *plate.shape[:2]), bool)
    for frame, one in zip(frames, shown, strict=True):
        area = _area(keypoints.uv[row_of[frame.number]], _COVERED, one.shape)
        if area is not None:
            one[area] = False
    count = shown.sum(axis=0)
    for y in range(len(plate)):
        levels = np.stack(
            [
                np.where(one[y, :, None], frame.image[y], _HIDDEN)
                for frame, one in zip(frames, shown, strict=True)
            ]
        )
        middle = ((count[y] - 1) // 2).clip(0)
        plate[y] = np.take_along_axis(np.sort(levels, axis=0), middle[None, :, None], axis=0)[0].clip(0, 255)
    return plate, count >= _FEWEST_SHOWN


def _outermost(
    image: Image, plate: Image, known: Bools, area: Area | None, camera: Camera, axes: Array
) -> Array:
    """Return the least and the largest angle (2,) of the rays to a silhouette, radians; NaN where unknown."""
    if area is None:
        return np.full(2, np.nan)
    exposure = np.median(image[::8, ::8].astype(np.int16) - plate[::8, ::8], axis=(0, 1)).astype(np.int16)
    change = np.abs(image[area].astype(np.int16) - plate[area] - exposure).max(axis=2)
    changed = cv2.blur(change.clip(0, 255).astype(np.uint8), (3, 3)) > _CHANGE
    mask = (changed | ~known[area]).astype(np.uint8)
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((_CLOSED_PX, _CLOSED_PX), np.uint8))
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not outlines:
        return np.full(2, np.nan)
    edge = max(outlines, key=cv2.contourArea)[:, 0]
    cut = ((edge == 0) | (edge == np.array(mask.shape[::-1]) - 1)).any(axis=1)
    edge = edge + (area[1].start, area[0].start)
    rays = camera.rays(edge.astype(float)) @ axes.T
    angles = np.arctan2(rays[:, 1], rays[:, 0])
    ends = np.array([angles.argmin(), angles.argmax()])
    sure = known[edge[ends, 1], edge[ends, 0]] & ~cut[ends]
    return np.where(sure, angles[ends], np.nan)


def _costs(times: Array, angles: Array, other_times: Array, other_angles: Array, offsets: Array) -> Array:
    """Return the negative log-likelihood (n,) of offsets by one plane's angles, apart from a constant.

    A lasting difference between the films and its trend are fitted; the standard deviation is unknown.
    """
    ours, theirs = np.isfinite(angles), np.isfinite(other_angles)
    if min(ours.sum(), theirs.sum()) < _FEWEST:
        return np.zeros(len(offsets))
    times, angles, observed = times[ours], angles[ours], other_times[theirs]
    curve = CubicSpline(observed, other_angles[theirs])
    wanted = times - offsets[:, None]
    inside = (wanted >= observed[0]) & (wanted <= observed[-1])  # the curve is not extrapolated
    shared = (inside & neighbours(observed, wanted)[2]).all(axis=0)
    if shared.sum() < _FEWEST:
        return np.zeros(len(offsets))
    away = (angles - curve(wanted))[:, shared]
    away = away - np.median(away, axis=1, keepdims=True)
    trend = np.stack([np.ones(shared.sum()), times[shared] - times[shared].mean()], axis=1)
    away = np.abs(away - away @ trend @ np.linalg.inv(trend.T @ trend) @ trend.T)
    scale = 1.4826 * np.median(away) + _LEAST_SD
    square = np.minimum(away, _OUTLIER * scale) ** 2
    return np.asarray(shared.sum() / 2 * np.log(square.mean(axis=1) + _LEAST_SD**2))
