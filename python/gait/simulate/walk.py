"""A walk of given speed and cadence: pelvis, planted feet and every bone on a fine time grid.

The joint angles give the shape of the movement.  The stance foot then gives the forward motion, each step is
planted at its mean position while it stands, and the legs are solved so that planted feet neither slide nor
sink.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator
from scipy.ndimage import gaussian_filter1d, maximum_filter1d
from scipy.optimize import brentq

from gait.body.skeleton import axis_rotation as about
from gait.errors import UsageError
from gait.simulate.body import BODY_BONES, BONE_INDEX, JOINT_OF, POINT_BONE, POINTS, SIDES, Anatomy
from gait.simulate.curves import Curves
from gait.simulate.geometry import Array, Ints, apply, euler, limb, unit


@dataclass(frozen=True)
class Path:
    """Curve on the ground by arc length; arc length 0 is the middle of the clip."""

    heading: float  #: direction of travel at arc length 0, radians from world x towards world y
    #: Radius of the circle about the origin, metres, positive to the left (anticlockwise); 0 = straight.
    radius: float = 0.0
    #: Angle of a corner in the middle of the path, radians, positive to the left.
    corner: float = 0.0
    #: Metres by which a straight path is moved to the left and forward.
    aside: float = 0.0
    ahead: float = 0.0

    def direction(self, along: ArrayLike) -> Array:
        """Return the heading at arc lengths (...), radians, unwrapped."""
        along = np.asarray(along, np.float64)
        if self.corner:
            return self.heading + self.corner * (smoothstep(along, -CORNER_M, CORNER_M) - 0.5)
        return self.heading + (along / self.radius if self.radius else np.zeros_like(along))

    def point(self, along: ArrayLike, left: ArrayLike = 0.0) -> Array:
        """Return world x, y (..., 2) at arc lengths (...) and an offset to the left, metres."""
        along, left = np.broadcast_arrays(np.asarray(along, np.float64), left)
        h = self.direction(along)
        ahead, aside = np.stack([np.cos(h), np.sin(h)], -1), np.stack([-np.sin(h), np.cos(h)], -1)
        if self.corner:
            base = self._round_the_corner(along)
        else:
            base = -self.radius * aside if self.radius else (along + self.ahead)[..., None] * ahead
        return base + (left + self.aside)[..., None] * aside

    def _round_the_corner(self, along: Array) -> Array:
        """Compute world x, y (..., 2) at arc lengths (...), by the trapezoidal rule."""
        grid = np.linspace(-CORNER_M, CORNER_M, 401)
        h = self.direction(grid)
        inside = np.clip(along, -CORNER_M, CORNER_M)
        end = self.direction(along)
        out = []
        for turned, last in ((np.cos(h), np.cos(end)), (np.sin(h), np.sin(end))):
            way = cumulative_trapezoid(turned, grid, initial=0)
            out.append(np.interp(inside, grid, way - way[200]) + (along - inside) * last)
        return np.stack(out, axis=-1)


CORNER_M = 0.7  # metres of the path before and after its middle in which a corner turns
STRIDE_TIME_CV = 0.02
# Effects of sparing a leg by a share s, about as in people with a prosthesis below the knee: it strikes later
# by _LATE s of the stride and further ahead by _AHEAD s of the step; it stands for a shorter time, by _SHORT
# s, and the other one for a longer time, by _LONG s; its knee yields less under load, by _STRAIGHT s, and its
# foot pushes off less, by _WEAK s.
_LATE, _AHEAD, _SHORT, _LONG, _STRAIGHT, _WEAK = 0.12, 0.65, 0.5, 0.25, 4.0, 1.0
TOE_OFF, RUN_TOE_OFF = 0.625, 0.37  # share of the cycle, for walks and for runs
MARGIN_STRIDES = 2  # whole strides simulated before and after the clip, so that the clip is not at an edge


@dataclass(frozen=True)
class Timing:
    """Fine time grid and the gait phase on it."""

    time: Array  #: (T,) seconds, uniform, 0 = first frame of the clip; the frames lie on the grid
    phase: Array  #: (T,) unwrapped strides of the right foot; whole numbers are right heel strikes
    scores: Array  #: (T, modes) smooth stride-to-stride scores, unit variance
    #: Grid steps per frame, a multiple of 4, so that a half-open shutter opens and closes on the grid.
    per_frame: int
    #: Strides per second while walking, if the person also stands or runs; 0: the average from the phase.
    usual_hz: float = 0.0
    #: Share by which the left leg is spared, negative for the right leg; see `Scenario.asymmetry`.
    spared: float = 0.0
    toe_off: float = TOE_OFF  #: share of the cycle at which a foot leaves the ground; below 0.5 for runs
    runs_from: float = np.inf  #: phase, a right heel strike, from which a walk is a run

    @property
    def stride_hz(self) -> float:
        """Strides per second while the person walks."""
        return self.usual_hz or float(np.gradient(self.phase, self.step).mean())

    @property
    def step(self) -> float:
        """Grid step, seconds."""
        return float(self.time[1] - self.time[0])

    def of_side(self, side: str) -> Array:
        """Return a foot's unwrapped phase: whole at its own heel strikes, swinging from `TOE_OFF`."""
        phase = self.phase + (0.5 - _LATE * self.spared if side == "l" else 0.0)
        if np.isfinite(self.runs_from):
            strike = np.floor(phase) - (0.5 if side == "l" else 0.0)
            return np.where(strike < self.runs_from, phase, _warped(phase, RUN_TOE_OFF))
        if not self.spared and self.toe_off == TOE_OFF:
            return phase
        off = self.toe_off * (1 - self.sparing(side) * (_SHORT if self.sparing(side) > 0 else _LONG))
        return _warped(phase, off)

    def sparing(self, side: str) -> float:
        """Return the share by which this leg is spared; negative if the other one is."""
        return self.spared if side == "l" else -self.spared


