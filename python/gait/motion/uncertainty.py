"""Uncertain footfalls: motions that agree with a track's standard deviations, and the contacts of each.

Errors of a track last for some time, which decides how they affect a gait parameter.  If they were taken as
independent in every frame, means over strides would seem too precise and single strides too imprecise.
Parts:

- position of the whole person: the same for all joints, cancels in every length;
- size: scales every length alike, as the distance from the camera follows from the size in the picture;
- person: feet differ from the model's by a constant and by a part that repeats with every stride, and strike
  and leave the ground earlier or later, independently on each side.  This cancels in strides, but not in
  events, steps, stance, width, clearance or symmetry, and a mean over strides does not reduce it;
- errors that change within a stride;
- camera, if it was estimated from the walk: common to all frames.

Motions drawn from the posterior (`Draws`) contain all of this except for what the model cannot express.  That
is the difference from the track's standard deviations, and is treated as the person's part.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from gait.io.track_file import Joints, Track
from gait.motion.footfalls import (
    STRIKE_SIDES,
    Contacts,
    Draws,
    Events,
    contacts,
    find_events,
    moved_by_camera,
    same_events,
    stack,
    walking_direction,
)

Array = NDArray[np.float64]

UNCERTAIN_JOINTS = ("pelvis", *(f"{s}_{part}" for s in "rl" for part in ("ankle", "heel", "toe")))
"""Joints from which contacts are found."""

_COUNT = 100  # motions drawn if the track has none; a standard deviation is then known to 7 %
# Shares of the variance of a joint and of the phase, if only the standard deviations of frames are known;
# chosen on people of `gait simulate` who are in no reported result.
_PERSON, _WANDER = 0.5, 0.15
_LASTING_PHASE_SHARE = 0.6  # share of the variance of the phase that lasts
#: The person's part of a foot: standard deviations along the path, across it and up, of the constant and of
#: the first and second wave of the stride, as multiples of that of a joint; and those of its strikes and
#: toe-offs, strides.  Measured on walks of people left out of learning, then rounded on people of `gait
#: simulate` who are in no reported result (decisions.md).
_FOOT = np.array([[1.0, 0.95, 0.65], [0.5, 0.45, 0.35], [0.25, 0.25, 0.25]])
_BY_WAVE = np.repeat(_FOOT, (1, 2, 2), axis=0)
_STRIKE_SD, _OFF_SD = 0.007, 0.019
_SMOOTH_S = 0.12  # duration over which errors within a stride are smooth
_SIZE_SHARE = 0.7  # error of the size over the person's part of a joint: many joints determine the size


def draw_contacts(
    track: Track, events: Events, stride: float, draws: Draws | None
) -> tuple[dict[str, Contacts], Events, str]:
    """Draw contacts by side, shape (D, ...); also return the events' standard deviations and their source."""
    if draws is None and "phase_sd" not in track.numbers:
        nothing = {side: _unknown(contacts(track, events, side, stride)) for side in STRIKE_SIDES}
        return nothing, _event_sd([events], unknown=True), "unknown: the track has no column phase_sd"
    drawn: dict[str, list[Contacts]] = {side: [] for side in STRIKE_SIDES}
    found, random = [], np.random.default_rng(1)
    common = _lasting_phase_sd(track, draws)
    for motion in _motions(track, draws):
        found.append(_shifted(same_events(find_events(motion), events), stride, common, random))
        for side in STRIKE_SIDES:
            drawn[side].append(contacts(motion, found[-1], side, stride))
    source = "the standard deviations of each frame, whose errors persist over frames"
    if draws is not None:
        source = (
            f"{len(found)} motions drawn from the posterior, plus the variation that the model cannot express"
        )
    source += "" if track.camera_change is None else "; camera errors are common to all frames"
    return {side: stack(drawn[side]) for side in STRIKE_SIDES}, _event_sd(found), source


