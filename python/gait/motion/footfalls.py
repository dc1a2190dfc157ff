"""Where and when the feet of a tracked walker meet and leave the ground.

Strikes are where the heel is furthest ahead of the pelvis along the walking direction, toe-offs where the
toe is furthest behind it (Zeni et al. 2008, Gait & Posture 27:710).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gait.io.track_file import Joints
from gait.motion.events import furthest, walking_direction

Array = NDArray[np.float64]
SIDES = ("right", "left")

_STANCE = np.linspace(0.10, 0.30, 5)  # of a stride after the strike: the foot is flat
_NEAR = 0.25  # seconds: further apart two events are not the same


@dataclass(frozen=True)
class Events:
    """Strikes and toe-offs of both feet, seconds, each increasing.

    Attributes
    ----------
    strike, off : dict of str to ndarray of shape (k,)
        By side, "right" or "left".
    """

    strike: dict[str, Array]
    off: dict[str, Array]

    @property
    def count(self) -> int:
        """How many there are."""
        return sum(len(times) for kind in (self.strike, self.off) for times in kind.values())


@dataclass(frozen=True)
class Contacts:
    """Contacts of one foot with the ground; leading axes (...) may run over draws.

    Attributes
    ----------
    strike, off : ndarray of shape (..., k)
        Seconds; `off` ends the contact that `strike` begins, NaN where it was not seen.
    place : ndarray of shape (..., k, 3)
        Heel while the foot is flat, metres, world; NaN where the track ends before.
    pelvis : ndarray of shape (..., k, 3)
        At the strike.
    """

    strike: Array
    off: Array
    place: Array
    pelvis: Array


def find_events(joints: Joints) -> Events:
    """Find the strikes and toe-offs of a motion of at least three frames."""
    ahead, pelvis = walking_direction(joints), joints.places["pelvis"]
    strike, off = {}, {}
    for side in SIDES:
        heel, toe = (joints.places[f"{side[0]}_{part}"] - pelvis for part in ("heel", "toe"))
        strike[side] = furthest(joints.time, np.sum(heel * ahead, axis=1))
        off[side] = furthest(joints.time, -np.sum(toe * ahead, axis=1))
    return Events(strike, off)


def same_events(found: Events, wanted: Events) -> Events:
    """Return those of `found` that `wanted` has, in its order; NaN where there is none."""

    def pick(have: Array, want: Array) -> Array:
        if not len(have):
            return np.full(len(want), np.nan)
        nearest = have[np.argmin(np.abs(have[:, None] - want), axis=0)] if len(want) else np.zeros(0)
        return np.where(np.abs(nearest - want) <= _NEAR, nearest, np.nan)

    return Events(
        {side: pick(found.strike[side], wanted.strike[side]) for side in SIDES},
        {side: pick(found.off[side], wanted.off[side]) for side in SIDES},
    )


def contacts(joints: Joints, events: Events, side: str, stride: float) -> Contacts:
    """Contacts of one foot.

    Parameters
    ----------
    joints : Joints
    events : Events
    side : str
        "right" or "left".
    stride : float
        Seconds of a stride, about.
    """
    strike = events.strike[side]
    return Contacts(
        strike=strike,
        off=_offs(strike, events.off[side], stride),
        place=_flat(joints.time, joints.places[f"{side[0]}_heel"], strike, stride),
        pelvis=at(joints.time, joints.places["pelvis"], strike),
    )


def at(time: Array, values: Array, when: Array) -> Array:
    """Values (n, d) linear in time at `when` (k,): shape (k, d)."""
    return np.stack([np.interp(when, time, column) for column in values.T], axis=-1)


def stride_time(events: Events) -> float:
    """Return the median time between strikes of one foot, seconds; NaN if no foot strikes twice."""
    gaps = np.concatenate([np.diff(events.strike[side]) for side in SIDES])
    return float(np.median(gaps)) if len(gaps) else float("nan")


def stack(draws: list[Contacts]) -> Contacts:
    """Contacts of many draws as one, shape (draws, ...)."""
    names = ("strike", "off", "place", "pelvis")
    return Contacts(**{name: np.stack([getattr(draw, name) for draw in draws]) for name in names})


def _offs(strike: Array, off: Array, stride: float) -> Array:
    """First toe-off within a stride after each strike."""
    out = np.full(len(strike), np.nan)
    for k, begun in enumerate(strike):
        after = off[(off > begun) & (off < begun + 0.9 * stride)]
        if len(after):
            out[k] = after[0]
    return out


def _flat(time: Array, heel: Array, strike: Array, stride: float) -> Array:
    """Mean of the heel while the foot is flat, as far as the track goes."""
    out = np.full((len(strike), 3), np.nan)
    for k, begun in enumerate(strike):
        when = begun + stride * _STANCE
        when = when[when <= time[-1]]
        if len(when):
            out[k] = at(time, heel, when).mean(axis=0)
    return out
