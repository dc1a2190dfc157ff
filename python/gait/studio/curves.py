"""Curves under the film: joint angles with intervals, phase, and marks of heel strikes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import CHANNELS, JOINTS
from gait.errors import UserError
from gait.export import angles
from gait.io.track_file import Joints
from gait.motion.footfalls import Events, find_events
from gait.report import terms
from gait.web.motion_data import curve

Floats = npt.NDArray[np.float64]
Angles = dict[str, tuple[Floats, Floats]]

CURVE_ANGLES = ("hip_flexion", "knee_flexion", "elbow_flexion")
"""Angles that are shown, with the signs of the package's skeleton."""
LEG_ANGLES = ("hip_flexion", "knee_flexion")
SIDE_PREFIXES = {"left": "l", "right": "r"}
_PHASE = "0 to 1 between right heel strikes"


def angles_of(names: Sequence[str], places: Floats, covariance: Floats) -> Angles:
    """Compute angles (T,) and their sd (T,), degrees, by channel; empty if a joint is missing.

    Parameters
    ----------
    names : sequence of J str
    places : (T, J, 3)
        Positions of the joints, metres.
    covariance : (T, 3 J, 3 J)
        Covariance of the coordinates of each frame's joints, square metres.
    """
    if not set(JOINTS) <= set(names):
        return {}
    joints = np.array([list(names).index(joint) for joint in JOINTS])
    rows = (3 * joints[:, None] + np.arange(3)).ravel()
    fitted = angles.fit(places[:, joints])
    sds = angles.standard_deviations(fitted, covariance[:, rows[:, None], rows])
    return {
        f"{letter}_{name}": (np.degrees(fitted.angles[:, channel]), np.degrees(sds[:, channel]))
        for name in CURVE_ANGLES
        for letter in SIDE_PREFIXES.values()
        for channel in [CHANNELS.index(f"{letter}_{name}")]
    }


def angle_curves(found: Angles) -> list[dict[str, Any]]:
    """Make the curves of angles (from `angles_of`) with 90 % intervals."""
    curves = []
    for name in CURVE_ANGLES if found else ():
        words, positive, _ = terms.angle(name)
        for side, letter in SIDE_PREFIXES.items():
            curves.append(curve(words, f"°, {positive}", *found[f"{letter}_{name}"], side))
    return curves


def events_of(
    frame: npt.NDArray[np.int64], time: Floats, names: Sequence[str], places: Floats
) -> Events | None:
    """Find heel strikes and toe-offs; None if joints are missing or the person does not walk."""
    by_name = {name: places[:, j] for j, name in enumerate(names)}
    try:
        return find_events(Joints(frame, time, by_name))
    except (UserError, KeyError, ValueError, IndexError):
        return None


def phase_curve(time: Floats, events: Events | None, found: Angles) -> list[dict[str, Any]]:
    """Make the curve of the phase, 0 to 1 between heel strikes of the right foot and unknown elsewhere.

    Its variance follows from those of the legs' angles: 1 / sum of (rate / sd)^2.
    """
    strikes = np.sort(events.strike["right"]) if events else np.zeros(0)
    if len(strikes) < 2:
        return [curve("Phase", "no two right heel strikes", np.full(len(time), np.nan), limits=(0, 1))]
    count = np.interp(time, strikes, np.arange(len(strikes)), left=np.nan, right=np.nan)
    information = np.zeros(len(time))
    for name, (values, sd) in found.items():
        if name[2:] in LEG_ANGLES:
            information += (np.gradient(values, time) * float(np.diff(strikes).mean()) / sd) ** 2
    sd = np.minimum(1 / np.sqrt(np.maximum(information, 1e-9)), 0.5)
    phase = count % 1
    phase[1:][np.diff(phase) < 0] = np.nan  # so that no line joins the end of a cycle to the next
    return [curve("Phase", _PHASE, phase, sd if found else None, limits=(0, 1))]


def phase_at(time: float, events: Events | None) -> dict[str, float]:
    """Return phase and stride rate at a time, with the keys of an init file; empty if unknown."""
    strikes = np.sort(events.strike["right"]) if events else np.zeros(0)
    after = int(np.searchsorted(strikes, time, "right"))
    if not 0 < after < len(strikes):
        return {}
    stride = float(strikes[after] - strikes[after - 1])
    phase = (time - float(strikes[after - 1])) / stride
    return {"phase": round(phase, 3), "stride_hz": round(1 / stride, 3)}


def event_marks(events: Events | None) -> list[dict[str, Any]]:
    """Make the marks of heel strikes on the timeline."""
    if events is None:
        return []
    return [
        {"time": round(float(at), 4), "name": f"{side} heel strike at {at:.2f} s", "side": side}
        for side, times in events.strike.items()
        for at in times
    ]
