"""Find the steady part of a recording: starts, stops and turns are detected in the motion and cut off.

Three measures are constant in steady motion, whatever the phase: the joints' angular speed over half a cycle
(one step); the distance that the pelvis travels in a step; and its turn in a whole cycle.  The longest
interval in which they are near their medians is kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gait.learn.arrays import Floats, Mask
from gait.learn.cycles import period, stride

QUIET = 0.3  # of the 90th percentile of the joints' speed; slower ends do not belong to the motion
SPEED_WINDOW_S = 0.5  # seconds over which that speed is averaged
DERIVATIVE = 0.05  # seconds to either side for differences of angles
MOTION = 1.55  # factor by which the joints' speed may differ from its median
TURN_LIMIT = np.radians(25.0)  # by which the turn in a cycle may differ from its median
TRAVELLING = 0.3  # m/s; mean speed below which the position is meaningless (treadmills)
#: Relative difference of a step's travel from the median: steady walks of CMU are within 0.1.  The wider
#: limits are for recordings without such an interval, as when a person keeps speeding up.
TRAVEL_LIMITS = (0.12, 0.15, 0.2, 0.25)
#: Cycles that an interval should have, or a wider limit is tried; most phases then occur twice.
WANTED_CYCLES = 1.8
MOST_INTERVAL_PASSES = 6  # most iterations of interval and medians
PERIODS = 3  # most iterations of interval and period


@dataclass(frozen=True)
class RootPath:
    """Motion of the body as a whole, T frames."""

    position: Floats | None = None  #: (T, 2) of the pelvis over the ground, metres
    yaw: Floats | None = None  #: (T,) direction of the pelvis, radians, continuous

    def part(self, start: int, stop: int) -> RootPath:
        """Return frames start <= t < stop."""
        position = None if self.position is None else self.position[start:stop]
        return RootPath(position, None if self.yaw is None else self.yaw[start:stop])


@dataclass(frozen=True)
class Kept:
    """Frames [start, stop) that are kept, and why those before and after are not, in words ('' if none)."""

    start: int
    stop: int
    before: str = ""
    after: str = ""


def steady_part(angles: Floats, fps: float, mode: str, path: RootPath) -> tuple[Kept, period.Period]:
    """Find the steady part of angles (T, A), radians with NaN where missing, and its period."""
    moving = active_part(angles, fps)
    angles, path = angles[moving.start : moving.stop], path.part(moving.start, moving.stop)
    found, kept = stride.find(angles, fps, mode), Kept(0, len(angles))
    for _ in range(PERIODS):
        if not np.isfinite(found.frames):
            break
        before, kept = kept, longest_steady(angles, fps, found.frames, path)
        if kept == before or kept.stop - kept.start < period.FEWEST_CYCLES * found.frames:
            break
        found = stride.find(angles[kept.start : kept.stop], fps, mode)
    why = words(moving.before, kept.before), words(moving.after, kept.after)
    return Kept(moving.start + kept.start, moving.start + kept.stop, *why), found


def active_part(angles: Floats, fps: float) -> Kept:
    """Cut off the ends in which nothing moves or nothing is observed; angles (T, A), NaN where missing."""
    square, weight = _speed(angles, fps)
    width = max(1, round(SPEED_WINDOW_S * fps))
    window = np.ones(min(width, len(angles)))
    share = np.convolve(square, window, "same") / np.maximum(np.convolve(weight, window, "same"), 1e-12)
    speed = np.where(weight > 0, np.sqrt(share), 0.0)
    if not speed.any():
        return Kept(0, len(angles))
    moving = np.flatnonzero(speed > QUIET * np.percentile(speed, 90))
    start, stop = int(moving[0]), int(moving[-1]) + 1
    return Kept(start, stop, "standing" if start else "", "standing" if stop < len(angles) else "")


def longest_steady(angles: Floats, fps: float, cycle: float, path: RootPath) -> Kept:
    """Find the longest steady interval of angles (T, A); `cycle` is the frames of a cycle."""
    kept = Kept(0, len(angles))
    for limit in TRAVEL_LIMITS:
        kept = _within(angles, fps, cycle, path, limit)
        if kept.stop - kept.start >= WANTED_CYCLES * cycle:
            break
    return kept


def words(*reasons: str) -> str:
    """Join reasons, each once, without empty ones."""
    each = " and ".join(reason for reason in reasons if reason).split(" and ")
    return " and ".join(dict.fromkeys(each))


def _within(angles: Floats, fps: float, cycle: float, path: RootPath, limit: float) -> Kept:
    """Find the longest interval in which the measures are near their medians over that interval."""
    frames, step = len(angles), max(1, round(cycle / 2))
    if frames < 3 * step:
        return Kept(0, frames)
    motion, travel, turn = _motion(angles, fps, step), _travel(path, fps, step), _turn(path, round(cycle))
    start, stop = 0, frames
    bad: dict[str, Mask] = {}
    for _ in range(MOST_INTERVAL_PASSES):
        m, d, y = (_median(q, frames, start, stop) for q in (motion, travel, turn))
        bad = {
            "standing": _centred(motion < m / MOTION, frames),
            "hurrying": _centred(motion > m * MOTION, frames),
            "slower": _centred(travel < d * (1 - limit), frames),
            "faster": _centred(travel > d * (1 + limit), frames),
            "turning": ~_covered(~(np.abs(turn - y) > TURN_LIMIT), frames),
        }
        run = _longest(~np.any(list(bad.values()), axis=0))
        if run in ((start, stop), (0, 0)):
            break
        start, stop = run
    before, after = (
        words(*(word for word, mask in bad.items() if mask[part].any()))
        for part in (slice(0, start), slice(stop, frames))
    )
    return Kept(start, stop, before, after)


def _speed(angles: Floats, fps: float) -> tuple[Floats, Floats]:
    """Squared speed of the joints (T,), and its mean for the visible joints, so that the ratio is about 1."""
    reach = min(max(1, round(DERIVATIVE * fps)), (len(angles) - 1) // 2)
    change = np.full(angles.shape, np.nan)
    change[reach:-reach] = angles[2 * reach :] - angles[: -2 * reach]
    change[:reach], change[-reach:] = change[reach], change[-reach - 1]
    square = np.where(np.isfinite(change), change, 0.0) ** 2
    visible = np.isfinite(change)
    usual = square.sum(axis=0) / np.maximum(visible.sum(axis=0), 1)
    moving = usual > 1e-12
    return (square[:, moving] / usual[moving]).sum(axis=1), visible[:, moving].sum(axis=1).astype(float)


def _motion(angles: Floats, fps: float, step: int) -> Floats:
    """Speed of the joints in each window of a step, about 1; NaN where little is visible."""
    square, weight = (_window_sums(q, step) for q in _speed(angles, fps))
    enough = weight > 0.3 * weight.max()
    return np.where(enough, np.sqrt(square / np.maximum(weight, 1e-12)), np.nan)


def _travel(path: RootPath, fps: float, step: int) -> Floats:
    """Distance of the pelvis, metres, in each window of a step; empty if unknown or in place."""
    if path.position is None:
        return np.zeros(0)
    way = np.linalg.norm(path.position[step:] - path.position[:-step], axis=1)
    visible = way[np.isfinite(way)]
    return way if len(visible) and np.median(visible) > TRAVELLING * step / fps else np.zeros(0)


def _turn(path: RootPath, cycle: int) -> Floats:
    """Turn of the pelvis, radians, in each window of a cycle; empty if unknown."""
    return np.zeros(0) if path.yaw is None else path.yaw[cycle:] - path.yaw[:-cycle]


def _window_sums(values: Floats, width: int) -> Floats:
    total = np.concatenate([[0.0], np.cumsum(values)])
    return total[width:] - total[:-width]


def _median(measure: Floats, frames: int, start: int, stop: int) -> float:
    """Median of a measure over its windows inside frames start to stop; NaN if there are none."""
    inside = measure[start : max(start + 1, stop - (frames - len(measure)))]
    visible = inside[np.isfinite(inside)]
    return float(np.median(visible)) if len(visible) else float("nan")


def _centred(flag: Mask, frames: int) -> Mask:
    """Return for each frame the flag of the window centred on it, or of the first or last window."""
    if not len(flag):
        return np.zeros(frames, bool)
    return flag[np.clip(np.arange(frames) - (frames - len(flag)) // 2, 0, len(flag) - 1)]


def _covered(flag: Mask, frames: int) -> Mask:
    """Frames that are in a window with the flag; all if there are no windows."""
    if not len(flag):
        return np.ones(frames, bool)
    width = frames - len(flag) + 1
    return np.convolve(flag, np.ones(width)) > 0.5


def _longest(good: Mask) -> tuple[int, int]:
    """First and one past the last index of the longest run; (0, 0) if there is none."""
    edges = np.diff(np.concatenate([[0], good.astype(int), [0]]))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    if not len(begins):
        return 0, 0
    top = int(np.argmax(ends - begins))
    return int(begins[top]), int(ends[top])
