"""Check that a recording is cyclic and shows the activity to be learnt: evidence, and reasons in words.

In running both feet are off the ground at times, or the pelvis is lowest over the standing leg, where in
walking it is highest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gait.body.motion_classes import RUNNING
from gait.body.skeleton import ANGLES, JOINTS, SIDES, default_skeleton, points
from gait.learn.arrays import Floats, column_means
from gait.learn.cycles import stride
from gait.learn.cycles.fourier import first_harmonic
from gait.learn.cycles.period import FEWEST_CYCLES, Period
from gait.learn.solve.body import Body

#: Names that users may give to the two activities that can be recognised.
NAMES = {
    **dict.fromkeys(("walk", "walking", "gait"), "walk"),
    **dict.fromkeys(RUNNING, "run"),
}
#: Percentile of a joint's height that is its height in stance; a runner's foot stands for 30 %.
STANCE_PERCENTILE = 15
FLIGHT_CLEARANCE = 0.018  # statures above that from which ankle and ball of a foot are both off the ground
FLIGHT = 0.05  # share of the time in flight above which a person runs
#: Correlation of the pelvis's height with the distance of the feet above which a person runs, with or without
#: flight, as the body is lowest over the standing leg.  Recorded walks have -1 to -0.1, runs 0.5 to 0.9; slow
#: runs, with a foot always on the ground, differ from walks only in this.
BOB = 0.3
SHARPNESS = 3.0
REPEATS = 0.75  # the walks of CMU reach 0.88 to 0.99; punching 0.69, dances and climbing less or nothing
#: Legs that alternate within an eighth of a cycle; the walks of CMU reach 0.96 and more.
LEAST_LEG_ALTERNATION = 0.7
LIFT = 0.02  # statures
STEPS = 0.03  # statures
LEAST_FORWARD_SHARE = 0.5  # the walks of CMU reach 0.98 and more, with left and right swapped -0.98 and less
AHEAD = "ahead"  # name of evidence
CYCLIC = ("cycles", "sharpness", "repeats")  # names of evidence


@dataclass(frozen=True)
class Evidence:
    """A measure, and the limits within which it is accepted."""

    name: str
    value: float  #: NaN, which is accepted, if it could not be measured
    least: float = -np.inf
    most: float = np.inf
    words: str = ""  #: meaning of a value outside the limits

    @property
    def accepted(self) -> bool:
        """Whether the value is not outside the limits."""
        return not (self.value < self.least or self.value > self.most)

    def __str__(self) -> str:
        """Words, value and limit, such as 'the cycles do not repeat (repeats 0.31, at least 0.75)'."""
        limit = self.least if self.value < self.least else self.most
        which = "at least" if self.value < self.least else "at most"
        digits = next((n for n in (2, 3, 4) if f"{self.value:.{n}g}" != f"{limit:.{n}g}"), 6)
        return f"{self.words} ({self.name} {self.value:.{digits}g}, {which} {limit:.4g})"


@dataclass(frozen=True)
class Verdict:
    """Result of judging a recording."""

    activity: str  #: 'walk', 'run', or '' if the feet do not show it
    evidence: tuple[Evidence, ...]

    @property
    def accepted(self) -> bool:
        """Whether all evidence is accepted."""
        return all(e.accepted for e in self.evidence)

    @property
    def cyclic(self) -> bool:
        """Whether the evidence for cycles of any kind is accepted."""
        return all(e.accepted for e in self.evidence if e.name in CYCLIC)

    @property
    def backwards(self) -> bool:
        """Whether all evidence but that for walking ahead is accepted."""
        return [e.name for e in self.evidence if not e.accepted] == [AHEAD]

    @property
    def reason(self) -> str:
        """Why the recording is not accepted, what the reasons have in common once; '' if it is."""
        reasons = list[str]()
        for e in self.evidence:
            if not e.accepted:
                what, colon, why = str(e).partition(": ")
                stated = colon and any(reason.startswith(what + colon) for reason in reasons)
                reasons.append(why if stated else str(e))
        return "; ".join(reasons)


def judge(
    angles: Floats,
    found: Period,
    feet: Footing | None,
    wanted: str,
    yaw: Floats | None = None,
    by_steps: bool = False,
    reverse: bool = False,
) -> Verdict:
    """Judge the steady part of a recording: angles (T, 24), NaN where missing, and its period.

    `feet`: None if they are not visible.  `wanted`: activity to be learnt; names other than those of walking
    and running only require cycles.  `yaw` (T,): yaw of the pelvis from its direction of travel, radians, NaN
    where missing.  `by_steps`: cycles need not repeat, but each side must repeat the other
    (`stride.find_by_steps`).  `reverse`: the recording is read in reversed time.
    """
    kind = NAMES.get(wanted.lower(), "")
    evidence = _repeating_steps(angles, found) if by_steps else _cyclic(angles, found)
    known = ""
    if kind and np.isfinite(found.frames):
        evidence.append(
            Evidence(
                "legs", legs(angles, found.frames), LEAST_LEG_ALTERNATION, words="the legs do not alternate"
            )
        )
    if feet is not None:
        legged = all(e.accepted for e in evidence) and feet.lift >= LIFT
        known = ("run" if feet.running else "walk") if legged else ""
        if kind:
            evidence += _footing(feet, kind)
    if kind and yaw is not None and np.isfinite(yaw).any():
        way = "forwards" if reverse else "backwards"
        words = f"the walk is {way}, or left and right are swapped"
        evidence.append(Evidence(AHEAD, float(np.nanmean(np.cos(yaw))), LEAST_FORWARD_SHARE, words=words))
    return Verdict(known, tuple(evidence))


def _cyclic(angles: Floats, found: Period) -> list[Evidence]:
    """Return the evidence for cycles of any kind."""
    if not np.isfinite(found.frames):
        return [Evidence("cycles", 0.0, FEWEST_CYCLES, words="no cycle found")]
    return [
        Evidence("cycles", len(angles) / found.frames, FEWEST_CYCLES, words="the steady part is too short"),
        Evidence("sharpness", found.sharpness, SHARPNESS, words="no period stands out"),
        Evidence("repeats", repeats(angles, found.frames), REPEATS, words="the cycles do not repeat"),
    ]


def _repeating_steps(angles: Floats, found: Period) -> list[Evidence]:
    """Return the evidence for steps of left and right that are alike, in less than `FEWEST_CYCLES` cycles."""
    cycles, alike = len(angles) / found.frames, stride.step_repeats(angles, found.frames)
    return [
        Evidence("cycles", cycles, stride.FEWEST_STRIDES, words="the trial is too short"),
        Evidence("repeats", alike, REPEATS, words="left and right steps do not match"),
    ]


def _footing(feet: Footing, kind: str) -> list[Evidence]:
    """Return the evidence for walking or running."""
    result = [
        Evidence("lift", feet.lift, LIFT, words="a foot stays on the ground"),
        Evidence("steps", feet.steps, most=STEPS, words="the ground is not level"),
    ]
    if kind == "walk":
        bob, flight = (
            "the body is lowest over the standing leg",
            "both feet leave the ground",
        )
        return [
            *result,
            Evidence("flight", feet.flight, most=FLIGHT, words=f"this is running: {flight}"),
            Evidence("bob", feet.bob, most=BOB, words=f"this is running: {bob}"),
        ]
    words = "this is not running: there is a foot on the ground, and the body is highest over it"
    least = -np.inf if feet.bob > BOB else FLIGHT
    return [*result, Evidence("bob", feet.bob), Evidence("flight", feet.flight, least, words=words)]


def repeats(angles: Floats, period: float) -> float:
    """Return the correlation of all angles with themselves a period later; NaN without overlap.

    Thus each cycle is predicted by another.  Unlike the ratio that chooses the period, this is not inflated
    by the choice among many means.
    """
    moved = angles - column_means(angles)
    return stride.correlation(*stride.with_later(moved, moved, period))


def legs(angles: Floats, period: float) -> float:
    """Return how exactly the legs alternate: 1 if they are half a cycle apart, -1 if they move together.

    It is the cosine of the lag beyond half a cycle between left and right, from the first harmonics of hips
    and knees, each joint weighted by the product of its amplitudes.  Differences between the amplitudes of
    left and right do not count, as people limp.  NaN if nothing moves or is visible.
    """
    left, right = (
        np.array(
            [first_harmonic(angles[:, ANGLES.index(f"{s}_{name}")], period) for name in stride.SWING_ANGLES]
        )
        for s in SIDES
    )
    products = left * right.conj()
    scale = float(np.abs(products).sum())
    return -float(products.real.sum()) / scale if scale > 0 else float("nan")


@dataclass(frozen=True)
class Feet:
    """The feet over T frames, statures above an arbitrary level; NaN where missing."""

    ankle: Floats  #: (T, 2) left and right
    ball: Floats  #: (T, 2)
    pelvis: Floats  #: (T,)
    apart: Floats  #: (T,) horizontal distance of the ankles


@dataclass(frozen=True)
class Footing:
    """Measurements of the feet over some cycles."""

    flight: float  #: share of the time in which both feet are off the ground
    #: Correlation of the pelvis's height with the distance of the ankles: negative in walking, where the
    #: pelvis is highest over the standing leg, positive in running.
    bob: float
    lift: float  #: range of an ankle's height, statures, the smaller of both
    steps: float  #: range of the ground under a foot, statures, the larger of both

    @property
    def running(self) -> bool:
        """Whether this is a run and not a walk."""
        return self.flight > FLIGHT or self.bob > BOB


def feet_of_body(body: Body, stature: float) -> Feet:
    """Return the feet of recorded joints."""
    ankle, ball = (
        np.stack([body.joints[f"{s}_{joint}"] for s in SIDES], axis=1) / stature for joint in ("ankle", "toe")
    )
    apart = np.linalg.norm(ankle[:, 0, :2] - ankle[:, 1, :2], axis=1)
    return Feet(ankle[..., 2], ball[..., 2], body.joints["pelvis"][:, 2] / stature, apart)


def feet_of_channels(channels: Floats) -> Feet:
    """Return the feet of angles and root channels (T, 30) on the default skeleton."""
    moving = np.where(np.isfinite(channels), channels, 0.0)
    place = points(default_skeleton().sections(), moving)
    ankle, ball = (place[:, [JOINTS.index(f"{s}_{joint}") for s in SIDES]] for joint in ("ankle", "toe"))
    pelvis = channels[:, -4]
    apart = np.linalg.norm(ankle[:, 0, :2] - ankle[:, 1, :2], axis=1)
    return Feet(ankle[..., 2] + pelvis[:, None], ball[..., 2] + pelvis[:, None], pelvis, apart)


def footing(feet: Feet, cycle: float) -> Footing | None:
    """Measure the feet over at least one cycle (frames); None if they are visible for less."""
    visible = np.isfinite(feet.ankle + feet.ball).all(axis=1) & np.isfinite(feet.pelvis + feet.apart)
    if visible.sum() < cycle:
        return None
    ankle, ball = feet.ankle[visible], feet.ball[visible]
    over = np.minimum(*(z - np.percentile(z, STANCE_PERCENTILE, axis=0) for z in (ankle, ball)))
    return Footing(
        flight=float((over > FLIGHT_CLEARANCE).all(axis=1).mean()),
        bob=_correlation(feet.pelvis[visible], feet.apart[visible]),
        lift=float(np.min(np.percentile(ankle, 95, axis=0) - np.percentile(ankle, 5, axis=0))),
        steps=float(np.max(_ground(feet, cycle))),
    )


def _ground(feet: Feet, cycle: float) -> Floats:
    """Return the range (2,) of the ankles' lowest heights in windows of a cycle."""
    height = np.where(np.isfinite(feet.ankle), feet.ankle, np.inf)
    width = min(round(cycle), len(height))
    lowest = np.lib.stride_tricks.sliding_window_view(height, width, axis=0).min(axis=-1)
    lowest = np.where(np.isfinite(lowest), lowest, np.nan)
    return np.asarray(np.nanmax(lowest, axis=0) - np.nanmin(lowest, axis=0))


def _correlation(a: Floats, b: Floats) -> float:
    """Return the correlation of two signals without linear trends; 0 if one is constant."""
    time = np.linspace(-1, 1, len(a))
    a, b = (v - np.polyval(np.polyfit(time, v, 1), time) for v in (a, b))
    scale = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / scale if scale > 0 else 0.0
