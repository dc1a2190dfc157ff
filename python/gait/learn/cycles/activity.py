"""Walking and running told apart by the feet: who runs has both off the ground at times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import JOINTS, SIDES, default_skeleton, points
from gait.learn.solve.body import Body

Floats = npt.NDArray[np.float64]

#: What users may call the two activities that are known by themselves.
NAMES = {
    **dict.fromkeys(("walk", "walking", "gait"), "walk"),
    **dict.fromkeys(("run", "running", "jog", "jogging"), "run"),
}
STANCE = 15  # percentile of a joint's height that is its height in stance; a runner's foot stands for 30 %
CLEAR = 0.018  # statures above that from which both the ankle and the ball of a foot are off the ground
FLIGHT = 0.05  # share of the time in flight above which somebody runs
SOME_FLIGHT, BOB = 0.01, 0.3  # a slow run: less flight, but the pelvis is highest while the feet are apart


@dataclass(frozen=True)
class Feet:
    """Heights in statures over any one level, T frames; NaN where missing.

    Attributes
    ----------
    ankle, ball : (T, 2)
        Left and right.
    pelvis : (T,)
    apart : (T,)
        Distance of the ankles over the ground.
    """

    ankle: Floats
    ball: Floats
    pelvis: Floats
    apart: Floats


@dataclass(frozen=True)
class Footing:
    """What the feet do over some cycles.

    Attributes
    ----------
    flight : float
        Share of the time in which both feet are off the ground.
    bob : float
        Correlation of the pelvis's height with the distance of the ankles: negative in walking, where the
        pelvis is highest over the standing leg, positive in running.
    lift : float
        Range of the ankle's height, the lesser of both feet, statures.
    steps : float
        Spread of the ground under a foot, the larger of both feet, statures.
    """

    flight: float
    bob: float
    lift: float
    steps: float

    @property
    def limit(self) -> float:
        """Share of flight above which this is a run: less where the pelvis moves as in running."""
        return SOME_FLIGHT if self.bob >= BOB else FLIGHT

    @property
    def running(self) -> bool:
        """Whether this is a run and not a walk."""
        return self.flight > self.limit


def of_body(body: Body, stature: float) -> Feet:
    """Feet of recorded joints."""
    ankle, ball = (
        np.stack([body.joints[f"{s}_{joint}"] for s in SIDES], axis=1) / stature for joint in ("ankle", "toe")
    )
    apart = np.linalg.norm(ankle[:, 0, :2] - ankle[:, 1, :2], axis=1)
    return Feet(ankle[..., 2], ball[..., 2], body.joints["pelvis"][:, 2] / stature, apart)


def of_channels(channels: Floats) -> Feet:
    """Feet of angles and root channels (T, 30), by the default skeleton."""
    moving = np.where(np.isfinite(channels), channels, 0.0)
    place = points(default_skeleton().sections(), moving)
    ankle, ball = (place[:, [JOINTS.index(f"{s}_{joint}") for s in SIDES]] for joint in ("ankle", "toe"))
    pelvis = channels[:, -4]
    apart = np.linalg.norm(ankle[:, 0, :2] - ankle[:, 1, :2], axis=1)
    return Feet(ankle[..., 2] + pelvis[:, None], ball[..., 2] + pelvis[:, None], pelvis, apart)


def footing(feet: Feet, cycle: float) -> Footing | None:
    """Measure what the feet do in a stretch of at least one cycle, frames; None if they are not seen."""
    seen = np.isfinite(feet.ankle + feet.ball).all(axis=1) & np.isfinite(feet.pelvis + feet.apart)
    if seen.sum() < cycle:
        return None
    ankle, ball = feet.ankle[seen], feet.ball[seen]
    over = np.minimum(*(z - np.percentile(z, STANCE, axis=0) for z in (ankle, ball)))
    return Footing(
        flight=float((over > CLEAR).all(axis=1).mean()),
        bob=_correlation(feet.pelvis[seen], feet.apart[seen]),
        lift=float(np.min(np.percentile(ankle, 95, axis=0) - np.percentile(ankle, 5, axis=0))),
        steps=float(np.max(_ground(feet, cycle))),
    )


def _ground(feet: Feet, cycle: float) -> Floats:
    """Range (2,) of the ankles' lowest heights in windows of a cycle."""
    height = np.where(np.isfinite(feet.ankle), feet.ankle, np.inf)
    width = min(round(cycle), len(height))
    lowest = np.lib.stride_tricks.sliding_window_view(height, width, axis=0).min(axis=-1)
    lowest = np.where(np.isfinite(lowest), lowest, np.nan)
    return np.asarray(np.nanmax(lowest, axis=0) - np.nanmin(lowest, axis=0))


def _correlation(a: Floats, b: Floats) -> float:
    """Correlation of two signals without their linear trends; 0 if one is constant."""
    time = np.linspace(-1, 1, len(a))
    a, b = (v - np.polyval(np.polyfit(time, v, 1), time) for v in (a, b))
    scale = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / scale if scale > 0 else 0.0
