"""Curves under the film: angles of joints with their intervals, phase, and which corrections would help."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.errors import UserError
from gait.io.track_file import Joints
from gait.lift.keypoints.corrections import Edits
from gait.lift.run import Lifted
from gait.motion.footfalls import Events, find_events
from gait.web.motion_data import curve

Floats = npt.NDArray[np.float64]

NUDGE = 1e-3  # metres, of numeric derivatives
NEAR_S = 0.35  # seconds from a correction of the same joint within which another would add little
PROPOSED = 8  # corrections that are named
ANGLES = {
    "knee flexion": (("hip", "knee"), ("knee", "ankle")),
    "hip flexion": (("neck", "pelvis"), ("hip", "knee")),
    "elbow flexion": (("shoulder", "elbow"), ("elbow", "wrist")),
}
"""Angles between two parts of the body: 0 where they point the same way."""


def angle_curves(names: tuple[str, ...], places: Floats, sd: Floats) -> list[dict[str, Any]]:
    """Angles of both sides by frame, degrees, with 90 % intervals.

    The errors of joints are taken for independent, which makes the intervals too wide where joints err
    together.

    Parameters
    ----------
    names : tuple of str
    places, sd : (T, J, 3)
        Metres; `sd` about the middle of the hips.
    """
    found = []
    for name, parts in ANGLES.items():
        for side in ("left", "right"):
            ends = [[_joint(joint, side) for joint in part] for part in parts]
            if not all(joint in names for part in ends for joint in part):
                continue
            index = [[names.index(joint) for joint in part] for part in ends]
            values = _angle(places, index)
            variance = np.zeros(len(values))
            for joint in {joint for part in index for joint in part}:
                for axis in range(3):
                    moved = places.copy()
                    moved[:, joint, axis] += NUDGE
                    variance += ((_angle(moved, index) - values) / NUDGE * sd[:, joint, axis]) ** 2
            found.append(curve(name, "°", values, np.sqrt(variance), side))
    return found


def _joint(joint: str, side: str) -> str:
    return joint if joint in ("neck", "pelvis") else f"{side[0]}_{joint}"


def _angle(places: Floats, parts: list[list[int]]) -> Floats:
    """Angle (T,) between two parts, degrees; of parts by the indices of their ends."""
    one, two = (places[:, end] - places[:, start] for start, end in parts)
    cross = np.linalg.norm(np.cross(one, two), axis=1)
    return np.asarray(np.degrees(np.arctan2(cross, np.sum(one * two, axis=1))))


def events_of(
    frame: npt.NDArray[np.int64], time: Floats, names: tuple[str, ...], places: Floats
) -> Events | None:
    """Heel strikes and toe-offs; None if joints are missing or no person walks."""
    by_name = {name: places[:, j] for j, name in enumerate(names)}
    try:
        return find_events(Joints(frame, time, by_name))
    except (UserError, KeyError, ValueError, IndexError):
        return None


def phase_curve(time: Floats, events: Events | None) -> list[dict[str, Any]]:
    """Phase of walking, 0 to 1 between the heel strikes of the right foot and unknown elsewhere."""
    strikes = np.sort(events.strike["right"]) if events else np.zeros(0)
    if len(strikes) < 2:
        return []
    count = np.interp(time, strikes, np.arange(len(strikes)), left=np.nan, right=np.nan)
    return [curve("phase", "", count % 1)]


def phase_at(time: float, events: Events | None) -> dict[str, float]:
    """Phase and rate at a time as a start of the tracker has them; empty where they are not known."""
    strikes = np.sort(events.strike["right"]) if events else np.zeros(0)
    after = int(np.searchsorted(strikes, time, "right"))
    if not 0 < after < len(strikes):
        return {}
    stride = float(strikes[after] - strikes[after - 1])
    phase = (time - float(strikes[after - 1])) / stride
    return {"phase": round(phase, 3), "stride_hz": round(1 / stride, 3)}


def event_marks(events: Events | None) -> list[dict[str, Any]]:
    """Give marks of heel strikes on the timeline."""
    if events is None:
        return []
    return [
        {"time": round(float(at), 4), "name": f"{side} heel strike at {at:.2f} s", "side": side}
        for side, times in events.strike.items()
        for at in times
    ]


def off_px(lifted: Lifted, names: tuple[str, ...], sd: Floats) -> Floats:
    """How far joints (T, n) may be from where they are drawn, pixels.

    What the posterior leaves open, and how far the detected point lies from a figure that does not follow it.

    Parameters
    ----------
    lifted : Lifted
    names : tuple of str
        The n joints.
    sd : (T, J)
        Standard deviations of all markers in the picture, pixels.
    """
    motion, points = lifted.motion, lifted.keypoints
    px = sd[:, [motion.names.index(name) for name in names]]
    for column, name in enumerate(points.names):
        if name in names:
            joint = names.index(name)
            px[:, joint] = np.hypot(px[:, joint], np.nan_to_num(motion.error[:, column]))
    return px


@dataclass(frozen=True)
class Proposal:
    """A joint to correct, and how wrong it may be in the picture, pixels."""

    frame: int
    joint: str
    px: float


def proposals(
    frame: npt.NDArray[np.int64],
    time: Floats,
    names: tuple[str, ...],
    px: Floats,
    edits: Edits,
    most: int = PROPOSED,
) -> list[Proposal]:
    """Corrections that would help most: where a joint may be furthest from where it is drawn.

    A correction informs about its joint for a while, so none is proposed near another.

    Parameters
    ----------
    px : (T, J)
        Of `off_px`.
    """
    left = np.nan_to_num(px.copy())
    rows = {int(number): row for row, number in enumerate(frame)}
    for done in edits.corrections:
        if done.joint in names and done.frame in rows:
            left[np.abs(time - time[rows[done.frame]]) < NEAR_S, names.index(done.joint)] = 0.0
    found: list[Proposal] = []
    while len(found) < most and left.size and left.max() > 0:
        row, joint = np.unravel_index(int(left.argmax()), left.shape)
        found.append(Proposal(int(frame[row]), names[joint], float(left[row, joint])))
        left[np.abs(time - time[row]) < NEAR_S, joint] = 0.0
    return found