def _shifted(events: Events, stride: float, common: float, random: np.random.Generator) -> Events:
    """Shift all events alike, with sd `common` (strides), and each foot's strikes and toe-offs by its own."""
    late = common * random.standard_normal()
    strike, off = (
        {side: times + stride * (late + sd * random.standard_normal()) for side, times in kind.items()}
        for kind, sd in ((events.strike, _STRIKE_SD), (events.off, _OFF_SD))
    )
    return Events(strike, off)


def _lasting_phase_sd(track: Track, draws: Draws | None) -> float:
    """Return the standard deviation of the phase, strides, that the track states beyond its draws."""
    if draws is None or "phase_sd" not in track.numbers:
        return 0.0
    length = np.abs(np.exp(2j * np.pi * draws.phase).mean(axis=0))
    drawn = -2 * np.log(np.clip(length, 1e-6, 1.0)) / (2 * np.pi) ** 2
    beyond = track.numbers["phase_sd"] ** 2 - drawn
    return float(np.sqrt(np.maximum(np.nanmedian(beyond), 0.0))) if np.isfinite(beyond).any() else 0.0


def _motions(track: Track, draws: Draws | None) -> Iterator[Joints]:
    """Yield motions of `UNCERTAIN_JOINTS` that agree with the track's standard deviations."""
    random = np.random.default_rng(0)
    count = _COUNT if draws is None else len(draws.phase)
    moved = {name: _moved(track, name) for name in UNCERTAIN_JOINTS}
    sd = {name: _without_camera(track.sd[name], moved[name]) for name in UNCERTAIN_JOINTS}
    own = _person_sd(sd, draws)
    size = _size_sd(track, own, draws)
    waves, ways = _waves(track.phase), _ways(track)
    for d in range(count):
        places = _warped(track, random) if draws is None else draws.motion(d).places
        start, scale = places["pelvis"][0].copy(), 1 + size * random.standard_normal()
        camera = random.standard_normal(4)
        feet = {side: waves @ (random.standard_normal((waves.shape[1], 3)) * _BY_WAVE) for side in "rl"}
        out = {}
        for name in UNCERTAIN_JOINTS:
            out[name] = start + scale * (places[name] - start)
            if name != "pelvis":
                sizes = np.sqrt(np.einsum("nak,k->na", ways**2, own[name] ** 2))  # along each way
                out[name] += np.einsum("na,nak->nk", feet[name[0]] * sizes, ways)
            if draws is None:
                wander = _wander(track.time, 3, random)
                out[name] += np.sqrt(_WANDER) * sd[name] * wander
            out[name][:, :2] += moved[name] @ camera
        yield Joints(track.frame, track.time, out)


def _moved(track: Track, name: str) -> Array:
    """Movement (n, 2, 4) of a joint with each independent error of the camera; 0 if the camera was given."""
    if track.camera_change is None:
        return np.zeros((len(track.time), 2, 4))
    return moved_by_camera(track.camera_change, (track.places[name] - track.places["pelvis"])[:, :2])


def _without_camera(sd: Array, moved: Array) -> Array:
    """Return the standard deviations (n, 3) of a joint without the camera's part, metres."""
    common = np.pad((moved**2).sum(axis=2), ((0, 0), (0, 1)))
    return np.asarray(np.sqrt(np.maximum(sd**2 - common, 0.0)))


def _person_sd(sd: dict[str, Array], draws: Draws | None) -> dict[str, Array]:
    """Return the standard deviations (3,) of the person's part, by joint, metres."""
    if draws is None:
        return {name: np.sqrt(_PERSON) * np.median(sd[name], axis=0) for name in UNCERTAIN_JOINTS}
    out = {}
    for name in UNCERTAIN_JOINTS:
        drawn = draws.joints[:, :, draws.joint_names.index(name)].astype(float).var(axis=0)
        out[name] = np.sqrt(np.median(np.maximum(sd[name] ** 2 - drawn, 0), axis=0))
    return out


