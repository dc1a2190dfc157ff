"""The JSON object that scene.js, film.js and curves.js draw.

A page gets one object, made by `motion_data`:

=========== ======================= ==========================================================================
key         shape                   meaning
=========== ======================= ==========================================================================
rate        number                  frames per second of the film
first       integer                 number in the film of the first frame; a frame is an index from 0 below
times       [frame]                 seconds of the film
offset      integer                 frame of the video file that shows index 0 (0 if absent)
joints      [joint]                 names
sides       [joint]                 ``left``, ``right`` or ``middle``
bones       [bone][2]               indices of the two joints of a bone
bone_sides  [bone]                  ``left``, ``right`` or ``middle``
radii       [bone]                  radius of its cylinder, metres
points      [frame][joint][3]       metres; world frame, z up, floor at z = 0; null for a frame without
sd          [frame][joint][3]       standard deviations along x, y and z, metres; null where not known
uv          [frame][joint][2]       pixels of the film, for the overlay; null without a camera
size        [2]                     width and height of the film, pixels
camera      [3] or null             where the camera stands, metres
status      [frame]                 text shown beside the time, such as ``tracking``; null where there is none
curves      list of curves          plots under the film, each with these keys:
  id                                text by which the page finds it
  name, unit                        of the plot
  side                              ``left``, ``right`` or empty: colour and dash
  values    [frame]                 null where not known
  low, high [frame] or null         bounds of the 90 % interval
  limits    [2] or null             of the axis; by the values if null
events      list of events          marks on the timeline: ``time`` in seconds, ``name``, ``side``
strip       [frame]                 how uncertain a frame is, in any unit: a strip under the timeline
=========== ======================= ==========================================================================

Curves of the same `name` share one plot.  Everything but ``rate``, ``times``, ``joints``, ``sides``,
``bones``, ``bone_sides`` and ``points`` may be absent.  Frames may be appended to a page that is open: an
object with the keys by frame alone goes to ``append()`` of the module.  All numbers are finite; unknown ones
are null.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import side_of

Floats = npt.NDArray[np.float64]

RADIUS = {"pelvis": 0.09, "chest": 0.09, "head": 0.08, "hip": 0.07, "knee": 0.06, "shoulder": 0.05}
"""Radius of the cylinder that ends at a joint, metres, by the joint's name without side."""
_THIN = 0.04
COVERAGE = 1.6449
"""Half-width of the 90 % interval of a Gaussian, standard deviations."""


def motion_data(
    rate: float,
    times: Floats,
    joints: Sequence[str],
    bones: Sequence[tuple[int, int]],
    points: Floats,
    sd: Floats | None = None,
    **more: Any,
) -> dict[str, Any]:
    """Make the object of this page's table.

    Parameters
    ----------
    rate : float
    times : (T,)
    joints : (J,) names
    bones : (B, 2) indices of joints
    points, sd : (T, J, 3)
        Metres; frames of NaN have no estimate.
    more : keyword arguments
        Further keys of the table: arrays (NaN becomes null) or plain values.
    """
    found = {
        "rate": rate,
        "times": rounded(times, 6),
        "joints": list(joints),
        "sides": [side_of(joint) for joint in joints],
        "bones": [[int(a), int(b)] for a, b in bones],
        "bone_sides": [_either(side_of(joints[a]), side_of(joints[b])) for a, b in bones],
        "radii": [_radius(joints[b]) for _, b in bones],
        "points": frames(points),
        "sd": None if sd is None else frames(sd),
    }
    return found | {key: _plain(value) for key, value in more.items()}


def curve(
    name: str,
    unit: str,
    values: Floats,
    sd: Floats | None = None,
    side: str = "",
    id: str = "",
    limits: tuple[float, float] | None = None,
) -> dict[str, Any]:
    """Make a curve: `values` (T,) and its 90 % interval by standard deviations `sd` (T,)."""
    low = high = None
    if sd is not None:
        low, high = rounded(values - COVERAGE * sd, 3), rounded(values + COVERAGE * sd, 3)
    return {
        "id": id or f"{name} {side}".strip(),
        "name": name,
        "unit": unit,
        "side": side,
        "values": rounded(values, 3),
        "low": low,
        "high": high,
        "limits": limits,
    }


def rounded(values: npt.ArrayLike, digits: int = 4) -> list[Any]:
    """Convert an array to nested lists, with NaN as null."""
    array = np.asarray(values, float)
    if np.isfinite(array).all():
        return list(np.round(array, digits).tolist())
    return list(np.where(np.isfinite(array), np.round(array, digits), np.array(None)).tolist())


def frames(values: Floats, digits: int = 4) -> list[Any]:
    """Convert an array to nested lists by frame; null for a frame that is not finite."""
    found = np.round(values, digits).tolist()  # all frames at once, which is ten times as fast
    return [one if np.isfinite(each).all() else None for one, each in zip(found, values, strict=True)]


def _either(one: str, other: str) -> str:
    """Return the side of a bone, from the sides of its ends."""
    return other if one == "middle" else one


def _radius(joint: str) -> float:
    return RADIUS.get(joint[2:] if side_of(joint) != "middle" else joint, _THIN)


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return rounded(value)
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    return value
