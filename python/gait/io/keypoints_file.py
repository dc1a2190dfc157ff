"""Files of 2-D joint keypoints: CSV ``frame,time,<joint>_u,<joint>_v[,<joint>_c]``.

A detector's errors may be given as ``<joint>_sd``, ``<joint>_lasting_sd`` and ``<joint>_frame_sd``, and, in
the first row, ``lasting_s`` and ``repeated``.

An empty cell means that a joint was not seen.  Columns may also be separated by tabs, or by semicolons with
decimal commas.
"""

from __future__ import annotations

import csv
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.errors import UserError
from gait.io import detections
from gait.io.detections import Clip
from gait.io.detector_formats import KNOWN, Reader, reader_of
from gait.io.fields import frame_numbers, table_rows
from gait.io.files import replacing, require_no_device
from gait.progress import warning

Array = NDArray[np.float64]

LEAST_CONFIDENCE = 0.1  # points with less count as not seen

LASTS = 1.0  # seconds for which a lasting error counts as one observation, unless modelled separately
TYPICAL_STRIDE_S = 1.1  # seconds; typical stride time
LONGEST_STEP = 1.0  # seconds between frames; about one stride
SHORTEST_STEP = 1e-5  # seconds between frames; no camera is this fast
LONGEST_KEYPOINT_GAP_S = 0.15  # seconds; keypoints are not interpolated across longer gaps
LONGEST_ROW_GAP_S = 10.0  # seconds without a row that lifting bridges; nothing is known in the middle of it
RATE_DIFFERENCE = 0.05  # relative difference between the rates of keypoints and video; phones vary less
MOST_OUTSIDE_SHARE = 0.5  # share of the points outside the pictures from which they are of another size
TIME_OFF = 0.6  # frames; times are often rounded to half a frame
FURTHEST = 1e6  # largest coordinate, in pixels or units of an orthographic view