def _size_sd(track: Track, own: dict[str, Array], draws: Draws | None) -> float:
    """Return the relative standard deviation of the size."""
    stature = float(np.median(track.numbers.get("stature_m", 0.0)))
    if not stature > 0:
        return 0.0
    stated = float(np.median(track.numbers["stature_sd_m"])) / stature
    if draws is not None:
        legs = [draws.joints[:, :, draws.joint_names.index(f"r_{name}")] for name in ("hip", "knee", "ankle")]
        lengths = sum(
            np.linalg.norm(a - b, axis=2).mean(axis=1) for a, b in zip(legs, legs[1:], strict=False)
        )
        stated = np.sqrt(max(stated**2 - (lengths.std() / lengths.mean()) ** 2, 0.0))
    fitted = _SIZE_SHARE * float(np.mean([own[f"{s}_heel"][2] for s in "rl"])) / stature
    return float(np.hypot(stated, fitted))


def _waves(phase: Array) -> Array:
    """Return a constant, and cosine and sine of each wave of the stride (n, rows of `_BY_WAVE`).

    Without a phase there is only the constant.
    """
    known = np.isfinite(phase)[:, None]
    turn = 2 * np.pi * np.where(known, phase[:, None], 0.0) * np.arange(1, len(_FOOT))
    waves = np.stack([np.cos(turn), np.sin(turn)], axis=2).reshape(len(phase), -1)
    return np.hstack([np.ones((len(phase), 1)), known * waves])


def _ways(track: Track) -> Array:
    """Return unit vectors along the path, across it and up, shape (n, 3, 3)."""
    ahead, up = walking_direction(track), np.array([0.0, 0.0, 1.0])
    return np.stack([ahead, np.cross(up, ahead), np.broadcast_to(up, ahead.shape)], axis=1)


def _warped(track: Track, random: np.random.Generator) -> dict[str, Array]:
    """Positions of the track, shifted in time by a random error of the phase."""
    rate = np.maximum(track.numbers["stride_hz"], 0.1)
    sd = np.minimum(track.numbers["phase_sd"], 0.29) / rate  # 0.29: sd of a uniform phase
    wander = _wander(track.time, 1, random)[:, 0]
    late = np.nan_to_num(sd) * (
        np.sqrt(_LASTING_PHASE_SHARE) * random.standard_normal() + np.sqrt(1 - _LASTING_PHASE_SHARE) * wander
    )
    return {
        name: np.stack(
            [np.interp(track.time - late, track.time, axis) for axis in track.places[name].T], axis=1
        )
        for name in UNCERTAIN_JOINTS
    }


def _wander(time: Array, count: int, random: np.random.Generator) -> Array:
    """Smooth noise (n, count) of unit variance."""
    width = max(_SMOOTH_S / float(np.median(np.diff(time))), 0.1)
    reach = int(4 * width + 0.5)
    bell = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    noise = np.pad(random.standard_normal((len(time), count)), ((reach, reach), (0, 0)), "symmetric")
    return np.apply_along_axis(np.convolve, 0, noise, bell / np.linalg.norm(bell), "valid")


def _event_sd(found: list[Events], unknown: bool = False) -> Events:
    """Return the sd of each event over the draws that have it; NaN if fewer than half of them do."""

    def sd(times: list[Array]) -> Array:
        stacked = np.stack(times)
        enough = (np.isfinite(stacked).mean(axis=0) >= 0.5) & (not unknown)
        return np.where(enough, np.nanstd(np.where(enough, stacked, 0.0), axis=0), np.nan)

    return Events(
        {side: sd([e.strike[side] for e in found]) for side in STRIKE_SIDES},
        {side: sd([e.off[side] for e in found]) for side in STRIKE_SIDES},
    )


def _unknown(c: Contacts) -> Contacts:
    """Return a draw in which everything about the contacts is NaN."""
    return Contacts(**{item.name: np.full_like(getattr(c, item.name), np.nan)[None] for item in fields(c)})
