"""When and where the feet of a walking person touch and leave the ground, with uncertainties.

A heel strike is when the heel is furthest ahead of the pelvis along the walking direction, a toe-off when the
toe is furthest behind it (Zeni et al. 2008, Gait & Posture 27:710).  There are no events while the person
stands, and no toe-offs in runs, in which the toe is furthest behind the pelvis after it has left the ground.

Uncertainty is represented by draws.  With the motions of ``gait track --draws`` each draw is a whole motion,
so lasting errors are the same at both ends of a stride, as they should be.  A track without draws has only
the standard deviations of each frame; `gait.motion.uncertainty` describes how long their errors last.
"""

from __future__ import annotations

import os
import zipfile
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gait.errors import UserError
from gait.io.fields import Fields, read_json
from gait.io.files import replacing, require_file
from gait.io.track_file import Joints, Track

Array = NDArray[np.float64]

ASSUMED_STRIDE_S = 1.1  # seconds; stride time assumed where the true one is unknown
LONGEST_CYCLE = 1.6  # usual strides; a longer gap between strikes of a foot holds a stand or a missed strike
_LEAST_STRIKE_GAP_S = 0.5  # least seconds between strikes of one foot
_SWING_REACH_M = 0.1  # least metres that a foot swings past the pelvis


@dataclass(frozen=True)
class Strikes:
    """Heel strikes as fractional frame numbers, increasing."""

    right: Array
    left: Array

    def phase(self, frames: ArrayLike) -> Array | None:
        """Phase [0, 1) at frame numbers (n,), as `cycles` without the whole strides."""
        cycles = self.cycles(frames)
        return None if cycles is None else cycles % 1.0

    def cycles(self, frames: ArrayLike) -> Array | None:
        """Return the phase without wrapping, in strides; None if fewer than two strikes are known.

        Phase exists only within a gait cycle, from a strike of a foot to its next one, which lasts at most
        1.6 times as long as the usual stride of both feet (a longer gap holds a stand), and for at most 0.8
        of the usual stride before the first strike of either foot and after the last; elsewhere it is NaN.

        It is linear within the cycles of the right foot, whose strikes are phase 0; where there are none,
        between the strikes of both feet, of which those of the left are only near 0.5.
        """
        at = np.concatenate([self.right, self.left])
        if len(at) < 2:
            return None
        right = np.arange(len(self.right), dtype=float)
        left = np.searchsorted(self.right, self.left) - 0.5
        order = np.argsort(at, kind="stable")
        at, count = at[order], np.concatenate([right, left])[order]
        frames, stride = np.asarray(frames, float), self._stride()
        of_both = _between_strikes(frames, at, count, stride)
        if len(right) < 2:
            return of_both
        of_right = _between_strikes(frames, self.right, right, stride, only_whole=True)
        inside = (frames >= self.right[0]) & (frames <= self.right[-1])
        return np.where(np.isfinite(of_right) & (inside | np.isfinite(of_both)), of_right, of_both)

    def strides(self) -> Array:
        """Return how long the strides of both feet take, frames, without gaps that hold a stand."""
        gaps = np.concatenate([np.diff(self.right), np.diff(self.left)])
        return gaps[gaps <= LONGEST_CYCLE * np.quantile(gaps, 0.25)] if len(gaps) else gaps

    def _stride(self) -> float:
        """Usual stride, frames: the median, or twice a step if there are no whole strides."""
        found = self.strides()
        return float(np.median(found)) if len(found) else 2 * float(abs(self.left[0] - self.right[0]))


def _between_strikes(
    frames: Array, at: Array, count: Array, stride: float, *, only_whole: bool = False
) -> Array:
    """Interpolate the strides `count` (k,) at strikes `at` (k,); NaN in gaps longer than a cycle may be.

    `stride`: usual one, frames. Outside the strikes the first or last gap goes on, or, if it is longer than a
    cycle, the usual stride, or none with `only_whole`.
    """
    strides, gap = np.diff(count), np.diff(at)
    whole = gap <= LONGEST_CYCLE * stride * strides
    rate = np.divide(strides, gap, out=np.full(len(gap), 1 / stride), where=whole)[[0, -1]]
    beyond = np.array([-1.0, 1.0]) * stride * (1.0 if only_whole else LONGEST_CYCLE / 2)
    ends, reached = at[[0, -1]] + beyond, count[[0, -1]] + beyond * rate
    value = np.interp(
        frames,
        np.concatenate([ends[:1], at, ends[1:]]),
        np.concatenate([reached[:1], count, reached[1:]]),
        left=np.nan,
        right=np.nan,
    )
    outside = whole[[0, -1]] | (not only_whole)
    known = np.concatenate([outside[:1], whole, outside[1:]])
    return np.where(known[np.searchsorted(at, frames, side="right")], value, np.nan)


