"""Feet on the ground: how a planted foot rolls, where each step lands, and the swing between two steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from gait.simulate.anatomy import Anatomy
from gait.simulate.arrays import Array

TOE_OFF = 0.625  # share of the cycle

# pitch of the foot, degrees, toes up positive
_PITCH_PHASE = (0, 0.03, 0.065, 0.10, 0.34, 0.43, 0.50, 0.56, 0.61, 0.66, 0.71, 0.77, 0.83, 0.88, 0.93, 0.97)
_PITCH_DEG = (20, 13, 4, 0, 0, -5, -15, -34, -56, -67, -60, -38, -11, 8, 18, 20.5)
# bend of the toes against the foot, as a share of its downward pitch: flat on the ground, then rolling off
_BEND_PHASE = (0, 0.50, 0.56, 0.60, 0.625, 0.66, 0.70, 0.75, 0.85)
_BEND_SHARE = (1, 1, 0.88, 0.67, 0.55, 0.38, 0.20, 0.05, 0)


def _periodic(phase: tuple[float, ...], value: tuple[float, ...]) -> PchipInterpolator:
    """Interpolate without overshoot over three cycles, so that the middle one is periodic."""
    p = np.asarray(phase)
    return PchipInterpolator(np.concatenate([p - 1, p, p + 1]), np.tile(value, 3))


_PITCH = _periodic(_PITCH_PHASE, _PITCH_DEG)
_BEND = _periodic(_BEND_PHASE, _BEND_SHARE)


def foot_pitch(phase: Array, gain: float) -> Array:
    """Return the pitch of the foot (toes up positive), radians, at phases of that foot (unwrapped)."""
    return np.radians(gain * _PITCH(phase % 1.0))


def toe_bend(phase: Array, pitch: Array) -> Array:
    """Return how far the toes bend up against the foot, radians."""
    return np.maximum(-pitch, 0) * _BEND(phase % 1.0)


def smoothstep(x: Array, low: float, high: float) -> Array:
    """Return 0 below `low`, 1 above `high`, a smooth cubic between."""
    u = np.clip((np.asarray(x) - low) / (high - low), 0, 1)
    return u * u * (3 - 2 * u)


def rolling_ankle(pitch: Array, bend: Array, body: Anatomy) -> tuple[Array, Array]:
    """Return the ankle of a planted foot, forward and up of the ground under the flat foot's ankle, metres.

    The foot turns about its heel while the toes are up, then about its ball, last about the tip of the toes.
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
    """One planted step.

    Attributes
    ----------
    stride : int
        The foot's stride number: it is on the ground from phase `stride` to `stride` + TOE_OFF.
    place : ndarray of shape (2,)
        Ground under the ankle of the flat foot, world, metres.
    yaw : float
        Direction of the foot, radians.
    """

    stride: int
    place: Array
    yaw: float


def foot_track(
    phase: Array, free: Array, step: float, falls: list[Footfall], rolled: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return the ankle (T, 3) and the yaw (T,) of a foot that stays where it is planted.

    Parameters
    ----------
    phase : ndarray of shape (T,)
        Unwrapped phase of this foot.
    free : ndarray of shape (T, 3)
        Ankle as the joint angles alone would carry it; gives the swing its shape.
    step : float
        Grid step, seconds.
    falls : list of Footfall
        Consecutive steps.
    rolled : two ndarrays of shape (T,)
        The planted ankle, from `rolling_ankle`.
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
    """Bend the free swing so that it leaves and meets the planted foot with equal place and velocity."""
    ends = np.array([first, last])
    offset = ankle[ends] - free[ends]
    before = (ankle[first] - ankle[first - 2] - free[first] + free[first - 2]) / (2 * step)
    after = (ankle[last + 2] - ankle[last] - free[last + 2] + free[last]) / (2 * step)
    inside = np.arange(first + 1, last)
    bend = CubicHermiteSpline(ends * step, offset, np.array([before, after]))
    ankle[inside] = free[inside] + bend(inside * step)


def lift_swing(ankle: Array, pitch: Array, bend: Array, phase: Array, body: Anatomy) -> Array:
    """Raise a swinging foot (T, 3) smoothly where its sole would come within 12 mm of the ground."""
    sole = np.min(
        [point_height(ankle[:, 2], pitch, bend, name, body) for name in ("heel", "ball", "tip")], axis=0
    )
    p = phase % 1.0
    window = smoothstep(p, TOE_OFF, TOE_OFF + 0.10) * (1 - smoothstep(p, 0.92, 1.0))
    lack = np.maximum(0.012 - sole, 0) * window
    stride = len(phase) / (phase[-1] - phase[0])
    broad = gaussian_filter1d(maximum_filter1d(lack, int(0.10 * stride)), 0.05 * stride)
    raised = ankle.copy()
    raised[:, 2] += broad * window
    return raised


def point_height(ankle_z: Array, pitch: Array, bend: Array, name: str, body: Anatomy) -> Array:
    """Return the height of the sole under the heel, the ball or the tip of the toes, metres."""
    c, s = np.cos(pitch), np.sin(pitch)
    if name == "heel":
        return ankle_z - body["heel_back"] * s - body["ankle_height"] * c
    ball = ankle_z + body["ball_forward"] * s - body["ankle_height"] * c
    if name == "ball":
        return ball
    return ball + (body["toe_forward"] - body["ball_forward"]) * np.sin(pitch + bend)