@dataclass(frozen=True)
class Keypoints:
    """Keypoints of a person over T frames of one view."""

    frame: NDArray[np.int64]  #: (T,) increasing
    time: Array  #: (T,) seconds, increasing
    names: tuple[str, ...]  #: names of the J points
    #: (T, J, 2) pixels (or metres in an orthographic view), u to the right, v down; NaN where not seen.
    uv: Array
    confidence: Array  #: (T, J) from 0 to 1; 1 if the file has none
    #: (T, J) standard deviation, along an axis, of errors that last some frames, enlarged so that frames may
    #: count as independent: pixels, NaN where unknown.  None: the scatter between frames shows all errors.
    sd: Array | None = None
    #: (T, J) standard deviation, along an axis, of errors that last for many seconds.  None: there are none.
    lasting_sd: Array | None = None
    lasting_s: float = np.inf  #: seconds in which the autocorrelation of a lasting error falls to 1/e
    repeated: float = 0.0  #: share of the variance of other errors that repeats in every stride
    #: (T, J) standard deviation, along an axis, of the errors in one frame, pixels.  None: unknown.
    frame_sd: Array | None = None
    #: (T, J) standard deviation, along an axis, of points marked by hand, pixels; NaN elsewhere.  None: no
    #: such points.
    by_hand: Array | None = None

    @property
    def visible(self) -> NDArray[np.bool_]:
        """Whether each point is seen, shape (T, J)."""
        return np.asarray(np.isfinite(self.uv).all(axis=2))

    @property
    def rate(self) -> float:
        """Frames per second; 1 if there is one frame."""
        return float((len(self.time) - 1) / (self.time[-1] - self.time[0])) if len(self.time) > 1 else 1.0

    def part(self, rows: slice) -> Keypoints:
        """Return the keypoints of some frames."""
        names = ("frame", "time", "uv", "confidence", "sd", "lasting_sd", "frame_sd", "by_hand")
        columns: dict[str, Any] = {}
        for name in names:
            values = getattr(self, name)
            columns[name] = None if values is None else values[rows]
        return replace(self, **columns)

    def among(self, points: NDArray[np.bool_]) -> Keypoints:
        """Return the keypoints of some points (J,)."""
        named = zip(self.names, points, strict=True)
        columns: dict[str, Any] = {"names": tuple(name for name, own in named if own)}
        for name in ("uv", "confidence", "sd", "lasting_sd", "frame_sd", "by_hand"):
            values = getattr(self, name)
            columns[name] = None if values is None else values[:, points]
        return replace(self, **columns)

    def visible_frames(self) -> set[int]:
        """Return the numbers of the frames in which at least one point is seen."""
        return set(self.frame[self.visible.any(axis=1)].tolist())

    def outside(self, size: tuple[int, int]) -> float:
        """Share of the visible points that lie outside a picture of `size` (width, height)."""
        observed = self.uv[self.visible]
        return float(((observed < -0.5) | (observed > np.array(size) - 0.5)).any(axis=1).mean())

    def reach(self) -> tuple[float, float]:
        """Largest u and v, pixels, apart from outliers."""
        u, v = np.nanquantile(self.uv, 0.999, axis=(0, 1))
        return float(u), float(v)

    def require_inside(self, path: str | os.PathLike[str], size: tuple[int, int]) -> None:
        """Raise UserError if most points lie outside a video's pictures of `size`."""
        if (outside := self.outside(size)) > MOST_OUTSIDE_SHARE:
            raise UserError(
                f"{path}: {outside:.0%} of the points are outside the video's {size[0]}x{size[1]} pictures; "
                "give keypoints found in this video, in its pixels"
            )

    def require_extent(self, path: str | os.PathLike[str], sd: float) -> None:
        """Raise UserError if several points all lie within `sd`, and so cannot be in the same unit."""
        observed = self.uv[self.visible]
        extent = float(np.ptp(observed, axis=0).max())
        if self.visible.any(axis=0).sum() > 1 and extent <= sd:
            raise UserError(
                f"{path}: all u and v lie within {extent:.3g}, less than their noise of {sd:g}; give pixels, "
                "not fractions of the picture, or the noise in their unit"
            )

    def compare_times(self, path: str | os.PathLike[str], times: Array) -> str:
        """Compare `time` with the times (n,) of a video's frames, seconds; describe the difference, or ''.

        UserError if the rates differ, since `frame` then does not number the video's frames.
        """
        shared = (self.frame >= 0) & (self.frame < len(times))
        last = int(self.frame[-1])
        beyond = f"has frame {last}, the video ends at {len(times) - 1}" if last >= len(times) else ""
        if len(times) < 2 or shared.sum() < 2:
            return beyond
        own, shown = self.time[shared], times[self.frame[shared]]
        interval = float(np.median(np.diff(times)))
        rate = float(own[-1] - own[0]) / float(shown[-1] - shown[0])
        if not abs(rate - 1) <= RATE_DIFFERENCE:
            step = float(shown[-1] - shown[0]) / float(np.ptp(self.frame[shared]))
            raise UserError(
                f"{path}: time increases by {rate * step:.4g} s a frame, the video by {step:.4g} s; frame "
                "must number the video's frames, from 0"
            )
        late = own - shown
        if not np.abs(late).max() > TIME_OFF * interval:
            return beyond
        frames = float(np.median(late)) / interval
        remedy = "frame numbers the video's frames, from 0"
        return f"time is up to {np.abs(late).max():.3g} s off the video's ({frames:+.1f} frames); {remedy}"

    def require_motion(self, path: str | os.PathLike[str]) -> None:
        """Raise UserError unless these are at least two frames without a long gap."""
        if len(self.time) < 2:
            raise UserError(f"{path}: has one frame; lifting needs motion, so give at least two")
        gap = np.diff(self.time)
        if gap.max() > LONGEST_ROW_GAP_S:
            line = int(gap.argmax()) + 3
            raise UserError(
                f"{path}: line {line}: {gap.max():.3g} s after the frame before; lift the parts before and "
                f"after a gap of more than {LONGEST_ROW_GAP_S:g} s separately"
            )

    def standard_deviations(self, sd: float) -> Array:
        """Return standard deviations (T, J): `sd` at full confidence, inf where not seen."""
        found = np.where(self.visible, sd / np.maximum(self.confidence, LEAST_CONFIDENCE), np.inf)
        return self._with_hand(found)

    def _with_hand(self, sd: Array) -> Array:
        """Replace standard deviations by those of points marked by hand."""
        return sd if self.by_hand is None else np.where(np.isfinite(self.by_hand), self.by_hand, sd)

    def changing(self, sd: float, whole: bool = False) -> Array:
        """Return standard deviations (T, J) without `lasting_sd`; `sd` as in `standard_deviations`.

        If this is the `whole` sequence, errors that repeat in every stride, because the pose does, count
        once.
        """
        jitter = self.standard_deviations(sd)
        if self.sd is None:
            return jitter
        strides = max((self.time[-1] - self.time[0]) / TYPICAL_STRIDE_S, 1.0) if whole else 1.0
        lasting = np.nan_to_num(self.sd) * np.sqrt(1 + self.repeated * (strides - 1))
        return self._with_hand(np.hypot(jitter, lasting))

    def errors(self, sd: float) -> Array:
        """Return standard deviations (T, J) of all errors; `sd` as in `standard_deviations`.

        Lasting errors count as one observation per `LASTS` seconds, so that frames may count as independent.
        """
        if self.lasting_sd is None:
            return self.changing(sd)
        step = float(np.median(np.diff(self.time))) if len(self.time) > 1 else LASTS
        return np.hypot(self.changing(sd), np.nan_to_num(self.lasting_sd) * np.sqrt(max(LASTS / step, 1.0)))

    def in_frame(self, sd: float) -> Array:
        """Return `frame_sd` or, where it is unknown, `standard_deviations`."""
        found = self.standard_deviations(sd)
        return found if self.frame_sd is None else np.where(np.isfinite(self.frame_sd), self.frame_sd, found)


