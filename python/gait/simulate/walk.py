"""A walk of given speed and cadence: pelvis, planted feet and every bone on a fine time grid.

The joint angles give the shape of the movement.  The stance foot then gives the forward motion, each step is
planted where it is on average while it stands, and the legs are solved so that planted feet neither slide
nor sink.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import brentq

from gait.errors import UsageError
from gait.simulate import feet
from gait.simulate.anatomy import BONE_INDEX, BONES, JOINT_OF, POINT_BONE, POINTS, SIDES, Anatomy
from gait.simulate.arrays import Array, Ints
from gait.simulate.curves import Curves
from gait.simulate.path import Path
from gait.simulate.rotations import about, apply, euler, limb, unit
from gait.simulate.stride import Timing

_REACH = 0.9985  # a leg is never straighter than this share of its length
_LANDING = 0.90  # from this share of the cycle the swinging foot already binds the pelvis's height
_SWAY = 0.012  # statures
_SURGE = 0.05  # the pelvis is fastest in double support and slowest over the standing leg, share of the speed
_HALF_WIDTH = 0.024  # of the step, statures
_LEAD = 0.010  # how far the pelvis is ahead of where the angles would have it over the feet, statures


@dataclass(frozen=True)
class Walk:
    """Pose of every bone at every step of the time grid.

    Attributes
    ----------
    timing : Timing
    body : Anatomy
    origins : ndarray of shape (T, bones, 3)
        Joint of each bone, world, metres.
    turns : ndarray of shape (T, bones, 3, 3)
        Bone to world.
    heading : ndarray of shape (T,)
        Direction of the path under the pelvis, radians.
    pelvis_yaw : ndarray of shape (T,)
        Turn of the pelvis against that direction, radians.
    speed : ndarray of shape (T,)
        Forward speed along the path, m/s.
    """

    timing: Timing
    body: Anatomy
    origins: Array
    turns: Array
    heading: Array
    pelvis_yaw: Array
    speed: Array

    def points(self, index: Ints | slice = slice(None)) -> dict[str, Array]:
        """Return the reported points (n, 3) at grid indices, world, metres."""
        rest = self.body.rest
        out = {}
        for name in POINTS:
            bone = BONE_INDEX[POINT_BONE[name]]
            offset = rest[name] - rest[_joint_name(bone)]
            out[name] = self.origins[index, bone] + apply(self.turns[index, bone], offset)
        return out


def _joint_name(bone: int) -> str:
    return JOINT_OF[BONES[bone]]


def make_walk(
    body: Anatomy, curves: Curves, timing: Timing, path: Path, speed: float, rng: np.random.Generator
) -> Walk:
    """Compute a walk at `speed` m/s (mean over the grid) along `path`.

    Raises
    ------
    UsageError
        If no step length of this person and cadence gives that speed.
    """
    angles = curves.angles(timing.phase, timing.scores)
    gain = _stride_gain(angles, timing, body, speed)
    angles = _stretched(angles, gain)
    forward = _forward_speed(angles, timing, body, gain)
    along = cumulative_trapezoid(forward, dx=timing.step, initial=0)
    along -= np.interp(0.5 * (timing.time[0] + timing.time[-1]), timing.time, along)  # the clip's middle
    heading = path.direction(along)
    course = _Course(timing, body, path, angles, gain, along, heading)
    yaw = heading + angles["pelvis_yaw"]
    turn = euler(yaw, angles["pelvis_pitch"], angles["pelvis_roll"])
    plans = {side: _plan_foot(side, course, rng) for side in SIDES}
    sway = -_SWAY * body.stature * np.sin(2 * np.pi * (timing.phase - 0.02))
    ground = path.point(along, sway)
    pelvis = np.column_stack([ground, _pelvis_height(ground, turn, plans, timing, body)])
    origins, turns = np.zeros((len(along), len(BONES), 3)), np.zeros((len(along), len(BONES), 3, 3))
    _set(origins, turns, "pelvis", pelvis, turn)
    for side in SIDES:
        _solve_leg(side, origins, turns, plans[side], yaw, body)
    _upper_body(origins, turns, angles, body)
    return Walk(timing, body, origins, turns, heading, angles["pelvis_yaw"], forward)


@dataclass(frozen=True)
class _Course:
    """What both feet have in common: the pelvis's progress along the path and the joint angles."""

    timing: Timing
    body: Anatomy
    path: Path
    angles: dict[str, Array]
    gain: float
    along: Array
    heading: Array


