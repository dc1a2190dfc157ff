"""Posterior of a segment given 2-D observations in numpy: the independent reference of the C lifter in tests.

Leventon and Freeman (1998), eqs. 5 and 6.  With alpha ~ N(0, I) (the modes are given times their standard
standard deviations), measurements y = G alpha + noise about the mean and noise of covariance R:

    alpha = G' (G G' + R)^-1 y = (I + G' R^-1 G)^-1 G' R^-1 y,    Q = (I + G' R^-1 G)^-1.

The first is the paper's form (`dual`), the second the information form (`infer`).  R holds the noise of the
observations and the markers' variance outside the modes.  `explain` searches for an unknown heading: starts
all round, each refined with the turn by a small angle as one more mode; the evidence decides.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import axis_rotation
from gait.lift.smooth.rows import Rows

Floats = npt.NDArray[np.float64]

LEADING = 3  # modes whose scores enter the shapes that views are linearised around

GROUND_SD = 10.0  # metres, of where a person stands
FLOOR_SD = 0.03  # metres, of the floor's height
LN10 = float(np.log(10))


@dataclass(frozen=True)
class Gaussian:
    """Segments in the world: mean + sum_i alpha_i modes_i + residual, alpha ~ N(0, I); metres.

    Attributes
    ----------
    mean : (F, J, 3)
    modes : (m, F, J, 3)
        Times their standard deviations.
    residual : (J,)
        Variance of each coordinate outside the modes.
    rigid : int
        How many of the modes, the last ones, move the body as a whole.
    """

    mean: Floats
    modes: Floats
    residual: Floats
    rigid: int = 0

    def projected(self, x: Floats) -> Floats:
        """Nearest segment to x (F, J, 3) in the span of the modes about the mean."""
        flat = self.modes.reshape(len(self.modes), -1).T
        scores = np.linalg.lstsq(flat, (x - self.mean).ravel(), rcond=None)[0]
        return np.asarray(self.mean + (flat @ scores).reshape(x.shape))

    def draw(self, rng: np.random.Generator, residual: bool = True) -> Floats:
        """Segment (F, J, 3) drawn from the prior."""
        x = self.mean + np.tensordot(rng.normal(size=len(self.modes)), self.modes, 1)
        return x + rng.normal(size=x.shape) * np.sqrt(self.residual)[:, None] * residual


def place(
    prior: SegmentPrior,
    component: int = 0,
    *,
    stature: float | None = None,
    stature_sd: float = 0.0,
    heading: float = 0.0,
    at: npt.ArrayLike = (0.0, 0.0),
    ground_sd: float = GROUND_SD,
    height_sd: float = FLOOR_SD,
) -> Gaussian:
    """Put a component of the prior into the world; where it stands becomes three rigid modes.

    Parameters
    ----------
    stature, stature_sd : float
        Metres, by default the mean of the people learnt from, exactly; an sd adds a mode of size.
    heading : float
        Turn about z, radians.
    at : (x, y)
        Mean of where the pelvis is in the first frame, metres.
    ground_sd, height_sd : float
        Of that place along x and y, and of the height, metres; 0 leaves the modes out.
    """
    size = prior.stature if stature is None else stature
    turn = size * axis_rotation(2, heading).T
    mean = prior.mean[component] @ turn
    used = prior.modes[component][prior.sd[component] > 0]
    moves = [sd * np.broadcast_to(axis, mean.shape) for sd, axis in _moves(ground_sd, height_sd)]
    if stature_sd:
        moves.append(mean * (stature_sd / size))
    modes = np.concatenate([used @ turn, *(move[None] for move in moves)])
    residual = size**2 * prior.gamma * prior.residual[component]
    return Gaussian(mean + np.append(np.asarray(at, float), 0.0), modes, residual, len(moves))


def _moves(ground_sd: float, height_sd: float) -> list[tuple[float, Floats]]:
    """Give standard deviations and axes of the rigid displacements."""
    moves = zip((ground_sd, ground_sd, height_sd), np.eye(3), strict=True)
    return [(sd, axis) for sd, axis in moves if sd]


@dataclass(frozen=True)
class System:
    """Measurements of a Gaussian: y = design alpha + noise, with white noise of unit variance.

    Attributes
    ----------
    design : (2n, m)
    y : (2n,)
    whiten : (n, 2, 2)
        L^-1 of each point's noise covariance L L'.
    direction : (n, 2, 3)
        As in the rows.
    """

    design: Floats
    y: Floats
    whiten: Floats
    direction: Floats


def system(gaussian: Gaussian, rows: Rows) -> System:
    """Whiten the measurements: the residual of a point makes its two rows' noise correlated."""
    cross = rows.direction @ rows.direction.transpose(0, 2, 1)
    noise = cross * gaussian.residual[rows.marker, None, None]
    noise[:, (0, 1), (0, 1)] += rows.variance
    whiten = np.linalg.inv(np.linalg.cholesky(noise))
    reduced = whiten @ rows.direction
    design = np.einsum("nai,mni->nam", reduced, gaussian.modes[:, rows.frame, rows.marker])
    y = np.einsum("nab,nb->na", whiten, rows.shifted(gaussian.mean).value)
    return System(design.reshape(-1, len(gaussian.modes)), y.ravel(), whiten, rows.direction)


