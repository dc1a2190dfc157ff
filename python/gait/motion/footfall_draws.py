"""Contacts of the feet drawn from the posterior of a track.

With the motions of ``gait track --draws`` each draw is a whole motion, so errors that last are the same at
both ends of a stride, as they should be.  A track alone has only the deviation of each frame: then strikes,
toe-offs and places are drawn independently, which makes the parameters less certain where errors last.
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gait.errors import UserError
from gait.io.files import replacing
from gait.io.track_file import Joints, Track
from gait.motion.footfalls import SIDES, Contacts, Events, at, contacts, find_events, same_events, stack

Array = NDArray[np.float64]

_COUNT = 500  # independent draws; deviations are then known to 3 %
_FLAT = 0.2  # of a stride after the strike


@dataclass(frozen=True)
class Draws:
    """Motions drawn from the posterior of a whole clip.

    Attributes
    ----------
    frame : ndarray of int, shape (n,)
    time : ndarray of shape (n,)
        Seconds.
    joint_names, angle_names : tuple of str
        Of P joints and A angles.
    joints : ndarray of float32, shape (D, n, P, 3)
        Metres, world.
    angles : ndarray of float32, shape (D, n, A)
        Radians.
    phase : ndarray of float32, shape (D, n)
        [0, 1) of the stride.
    """

    frame: NDArray[np.int64]
    time: Array
    joint_names: tuple[str, ...]
    angle_names: tuple[str, ...]
    joints: NDArray[np.float32]
    angles: NDArray[np.float32]
    phase: NDArray[np.float32]

    def motion(self, draw: int) -> Joints:
        """One of the motions."""
        places = {name: self.joints[draw, :, i].astype(float) for i, name in enumerate(self.joint_names)}
        return Joints(self.frame, self.time, places)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write a compressed .npz file."""
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        with replacing(path) as temporary, open(temporary, "wb") as file:
            np.savez_compressed(file, **{k: np.asarray(v) for k, v in arrays.items()}, allow_pickle=False)

    @staticmethod
    def read(path: str | os.PathLike[str], track: Track) -> Draws:
        """Read a file of `write` that must be of the same frames as `track`."""
        if not Path(path).is_file():
            raise UserError(f"{path}: no such file of draws; gait track --smooth --draws writes it")
        try:
            with np.load(path, allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in _ARRAYS}
        except (OSError, ValueError, KeyError, zipfile.BadZipFile):
            raise UserError(f"{path}: not a file of draws; gait track --smooth --draws writes it") from None
        for name in ("joint_names", "angle_names"):
            arrays[name] = tuple(str(word) for word in arrays[name])
        draws = Draws(**arrays)
        if not np.array_equal(draws.frame, track.frame):
            raise UserError(f"{path}: its frames are not those of the track; give the draws made with it")
        return draws


_ARRAYS = ("frame", "time", "joint_names", "angle_names", "joints", "angles", "phase")


def draw_contacts(
    track: Track, events: Events, feet: Mapping[str, Contacts], stride: float, draws: Draws | None
) -> tuple[dict[str, Contacts], Events, str]:
    """Draws of the contacts by side, shape (D, ...); deviations of the events; and where they come from."""
    if draws is not None:
        return (*_of_motions(draws, events, stride), f"{len(draws.phase)} motions drawn from the posterior")
    if "phase_sd" not in track.numbers:
        nothing = {side: stack([_nan_like(feet[side])]) for side in SIDES}
        return nothing, _event_sd([events], unknown=True), "unknown: the track has no column phase_sd"
    return (
        *_of_deviations(track, events, feet, stride),
        "the deviations of each frame, taken as independent",
    )


def _of_motions(draws: Draws, events: Events, stride: float) -> tuple[dict[str, Contacts], Events]:
    motions = [draws.motion(d) for d in range(len(draws.phase))]
    found = [same_events(find_events(motion), events) for motion in motions]
    drawn = {
        side: stack([contacts(m, e, side, stride) for m, e in zip(motions, found, strict=True)])
        for side in SIDES
    }
    return drawn, _event_sd(found)


def _of_deviations(
    track: Track, events: Events, feet: Mapping[str, Contacts], stride: float
) -> tuple[dict[str, Contacts], Events]:
    """Draw each event as sure as the phase is then, its place as sure as the heel."""
    random = np.random.default_rng(0)
    time, rate = track.time, np.maximum(track.numbers["stride_hz"], 0.1)
    late = np.minimum(track.numbers["phase_sd"], 0.29) / rate  # no less sure than knowing nothing

    def timing(when: Array) -> Array:
        return np.interp(when, time, late)

    def noisy(value: Array, sd: Array) -> Array:
        return np.asarray(value + sd * random.standard_normal((_COUNT, *value.shape)))

    drawn = {}
    for side in SIDES:
        foot = feet[side]
        heel_sd, pelvis_sd = track.sd[f"{side[0]}_heel"], track.sd["pelvis"]
        drawn[side] = Contacts(
            noisy(foot.strike, timing(foot.strike)),
            noisy(foot.off, timing(foot.off)),
            noisy(foot.place, at(time, heel_sd, foot.strike + _FLAT * stride)),
            noisy(foot.pelvis, at(time, pelvis_sd, foot.strike)),
        )
    sd = Events(
        {side: timing(events.strike[side]) for side in SIDES},
        {side: timing(events.off[side]) for side in SIDES},
    )
    return drawn, sd


def _event_sd(found: list[Events], unknown: bool = False) -> Events:
    """Deviation of each event over draws that were matched; NaN where fewer than half have it."""

    def sd(times: list[Array]) -> Array:
        stacked = np.stack(times)
        enough = (np.isfinite(stacked).mean(axis=0) >= 0.5) & (not unknown)
        return np.where(enough, np.nanstd(np.where(enough, stacked, 0.0), axis=0), np.nan)

    return Events(
        {side: sd([e.strike[side] for e in found]) for side in SIDES},
        {side: sd([e.off[side] for e in found]) for side in SIDES},
    )


def _nan_like(c: Contacts) -> Contacts:
    return Contacts(*(np.full_like(values, np.nan) for values in (c.strike, c.off, c.place, c.pelvis)))
