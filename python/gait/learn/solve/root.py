"""Motion of the pelvis over the ground: level floor, heading, and the six root channels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import SIDES, Proportions, axis_rotation
from gait.learn.rotations import decompose_zyx, frame_from, unit, unwrap
from gait.learn.solve.body import Body
from gait.learn.solve.retarget import BALL, Measures, median, stance

Floats = npt.NDArray[np.float64]

HARMONICS = 4  # of the pelvis's path within a stride
STANDING = 0.2  # mean speed, m/s, below which the pelvis and not the path gives the heading
LOW = 0.15  # share of the frames in which a foot is lowest: it is on the ground then
BELT = 0.4  # m/s, speed of the ground under a person who stays in place that makes a treadmill
STEADY = 0.35  # share of the belt's speed that half of the feet's velocities may differ from it


def overground(body: Body) -> Body:
    """Let somebody on a treadmill, or of an animation in place, move over the ground.

    The velocity of the feet while they are lowest is the belt's; the body then moves against it.  Bodies that
    travel, and feet that do not slide steadily, are left as they are.
    """
    path = body.joints["pelvis"]
    seen = np.flatnonzero(np.isfinite(path[:, 0]))
    if (
        len(seen) < 3
        or np.linalg.norm(path[seen[-1], :2] - path[seen[0], :2]) / len(seen) * body.fps > STANDING
    ):
        return body
    sliding = [np.zeros((0, 2))]
    for s in SIDES:
        foot = body.joints[f"{s}_ankle"]
        velocity = np.gradient(foot[:, :2], axis=0) * body.fps
        known = np.isfinite(velocity).all(axis=1)
        if known.any():
            sliding.append(velocity[known & (foot[:, 2] <= np.quantile(foot[known, 2], LOW))])
    slides = np.concatenate(sliding)
    belt = np.median(slides, axis=0) if len(slides) else np.zeros(2)
    speed = float(np.linalg.norm(belt))
    if speed < BELT or np.median(np.linalg.norm(slides - belt, axis=1)) > STEADY * speed:
        return body
    shift = np.zeros((body.frames, 3))
    shift[:, :2] = -belt * np.arange(body.frames)[:, None] / body.fps
    return replace(body, joints={name: place + shift for name, place in body.joints.items()})


def level(body: Body) -> tuple[Body, float]:
    """Turn a sequence so that the floor under the feet is level along the path.

    Returns the turned body and the slope removed, radians.  Captures may have a sloping floor; it is the line
    through the balls of the feet in stance.
    """
    path = body.joints["pelvis"]
    seen = np.flatnonzero(np.isfinite(path[:, 0]))
    travel = path[seen[-1], :2] - path[seen[0], :2] if len(seen) else np.zeros(2)
    contacts = np.concatenate([body.joints[f"{s}_toe"][stance(body, s)] for s in SIDES])
    contacts = contacts[np.isfinite(contacts).all(axis=1)]
    if np.linalg.norm(travel) < 1.0 or len(contacts) < 3:
        return body, 0.0
    way: Floats = travel / np.linalg.norm(travel)
    design = np.stack([np.ones(len(contacts)), contacts[:, :2] @ way], axis=1)
    slope = float(np.arctan(_robust_line(design, contacts[:, 2])[1]))
    turn = _about(np.array([-way[1], way[0], 0.0]), slope)
    joints = {name: points @ turn.T for name, points in body.joints.items()}
    lateral = {name: axes @ turn.T for name, axes in body.lateral.items()}
    return replace(body, joints=joints, pelvis=turn @ body.pelvis, lateral=lateral), slope


def align_pelvis(body: Body) -> Body:
    """Give the pelvis axes a meaning that does not depend on where markers sat.

    The left axis becomes the line between the hips, and the forward axis is level on average: a file's pelvis
    may be pitched by a constant that only its skeleton's calibration knows.
    """
    if not np.isfinite(body.pelvis).any():
        return body
    line = unit(
        np.nanmean(np.einsum("tji,tj->ti", body.pelvis, body.joints["l_hip"] - body.joints["r_hip"]), axis=0)
    )
    turned = body.pelvis @ frame_from(np.array([0.0, 0, 1]), line, exact="y")
    pitch = np.nanmean(np.arcsin(np.clip(-turned[:, 2, 0], -1, 1)))
    return replace(body, pelvis=turned @ axis_rotation(1, -pitch))


def _robust_line(design: Floats, values: Floats) -> Floats:
    """Least-squares line, twice refitted without the points farther than twice the median error."""
    keep = np.ones(len(values), bool)
    line: Floats = np.zeros(2)
    for _ in range(3):
        line = np.asarray(np.linalg.lstsq(design[keep], values[keep], rcond=None)[0], float)
        error = np.abs(values - design @ line)
        keep = error <= max(2 * float(np.median(error)), 1e-4)
    return line


def _about(axis: Floats, angle: float) -> Floats:
    """Rotation (3, 3) about a horizontal unit axis."""
    base = axis_rotation(2, float(np.arctan2(axis[1], axis[0])))
    return np.asarray(base @ axis_rotation(0, angle) @ base.T)


def channels(body: Body, measures: Measures, period: float) -> tuple[Floats, Floats]:
    """Root channels of a level sequence.

    Parameters
    ----------
    period : float
        Frames per stride.

    Returns
    -------
    channels : (T, 6)
        root_forward ... root_yaw: statures per stride, statures, statures, radians; NaN where the pelvis is
        not seen.
    heading : (T,)
        Direction of travel, radians; before the pelvis is first seen and after the last time, as then.  NaN
        if it is not seen.
    """
    path, frames = body.joints["pelvis"], body.frames
    seen = np.isfinite(path[:, 0])
    if seen.sum() < 3:
        return np.full((frames, 6), np.nan), np.full(frames, np.nan)
    ground = ground_height(body, measures.stature)
    smooth, velocity, fitted = _smooth_path(path[:, :2], period)
    first, last = np.flatnonzero(seen)[[0, -1]]
    speed = np.linalg.norm(smooth[last] - smooth[first]) / (last + 1 - first) * body.fps
    yaw = unwrap(np.arctan2(body.pelvis[:, 1, 0], body.pelvis[:, 0, 0])[:, None])[:, 0]
    heading = (
        np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0])) if speed > STANDING else _mean_over(yaw, period)
    )
    heading = heading[np.clip(np.arange(frames), first, last)]
    along = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    result = np.empty((frames, 6))
    forward = np.sum(np.gradient(fitted, axis=0) * along, axis=1) * period / measures.stature
    result[:, 0] = np.where(seen, forward, np.nan)
    result[:, 1] = np.sum((path[:, :2] - smooth) * across, axis=1) / measures.stature
    result[:, 2] = (path[:, 2] - ground) / measures.stature
    turns = decompose_zyx(axis_rotation(2, -heading) @ body.pelvis)
    result[:, 3:] = turns[:, ::-1]
    return result, heading


def ground_height(body: Body, stature: float) -> float:
    """Height of the ground under the feet in stance, by their balls, else by their ankles."""
    for joint, height in (("toe", BALL), ("ankle", Proportions().sole)):
        lowest = median(np.array([median(body.joints[f"{s}_{joint}"][stance(body, s), 2]) for s in SIDES]))
        if np.isfinite(lowest):
            return lowest - height * stature
    return float("nan")


def _smooth_path(path: Floats, period: float) -> tuple[Floats, Floats, Floats]:
    """Split the path (T, 2) into a slow polynomial and a motion within the stride.

    Returns the polynomial, its derivative per frame, and polynomial plus stride motion, all (T, 2).
    """
    frames = len(path)
    t = (np.arange(frames) - frames / 2) / period
    degree = 2 if frames < 4 * period else 5
    angle = 2 * np.pi * np.outer(t, np.arange(1, HARMONICS + 1))
    powers = np.vander(t, degree + 1, increasing=True)
    design = np.concatenate([powers, np.cos(angle), np.sin(angle)], axis=1)
    seen = np.isfinite(path[:, 0])
    weights, *_ = np.linalg.lstsq(design[seen], path[seen], rcond=None)
    slow = weights[: degree + 1]
    derivative = (
        np.vander(t, degree, increasing=True) @ (slow[1:] * np.arange(1, degree + 1)[:, None]) / period
    )
    return powers @ slow, derivative, design @ weights


def _mean_over(values: Floats, period: float) -> Floats:
    """Mean (T,) over one stride about each frame, shorter at the ends; NaN left out."""
    seen = np.isfinite(values)
    width = max(1, round(period))
    window = np.ones(width)
    total = np.convolve(np.where(seen, values, 0), window, "same")
    return np.asarray(total / np.maximum(np.convolve(seen, window, "same"), 1))
