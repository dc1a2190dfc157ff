"""Track and truth files: CSV with one row per frame and joint positions in the world, in metres."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from types import TracebackType

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from gait.bindings.abi import TrackStatus
from gait.bindings.estimate import Estimate
from gait.body.motion_classes import RUNNING, STANDING
from gait.body.skeleton import EVAL15, JOINTS
from gait.errors import UserError
from gait.io.fields import frame_numbers
from gait.io.files import end_at_a_row, is_unfinished, replacing, require_file
from gait.io.video import Frame, Video

Array = NDArray[np.float64]

STATE_COLUMNS = (
    *("frame", "time", "status", "phase", "stride_hz", "heading_rad", "stature_m", "speed_m_s"),
    *("ess", "log_evidence"),
)
SD_COLUMNS = ("phase_sd", "stride_hz_sd", "heading_sd_rad", "stature_sd_m")
STRIDE_COLUMNS = ("phase", "stride_hz", "speed_m_s", "phase_sd", "stride_hz_sd")
"""Empty in frames in which the person takes no strides; the speed is 0 if the class of motion stands."""
STATUSES = ("init", "tracking", "ambiguous", "lost")


CLASS_COLUMN, CLASS_PREFIX = "motion_class", "p_"
CLIP_COLUMNS = ("reason", "first_frame", "last_frame")
FILM_COLUMN = "film"
PERSON_COLUMN = "person"
#: Columns of words and of whole numbers; all others have numbers.
TEXT_COLUMNS = ("status", CLASS_COLUMN, CLIP_COLUMNS[0], FILM_COLUMN)
WHOLE_COLUMNS = ("frame", *CLIP_COLUMNS[1:], PERSON_COLUMN)
CAMERA_COLUMNS = tuple(f"camera_{k}_{what}" for k in range(1, 5) for what in ("x", "y", "heading"))


#: Columns that may have any finite number, such as times since 1970, or the effective number of more than a
#: million particles; others are at most `LARGEST`.
_UNBOUNDED = ("frame", "time", "ess", "log_evidence", *CLIP_COLUMNS, PERSON_COLUMN)
LARGEST = 1e6
"""Largest magnitude of other numbers in a track, in metres or another unit."""
_NOT_NEGATIVE = re.compile(r"stature_m|ess|.*_sd(_rad|_m)?|.*_s[xyz]")
_PROBABILITY = re.compile(rf"{CLASS_PREFIX}.*|class_probability")
_ROUNDED = 0.01  # most by which the probabilities of a row may differ from a sum of 1


def fault_in(column: str, values: npt.ArrayLike) -> tuple[int, str] | None:
    """Return the index of the first value that a column of a track cannot have, and the remedy; None if none.

    `values`: of shape (n,).
    """
    numbers = np.asarray(values, float)
    most = np.inf if column in _UNBOUNDED else LARGEST
    negative = (numbers < 0) & (_NOT_NEGATIVE.fullmatch(column) is not None)
    share = (numbers < 0) | (numbers > 1 + 1e-6)  # by single precision, slightly more than 1
    for wrong, remedy in (
        (~np.isfinite(numbers), "give a finite number"),
        (np.abs(numbers) > most, f"give a number of at most {most:g}"),
        (negative, "give 0 or more"),
        (share & (_PROBABILITY.fullmatch(column) is not None), "give a probability, from 0 to 1"),
    ):
        if wrong.any():
            return int(wrong.argmax()), remedy
    return None


def fault_of(estimate: Estimate) -> str | None:
    """Describe the first number of an estimate that a track or a page cannot have; None if there is none."""
    mean, sd = estimate.mean, estimate.sd
    columns: dict[str, npt.ArrayLike] = {
        "heading_rad": [mean.heading],
        "heading_sd_rad": [sd.heading],
        "stature_m": [mean.stature],
        "stature_sd_m": [sd.stature],
        "speed_m_s": [estimate.speed],
        "ess": [estimate.ess],
        "log_evidence": [estimate.log_evidence],
        "c_1": mean.coef,
        "c_1_sd": sd.coef,
        "angle_deg": np.degrees(estimate.angles),
        "joint_x": estimate.joints.ravel(),
        "joint_sx": estimate.joint_sd.ravel(),
        "pelvis_x": mean.pelvis,
        "hypothesis_weight": [estimate.hypothesis_weight],
        "class_probability": estimate.class_probability,
    }
    columns |= {name: [getattr(mean, name)] for name in ("phase", "stride_hz", "pitch", "roll")}
    if estimate.takes_strides:
        columns |= {"phase_sd": [sd.phase], "stride_hz_sd": [sd.stride_hz]}
    for name, values in columns.items():
        if (fault := fault_in(name, values)) is not None:
            return f"{_entry(estimate, name, fault[0])} is {np.ravel(values)[fault[0]]:g}"
    return None


def _entry(estimate: Estimate, first: str, k: int) -> str:
    """Name the `k`-th number of those that begin with the column `first` in `fault_of`."""
    if first.startswith("joint_"):
        return f"{estimate.joint_names[k // 3]}_{first.removeprefix('joint_')[:-1]}{'xyz'[k % 3]}"
    if first == "pelvis_x":
        return f"pelvis_{'xyz'[k]} of the state"
    if first.startswith("c_1"):
        return first.replace("1", str(k + 1))
    return f"{first} {k + 1}" if first in ("angle_deg", "class_probability") else first


def require_joints(names: Sequence[str]) -> None:
    """Raise UserError unless a model's joints include those of a track."""
    missing = [name for name in JOINTS if name not in names]
    if missing:
        raise UserError(f"model: has no joint {' '.join(missing)}; learn it with the default skeleton")


