"""Poses of a camera over time: files, and interpolation."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.fields import table_rows
from gait.io.files import require_file

Array = NDArray[np.float64]

_ROTATION = tuple(f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3))
_MATRIX = (*_ROTATION, "tx", "ty", "tz")
_QUATERNION = ("x", "y", "z", "qx", "qy", "qz", "qw")
_SD_COLUMNS = ("turn_sd_deg", "place_sd_m")
_LENS = ("fx", "fy", "cx", "cy")
LONGEST_POSE_GAP_S = 0.5  #: seconds; poses are not interpolated across longer gaps
_SLACK = 0.02  # seconds before the first and after the last pose in which these are used
_FASTEST = 20.0  # metres, and radians, per second: anything faster is a jump, not a motion
_ROTATED = 1e-3  # by which rows of a rotation may differ from orthonormal
_ONE_PLACE = 0.01  # metres; a camera that moves less only turns


@dataclass(frozen=True)
class CameraPose:
    """Pose of a camera in one frame, ``gait_camera_pose``.

    Attributes
    ----------
    R : ndarray of shape (3, 3)
        World to camera.
    t : ndarray of shape (3,)
        World origin in camera coordinates, metres.
    turn_sd, place_sd : float
        Standard deviations of the rotation about each axis, radians, and of each coordinate of the position,
        metres; 0: exact.
    """

    R: Array
    t: Array
    turn_sd: float = 0.0
    place_sd: float = 0.0

    @staticmethod
    def of(camera: Camera) -> CameraPose:
        """Return the pose of a camera that stands still."""
        return CameraPose(camera.R, camera.t)

    @property
    def centre(self) -> Array:
        """Position of the lens in the world, shape (3,), metres."""
        return np.asarray(-self.R.T @ self.t)

    def camera(self, lens: Camera) -> Camera:
        """Return the camera with this pose and the intrinsics of `lens`."""
        return replace(lens, R=self.R, t=self.t)


def one_place(poses: Sequence[CameraPose]) -> bool:
    """Whether a camera only turns, without moving its lens."""
    centres = np.array([pose.centre for pose in poses])
    return bool(np.hypot.reduce(centres - np.median(centres, axis=0), axis=1).max() < _ONE_PLACE)


def stand_still(poses: Sequence[CameraPose]) -> bool:
    """Whether all poses are the same and exact."""
    first = poses[0]
    return all(
        np.array_equal(one.R, first.R) and np.array_equal(one.t, first.t) and not one.turn_sd + one.place_sd
        for one in poses
    )


@dataclass(frozen=True)
class CameraPath:
    """Poses of one camera over time, for example from a robot.

    Attributes
    ----------
    path : str
        The file, for messages.
    at : ndarray of shape (N,)
        Times in seconds, or numbers of frames.
    by_frame : bool
        Whether `at` contains numbers of frames.
    poses : tuple of CameraPose
    """

    path: str
    at: Array
    by_frame: bool
    poses: tuple[CameraPose, ...]

    @staticmethod
    def read(path: str) -> CameraPath:
        """Read a CSV file with a row for each pose.

        Columns: ``time`` (seconds of the video) or ``frame``; ``r11`` to ``r33`` and ``tx ty tz`` (world to
        camera), or ``x y z qx qy qz qw`` (position of the lens, and rotation from camera to world);
        optionally ``turn_sd_deg`` and ``place_sd_m``.  Others are ignored, but ``fx fy cx cy`` must not
        change.

        Raises
        ------
        UserError
            One line naming file, line and remedy.
        """
        names, table, lines = _read_table(path)
        by_frame = "time" not in names
        at = table[:, names.index("frame" if by_frame else "time")]
        late = np.flatnonzero(np.diff(at) <= 0)
        if len(late):
            raise UserError(
                f"{path}: line {lines[late[0] + 1]}: {'frame' if by_frame else 'time'} does not increase; "
                "sort the rows, one for each time"
            )
        for name in set(_LENS) & set(names):
            if np.ptp(table[:, names.index(name)]) > 1e-3 * abs(table[0, names.index(name)]):
                raise UserError(f"{path}: {name} changes; a camera that zooms cannot be tracked")
        return CameraPath(path, at, by_frame, _poses(path, names, table, lines))

    def at_times(self, times: Sequence[float] | Array, first: int = 0) -> list[CameraPose]:
        """Interpolate poses at the times of frames, seconds; `first` is the number of the first frame.

        Rotations are interpolated along the shortest path, positions of the lens linearly.

        Raises
        ------
        UserError
            If a frame is before the first or after the last pose, or in a gap or a jump of the path.
        """
        times = np.asarray(times, float)
        asked = first + np.arange(len(times), dtype=float) if self.by_frame else times
        rate = (len(times) - 1) / max(times[-1] - times[0], 1e-9) if self.by_frame and len(times) > 1 else 1.0
        slack = _SLACK * rate if not self.by_frame else 0.0
        unit = "frame " if self.by_frame else ""
        for number, moment in enumerate(asked, first):
            if not self.at[0] - slack <= moment <= self.at[-1] + slack:
                raise UserError(
                    f"{self.path}: has poses from {unit}{self.at[0]:g} to {self.at[-1]:g}"
                    f"{'' if self.by_frame else ' s'}, but frame {number} is at {moment:.6g}; give more, or "
                    "--start and --stop"
                )
        asked = np.clip(asked, self.at[0], self.at[-1])
        after = np.clip(np.searchsorted(self.at, asked), 1, max(len(self.at) - 1, 1))
        out = []
        for number, (moment, right) in enumerate(zip(asked, after.tolist(), strict=True), first):
            if len(self.at) == 1 or moment in (self.at[right - 1], self.at[min(right, len(self.at) - 1)]):
                out.append(self.poses[int(np.searchsorted(self.at, moment))])
                continue
            self._require_motion(number, right, (self.at[right] - self.at[right - 1]) / rate)
            share = (moment - self.at[right - 1]) / (self.at[right] - self.at[right - 1])
            out.append(between(self.poses[right - 1], self.poses[right], float(share)))
        return out

    def _require_motion(self, number: int, right: int, seconds: float) -> None:
        """Raise UserError instead of interpolating across a gap or a jump."""
        left, then = self.poses[right - 1], self.poses[right]
        where = f"{self.path}: between {self.at[right - 1]:g} and {self.at[right]:g}"
        if seconds > LONGEST_POSE_GAP_S:
            raise UserError(
                f"{where}, where frame {number} is, poses are {seconds:.2f} s apart; give one every "
                f"{LONGEST_POSE_GAP_S:g} s or more often"
            )
        moved = float(np.linalg.norm(then.centre - left.centre))
        turned = float(np.linalg.norm(_turn(left.R, then.R)))
        if max(moved, turned) > _FASTEST * seconds:
            raise UserError(
                f"{where} the camera jumps {moved:.3g} m and {np.degrees(turned):.3g} degrees; give one "
                "path, in metres"
            )


def _turn(before: Array, after: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(after @ before.T).as_rotvec())


def between(left: CameraPose, right: CameraPose, share: float) -> CameraPose:
    """Interpolate between two poses, `share` from 0 to 1; standard deviations are the larger ones."""
    from scipy.spatial.transform import Rotation

    sd = max(left.turn_sd, right.turn_sd), max(left.place_sd, right.place_sd)
    if np.array_equal(left.R, right.R) and np.array_equal(left.t, right.t):
        return CameraPose(left.R, left.t, *sd)  # without rounding
    R = Rotation.from_rotvec(share * _turn(left.R, right.R)).as_matrix() @ left.R
    return CameraPose(R, -R @ (left.centre + share * (right.centre - left.centre)), *sd)


def write_path(
    path: Path,
    at: Sequence[float],
    poses: Sequence[CameraPose],
    *,
    by_frame: bool,
    lens: Camera | None = None,
) -> None:
    """Write poses for `CameraPath.read`, with full precision, and the intrinsics of `lens` in each row."""
    uncertain = any(pose.turn_sd + pose.place_sd > 0 for pose in poses)
    of_lens = {} if lens is None else {name: getattr(lens, name) for name in _LENS}
    with path.open("w", newline="", encoding="ascii") as file:
        rows = csv.writer(file)
        head = ["frame" if by_frame else "time", *of_lens, *_MATRIX, *(_SD_COLUMNS if uncertain else ())]
        rows.writerow(head)
        for moment, pose in zip(at, poses, strict=True):
            sd = [float(np.degrees(pose.turn_sd)), pose.place_sd] if uncertain else []
            numbers = [*of_lens.values(), *pose.R.ravel().tolist(), *pose.t.tolist(), *sd]
            rows.writerow([moment if by_frame else f"{moment:.6f}", *(repr(float(x)) for x in numbers)])


def _read_table(path: str) -> tuple[list[str], Array, list[int]]:
    """Read a file: names of the columns in use, their numbers (N, columns), and the line of each row."""
    require_file(path, "file of camera poses")
    try:
        rows = table_rows(Path(path).read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError, csv.Error):
        raise UserError(f"{path}: is not text; give CSV with time, r11 to r33, tx, ty, tz") from None
    rows = [(line, cells) for line, cells in rows if any(cell.strip() for cell in cells)]
    head = [cell.strip().lower() for cell in rows[0][1]] if rows else []
    placed = next((names for names in (_MATRIX, _QUATERNION) if set(names) <= set(head)), None)
    if placed is None or not {"time", "frame"} & set(head):
        raise UserError(
            f"{path}: the first line must name time or frame, and r11 to r33, tx, ty, tz or x, y, z, qx, qy, "
            "qz, qw"
        )
    if len(rows) < 2:
        raise UserError(f"{path}: has no pose; give a row for each time")
    wanted = {*placed, *_SD_COLUMNS, *_LENS, "time" if "time" in head else "frame"}
    where = [(name, at) for at, name in enumerate(head) if name in wanted]
    table = [[_number(path, line, cells, at, name) for name, at in where] for line, cells in rows[1:]]
    return [name for name, _ in where], np.array(table), [line for line, _ in rows[1:]]


def _number(path: str, line: int, cells: list[str], at: int, name: str) -> float:
    text = cells[at].strip() if at < len(cells) else ""
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not abs(value) <= 1e9 or (name in _SD_COLUMNS and value < 0):
        least = " of 0 or more" if name in _SD_COLUMNS else ""
        raise UserError(f"{path}: line {line}: {name} is {text[:20]!r}; give a number{least}")
    return value


def _poses(path: str, names: list[str], table: Array, lines: list[int]) -> tuple[CameraPose, ...]:
    def columns(wanted: Sequence[str]) -> Array:
        return table[:, [names.index(name) for name in wanted]]

    sd = [columns([name])[:, 0] if name in names else np.zeros(len(table)) for name in _SD_COLUMNS]
    if set(_MATRIX) <= set(names):
        turns, shifts = columns(_ROTATION).reshape(-1, 3, 3), columns(_MATRIX[9:])
        wrong = np.abs(turns @ turns.swapaxes(1, 2) - np.eye(3)).max(axis=(1, 2)) > _ROTATED
        wrong |= np.linalg.det(turns) < 0
        what = "r11 to r33 are not a rotation; give the one from world to camera, row by row"
    else:
        quaternions, places = columns(_QUATERNION[3:]), columns(_QUATERNION[:3])
        length = np.linalg.norm(quaternions, axis=1)
        wrong = np.abs(length - 1) > _ROTATED
        what = "qx qy qz qw do not have length 1; give the rotation from camera to world"
        turns = _matrices(quaternions[~wrong]) if not wrong.any() else np.zeros((len(table), 3, 3))
        shifts = -np.einsum("nij,nj->ni", turns, places)
    if wrong.any():
        raise UserError(f"{path}: line {lines[int(np.argmax(wrong))]}: {what}")
    return tuple(
        CameraPose(R, t, float(np.radians(turn)), float(place))
        for R, t, turn, place in zip(turns, shifts, *sd, strict=True)
    )


def _matrices(quaternions: Array) -> Array:
    """Convert quaternions (N, 4) from camera to world to rotations (N, 3, 3) from world to camera."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(quaternions).inv().as_matrix())