@dataclass(frozen=True)
class _FootPlan:
    ankle: Array
    yaw: Array
    pitch: Array
    bend: Array
    phase: Array


def _stretched(angles: dict[str, Array], gain: float) -> dict[str, Array]:
    """Scale the swing of legs, arms and pelvis for a longer (gain > 1) or shorter step."""
    out = dict(angles)
    for name, value in angles.items():
        if name.endswith(("hip_flexion", "shoulder_flexion")) or name in ("pelvis_yaw", "torso_z"):
            centre = value.mean()
            out[name] = centre + gain * (value - centre)
    return out


def _free_ankle(side: str, angles: dict[str, Array], body: Anatomy) -> Array:
    """Return the ankle relative to the pelvis joint as the angles put it, path frame (T, 3)."""
    pelvis = euler(angles["pelvis_yaw"], angles["pelvis_pitch"], angles["pelvis_roll"])
    thigh = pelvis @ _ball_joint(angles, f"{side}_hip")
    shank = thigh @ about(1, angles[f"{side}_knee_flexion"])
    return (
        apply(pelvis, body.rest[f"{side}_hip"])
        + apply(thigh, [0, 0, -body["thigh"]])
        + apply(shank, [0, 0, -body["shank"]])
    )


def _ball_joint(angles: dict[str, Array], joint: str) -> Array:
    """Return the rotation of a hip or shoulder, named with its side."""
    sign = 1.0 if joint.startswith("l_") else -1.0
    return limb(angles[f"{joint}_flexion"], angles[f"{joint}_abduction"], angles[f"{joint}_rotation"], sign)


def _forward_speed(angles: dict[str, Array], timing: Timing, body: Anatomy, gain: float) -> Array:
    """Return the speed at which the feet on the ground push the pelvis forward, smoothed, (T,) m/s."""
    total, weight = np.zeros(len(timing.time)), np.zeros(len(timing.time))
    for side in SIDES:
        phase = timing.of_side(side)
        p = phase % 1.0
        pitch = feet.foot_pitch(phase, _pitch_gain(gain))
        rolled, _ = feet.rolling_ankle(pitch, feet.toe_bend(phase, pitch), body)
        still = _free_ankle(side, angles, body)[:, 0] - rolled
        share = feet.smoothstep(p, 0.0, 0.12) * (1 - feet.smoothstep(p, 0.48, feet.TOE_OFF))
        total += share * -np.gradient(still, timing.step)
        weight += share
    speed = total / np.maximum(weight, 1e-3)
    surge = 1 + _SURGE * np.cos(4 * np.pi * (timing.phase - 0.02))
    return _smoothed(speed, 0.35, timing) * surge


def _smoothed(value: Array, strides: float, timing: Timing) -> Array:
    """Return `value` (T,) filtered by a Gaussian whose standard deviation is a share of the stride."""
    per_stride = 1 / (timing.step * np.gradient(timing.phase, timing.step).mean())
    return gaussian_filter1d(value, strides * per_stride, mode="nearest")


def _pitch_gain(gain: float) -> float:
    """Return how much the foot rolls for a stretched step: a third of the step's share."""
    return 1 + (gain - 1) / 3


