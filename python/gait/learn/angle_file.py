"""Angles as a source of learning: .csv of the model's joint angles, as `gait track` writes them too."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


@dataclass
class AngleTable:
    """Angles over time without joint positions, T frames.

    Attributes
    ----------
    name : str
        Stem of the file.
    fps : float
        Frames per second.
    angles : (T, 24)
        In the order of `gait.skeleton.ANGLES`, radians; NaN where missing.
    root : (T, 6) or None
        In the order of `gait.skeleton.ROOTS`, radians and statures; None if the file has no such column.
    stature : float or None
        Metres, if the file says.
    """

    name: str
    fps: float
    angles: Floats
    root: Floats | None = None
    stature: float | None = None

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.angles)