def header(components: int, angle_names: tuple[str, ...], classes: tuple[str, ...] = ()) -> list[str]:
    """List the columns of a track file; columns for classes of motion only if the model has several."""
    scores = [f"c_{k + 1}" for k in range(components)]
    joints = [f"{joint}_{axis}" for joint in JOINTS for axis in ("x", "y", "z", "sx", "sy", "sz")]
    sds = [*SD_COLUMNS, *(f"{score}_sd" for score in scores)]
    of_classes = [CLASS_COLUMN, *(f"{CLASS_PREFIX}{name}" for name in classes)] if len(classes) > 1 else []
    return [*STATE_COLUMNS, *scores, *joints, *(f"{name}_deg" for name in angle_names), *sds, *of_classes]


class TrackWriter:
    """Write a track file row by row; it appears under its name when the ``with`` block ends without error.

    If the block is interrupted or a disk is full, the rows written so far are kept as NAME.unfinished.csv.

    Parameters
    ----------
    path
    components : int
        Number of scores per row.
    joint_names, angle_names, classes : tuple of str
        Joints, angles and classes of motion of the model.
    frames : range, optional
        Frames to be tracked, if known; the reasons of estimates are then written too.
    camera_change : callable, optional
        Returns `Track.camera_change` at a time in seconds, for a camera that was estimated from the walk.
    person : int, optional
        Number of the person, if a clip has several.
    film : str, optional
        `Video.digest` of the film that is tracked.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        components: int,
        joint_names: tuple[str, ...],
        angle_names: tuple[str, ...],
        classes: tuple[str, ...] = (),
        frames: range | None = None,
        camera_change: Callable[[float], Array] | None = None,
        person: int | None = None,
        film: str | None = None,
    ) -> None:
        self.path = path
        require_joints(joint_names)
        self._order = [joint_names.index(name) for name in JOINTS]
        self._components = components
        self._classes = len(classes) if len(classes) > 1 else 0
        self._frames, self._camera_change = frames, camera_change
        self._header = header(components, angle_names, classes)
        self._header += CLIP_COLUMNS if frames is not None else ()
        self._header += CAMERA_COLUMNS if camera_change is not None else ()
        self._last = {PERSON_COLUMN: person, FILM_COLUMN: film}
        self._last = {name: value for name, value in self._last.items() if value is not None}
        self._header += self._last
        self._stack = ExitStack()

    def __enter__(self) -> TrackWriter:
        temporary = self._stack.enter_context(replacing(self.path, partial=end_at_a_row))
        file = self._stack.enter_context(open(temporary, "w", newline="", encoding="utf-8"))
        self._csv = csv.writer(file, lineterminator="\n")
        self._csv.writerow(self._header)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> bool | None:
        return self._stack.__exit__(kind, exc, trace)

    def write(self, frame: Frame, estimate: Estimate) -> None:
        """Append the estimate of one frame; without probabilities of all classes, their cells are empty."""
        state, sd = estimate.mean, estimate.sd
        joints = np.hstack([estimate.joints, estimate.joint_sd])[self._order]
        nan = float("nan")
        stride, stride_sd = (
            (one.phase, one.stride_hz) if estimate.takes_strides else (nan, nan) for one in (state, sd)
        )
        values = [*stride, state.heading, state.stature, estimate.speed]
        self._csv.writerow(
            [frame.number, f"{frame.time:.6f}", estimate.status.name.lower()]
            + [_or_empty(value) for value in values]
            + [f"{estimate.ess:.2f}", f"{estimate.log_evidence:.4f}"]
            + [f"{value:.4f}" for value in self._scores(state.coef)]
            + [f"{value:.5f}" for value in joints.ravel()]
            + [f"{value:.3f}" for value in np.degrees(estimate.angles)]
            + [_or_empty(value) for value in (*stride_sd, sd.heading, sd.stature)]
            + [f"{value:.4f}" for value in self._scores(sd.coef)]
            + self._of_class(estimate)
            + self._of_clip(estimate)
            + self._of_camera(frame.time)
            + [*self._last.values()]
        )

    def _of_class(self, estimate: Estimate) -> list[str]:
        if not self._classes:
            return []
        if len(estimate.class_probability) != self._classes:
            return [""] * (1 + self._classes)
        return [estimate.motion_class, *(f"{value:.4f}" for value in estimate.class_probability)]

    def _of_clip(self, estimate: Estimate) -> list[object]:
        if self._frames is None:
            return []
        reason = estimate.reason if estimate.status == TrackStatus.AMBIGUOUS else ""
        return [reason, self._frames[0], self._frames[-1]]

    def _of_camera(self, time: float) -> list[str]:
        change = None if self._camera_change is None else self._camera_change(time)
        return [] if change is None else [f"{value:.6f}" for value in change.T.ravel()]

    def _scores(self, coef: Array) -> Array:
        """Return a value for each score column; scores that a state lacks are 0."""
        return np.pad(np.asarray(coef, float)[: self._components], (0, max(0, self._components - len(coef))))


def _or_empty(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.6f}"


@dataclass(frozen=True)
class Joints:
    """Joint positions over frames: the truth of a clip."""

    frame: NDArray[np.int64]  #: (n,) increasing
    time: Array  #: (n,) seconds
    places: dict[str, Array]  #: (n, 3) metres, world; at least EVAL15

    def eval15(self) -> Array:
        """Return the positions of EVAL15, shape (n, 15, 3)."""
        return np.stack([self.places[name] for name in EVAL15], axis=1)

    @property
    def stands(self) -> NDArray[np.bool_]:
        """Whether the person is known to take no strides, (n,)."""
        return np.zeros(len(self.frame), bool)

    @property
    def runs(self) -> NDArray[np.bool_]:
        """Whether the person is known to run, (n,)."""
        return np.zeros(len(self.frame), bool)


@dataclass(frozen=True)
class Track(Joints):
    """A track file."""

    status: list[str]  #: for each frame: init, tracking, ambiguous or lost
    phase: Array  #: (n,) NaN where the person takes no strides
    sd: dict[str, Array]  #: (n, 3) posterior standard deviations, metres
    #: (n,) for each other column of numbers, by name: state, scores, angles and their standard deviations;
    #: NaN in `STRIDE_COLUMNS` where the person takes no strides, in those of classes where not recorded.
    numbers: dict[str, Array] = field(default_factory=dict)
    #: Class of motion of each frame, '' where not recorded; empty if the model has only one.
    motion_class: list[str] = field(default_factory=list)
    #: Frames that were to be tracked; None if the file does not state them.
    frames: range | None = None
    #: Why whole-clip checks made each frame ambiguous, '' where the tracker itself decided; none if not
    #: stated.
    reason: list[str] = field(default_factory=list)
    #: (n, 3, 4) changes of the pelvis's x and y, metres, and of the heading, radians, per sd of each of four
    #: independent errors of a camera that was estimated from the walk, which are common to all frames; None
    #: if the camera was given.
    camera_change: Array | None = None
    #: `Video.digest` of the film that was tracked; empty if not stated.
    film: str = ""

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the classes of motion of the model that tracked; empty if it has only one."""
        columns = [name for name in self.numbers if name.startswith(CLASS_PREFIX)]
        return tuple(name.removeprefix(CLASS_PREFIX) for name in columns) if self.motion_class else ()

    @property
    def stands(self) -> NDArray[np.bool_]:
        """Whether the class stands or the phase is empty, (n,); nowhere if the track has neither (lifts)."""
        empty = np.isnan(self.phase)
        if not any(self.motion_class):
            return empty & ~empty.all()
        return empty | (np.array(self.motion_class) == STANDING)

    @property
    def runs(self) -> NDArray[np.bool_]:
        """Whether the class is one of `RUNNING`, (n,)."""
        classes = self.motion_class or [""] * len(self.frame)
        return np.array([name.lower() in RUNNING for name in classes], bool)

    def eval15_sd(self) -> Array:
        """Return the standard deviations of EVAL15, shape (n, 15, 3)."""
        return np.stack([self.sd[name] for name in EVAL15], axis=1)

    def compare_film(self, path: str | os.PathLike[str], video: Video) -> str:
        """Compare a film with the one tracked; return a warning, or ''; `path`: of the track, for messages.

        UserError if its frames have other times, so that it cannot be the film that was tracked.
        """
        if self.film in ("", video.digest):
            return ""
        shared = self.frame < video.count
        shown, own = video.times[self.frame[shared]], self.time[shared]
        if (late := np.abs(own - shown)).size and late.max() > 0.5 / video.fps:
            k = int(late.argmax())
            raise UserError(
                f"{video.path}: is not the film that was tracked: its frame {self.frame[shared][k]} is at "
                f"{shown[k]:.2f} s, in {path} at {own[k]:.2f} s; give that film"
            )
        return (
            f"{video.path}: is not the file that was tracked; unless it is a re-encoded copy, "
            f"give the film of {path}"
        )


