"""Convert bodies to channels of the default skeleton: lengths, the 24 angles, and pelvis (root) motion.

In the frame of a limb, z points from its end to its start and y along its hinge; angles are exact
decompositions of the frames of neighbours (libgait/doc/model-format.md), continuous in time.  Root motion
needs a level floor and a heading.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from gait.body.skeleton import ANGLES, SIDES, Proportions, axis_rotation
from gait.learn.arrays import Floats, Indices
from gait.learn.rotations import decompose, frame_from, unit, unwrap
from gait.learn.solve.body import Body

#: Neck to top of the head, statures, as the head's bone ends at different heights in files.
HEAD_LENGTH = 0.141
#: Anatomical trunk and upper arms, statures.  In recordings the clavicle ends near the acromion and the spine
#: near the back; here the shoulder's centre is lower, the neck further forward, and the elbow nearer.
ANATOMICAL: dict[str, Any] = {
    "shoulder": (0.043, 0.1085, 0.2595),
    "neck": 0.3205,
    "neck_ahead": 0.048,
    "head": (0.027, 0.0, 0.130),
    "upper_arm": 0.161,
}
#: A straight limb has a smaller sine of the bend in this share of the frames; elbows that bend in recorded
#: walks reach at least 20 degrees.
STRAIGHT_KNEE_SINE, MOSTLY = np.sin(np.radians(15)), 0.9
BALL = 0.0235  # height of the ball of the foot in stance, statures
#: Heights of the parts of a standing body that may be unknown, statures.
UNKNOWN_HEIGHTS = {"rise": Proportions().sole - BALL, "neck": Proportions().neck}
PELVIS_HARMONICS = 4  # of the pelvis's path within a stride
STANDING = 0.2  # m/s; mean speed below which the heading is from the pelvis instead of the path
BELT = 0.4  # m/s; least speed of a treadmill's belt
BELT_VELOCITY_RANGE = 0.4  # range of the velocities of feet that stand on a belt, over its speed
FEWEST_FOOT_VELOCITIES = 20  # fewest velocities of feet that show a belt
STANCE_SHARE = 0.15  # share of frames, those in which a foot moves least, when it is flat on the ground


@dataclass(frozen=True)
class Measures:
    """A body's own lengths, metres: `gait.body.skeleton.Proportions` times the stature.

    Lengths of parts that are never visible are NaN; the stature then follows from the others.
    """

    stature: float
    hip: Floats  #: (2, 3) left and right, in the pelvis frame
    shoulder: Floats  #: (2, 3) left and right, in the torso frame
    neck: float
    upper_arm: Floats  #: (2,) and so on
    forearm: Floats
    thigh: Floats
    shank: Floats
    foot: Floats  #: (2,) ankle to ball
    slope: Floats  #: (2,) of the line ankle to ball below the sole's direction, radians
    sole: float  #: height of the ankle above the ground in stance


def stance(body: Body, side: str) -> Indices:
    """Return the frames in which the foot of a side is flat, as ankle and ball (if known) move least."""
    points = [body.joints[f"{side}_{joint}"] for joint in ("ankle", "toe")]
    known = [place for place in points if np.isfinite(place).any()]
    speed = sum((np.linalg.norm(np.gradient(p, axis=0), axis=1) for p in known), np.zeros(body.frames))
    visible = int(np.isfinite(speed).sum())
    order = np.argsort(np.where(np.isfinite(speed), speed, np.inf), kind="stable")
    return order[: min(max(3, int(STANCE_SHARE * visible)), visible)]


def measure(body: Body) -> Measures:
    """Measure a body whose floor is level (at any height)."""
    j = body.joints

    def distances(upper: str, lower: str) -> Floats:
        return np.array([_distance(j[f"{s}_{upper}"], j[f"{s}_{lower}"]) for s in SIDES])

    torso = torso_frames(body)
    flat = {s: stance(body, s) for s in SIDES}
    rise = np.array([median((j[f"{s}_ankle"] - j[f"{s}_toe"])[flat[s], 2]) for s in SIDES])
    foot, neck = distances("ankle", "toe"), _distance(j["pelvis"], j["neck"])
    thigh, shank = distances("hip", "knee"), distances("knee", "ankle")
    parts = {"rise": mean(rise), "thigh": mean(thigh), "shank": mean(shank), "neck": neck}
    known = (
        1
        - HEAD_LENGTH
        - BALL
        - sum(share for part, share in UNKNOWN_HEIGHTS.items() if np.isnan(parts[part]))
    )
    stature = float(sum(length for length in parts.values() if np.isfinite(length))) / known
    return Measures(
        stature=stature,
        hip=np.array([_in_frame(body.pelvis, j[f"{s}_hip"] - j["pelvis"]) for s in SIDES]),
        shoulder=np.array([_in_frame(torso, j[f"{s}_shoulder"] - j["pelvis"]) for s in SIDES]),
        neck=neck,
        upper_arm=distances("shoulder", "elbow"),
        forearm=distances("elbow", "wrist"),
        thigh=thigh,
        shank=shank,
        foot=foot,
        slope=np.arcsin(np.clip(rise / foot, -1, 1)),
        sole=parts["rise"] + BALL * stature,
    )


def known_parts(m: Measures | None) -> int:
    """Count the known lengths of a body; 0 for None."""
    return 0 if m is None else sum(int(np.isfinite(getattr(m, part.name)).sum()) for part in fields(m))


def mean(values: Floats) -> float:
    """Return the mean of the finite values; NaN if there are none."""
    return float(np.nanmean(values)) if np.isfinite(values).any() else float("nan")


def median(values: Floats) -> float:
    """Return the median of the finite values; NaN if there are none."""
    return float(np.nanmedian(values)) if np.isfinite(values).any() else float("nan")


def _distance(a: Floats, b: Floats) -> float:
    return mean(np.asarray(np.linalg.norm(a - b, axis=1)))


def _in_frame(frames: Floats, vectors: Floats) -> Floats:
    """Mean of vectors (T, 3) in the axes of frames (T, 3, 3); NaN along axes that are never visible."""
    along = np.einsum("tji,tj->ti", frames, vectors)
    visible = np.isfinite(along)
    total = np.where(visible, along, 0).sum(axis=0)
    return np.asarray(np.where(visible.any(axis=0), total / np.maximum(visible.sum(axis=0), 1), np.nan))


def torso_frames(body: Body) -> Floats:
    """Return torso axes (T, 3, 3): up from the pelvis to the neck, left from shoulder to shoulder."""
    j = body.joints
    return frame_from(j["neck"] - j["pelvis"], j["l_shoulder"] - j["r_shoulder"])


def angles(body: Body, measures: Measures) -> Floats:
    """Return angles (T, 24) in the order of `ANGLES`, radians; NaN where a joint is missing."""
    j = body.joints
    result: dict[str, Floats] = {}
    torso = torso_frames(body)
    head = frame_from(j["head"] - j["neck"], body.lateral["head"])
    for name, child, parent in (("torso", torso, body.pelvis), ("neck", head, torso)):
        turns = decompose(np.swapaxes(parent, 1, 2) @ child, "zyx")
        result |= {f"{name}_{axis}": turns[:, k] for k, axis in enumerate("zyx")}
    for i, s in enumerate(SIDES):
        chains = (("shoulder", "elbow", "wrist", torso, -1.0), ("hip", "knee", "ankle", body.pelvis, 1.0))
        for first, second, third, parent, sense in chains:
            hinge = body.lateral[f"{s}_{second}"]
            upper = frame_from(j[f"{s}_{first}"] - j[f"{s}_{second}"], hinge)
            turns = decompose(np.swapaxes(parent, 1, 2) @ upper, "yxz") * (
                (-1, 1, -1) if s == "l" else (-1, -1, 1)
            )
            result |= {
                f"{s}_{first}_{n}": turns[:, k] for k, n in enumerate(("flexion", "abduction", "rotation"))
            }
            lower = j[f"{s}_{second}"] - j[f"{s}_{third}"]
            result[f"{s}_{second}_flexion"] = sense * _about_y(upper, lower)
        shank = frame_from(j[f"{s}_knee"] - j[f"{s}_ankle"], body.lateral[f"{s}_knee"])
        sole = _about_y(shank, j[f"{s}_toe"] - j[f"{s}_ankle"])
        result[f"{s}_ankle_flexion"] = np.pi / 2 - sole + measures.slope[i]
    table = np.stack([result[name] for name in ANGLES], axis=1)
    return _centred(table)


def observed_angles(body: Body, measures: Measures, unknown: float = np.nan) -> Floats:
    """Return `angles` with `unknown` for rotations of limbs that are always straight, as nothing shows them.

    The hinge of a straight limb has no direction, and that in a file is arbitrary; other angles are computed
    as if it were along the body's lateral axis.
    """
    straight = _straight_limbs(body)
    across = {"elbow": torso_frames(body)[..., 1], "knee": body.pelvis[..., 1]}
    hinges = {f"{s}_{joint}": across[joint] for s, joint in straight}
    table = angles(replace(body, lateral=body.lateral | hinges), measures)
    for s, joint in straight:
        upper = "shoulder" if joint == "elbow" else "hip"
        table[:, ANGLES.index(f"{s}_{upper}_rotation")] = unknown
    return table


def _straight_limbs(body: Body) -> list[tuple[str, str]]:
    """Return sides and joints of limbs that hardly bend in any frame."""
    found = []
    for s in SIDES:
        for joint, (upper, lower) in {"elbow": ("shoulder", "wrist"), "knee": ("hip", "ankle")}.items():
            middle = body.joints[f"{s}_{joint}"]
            ends = unit(middle - body.joints[f"{s}_{upper}"]), unit(body.joints[f"{s}_{lower}"] - middle)
            bend = np.linalg.norm(np.cross(*ends), axis=1)
            bend = bend[np.isfinite(bend)]
            if len(bend) and np.quantile(bend, MOSTLY) < STRAIGHT_KNEE_SINE:
                found.append((s, joint))
    return found


def _about_y(frames: Floats, vectors: Floats) -> Floats:
    """Angle (T,) about the frames' y axis from their z axis to vectors, in (-pi, pi]."""
    local = np.einsum("tji,tj->ti", frames, unit(vectors))
    return np.asarray(np.arctan2(local[:, 0], local[:, 2]))