def neighbours(own: Array, times: Array) -> tuple[NDArray[np.intp], Array, NDArray[np.bool_]]:
    """Find the frames of a film between which its keypoints are interpolated at other times.

    Parameters
    ----------
    own : (T,)
        Times of the film's frames, seconds; at least two.
    times : (..., n)
        Seconds after the film began.

    Returns
    -------
    after : (..., n)
        The later of the two frames; the other one is the frame before it.
    share : (..., n)
        Weight of the later frame.
    known : (..., n)
        Whether the time is between the two, which are less than `LONGEST_KEYPOINT_GAP_S` apart.
    """
    after = np.searchsorted(own, times).clip(1, len(own) - 1)
    begin, end = own[after - 1], own[after]
    share = (times - begin) / (end - begin)
    share = np.where(np.abs(share) < 1e-6, 0.0, np.where(np.abs(share - 1) < 1e-6, 1.0, share))
    return after, share, (share >= 0) & (share <= 1) & (end - begin < LONGEST_KEYPOINT_GAP_S)


def read(
    path: str | os.PathLike[str],
    known: Sequence[str],
    ignore_unknown: bool = False,
    clip: Clip | None = None,
) -> tuple[Keypoints, list[str]]:
    """Read keypoints of points named in `known`, from the package's CSV or a file or folder of another tool.

    `clip`: what other tools' files may lack.  Of several people the one who is seen most is taken, with a
    note.  Also returns the ignored points, which are not in `known`.
    UserError if the file is malformed, contains no point, or, unless `ignore_unknown`, contains one that is
    not known; files of other tools may always have such points.
    """
    clip = clip or Clip()
    people, ignored = read_people(path, known, ignore_unknown, clip)
    person = next(iter(people))
    if len(people) > 1:
        warning(f"{path}: has {listed(people)}; took {person} (--person)", clip.quiet)
    return people[person], ignored


def listed(people: Mapping[str, Keypoints]) -> str:
    """List several people by id, with the number of frames in which each is seen."""
    return f"{len(people)} people: {detections.listed({id: len(one.frame) for id, one in people.items()})}"


