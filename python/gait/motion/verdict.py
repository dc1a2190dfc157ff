"""The verdict on a track in plain words, the same in the terminal and on the page of a run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gait.body.motion_classes import STANDING, WALKING
from gait.counts import count_of
from gait.io.track_file import STATUSES, Track
from gait.motion.parameters import Parameters, measured

WHICH_LEG = "the images do not show which leg is the right one"
"""Why the tracker itself leaves left and right undecided."""
#: A person whose pelvis moves slower than this share of the strides' speed walks in place.
_LEAST_SPEED_SHARE = 0.25
_SHORTEST_S = 0.5  # shortest track, and interval, whose positions give a speed


@dataclass(frozen=True)
class Verdict:
    """How far a track can be trusted.

    Attributes
    ----------
    total : int
        Frames that were to be tracked.
    counts : dict of str to int
        Frames by status.
    strides : int
        Strides that count for the gait parameters, of the foot that has more of them; if none counts, whole
        strides.
    speed : float or None
        Metres per second along the ground: the mean of `Parameters`, or from the path if no stride counts; of
        a person who walks in place, from the strides.
    in_place : bool
        The person walks in place, as on a treadmill.
    no_strides : int
        Frames with an estimate in which the person takes no strides.
    motion_class : str
        Class of the strides that count, if others are left out because of their class, or if it is not the
        walk; without strides, the class of the whole track if it is one other than the walk.
    camera_moves : bool
        The camera moves but counts as still: a person who walks may seem to walk in place.
    along_path : bool
        There are whole strides, but the speed is that along the whole path, because not all are of one class.
    why : dict of str to int
        Number of ambiguous frames for each reason, most frequent first; empty if reasons are unknown.
    """

    total: int
    counts: dict[str, int]
    strides: int
    speed: float | None
    in_place: bool
    no_strides: int
    why: dict[str, int]
    motion_class: str = ""
    along_path: bool = False
    camera_moves: bool = False

    @property
    def tracked(self) -> int:
        """Number of frames with an estimate of the person, sure or not."""
        return self.counts["tracking"] + self.counts["ambiguous"]

    @property
    def absent(self) -> int:
        """Number of frames without a row in the track."""
        return self.total - sum(self.counts.values())

    def sentence(self) -> str:
        """One sentence: what was tracked, how the person walked, and what is uncertain."""
        parts = [f"Tracked {self.tracked} of {count_of(self.total, 'frame')}"]
        stood = self.motion_class == STANDING and not self.strides
        if stood:
            parts.append("stood throughout")
        else:
            strides = count_of(self.strides, "whole stride") if self.strides else "no whole stride"
            parts.append(strides + (f" of class {self.motion_class}" if self.motion_class else ""))
            if self.speed is not None:
                parts.append(f"{self.speed:.2f} m/s" + self._speed_words())
        text = ", ".join(parts)
        if self.counts["ambiguous"]:
            what = "left and right uncertain" if set(self.why) == {WHICH_LEG} else "uncertain"
            text += f"; {what} in {count_of(self.counts['ambiguous'], 'frame')}"
            why = [f"{reason} ({count})" for reason, count in self.why.items()]
            text += f": {', '.join(why if len(why) > 1 else self.why)}" if why else ""
        rest = {"no strides": 0 if stood else self.no_strides}
        rest |= {"lost": self.counts["lost"], "settling": self.counts["init"], "not found": self.absent}
        return "; ".join([text, *(f"{what} in {count_of(n, 'frame')}" for what, n in rest.items() if n)])

    def _speed_words(self) -> str:
        if self.in_place:
            return " by the strides, as the camera moves" if self.camera_moves else " in place"
        return " along the whole path" if self.along_path else ""

    def statuses(self, named: Callable[[str], str] = str) -> str:
        """Numbers of frames by status, in words; `named` returns those of a status."""
        text = f"{count_of(sum(self.counts.values()), 'frame')}: "
        text += ", ".join(f"{self.counts[status]} {named(status)}" for status in STATUSES)
        return text + (f"; {self.absent} more without an estimate" if self.absent else "")

    def warning(self) -> str | None:
        """Return advice if no frame can be relied on, otherwise None."""
        if self.counts["tracking"]:
            return None
        return (
            "no frame has status tracking, so do not rely on this track: view it with --overlay, check "
            "--camera and --init, or use the detector (gait detect --fetch)"
        )


def verdict_of(
    track: Track,
    total: int | None = None,
    parameters: Parameters | None = None,
    *,
    camera_moves: bool = False,
) -> Verdict:
    """Judge a track.

    Parameters
    ----------
    track : Track
    total : int, optional
        Number of frames that were to be tracked, if the track does not state them.
    parameters : Parameters, optional
        Parameters of the track, if they have been computed.
    camera_moves : bool
        As in `Verdict`.
    """
    counts = {status: track.status.count(status) for status in STATUSES}
    if parameters is None:
        parameters = measured(track)
    reasons: Counter[str] = Counter()
    if track.reason:
        unsure = [k for k, status in enumerate(track.status) if status == "ambiguous"]
        reasons.update(track.reason[k] or WHICH_LEG for k in unsure)
    speed, in_place = _speed(track)
    others = parameters is not None and parameters.others > 0
    if parameters is not None and not in_place and not others:
        speed = parameters.speed or speed
    return Verdict(
        total=max(len(track.frame), total or 0) if track.frames is None else len(track.frames),
        counts=counts,
        strides=0 if parameters is None else _strides(parameters),
        speed=speed,
        in_place=in_place,
        no_strides=int(track.stands.sum()),
        why=dict(reasons.most_common()),
        motion_class=_class_to_name(track, parameters),
        along_path=others,
        camera_moves=camera_moves,
    )


def _class_to_name(track: Track, parameters: Parameters | None) -> str:
    if parameters is None:
        classes = set(track.motion_class) - {""}
        name, others = classes.pop() if len(classes) == 1 else "", False
    else:
        name, others = parameters.motion_class, parameters.others > 0
    return name if others or name != WALKING else ""


def _strides(parameters: Parameters) -> int:
    every = parameters.strides.values()
    return max(int(s.counts.sum()) for s in every) or max(len(s.start) for s in every)


def _speed(track: Track) -> tuple[float | None, bool]:
    """Speed over the frames with an estimate, metres per second, and whether the person walks in place."""
    followed = np.isin(track.status, ("tracking", "ambiguous"))
    if not followed.any() or "speed_m_s" not in track.numbers:
        return None, False
    speed = track.numbers["speed_m_s"][followed]
    of_strides = float(np.median(speed[np.isfinite(speed)])) if np.isfinite(speed).any() else 0.0
    time, place = track.time[followed], track.places["pelvis"][followed, :2]
    if time[-1] - time[0] < _SHORTEST_S:
        return of_strides, False
    # To exclude sideways sway, the path is measured between positions at least half a second apart.
    steps = int((time[-1] - time[0]) / _SHORTEST_S)
    knots = np.searchsorted(time, np.linspace(time[0], time[-1], steps + 1))
    way = float(np.linalg.norm(np.diff(place[knots], axis=0), axis=1).sum())
    moved = way / float(time[knots[-1]] - time[knots[0]])
    in_place = moved < _LEAST_SPEED_SHARE * of_strides
    return (of_strides if in_place else moved), in_place
