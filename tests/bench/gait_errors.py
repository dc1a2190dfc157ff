"""Errors of footfalls and gait parameters against the truth, with their intervals, as gait labs report them.

Strides and events are matched by time.  Those that the truth lacks are not judged; those that a track lacks
count as missed.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gait.errors import UserError
from gait.io.track_file import Joints
from gait.motion.footfalls import MATCHING_STRIKES_S, STRIKE_SIDES, Events, find_events, same_events
from gait.motion.parameters import (
    MIRRORED_PARAMETERS,
    PARAMETER_LABELS,
    Parameters,
    Strides,
    asymmetry,
    mean_of,
    sd_of,
    strides_of,
)

Array = NDArray[np.float64]

EVENTS = {"heel_strike_s": "heel strike, s", "toe_off_s": "toe-off, s"}
HALF = 1.6448536  # half-width of the 90 % interval of a normal distribution, standard deviations


@dataclass(frozen=True)
class Compared:
    """Values of one quantity with the true ones."""

    #: (k,) in the quantity's unit; `sd` is NaN if the track states none.
    found: Array
    true: Array
    sd: Array

    @property
    def error(self) -> Array:
        """Found minus true (k,)."""
        return self.found - self.true

    @property
    def covered(self) -> NDArray[np.bool_]:
        """Whether the 90 % interval contains the true value, for those that have an interval."""
        known = np.isfinite(self.sd)
        return np.abs(self.error[known]) <= HALF * self.sd[known]


def true_events(truth: Joints, meta: Path) -> Events:
    """Events in seconds: those that the file `meta` lists if it exists and is complete, else the truth's."""
    stated = json.loads(meta.read_text(encoding="utf-8")) if meta.is_file() else {}
    listed = stated.get("events_video_frames", {})
    names = {
        kind: {side: f"{side[0]}_{kind}" for side in STRIKE_SIDES} for kind in ("heel_strike", "toe_off")
    }
    if not all(name in listed for each in names.values() for name in each.values()):
        return find_events(truth)
    rate = float((truth.frame[-1] - truth.frame[0]) / (truth.time[-1] - truth.time[0]))
    strike, off = (
        {side: truth.time[0] + (np.array(listed[name], float) - truth.frame[0]) / rate for side, name in each}
        for each in (names["heel_strike"].items(), names["toe_off"].items())
    )
    return Events(strike, off)


def gait_errors(parameters: Parameters, truth: Joints, events: Events) -> dict[str, Compared]:
    """Compare what `measure` found with the truth.

    `truth`: with heels and toes. `events`: its own, seconds. Returns by name: `EVENTS`; `PARAMETER_LABELS`
    stride by stride; ``mean:NAME`` of each, over the strides that both have (k = 1); ``asymmetry:NAME``, per
    cent.  Only strides without unsure frames count. UserError if the truth has no heels or toes.
    """
    lacking = [
        name for name in (f"{s}_{p}" for s in "rl" for p in ("heel", "toe")) if name not in truth.places
    ]
    if lacking:
        raise UserError(f"truth: has no {lacking[0]}; gait parameters need heels and toes")
    out = _of_events(parameters, events)
    true = strides_of(truth, events)
    pairs = {side: _matched(parameters.strides[side], true[side]) for side in STRIKE_SIDES}
    for name in PARAMETER_LABELS:
        both = [_values(parameters.strides[side], true[side], name, *pairs[side]) for side in STRIKE_SIDES]
        found, right, draws = (np.concatenate(parts, axis=-1) for parts in zip(*both, strict=True))
        out[name] = Compared(found, right, sd_of(draws))
        if not len(found):
            continue
        out[f"mean:{name}"] = Compared(
            found.mean(keepdims=True), right.mean(keepdims=True), sd_of(mean_of(draws, 1))[None]
        )
        if name in MIRRORED_PARAMETERS and all(len(values[0]) for values in both):
            index = [asymmetry(*(values[k].mean() for values in both)) for k in (0, 1)]
            sd = sd_of(asymmetry(*(mean_of(values[2], 1) for values in both)))
            out[f"asymmetry:{name}"] = Compared(*(np.array([value]) for value in (*index, sd)))
    return out


def _of_events(parameters: Parameters, events: Events) -> dict[str, Compared]:
    """Events that were found, with the true ones."""
    matched = same_events(parameters.events, events)
    out = {}
    for name, kind in zip(EVENTS, ("strike", "off"), strict=True):
        found, true, sd = [], [], []
        for side in STRIKE_SIDES:
            have, wanted = getattr(parameters.events, kind)[side], getattr(events, kind)[side]
            at = getattr(matched, kind)[side]
            seen = np.isfinite(at)
            rows = [int(np.flatnonzero(have == time)[0]) for time in at[seen]]
            found.append(at[seen])
            true.append(wanted[seen])
            sd.append(getattr(parameters.event_sd, kind)[side][rows])
        out[name] = Compared(*(np.concatenate(parts) for parts in (found, true, sd)))
    return out


def _matched(found: Strides, true: Strides) -> tuple[list[int], list[int]]:
    """Rows of the strides that count and that the truth also has, and their rows in the truth."""
    rows, theirs = [], []
    for i in np.flatnonzero(found.counts):
        off = np.maximum(np.abs(true.start - found.start[i]), np.abs(true.end - found.end[i]))
        if len(off) and off.min() <= MATCHING_STRIKES_S:
            rows.append(int(i))
            theirs.append(int(off.argmin()))
    return rows, theirs


def _values(
    found: Strides, true: Strides, name: str, rows: list[int], theirs: list[int]
) -> tuple[Array, Array, Array]:
    """Values (k,), true values (k,) and draws (D, k) where both are known."""
    values, right = found.values[name][rows], true.values[name][theirs]
    known = np.isfinite(values) & np.isfinite(right)
    return values[known], right[known], found.draws[name][:, rows][:, known]
