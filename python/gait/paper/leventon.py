"""Segments literally as in Leventon and Freeman (1998): one Gaussian of 50 modes and its posterior.

A segment is 10 frames of 37 markers at 20 per second, in metres: z up, the pelvis of its first frame over the
origin, the heading as recorded.  The camera looks along y, so that x and z are seen and y is the depth.
Training segments are there twice, once turned by 90 degrees about z.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gait.bindings.lifter import LiftConfig, Lifter
from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import axis_rotation
from gait.errors import UserError
from gait.io import blob
from gait.learn.arrays import Floats
from gait.learn.options import SegmentOptions
from gait.learn.segments import fit as segment_fit
from gait.learn.segments.corpus import Recorded
from gait.learn.segments.fit import USUAL_STATURE
from gait.learn.segments.virtual_markers import MARKERS
from gait.lift.segment.view import looking_along

SEGMENT_FRAMES, HOP, SEGMENT_FPS = 10, 5, 20.0  # of a segment
PAPER_MODES = 50
PAPER_VARIANCE_SHARE = 0.91  # of the variance that 50 modes explain in the paper
WINDOW_FRAMES = 20  # frames of three overlapping segments
SEGMENT_STARTS = tuple(range(0, WINDOW_FRAMES - SEGMENT_FRAMES + 1, HOP))
NOISES_M = (0.005, 0.02, 0.05, 0.1, 0.2)  # metres: sd of what is seen
TRIED = NOISES_M[:3]  # in the table of errors
FIGURE_NOISE_M = TRIED[-1]  # in figures 3, 5 and 6: the nearest to what the paper's volume implies
MOST_SEGMENTS = 12  # segments tried of a sequence
WITHIN = 1.645  # standard deviations that hold 90 %
VIEW = looking_along("y")  # rows right, down, ahead
PICTURE = np.stack([VIEW[0], -VIEW[1]])  # right and up
DEPTH = 1  # coordinate that is not seen
PELVIS = MARKERS.index("pelvis")
_ENDS = ("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist")
LIMB_COLUMNS = np.array([[MARKERS.index(f"{side}_{end}") for end in ends] for side in "lr" for ends in _ENDS])
LN10 = float(np.log(10))


@dataclass(frozen=True)
class Gaussian:
    """Segments x = mean + modes alpha, alpha ~ N(0, diag(variance)); D = SEGMENT_FRAMES * J * 3."""

    mean: Floats  #: (D,)
    modes: Floats  #: (D, k) orthonormal, most variance first
    variance: Floats  #: (k,) squared singular values over N - 1
    spectrum: Floats  #: of all modes
    segments: int  #: learnt from, without turned copies

    @property
    def visible(self) -> Floats:
        """Modes as the view shows them, (D * 2 / 3, k)."""
        return _visible(self.modes.T.reshape(-1, SEGMENT_FRAMES, len(MARKERS), 3)).T

    def explained(self) -> Floats:
        """Share of the variance that the first modes explain."""
        return np.asarray(np.cumsum(self.spectrum) / self.spectrum.sum())

    def segment(self, alpha: Floats) -> Floats:
        """Return the segment (F, J, 3) of some scores (k,)."""
        return (self.mean + self.modes[:, : len(alpha)] @ alpha).reshape(SEGMENT_FRAMES, -1, 3)

    def projected(self, x: Floats, count: int = PAPER_MODES) -> Floats:
        """Return the nearest segment in the span of the first modes."""
        return self.segment(np.asarray(self.modes[:, :count].T @ (x.ravel() - self.mean)))

    def posterior(self, y: Floats, noise: float) -> Posterior:
        """Return the posterior (eqs. 5 and 6) given a view (F, J, 2) with noise of this sd."""
        design = self.visible / noise
        precision = np.diag(1 / self.variance) + design.T @ design
        covariance = np.linalg.inv(precision)
        rest = (y - _view(self.segment(np.zeros(0)))).ravel() / noise
        _, after = np.linalg.slogdet(precision)
        volume = -0.5 * (after + np.log(self.variance).sum()) / LN10
        return Posterior(covariance @ (design.T @ rest), covariance, float(volume))

    def likelihood_only(self, y: Floats) -> Floats:
        """Return the segment (F, J, 3) of the view alone: least squares of minimum norm."""
        rest = (y - _view(self.segment(np.zeros(0)))).ravel()
        return self.segment(np.asarray(np.linalg.lstsq(self.visible, rest, rcond=None)[0], float))


@dataclass(frozen=True)
class Posterior:
    """Mean (k,) and covariance (k, k) of the scores, and log10 of posterior over prior volume."""

    alpha: Floats
    covariance: Floats
    log10_volume: float


def _view(x: Floats) -> Floats:
    """Return what is seen (..., 2) of places (..., 3)."""
    return np.asarray(x @ PICTURE.T)


def _visible(modes: Floats) -> Floats:
    return _view(modes).reshape(len(modes), -1)


def metres(recorded: Recorded) -> Floats:
    """Return the markers (T, J, 3) of a recording, metres."""
    stature = recorded.stature if np.isfinite(recorded.stature) else USUAL_STATURE
    return np.asarray(stature * recorded.places)


def cut(
    recorded: Recorded, frames: int = SEGMENT_FRAMES, hop: int = HOP, heading: float | None = None
) -> Floats:
    """Return the whole segments (n, frames, J, 3) of a recording, rooted; turned to a heading, if given."""
    places, found = metres(recorded), []
    for k in range(0, len(places) - frames + 1, hop):
        part, now = places[k : k + frames], recorded.root[k, 2]
        if np.isfinite(part).all() and (heading is None or np.isfinite(now)):
            turn = 0.0 if heading is None else heading - float(now)
            found.append(rooted(part) @ axis_rotation(2, turn).T)
    return np.array(found).reshape(-1, frames, len(MARKERS), 3)


def rooted(x: Floats) -> Floats:
    """Move a motion (F, J, 3) so that the pelvis of its first frame is over the origin."""
    return np.asarray(x - x[0, PELVIS] * (1, 1, 0))


def learn(segments: Floats, turned: bool = True) -> Gaussian:
    """Learn the Gaussian of segments (N, F, J, 3), by default and of copies turned by 90 degrees."""
    both = np.concatenate([segments, segments @ axis_rotation(2, np.pi / 2).T]) if turned else segments
    rows = both.reshape(len(both), -1)
    mean = rows.mean(axis=0)
    _, singular, right = np.linalg.svd(rows - mean, full_matrices=False)
    spectrum = singular**2 / (len(rows) - 1)
    count = min(PAPER_MODES, int(np.sum(spectrum > 1e-9 * spectrum[0])))
    return Gaussian(mean, right[:count].T, spectrum[:count], spectrum, len(segments))


def learn_all(motions: Sequence[Recorded], turned: bool = True) -> Gaussian:
    """Learn the Gaussian of all segments of some recordings."""
    return learn(np.concatenate([cut(m) for m in motions]), turned)


def prior_of(gaussian: Gaussian, stature: float) -> SegmentPrior:
    """Return a Gaussian as a prior for the package's energy: nothing lies outside its modes."""
    sd, shape = np.sqrt(gaussian.variance) / stature, (SEGMENT_FRAMES, len(MARKERS), 3)
    return SegmentPrior(
        names=MARKERS,
        hop=HOP,
        fps=SEGMENT_FPS,
        headings=2,
        weights=np.ones(1),
        mean=(gaussian.mean / stature).reshape(1, *shape),
        modes=(gaussian.modes * sd).T.reshape(1, -1, *shape),
        sd=sd[None],
        residual=np.full((1, len(MARKERS)), segment_fit.LEAST_VARIANCE),
        gamma=1.0,
        stature=stature,
        segments=gaussian.segments,
    )