def _warped(phase: Array, off: float) -> Array:
    """Return phases (T,) that pass `TOE_OFF` where `phase` passes `off`."""
    knots = np.array([0, 0.5 * off, off, 0.5 * (1 + off)])
    meant = np.array([0, 0.5 * TOE_OFF, TOE_OFF, 0.5 * (1 + TOE_OFF)])
    warp = PchipInterpolator(
        np.concatenate([knots - 1, knots, knots + 1]), np.concatenate([meant - 1, meant, meant + 1])
    )
    whole = np.floor(phase)
    return np.asarray(whole + warp(phase - whole))


def draw_timing(stride_hz: float, fps: float, frames: int, modes: int, rng: np.random.Generator) -> Timing:
    """Draw stride times with a coefficient of variation of 2 % and a random phase at the first frame."""
    per_frame = 4 * int(np.ceil(60 / fps))
    step = 1 / (fps * per_frame)
    period = 1 / stride_hz
    before = int(np.ceil(MARGIN_STRIDES * period / step))
    count = before + (frames - 1) * per_frame + before + 1
    time = (np.arange(count, dtype=np.float64) - before) * step
    strides = int(np.ceil((time[-1] - time[0]) / period)) + 4
    lengths = period * (1 + STRIDE_TIME_CV * np.clip(rng.standard_normal(strides), -2.5, 2.5))
    strikes = time[0] - period * (1 + rng.uniform()) + np.concatenate([[0], np.cumsum(lengths)])
    phase = PchipInterpolator(strikes, np.arange(strides + 1.0) - 2, extrapolate=True)(time)
    knots: Array = rng.standard_normal((strides + 1, modes))
    scores = PchipInterpolator(strikes, np.clip(knots, -2, 2), extrapolate=True)(time)
    return Timing(time, np.asarray(phase, np.float64), np.asarray(scores, np.float64), per_frame)


