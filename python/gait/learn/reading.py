"""How recordings are read: the choices that apply to every file of a run."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gait.learn.segment_options import Segments

NO_SEGMENTS = Segments(source="none")


@dataclass(frozen=True)
class Reading:
    """Options of `gait learn` that concern single files.

    Attributes
    ----------
    mode : "refined" or "literal"
        How the period is found.
    fps : float, optional
        Frames per second, if not what the file or its kind says.
    zero_runs : bool
        Take runs of three or more exact zeros for missing data.
    activity : str
        What the motion is called; recordings of another known activity are refused.
    markers : Path, optional
        Mapping of the marker names of .c3d and .trc files, for sets that are not known by themselves.
    trim : bool
        Cut starts, stops and turns off the ends of a recording.
    segments : Segments
        What the prior over segments is made from.
    """

    mode: str = "refined"
    fps: float | None = None
    zero_runs: bool = False
    activity: str = "walk"
    markers: Path | None = None
    trim: bool = True
    segments: Segments = NO_SEGMENTS


DEFAULT = Reading()