def read_people(
    path: str | os.PathLike[str], known: Sequence[str], ignore_unknown: bool, clip: Clip
) -> tuple[dict[str, Keypoints], list[str]]:
    """Read the keypoints of everyone in a file, as `read` does; the one who is seen most comes first."""
    if not Path(path).exists():
        raise UserError(f"{path}: no such file of keypoints; check the name")
    require_no_device(path, "file of keypoints")
    if (reader := reader_of(path)) is not None:
        return _read_foreign(path, reader, known, clip)
    head, rows = _table(path)
    if clip.given:
        raise UserError(f"{path}: has one person and times; leave out --person and --fps")
    columns = {name: i for i, name in enumerate(head)}
    for name in ("frame", "time"):
        if name not in columns:
            raise UserError(f"{path}: column {name} is missing; keypoints are frame,time,<joint>_u,<joint>_v")
    points = list(dict.fromkeys(name[:-2] for name in head if name[-2:] in ("_u", "_v")))
    if not points:
        raise UserError(f"{path}: has no columns <joint>_u,<joint>_v; name them by joint, such as l_knee_u")
    for name in points:
        for axis in "uv":
            if f"{name}_{axis}" not in columns:
                raise UserError(f"{path}: column {name}_{axis} is missing; every point needs _u and _v")
    ignored = [name for name in points if name not in known]
    if ignored and not ignore_unknown:
        raise UserError(
            f"{path}: point {ignored[0]!r} is unknown to the model; rename it to one of {' '.join(known)}, "
            "or use --ignore-unknown"
        )
    names = [name for name in points if name in known]
    if not names:
        raise UserError(f"{path}: has no point of the model; rename them to {' '.join(known)}")
    numbers = _Numbers(path, columns, rows)
    frame, time = frame_numbers(path, numbers.required("frame")), numbers.required("time")
    _require_seconds(path, time)
    both = [[numbers.column(f"{name}_{axis}", FURTHEST) for axis in "uv"] for name in names]
    uv = np.moveaxis(np.array(both), 2, 0).copy()
    half = np.isfinite(uv[..., 0]) != np.isfinite(uv[..., 1])
    if half.any():
        t, j = np.argwhere(half)[0]
        raise UserError(f"{path}: line {t + 2}: {names[j]} has only one of _u and _v; give both or none")
    confidence = np.stack([numbers.confidence(f"{name}_c") for name in names], axis=1)
    uv[confidence < LEAST_CONFIDENCE] = np.nan
    if not np.isfinite(uv).any():
        raise UserError(f"{path}: no point is visible in any frame; fill _u and _v")
    refuse_sentinels(path, names, uv)
    sd, lasting_sd, frame_sd = (
        np.stack([numbers.standard_deviation(f"{name}_{error}") for name in names], axis=1)
        if any(f"{name}_{error}" in columns for name in names)
        else None
        for error in ("sd", "lasting_sd", "frame_sd")
    )
    if lasting_sd is not None and frame_sd is not None and (lasting_sd >= frame_sd).any():
        t, j = np.argwhere(lasting_sd >= frame_sd)[0]
        raise UserError(
            f"{path}: line {t + 2}: {names[j]}_lasting_sd is {lasting_sd[t, j]:g}, not less than "
            f"{names[j]}_frame_sd, {frame_sd[t, j]:g}, which contains it; correct one of them"
        )
    lasting_s, repeated = numbers.first("lasting_s", np.inf), numbers.first("repeated", 0.0)
    if not lasting_s > 0:
        raise UserError(f"{path}: line 2: lasting_s is {lasting_s:g}; give seconds above 0")
    if not 0 <= repeated <= 1:
        raise UserError(f"{path}: line 2: repeated is {repeated:g}; give a fraction from 0 to 1")
    errors = {"sd": sd, "lasting_sd": lasting_sd, "frame_sd": frame_sd}
    found = Keypoints(
        frame, time, tuple(names), uv, confidence, lasting_s=lasting_s, repeated=repeated, **errors
    )
    return {"0": found}, ignored


def _require_seconds(path: str | os.PathLike[str], time: Array) -> None:
    """Raise UserError unless times increase in steps that a camera's times in seconds can have."""
    if (np.diff(time) <= 0).any():
        line = int(np.argmax(np.diff(time) <= 0)) + 3
        raise UserError(f"{path}: line {line}: time does not increase; give seconds")
    step = float(np.median(np.diff(time))) if len(time) > 1 else SHORTEST_STEP
    if not SHORTEST_STEP <= step < LONGEST_STEP:
        what = f"time increases by {step:g} per frame"
        raise UserError(f"{path}: {what}; give seconds, not milliseconds or frames")


