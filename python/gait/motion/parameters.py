"""Gait parameters of a track, each with its uncertainty: strides, steps, stance, symmetry.

Uncertainty is carried by draws: contacts of the feet drawn from the posterior, from which every parameter is
computed again; the standard deviation over the draws is reported.  See `gait.motion.footfall_draws`.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.errors import UserError
from gait.io.track_file import Track
from gait.motion.footfall_draws import Draws, draw_contacts
from gait.motion.footfalls import SIDES, Contacts, Events, contacts, find_events, stride_time

Array = NDArray[np.float64]

QUANTITIES = {
    "stride_time_s": "stride time, s",
    "cadence_spm": "cadence, steps/min",
    "stride_length_m": "stride length, m",
    "speed_m_s": "speed, m/s",
    "step_time_s": "step time, s",
    "step_length_m": "step length, m",
    "step_width_m": "step width, m",
    "stance_percent": "stance, % of the stride",
    "double_support_percent": "double support, % of the stride",
}
"""Names in files, with the words for people."""

MIRRORED = ("step_time_s", "step_length_m", "stance_percent")
"""Quantities whose left and right are compared."""


@dataclass(frozen=True)
class Strides:
    """Strides of one foot, from strike to strike.

    Attributes
    ----------
    side : str
        "right" or "left".
    start, end : ndarray of shape (k,)
        Seconds.
    values, sd : dict of str to ndarray of shape (k,)
        `QUANTITIES` and their standard deviations; NaN where the track does not show one.
    draws : dict of str to ndarray of shape (D, k)
        The same of every draw.
    sure : ndarray of bool, shape (k,)
        No frame of the stride was lost or ambiguous.
    """

    side: str
    start: Array
    end: Array
    values: dict[str, Array]
    sd: dict[str, Array]
    draws: dict[str, Array]
    sure: NDArray[np.bool_]


@dataclass(frozen=True)
class Parameters:
    """What `measure` finds.

    Attributes
    ----------
    events, event_sd : Events
        Strikes and toe-offs, seconds.
    strides : dict of str to Strides
        By side.
    source : str
        Where the uncertainty comes from, in words.
    """

    events: Events
    event_sd: Events
    strides: dict[str, Strides]
    source: str

    def summary(self) -> dict[str, dict[str, Any]]:
        """Means over the sure strides: by quantity, for right, left and both feet.

        Each is ``{"mean", "sd", "between"}``: the mean, its standard deviation, and the standard deviation
        between strides; ``"asymmetry_percent"`` is 200 (right - left) / (right + left) (Robinson 1987).
        """
        out = {}
        for name in QUANTITIES:
            row: dict[str, Any] = {side: self._mean(name, (side,)) for side in SIDES}
            row["both"] = self._mean(name, SIDES)
            if name in MIRRORED:
                row["asymmetry_percent"] = self._asymmetry(name)
            out[name] = row
        return out

    def _sure(self, name: str, sides: tuple[str, ...]) -> tuple[Array, Array]:
        """Values (k,) and draws (D, k) of the sure strides of the feet."""
        chosen = [self.strides[side] for side in sides]
        values = np.concatenate([s.values[name][s.sure] for s in chosen])
        draws = np.concatenate([s.draws[name][:, s.sure] for s in chosen], axis=1)
        seen = np.isfinite(values)
        return values[seen], draws[:, seen]

    def _mean(self, name: str, sides: tuple[str, ...]) -> dict[str, float] | None:
        values, draws = self._sure(name, sides)
        if not len(values):
            return None
        between = float(values.std(ddof=1)) if len(values) > 1 else float("nan")
        return {"mean": float(values.mean()), "sd": float(_sd(_mean(draws, 1))), "between": between}

    def _asymmetry(self, name: str) -> dict[str, float] | None:
        right, left = (self._sure(name, (side,)) for side in SIDES)
        if not len(right[0]) or not len(left[0]):
            return None

        def index(r: Array, m: Array) -> Array:
            return 200 * (r - m) / (r + m)

        value = index(right[0].mean(), left[0].mean())
        return {"mean": float(value), "sd": float(_sd(index(_mean(right[1], 1), _mean(left[1], 1))))}


def measure(track: Track, draws: Draws | None = None) -> Parameters:
    """Gait parameters of a track.

    Parameters
    ----------
    track : Track
        Of at least three frames.
    draws : Draws, optional
        Motions drawn from the posterior; without them the deviations of the track serve.

    Raises
    ------
    UserError
        If no foot strikes twice in the track.
    """
    if len(track.frame) < 3:
        raise UserError("has fewer than three frames; track at least two strides")
    events = find_events(track)
    stride = stride_time(events)
    if not np.isfinite(stride):
        seconds = track.time[-1] - track.time[0]
        raise UserError(f"has no whole stride in {seconds:.2f} s; track at least two strides")
    feet = {side: contacts(track, events, side, stride) for side in SIDES}
    drawn, event_sd, source = draw_contacts(track, events, feet, stride, draws)
    strides = {}
    for side, other in (SIDES, SIDES[::-1]):
        between = _between(feet[side].strike, feet[other].strike)
        values = stride_quantities(feet[side], feet[other], between)
        many = stride_quantities(drawn[side], drawn[other], between)
        start, end = feet[side].strike[:-1], feet[side].strike[1:]
        whole = (end - start > 0.6 * stride) & (end - start < 1.6 * stride)  # no strike was missed
        strides[side] = Strides(
            side,
            start[whole],
            end[whole],
            {name: value[whole] for name, value in values.items()},
            {name: _sd(value[:, whole]) for name, value in many.items()},
            {name: value[:, whole] for name, value in many.items()},
            np.array([_is_sure(track, *ends) for ends in zip(start, end, strict=True)], bool)[whole],
        )
    return Parameters(events, event_sd, strides, source)


def stride_quantities(foot: Contacts, other: Contacts, between: NDArray[np.int64]) -> dict[str, Array]:
    """`QUANTITIES` of the strides of a foot, shape (..., k - 1) for k strikes.

    The step is the one that ends the stride: from the other foot's strike within it.

    Parameters
    ----------
    foot, other : Contacts
        Of the foot and of the other one, with the same leading axes.
    between : ndarray of int, shape (k - 1,)
        Which strike of the other foot lies within each stride; -1: none.
    """
    start, end = foot.strike[..., :-1], foot.strike[..., 1:]
    middle, last_off = _pick(other.strike, between), _pick(other.off, np.where(between > 0, between - 1, -1))
    time = end - start
    way = foot.pelvis[..., 1:, :2] - foot.pelvis[..., :-1, :2]
    length = np.linalg.norm(way, axis=-1)
    ahead = way / np.maximum(length, 1e-9)[..., None]
    stride = foot.place[..., 1:, :2] - foot.place[..., :-1, :2]
    step = foot.place[..., 1:, :2] - _pick(other.place, between, -2)[..., :2]
    aside = ahead[..., 0] * step[..., 1] - ahead[..., 1] * step[..., 0]
    return {
        "stride_time_s": time,
        "cadence_spm": 120 / time,
        "stride_length_m": np.sum(stride * ahead, axis=-1),
        "speed_m_s": length / time,
        "step_time_s": end - middle,
        "step_length_m": np.sum(step * ahead, axis=-1),
        "step_width_m": np.abs(aside),
        "stance_percent": 100 * (foot.off[..., :-1] - start) / time,
        "double_support_percent": 100 * (last_off - start + foot.off[..., :-1] - middle) / time,
    }


def _pick(values: Array, index: NDArray[np.int64], axis: int = -1) -> Array:
    """`values` at `index` along an axis; NaN where the index is -1."""
    shape = list(values.shape)
    shape[axis] = 1
    padded = np.concatenate([values, np.full(shape, np.nan)], axis=axis)
    return np.asarray(np.take(padded, index, axis=axis))


def _between(strike: Array, other: Array) -> NDArray[np.int64]:
    """Index of the first strike of the other foot within each stride; -1: none."""
    first = np.searchsorted(other, strike[:-1], side="right")
    inside = (first < len(other)) & (np.append(other, np.inf)[first] < strike[1:])
    return np.where(inside, first, -1)


def _is_sure(track: Track, start: float, end: float) -> bool:
    inside = (track.time >= start) & (track.time <= end)
    return not {"lost", "ambiguous"} & {track.status[i] for i in np.flatnonzero(inside)}


def _mean(values: Array, axis: int) -> Array:
    """Mean of what is there."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of nothing: NaN
        return np.asarray(np.nanmean(values, axis=axis))


def _sd(draws: Array) -> Array:
    """Return the standard deviation over the first axis; NaN where fewer than half of the draws have one."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        sd = np.nanstd(draws, axis=0)
    return np.where(np.isfinite(draws).mean(axis=0) >= 0.5, sd, np.nan)