def read_truth(path: str | os.PathLike[str]) -> Joints:
    """Read ``frame,time`` and ``<joint>_x,_y,_z`` columns; others are ignored."""
    table = _Table(path, "truth")
    names = [name for name in JOINTS if name in EVAL15 or f"{name}_x" in table.rows]
    return Joints(table.frames(), table.numbers("time"), {name: table.vectors(name, "xyz") for name in names})


def read_true_phase(path: str | os.PathLike[str]) -> Array | None:
    """Read the phase (n,) that a truth file states, which falls while the person walks backwards.

    NaN where the person stands; None if the file has no column of it.
    """
    table = _Table(path, "truth")
    if "phase" not in table.rows:
        return None
    phase = table.numbers("phase")
    if (wrong := (phase < 0) | (phase > 1)).any():
        i = int(wrong.argmax())
        raise UserError(f"{path}: line {i + 2}: phase is {phase[i]:g}; give it in strides, from 0 to 1")
    classes = table.rows.get(CLASS_COLUMN, [""] * len(phase))
    return np.where([name == STANDING for name in classes], np.nan, phase)


def read_estimates(path: str | os.PathLike[str]) -> Track:
    """Read a file from ``gait track`` or ``gait lift``.

    Lifted motion has only joints: every status is then ``tracking`` and the phase NaN.
    """
    table = _Table(path, "track")
    if _has_no_state(table):
        count = len(table.frames())
        return _track(table, ["tracking"] * count, np.full(count, np.nan))
    return read_track(path)