def _centred(table: Floats) -> Floats:
    """Remove jumps of a whole turn, with the mean of each column within half a turn."""
    result = unwrap(table)
    for column in result.T:
        visible = np.isfinite(column)
        if visible.any():
            column -= 2 * np.pi * np.round(np.mean(column[visible]) / (2 * np.pi))
    return result


def generic_proportions(bodies: Sequence[Measures | None]) -> Proportions:
    """Return proportions for people who were not measured: recorded legs and forearms, the rest `ANATOMICAL`.

    The positions of hips and neck in a body are a matter of definition, which images do not determine.
    ANATOMICAL minimises the tracker's errors on the rendered bodies (MakeHuman) of the development clips of
    ../shared/data, which are therefore no independent test; tests/bench/learn_floor.py measures its cost on
    CMU's recordings.
    """
    return replace(mean_proportions(bodies), **ANATOMICAL)


def own_proportions(m: Measures) -> Proportions:
    """Return the proportions of one body, made symmetric."""
    return mean_proportions([m])


def mean_proportions(bodies: Sequence[Measures | None]) -> Proportions:
    """Return mean proportions of bodies in statures, made symmetric.

    Each part is averaged over the bodies that have it, and generic if none does; None: a body without any
    part.
    """
    generic, measured = Proportions(), [m for m in bodies if m is not None]

    def part(value: Callable[[Measures], Floats | float], default: float) -> float:
        found = mean(np.array([mean(np.asarray(value(m))) / m.stature for m in measured]))
        return found if np.isfinite(found) else default

    def offset(points: str) -> tuple[float, float, float]:
        known = [m for m in measured if np.isfinite(getattr(m, points)).all()]
        if not known:
            return getattr(generic, points)
        both = np.mean([getattr(m, points) / m.stature for m in known], axis=0)
        middle = (both[0] + both[1] * (1, -1, 1)) / 2
        return float(middle[0]), float(middle[1]), float(middle[2])

    foot = part(lambda m: m.foot, float(np.hypot(generic.toe[0], generic.toe[2])))
    slope = part(lambda m: m.slope * m.stature, float(np.arctan2(-generic.toe[2], generic.toe[0])))
    sole = part(lambda m: m.sole, generic.sole)
    toe = (foot * np.cos(slope), 0.0, -foot * np.sin(slope))
    return Proportions(
        hip=(0.0, offset("hip")[1], 0.0),
        shoulder=offset("shoulder"),
        neck=part(lambda m: m.neck, generic.neck),
        head=(0.0, 0.0, HEAD_LENGTH),
        upper_arm=part(lambda m: m.upper_arm, generic.upper_arm),
        forearm=part(lambda m: m.forearm, generic.forearm),
        thigh=part(lambda m: m.thigh, generic.thigh),
        shank=part(lambda m: m.shank, generic.shank),
        toe=(float(toe[0]), 0.0, float(toe[2])),
        heel=(generic.heel[0], 0.0, generic.heel[2] + generic.sole - sole),
        sole=sole,
    )


