"""Account for other people in a clip, who hide the tracked person and are foreground.

Where another person is nearest, the tracker does not compare the silhouette (``gait_frame``).  Then their
foreground need not be explained, and a person behind them is hidden rather than absent.  The feet show who is
nearer: on level ground nearer feet are lower in the picture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.detect.outline import ANKLES, draw_person
from gait.io.keypoints_file import Keypoints
from gait.io.video import Frame, Image

Array = NDArray[np.float64]

TRACKED, OTHER = 1, 2
"""Numbers of the tracked person, and of all others, where they are nearest."""

_STANCE_S = 0.25  # seconds before and after, within which the lowest ankle is on the ground
_CLOTHES_REACH = 0.3  # by which head and clothes extend beyond the joints, in distances from shoulder to foot
_REGION = 0.8  # heights; radius around a person's middle in which the tracker uses the picture


class Outline:
    """Area of the picture that one person covers, from the keypoints of each frame.

    Parameters
    ----------
    keypoints : Keypoints
        Interpolated in frames in which the person was not found.
    fps : float
        Frames per second.
    camera : Camera
        Outlines are free of the distortion of its lens.
    """

    def __init__(self, keypoints: Keypoints, fps: float, camera: Camera) -> None:
        self._first, self._names = int(keypoints.frame[0]), list(keypoints.names)
        self._uv = camera.undistorted(_filled(keypoints.uv))
        ankles = self._uv[:, [self._names.index(name) for name in ANKLES], 1].max(axis=1)
        reach = max(1, round(_STANCE_S * fps))
        padded = np.pad(ankles, reach, mode="edge")
        self._foot = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=1)

    def foot(self, number: int) -> float | None:
        """Row of the foot on the ground in a frame, pixels; None outside the person's frames."""
        row = number - self._first
        return float(self._foot[row]) if 0 <= row < len(self._foot) else None

    def box(self, number: int) -> Array | None:
        """Bounding box of the person in a frame: smallest and largest (u, v), (2, 2); None if absent."""
        row = number - self._first
        if not 0 <= row < len(self._uv) or not np.isfinite(self._uv[row]).all():
            return None
        low, high = self._uv[row].min(axis=0), self._uv[row].max(axis=0)
        return np.array([low, high]) + _CLOTHES_REACH * (high[1] - low[1]) * np.array([[-1.0], [1.0]])

    def draw(self, number: int, canvas: Image, value: int) -> None:
        """Set the pixels (h, w) that the person covers in a frame, in place."""
        row = number - self._first
        if self.box(number) is None:
            return
        draw_person(canvas, dict(zip(self._names, self._uv[row], strict=True)), value)


class OtherPeople:
    """Finds who is nearest in each pixel of a frame.

    Parameters
    ----------
    camera : Camera
    own : Outline
        The person who is tracked.
    others : sequence of Outline
    """

    def __init__(self, camera: Camera, own: Outline, others: Sequence[Outline]) -> None:
        self._size, self._own, self._others = camera.size, own, others

    def nearest(self, frame: Frame) -> Image | None:
        """Find the nearest person in each pixel (h, w): `TRACKED`, `OTHER` or 0; None if no one else is near.

        Where no one else is, the tracked person may be left out.
        """
        number = frame.number
        near = [other for other in self._others if self._near(other, number)]
        if not near:
            return None
        foot = self._own.foot(number)
        feet = [other.foot(number) for other in near]
        behind = [foot is not None and theirs is not None and foot > theirs for theirs in feet]
        canvas = np.zeros(self._size[::-1], np.uint8)
        for other, hidden in zip(near, behind, strict=True):
            if hidden:
                other.draw(number, canvas, OTHER)
        if any(behind):
            self._own.draw(number, canvas, TRACKED)
        for other, hidden in zip(near, behind, strict=True):
            if not hidden:
                other.draw(number, canvas, OTHER)
        return canvas

    def _near(self, other: Outline, number: int) -> bool:
        """Whether another person may be in the part of the picture that the tracker uses."""
        mine, theirs = self._own.box(number), other.box(number)
        if theirs is None or mine is None:
            return theirs is not None
        reach = _REGION * (mine[1, 1] - mine[0, 1])
        middle = mine.mean(axis=0)
        return bool((theirs[0] < middle + reach).all() and (theirs[1] > middle - reach).all())


def with_track(keypoints: Keypoints, joints: Mapping[int, Mapping[str, Array]], times: Array) -> Keypoints:
    """Fill keypoints with the joints of a track in frames in which the detector did not find the person.

    Parameters
    ----------
    keypoints : Keypoints
    joints : mapping of int to mapping of str to ndarray of shape (2,)
        Pixels, by frame and name.
    times : ndarray
        Times of all frames of the clip, seconds.
    """
    frames = np.arange(min([int(keypoints.frame[0]), *joints]), max([int(keypoints.frame[-1]), *joints]) + 1)
    uv = np.full((len(frames), len(keypoints.names), 2), np.nan)
    confidence = np.zeros(uv.shape[:2])
    rows = keypoints.frame - frames[0]
    uv[rows], confidence[rows] = keypoints.uv, keypoints.confidence
    for number, at in joints.items():
        row = number - frames[0]
        if not np.isfinite(uv[row]).any() and set(keypoints.names) <= set(at):
            uv[row] = [at[name] for name in keypoints.names]
    return Keypoints(frames, times[frames], keypoints.names, uv, confidence)


def _filled(uv: Array) -> Array:
    """Interpolate missing coordinates (T, J, 2) between frames; NaN for joints that were never found."""
    out = uv.copy()
    rows = np.arange(len(uv))
    for column in out.reshape(len(uv), -1).T:
        found = np.isfinite(column)
        if found.any():
            column[:] = np.interp(rows, rows[found], column[found])
    return out