def read_track(path: str | os.PathLike[str]) -> Track:
    """Read a file from ``gait track``."""
    table = _Table(path, "track")
    if _has_no_state(table):
        raise UserError(f"{path}: has only joints, as from gait lift; give a track from gait track")
    status = table.column("status")
    for line, word in enumerate(status, 2):
        if word not in STATUSES:
            raise UserError(f"{path}: line {line}: status {word!r} is not one of {' '.join(STATUSES)}")
    return _track(table, status, table.numbers("phase"))


def _has_no_state(table: _Table) -> bool:
    """Whether a file has only joints, as lifted motion and truth have."""
    return not {"status", "phase"} & table.rows.keys()


def _track(table: _Table, status: list[str], phase: Array) -> Track:
    return Track(
        frame=table.frames(),
        time=table.numbers("time"),
        places={name: table.vectors(name, "xyz") for name in JOINTS},
        status=status,
        phase=phase,
        sd={name: table.vectors(name, ("sx", "sy", "sz")) for name in JOINTS},
        numbers={name: table.numbers(name) for name in table.rows if _is_number(name)},
        motion_class=_motion_class(table) if CLASS_COLUMN in table.rows else [],
        frames=_frames(table) if set(CLIP_COLUMNS) <= table.rows.keys() else None,
        reason=table.column("reason") if "reason" in table.rows else [],
        camera_change=_camera_change(table) if set(CAMERA_COLUMNS) <= table.rows.keys() else None,
        film=table.column(FILM_COLUMN)[0] if FILM_COLUMN in table.rows else "",
    )


def _motion_class(table: _Table) -> list[str]:
    """Read the class of motion of each frame, which must be one of those that have probabilities."""
    found, columns = table.column(CLASS_COLUMN), [c for c in table.rows if c.startswith(CLASS_PREFIX)]
    if not columns:
        raise UserError(
            f"{table.path}: column {CLASS_COLUMN} needs a column {CLASS_PREFIX}<class> for each class; give "
            f"the track as it was written, or remove {CLASS_COLUMN}"
        )
    shares = np.stack([table.numbers(column) for column in columns], axis=1)
    classes = [column.removeprefix(CLASS_PREFIX) for column in columns]
    for line, (name, share) in enumerate(zip(found, shares, strict=True), 2):
        fault, given = "", np.isfinite(share)
        if name and name not in classes:
            fault = f"{CLASS_COLUMN} {name!r} is not one of {' '.join(classes)}"
        elif {bool(name)} != set(given.tolist()):
            fault = f"of {CLASS_COLUMN} {' '.join(columns)} some are empty; give all or none"
        elif name and abs(share.sum() - 1) > _ROUNDED:
            fault = f"{' + '.join(columns)} is {share.sum():g}; give probabilities that sum to 1"
        if fault:
            raise UserError(f"{table.path}: line {line}: {fault}")
    return found


