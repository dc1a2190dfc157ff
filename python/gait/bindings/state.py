"""One state of the person, as Python numbers and NumPy arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.bindings import abi
from gait.bindings.library import library, struct_fields

Array = NDArray[np.float64]
ARRAY_LIMITS = {"coef": abi.MAX_COMPONENTS, "offset": abi.MAX_ANGLES, "proportion": abi.MAX_PROPORTIONS}
LEAST_STATURE = 0.3  # metres; the smallest that particles may have (particles.h)
POSE_SCALARS = ("phase", "stride_hz", "stature", "heading", "pitch", "roll")  # scalars that a pose depends on
STATE_SCALARS = (*POSE_SCALARS, "turn_rate")


@cache
def state_range(name: str) -> tuple[float, float]:
    """Lowest and highest value of a field of a first `State`, from the library's table."""
    return next((row.low, row.high) for row in struct_fields("gait_state") if row.name == name)


@dataclass
class State:
    """Position and pose of a person; also used for the standard deviations of these values.

    Attributes
    ----------
    phase : float
        [0, 1) of the stride, 0 = right heel strike.
    stride_hz : float
        Strides (two steps) per second.
    stature : float
        Metres.
    heading : float
        Walking direction about world z, radians; 0 = along +x.
    pitch, roll : float
        Tilt of the pelvis relative to the model's, radians.
    pelvis : ndarray of shape (3,)
        Pelvis joint in the world, metres.
    coef : ndarray of shape (q,)
        Principal-component scores in standard deviations; missing ones are 0.
    offset : ndarray of shape (A,)
        Posture offsets: added to the model's joint angles, radians; missing ones are 0.
    proportion : ndarray of shape (p,)
        Scores of the limbs' proportions in standard deviations; missing ones are 0.
    turn_rate : float
        Change of the heading, radians per second, positive to the left.
    motion_class : int
        Index of the class of motion in `Model.classes`.
    """

    phase: float = 0.0
    stride_hz: float = 0.9
    stature: float = 1.75
    heading: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    pelvis: Array = field(default_factory=lambda: np.zeros(3))
    coef: Array = field(default_factory=lambda: np.zeros(0))
    offset: Array = field(default_factory=lambda: np.zeros(0))
    proportion: Array = field(default_factory=lambda: np.zeros(0))
    turn_rate: float = 0.0
    motion_class: int = 0

    @staticmethod
    def from_c(c: abi.StateC, components: int, angles: int) -> State:
        """Copy a ``gait_state``, with `components` scores and `angles` offsets."""
        arrays = {"pelvis": c.pelvis, "coef": c.coef[:components], "offset": c.offset[:angles]}
        arrays["proportion"] = c.proportion[:]
        values: dict[str, Any] = {name: float(getattr(c, name)) for name in STATE_SCALARS}
        values |= {name: np.array(numbers, float) for name, numbers in arrays.items()}
        return State(**values, motion_class=c.motion_class)

    def to_c(self) -> abi.StateC:
        """Make a ``gait_state``.

        Raises
        ------
        ValueError
            If `pelvis` does not have 3 numbers, or another array has more than the library allows.
        """
        pelvis: Sequence[float] = np.asarray(self.pelvis, float).tolist()
        if len(pelvis) != 3 or any(
            np.size(getattr(self, name)) > most for name, most in ARRAY_LIMITS.items()
        ):
            limits = ", ".join(f"{name} at most {most}" for name, most in ARRAY_LIMITS.items())
            raise ValueError(f"state: pelvis has 3 numbers, {limits}")
        library()  # loading it defines the structures
        c = abi.StateC(**{name: float(getattr(self, name)) for name in STATE_SCALARS})
        c.motion_class = self.motion_class
        c.pelvis[:] = pelvis
        for name in ARRAY_LIMITS:
            numbers: Sequence[float] = np.asarray(getattr(self, name), float).tolist()
            getattr(c, name)[: len(numbers)] = numbers
        return c