def meta_of(truth: str | os.PathLike[str]) -> Path:
    """Return the path of the meta.json of a file of true joints: meta_2.json of truth_2.csv."""
    number = Path(truth).stem.removeprefix("truth")
    return Path(truth).with_name(f"meta{number}.json" if number.startswith("_") else "meta.json")


def strikes_of(truth: Joints, meta: Path) -> Strikes:
    """Return the strikes listed in the file `meta`, or, if it is missing or has none, those in the truth."""
    known = strikes_from_meta(meta) if meta.is_file() else None
    return known or strikes_by_zeni(truth)


def strikes_from_meta(path: str | os.PathLike[str]) -> Strikes | None:
    """Read strikes from ``events_video_frames`` in a clip's meta.json; None if it has none."""
    events = read_json(path, "meta").table("events_video_frames", "give lists of heel strikes")
    if "r_heel_strike" not in events or "l_heel_strike" not in events:
        return None
    return Strikes(_times(events, "r_heel_strike"), _times(events, "l_heel_strike"))


def strikes_by_zeni(truth: Joints) -> Strikes:
    """Find strikes, when a heel is furthest ahead of the pelvis in walking direction (Zeni et al. 2008).

    If the truth has no heels, the ankles are used.
    """
    ahead = walking_direction(truth)
    pelvis = truth.places["pelvis"]
    right, left = (
        _strikes(truth, np.sum((_foot(truth, side) - pelvis) * ahead, axis=1)) for side in ("r", "l")
    )
    return Strikes(right, left)


def walking_direction(truth: Joints, stride: float = ASSUMED_STRIDE_S) -> Array:
    """Return the unit direction of travel along the ground at each frame, shape (n, 3).

    It is the direction in which the pelvis moves during one stride of `stride` seconds around the frame, so
    that its sway cancels; near the ends, during the first or last stride.
    """
    time, pelvis = truth.time, truth.places["pelvis"][:, :2]
    early = np.clip(time - stride / 2, time[0], max(time[0], time[-1] - stride))
    late = np.minimum(early + stride, time[-1])
    way = np.zeros((len(time), 3))
    for axis in range(2):
        way[:, axis] = np.interp(late, time, pelvis[:, axis]) - np.interp(early, time, pelvis[:, axis])
    return np.asarray(way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12))


def _foot(truth: Joints, side: str) -> Array:
    return truth.places.get(f"{side}_heel", truth.places[f"{side}_ankle"])


def furthest(time: Array, reach: Array) -> Array:
    """Return the times of the maxima of `reach`, refined by a parabola through three frames.

    `time` (n,); `reach` (n,): how far a foot is ahead of the pelvis (or behind it, to find toe-offs), metres.
    """
    step = float(np.median(np.diff(time)))
    peaks = maxima(reach, _SWING_REACH_M, max(1, round(_LEAST_STRIKE_GAP_S / step)))
    before, top, after = reach[peaks - 1], reach[peaks], reach[peaks + 1]
    bend = before - 2 * top + after
    shift = np.where(bend < 0, 0.5 * (before - after) / np.where(bend < 0, bend, 1), 0.0)
    return np.interp(peaks + shift, np.arange(len(reach)), time)


def maxima(values: Array, least: float, apart: int) -> NDArray[np.int64]:
    """Return the indices of the local maxima of `values` (n,) that are at least `least`.

    Of maxima less than `apart` from each other only the highest is kept, of equal ones the last; of equal
    neighbouring values the middle is the maximum.  This does what ``scipy.signal.find_peaks`` does, which
    takes over a second to import.
    """
    change = np.flatnonzero(np.diff(values))
    up = np.diff(values)[change] > 0
    top = up[:-1] & ~up[1:]
    found = (change[:-1][top] + 1 + change[1:][top]) // 2
    kept: list[int] = []
    for peak in found[np.argsort(values[found], kind="stable")[::-1]]:
        if values[peak] >= least and all(abs(peak - other) >= apart for other in kept):
            kept.append(int(peak))
    return np.sort(np.array(kept, dtype=np.int64))


def _strikes(truth: Joints, reach: Array) -> Array:
    """Fractional frame numbers of the strikes of a foot that is `reach` (n,) metres ahead of the pelvis."""
    return np.interp(furthest(truth.time, reach), truth.time, truth.frame.astype(float))