# pitch of the foot, degrees, toes up positive
_PITCH_PHASE = (0, 0.03, 0.065, 0.10, 0.34, 0.43, 0.50, 0.56, 0.61, 0.66, 0.71, 0.77, 0.83, 0.88, 0.93, 0.97)
_PITCH_DEG = (20, 13, 4, 0, 0, -5, -15, -34, -56, -67, -60, -38, -11, 8, 18, 20.5)
# bend of the toes relative to the foot, as a share of its downward pitch: flat on the ground, then rolling
# off
_BEND_PHASE = (0, 0.50, 0.56, 0.60, 0.625, 0.66, 0.70, 0.75, 0.85)
_BEND_SHARE = (1, 1, 0.88, 0.67, 0.55, 0.38, 0.20, 0.05, 0)


def _periodic(phase: tuple[float, ...], value: tuple[float, ...]) -> PchipInterpolator:
    """Interpolate without overshoot over three cycles, so that the middle one is periodic."""
    p = np.asarray(phase)
    return PchipInterpolator(np.concatenate([p - 1, p, p + 1]), np.tile(value, 3))


_PITCH = _periodic(_PITCH_PHASE, _PITCH_DEG)
_BEND = _periodic(_BEND_PHASE, _BEND_SHARE)


def foot_pitch(phase: Array, gain: float | Array) -> Array:
    """Return the pitch of the foot (toes up positive), radians, at phases of that foot (unwrapped)."""
    return np.radians(gain * _PITCH(phase % 1.0))


def toe_bend(phase: Array, pitch: Array) -> Array:
    """Return how far the toes bend up relative to the foot, radians."""
    return np.maximum(-pitch, 0) * _BEND(phase % 1.0)


def smoothstep(x: Array, low: float, high: float) -> Array:
    """Return 0 below `low`, 1 above `high`, a smooth cubic between."""
    u = np.clip((np.asarray(x) - low) / (high - low), 0, 1)
    return u * u * (3 - 2 * u)


def rolling_ankle(pitch: Array, bend: Array, body: Anatomy) -> tuple[Array, Array]:
    """Return a planted foot's ankle, forward and up from the ground under the flat foot's ankle, metres.

    The foot rotates about its heel while the toes are up, then about its ball, finally about the tip of the
    toes.
    """
    c, s = np.cos(pitch), np.sin(pitch)
    toes = body["toe_forward"] - body["ball_forward"]
    tilt = pitch + bend  # of the toes
    ball_forward = np.where(pitch > 0, 0, toes * (1 - np.cos(tilt)))
    ball_up = np.where(pitch > 0, 0, -toes * np.sin(tilt))
    pivot = np.where(pitch > 0, -body["heel_back"], body["ball_forward"])
    forward = pivot * (1 - c) - body["ankle_height"] * s + ball_forward
    up = -pivot * s + body["ankle_height"] * c + ball_up
    return forward, up


@dataclass(frozen=True)
class Footfall:
    """One planted step."""

    stride: int  #: the foot's stride number: it is on the ground from phase `stride` to `stride` + TOE_OFF
    place: Array  #: (2,) ground below the ankle of the flat foot, world, metres
    yaw: float  #: direction of the foot, radians


