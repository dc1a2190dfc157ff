"""Settings of a tracker, as the C library has them."""

from __future__ import annotations

import ctypes
import operator
from dataclasses import dataclass, fields
from typing import Any

from gait.bindings import abi
from gait.bindings.abi import Mode, Term
from gait.bindings.library import library


@dataclass(frozen=True)
class TrackerConfig:
    """Settings of a tracker, each documented in ``gait.h``; `default` fills them from the C library."""

    mode: Mode
    seed: int
    particles: int
    acquisition_particles: int
    components: int
    tasks: int
    lag: int
    proportions: int
    terms: Term
    term_weight: tuple[float, ...]
    missed_weight: float
    girth: float
    resample_ess: float
    evidence_time: float
    rejuvenation_time: float
    max_dt: float
    phase_noise: float
    rate_noise: float
    settle_time: float
    rate_time: float
    forward_noise: float
    lateral_noise: float
    vertical_noise: float
    heading_noise: float
    turn_sd: float
    turn_time: float
    tilt_noise: float
    tilt_time: float
    coef_noise: float
    coef_time: float
    stature_noise: float
    stature_noise_start: float
    offset_noise: float
    proportion_noise: float
    offset_angles: int
    cpu_mask: int
    joint_sd_model: float

    @staticmethod
    def default(mode: Mode | int = Mode.DEFAULT, **changes: Any) -> TrackerConfig:
        """Defaults of the library for `mode`, with `changes`.

        Raises
        ------
        TypeError
            If a change names no setting.
        """
        c = abi.TrackerConfigC()
        library().gait_tracker_default(ctypes.byref(c), int(mode))
        values = {item.name: getattr(c, item.name) for item in fields(TrackerConfig)}
        values["term_weight"] = tuple(c.term_weight)
        return TrackerConfig(**(values | {"mode": Mode(c.mode), "terms": Term(c.terms)} | changes))

    def to_c(self) -> abi.TrackerConfigC:
        """Make a ``gait_tracker_config`` without cameras and tasks; ValueError for what has no room in it."""
        c = abi.TrackerConfigC()
        library().gait_tracker_default(ctypes.byref(c), int(self.mode))
        for item in fields(self):
            if item.name != "term_weight":
                _put(c, item.name, getattr(self, item.name))
        if len(self.term_weight) != len(c.term_weight):
            raise ValueError(f"term_weight: give {len(c.term_weight)} numbers")
        c.term_weight[:] = self.term_weight
        return c


def _put(c: abi.TrackerConfigC, name: str, value: Any) -> None:
    """Set a field; ctypes would cut a number that it has no room for."""
    whole = isinstance(getattr(c, name), int)
    try:
        setattr(c, name, operator.index(value) if whole else value)
    except TypeError:
        raise ValueError(f"config {name} = {value!r}: give a {'whole ' * whole}number") from None
    if whole and getattr(c, name) != value:
        raise ValueError(f"config {name} = {value} is negative or too large")