@dataclass(frozen=True)
class Posterior:
    """Posterior of a Gaussian after the measurements.

    Attributes
    ----------
    gaussian, rows, system
        What it was made from.
    alpha : (m,)
        Mean of the scores.
    covariance : (m, m)
        Q, their covariance.
    log_evidence : float
        Log density of the measurements.
    """

    gaussian: Gaussian
    rows: Rows
    system: System
    alpha: Floats
    covariance: Floats
    log_evidence: float

    @property
    def subspace(self) -> Floats:
        """Mean + modes alpha (F, J, 3): the paper's estimate, in the span of the modes."""
        return np.asarray(self.gaussian.mean + np.tensordot(self.alpha, self.gaussian.modes, 1))

    @cached_property
    def _gain(self) -> Floats:
        """Residual of a measured point by its whitened measurements, (n, 3, 2)."""
        psi = self.gaussian.residual[self.rows.marker, None, None]
        return np.asarray(psi * (self.system.whiten @ self.system.direction).transpose(0, 2, 1))

    @property
    def points(self) -> Floats:
        """Posterior mean of the markers (F, J, 3), including what lies outside the modes."""
        rest = (self.system.y - self.system.design @ self.alpha).reshape(-1, 2)
        x = self.subspace
        np.add.at(x, (self.rows.frame, self.rows.marker), np.einsum("nia,na->ni", self._gain, rest))
        return x

    @cached_property
    def _uncertainty(self) -> tuple[Floats, Floats]:
        """Places by the scores (F, J, 3, m), and the remaining covariance (F, J, 3, 3) of each."""
        by_scores = np.moveaxis(self.gaussian.modes, 0, -1).copy()  # (F, J, 3, m)
        frames, markers = self.gaussian.mean.shape[:2]
        outside = np.eye(3) * np.broadcast_to(self.gaussian.residual, (frames, markers))[..., None, None]
        at, gain = (self.rows.frame, self.rows.marker), self._gain
        count = len(self.alpha)
        np.subtract.at(by_scores, at, gain @ self.system.design.reshape(-1, 2, count))
        np.subtract.at(outside, at, gain @ gain.transpose(0, 2, 1))
        return by_scores, outside

    @property
    def covariances(self) -> Floats:
        """Posterior covariance of each marker in each frame, (F, J, 3, 3)."""
        by_scores, outside = self._uncertainty
        return np.asarray(by_scores @ self.covariance @ by_scores.swapaxes(-1, -2) + outside)

    @property
    def sd(self) -> Floats:
        """Posterior standard deviation of each coordinate, (F, J, 3)."""
        return _standard_deviations(self.covariances)

    def rooted_sd(self, left: int, right: int) -> Floats:
        """Give standard deviations (F, J, 3) of the places about the middle of two markers."""
        by_scores, outside = self._uncertainty
        ends = [left, right]
        apart = by_scores - by_scores[:, ends].mean(axis=1, keepdims=True)
        middle = outside[:, ends].sum(axis=1, keepdims=True) / 4
        own = outside + middle
        own[:, ends] -= outside[:, ends]  # half of an end is in the middle
        return _standard_deviations(apart @ self.covariance @ apart.swapaxes(-1, -2) + own)

    @property
    def log10_volume(self) -> float:
        """log10 of sqrt(det Q / det Lambda): how much smaller the posterior is than the prior."""
        return float(np.linalg.slogdet(self.covariance)[1] / (2 * LN10))

    @property
    def resolved(self) -> float:
        """How many modes the measurements resolve: m - tr Q, sum_i s_i^2 / (1 + s_i^2).

        s_i are the singular values of the whitened design.  Without a residual it is the slope of
        log10_volume against log10 of the noise's standard deviation.
        """
        return float(len(self.alpha) - np.trace(self.covariance))


