"""Suggested corrections: each is the one that makes all joints most certain in the picture.

Greedy: the correction that is expected to take most from the total variance of all joints is taken, as if it
were made, and so on.  What is close in time and of the same joint is not suggested again.
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
    """Frames that one Gaussian describes.

    Attributes
    ----------
    frame : (T,)
        Numbers in the video.
    slope : (T, J, 2, n)
        Of the joints' pixels by the numbers that the Gaussian is over.
    covariance : (n, n)
        Of those numbers.
    missed : (T, J) or None
        How far each joint is from where it was detected, pixels: more that it may be off.
    missed_around : (T, J) or None
        What a correction also takes from what was missed around it, square pixels, summed over frames.
    lasts : float
        Frames for which a correction of one of these helps.
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
        self.off = np.where(self._open, np.sqrt(square), 0.0)  #: (T, J) pixels, both axes together
        inner = half @ self.slope.swapaxes(2, 3) + CLICK_SD**2 * np.eye(2)
        reach = half @ self._total @ half.swapaxes(2, 3)
        gain = self.lasts * np.trace(np.linalg.solve(inner, reach), axis1=2, axis2=3)
        self.gain = gain if self.missed_around is None else gain + self.missed_around  #: (T, J) square pixels

    def correct(self, row: int, joint: int, sd: float) -> None:
        """Take a correction of a frame and joint into the covariance."""
        slope = self.slope[row, joint]
        across = self.covariance @ slope.T
        inner = slope @ across + sd**2 * np.eye(2)
        self.covariance = self.covariance - across @ np.linalg.solve(inner, across.T)
        self._measure()

    def close(self, frame: int, joint: int, alike: Sequence[int], near: float) -> None:
        """Suggest a joint no more within `near` frames; what joints found `alike` missed there is known."""
        rows = np.abs(self.frame - frame) < near
        if rows.any():
            self._open[rows, joint] = False
            near_by = np.flatnonzero(rows)[:, None], np.array(alike)
            for values in (self.missed, self.missed_around):
                if values is not None:
                    values[near_by] = 0.0
            self._measure()

    def best(self, enough: float) -> tuple[float, int, int]:
        """Gain, row and joint of the best correction of a joint that is further off than `enough`."""
        gain = np.where(self.off > enough, self.gain, 0.0)
        row, joint = (int(at) for at in np.unravel_index(int(gain.argmax()), gain.shape))
        return float(gain[row, joint]), row, joint


def suggest(
    posteriors: Sequence[FramePosterior], joints: Sequence[str], near: float, enough: float, most: int
) -> list[Suggestion]:
    """Corrections, most useful first, until every joint is known in the picture.

    Parameters
    ----------
    posteriors : sequence of FramePosterior
        They are changed.
    joints : sequence of str
        The J joints.
    near : float
        Frames from a correction of a joint within which another of it would add little.
    enough : float
        Pixels within which a joint counts as known.
    most : int
        Corrections to give at most.
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