def _times(events: Fields, key: str) -> Array:
    """Read the strike times of one foot, which must increase."""
    remedy = "give a list of increasing frame numbers"
    times = events.array(key, (events.count(key, remedy),), remedy)
    if (np.diff(times) <= 0).any():
        raise events.fail(key, "does not increase", remedy)
    return times


STRIKE_SIDES = ("right", "left")

_FLAT_FOOT_STRIDES = np.linspace(0.10, 0.30, 5)  # strides after the strike, when the foot is flat
_SWING = np.linspace(0.12, 0.26, 8)  # strides before the strike, when the toe passes the other foot
_SHORTEST_CONTACT = 0.15  # strides; sprinters' last about 0.2
_OWN_TRACK_M = 0.01  # most between a track and the mean of its own draws
MATCHING_STRIKES_S = 0.25  # seconds; events further apart are not the same


@dataclass(frozen=True)
class Events:
    """Strikes and toe-offs of both feet, seconds, each increasing."""

    #: Times (k,) by side, "right" or "left".
    strike: dict[str, Array]
    off: dict[str, Array]
    #: (m, 2) seconds: first and last frame of each interval in which the person takes no strides.
    stands: Array = field(default_factory=lambda: np.zeros((0, 2)))

    def walk(self, times: Array) -> NDArray[np.int64]:
        """Return the number of stands before each of `times` (k,), which numbers the walks between them."""
        return np.searchsorted(self.stands[:, 0], times)

    @property
    def count(self) -> int:
        """Number of events."""
        return sum(len(times) for kind in (self.strike, self.off) for times in kind.values())


@dataclass(frozen=True)
class Contacts:
    """Contacts of one foot with the ground; leading axes (...) may run over draws."""

    #: (..., k) seconds; `off` ends the contact that `strike` begins; NaN if it was not seen.
    strike: Array
    off: Array
    place: Array  #: (..., k, 3) ankle while the foot is flat, metres, world; NaN if the track ends before
    pelvis: Array  #: (..., k, 3) at the strike
    #: (..., k) least height of the toe above the floor in the middle of the swing before the strike, metres;
    #: NaN if the track begins later
    clearance: Array


def find_events(joints: Joints) -> Events:
    """Find the strikes and toe-offs of a motion of at least three frames."""
    ahead, pelvis = walking_direction(joints), joints.places["pelvis"]
    stands, runs = joints.stands, joints.runs
    strike, off = {}, {}
    for side in STRIKE_SIDES:
        heel, toe = (joints.places[f"{side[0]}_{part}"] - pelvis for part in ("heel", "toe"))
        strike[side] = _outside(stands, joints, furthest(joints.time, np.sum(heel * ahead, axis=1)))
        off[side] = _outside(stands | runs, joints, furthest(joints.time, -np.sum(toe * ahead, axis=1)))
    change = np.diff(stands.astype(int), prepend=0, append=0)
    ends = np.flatnonzero(change > 0), np.flatnonzero(change < 0) - 1
    return Events(strike, off, np.stack([joints.time[rows] for rows in ends], axis=1))


def _outside(frames: NDArray[np.bool_], joints: Joints, times: Array) -> Array:
    """Return those of `times` whose nearest frame is none of `frames` (n,)."""
    return times[np.interp(times, joints.time, frames) < 0.5]


def same_events(found: Events, wanted: Events) -> Events:
    """Match events: for each of `wanted`, return the event of `found` near it, or NaN if there is none."""

    def pick(have: Array, want: Array) -> Array:
        if not len(have):
            return np.full(len(want), np.nan)
        nearest = have[np.argmin(np.abs(have[:, None] - want), axis=0)] if len(want) else np.zeros(0)
        return np.where(np.abs(nearest - want) <= MATCHING_STRIKES_S, nearest, np.nan)

    return Events(
        {side: pick(found.strike[side], wanted.strike[side]) for side in STRIKE_SIDES},
        {side: pick(found.off[side], wanted.off[side]) for side in STRIKE_SIDES},
    )


def contacts(joints: Joints, events: Events, side: str, stride: float) -> Contacts:
    """Describe the contacts of one foot. `side`: "right" or "left"; `stride`: rough stride time, seconds."""
    strike = events.strike[side]
    return Contacts(
        strike=strike,
        off=_offs(strike, events.off[side], stride),
        place=_flat(joints.time, joints.places[f"{side[0]}_ankle"], strike, stride),
        pelvis=at(joints.time, joints.places["pelvis"], strike),
        clearance=_clearance(joints.time, joints.places[f"{side[0]}_toe"][:, 2], strike, stride),
    )


def at(time: Array, values: Array, when: Array) -> Array:
    """Interpolate values (n, d) linearly at times `when` (k,): shape (k, d)."""
    return np.stack([np.interp(when, time, column) for column in values.T], axis=-1)