def infer(gaussian: Gaussian, rows: Rows) -> Posterior:
    """Posterior of a Gaussian given measurements, by the information form."""
    s = system(gaussian, rows)
    precision = np.eye(len(gaussian.modes)) + s.design.T @ s.design
    covariance = _inverse(precision)
    alpha = covariance @ (s.design.T @ s.y)
    fit = s.y @ (s.y - s.design @ alpha)
    sds = np.linalg.slogdet(precision)[1] - 2 * np.log(np.linalg.det(s.whiten)).sum()
    evidence = -0.5 * float(fit + sds + len(s.y) * np.log(2 * np.pi))
    return Posterior(gaussian, rows, s, alpha, (covariance + covariance.T) / 2, evidence)


def _standard_deviations(covariances: Floats) -> Floats:
    """Square roots of the diagonals (..., 3) of covariances, which only rounding can make negative."""
    return np.sqrt(np.maximum(np.diagonal(covariances, axis1=-2, axis2=-1), 0))


def _inverse(precision: Floats) -> Floats:
    """Invert a positive definite matrix whose rows may differ greatly in size."""
    scale = 1 / np.sqrt(np.diagonal(precision))
    root = np.linalg.inv(np.linalg.cholesky(precision * np.outer(scale, scale))) * scale
    return np.asarray(root.T @ root)


STARTS = 8  # headings all around, from which an unknown one is searched for
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
    """What is known of a person before the measurements.

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
        If the heading is latent the last mode is the turn, `TURN_SD` radians per standard deviation.
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
    """Make Gauss-Newton passes from a start until heading and place settle; the share is not yet known."""
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
    """One of each kind with its share, the most probable first; equal ones of a component are merged."""
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
    """Log density of the observations in the picture: rows of farther points have longer units."""
    return posterior.log_evidence + 0.5 * float(np.log(posterior.rows.variance).sum())


def _same(a: Explanation, b: Explanation) -> bool:
    apart = (a.heading - b.heading + np.pi) % (2 * np.pi) - np.pi
    return a.component == b.component and bool(abs(apart) < SAME)


def uncertain_modes(found: Posterior, count: int) -> tuple[Floats, Floats]:
    """Directions of largest posterior standard deviation, within the modes.

    Returns
    -------
    sd : (count,)
        Metres, along the unit vectors below, largest first.
    modes : (count, F, J, 3)
        Unit vectors over all coordinates.
    """
    q, r = np.linalg.qr(found.gaussian.modes.reshape(len(found.gaussian.modes), -1).T)
    values, vectors = np.linalg.eigh(r @ found.covariance @ r.T)
    order = np.argsort(values)[::-1][:count]
    modes = (q @ vectors[:, order]).T.reshape(-1, *found.gaussian.mean.shape)
    return np.sqrt(np.maximum(values[order], 0)), modes


def dual(gaussian: Gaussian, rows: Rows) -> tuple[Floats, Floats, float]:
    """Eqs. 5 and 6 with a matrix of the measurements' size: alpha, covariance and log evidence."""
    s = system(gaussian, rows)
    observed = s.design @ s.design.T + np.eye(len(s.y))
    gain = np.linalg.solve(observed, s.design).T
    alpha, covariance = gain @ s.y, np.eye(len(gaussian.modes)) - gain @ s.design
    sds = np.linalg.slogdet(observed)[1] - 2 * np.log(np.linalg.det(s.whiten)).sum()
    fit = s.y @ (s.y - s.design @ alpha)
    return alpha, covariance, -0.5 * float(fit + sds + len(s.y) * np.log(2 * np.pi))


def log10_volume(gaussian: Gaussian, rows: Rows) -> float:
    """log10 sqrt(det Q / det Lambda) in closed form: -1/2 sum log10(1 + s_i^2), s of the whitened design."""
    s = np.linalg.svd(system(gaussian, rows).design, compute_uv=False)
    return float(-0.5 * np.log10(1 + s**2).sum())


def likelihood_only(gaussian: Gaussian, rows: Rows) -> Floats:
    """Segment (F, J, 3) in the span of the modes that fits the measurements best, without the prior.

    Of all such segments, the one nearest to the mean (least squares of minimum norm).  The standard
    deviations of the observations weight them.
    """
    norm = np.linalg.norm(gaussian.modes.reshape(len(gaussian.modes), -1), axis=1)
    unit = gaussian.modes / norm[:, None, None, None]
    weight = 1 / np.sqrt(rows.variance)
    design = np.einsum("nai,mni->nam", rows.direction, unit[:, rows.frame, rows.marker])
    y = weight * rows.shifted(gaussian.mean).value
    flat = (design * weight[..., None]).reshape(y.size, -1)
    scores = np.linalg.lstsq(flat, y.ravel(), rcond=1e-10)[0]
    return np.asarray(gaussian.mean + np.tensordot(scores, unit, 1))
