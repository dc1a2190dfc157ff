"""Segments whose heading is unknown: starts all round, each refined, the evidence decides.

A turn by a small angle h moves a point at X by h (z x X): one more mode, so that a Gauss-Newton step of the
heading is a step of the linear model, and what is unsure about the heading is in the posterior.  The same
passes give a perspective view's noise, which depends on the depth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gait.bindings.segment_prior import SegmentPrior
from gait.lift.chain import LEADING
from gait.lift.observe import Rows
from gait.lift.posterior import GROUND_SD, Gaussian, Posterior, infer, place

Floats = npt.NDArray[np.float64]

STARTS = 8  # headings all round from which a latent one is looked for
TURN_SD = 0.4  # radians from a start: half of what lies between two
PASSES = 12
SETTLED = 1e-4  # radians, and metres of the mean place, between passes
FAR_SD = 100.0  # metres, of the place on the ground in the first pass
ALONE_FLOOR_SD = 0.05  # metres: a segment alone hangs less on it than a sequence
SAME = 0.2  # radians: explanations that are nearer are one

#: Rows given a guess of the places (F, J, 3): `observe.perspective`, or `observe.orthographic` of any guess.
Measure = Callable[[Floats], Rows]


@dataclass(frozen=True)
class Person:
    """What is known of somebody before the measurements.

    Attributes
    ----------
    stature, stature_sd : float
        Metres, as in `posterior.place`.
    at : (x, y)
        Where to look first, metres.
    headings : sequence of float or None
        Radians, from which to look for a latent heading; None: all round.
    """

    stature: float | None = None
    stature_sd: float = 0.0
    at: tuple[float, float] = (0.0, 0.0)
    headings: Sequence[float] | None = None


@dataclass(frozen=True)
class Explanation:
    """A component of the prior at a heading, and the posterior there.

    Attributes
    ----------
    component : int
    heading : float
        Of the prior's axes in the world, radians.
    posterior : Posterior
        If the heading is latent the last mode is the turn, `TURN_SD` radians per deviation.
    share : float
        Probability among the explanations of the same call.
    """

    component: int
    heading: float
    posterior: Posterior
    share: float


def explain(prior: SegmentPrior, measure: Measure, person: Person | None = None) -> list[Explanation]:
    """All distinct explanations of a segment's measurements, the most probable first."""
    known = person or Person()
    starts = [0.0]
    if prior.headings == 0:
        starts = list(np.arange(STARTS) * 2 * np.pi / STARTS if known.headings is None else known.headings)
    found = [
        _refined(prior, component, measure, float(start), known)
        for component in range(prior.components)
        for start in starts
    ]
    return _distinct(found, prior)


def _refined(
    prior: SegmentPrior, component: int, measure: Measure, start: float, person: Person
) -> Explanation:
    """Take Gauss-Newton passes from a start until heading and place settle; the share is not yet known."""
    heading, at, ground_sd, free = start, np.array(person.at), FAR_SD, prior.headings == 0
    places: Floats | None = None
    shape: Floats | None = None
    for _ in range(PASSES):
        gaussian = place(
            prior,
            component,
            stature=person.stature,
            stature_sd=person.stature_sd,
            heading=heading,
            at=at,
            ground_sd=ground_sd,
            height_sd=ALONE_FLOOR_SD,
        )
        guess, first = gaussian.mean if places is None else places, len(gaussian.modes) - gaussian.rigid
        if free:
            gaussian = with_turn(gaussian, guess, at, start - heading)
        posterior = infer(gaussian, measure(gaussian.mean if shape is None else shape))
        places, shape, turn = posterior.points, _shape(posterior), 0.0
        if free:
            turn = start - heading + TURN_SD * float(posterior.alpha[-1])
        heading, at = heading + turn, at + ground_sd * posterior.alpha[first : first + 2]
        ground_sd = GROUND_SD
        if max(abs(turn), float(np.abs((places - guess).mean(axis=(0, 1))).max())) < SETTLED:
            break
    return Explanation(component, heading, posterior, 0.0)


def _shape(posterior: Posterior) -> Floats:
    """Places by the leading modes and the rigid ones: see `chain.moved` for what the others would do."""
    alpha = posterior.alpha.copy()
    alpha[LEADING : len(alpha) - posterior.gaussian.rigid] = 0
    return np.asarray(posterior.gaussian.mean + np.tensordot(alpha, posterior.gaussian.modes, 1))


def with_turn(gaussian: Gaussian, about: Floats, pivot: Floats, offset: float) -> Gaussian:
    """Append the mode of a turn, which is `offset` radians on average and deviates by `TURN_SD`.

    Parameters
    ----------
    about : (F, J, 3)
        Places that are turned.
    pivot : (2,)
        Around it, on the ground.
    """
    away = about[..., :2] - pivot
    step = np.stack([-away[..., 1], away[..., 0], np.zeros(away.shape[:-1])], axis=-1)
    return replace(
        gaussian,
        mean=gaussian.mean + offset * step,
        modes=np.concatenate([gaussian.modes, TURN_SD * step[None]]),
        rigid=gaussian.rigid + 1,
    )


def _distinct(found: list[Explanation], prior: SegmentPrior) -> list[Explanation]:
    """One of each kind with its share, the most probable first; those of one component that met are one."""
    score = np.array([_evidence(e.posterior) + np.log(prior.weights[e.component]) for e in found])
    shares = np.exp(score - score.max())
    shares /= shares.sum()
    kept: list[Explanation] = []
    for k in np.argsort(-score, kind="stable"):
        one = found[k]
        same = next((i for i, other in enumerate(kept) if _same(one, other)), None)
        if same is None:
            kept.append(replace(one, share=float(shares[k])))
        else:
            kept[same] = replace(kept[same], share=kept[same].share + float(shares[k]))
    return sorted(kept, key=lambda e: -e.share)


def _evidence(posterior: Posterior) -> float:
    """Log density of the observations in the picture: rows of farther points count by longer units."""
    return posterior.log_evidence + 0.5 * float(np.log(posterior.rows.variance).sum())


def _same(a: Explanation, b: Explanation) -> bool:
    apart = (a.heading - b.heading + np.pi) % (2 * np.pi) - np.pi
    return a.component == b.component and bool(abs(apart) < SAME)