def _read_foreign(
    path: str | os.PathLike[str], reader: Reader, known: Sequence[str], clip: Clip
) -> tuple[dict[str, Keypoints], list[str]]:
    """Read another tool's file, as `read_people` does."""
    found, names, ignored = detections.read_people(path, reader(path), clip)
    kept = [i for i, name in enumerate(names) if name in known]
    if not kept:
        raise UserError(f"{path}: no point of the model; its points are {' '.join(names)}")
    ignored += [name for name in names if name not in known]
    people = detections.usable(found, lambda person: _joints_of(path, person, names, kept))
    return people, ignored


def _joints_of(
    path: str | os.PathLike[str], person: detections.Person, names: Sequence[str], kept: list[int]
) -> Keypoints:
    """Return the joints of one person with indices `kept`."""
    _require_seconds(path, person.time)
    uv, confidence = person.uv[:, kept], person.confidence[:, kept]
    if not (np.abs(uv[np.isfinite(uv)]) <= FURTHEST).all():
        raise UserError(f"{path}: a point is more than {FURTHEST:g} pixels off; write the file again")
    uv[confidence < LEAST_CONFIDENCE] = np.nan
    if not np.isfinite(uv).any():
        raise UserError(f"{path}: no point has a confidence of {LEAST_CONFIDENCE:g} or more")
    return Keypoints(person.frame, person.time, tuple(names[i] for i in kept), uv, confidence)


