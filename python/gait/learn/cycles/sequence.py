"""One learning sequence: the steady part of a recording, levelled, retargeted, timed and checked."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gait.body.skeleton import ANGLES, ROOTS, SIDES
from gait.errors import UserError
from gait.learn.arrays import Floats
from gait.learn.cycles import cutting, period, steady, stride, verdict
from gait.learn.mocap.tables import AngleTable
from gait.learn.options import DEFAULT, LearnOptions
from gait.learn.rotations import unwrap
from gait.learn.solve import readers, retarget
from gait.learn.solve.body import Body

YAW = ROOTS.index("root_yaw")
#: Remedies for walks backwards, and for runs and walks, by which `gait.learn.classes.run` sorts recordings.
AS_BACKWARDS, AS_ACTIVITY = "--class backwards=FOLDER", "--activity "
OBSERVED_PHASES = 64  # phases at which the observed share of a cycle is counted


@dataclass
class Sequence:
    """The steady part of a recording as the learner uses it, T frames."""

    name: str
    subject: str
    source: Path
    fps: float  #: frames per second
    measures: retarget.Measures | None  #: None if the file has only angles
    channels: Floats  #: (T, 30) angles and root channels, radians and statures; NaN where missing
    heading: Floats  #: (T,) radians; NaN if the file does not have it
    period: period.Period
    #: (n,) durations of single strides, seconds: between forward extremes of an ankle, or of a knee's flexion
    #: if the file has only angles.
    strides: Floats
    kept: tuple[int, int]  #: start and stop of these frames in the file
    cut: tuple[str, str]  #: why frames before and after them were left out; '' if none were
    verdict: verdict.Verdict
    #: Whether it has fewer cycles than `period.FEWEST_CYCLES`, so that more trials of the person are needed.
    short: bool = False
    recordings: int = 1  #: number of the person's recordings from which limb lengths were estimated

    @property
    def cycles(self) -> float:
        """Number of cycles in the recording."""
        return len(self.channels) / self.period.frames


@dataclass
class _Motion:
    """Data of some frames that do not depend on the period; arrays as in `Sequence`."""

    angles: Floats
    path: steady.RootPath
    body: Body | None = None
    measures: retarget.Measures | None = None
    root: Floats | None = None


def load(path: Path, options: LearnOptions = DEFAULT) -> Sequence:
    """Read and prepare one file; the part of its name before '_' is the person's name."""
    return prepare(path, readers.read(path, options), options)


def prepare(path: Path, read: Body | AngleTable, options: LearnOptions = DEFAULT) -> Sequence:
    """Prepare the data read from a file.

    A trial of little more than a stride is prepared from its steps (`Sequence.short`).  UserError if the
    motion is not cyclic, is too short, or is of another activity.
    """
    read = read.reversed() if options.reverse else read
    try:
        return _long(path, read, options)
    except UserError:
        if (found := _short(path, read, options)) is not None:
            return found
        raise


def _short(path: Path, read: Body | AngleTable, options: LearnOptions) -> Sequence | None:
    """Prepare a trial too short to repeat; None if it is longer, or its steps do not show the activity."""
    if options.period_mode == "literal" or options.activity.lower() not in verdict.NAMES:
        return None
    kept = steady.Kept(0, read.frames)
    if options.trim:
        kept = steady.active_part(_motion(read).angles, read.fps)
    motion = _motion(read.part(kept.start, kept.stop))
    found = stride.find_by_steps(motion.angles, read.fps)
    if not kept.stop - kept.start < period.FEWEST_CYCLES * found.frames:
        return None
    judged, channels, heading = _judge(motion, found, options, by_steps=True)
    if not judged.accepted or not cutting.fewest_cycles(channels, found.frames, OBSERVED_PHASES):
        return None
    if _outside(motion.angles, read.fps, found.frames, options.period_mode, repeats=True):
        return None
    made = _sequence(path, read.fps, motion, kept, (judged, channels, heading), found)
    return replace(made, short=True)


