"""Suggest corrections that would reduce the uncertainty of all joints in the picture most.

Greedy search: choose the correction that is expected to reduce the total variance of all joints most, assume
that it has been made, and repeat.  The same joint is not suggested again within a short time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.lift.keypoints.corrections import CLICK_SD, found_alike

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Suggestion:
    """A joint to correct: its frame in the video and its standard deviation in the picture, pixels."""

    frame: int
    joint: str
    sd_px: float


@dataclass
class FramePosterior:
    """Frames whose posterior is one Gaussian.

    Attributes
    ----------
    frame : (T,)
        Frame numbers in the video.
    slope : (T, J, 2, n)
        Derivatives of the joints' pixels by the Gaussian's n variables.
    covariance : (n, n)
        Covariance of these variables.
    missed : (T, J) or None
        Distance of each joint from its detection, pixels, which adds to its uncertainty.
    missed_around : (T, J) or None
        By how much a correction also reduces such distances around it, square pixels, summed over frames.
    lasts : float
        Number of frames in which a correction of one of them helps.
    """

    frame: npt.NDArray[np.intp]
    slope: Floats
    covariance: Floats
    missed: Floats | None = None
    missed_around: Floats | None = None
    lasts: float = 1.0

    def __post_init__(self) -> None:
        flat = self.slope.reshape(-1, self.slope.shape[-1])
        self._total = flat.T @ flat
        self._open = np.ones(self.slope.shape[:2], bool)
        self._measure()

    def _measure(self) -> None:
        half = self.slope @ self.covariance
        square = np.maximum((half * self.slope).sum(axis=(2, 3)), 0)
        if self.missed is not None:
            square = square + self.missed**2
        self.off = np.where(self._open, np.sqrt(square), 0.0)  #: (T, J) pixels, over both axes
        inner = half @ self.slope.swapaxes(2, 3) + CLICK_SD**2 * np.eye(2)
        reach = half @ self._total @ half.swapaxes(2, 3)
        gain = self.lasts * np.trace(np.linalg.solve(inner, reach), axis1=2, axis2=3)
        self.gain = gain if self.missed_around is None else gain + self.missed_around  #: (T, J) square pixels

    def correct(self, row: int, joint: int, sd: float) -> None:
        """Update the covariance as if a joint had been corrected in a frame."""
        slope = self.slope[row, joint]
        across = self.covariance @ slope.T
        inner = slope @ across + sd**2 * np.eye(2)
        self.covariance = self.covariance - across @ np.linalg.solve(inner, across.T)
        self._measure()

    def close(self, frame: int, joint: int, alike: Sequence[int], near: float) -> None:
        """Suggest a joint no more within `near` frames; there, errors of joints `alike` are then known."""
        rows = np.abs(self.frame - frame) < near
        if rows.any():
            self._open[rows, joint] = False
            near_by = np.flatnonzero(rows)[:, None], np.array(alike)
            for values in (self.missed, self.missed_around):
                if values is not None:
                    values[near_by] = 0.0
            self._measure()

    def best(self, enough: float) -> tuple[float, int, int]:
        """Find gain, row and joint of the best correction, of a joint more uncertain than `enough`."""
        gain = np.where(self.off > enough, self.gain, 0.0)
        row, joint = (int(at) for at in np.unravel_index(int(gain.argmax()), gain.shape))
        return float(gain[row, joint]), row, joint


def suggest(
    posteriors: Sequence[FramePosterior], joints: Sequence[str], near: float, enough: float, most: int
) -> list[Suggestion]:
    """Suggest corrections, most useful first, until every joint is known in the picture.

    Parameters
    ----------
    posteriors : sequence of FramePosterior
        They are changed.
    joints : sequence of str
        Names of the J joints.
    near : float
        Frames around a correction of a joint in which another one of it would add little.
    enough : float
        Standard deviation, pixels, below which a joint counts as known.
    most : int
        Most corrections to suggest.
    """
    asked: list[Suggestion] = []
    while posteriors and len(asked) < most:
        gain, row, joint, k = max((*each.best(enough), k) for k, each in enumerate(posteriors))
        if not gain > 0:
            break
        which = posteriors[k]
        frame = int(which.frame[row])
        asked.append(Suggestion(frame, joints[joint], float(which.off[row, joint])))
        which.correct(row, joint, CLICK_SD)
        for posterior in posteriors:
            posterior.close(frame, joint, found_alike(joints, joints[joint]), near)
    return asked