def write(path: str | os.PathLike[str], keypoints: Keypoints) -> None:
    """Write keypoints for `read`, rounded to hundredths of a pixel."""
    errors = {"sd": keypoints.sd, "lasting_sd": keypoints.lasting_sd, "frame_sd": keypoints.frame_sd}
    given = {name: values for name, values in errors.items() if values is not None}
    columns = ("u", "v", "c", *given)
    detector = {} if keypoints.lasting_sd is None else {"lasting_s": keypoints.lasting_s}
    detector |= {"repeated": keypoints.repeated} if keypoints.repeated else {}
    points = (f"{name}_{column}" for name in keypoints.names for column in columns)
    head = ["frame", "time", *detector, *points]
    with replacing(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(head)
        for t, frame in enumerate(keypoints.frame):
            row = [str(frame), f"{keypoints.time[t]:.6f}"]
            row += [f"{value:g}" if t == 0 and np.isfinite(value) else "" for value in detector.values()]
            for j, (u, v) in enumerate(keypoints.uv[t]):
                if not np.isfinite(u):
                    row += [""] * len(columns)
                    continue
                row += [f"{u:.4f}", f"{v:.4f}", f"{keypoints.confidence[t, j]:.3g}"]
                row += [f"{values[t, j]:.3f}" for values in given.values()]
            table.writerow(row)


def as_filed(keypoints: Keypoints) -> Keypoints:
    """Write keypoints and read them back, so that results do not depend on whether a file was in between."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "keypoints.csv"
        write(path, keypoints)
        return read(path, keypoints.names)[0]


class _Numbers:
    """Columns of numbers, with errors that name file, line and column."""

    def __init__(self, path: str | os.PathLike[str], columns: dict[str, int], rows: list[list[str]]) -> None:
        self._path, self._columns, self._rows = path, columns, rows

    def column(self, name: str, most: float = sys.float_info.max) -> Array:
        """Return a column's values, between -most and most, NaN where it is empty."""
        values = np.full(len(self._rows), np.nan)
        limit = f" of at most {most:g}" if most < sys.float_info.max else ""
        for i, row in enumerate(self._rows):
            cell = row[self._columns[name]].strip()
            if not cell or cell.lower() == "nan":
                continue
            try:
                values[i] = float(cell)
            except ValueError:
                values[i] = np.inf
            if not abs(values[i]) <= most:
                raise UserError(
                    f"{self._path}: line {i + 2}: {name} is {cell!r}; give a number{limit} or leave it empty"
                )
        return values

    def required(self, name: str) -> Array:
        """Return the values of a column that may have no empty cells."""
        values = self.column(name)
        if np.isnan(values).any():
            raise UserError(
                f"{self._path}: line {int(np.argmax(np.isnan(values))) + 2}: {name} is empty; give a number"
            )
        return values

    def confidence(self, name: str) -> Array:
        """Return confidences; 1 if there is no such column, 0 where it is empty."""
        if name not in self._columns:
            return np.ones(len(self._rows))
        values = self.column(name)
        wrong = (values < 0) | (values > 1)
        if wrong.any():
            i = int(np.argmax(wrong))
            raise UserError(f"{self._path}: line {i + 2}: {name} is {values[i]:g}; give it from 0 to 1")
        return np.nan_to_num(values)

    def first(self, name: str, default: float) -> float:
        """Return the first value of a column, or the default."""
        value = self.column(name)[0] if name in self._columns else np.nan
        return default if np.isnan(value) else float(value)

    def standard_deviation(self, name: str) -> Array:
        """Return standard deviations; NaN if there is no such column or the cell is empty."""
        if name not in self._columns:
            return np.full(len(self._rows), np.nan)
        values = self.column(name, FURTHEST)
        if (values < 0).any():
            i = int(np.argmax(values < 0))
            raise UserError(f"{self._path}: line {i + 2}: {name} is {values[i]:g}; give pixels of 0 or more")
        return values


def _table(path: str | os.PathLike[str]) -> tuple[list[str], list[list[str]]]:
    """Read header and rows of a CSV file; UserError unless all have the same number of cells."""
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
        lines = [row for _, row in table_rows(text) if row]
    except (UnicodeDecodeError, csv.Error) as exc:
        raise UserError(f"{path}: not a CSV file in UTF-8 ({exc}); write or export it again") from None
    if len(lines) < 2:
        raise UserError(f"{path}: has no rows; keypoints are a header and one row per frame")
    head = [name.strip() for name in lines[0]]
    if not {"frame", "time"} & set(head) and not any(name.endswith("_u") for name in head):
        raise UserError(f"{path}: is no table of keypoints, its first line is {lines[0][0][:40]!r}; {KNOWN}")
    twice = next((name for name in head if head.count(name) > 1), None)
    if twice is not None:
        raise UserError(f"{path}: column {twice} appears twice; remove one")
    for number, row in enumerate(lines[1:], 2):
        if len(row) != len(head):
            raise UserError(f"{path}: line {number} has {len(row)} cells, the header {len(head)}")
    return head, lines[1:]


EQUAL_POINTS = 10  # points at exactly the same position, which noise would not produce
COINCIDE = 4  # joints at one position: from the side, hips and pelvis or shoulders and neck meet, not more
FEET_APART = 0.5  # distance from the other points, as a fraction of their extent, at which feet do not meet


def refuse_sentinels(path: str | os.PathLike[str], names: Sequence[str], uv: Array) -> None:
    """Raise UserError for points (T, J, 2) at 0, 0 or -1, -1; a single point at 0, 0 may be the origin."""
    zero, minus = (uv == 0).all(axis=2), (uv == -1).all(axis=2)
    origin = zero.all(axis=0) & (zero.sum(axis=1) == 1)[:, None]
    wrong = (zero & ~origin) | minus
    if wrong.any():
        t, j = np.argwhere(wrong)[0]
        raise UserError(
            f"{path}: line {t + 2}: {names[j]} is at exactly {uv[t, j, 0]:g}, {uv[t, j, 1]:g}, as detectors "
            f"write missing points; leave both cells empty, or give {names[j]}_c 0"
        )


def shared_place(uv: Array) -> tuple[Array, int] | None:
    """Find the position (2,) that several points of (T, J, 2) share exactly, and how often; None if none do.

    Joints can meet in the picture, so the position must be apart from all other points, or shared by more
    joints than can meet.
    """
    observed = np.isfinite(uv).all(axis=2)
    pairs, which, counts = np.unique(uv[observed], axis=0, return_inverse=True, return_counts=True)
    column = np.nonzero(observed)[1]
    for k in np.argsort(-counts)[: len(counts[counts >= EQUAL_POINTS])]:
        at = which.ravel() == k
        shared = len(set(column[at].tolist()))
        if shared >= COINCIDE or (shared > 1 and _beside(pairs[k], uv[observed][~at])):
            return pairs[k], int(counts[k])
    return None


def _beside(place: Array, others: Array) -> bool:
    """Whether a position (2,) is clearly outside the extent of the others (n, 2)."""
    if not len(others):
        return False
    low, high = others.min(axis=0), others.max(axis=0)
    return bool((np.maximum(low - place, place - high) > FEET_APART * (high - low).max()).any())
