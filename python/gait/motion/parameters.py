"""Gait parameters and joint-angle cycles of a track, with uncertainties, and their files.

Contacts of the feet are drawn from the posterior (`gait.motion.uncertainty`), every parameter is computed
from each draw, and its standard deviation is that over the draws.
"""

from __future__ import annotations

import csv
import json
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.body.model_curves import ModelCurves
from gait.body.motion_classes import class_names, class_sections, first_class
from gait.errors import UserError
from gait.io.track_file import Joints, Track
from gait.motion.footfalls import (
    LONGEST_CYCLE,
    STRIKE_SIDES,
    Contacts,
    Draws,
    Events,
    contacts,
    find_events,
    stride_time,
    walking_direction,
)
from gait.motion.uncertainty import draw_contacts

Array = NDArray[np.float64]

PARAMETER_LABELS = {
    "stride_time_s": "stride time, s",
    "cadence_spm": "cadence, steps/min",
    "stride_length_m": "stride length, m",
    "speed_m_s": "speed, m/s",
    "step_time_s": "step time, s",
    "step_length_m": "step length, m",
    "step_width_m": "step width, m",
    "foot_clearance_m": "foot clearance, m",
    "stance_percent": "stance, % of the stride",
    "double_support_percent": "double support, % of the stride",
}
"""Names in files, with names and units for people."""

_UNSURE_STATUSES = {"lost", "ambiguous"}
_LONGEST_FLIGHT = 0.25  # of a stride, from one foot's toe-off to the other's strike; longer: one was missed
_STEADY = 0.8  # of the median speed; at the ends of a walk, slower strides are starting or stopping
#: Degrees by which the heading or the path turns between the strikes of a stride in a turn.  On an arc, a
#: stride of 1.3 m that turns by this departs from its chord by 5.7 cm, which the step width contains, more
#: than the sd among people (4.5 cm).  Straight walks turn by up to 17 degrees in tracks (decisions.md).
_TURN_DEG = 20.0
_LEAST_WAY_M = 0.3  # metres that the pelvis moves in a stride; with less, its path has no direction
LEFT_OUT = {
    "uncertain": "uncertain",
    "stand": "beside a stand",
    "class": "not of class {}",
    "turn": "in a turn",
    "slow": "while starting or stopping",
}
"""Why a stride does not count, in the order of the checks, with words for people.

Some of its frames are ambiguous or lost (only lost, if no stride is without); it begins or ends less than a
step from a stand; it is of another class than the most frequent one; the person turns in it
(unless it does in all that are left); or it is much slower than the median, at the end of a walk.
"""
MIRRORED_PARAMETERS = ("step_time_s", "step_length_m", "stance_percent")
"""Quantities for which left and right are compared."""


@dataclass(frozen=True)
class Strides:
    """Strides of one foot, from strike to strike."""

    side: str  #: "right" or "left"
    #: (k,) seconds.
    start: Array
    end: Array
    #: (k,) `PARAMETER_LABELS` and their standard deviations; NaN where the track does not show them.
    values: dict[str, Array]
    sd: dict[str, Array]
    draws: dict[str, Array]  #: (D, k) `PARAMETER_LABELS` in each draw
    sure: NDArray[np.bool_]  #: (k,) none of its frames is lost or ambiguous
    #: (k,) Why the stride does not count for the means, one of `LEFT_OUT`, or "" if it counts.
    left_out: NDArray[np.str_]
    #: Class of motion of each stride, or "" if it changes; empty if the track has none.
    motion_class: Sequence[str] = ()

    @property
    def counts(self) -> NDArray[np.bool_]:
        """Whether the stride counts for the means, (k,)."""
        return np.asarray(self.left_out == "")

    def leave_out(self, which: NDArray[np.bool_], why: str) -> None:
        """Leave out those strides of `which` (k,) that still count; `why`: one of `LEFT_OUT`."""
        self.left_out[which & self.counts] = why