@dataclass(frozen=True)
class Score:
    """Errors with one noise, millimetres per marker, and share of depths within 90 % intervals."""

    noise: float
    mean: float  #: of the prior's mean
    floor: float  #: of the nearest segment in the span of the modes
    likelihood: float
    bayes: float
    covered: float
    ours: float
    ours_covered: float


@dataclass(frozen=True)
class HeldOut:
    """A sequence that neither prior was learnt from."""

    name: str
    windows: Floats  #: (n, WINDOW_FRAMES, J, 3) metres
    gaussian: Gaussian
    prior: SegmentPrior  #: the package's
    stature: float
    scores: tuple[Score, ...]


def hold_out(motions: Sequence[Recorded], update: Callable[[int], None] = lambda done: None) -> list[HeldOut]:
    """Leave out one sequence after the other, with all of its recording, and estimate its segments."""
    found = []
    for k, out in enumerate(motions):
        others = [m for m in motions if m.source != out.source]
        windows = cut(out, WINDOW_FRAMES, HOP)
        if len(windows):
            found.append(_held_out(out, windows, learn_all(others), _ours(others)))
        update(k + 1)
    if not found:
        raise UserError(
            f"no motion shows all markers for {WINDOW_FRAMES / SEGMENT_FPS:g} s; add recordings without gaps"
        )
    return found