def _long(path: Path, read: Body | AngleTable, options: LearnOptions) -> Sequence:
    """Prepare a recording whose cycles repeat."""
    motion = _motion(read)
    kept, found, mode = steady.Kept(0, read.frames), None, options.period_mode
    wanted = "backwards" if options.reverse else options.activity
    if options.trim:
        kept, found = steady.steady_part(motion.angles, read.fps, mode, motion.path)
        if not kept.stop - kept.start >= period.FEWEST_CYCLES * found.frames:
            outside = _outside(motion.angles, read.fps, found.frames, mode, repeats=False)
            words = outside or _too_short(motion.angles, read.fps) or _unsteady(kept, found, read.fps)
            raise _refused(path, wanted, words)
    whole = motion.angles
    if found is None or kept.stop - kept.start < read.frames:
        motion = _motion(read.part(kept.start, kept.stop))
        found = stride.find(motion.angles, read.fps, mode)
    judged, channels, heading = _judge(motion, found, options)
    if outside := _outside(motion.angles, read.fps, found.frames, mode, judged.cyclic):
        raise _refused(path, wanted, outside)
    if not judged.cyclic and (words := _too_short(whole, read.fps)):
        raise _refused(path, wanted, words)
    if not judged.accepted:
        remedy = AS_ACTIVITY + judged.activity if {judged.activity, wanted} == {"walk", "run"} else ""
        if judged.backwards and verdict.NAMES.get(wanted.lower()) == "walk":
            remedy = AS_BACKWARDS
        raise _refused(path, wanted, judged.reason, remedy)
    if not cutting.fewest_cycles(channels, found.frames, OBSERVED_PHASES):
        raise _refused(path, wanted, "too little of each cycle is observed")
    return _sequence(path, read.fps, motion, kept, (judged, channels, heading), found)


def _sequence(
    path: Path,
    fps: float,
    motion: _Motion,
    kept: steady.Kept,
    judged: tuple[verdict.Verdict, Floats, Floats],
    found: period.Period,
) -> Sequence:
    """Make the sequence from its parts; `judged`: result of `_judge`."""
    why, channels, heading = judged
    return Sequence(
        name=path.stem,
        subject=path.stem.split("_")[0],
        source=path,
        fps=fps,
        measures=motion.measures,
        channels=channels,
        heading=heading,
        period=found,
        strides=_strides(motion, heading, found.frames) / fps,
        kept=(kept.start, kept.stop),
        cut=(kept.before, kept.after),
        verdict=why,
    )


def _outside(angles: Floats, fps: float, found: float, mode: str, repeats: bool) -> str:
    """Explain that the strides are shorter or longer than those searched for, or return ''.

    `found`: the period found, frames; a stride if the motion does not repeat even better just beyond an end
    of the search, and if it is not two or three strides.  `repeats`: whether the motion repeats after it.
    """
    shortest, longest = period.seconds(mode)
    reached = period.climbed(angles, fps, found, mode)
    tried = [found / 2, found / 3] if reached / fps <= longest else []
    if not repeats or reached / fps > longest:
        tried.append(period.find_longer(angles, fps, mode))
    strides = [f for f in (reached, *tried) if _is_stride(angles, f)] + [reached] * repeats
    for seconds in (frames / fps for frames in strides):
        if seconds < shortest:
            what = f"shorter than {shortest:.3g} s, which is the shortest allowed"
        elif seconds > longest:
            what = f"longer than {longest:.3g} s, which is the longest allowed"
        else:
            continue
        return f"strides of {seconds:.2f} s are {what} (see --fps unless it is {fps:g} frames per second)"
    return ""


def _is_stride(angles: Floats, frames: float) -> bool:
    """Whether angles (T, 24) repeat after `frames` frames and the legs alternate; NaN: no."""
    if not (np.isfinite(frames) and verdict.repeats(angles, frames) >= verdict.REPEATS):
        return False
    return bool(verdict.legs(angles, frames) >= verdict.LEAST_LEG_ALTERNATION)