@dataclass(frozen=True)
class Parameters:
    """Result of `measure`."""

    #: Strikes and toe-offs, seconds.
    events: Events
    event_sd: Events
    strides: dict[str, Strides]  #: by side
    source: str  #: where the uncertainty comes from, in words
    all_unsure: bool = False  #: every stride has ambiguous frames; those that were not lost count
    all_turn: bool = False  #: every stride that counts is in a turn
    runs: bool = False  #: the person runs in some frames, for which no toe-offs are known
    motion_class: str = ""  #: of the strides that count, the most frequent; "" if the track has no classes

    @property
    def counting(self) -> int:
        """Number of strides of both feet that count."""
        return int(sum(s.counts.sum() for s in self.strides.values()))

    @property
    def others(self) -> int:
        """Number of strides that do not count because they are of another class."""
        return self._number("class")

    @property
    def speed(self) -> float | None:
        """Mean over the strides of both feet that count, metres per second."""
        found = self._mean("speed_m_s", STRIKE_SIDES)
        return None if found is None else found["mean"]

    def counted(self) -> str:
        """Describe the strides over which the means are taken."""
        right, left = (int(self.strides[side].counts.sum()) for side in STRIKE_SIDES)
        why = self._not_counted()
        return f"{right} right and {left} left strides" + (f" (not counted: {why})" if why else "")

    def warning(self) -> str:
        """Return what is missing or cannot be relied on, in sentences; empty if nothing is."""
        found = []
        if not self.counting:
            found.append(f"No stride counts, so there are no means: {self._not_counted()}.")
        elif self.all_unsure:
            found.append(
                "Every stride has uncertain frames. The values are means over these strides anyway: left and "
                "right may be swapped, or the figure may be off."
            )
        if self.all_turn:
            found.append(
                f"Every stride is in a turn of more than {_TURN_DEG:.0f} degrees. The values are means over "
                "these strides anyway; norms are those of straight walks."
            )
        if self.runs:
            found.append(
                "Toe-offs, stance and double support are not given for runs, in which the foot leaves the "
                "floor before the toe is furthest back."
            )
        return " ".join(found)

    def _number(self, why: str) -> int:
        return int(sum((s.left_out == why).sum() for s in self.strides.values()))

    def _not_counted(self) -> str:
        words = LEFT_OUT | {"class": LEFT_OUT["class"].format(self.motion_class)}
        words |= {} if self.motion_class else {"class": "in which the class changes"}
        return ", ".join(f"{self._number(why)} {words[why]}" for why in LEFT_OUT if self._number(why))

    def summary(self) -> dict[str, dict[str, Any]]:
        """Compute means over the strides that count: by quantity, for right, left and both feet.

        Each is ``{"mean", "sd", "between"}``: the mean, its standard deviation, and the standard deviation
        between strides; ``"asymmetry_percent"`` is 200 (right - left) / (right + left) (Robinson 1987).
        """
        out = {}
        for name in PARAMETER_LABELS:
            row: dict[str, Any] = {side: self._mean(name, (side,)) for side in STRIKE_SIDES}
            row["both"] = self._mean(name, STRIKE_SIDES)
            if name in MIRRORED_PARAMETERS:
                row["asymmetry_percent"] = self._asymmetry(name)
            out[name] = row
        return out

    def _counting(self, name: str, sides: tuple[str, ...]) -> tuple[Array, Array]:
        """Return values (k,) and draws (D, k) of a quantity in the strides of some feet that count."""
        chosen = [self.strides[side] for side in sides]
        values = np.concatenate([s.values[name][s.counts] for s in chosen])
        draws = np.concatenate([s.draws[name][:, s.counts] for s in chosen], axis=1)
        seen = np.isfinite(values)
        return values[seen], draws[:, seen]

    def _mean(self, name: str, sides: tuple[str, ...]) -> dict[str, float] | None:
        values, draws = self._counting(name, sides)
        if not len(values):
            return None
        between = float(values.std(ddof=1)) if len(values) > 1 else float("nan")
        return {"mean": float(values.mean()), "sd": float(sd_of(mean_of(draws, 1))), "between": between}

    def _asymmetry(self, name: str) -> dict[str, float] | None:
        right, left = (self._counting(name, (side,)) for side in STRIKE_SIDES)
        if not len(right[0]) or not len(left[0]):
            return None

        value = asymmetry(right[0].mean(), left[0].mean())
        return {
            "mean": float(value),
            "sd": float(sd_of(asymmetry(mean_of(right[1], 1), mean_of(left[1], 1)))),
        }


