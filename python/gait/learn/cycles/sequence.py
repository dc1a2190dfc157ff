"""One learning sequence: the steady part of a recording, levelled, retargeted, timed and checked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
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
#: Times that a refused recording is divided: a walk, a stand, a walk and a run need two.
DIVISIONS = 2
ANOTHER = "another motion"  # why a part is not kept
Part = tuple[int, int]  # first frame, and one past the last


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
    kept: Part  #: these frames in the file
    cut: tuple[str, str]  #: why frames before and after them were left out; '' if none were
    verdict: verdict.Verdict
    part: str = ""  #: which part of the file this is, in words, if the file shows further motions
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


class _Refused(UserError):
    """Why a part of a recording is not learnt."""

    def __init__(
        self, reason: str, part: Part, steady: Part | None = None, cyclic: bool | None = None, other: str = ""
    ) -> None:
        super().__init__(reason)
        self.part = part
        self.steady = steady  #: its steady part; None if that is not why
        self.cyclic = cyclic  #: whether the steady part shows cycles, of any kind; None if not judged
        self.other = other  #: options that might help

    @property
    def frames(self) -> int:
        """Frames of the steady part."""
        return self.steady[1] - self.steady[0] if self.steady else 0

    def parts(self, fewest: float) -> Iterator[Part]:
        """Yield what is before, in and after the steady part, where that is less than all and long enough."""
        edges = self.part[0], *(self.steady or ()), self.part[1]
        for start, stop in pairwise(edges):
            if fewest <= stop - start < self.part[1] - self.part[0]:
                yield start, stop


def load(path: Path, options: LearnOptions = DEFAULT) -> Sequence:
    """Read and prepare one file; the part of its name before '_' is the person's name."""
    return prepare(path, readers.read(path, options), options)


def prepare(path: Path, read: Body | AngleTable, options: LearnOptions = DEFAULT) -> Sequence:
    """Prepare the data read from a file.

    A trial of little more than a stride is prepared from its steps (`Sequence.short`).  A recording that is
    refused as a whole, as it shows several motions, is divided; the longest part that is accepted is used.
    UserError if the motion is not cyclic, is too short, or is of another activity.
    """
    read = read.reversed() if options.reverse else read
    try:
        return _long(path, read, options, (0, read.frames))
    except _Refused as error:
        refusals = [error]
    if (found := _short(path, read, options)) is not None:
        return found
    if options.trim and (parts := _parts(path, read, options, refusals)):
        return max(parts, key=lambda one: len(one.channels))
    raise _explained(path, read, options, refusals)


def _parts(
    path: Path, read: Body | AngleTable, options: LearnOptions, refusals: list[_Refused]
) -> list[Sequence]:
    """Prepare the parts of a recording that was refused; add to `refusals` why others are refused."""
    accepted, divided = list[Sequence](), refusals[:]
    fewest = _fewest(read.fps, options.period_mode)
    for _ in range(DIVISIONS):
        parts, divided = [part for one in divided for part in one.parts(fewest)], []
        for part in parts:
            try:
                accepted.append(_long(path, read, options, part))
            except _Refused as error:
                divided.append(error)
        refusals += divided
    return accepted


def _explained(
    path: Path, read: Body | AngleTable, options: LearnOptions, refusals: list[_Refused]
) -> UserError:
    """Return the error for a recording that is refused, first as a whole and then in parts."""
    alike = [one for one in refusals if one.cyclic is refusals[0].cyclic]
    shown = max([one for one in refusals if one.cyclic] or alike, key=lambda one: one.frames)
    reason, remedy = f"{shown}", f", or give {shown.other}" if shown.other else ""
    tried = (_short(path, read.part(*one.part), options) for one in refusals[1:])
    if short := [one for one in tried if one is not None]:
        longest = max(short, key=lambda one: len(one.channels))
        frames, activity = len(longest.channels), verdict.NAMES[options.activity.lower()]
        reason = (
            f"several motions, of which the longest steady {activity} lasts {frames / read.fps:.1f} s, "
            f"{_cycles(frames, longest.period.frames)}"
        )
    return UserError(f"{path}: not learnt as {_wanted(options)!r}: {reason}; leave it out{remedy}")


def _wanted(options: LearnOptions) -> str:
    return "backwards" if options.reverse else options.activity


def _short(path: Path, read: Body | AngleTable, options: LearnOptions) -> Sequence | None:
    """Prepare a trial too short to repeat; None if it is longer, or its steps do not show the activity."""
    if options.period_mode == "literal" or options.activity.lower() not in verdict.NAMES:
        return None
    kept = steady.Kept(0, read.frames)
    if options.trim:
        kept = steady.active_part(_motion(read).angles, read.fps)
    if kept.stop - kept.start >= period.FEWEST_CYCLES * period.SECONDS[1] * read.fps:
        return None
    motion = _motion(read.part(kept.start, kept.stop))
    found = stride.find_by_steps(motion.angles, read.fps)
    if not kept.stop - kept.start < period.FEWEST_CYCLES * found.frames:
        return None
    judged, channels, heading = _judge(motion, found, options, by_steps=True)
    if not judged.accepted or not cutting.fewest_cycles(channels, found.frames, OBSERVED_PHASES):
        return None
    if _outside(motion.angles, read.fps, found.frames, options.period_mode, repeats=True):
        return None
    kept = _in_file(kept, (0, read.frames), read, options)
    made = _sequence(path, read.fps, motion, kept, (judged, channels, heading), found)
    return replace(made, short=True)


