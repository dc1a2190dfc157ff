"""Settings of the C library's lifter, and the view that it lifts from."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gait.bindings import abi
from gait.bindings.abi import Projection
from gait.bindings.library import library
from gait.bindings.model import camera_c
from gait.camera.camera import Camera

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LiftConfig:
    """Settings of a lifter, each documented in ``gait.h``; `default` fills them from the C library."""

    stature: float
    stature_sd: float
    sd: float
    residual: float
    place: tuple[float, ...]
    place_sd: tuple[float, ...]
    heading: float
    heading_sd: float
    turn_sd: float
    tolerance: float
    max_iterations: int
    lag: int
    max_rate: float
    max_gap: float
    fit_threshold: float
    report: int
    cpu_mask: int

    @staticmethod
    def default(**changes: Any) -> LiftConfig:
        """Defaults of the library, with `changes`.

        Raises
        ------
        TypeError
            If a change names no setting.
        """
        c = abi.LiftConfigC()
        library().gait_lift_default(ctypes.byref(c))
        values = {item.name: getattr(c, item.name) for item in fields(LiftConfig)}
        values |= {"place": tuple(c.place), "place_sd": tuple(c.place_sd)}
        unknown = [name for name in changes if name not in values]
        if unknown:
            raise TypeError(f"LiftConfig has no setting {unknown[0]!r}; it has {', '.join(values)}")
        return LiftConfig(**(values | changes))

    def to_c(self, view: Camera | ArrayLike) -> abi.LiftConfigC:
        """Make a ``gait_lift_config`` for a view."""
        c = abi.LiftConfigC()
        library().gait_lift_default(ctypes.byref(c))
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, int | float):
                setattr(c, item.name, value)
            else:
                getattr(c, item.name)[:] = value
        if isinstance(view, Camera):
            c.projection, c.camera = Projection.PERSPECTIVE, camera_c(view)
        else:
            c.projection = Projection.ORTHOGRAPHIC
            for row, axis in zip(c.axis, _axes(view), strict=True):
                row[:] = axis
        return c


def _axes(view: ArrayLike) -> Array:
    """Directions (2, 3) of u and v."""
    try:
        return np.asarray(view, np.float64).reshape(2, 3)
    except (TypeError, ValueError):
        raise TypeError(
            f"view is {view!r:.60}; give a Camera (Camera.read(FILE)), or the directions of u and v: two "
            "rows of three numbers"
        ) from None