def asymmetry(right: Array, left: Array) -> Array:
    """Return 200 (right - left) / (right + left), per cent (Robinson 1987)."""
    return 200 * (right - left) / (right + left)


def measure(track: Track, draws: Draws | None = None) -> Parameters:
    """Measure the gait parameters of a track.

    `track`: at least three frames. `draws`: motions drawn from the posterior; without them the standard
    deviations of the track are used. UserError if no foot strikes twice in a walk of the track.
    """
    if len(track.frame) < 3:
        raise UserError("has fewer than three frames; track at least two strides")
    events = find_events(track)
    stride = stride_time(events)
    if not np.isfinite(stride):
        seconds = track.time[-1] - track.time[0]
        stood = ", as the person stood throughout" if track.stands.all() else ""
        raise UserError(f"has no whole stride in {seconds:.2f} s{stood}; track at least two strides")
    feet = {side: contacts(track, events, side, stride) for side in STRIKE_SIDES}
    drawn, event_sd, source = draw_contacts(track, events, stride, draws)
    strides = {}
    for side, other in (STRIKE_SIDES, STRIKE_SIDES[::-1]):
        between = _between(feet[side].strike, feet[other].strike)
        values = stride_quantities(feet[side], feet[other], between)
        many = stride_quantities(drawn[side], drawn[other], between)
        whole = _whole(events, side, stride)
        start, end = feet[side].strike[:-1][whole], feet[side].strike[1:][whole]
        strides[side] = Strides(
            side,
            start,
            end,
            {name: value[whole] for name, value in values.items()},
            {name: sd_of(value[:, whole]) for name, value in many.items()},
            {name: value[:, whole] for name, value in many.items()},
            np.array(
                [_is_free(track, _UNSURE_STATUSES, *ends) for ends in zip(start, end, strict=True)], bool
            ),
            _counting(len(start)),
            [_class_of(track, *ends) for ends in zip(start, end, strict=True)] if track.motion_class else [],
        )
    none_sure = not any(s.sure.any() for s in strides.values())
    for s in strides.values():
        # Better than nothing, since left and right seldom swap in only some frames.
        lost = [not _is_free(track, {"lost"}, *ends) for ends in zip(s.start, s.end, strict=True)]
        s.leave_out(np.array(lost, bool) if none_sure else ~s.sure, "uncertain")
        s.leave_out(_beside_stand(s, events, stride / 2), "stand")
    motion_class = _leave_out_other_classes(strides)
    all_turn = _leave_out_turns(strides, track, stride)
    _leave_out_slow(strides, events)
    runs = bool(track.runs.any())
    return Parameters(events, event_sd, strides, source, none_sure, all_turn, runs, motion_class)


def _counting(number: int) -> NDArray[np.str_]:
    """`Strides.left_out` of strides that all count."""
    return np.full(number, "", f"U{max(map(len, LEFT_OUT))}")


def _class_of(track: Track, start: float, end: float) -> str:
    """Return the class of motion in all frames of a stride that have one; "" if it changes."""
    inside = np.flatnonzero((track.time >= start) & (track.time <= end))
    found = {track.motion_class[i] for i in inside} - {""}
    return found.pop() if len(found) == 1 else ""


def _beside_stand(strides: Strides, events: Events, step: float) -> NDArray[np.bool_]:
    """Which strides begin less than a step (seconds) after a stand, or end less than a step before one."""
    walk = events.walk(strides.start)
    stood = np.append(-np.inf, events.stands[:, 1])[walk]
    stands = np.append(events.stands[:, 0], np.inf)[walk]
    return np.asarray((strides.start - stood < step) | (stands - strides.end < step))


def _leave_out_other_classes(strides: Mapping[str, Strides]) -> str:
    """Leave out strides of all but the most frequent class; return that class."""
    if not any(s.motion_class for s in strides.values()):
        return ""
    numbers = Counter(
        name
        for s in strides.values()
        for name, counts in zip(s.motion_class, s.counts, strict=True)
        if counts and name
    )
    most = max(numbers, key=lambda name: (numbers[name], name), default="")
    for s in strides.values():
        s.leave_out(np.array([name != most or not name for name in s.motion_class], bool), "class")
    return most


