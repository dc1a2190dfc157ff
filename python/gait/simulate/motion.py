"""Motions in a clip other than walking straight: stopping, standing, backwards, turning, running.

A stop slows the gait's clock until both feet are on the ground, while steps get shorter, so that the feet
come together; a start is the reverse.  Walking backwards is a walk in reversed time.  A walk that accelerates
has faster and longer steps, and becomes a run at a heel strike, from which feet leave the ground earlier.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import gaussian_filter1d

from gait.simulate.curves import Curves
from gait.simulate.geometry import Array
from gait.simulate.walk import Faster, Timing, Walk, smoothstep

WALK, STAND, BACKWARDS, RUN, ACCELERATE = "walk", "stand", "backwards", "run", "accelerate"
_RAMP = 0.8  # seconds from walking to standing
_SHORTER = 0.3  # seconds before that, when steps begin to get shorter
_BOTH_FEET = 0.06  # phase, modulo half a stride, with both feet on the ground
_SPEEDING = 2.0  # seconds from the pace of a walk to that of a run
_BLEND = 0.6  # strides from the first running strike, in which the posture changes
_MOVES = 0.25  # share of the usual stride rate above which a person walks rather than stands
# movements of arms, trunk and head while standing, degrees and seconds
_IDLE = {"l_shoulder_flexion": 7, "r_shoulder_flexion": 7, "l_elbow_flexion": 10, "r_elbow_flexion": 10,
         "torso_z": 4, "torso_y": 2, "neck_z": 12, "neck_y": 4}  # fmt: skip
_IDLE_TIME = 0.6
_LEGS = {"hip_flexion": 3.0, "knee_flexion": 5.0}  # standing, degrees
#: When a person stops and continues, as fractions of the clip.
_STOPS = {"stop": (0.35, 0.75), "stand": (-0.15, 1.15)}


@dataclass(frozen=True)
class Pause:
    """A stop on the time grid."""

    timing: Timing
    clock: Array  #: (T,) time in the walk without the stop, seconds
    share: Array  #: (T,) stride rate over the usual one
    amplitude: Array  #: (T,) of the steps: 1 walking, 0 feet together


def pause(timing: Timing, motion: str, frames: int) -> Pause | None:
    """Return the stop of a motion in a walk of this timing; None for motions without one."""
    if motion not in _STOPS:
        return None
    length = frames * timing.per_frame * timing.step
    stop, go = (share * length for share in _STOPS[motion])
    phase = timing.phase
    aligned = np.abs((phase - _BOTH_FEET + 0.25) % 0.5 - 0.25)  # 0 when both feet are on the ground
    lowest = (aligned[1:-1] < aligned[:-2]) & (aligned[1:-1] <= aligned[2:])
    best = timing.time[1:-1][lowest].tolist()
    usable = [t for t in best if t - timing.time[0] > _RAMP + _SHORTER]
    end = min(usable, key=lambda t: abs(t + 0.5 * _RAMP - stop)) + 0.5 * _RAMP  # the clock lags half a ramp
    go = max(go, end + 0.2)
    share = 1 - smoothstep(timing.time, end - _RAMP, end) + smoothstep(timing.time, go, go + _RAMP)
    # before the ramp, walking time is clip time
    at = int(np.searchsorted(timing.time, end - _RAMP))
    clock = cumulative_trapezoid(share, timing.time, initial=0)
    clock += timing.time[at] - clock[at]
    amplitude = 1 - smoothstep(timing.time, end - _RAMP - _SHORTER, end)
    amplitude += smoothstep(timing.time, go, go + _RAMP + _SHORTER)
    warped = replace(
        timing,
        phase=np.interp(clock, timing.time, phase),
        scores=np.stack([np.interp(clock, timing.time, row) for row in timing.scores.T], axis=1),
        usual_hz=timing.stride_hz,
    )
    return Pause(warped, clock, share, amplitude)


def posture(angles: dict[str, Array], stop: Pause, rng: np.random.Generator) -> dict[str, Array]:
    """Blend the angles of the walk into standing: legs straight, arms, trunk and head move a little."""
    still, out = 1 - stop.amplitude, {}
    for name, walking in angles.items():
        kind = name[2:] if name[1] == "_" else name
        standing = np.radians(_LEGS[kind]) if kind in _LEGS else walking[stop.share == 1].mean()
        if name in _IDLE:
            drawn = gaussian_filter1d(rng.standard_normal(len(still)), _IDLE_TIME / stop.timing.step)
            standing = standing + np.radians(_IDLE[name]) * drawn / drawn.std()
        out[name] = walking + still * (standing - walking)
    return out


def accelerate(timing: Timing, run_timing: Timing, speeds: tuple[float, float], run: Curves) -> Faster:
    """Return how a walk of this timing becomes a run near the middle of the clip, at a right heel strike.

    `run_timing`: of a run on the same grid; `speeds` of walk and run, m/s.
    """
    time = timing.time
    middle = 0.5 * (time[0] + time[-1])
    cadence = run_timing.stride_hz / timing.stride_hz
    rate = np.gradient(timing.phase, timing.step) * (1 + (cadence - 1) * _pace_share(time, middle))
    phase = timing.phase[0] + cumulative_trapezoid(rate, dx=timing.step, initial=0)
    strike = float(np.round(np.interp(middle, time, phase)))
    at = float(np.interp(strike, phase, time))
    speed = speeds[0] + (speeds[1] - speeds[0]) * _pace_share(time, at)
    changed = replace(timing, phase=phase, usual_hz=timing.stride_hz, runs_from=strike)
    runs = smoothstep(phase, strike, strike + _BLEND)
    return Faster(changed, run, run_timing, speeds[1], runs, speed)


def _pace_share(time: Array, at: float) -> Array:
    """Return the share of the way (T,) from the pace of a walk to that of a run, halfway at `at`."""
    return smoothstep(time, at - 0.5 * _SPEEDING, at + 0.5 * _SPEEDING)


def reversed_in_time(walk: Walk) -> Walk:
    """Return a walk in reversed time: the body faces forwards and moves backwards."""
    timing = replace(walk.timing, phase=walk.timing.phase[::-1], scores=walk.timing.scores[::-1])
    return replace(
        walk,
        timing=timing,
        origins=walk.origins[::-1],
        turns=walk.turns[::-1],
        heading=walk.heading[::-1],
        pelvis_yaw=walk.pelvis_yaw[::-1],
        speed=-walk.speed[::-1],
    )


def classes(motion: str, stop: Pause | None, timing: Timing) -> list[str]:
    """Return the class of motion at each step of the time grid of a walk's timing."""
    if stop is None:
        usual = motion if motion in (BACKWARDS, RUN) else WALK
        return [RUN if runs else usual for runs in (timing.phase >= timing.runs_from).tolist()]
    return [WALK if moving else STAND for moving in (stop.share > _MOVES).tolist()]