def overground(body: Body) -> Body:
    """Move a person on a treadmill, or an animation in place, over the ground, and note the belt's speed.

    Bodies that travel, or whose feet do not slide at a constant speed, are not changed.
    """
    path = body.joints["pelvis"]
    visible = np.flatnonzero(np.isfinite(path[:, 0]))
    if (
        len(visible) < 3
        or np.linalg.norm(path[visible[-1], :2] - path[visible[0], :2]) / len(visible) * body.fps > STANDING
    ):
        return body
    belt = _belt(body)
    speed = float(np.linalg.norm(belt))
    if not speed >= BELT:
        return replace(body, notes=replace(body.notes, belt=0.0))
    shift = np.zeros((body.frames, 3))
    shift[:, :2] = -belt * np.arange(body.frames)[:, None] / body.fps
    joints = {name: place + shift for name, place in body.joints.items()}
    return replace(body, joints=joints, notes=replace(body.notes, belt=speed))


def _belt(body: Body) -> Floats:
    """Return the velocity (2,) of the ground under a person who stays in place, m/s; 0 if there is none.

    A standing foot moves with the belt, and at no other time has a constant velocity for long.  So the
    velocity is where those of ankles or balls, whichever agree better, are densest.  Heights are not used, as
    belts may slope.
    """
    best, narrowest = np.zeros(2), BELT_VELOCITY_RANGE
    for joint in ("ankle", "toe"):
        feet = [np.gradient(body.joints[f"{s}_{joint}"][:, :2], axis=0) * body.fps for s in SIDES]
        velocity = np.concatenate([v[np.isfinite(v).all(axis=1)] for v in feet])
        if len(velocity) < FEWEST_FOOT_VELOCITIES:
            continue
        _, _, axes = np.linalg.svd(velocity - np.median(velocity, axis=0), full_matrices=False)
        along = velocity @ axes[0]
        inside = _densest(along, STANCE_SHARE)
        middle = np.median(velocity[inside], axis=0)
        width = float(np.ptp(along[inside])) / max(float(np.linalg.norm(middle)), 1e-9)
        if width < narrowest:
            best, narrowest = middle, width
    return best