def _leave_out_turns(strides: Mapping[str, Strides], track: Track, stride: float) -> bool:
    """Leave out strides in turns, unless there are no others; return whether there are none."""
    path = np.unwrap(np.arctan2(*walking_direction(track, stride).T[[1, 0]]))
    heading = np.unwrap(track.numbers.get("heading_rad", np.zeros(len(path))))
    turned = {}
    for side, s in strides.items():
        by_path, by_heading = (
            np.abs(np.interp(s.end, track.time, angle) - np.interp(s.start, track.time, angle))
            for angle in (path, heading)
        )
        moves = s.values["speed_m_s"] * (s.end - s.start) > _LEAST_WAY_M
        turned[side] = np.maximum(by_heading, np.where(moves, by_path, 0.0)) > np.radians(_TURN_DEG)
    counts = np.concatenate([s.counts for s in strides.values()])
    if counts.any() and np.concatenate(list(turned.values()))[counts].all():
        return True
    for side, s in strides.items():
        s.leave_out(turned[side], "turn")
    return False


def _leave_out_slow(strides: Mapping[str, Strides], events: Events) -> None:
    """Leave out much slower strides at the ends of each walk."""
    speed = np.concatenate([s.values["speed_m_s"] for s in strides.values()])
    start = np.concatenate([s.start for s in strides.values()])
    counts = np.concatenate([s.counts for s in strides.values()])
    if not counts.any():
        return
    steady = start[counts & (speed >= _STEADY * np.median(speed[counts]))]
    for s in strides.values():
        ends = [steady[events.walk(steady) == walk] for walk in events.walk(s.start)]
        inside = [len(own) and own.min() <= at <= own.max() for own, at in zip(ends, s.start, strict=True)]
        s.leave_out(~np.array(inside, bool), "slow")


def strides_of(motion: Joints, events: Events) -> dict[str, Strides]:
    """Make the strides of a motion with known events, by side; all are sure and count; there are no draws.

    UserError if no foot strikes twice.
    """
    stride = stride_time(events)
    if not np.isfinite(stride):
        raise UserError("the true motion has no whole stride; give a longer one")
    feet = {side: contacts(motion, events, side, stride) for side in STRIKE_SIDES}
    out = {}
    for side, other in (STRIKE_SIDES, STRIKE_SIDES[::-1]):
        values = stride_quantities(feet[side], feet[other], _between(feet[side].strike, feet[other].strike))
        whole = _whole(events, side, stride)
        start, end = feet[side].strike[:-1][whole], feet[side].strike[1:][whole]
        known = {name: value[whole] for name, value in values.items()}
        unknown = {name: np.full(value.shape, np.nan) for name, value in known.items()}
        draws = {name: value[None] for name, value in unknown.items()}
        out[side] = Strides(
            side, start, end, known, unknown, draws, np.ones(len(start), bool), _counting(len(start))
        )
    return out


def _whole(events: Events, side: str, stride: float) -> NDArray[np.bool_]:
    """Which intervals between strikes of a foot are one stride, without a stand or missed strike."""
    strike = events.strike[side]
    time = np.diff(strike)
    return (time > 0.6 * stride) & (time < LONGEST_CYCLE * stride) & (np.diff(events.walk(strike)) == 0)


def measured(track: Track, draws: Draws | None = None) -> Parameters | None:
    """Measure the gait parameters of a track as `measure` does; None if it has no whole stride."""
    try:
        return measure(track, draws)
    except UserError:
        return None


def stride_quantities(foot: Contacts, other: Contacts, between: NDArray[np.int64]) -> dict[str, Array]:
    """Compute `PARAMETER_LABELS` of the strides of a foot, shape (..., k - 1) for k strikes.

    A stride's step is its second one, from the other foot's strike to the end of the stride.

    `foot`, `other`: contacts of this foot and of the other, with the same leading axes. `between` (k - 1,):
    index of the other foot's strike within each stride; -1: none.
    """
    start, end = foot.strike[..., :-1], foot.strike[..., 1:]
    middle, last_off = _pick(other.strike, between), _pick(other.off, np.where(between > 0, between - 1, -1))
    time = end - start
    way = foot.pelvis[..., 1:, :2] - foot.pelvis[..., :-1, :2]
    length = np.linalg.norm(way, axis=-1)
    ahead = way / np.maximum(length, 1e-9)[..., None]
    stride = foot.place[..., 1:, :2] - foot.place[..., :-1, :2]

    def both_feet(strike: Array, off: Array) -> Array:
        """Share of the stride from a strike to the other foot's toe-off; negative: both are off the floor."""
        share = (off - strike) / time
        return np.where(share >= -_LONGEST_FLIGHT, share, np.nan)

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
        "foot_clearance_m": foot.clearance[..., 1:],
        "stance_percent": 100 * (foot.off[..., :-1] - start) / time,
        "double_support_percent": 100 * (both_feet(start, last_off) + both_feet(middle, foot.off[..., :-1])),
    }


