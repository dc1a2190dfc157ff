"""Where the next correction tells most: the joints that are least certain in the picture.

Greedy: the joint with the largest deviation in the picture is taken, as if it were corrected, and so on.  A
correction counts for the segment that its frame lies most in the middle of, and what is close in time and of
the same joint is not asked for again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import JOINTS
from gait.lift.clip_segments import ClipSegments
from gait.lift.fit_clip import ClipFit
from gait.lift.corrections import CLICK_SD

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

ENOUGH = 0.03  # statures: joints known this well in the picture need no correction
MOST = 2.0  # corrections per frame that are counted


@dataclass(frozen=True)
class Suggestion:
    """A joint to correct: its frame in the video and its standard deviation in the picture, pixels."""

    frame: int
    joint: str
    sd_px: float


@dataclass
class _Part:
    """Frames of one segment: numbers (T,), slopes (T, J, 2, n) of pixels by the state, covariance (n, n)."""

    frame: Indices
    slope: Floats
    covariance: Floats

    def spread(self) -> Floats:
        """Deviations (T, J) in the picture, both axes together."""
        half = self.slope @ self.covariance
        return np.asarray(np.sqrt(np.maximum((half * self.slope).sum(axis=(2, 3)), 0)))

    def correct(self, at: tuple[int, int], sd: float) -> None:
        """Take a correction of a frame and joint into the covariance."""
        slope = self.slope[at]
        across = self.covariance @ slope.T
        inner = slope @ across + sd**2 * np.eye(2)
        self.covariance = self.covariance - across @ np.linalg.solve(inner, across.T)


def suggest(clip: ClipSegments, fit: ClipFit) -> list[Suggestion]:
    """Corrections, most useful first, until every joint is known within `ENOUGH` of the stature.

    At most `MOST` per frame.
    """
    joints = [j for j in JOINTS if j in clip.prior.names]
    parts = _parts(clip, fit, clip.prior.index(joints))
    spread = [part.spread() for part in parts]
    near = 0.5 * clip.hop / float(np.median(np.diff(clip.film.times))) if len(clip.film.times) > 1 else 1.0
    enough = ENOUGH * clip.placement.stature
    scale = float(np.median([clip.view.scale(body.mean(axis=0)) for body in fit.places]))
    asked: list[Suggestion] = []
    while parts and len(asked) < MOST * len(fit.frame):
        which = int(np.argmax([values.max(initial=0.0) for values in spread]))
        at = np.unravel_index(np.argmax(spread[which]), spread[which].shape)
        frame, joint = int(at[0]), int(at[1])
        sd = float(spread[which][frame, joint])
        if sd <= enough * scale:
            break
        number = int(parts[which].frame[frame])
        asked.append(Suggestion(number, joints[joint], sd))
        parts[which].correct((frame, joint), CLICK_SD)
        spread[which] = parts[which].spread()
        for part, values in zip(parts, spread, strict=True):
            for old in asked:
                values[np.abs(part.frame - old.frame) < near, joints.index(old.joint)] = 0.0
    return asked


def _parts(clip: ClipSegments, fit: ClipFit, joints: Indices) -> list[_Part]:
    """Frames by the segment that they lie most in the middle of."""
    middle = clip.starts + 0.5 * clip.span
    owner = np.argmin(np.abs(clip.film.times[:, None] - middle), axis=1)
    parts = []
    for segment in np.unique(owner):
        own = clip.frames(segment)
        mine = np.isin(own, np.flatnonzero(owner == segment))
        shape = clip.shapes[int(fit.sequence.components[segment])]
        weights = clip.weights(segment)[mine]
        places, by_state = shape.positions(fit.sequence.states[segment], weights, joints)
        _, by_place = clip.view.project(places)
        number = clip.film.first + own[mine]
        parts.append(_Part(number, by_place @ by_state, fit.covariance[segment]))
    return [part for part in parts if len(part.frame)]