def _refused(path: Path, wanted: str, reason: str, other: str = "") -> UserError:
    """Return the error for a recording not learnt as the activity; `other`: options that might help."""
    remedy = f"; leave it out, or give {other}" if other else "; leave it out"
    return UserError(f"{path}: not learnt as {wanted!r}: {reason}{remedy}")


def _too_short(angles: Floats, fps: float) -> str:
    """Explain that angles (T, 24) are too short to repeat, by what both sides share, or return ''."""
    moving = steady.active_part(angles, fps)
    count, least = moving.stop - moving.start, period.FEWEST_CYCLES
    if count < least * period.SECONDS[1] * fps:
        part = angles[moving.start : moving.stop]
        cycle = stride.find_by_steps(part, fps).frames
        if count < least * cycle and stride.step_repeats(part, cycle) >= verdict.REPEATS:
            return f"{count / fps:.1f} s of motion are {count / cycle:.2f} cycles (at least {least})"
    return ""


def _unsteady(kept: steady.Kept, found: period.Period, fps: float) -> str:
    """Explain why the steady part is too short."""
    if not np.isfinite(found.frames):
        return "no cycle found"
    frames = kept.stop - kept.start
    return (
        f"no steady motion: at most {frames / fps:.1f} s at a time, {frames / found.frames:.2f} cycles "
        f"(at least {period.FEWEST_CYCLES})"
    )


def _motion(read: Body | AngleTable) -> _Motion:
    """Compute the angles and other data of a file's contents."""
    if isinstance(read, AngleTable):
        return _Motion(read.angles, steady.RootPath(), root=read.root)
    body = retarget.levelled(read)
    measures = retarget.measure(body)
    yaw = np.arctan2(body.pelvis[:, 1, 0], body.pelvis[:, 0, 0])
    path = steady.RootPath(body.joints["pelvis"][:, :2], unwrap(yaw[:, None])[:, 0])
    return _Motion(retarget.observed_angles(body, measures), path, body, measures)


def _judge(
    motion: _Motion, found: period.Period, options: LearnOptions, by_steps: bool = False
) -> tuple[verdict.Verdict, Floats, Floats]:
    """Return the verdict, channels (T, 30) and heading (T,); the last two are valid only if accepted."""
    frames, feet = len(motion.angles), None
    moving, heading = np.full((frames, len(ROOTS)), np.nan), np.full(frames, np.nan)
    if motion.body is not None and motion.measures is not None and np.isfinite(found.frames):
        feet = verdict.feet_of_body(motion.body, motion.measures.stature)
        moving, heading = retarget.root_channels(motion.body, motion.measures, found.frames)
    elif motion.root is not None and np.isfinite(found.frames):
        moving = motion.root
        feet = verdict.feet_of_channels(np.concatenate([motion.angles, moving], axis=1))
    footing = verdict.footing(feet, found.frames) if feet is not None else None
    judged = verdict.judge(
        motion.angles, found, footing, options.activity, moving[:, YAW], by_steps, options.reverse
    )
    return judged, np.concatenate([motion.angles, moving], axis=1), heading


def _strides(motion: _Motion, heading: Floats, frames: float) -> Floats:
    """Return the times between successive extremes of each leg, frames."""
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
    """Return sub-frame times of maxima that are the largest within 0.4 period on both sides."""
    reach = int(0.4 * frames)
    times = []
    for t in range(reach, len(signal) - reach):
        window = signal[t - reach : t + reach + 1]
        if np.isfinite(window).all() and np.argmax(window) == reach:
            left, top, right = signal[t - 1 : t + 2]
            bend = left - 2 * top + right
            times.append(t + (0.5 * (left - right) / bend if bend < 0 else 0.0))
    return np.array(times)
