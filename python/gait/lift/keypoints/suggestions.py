"""Which correction would help most: where a joint is least certain in the picture, one after the other.

Greedy: the joint that may be furthest from where it is drawn is taken, as if it were corrected, and so on.
What is close in time and of the same joint is not suggested again.
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
    """

    frame: npt.NDArray[np.intp]
    slope: Floats
    covariance: Floats
    missed: Floats | None = None

    def __post_init__(self) -> None:
        self._open = np.ones(self.slope.shape[:2], bool)
        self._measure()

    def _measure(self) -> None:
        half = self.slope @ self.covariance
        square = np.maximum((half * self.slope).sum(axis=(2, 3)), 0)
        if self.missed is not None:
            square = square + self.missed**2
        self.off = np.where(self._open, np.sqrt(square), 0.0)  #: (T, J) pixels, both axes together

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
            if self.missed is not None:
                self.missed[np.flatnonzero(rows)[:, None], np.array(alike)] = 0.0
            self._measure()


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
        which = max(posteriors, key=lambda posterior: float(posterior.off.max(initial=0.0)))
        if not which.off.max(initial=0.0) > enough:
            break
        row, joint = (int(at) for at in np.unravel_index(int(which.off.argmax()), which.off.shape))
        frame = int(which.frame[row])
        asked.append(Suggestion(frame, joints[joint], float(which.off[row, joint])))
        which.correct(row, joint, CLICK_SD)
        for posterior in posteriors:
            posterior.close(frame, joint, found_alike(joints, joints[joint]), near)
    return asked