def _densest(values: Floats, share: float) -> Indices:
    """Return the indices of the share of the values that are closest together."""
    order = np.argsort(values, kind="stable")
    count = max(3, int(share * len(values)))
    width = values[order[count - 1 :]] - values[order[: len(order) - count + 1]]
    return order[int(np.argmin(width)) :][:count]


def level(body: Body) -> tuple[Body, float]:
    """Rotate a body so that the floor under its feet is level along the path; also return the slope, radians.

    The floor is the line through the balls of the feet in stance.
    """
    path = body.joints["pelvis"]
    visible = np.flatnonzero(np.isfinite(path[:, 0]))
    travel = path[visible[-1], :2] - path[visible[0], :2] if len(visible) else np.zeros(2)
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


def levelled(body: Body, steepest: float = np.inf) -> Body:
    """Put a body on a level floor, with standard pelvis axes.

    A floor steeper than `steepest`, radians, is stairs and is not changed.
    """
    level_body, slope = level(body)
    return align_pelvis(level_body if abs(slope) < steepest else body)


def align_pelvis(body: Body) -> Body:
    """Make the pelvis axes independent of the placement of markers.

    The left axis becomes the line between the hips, and the forward axis is level on average, as the pelvis
    in a file may be pitched by an unknown constant.
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
    """Fit a line by least squares, then twice again without points farther than twice the median error."""
    keep = np.ones(len(values), bool)
    line: Floats = np.zeros(2)
    for _ in range(3):
        line = np.asarray(np.linalg.lstsq(design[keep], values[keep], rcond=None)[0], float)
        error = np.abs(values - design @ line)
        keep = error <= max(2 * float(np.median(error)), 1e-4)
    return line


def _about(axis: Floats, angle: float) -> Floats:
    """Return the rotation (3, 3) about a horizontal unit axis."""
    base = axis_rotation(2, float(np.arctan2(axis[1], axis[0])))
    return np.asarray(base @ axis_rotation(0, angle) @ base.T)


def root_channels(body: Body, measures: Measures, period: float) -> tuple[Floats, Floats]:
    """Return root channels (T, 6) of a level body and its heading (T,); `period` is frames per stride.

    Channels are root_forward ... root_yaw: statures per stride, statures, statures, radians; NaN where the
    pelvis is not visible.  The heading is the direction of travel, radians, constant before the pelvis is
    first visible and after it is last visible; NaN if it never is.
    """
    path, frames = body.joints["pelvis"], body.frames
    visible = np.isfinite(path[:, 0])
    if visible.sum() < 3:
        return np.full((frames, 6), np.nan), np.full(frames, np.nan)
    ground = ground_height(body, measures.stature)
    smooth, velocity, fitted = _smooth_path(path[:, :2], period)
    first, last = np.flatnonzero(visible)[[0, -1]]
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
    result[:, 0] = np.where(visible, forward, np.nan)
    result[:, 1] = np.sum((path[:, :2] - smooth) * across, axis=1) / measures.stature
    result[:, 2] = (path[:, 2] - ground) / measures.stature
    turns = decompose(axis_rotation(2, -heading) @ body.pelvis, "zyx")
    result[:, 3:] = turns[:, ::-1]
    return result, heading


def ground_height(body: Body, stature: float) -> float:
    """Return the height of the ground under the feet in stance, from the balls, or else from the ankles."""
    for joint, height in (("toe", BALL), ("ankle", Proportions().sole)):
        lowest = median(np.array([median(body.joints[f"{s}_{joint}"][stance(body, s), 2]) for s in SIDES]))
        if np.isfinite(lowest):
            return lowest - height * stature
    return float("nan")


def _smooth_path(path: Floats, period: float) -> tuple[Floats, Floats, Floats]:
    """Return a slow polynomial through the path (T, 2), its derivative, and it plus a periodic stride."""
    frames = len(path)
    t = (np.arange(frames) - frames / 2) / period
    degree = 1 if frames < 1.5 * period else 2 if frames < 4 * period else 5
    angle = 2 * np.pi * np.outer(t, np.arange(1, PELVIS_HARMONICS + 1))
    powers = np.vander(t, degree + 1, increasing=True)
    design = np.concatenate([powers, np.cos(angle), np.sin(angle)], axis=1)
    visible = np.isfinite(path[:, 0])
    weights, *_ = np.linalg.lstsq(design[visible], path[visible], rcond=None)
    slow = weights[: degree + 1]
    derivative = (
        np.vander(t, degree, increasing=True) @ (slow[1:] * np.arange(1, degree + 1)[:, None]) / period
    )
    return powers @ slow, derivative, design @ weights


def _mean_over(values: Floats, period: float) -> Floats:
    """Return the mean (T,) over one stride around each frame, shorter at the ends, without NaN."""
    visible = np.isfinite(values)
    width = max(1, round(period))
    window = np.ones(width)
    total = np.convolve(np.where(visible, values, 0), window, "same")
    return np.asarray(total / np.maximum(np.convolve(visible, window, "same"), 1))