def _ours(motions: Sequence[Recorded]) -> SegmentPrior:
    return segment_fit.fit(motions, SegmentOptions(source="all"))


def _held_out(out: Recorded, windows: Floats, gaussian: Gaussian, prior: SegmentPrior) -> HeldOut:
    stature = out.stature if np.isfinite(out.stature) else USUAL_STATURE
    segments = cut(out)
    picked = segments[np.unique(np.linspace(0, len(segments) - 1, MOST_SEGMENTS).round().astype(int))]
    scores = tuple(_score(picked, gaussian, prior, stature, noise) for noise in TRIED)
    return HeldOut(out.name, windows, gaussian, prior, stature, scores)


def _score(segments: Floats, gaussian: Gaussian, prior: SegmentPrior, stature: float, noise: float) -> Score:
    rng = np.random.default_rng(1)
    lifter = lifter_of(prior, stature)
    rows = []
    for x in segments:
        y = _view(x) + noise * rng.normal(size=(*x.shape[:2], 2))
        found = gaussian.posterior(y, noise)
        bayes, sd = gaussian.segment(found.alpha), marker_sd(gaussian, found)
        lifter.segment(y, noise)
        ours, ours_sd = lifter.positions()
        rows.append([
            apart(gaussian.segment(np.zeros(0)), x),
            apart(gaussian.projected(x), x),
            apart(gaussian.likelihood_only(y), x),
            apart(bayes, x),
            _covered(bayes - x, sd),
            apart(ours, x),
            _covered(ours - x, ours_sd),
        ])  # fmt: skip
    return Score(noise, *np.mean(rows, axis=0).tolist())


def lifter_of(prior: SegmentPrior, stature: float) -> Lifter:
    """Return the package's lifter for a person whose place and stature, but not heading, are known."""
    config = LiftConfig.default(stature=stature, stature_sd=0.0, place_sd=(0.0, 0.0, 0.0))
    return Lifter(blob.encode(segment_fit.sections(prior)), PICTURE, config)


def marker_sd(gaussian: Gaussian, found: Posterior) -> Floats:
    """Return the standard deviations (F, J, 3) of a posterior, as the paper has them: of the modes alone."""
    variance = np.einsum("dk,kl,dl->d", gaussian.modes, found.covariance, gaussian.modes, optimize=True)
    return np.sqrt(variance).reshape(SEGMENT_FRAMES, -1, 3)


def apart(found: Floats, truth: Floats) -> float:
    """Return the mean distance of markers, millimetres."""
    return 1000 * float(np.linalg.norm(found - truth, axis=-1).mean())