def _frames(table: _Table) -> range:
    """Read the frames to be tracked, the same in all rows; if interrupted, those that were reached."""
    first, last = (table.numbers(name) for name in CLIP_COLUMNS[1:])
    return range(int(first[0]), int(table.frames()[-1] if is_unfinished(table.path) else last[0]) + 1)


def _camera_change(table: _Table) -> Array:
    values = np.stack([table.numbers(name) for name in CAMERA_COLUMNS], axis=1)
    return values.reshape(-1, 4, 3).swapaxes(1, 2)


def _is_number(column: str) -> bool:
    """Whether a column belongs in `Track.numbers`."""
    known = column in (*STATE_COLUMNS[3:], *SD_COLUMNS, PERSON_COLUMN) or column.endswith("_deg")
    return known or column.startswith(CLASS_PREFIX) or re.fullmatch(r"c_\d+(_sd)?", column) is not None


class _Table:
    """Columns of a CSV file by name, with errors that name file, line and column."""

    def __init__(self, path: str | os.PathLike[str], what: str) -> None:
        self.path, self.what = path, what
        require_file(path, f"{what} file")
        form = f"give a {what} CSV with a header and one row per frame"
        try:
            with open(path, newline="", encoding="utf-8-sig") as file:
                text = file.read()
            lines = list(csv.reader(io.StringIO(text, newline="")))
        except (UnicodeDecodeError, csv.Error) as exc:
            raise UserError(f"{path}: not a CSV file in UTF-8 ({exc}); {form}") from None
        if len(lines) < 2:
            raise UserError(f"{path}: has no rows; {form}")
        names, *rows = lines
        if "frame" not in names:
            raise UserError(f"{path}: not a {what} file, its header names no frame; {form}")
        for number, row in enumerate(rows, 2):
            if len(row) != len(names):
                raise UserError(
                    f"{path}: line {number} has {len(row)} cells, the header {len(names)}; "
                    "cut off? write it again"
                )
        if what == "track" and not text.endswith(("\n", "\r")):
            raise UserError(f"{path}: line {len(lines)} does not end; cut off? write it again")
        self.rows = dict(zip(names, zip(*rows, strict=True), strict=True))

    def column(self, name: str) -> list[str]:
        if name not in self.rows:
            raise UserError(f"{self.path}: column {name} is missing; a {self.what} file needs it")
        return list(self.rows[name])

    def numbers(self, name: str) -> Array:
        cells = self.column(name)
        values, given = np.empty(len(cells)), np.zeros(len(cells), bool)
        for i, cell in enumerate(cells):
            if not cell and (name in STRIDE_COLUMNS or name.startswith(CLASS_PREFIX)):
                values[i] = np.nan
                continue
            given[i] = True
            try:
                values[i] = float(cell)
            except ValueError:
                values[i] = np.nan
        if (fault := fault_in(name, values[given])) is not None:
            i = int(np.flatnonzero(given)[fault[0]])
            raise UserError(f"{self.path}: line {i + 2}: {name} is {cells[i]!r}; {fault[1]}")
        return values

    def vectors(self, joint: str, axes: str | tuple[str, ...]) -> Array:
        return np.stack([self.numbers(f"{joint}_{axis}") for axis in axes], axis=1)

    def frames(self) -> NDArray[np.int64]:
        return frame_numbers(self.path, self.numbers("frame"))


Floats = npt.NDArray[np.float64]


def write_lifted(
    path: str | os.PathLike[str],
    frame: npt.NDArray[np.integer],
    time: Floats,
    names: Sequence[str],
    places: Floats,
    sd: Floats,
) -> None:
    """Write positions and standard deviations (T, J, 3) of markers, completely or not at all."""
    head = [f"{name}_{axis}" for name in names for axis in ("x", "y", "z", "sx", "sy", "sz")]
    values = np.concatenate([places, sd], axis=2).reshape(len(frame), -1)
    with replacing(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["frame", "time", *head])
        for number, second, row in zip(frame, time, values, strict=True):
            table.writerow([int(number), f"{second:.6f}", *(f"{value:.5f}" for value in row)])
