"""One learning sequence: a recording read, levelled, retargeted and timed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gait.errors import UserError
from gait.learn import period, readers, retarget, root
from gait.learn.body import Body
from gait.learn.reading import DEFAULT, Reading
from gait.skeleton import SIDES

Floats = npt.NDArray[np.float64]

#: Fewer than the three that a clean fold would want: the walks of CMU hold 1.7 to 3.5 strides, and their
#: periods still agree with autocorrelation (tests/python/test_learn_period.py)
LEAST_CYCLES = 1.5


@dataclass
class Sequence:
    """A recording as the learner uses it.

    Attributes
    ----------
    name, subject : str
    source : Path
    fps : float
    measures : retarget.Measures
    channels : (T, 30)
        Angles and root channels, radians and statures.
    heading : (T,)
    period : period.Period
    strides : (n,)
        Durations of the single strides between forward extremes of either ankle, seconds.
    """

    name: str
    subject: str
    source: Path
    fps: float
    measures: retarget.Measures
    channels: Floats
    heading: Floats
    period: period.Period
    strides: Floats

    @property
    def cycles(self) -> float:
        """How many cycles the recording holds."""
        return len(self.channels) / self.period.frames


def subject_of(path: Path) -> str:
    """Name the subject: the part of the file's stem before '_', else the folder."""
    return path.stem.split("_")[0] if "_" in path.stem else path.parent.name


def level_body(path: Path, reading: Reading = DEFAULT) -> Body:
    """Read a recording's joints, on a level floor, with the pelvis axes in their standard place."""
    return root.align_pelvis(root.level(readers.read(path, reading))[0])


def load(path: Path, reading: Reading = DEFAULT) -> Sequence:
    """Read and prepare one file.

    Raises
    ------
    UserError
        If the file is malformed, or the motion is not cyclic or too short.
    """
    walker = level_body(path, reading)
    measures = retarget.measure(walker)
    angles = retarget.angles(walker, measures)
    found = period.find(angles, walker.fps, reading.mode)
    if not found.cyclic:
        raise UserError(
            f"{path}: no cycle found (sharpness {found.sharpness:.1f}); leave it out of the sources"
        )
    if len(angles) < LEAST_CYCLES * found.frames:
        raise UserError(
            f"{path}: {len(angles) / found.frames:.1f} cycles, at least {LEAST_CYCLES} are needed"
        )
    channels, heading = root.channels(walker, measures, found.frames)
    return Sequence(
        name=path.stem if "_" in path.stem else f"{path.parent.name}/{path.stem}",
        subject=subject_of(path),
        source=path,
        fps=walker.fps,
        measures=measures,
        channels=np.concatenate([angles, channels], axis=1),
        heading=heading,
        period=found,
        strides=_strides(walker, heading, found.frames),
    )


def _strides(walker: Body, heading: Floats, frames: float) -> Floats:
    """Time successive forward extremes of each ankle about the pelvis, seconds."""
    along = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    durations = [np.zeros(0)]
    for s in SIDES:
        forward = np.sum((walker.joints[f"{s}_ankle"] - walker.joints["pelvis"])[:, :2] * along, axis=1)
        durations.append(np.diff(_peaks(forward, frames)) / walker.fps)
    return np.concatenate(durations)


def _peaks(signal: Floats, frames: float) -> Floats:
    """Sub-frame times of maxima that are the largest within 0.4 period on both sides."""
    reach = int(0.4 * frames)
    times = []
    for t in range(reach, len(signal) - reach):
        window = signal[t - reach : t + reach + 1]
        if np.isfinite(window).all() and np.argmax(window) == reach:
            left, top, right = signal[t - 1 : t + 2]
            bend = left - 2 * top + right
            times.append(t + (0.5 * (left - right) / bend if bend < 0 else 0.0))
    return np.array(times)