def _pick(values: Array, index: NDArray[np.int64], axis: int = -1) -> Array:
    """Pick `values` at `index` along an axis; NaN where the index is -1."""
    shape = list(values.shape)
    shape[axis] = 1
    padded = np.concatenate([values, np.full(shape, np.nan)], axis=axis)
    return np.asarray(np.take(padded, index, axis=axis))


def _between(strike: Array, other: Array) -> NDArray[np.int64]:
    """Index of the first strike of the other foot within each stride; -1: none."""
    first = np.searchsorted(other, strike[:-1], side="right")
    inside = (first < len(other)) & (np.append(other, np.inf)[first] < strike[1:])
    return np.where(inside, first, -1)


def _is_free(track: Track, statuses: set[str], start: float, end: float) -> bool:
    """Whether no frame of a stride has one of these statuses."""
    inside = (track.time >= start) & (track.time <= end)
    return not statuses & {track.status[i] for i in np.flatnonzero(inside)}


def mean_of(values: Array, axis: int) -> Array:
    """Mean of the values that are not NaN; NaN if there are none."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # about means of nothing
        return np.asarray(np.nanmean(values, axis=axis))


def sd_of(draws: Array) -> Array:
    """Return the sd over the first axis; NaN where fewer than half of the draws have a value."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        sd = np.nanstd(draws, axis=0)
    return np.where(np.isfinite(draws).mean(axis=0) >= 0.5, sd, np.nan)


PERCENT = np.linspace(0, 100, 101)
"""Percent of the stride, from right strike to right strike; for angles of the left side, left to left."""
_SMALL = 0.005  # strides; step of the phase for numerical derivatives


@dataclass(frozen=True)
class AngleCycle:
    """One angle over the cycle, degrees; arrays have shape (101,) unless stated otherwise."""

    strides: Array  #: (k, 101) the strides that count
    #: Mean of the strides, and its posterior standard deviation (NaN if the track has none).
    mean: Array
    sd: Array
    #: Mean and standard deviation among the people from which the model was learnt, at the same stride rate.
    norm_mean: Array
    norm_sd: Array

    @property
    def z(self) -> Array:
        """Difference from the norm, in its standard deviations."""
        return np.asarray((self.mean - self.norm_mean) / np.maximum(self.norm_sd, 1e-6))

    def summary(self) -> dict[str, Any]:
        """Return the range of the mean, the root mean square of z, and where z is largest."""
        worst = int(np.argmax(np.abs(self.z)))
        return {
            "least_deg": float(self.mean.min()),
            "most_deg": float(self.mean.max()),
            "strides": len(self.strides),
            "rms_z": float(np.sqrt(np.mean(self.z**2))),
            "worst_z": float(self.z[worst]),
            "worst_at_percent": float(PERCENT[worst]),
        }


def without_norm(parameters: Parameters, model: Mapping[str, Any]) -> str:
    """Explain why a model has no norm for the strides that count; "" if it has one.

    It has none for classes without strides, whose rate or length is 0 in `GAIT`.
    """
    name, names = parameters.motion_class, class_names(model) or [first_class(model)]
    if name and name not in names:
        return f"the model has no class {name}; give the model that was tracked with, -m MODEL"
    if name and "CLIN" in model and model["CLIN"][names.index(name)][0] < 0:
        return f"strides of class {name} are the model's in reverse, for which there is no norm"
    gait = _model_of_class(parameters, model).get("GAIT", np.zeros(4))
    if not (gait[0] > 0 and gait[3] > 0):
        return f"{f'the class {name} of ' if name else ''}the model takes no strides"
    return ""