def _stride_gain(angles: dict[str, Array], timing: Timing, body: Anatomy, speed: float) -> float:
    """Return the factor on the legs' swing that gives the mean speed."""

    def excess(gain: float) -> float:
        return float(_forward_speed(_stretched(angles, gain), timing, body, gain).mean()) - speed

    low, high = 0.35, 1.6
    if excess(low) > 0 or excess(high) < 0:
        cadence = float(np.gradient(timing.phase, timing.step).mean())
        slow, fast = excess(low) + speed, excess(high) + speed
        raise UsageError(
            f"--speed {speed:g}: at {cadence:.2f} strides/s and this stature a walk goes {slow:.2f} to "
            f"{fast:.2f} m/s; change --speed or --stride-hz"
        )
    return float(brentq(excess, low, high, xtol=1e-4))


def _plan_foot(side: str, course: _Course, rng: np.random.Generator) -> _FootPlan:
    """Plant every step of one foot and carry the foot from one to the next."""
    phase = course.timing.of_side(side)
    pitch = feet.foot_pitch(phase, _pitch_gain(course.gain))
    bend = feet.toe_bend(phase, pitch)
    rel = _free_ankle(side, course.angles, course.body)
    rolled = feet.rolling_ankle(pitch, bend, course.body)
    left = (1.0 if side == "l" else -1.0) * _HALF_WIDTH * course.body.stature * float(rng.uniform(0.7, 1.3))
    falls = _footfalls(side, course, course.along + rel[:, 0] - rolled[0], left, rng)
    ahead = np.column_stack([np.cos(course.heading), np.sin(course.heading)])
    stance = phase % 1.0 < feet.TOE_OFF
    height = rel[:, 2] - (rel[:, 2] - rolled[1])[stance].mean()
    free = np.column_stack([course.path.point(course.along, left) + rel[:, :1] * ahead, height])
    ankle, yaw = feet.foot_track(phase, free, course.timing.step, falls, rolled)
    return _FootPlan(feet.lift_swing(ankle, pitch, bend, phase, course.body), yaw, pitch, bend, phase)


def _footfalls(
    side: str, course: _Course, place: Array, left: float, rng: np.random.Generator
) -> list[feet.Footfall]:
    """Plant each step where the foot is on average while it stands: `place` (T,) along the path, metres."""
    phase, stature = course.timing.of_side(side), course.body.stature
    toe_out = (1.0 if side == "l" else -1.0) * np.radians(rng.uniform(3, 9))
    falls = []
    for stride in range(int(np.ceil(phase[0])), int(np.floor(phase[-1] - feet.TOE_OFF)) + 1):
        stance = (phase > stride) & (phase < stride + feet.TOE_OFF)
        where = float(place[stance].mean()) - _LEAD * stature
        aside = left + 0.004 * stature * float(np.clip(rng.standard_normal(), -2, 2))
        yaw = float(course.path.direction(where) + toe_out + np.radians(1.5) * rng.standard_normal())
        falls.append(feet.Footfall(stride, course.path.point(where, aside), yaw))
    return falls


def _pelvis_height(
    ground: Array, turn: Array, plans: dict[str, _FootPlan], timing: Timing, body: Anatomy
) -> Array:
    """Return a smooth height of the pelvis (T,) at which the legs reach every planted foot, metres."""
    limit = np.full(len(ground), np.inf)
    for side, plan in plans.items():
        hip = apply(turn, body.rest[f"{side}_hip"])
        aside = np.linalg.norm(plan.ankle[:, :2] - ground - hip[:, :2], axis=1)
        p = plan.phase % 1.0
        reach = body.leg * np.where(p < feet.TOE_OFF, _bent(p), 1.0)
        highest = plan.ankle[:, 2] + np.sqrt(np.maximum(reach**2 - aside**2, 0)) - hip[:, 2]
        limit = np.minimum(limit, np.where((p < feet.TOE_OFF) | (p > _LANDING), highest, np.inf))
    height = _smoothed(limit, 0.045, timing)
    for _ in range(4):
        height -= _smoothed(np.maximum(height - limit, 0), 0.03, timing)
    return height