def foot_track(
    phase: Array, free: Array, step: float, falls: list[Footfall], rolled: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return the ankle (T, 3) and the yaw (T,) of a foot that does not slide when planted.

    `phase` (T,): unwrapped phase of this foot. `free` (T, 3): ankle from the joint angles alone, which
    determines the shape of the swing. `step`: grid step, seconds. `falls`: consecutive steps. `rolled` (T,):
    the planted ankle, from `rolling_ankle`.
    """
    ankle, yaw = free.copy(), np.zeros(len(phase))
    forward, up = rolled
    stances = []
    for fall in falls:
        span = np.flatnonzero((phase >= fall.stride) & (phase <= fall.stride + TOE_OFF))
        ahead = np.array([np.cos(fall.yaw), np.sin(fall.yaw)])
        ankle[span, :2] = fall.place + forward[span, None] * ahead
        ankle[span, 2] = up[span]
        yaw[span] = fall.yaw
        stances.append(span)
    for this, after, a, b in zip(stances, stances[1:], falls, falls[1:], strict=False):
        _swing(ankle, free, this[-1], after[0], step)
        u = smoothstep(np.arange(this[-1], after[0] + 1), this[-1], after[0])
        yaw[this[-1] : after[0] + 1] = a.yaw + u * (b.yaw - a.yaw)
    return ankle, yaw


def _swing(ankle: Array, free: Array, first: int, last: int, step: float) -> None:
    """Bend the free swing so that it meets the planted foot with the same position and velocity."""
    ends = np.array([first, last])
    offset = ankle[ends] - free[ends]
    before = (ankle[first] - ankle[first - 2] - free[first] + free[first - 2]) / (2 * step)
    after = (ankle[last + 2] - ankle[last] - free[last + 2] + free[last]) / (2 * step)
    inside = np.arange(first + 1, last)
    bend = CubicHermiteSpline(ends * step, offset, np.array([before, after]))
    ankle[inside] = free[inside] + bend(inside * step)


def lift_swing(
    ankle: Array, pitch: Array, bend: Array, phase: Array, body: Anatomy, stride: float | None = None
) -> Array:
    """Raise a swinging foot (T, 3) smoothly where its sole would come within 12 mm of the ground.

    `stride`: grid steps of a stride, by default the average from the phase.
    """
    sole = np.min(
        [point_height(ankle[:, 2], pitch, bend, name, body) for name in ("heel", "ball", "tip")], axis=0
    )
    p = phase % 1.0
    window = smoothstep(p, TOE_OFF, TOE_OFF + 0.10) * (1 - smoothstep(p, 0.92, 1.0))
    lack = np.maximum(0.012 - sole, 0) * window
    stride = stride or len(phase) / (phase[-1] - phase[0])
    broad = gaussian_filter1d(maximum_filter1d(lack, int(0.10 * stride)), 0.05 * stride)
    raised = ankle.copy()
    raised[:, 2] += broad * window
    return raised


def point_height(ankle_z: Array, pitch: Array, bend: Array, name: str, body: Anatomy) -> Array:
    """Return the height of the sole at the heel, the ball or the tip of the toes, metres."""
    c, s = np.cos(pitch), np.sin(pitch)
    if name == "heel":
        return ankle_z - body["heel_back"] * s - body["ankle_height"] * c
    ball = ankle_z + body["ball_forward"] * s - body["ankle_height"] * c
    if name == "ball":
        return ball
    return ball + (body["toe_forward"] - body["ball_forward"]) * np.sin(pitch + bend)


_REACH = 0.9985  # longest extension of a leg, as a share of its length
_LANDING = 0.90  # share of the cycle from which the swinging foot limits the pelvis's height
_SWAY = 0.012  # statures
_SURGE = 0.05  # variation of the pelvis's speed: fastest in double support, slowest over the standing leg
_HALF_WIDTH = 0.024  # of the step, statures
_GRAVITY = 9.81  # m/s^2
_LEAD = 0.010  # statures; how far the pelvis is ahead of its position over the feet from the angles


@dataclass(frozen=True)
class Walk:
    """Poses of all bones at every step of the time grid."""

    timing: Timing
    body: Anatomy
    origins: Array  #: (T, bones, 3) joint of each bone, world, metres
    turns: Array  #: (T, bones, 3, 3) bone to world
    heading: Array  #: (T,) direction of the path under the pelvis, radians
    pelvis_yaw: Array  #: (T,) yaw of the pelvis relative to that direction, radians
    speed: Array  #: (T,) forward speed along the path, m/s, negative backwards

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
    return JOINT_OF[BODY_BONES[bone]]


def make_walk(
    body: Anatomy,
    curves: Curves,
    timing: Timing,
    path: Path,
    speed: float,
    rng: np.random.Generator,
    shaped: Shaped | None = None,
    faster: Faster | None = None,
) -> Walk:
    """Compute a walk at `speed` m/s (mean over the grid) along `path`.

    `shaped`: a stop; `timing` is then that of the walk without the stop, which determines the length of the
    steps. `faster`: the walk becomes a run; `timing` and `speed` are likewise those of the walk.

    UsageError if no step length of this person gives that speed at this cadence.
    """
    angles = _angles(curves, timing)
    usual = _stride_gain(angles, timing, body, speed)
    gain: float | Array = usual
    angles = _stretched(angles, usual)
    if shaped is not None:
        angles = shaped.posture({name: np.interp(shaped.clock, timing.time, v) for name, v in angles.items()})
        timing, gain = shaped.timing, gain * shaped.amplitude
    if faster is not None:
        angles, gain, timing = _faster(curves, timing, usual, faster, body)
        forward = faster.speed
    else:
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
    runs: Array = np.full(len(along), float(timing.toe_off < 0.5)) if faster is None else faster.runs
    height = np.zeros(len(along))
    for share, of in ((1 - runs, _pelvis_height), (runs, _running_height)):
        if share.any():
            height += share * of(ground, turn, plans, course)
    pelvis = np.column_stack([ground, height])
    if runs.any():
        plans = {side: _carried(side, plan, pelvis, runs, course) for side, plan in plans.items()}
    origins, turns = np.zeros((len(along), len(BODY_BONES), 3)), np.zeros((len(along), len(BODY_BONES), 3, 3))
    _set(origins, turns, "pelvis", pelvis, turn)
    for side in SIDES:
        _solve_leg(side, origins, turns, plans[side], yaw, body)
    _upper_body(origins, turns, angles, body)
    return Walk(timing, body, origins, turns, heading, angles["pelvis_yaw"], forward)


def _angles(curves: Curves, timing: Timing) -> dict[str, Array]:
    """Compute the angles of the walk by channel; limbs follow the phase of their side's foot."""
    angles = curves.angles(timing.phase, timing.scores)
    if not timing.spared:
        return angles
    for side, half in (("l", 0.5), ("r", 0.0)):
        own = curves.angles(timing.of_side(side) - half, timing.scores)
        angles |= {name: values for name, values in own.items() if name.startswith(f"{side}_")}
    return angles


@dataclass(frozen=True)
class Shaped:
    """Differences of a walk with a stop from one without."""

    timing: Timing
    clock: Array  #: (T,) time in the walk without a stop, seconds
    amplitude: Array  #: (T,) of the steps
    posture: Callable[[dict[str, Array]], dict[str, Array]]  #: changes joint angles


@dataclass(frozen=True)
class Faster:
    """Differences of a walk that becomes a run from one that does not."""

    timing: Timing
    run: Curves
    run_timing: Timing  #: of a run throughout
    run_speed: float  #: m/s
    runs: Array  #: (T,) share of the run in the posture: 0 walking, 1 running
    speed: Array  #: (T,) m/s


def _faster(
    curves: Curves, timing: Timing, walking: float, faster: Faster, body: Anatomy
) -> tuple[dict[str, Array], Array, Timing]:
    """Blend the angles of a walk into those of a run; return them, the gain of the steps, and the timing.

    `walking`: gain at the walk's usual speed; with the speed, the steps get longer in walk and run alike.
    """
    stride = faster.speed / np.gradient(faster.timing.phase, timing.step)
    parts = []
    for one, gain, usual in (
        (curves, walking, faster.speed[0] / timing.stride_hz),
        (
            faster.run,
            _stride_gain(_angles(faster.run, faster.run_timing), faster.run_timing, body, faster.run_speed),
            faster.run_speed / faster.run_timing.stride_hz,
        ),
    ):
        longer = gain * _smoothed(stride / usual, 0.2, timing)
        parts.append((_stretched(_angles(one, faster.timing), longer), longer))
    (walk, walk_gain), (run, run_gain) = parts
    angles = {name: value + faster.runs * (run[name] - value) for name, value in walk.items()}
    return angles, walk_gain + faster.runs * (run_gain - walk_gain), faster.timing


@dataclass(frozen=True)
class _Course:
    """What both feet share: the pelvis's progress along the path, and the joint angles."""

    timing: Timing
    body: Anatomy
    path: Path
    angles: dict[str, Array]
    gain: float | Array
    along: Array
    heading: Array


@dataclass(frozen=True)
class _FootPlan:
    ankle: Array
    yaw: Array
    pitch: Array
    bend: Array
    phase: Array


def _stretched(angles: dict[str, Array], gain: float | Array) -> dict[str, Array]:
    """Scale the swing of legs, arms and pelvis for a longer (gain > 1) or shorter step."""
    out = dict(angles)
    for name, value in angles.items():
        if name.endswith(("hip_flexion", "shoulder_flexion")) or name in ("pelvis_yaw", "torso_z"):
            centre = value.mean()
            out[name] = centre + gain * (value - centre)
    return out


def _free_ankle(side: str, angles: dict[str, Array], body: Anatomy) -> Array:
    """Return the ankle relative to the pelvis joint, from the angles, in the path's frame (T, 3)."""
    pelvis = euler(angles["pelvis_yaw"], angles["pelvis_pitch"], angles["pelvis_roll"])
    thigh = pelvis @ _ball_joint(angles, f"{side}_hip")
    shank = thigh @ about(1, angles[f"{side}_knee_flexion"])
    return (
        apply(pelvis, body.rest[f"{side}_hip"])
        + apply(thigh, [0, 0, -body["thigh"]])
        + apply(shank, [0, 0, -body["shank"]])
    )


def _ball_joint(angles: dict[str, Array], joint: str) -> Array:
    """Return the rotation of a hip or shoulder, whose name includes the side."""
    sign = 1.0 if joint.startswith("l_") else -1.0
    return limb(angles[f"{joint}_flexion"], angles[f"{joint}_abduction"], angles[f"{joint}_rotation"], sign)


def _forward_speed(angles: dict[str, Array], timing: Timing, body: Anatomy, gain: float | Array) -> Array:
    """Return the speed at which the feet on the ground push the pelvis forward, smoothed, (T,) m/s."""
    total, weight = np.zeros(len(timing.time)), np.zeros(len(timing.time))
    for side in SIDES:
        phase = timing.of_side(side)
        p = phase % 1.0
        pitch = _pitch(side, timing, gain)
        rolled, _ = rolling_ankle(pitch, toe_bend(phase, pitch), body)
        still = _free_ankle(side, angles, body)[:, 0] - rolled
        share = smoothstep(p, 0.0, 0.12) * (1 - smoothstep(p, 0.48, TOE_OFF))
        total += share * -np.gradient(still, timing.step)
        weight += share
    if timing.toe_off < 0.5:
        return np.full(len(total), total.sum() / weight.sum())
    speed = total / np.maximum(weight, 1e-3)
    surge = 1 + _SURGE * np.cos(4 * np.pi * (timing.phase - 0.02))
    return _smoothed(speed, 0.35, timing) * surge


def _smoothed(value: Array, strides: float, timing: Timing) -> Array:
    """Return `value` (T,) filtered by a Gaussian whose standard deviation is a share of the stride."""
    per_stride = 1 / (timing.step * timing.stride_hz)
    return gaussian_filter1d(value, strides * per_stride, mode="nearest")


def _pitch(side: str, timing: Timing, gain: float | Array) -> Array:
    """Return the pitch of a foot; a spared foot pushes off less."""
    pitch = foot_pitch(timing.of_side(side), _pitch_gain(gain))
    return np.where(pitch < 0, pitch * (1 - _WEAK * max(timing.sparing(side), 0.0)), pitch)


def _pitch_gain(gain: float | Array) -> float | Array:
    """Return the factor of the foot's roll: it varies by a third as much as the step's, 0 without a step."""
    return np.minimum(1 + (gain - 1) / 3, 3 * np.asarray(gain)) if np.ndim(gain) else 1 + (gain - 1) / 3


def _stride_gain(angles: dict[str, Array], timing: Timing, body: Anatomy, speed: float) -> float:
    """Return the factor on the legs' swing that gives the mean speed."""

    def excess(gain: float) -> float:
        return float(_forward_speed(_stretched(angles, gain), timing, body, gain).mean()) - speed

    low, high = 0.35, 1.6
    if excess(low) > 0 or excess(high) < 0:
        cadence = float(np.gradient(timing.phase, timing.step).mean())
        slow, fast = excess(low) + speed, excess(high) + speed
        raise UsageError(
            f"speed {speed:.2f} m/s: at {cadence:.2f} strides/s and this stature it must be {slow:.2f} to "
            f"{fast:.2f} m/s; give another --speed or --stride-hz"
        )
    return float(brentq(excess, low, high, xtol=1e-4))


def _plan_foot(side: str, course: _Course, rng: np.random.Generator) -> _FootPlan:
    """Plant every step of one foot, and move the foot from each to the next."""
    phase = course.timing.of_side(side)
    pitch = _pitch(side, course.timing, course.gain)
    bend = toe_bend(phase, pitch)
    rel = _free_ankle(side, course.angles, course.body)
    rolled = rolling_ankle(pitch, bend, course.body)
    left = (1.0 if side == "l" else -1.0) * _HALF_WIDTH * course.body.stature * float(rng.uniform(0.7, 1.3))
    falls = _footfalls(side, course, course.along + rel[:, 0] - rolled[0], left, rng)
    ahead = np.column_stack([np.cos(course.heading), np.sin(course.heading)])
    stance = phase % 1.0 < TOE_OFF
    height = rel[:, 2] - (rel[:, 2] - rolled[1])[stance].mean()
    free = np.column_stack([course.path.point(course.along, left) + rel[:, :1] * ahead, height])
    ankle, yaw = foot_track(phase, free, course.timing.step, falls, rolled)
    stride = 1 / (course.timing.step * course.timing.usual_hz) if course.timing.usual_hz else None
    return _FootPlan(lift_swing(ankle, pitch, bend, phase, course.body, stride), yaw, pitch, bend, phase)


def _footfalls(
    side: str, course: _Course, place: Array, left: float, rng: np.random.Generator
) -> list[Footfall]:
    """Plant each step at the foot's mean position while it stands: `place` (T,) along the path, metres."""
    phase, stature = course.timing.of_side(side), course.body.stature
    toe_out = (1.0 if side == "l" else -1.0) * np.radians(rng.uniform(3, 9))
    steps = np.gradient(course.along, course.timing.step).mean() / course.timing.stride_hz / 2
    ahead = 0.5 * _AHEAD * course.timing.sparing(side) * steps
    falls = []
    for stride in range(int(np.ceil(phase[0])), int(np.floor(phase[-1] - TOE_OFF)) + 1):
        stance = (phase > stride) & (phase < stride + TOE_OFF)
        where = float(place[stance].mean()) - _LEAD * stature + ahead
        aside = left + 0.004 * stature * float(np.clip(rng.standard_normal(), -2, 2))
        yaw = float(course.path.direction(where) + toe_out + np.radians(1.5) * rng.standard_normal())
        falls.append(Footfall(stride, course.path.point(where, aside), yaw))
    return falls


def _pelvis_height(ground: Array, turn: Array, plans: dict[str, _FootPlan], course: _Course) -> Array:
    """Return a smooth height of the pelvis (T,) at which the legs reach every planted foot, metres."""
    timing, body = course.timing, course.body
    limit = np.full(len(ground), np.inf)
    for side, plan in plans.items():
        hip = apply(turn, body.rest[f"{side}_hip"])
        aside = np.linalg.norm(plan.ankle[:, :2] - ground - hip[:, :2], axis=1)
        p = plan.phase % 1.0
        yields = 1 - np.clip(_STRAIGHT * timing.sparing(side), 0, 1)
        reach = body.leg * np.where(p < TOE_OFF, _bent(p, yields), 1.0)
        highest = plan.ankle[:, 2] + np.sqrt(np.maximum(reach**2 - aside**2, 0)) - hip[:, 2]
        limit = np.minimum(limit, np.where((p < TOE_OFF) | (p > _LANDING), highest, np.inf))
    planted = np.flatnonzero(np.isfinite(limit))  # a run also flies
    limit = np.interp(np.arange(len(limit)), planted, limit[planted])
    height = _smoothed(limit, 0.045, timing)
    for _ in range(4):
        height -= _smoothed(np.maximum(height - limit, 0), 0.03, timing)
    return height


def _running_height(ground: Array, turn: Array, plans: dict[str, _FootPlan], course: _Course) -> Array:
    """Return the height of a runner's pelvis (T,), metres: legs bend by the angles; flight is free fall."""
    body, step = course.body, course.timing.step
    height, stands = np.zeros(len(ground)), np.zeros(len(ground), bool)
    for side, plan in plans.items():
        hip = apply(turn, body.rest[f"{side}_hip"])
        aside = np.linalg.norm(plan.ankle[:, :2] - ground - hip[:, :2], axis=1)
        knee, thigh, shank = course.angles[f"{side}_knee_flexion"], body["thigh"], body["shank"]
        length = thigh**2 + shank**2 + 2 * thigh * shank * np.cos(knee)
        up = np.sqrt(np.maximum(length - aside**2, 0))
        stance = plan.phase % 1.0 < TOE_OFF
        height[stance] = (plan.ankle[:, 2] + up - hip[:, 2])[stance]
        stands |= stance
    at = np.flatnonzero(stands)
    height = np.interp(np.arange(len(ground)), at, height[at])
    for a, b in zip(at, at[1:], strict=False):
        inside = np.arange(a + 1, b)
        height[inside] += 0.5 * _GRAVITY * step**2 * (inside - a) * (b - inside)
    return _smoothed(height, 0.01, course.timing)


def _carried(side: str, plan: _FootPlan, pelvis: Array, runs: Array, course: _Course) -> _FootPlan:
    """Return the plan of a foot that moves with the pelvis (T, 3), by the angles, while it swings.

    `runs`: share (T,) of this motion, which is a runner's.
    """
    p = plan.phase % 1.0
    window = runs * smoothstep(p, TOE_OFF, TOE_OFF + 0.1) * (1 - smoothstep(p, 0.85, 1.0))
    free = pelvis + apply(about(2, course.heading), _free_ankle(side, course.angles, course.body))
    return replace(plan, ankle=plan.ankle + window[:, None] * (free - plan.ankle))


def _bent(p: Array, yields: float) -> Array:
    """Return the target extension of a stance leg: yielding while it takes the load, then nearly straight."""
    load = smoothstep(p, 0.02, 0.13) * (1 - smoothstep(p, 0.18, 0.36))
    return _REACH - 0.0095 * yields * load


def _set(origins: Array, turns: Array, bone: str, origin: Array, turn: Array) -> None:
    origins[:, BONE_INDEX[bone]], turns[:, BONE_INDEX[bone]] = origin, turn


def _solve_leg(
    side: str, origins: Array, turns: Array, plan: _FootPlan, pelvis_yaw: Array, body: Anatomy
) -> None:
    """Set thigh, shank, foot and toes so that the ankle is where the foot's plan requires it."""
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