def _model_of_class(parameters: Parameters, model: Mapping[str, Any]) -> Mapping[str, Any]:
    name, names = parameters.motion_class, class_names(model)
    return class_sections(model, names.index(name)) if name in names else model


def norm_model(parameters: Parameters, model: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the model of the class of the strides that count; UserError `without_norm`."""
    if reason := without_norm(parameters, model):
        raise UserError(reason)
    return _model_of_class(parameters, model)


def angle_cycles(
    track: Track, parameters: Parameters, curves: ModelCurves, draws: Draws | None = None
) -> dict[str, AngleCycle]:
    """Compute the cycles of every angle that both track and model have.

    `parameters`: those of the track. `curves`: the norm; without draws, they also show how angles depend on
    scores and phase. `draws`: motions drawn from the posterior.
    """
    angles = {name[: -len("_deg")]: v for name, v in track.numbers.items() if name.endswith("_deg")}
    angles |= _pelvis_angles(track, curves)
    out = {}
    for name in (n for n in curves.names if n in angles):
        left = name.startswith("l_")
        when = _times(parameters, "left" if left else "right")
        if not len(when):
            continue
        strides = _interpolated(when, track.time, angles[name])
        rate = 1 / float(np.median(when[:, -1] - when[:, 0]))
        norm_mean, norm_sd = curves.norm(name, PERCENT / 100 + (0.5 if left else 0.0), rate)
        drawn = draws is not None and name in draws.angle_names
        sd = _drawn_sd(draws, name, when) if draws and drawn else _linear_sd(track, name, curves, when)
        out[name] = AngleCycle(strides, strides.mean(axis=0), sd, np.degrees(norm_mean), np.degrees(norm_sd))
    return out


def _interpolated(when: Array, time: Array, values: Array) -> Array:
    """Interpolate values (n,) linearly at times `when` (...), across frames without a value."""
    known = np.isfinite(values)
    return np.interp(when, time[known], values[known]) if known.any() else np.full(when.shape, np.nan)


def _pelvis_angles(track: Track, curves: ModelCurves) -> dict[str, Array]:
    """Angles of the pelvis, degrees: from the line through both hips, and, for the tilt, from the model."""
    if "heading_rad" not in track.numbers:
        return {}
    x, y, up = (track.places["l_hip"] - track.places["r_hip"]).T
    turn = np.arctan2(-x, y) - track.numbers["heading_rad"]
    scores = _scores(track, curves)
    found = {
        "root_roll": np.arctan2(up, np.hypot(x, y)),
        "root_yaw": (turn + np.pi) % (2 * np.pi) - np.pi,
        "root_pitch": curves.channel(
            "root_pitch",
            np.nan_to_num(track.phase),  # where it is NaN, the rate is too
            np.stack([track.numbers[name] for name in scores], axis=1),
            track.numbers["stride_hz"],
        ),
    }
    return {name: np.degrees(values) for name, values in found.items()}


def _scores(track: Track, curves: ModelCurves) -> list[str]:
    """Scores of a track that the model has, one column each."""
    scores = sorted((n for n in track.numbers if n.startswith("c_") and not n.endswith("_sd")), key=_number)
    return scores[: len(curves.samples) - 1]


def _times(parameters: Parameters, side: str) -> Array:
    """Return the times (k, 101) of the strides of a foot that count."""
    s = parameters.strides[side]
    start, end = s.start[s.counts, None], s.end[s.counts, None]
    return np.asarray(start + (end - start) * PERCENT / 100)


def _drawn_sd(draws: Draws, name: str, when: Array) -> Array:
    """Return the sd of the mean curve over the draws, including differences in timing."""
    values = np.degrees(draws.angles[:, :, draws.angle_names.index(name)].astype(float))
    means = [np.interp(when, draws.time, motion).mean(axis=0) for motion in values]
    return np.asarray(np.std(means, axis=0))


def _linear_sd(track: Track, name: str, curves: ModelCurves, when: Array) -> Array:
    """Return the sd by linear propagation from phase and scores, assuming the same errors in every stride."""
    numbers = track.numbers
    if "phase_sd" not in numbers:
        return np.full(len(PERCENT), np.nan)
    scores = _scores(track, curves)
    phase, coef = np.nan_to_num(track.phase), np.stack([numbers[n] for n in scores], axis=1)
    rate = numbers["stride_hz"]
    here = curves.channel(name, phase, coef, rate)
    late, early = (curves.channel(name, phase + move, coef, rate) for move in (_SMALL, -_SMALL))
    slope = (late - early) / (2 * _SMALL)
    variance = (slope * numbers["phase_sd"]) ** 2
    for k, score in enumerate(scores):
        one = np.eye(len(scores))[k]
        variance += ((curves.channel(name, phase, coef + one, rate) - here) * numbers[f"{score}_sd"]) ** 2
    return np.asarray(_interpolated(when, track.time, np.degrees(np.sqrt(variance))).mean(axis=0))


def _number(score: str) -> int:
    return int(score[len("c_") :])


def as_json(track: Track, parameters: Parameters, cycles: Mapping[str, AngleCycle]) -> dict[str, Any]:
    """Return everything but the curves, for JSON; unknown values are null."""
    found = {
        "frames": [int(track.frame[0]), int(track.frame[-1])],
        "uncertainty": parameters.source,
        "summary": parameters.summary(),
        "events": list(event_rows(track, parameters)),
        "strides": list(stride_rows(parameters)),
        "angles": {name: cycle.summary() for name, cycle in cycles.items()},
    }
    clean: dict[str, Any] = _without_nan(found)
    return clean


def event_rows(track: Track, parameters: Parameters) -> Iterator[dict[str, Any]]:
    """List strikes and toe-offs in order of time."""
    rows: list[dict[str, Any]] = []
    for side in STRIKE_SIDES:
        for kind in ("strike", "off"):
            times = getattr(parameters.events, kind)[side]
            for time, sd in zip(times, getattr(parameters.event_sd, kind)[side], strict=True):
                frame = float(np.interp(time, track.time, track.frame))
                event = {"event": f"{side}_{_EVENT[kind]}", "time_s": float(time)}
                rows.append(event | {"frame": frame, "sd_s": float(sd)})
    yield from sorted(rows, key=lambda row: row["time_s"])


_EVENT = {"strike": "heel_strike", "off": "toe_off"}


def stride_rows(parameters: Parameters) -> Iterator[dict[str, Any]]:
    """List strides in order of their start, each quantity with its standard deviation."""
    rows = []
    for side in STRIKE_SIDES:
        s = parameters.strides[side]
        for k in range(len(s.start)):
            row: dict[str, Any] = {"side": side, "start_s": float(s.start[k]), "end_s": float(s.end[k])}
            row |= {"sure": bool(s.sure[k]), "counts": bool(s.counts[k]), "left_out": str(s.left_out[k])}
            if s.motion_class:
                row["motion_class"] = s.motion_class[k]
            for name in PARAMETER_LABELS:
                row[name], row[f"{name}_sd"] = float(s.values[name][k]), float(s.sd[name][k])
            rows.append(row)
    yield from sorted(rows, key=lambda row: row["start_s"])


def curve_rows(cycles: Mapping[str, AngleCycle]) -> Iterator[dict[str, Any]]:
    """List mean and norm of every angle, with their sd, at each percent of the stride, degrees."""
    for i, percent in enumerate(PERCENT):
        row: dict[str, Any] = {"percent": int(percent)}
        for name, c in cycles.items():
            for part in ("mean", "sd", "norm_mean", "norm_sd"):
                row[f"{name}_{part}_deg"] = float(getattr(c, part)[i])
        yield row


def write_tables(
    folder: Path, found: Mapping[str, Any], parameters: Parameters, cycles: Mapping[str, AngleCycle]
) -> None:
    """Write parameters.json (`found`, from `as_json`), events.csv, strides.csv and curves.csv to `folder`."""
    text = json.dumps(found, indent=1, allow_nan=False) + "\n"
    (folder / "parameters.json").write_text(text, encoding="utf-8")
    write_rows(folder / "events.csv", found["events"])
    write_rows(folder / "strides.csv", list(stride_rows(parameters)))
    write_rows(folder / "curves.csv", list(curve_rows(cycles)))


def write_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows with the same keys; unknown values are left empty."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(rows[0] if rows else ())
        for row in rows:
            table.writerow([_cell(value) for value in row.values()])


def _cell(value: Any) -> Any:
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value:.5f}"
    return int(value) if isinstance(value, bool) else value


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and np.isnan(value) else value