def _bent(p: Array) -> Array:
    """Return the extension a stance leg aims for: yielding while it takes the load, then almost straight."""
    load = feet.smoothstep(p, 0.02, 0.13) * (1 - feet.smoothstep(p, 0.18, 0.36))
    return _REACH - 0.0095 * load


def _set(origins: Array, turns: Array, bone: str, origin: Array, turn: Array) -> None:
    origins[:, BONE_INDEX[bone]], turns[:, BONE_INDEX[bone]] = origin, turn


def _solve_leg(
    side: str, origins: Array, turns: Array, plan: _FootPlan, pelvis_yaw: Array, body: Anatomy
) -> None:
    """Set thigh, shank, foot and toes so that the ankle is where the foot wants it."""
    pelvis = BONE_INDEX["pelvis"]
    hip = origins[:, pelvis] + apply(turns[:, pelvis], body.rest[f"{side}_hip"])
    reach = plan.ankle - hip
    distance = np.linalg.norm(reach, axis=1)
    down = reach / distance[:, None]
    thigh, shank = body["thigh"], body["shank"]
    distance = np.minimum(distance, _REACH * body.leg)
    yaw = 0.5 * (pelvis_yaw + plan.yaw)
    ahead = np.column_stack([np.cos(yaw), np.sin(yaw), np.zeros(len(yaw))])
    bow = unit(ahead - (ahead * down).sum(1, keepdims=True) * down)
    share = (distance**2 + thigh**2 - shank**2) / (2 * distance)
    knee = hip + share[:, None] * down + np.sqrt(np.maximum(thigh**2 - share**2, 0))[:, None] * bow
    ankle = hip + distance[:, None] * down
    hinge = unit(np.cross(-down, bow))
    _set(origins, turns, f"{side}_thigh", hip, _upright(hip - knee, hinge))
    _set(origins, turns, f"{side}_shank", knee, _upright(knee - ankle, hinge))
    foot = about(2, plan.yaw) @ about(1, -plan.pitch)
    _set(origins, turns, f"{side}_foot", ankle, foot)
    offset = body.rest[f"{side}_toe"] - body.rest[f"{side}_ankle"]
    _set(origins, turns, f"{side}_toes", ankle + apply(foot, offset), foot @ about(1, -plan.bend))


def _upright(up: Array, left: Array) -> Array:
    """Return rotations whose z axis is along `up` and whose y axis is `left`."""
    z = unit(up)
    return np.stack([np.cross(left, z), left, z], axis=-1)


def _upper_body(origins: Array, turns: Array, angles: dict[str, Array], body: Anatomy) -> None:
    """Set torso, head and arms from the angles."""

    def place(child: str, parent: str, joint: str, parent_joint: str, turn: Array) -> None:
        p = BONE_INDEX[parent]
        offset = body.rest[joint] - body.rest[parent_joint]
        _set(origins, turns, child, origins[:, p] + apply(turns[:, p], offset), turns[:, p] @ turn)

    for child, parent, joint, base, name in (
        ("torso", "pelvis", "spine", "pelvis", "torso"), ("head", "torso", "neck", "spine", "neck")
    ):  # fmt: skip
        place(child, parent, joint, base, euler(*(angles[f"{name}_{axis}"] for axis in "zyx")))
    for side in SIDES:
        turn = _ball_joint(angles, f"{side}_shoulder")
        place(f"{side}_upper_arm", "torso", f"{side}_shoulder", "spine", turn)
        bend = np.maximum(angles[f"{side}_elbow_flexion"], np.radians(4))
        place(f"{side}_forearm", f"{side}_upper_arm", f"{side}_elbow", f"{side}_shoulder", about(1, -bend))
        loose = about(1, -0.15 * bend - 0.1)
        place(f"{side}_hand", f"{side}_forearm", f"{side}_wrist", f"{side}_elbow", loose)
