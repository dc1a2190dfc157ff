"""One learning sequence: a recording read, its steady part levelled, retargeted, timed and judged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import ANGLES, ROOTS, SIDES
from gait.errors import UserError
from gait.learn.corpus import subjects
from gait.learn.cycles import activity, cycles, period, trim, verdict
from gait.learn.mocap.angle_file import AngleTable
from gait.learn.reading import DEFAULT, Reading
from gait.learn.rotations import unwrap
from gait.learn.solve import readers, retarget, root
from gait.learn.solve.body import Body

Floats = npt.NDArray[np.float64]

YAW = ROOTS.index("root_yaw")
PHASES = 64  # at which it is counted how much of a cycle is seen


@dataclass
class Sequence:
    """The steady part of a recording as the learner uses it, T frames.

    Attributes
    ----------
    name, subject : str
    source : Path
    fps : float
    measures : retarget.Measures or None
        None where the file has angles alone.
    channels : (T, 30)
        Angles and root channels, radians and statures; NaN where missing.
    heading : (T,)
        Radians; NaN where the file does not have it.
    period : period.Period
    strides : (n,)
        Durations of the single strides, seconds: between forward extremes of either ankle, or of either
        knee's flexion where the file has angles alone.
    kept : (start, stop)
        The frames of the file that these are.
    cut : (before, after)
        Why frames before and after them were left out, in words; '' if none were.
    verdict : verdict.Verdict
    recordings : int
        How many recordings of the person tell the lengths of the limbs.
    """

    name: str
    subject: str
    source: Path
    fps: float
    measures: retarget.Measures | None
    channels: Floats
    heading: Floats
    period: period.Period
    strides: Floats
    kept: tuple[int, int]
    cut: tuple[str, str]
    verdict: verdict.Verdict
    recordings: int = 1

    @property
    def cycles(self) -> float:
        """How many cycles the recording holds."""
        return len(self.channels) / self.period.frames


@dataclass
class _Motion:
    """What is known of some frames before the period is used: see `Sequence`."""

    angles: Floats
    track: trim.Track
    body: Body | None = None
    measures: retarget.Measures | None = None
    root: Floats | None = None


def levelled(body: Body, kept: tuple[int, int] | None = None) -> Body:
    """Put a body on a level floor, with the pelvis axes in their standard place.

    Parameters
    ----------
    kept : (start, stop), optional
        Frames to use, all by default; the floor and the pelvis are those of these frames.
    """
    return root.align_pelvis(root.level(body if kept is None else _part_of_body(body, *kept))[0])


def measured(read: Body | AngleTable) -> retarget.Measures | None:
    """Measure the body of a recording, whatever it does; None where the file has angles alone."""
    return None if isinstance(read, AngleTable) else retarget.measure(levelled(read))


def load(path: Path, reading: Reading = DEFAULT) -> Sequence:
    """Read and prepare one file; it is named as if it were alone.

    Raises
    ------
    UserError
        If the file is malformed, or the motion is not cyclic, too short or of another activity.
    """
    return prepare(path, readers.read(path, reading), reading)


def prepare(path: Path, read: Body | AngleTable, reading: Reading = DEFAULT) -> Sequence:
    """Prepare what was read from a file, as `load` does.

    Raises
    ------
    UserError
        If the motion is not cyclic, too short or of another activity.
    """
    motion = _motion(read)
    kept, found = trim.Kept(0, read.frames), None
    if reading.trim:
        kept, found = trim.stretch(motion.angles, read.fps, reading.mode, motion.track)
        if not kept.stop - kept.start >= period.CYCLES * found.frames:
            raise _refused(path, reading.activity, _unsteady(kept, found, read.fps))
    if found is None or kept.stop - kept.start < read.frames:
        motion = _motion(_part(read, kept.start, kept.stop))
        found = period.find(motion.angles, read.fps, reading.mode)
    judged, channels, heading = _judge(motion, found, reading.activity)
    if not judged.accepted:
        other = judged.activity if {judged.activity, reading.activity} == {"walk", "run"} else ""
        raise _refused(path, reading.activity, judged.reason, other)
    if not cycles.fewest(channels, found.frames, PHASES):
        raise _refused(path, reading.activity, "too little is seen of each cycle")
    return Sequence(
        name=subjects.names([path])[0],
        subject=subjects.subjects([path])[0],
        source=path,
        fps=read.fps,
        measures=motion.measures,
        channels=channels,
        heading=heading,
        period=found,
        strides=_strides(motion, heading, found.frames) / read.fps,
        kept=(kept.start, kept.stop),
        cut=(kept.before, kept.after),
        verdict=judged,
    )


def _refused(path: Path, wanted: str, reason: str, other: str = "") -> UserError:
    """Error of a recording that cannot be learnt as the activity, but perhaps as another."""
    remedy = f"; leave it out, or give --activity {other}" if other else "; leave it out"
    return UserError(f"{path}: not learnt as {wanted!r}: {reason}{remedy}")


def _unsteady(kept: trim.Kept, found: period.Period, fps: float) -> str:
    """Say why the stretch that was found is no use."""
    if not np.isfinite(found.frames):
        return "it holds no cycle"
    held = kept.stop - kept.start
    return (
        f"no steady motion: at most {held / fps:.1f} s at a time, {held / found.frames:.1f} cycles "
        f"(at least {period.CYCLES})"
    )


def _part(read: Body | AngleTable, start: int, stop: int) -> Body | AngleTable:
    """Frames start to stop of what was read."""
    if isinstance(read, AngleTable):
        motion = None if read.root is None else read.root[start:stop]
        return replace(read, angles=read.angles[start:stop], root=motion)
    return _part_of_body(read, start, stop)


def _part_of_body(read: Body, start: int, stop: int) -> Body:
    joints = {name: places[start:stop] for name, places in read.joints.items()}
    lateral = {name: axes[start:stop] for name, axes in read.lateral.items()}
    return replace(read, joints=joints, pelvis=read.pelvis[start:stop], lateral=lateral)


def _motion(read: Body | AngleTable) -> _Motion:
    """Angles and what else is known of what was read."""
    if isinstance(read, AngleTable):
        return _Motion(read.angles, trim.Track(), root=read.root)
    body = levelled(read)
    measures = retarget.measure(body)
    yaw = np.arctan2(body.pelvis[:, 1, 0], body.pelvis[:, 0, 0])
    track = trim.Track(body.joints["pelvis"][:, :2], unwrap(yaw[:, None])[:, 0])
    return _Motion(retarget.angles(body, measures), track, body, measures)


def _judge(motion: _Motion, found: period.Period, wanted: str) -> tuple[verdict.Verdict, Floats, Floats]:
    """Verdict, channels (T, 30) and heading (T,); the last two are of use only if it is accepted."""
    frames, feet = len(motion.angles), None
    moving, heading = np.full((frames, len(ROOTS)), np.nan), np.full(frames, np.nan)
    if motion.body is not None and motion.measures is not None and np.isfinite(found.frames):
        feet = activity.of_body(motion.body, motion.measures.stature)
        moving, heading = root.channels(motion.body, motion.measures, found.frames)
    elif motion.root is not None and np.isfinite(found.frames):
        moving = motion.root
        feet = activity.of_channels(np.concatenate([motion.angles, moving], axis=1))
    footing = activity.footing(feet, found.frames) if feet is not None else None
    judged = verdict.judge(motion.angles, found, footing, wanted, moving[:, YAW])
    return judged, np.concatenate([motion.angles, moving], axis=1), heading


def _strides(motion: _Motion, heading: Floats, frames: float) -> Floats:
    """Time successive extremes of each leg, frames."""
    durations = [np.zeros(0)]
    for s in SIDES:
        if motion.body is None:
            forward = motion.angles[:, ANGLES.index(f"{s}_knee_flexion")]
        else:
            along = np.stack([np.cos(heading), np.sin(heading)], axis=1)
            joints = motion.body.joints
            forward = np.sum((joints[f"{s}_ankle"] - joints["pelvis"])[:, :2] * along, axis=1)
        durations.append(np.diff(_peaks(forward, frames)))
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