def stride_time(events: Events) -> float:
    """Return the median time between strikes of one foot, seconds; NaN if no foot strikes twice in a walk."""
    gaps = np.concatenate(
        [np.diff(times)[np.diff(events.walk(times)) == 0] for times in events.strike.values()]
    )
    return float(np.median(gaps)) if len(gaps) else float("nan")


def stack(draws: list[Contacts]) -> Contacts:
    """Stack the contacts of many draws along a new first axis, shape (draws, ...)."""
    names = [item.name for item in fields(Contacts)]
    return Contacts(**{name: np.stack([getattr(draw, name) for draw in draws]) for name in names})


def _offs(strike: Array, off: Array, stride: float) -> Array:
    """Find the toe-off that ends the contact after each strike; NaN if there is none within a stride."""
    out = np.full(len(strike), np.nan)
    for k, begun in enumerate(strike):
        after = off[(off > begun + _SHORTEST_CONTACT * stride) & (off < begun + 0.9 * stride)]
        if len(after):
            out[k] = after[0]
    return out


def _flat(time: Array, ankle: Array, strike: Array, stride: float) -> Array:
    """Mean position of the ankle while the foot is flat; NaN if the track ends before."""
    out = np.full((len(strike), 3), np.nan)
    for k, begun in enumerate(strike):
        when = begun + stride * _FLAT_FOOT_STRIDES
        when = when[when <= time[-1]]
        if len(when):
            out[k] = at(time, ankle, when).mean(axis=0)
    return out


def _clearance(time: Array, toe: Array, strike: Array, stride: float) -> Array:
    """Least height of the toe in the middle of the swing, above its height while the foot was flat before."""
    swing = np.interp(strike[:, None] - stride * _SWING, time, toe)
    flat = np.interp(strike[:, None] - stride * (1 - _FLAT_FOOT_STRIDES), time, toe)
    begun = strike - stride * (1 - _FLAT_FOOT_STRIDES[0]) >= time[0]
    return np.where(begun, swing.min(axis=1) - flat.mean(axis=1), np.nan)


@dataclass(frozen=True)
class Draws:
    """Motions drawn from the posterior of a whole clip."""

    frame: NDArray[np.int64]  #: (n,)
    time: Array  #: (n,) seconds
    #: Names of the P joints and A angles of the D draws.
    joint_names: tuple[str, ...]
    angle_names: tuple[str, ...]
    joints: NDArray[np.float32]  #: (D, n, P, 3) metres, world
    angles: NDArray[np.float32]  #: (D, n, A) radians
    phase: NDArray[np.float32]  #: (D, n) [0, 1) of the stride

    def motion(self, draw: int) -> Joints:
        """Return one of the motions."""
        places = {name: self.joints[draw, :, i].astype(float) for i, name in enumerate(self.joint_names)}
        return Joints(self.frame, self.time, places)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write a compressed .npz file."""
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        with replacing(path) as temporary, open(temporary, "wb") as file:
            np.savez_compressed(file, **{k: np.asarray(v) for k, v in arrays.items()}, allow_pickle=False)

    @staticmethod
    def read(path: str | os.PathLike[str], track: Track) -> Draws:
        """Read a file from `write`; UserError unless frames and positions are those of `track`."""
        require_file(path, "file of draws", "gait track --smooth --draws writes it")
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
        apart = draws._distance(track)  # the track is their mean
        if apart > _OWN_TRACK_M:
            words = f"its joints are {apart:.2f} m from those of the track"
            raise UserError(f"{path}: {words}; give the draws made with it")
        return draws

    def _distance(self, track: Track) -> float:
        """Median distance of the joints' mean places from those of a track with the same frames, metres."""
        mean = self.joints.mean(axis=0, dtype=float)
        there = np.stack([track.places[name] for name in self.joint_names], axis=1)
        return float(np.median(np.linalg.norm(mean - there, axis=2)))


_ARRAYS = ("frame", "time", "joint_names", "angle_names", "joints", "angles", "phase")


def moved_by_camera(change: Array, off: Array) -> Array:
    """Compute how positions move over the floor with each independent error of the camera.

    Parameters
    ----------
    change : ndarray of shape (..., 3, 4)
        Changes of the person's position and heading, as in `Track.camera_change`.
    off : ndarray of shape (..., 2)
        Offsets of the positions from the person's, metres.

    Returns
    -------
    ndarray of shape (..., 2, 4)
        Metres per sd of each error.
    """
    turned = np.stack([-off[..., 1], off[..., 0]], axis=-1)[..., None] * change[..., 2:, :]
    return np.asarray(change[..., :2, :] + turned)
