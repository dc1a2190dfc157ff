"""A motion to export: joints at a constant frame rate."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gait.body.skeleton import JOINTS
from gait.errors import UserError
from gait.io.track_file import PERSON_COLUMN, Track, read_estimates
from gait.motion.footfalls import Events, find_events

Array = NDArray[np.float64]

_OFF = 0.6  # largest difference of a time from that at a constant rate, in frame intervals


@dataclass(frozen=True)
class Motion:
    """Joints of a person; world with z up."""

    name: str  #: name of the file, without suffix
    names: tuple[str, ...]  #: names of the P joints
    rate: float  #: frames per second
    first: float  #: time of the first frame, seconds
    places: Array  #: (T, P, 3) metres; NaN in frames that the track lacks
    track: Track  #: the track as it was read, without missing frames

    @property
    def time(self) -> Array:
        """Times (T,) of the frames, seconds."""
        return np.asarray(self.first + np.arange(len(self.places)) / self.rate)

    @property
    def present(self) -> NDArray[np.bool_]:
        """Whether the track has each frame, (T,)."""
        return np.asarray(np.isfinite(self.places).all(axis=(1, 2)))

    @property
    def person(self) -> str:
        """Name of the person: ``person``, or ``person_N`` if the track states a number."""
        number = self.track.numbers.get(PERSON_COLUMN)
        return "person" if number is None else f"person_{number[0]:.0f}"

    def events(self) -> Events | None:
        """Heel strikes and toe-offs, seconds; None if there are too few frames."""
        return find_events(self.track) if len(self.track.frame) > 2 else None


def read(path: str | os.PathLike[str]) -> Motion:
    """Read a track of ``gait track`` or a motion of ``gait lift``.

    UserError if it is another file, has fewer than two frames, or has no constant frame rate.
    """
    track = read_estimates(path)
    frame, time = track.frame, track.time
    if len(frame) < 2:
        raise UserError(f"{path}: has one frame; give a motion of at least two")
    rate = round(float((frame[-1] - frame[0]) / (time[-1] - time[0])), 3)  # times are also rounded
    late = (time - time[0]) * rate - (frame - frame[0])
    if not np.abs(late).max() < _OFF:
        raise UserError(
            f"{path}: the frame rate is not constant: frame {frame[int(np.abs(late).argmax())]} is "
            f"{np.abs(late).max():.1f} steps off; formats other than .parquet need equal steps"
        )
    places = np.full((int(frame[-1] - frame[0]) + 1, len(JOINTS), 3), np.nan)
    places[frame - frame[0]] = np.stack([track.places[name] for name in JOINTS], axis=1)
    name = os.path.splitext(os.path.basename(os.fspath(path)))[0]
    return Motion(name, tuple(JOINTS), rate, float(time[0]), places, track)