def limbs(x: Floats) -> Floats:
    """Return the lengths (..., 8) of thighs, shanks, upper arms and forearms of bodies (..., J, 3)."""
    return np.asarray(np.linalg.norm(x[..., LIMB_COLUMNS[:, 0], :] - x[..., LIMB_COLUMNS[:, 1], :], axis=-1))


def _covered(error: Floats, sd: Floats) -> float:
    return float(np.mean(np.abs(error)[..., DEPTH] < WITHIN * sd[..., DEPTH]))


@dataclass(frozen=True)
class Example:
    """A window of a left-out sequence, estimated from one view (figure 5): motions (WINDOW_FRAMES, J, 3)."""

    truth: Floats
    likelihood: Floats
    bayes: Floats
    ours: Floats
    segment: Posterior  #: of the first of its segments


def example(held: HeldOut) -> Example:
    """Estimate the window in which the sequence moves most."""
    windows = held.windows
    x = windows[int(windows.var(axis=1).sum(axis=(1, 2)).argmax())]
    rng = np.random.default_rng(1)
    y = _view(x) + FIGURE_NOISE_M * rng.normal(size=(*x.shape[:2], 2))
    lifter, first = lifter_of(held.prior, held.stature), None
    parts: tuple[list[Floats], ...] = ([], [], [])
    for start in SEGMENT_STARTS:
        across = np.array([y[start, PELVIS, 0], 0.0, 0.0])  # where a segment stands is seen but for the depth
        part = y[start : start + SEGMENT_FRAMES] - across[[0, 2]]
        found = held.gaussian.posterior(part, FIGURE_NOISE_M)
        first = first or found
        lifter.segment(part, FIGURE_NOISE_M)
        alone, bayes = held.gaussian.likelihood_only(part), held.gaussian.segment(found.alpha)
        for each, estimate in zip(parts, (alone, bayes, lifter.positions()[0]), strict=True):
            each.append(estimate + across)
    assert first is not None
    alone, bayes, ours = (_level(blended(np.array(each)), x) for each in parts)
    return Example(x, alone, bayes, ours, first)


def blended(parts: Floats) -> Floats:
    """Join overlapping segments (n, F, J, 3): each continues the depth of the one before; linear weights."""
    total, weight = np.zeros((WINDOW_FRAMES, *parts.shape[2:])), np.zeros(WINDOW_FRAMES)
    ramp = np.minimum(np.arange(1, SEGMENT_FRAMES + 1), np.arange(SEGMENT_FRAMES, 0, -1)).astype(float)
    before = parts[0]
    for start, part in zip(SEGMENT_STARTS, parts, strict=True):
        if start:
            part = part + np.eye(3)[DEPTH] * (before[HOP:] - part[:-HOP])[..., DEPTH].mean()
        total[start : start + SEGMENT_FRAMES] += ramp[:, None, None] * part
        weight[start : start + SEGMENT_FRAMES] += ramp
        before = part
    return total / weight[:, None, None]


def _level(found: Floats, truth: Floats) -> Floats:
    """Move a motion in depth to the truth's on average: the view does not show where it is."""
    return found - np.eye(3)[DEPTH] * (found - truth)[..., DEPTH].mean()


def least_certain(gaussian: Gaussian, found: Posterior, count: int) -> tuple[Floats, Floats]:
    """Return the largest sds (count,) of a posterior, and displacements (count, F, J, 3) as long as they."""
    values, vectors = np.linalg.eigh(found.covariance)
    sd = np.sqrt(values[::-1][:count])
    modes = (gaussian.modes @ (vectors[:, ::-1][:, :count] * sd)).T
    return sd, modes.reshape(count, SEGMENT_FRAMES, -1, 3)


def noise_of(gaussian: Gaussian, log10_volume: float) -> float:
    """Return the noise, metres, that shrinks the prior's volume so far."""
    y = _view(gaussian.segment(np.zeros(0)))
    low, high = np.log(1e-4), np.log(10.0)
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (
            (middle, high)
            if gaussian.posterior(y, float(np.exp(middle))).log10_volume < log10_volume
            else (low, middle)
        )
    return float(np.exp(middle))
