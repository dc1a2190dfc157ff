"""People who were not recorded: a motion with other lengths of limbs and another posture.

A few dozen recordings show a handful of people, and a prior of theirs alone is far too sure about the next
one.  Every recording is therefore also learnt from as it would look of people with joints held a little
differently throughout and with limbs longer or shorter, in pairs of opposite deviations.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import ANGLES, CHANNELS, SIDES, Proportions, points
from gait.learn.prior.lengths import GROUPS
from gait.learn.segments.virtual_markers import MARKERS, marked_skeleton

Floats = npt.NDArray[np.float64]

PAIRS = 4  # of people per recording
#: How differently people hold their joints in the same gait, degrees: about what the cyclic model leaves of
#: a person left out (section CHST); a joint's own name first, then its kind.
POSTURE = {
    "neck": 6.0, "torso": 3.0, "shoulder_rotation": 12.0, "shoulder": 4.0, "elbow": 6.0, "hip_rotation": 4.0,
    "hip": 2.0, "knee": 3.0, "ankle": 3.0,
}  # fmt: skip
LENGTH = 0.05  # relative, of each length at the same stature
FEET = [MARKERS.index(f"{s}_{part}") for s in SIDES for part in ("toe", "heel")]


@dataclass(frozen=True)
class Pose:
    """A body's proportions and its channels (T, 30) over time; `gait.body.skeleton` says what they mean."""

    proportions: Proportions
    channels: Floats

    def places(self) -> Floats:
        """Markers (T, J, 3) about the pelvis, statures."""
        return points(marked_skeleton(self.proportions).sections(), self.channels)


def displacements(pose: Pose, name: str) -> Floats:
    """How far the markers of other people are from a person's, (2 PAIRS, T, J, 3), statures.

    Parameters
    ----------
    name : str
        Of the recording: its people are always the same ones.
    """
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    skeleton = marked_skeleton(pose.proportions)
    groups = (*GROUPS, "head")
    member = np.array([[frame.endswith(group) for frame in skeleton.frames] for group in groups], float)
    posture, sections, own = (
        np.radians([_posture(angle) for angle in ANGLES]),
        skeleton.sections(),
        pose.places(),
    )
    found = []
    for _ in range(PAIRS):
        turns, lengths = rng.normal(size=len(ANGLES)) * posture, rng.normal(size=len(groups)) * LENGTH
        table = np.append(lengths @ member, 0.0)[None]
        for sign in (1.0, -1.0):
            channels = pose.channels + np.pad(sign * turns, (0, len(CHANNELS) - len(ANGLES)))
            other = points({**sections, "PROP": table}, channels, [sign])
            found.append(other - own - _sunk(other, own))
    return np.array(found)


def _posture(angle: str) -> float:
    return next(degrees for part, degrees in POSTURE.items() if part in angle)


def _sunk(other: Floats, own: Floats) -> Floats:
    """Vector (3,) by which the lowest of another's feet is higher than that of the person on average."""
    lowest = [places[:, FEET, 2].min(axis=1) for places in (other, own)]
    difference = lowest[0] - lowest[1]
    seen = difference[np.isfinite(difference)]
    return np.array([0.0, 0.0, seen.mean() if len(seen) else 0.0])