def _long(path: Path, read: Body | AngleTable, options: LearnOptions, part: Part) -> Sequence:
    """Prepare a part of a recording whose cycles repeat; `_Refused` if it cannot be used."""
    motion, mode = _motion(read.part(*part)), options.period_mode
    whole, moving = motion.angles, steady.active_part(motion.angles, read.fps)
    kept, found = steady.Kept(0, len(whole)), None
    if options.trim:
        kept, found = steady.steady_part(whole, read.fps, mode, motion.path)
    steadiest = part[0] + kept.start, part[0] + kept.stop
    if found is not None and not kept.stop - kept.start >= period.FEWEST_CYCLES * found.frames:
        outside = _outside(whole, read.fps, found.frames, mode, repeats=False)
        if words := outside or _too_short(whole, read.fps):
            raise _Refused(words, part)
        raise _Refused(_unsteady(kept, found, read.fps), part, steadiest)
    if found is None or kept.stop - kept.start < len(whole):
        motion = _motion(read.part(*steadiest))
        found = stride.find(motion.angles, read.fps, mode)
    judged, channels, heading = _judge(motion, found, options)
    if words := _outside(motion.angles, read.fps, found.frames, mode, judged.cyclic):
        raise _Refused(words, part)
    if not judged.cyclic and (words := _too_short(whole, read.fps)):
        raise _Refused(words, part)
    left = max(kept.start - moving.start, moving.stop - kept.stop)
    kept = _in_file(kept, part, read, options)
    span = f"{kept.start / read.fps:.1f} to {kept.stop / read.fps:.1f} s of {read.frames / read.fps:.1f} s"
    where = f"{span}: " if read.frames - len(channels) >= _fewest(read.fps, mode) else ""
    if not judged.accepted:
        other = _remedy(judged, _wanted(options))
        raise _Refused(where + judged.reason, part, steadiest, judged.cyclic, other)
    if not cutting.fewest_cycles(channels, found.frames, OBSERVED_PHASES):
        raise _Refused(f"{where}too little of each cycle is observed", part, steadiest, cyclic=True)
    made = _sequence(path, read.fps, motion, kept, (judged, channels, heading), found)
    alone = part == (0, read.frames) and left < period.FEWEST_CYCLES * found.frames
    return made if alone else replace(made, part=span)


def _remedy(judged: verdict.Verdict, wanted: str) -> str:
    """Return the options with which a recording that is refused may be learnt, or ''."""
    if judged.backwards and verdict.NAMES.get(wanted.lower()) == "walk":
        return AS_BACKWARDS
    return AS_ACTIVITY + judged.activity if {judged.activity, wanted} == {"walk", "run"} else ""


def _fewest(fps: float, mode: str) -> float:
    """Return the frames of the shortest motion that can be learnt."""
    return period.FEWEST_CYCLES * period.seconds(mode)[0] * fps


def _in_file(kept: steady.Kept, part: Part, read: Body | AngleTable, options: LearnOptions) -> steady.Kept:
    """Return what is kept of a part, in frames of the file, which may be read in reversed time."""
    start, stop = part[0] + kept.start, part[0] + kept.stop
    before = steady.words(ANOTHER * (part[0] > 0), kept.before)
    after = steady.words(kept.after, ANOTHER * (part[1] < read.frames))
    if options.reverse:
        return steady.Kept(read.frames - stop, read.frames - start, after, before)
    return steady.Kept(start, stop, before, after)


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


def _too_short(angles: Floats, fps: float) -> str:
    """Explain that angles (T, 24) are too short to repeat, by what both sides share, or return ''."""
    moving = steady.active_part(angles, fps)
    count, least = moving.stop - moving.start, period.FEWEST_CYCLES
    if count < least * period.SECONDS[1] * fps:
        part = angles[moving.start : moving.stop]
        cycle = stride.find_by_steps(part, fps).frames
        if count < least * cycle and stride.step_repeats(part, cycle) >= verdict.REPEATS:
            return f"{count / fps:.1f} s of motion are {_cycles(count, cycle)}"
    return ""


def _unsteady(kept: steady.Kept, found: period.Period, fps: float) -> str:
    """Explain why the steady part is too short."""
    if not np.isfinite(found.frames):
        return "no cycle found"
    frames = kept.stop - kept.start
    return f"no steady motion: at most {frames / fps:.1f} s at a time, {_cycles(frames, found.frames)}"


def _cycles(frames: int, cycle: float) -> str:
    """Describe too few cycles, rounded down."""
    return f"{np.floor(100 * frames / cycle) / 100:.2f} cycles (at least {period.FEWEST_CYCLES})"


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
