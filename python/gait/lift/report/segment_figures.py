"""Figures of Leventon and Freeman (1998) for a learnt prior: spectrum, synthesis, draws, estimates, modes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.bindings.lifter import LiftConfig, Lifter
from gait.bindings.segment_prior import SegmentPrior
from gait.lift.report.motion_figures import SIDE, VIEWED_FROM_AHEAD, Strips
from gait.report.colours import BLUE, DARK, GREY, ORANGE
from gait.report.figures import Drawing, grid, line_legend

Floats = npt.NDArray[np.float64]

SYNTHESIS = 40  # modes of the paper's fig. 2
OBSERVED_NOISE_M = 0.02  # metres, of the observed points in figs. 3, 5 and 6
DRAWN_SEGMENTS = DRAWN_MODES = 3
MODE_SDS = 2.0  # standard deviations by which uncertain modes are drawn


@dataclass(frozen=True)
class Gaussian:
    """Segments of people with one stature: mean + sum_i alpha_i modes_i + residual, alpha ~ N(0, I); metres.

    Attributes
    ----------
    mean : (F, J, 3)
    modes : (k, F, J, 3)
        Modes times their standard deviations.
    residual : (J,)
        Variance of each coordinate that the modes do not explain.
    """

    mean: Floats
    modes: Floats
    residual: Floats

    @staticmethod
    def of(prior: SegmentPrior, stature: float, component: int = 0) -> Gaussian:
        """Make the Gaussian of a component of a prior, in the position in which it was learnt."""
        used = prior.modes[component][prior.sd[component] > 0]
        residual = stature**2 * prior.gamma * prior.residual[component]
        return Gaussian(stature * prior.mean[component], stature * used, residual)

    def projected(self, x: Floats, count: int | None = None) -> Floats:
        """Project x (F, J, 3) to the span of the first modes about the mean."""
        flat = self.modes[:count].reshape(len(self.modes[:count]), -1).T
        scores = np.linalg.lstsq(flat, (x - self.mean).ravel(), rcond=None)[0]
        return np.asarray(self.mean + (flat @ scores).reshape(x.shape))

    def draw(self, rng: np.random.Generator, residual: bool = True) -> Floats:
        """Draw a segment (F, J, 3) from the prior."""
        x = self.mean + np.tensordot(rng.normal(size=len(self.modes)), self.modes, 1)
        return x + rng.normal(size=x.shape) * np.sqrt(self.residual)[:, None] * residual


@dataclass(frozen=True)
class Case:
    """A segment observed along x (from behind), without depth, and estimates of it.

    Attributes
    ----------
    prior : SegmentPrior
    truth : (F, J, 3)
        Metres, positioned as in the prior.
    what : str
        What the segment is, in words.
    gaussian : Gaussian
        The prior at its stature.
    bayes, likelihood : (F, J, 3)
        Posterior mean, and least squares in the modes.
    variance : (k,)
        Posterior variances of the modes' scores.
    log10_volume : float
        log10 of posterior over prior volume.
    uncertain : (DRAWN_MODES, F, J, 3)
        Least certain displacements, one standard deviation long, longest first.
    """

    prior: SegmentPrior
    truth: Floats
    what: str
    gaussian: Gaussian
    bayes: Floats
    likelihood: Floats
    variance: Floats
    log10_volume: float
    uncertain: Floats


def case(model: str | None, truth: Floats | None, stature: float, what: str, seed: int) -> Case:
    """Observe a segment, or one drawn from a model's prior if `truth` is None, from behind with noise."""
    prior, rng = SegmentPrior.load(model), np.random.default_rng(seed)
    gaussian = Gaussian.of(prior, stature)
    x = gaussian.draw(rng) if truth is None else truth
    axes = np.stack([VIEWED_FROM_AHEAD, [0.0, 0.0, 1.0]])
    uv = x @ axes.T + OBSERVED_NOISE_M * rng.normal(size=(*x.shape[:2], 2))
    lifter = Lifter(model, axes, placed_as_learnt(stature))
    fit = lifter.segment(uv, OBSERVED_NOISE_M)
    if fit.component:
        gaussian = Gaussian.of(prior, stature, fit.component)
    return Case(
        prior,
        x,
        what,
        gaussian,
        bayes=lifter.positions()[0],
        likelihood=lifter.least_squares(),
        variance=np.diag(lifter.posterior()[1])[: len(gaussian.modes)],
        log10_volume=fit.log10_volume,
        uncertain=lifter.uncertain(DRAWN_MODES)[1],
    )


def placed_as_learnt(stature: float, heading: float = 0.0, **changes: float) -> LiftConfig:
    """Make settings of a lifter for a person of known size, position and heading, as in the paper."""
    known = {"stature": stature, "stature_sd": 0.0, "heading": heading, "heading_sd": 0.0}
    return LiftConfig.default(**known, place_sd=(0.0, 0.0, 0.0), **changes)


def drawings(c: Case, seed: int) -> Iterator[Drawing]:
    """Draw all figures of a case."""
    yield spectrum(c)
    yield synthesis(c)
    yield draws(c, seed)
    yield estimates(c)
    yield uncertain(c)


def spectrum(c: Case) -> Drawing:
    """Draw the variances of the modes before and after observing the segment (fig. 3)."""
    figure, panels = grid(1, 2, 9, 3.4)
    lengths = np.linalg.norm(c.gaussian.modes.reshape(len(c.gaussian.modes), -1), axis=1) ** 2
    after = lengths * c.variance
    number = np.arange(1, len(lengths) + 1)
    panels[0].semilogy(number, lengths, "o-", ms=3, color=BLUE)
    panels[0].semilogy(number, after, "o-", ms=3, color=ORANGE)
    panels[0].set(xlabel="mode", ylabel="variance, m²")
    share = 100 * c.prior.explained()
    panels[1].plot(np.arange(1, len(share) + 1), share, color=DARK)
    panels[1].set(xlabel="modes", ylabel="variance explained, %", ylim=(0, 102))
    line_legend(figure, {"prior": BLUE, "posterior": ORANGE})
    return Drawing(
        "spectrum",
        "Spectrum",
        f"Variances of the modes before and after {c.what} is observed from behind with "
        f"{1000 * OBSERVED_NOISE_M:.0f} mm of noise: the volume shrinks to 10^{c.log10_volume:.1f} of "
        "the prior's.",
        figure,
    )


def synthesis(c: Case) -> Drawing:
    """Draw the segment beside its projection on the first modes (fig. 2)."""
    used = c.gaussian.modes[:SYNTHESIS]
    projected = c.gaussian.projected(c.truth, SYNTHESIS)
    strips = _strips(c, ("from the side", "from ahead"))
    for row, across in enumerate((SIDE, VIEWED_FROM_AHEAD)):
        strips.add(row, c.truth, across, DARK, ghost=True)
        strips.add(row, projected, across, ORANGE, path=c.truth)
    figure = strips.figure()
    line_legend(figure, {"original": GREY, f"{len(used)} modes": ORANGE})
    caption = f"{c.what.capitalize()} (grey) and its projection on {len(used)} modes: "
    caption += f"{_apart(projected, c.truth):.0f} mm off."
    return Drawing("synthesis", "Synthesis", caption, figure)


def _strips(c: Case, titles: Sequence[str]) -> Strips:
    """Make rows for motions of a case."""
    return Strips(titles, c.prior.names, c.prior.stature, c.prior.fps)


def _apart(found: Floats, truth: Floats) -> float:
    return 1000 * float(np.linalg.norm(found - truth, axis=2).mean())


def draws(c: Case, seed: int) -> Drawing:
    """Draw random segments from the prior (fig. 4)."""
    rng = np.random.default_rng(seed)
    strips = _strips(c, [f"draw {k + 1}" for k in range(DRAWN_SEGMENTS)])
    for row in range(DRAWN_SEGMENTS):
        strips.add(row, c.gaussian.draw(rng, residual=False), SIDE, BLUE)
    caption = f"{DRAWN_SEGMENTS} segments drawn from the prior, seen from the side."
    return Drawing("draws", "Random draws", caption, strips.figure())


def estimates(c: Case) -> Drawing:
    """Draw original, projection, likelihood alone and Bayes, from the side, which shows depth (fig. 5)."""
    projected = c.gaussian.projected(c.truth)
    found = {
        "original": (c.truth, DARK),
        f"projection\n{_apart(projected, c.truth):.0f} mm": (projected, DARK),
        f"likelihood only\n{_apart(c.likelihood, c.truth):.0f} mm": (c.likelihood, BLUE),
        f"Bayes\n{_apart(c.bayes, c.truth):.0f} mm": (c.bayes, ORANGE),
    }
    strips = _strips(c, list(found))
    for row, (x, colour) in enumerate(found.values()):
        if x is not c.truth:
            strips.add(row, c.truth, SIDE, DARK, ghost=True)
        strips.add(row, x, SIDE, colour, path=c.truth)
    return Drawing(
        "estimates",
        "Estimates",
        f"{c.what.capitalize()} was observed from behind with {1000 * OBSERVED_NOISE_M:.0f} mm of "
        "noise and is drawn from the side, which shows the unobserved depth. Grey: original. Mean distance "
        "of all markers.",
        strips.figure(),
    )


def uncertain(c: Case) -> Drawing:
    """Draw the least certain displacements, from where they are most visible (fig. 6)."""
    length = np.linalg.norm(c.uncertain.reshape(DRAWN_MODES, -1), axis=1) / np.sqrt(c.truth[..., 0].size)
    titles = [f"mode {k + 1}\n{1000 * each:.0f} mm" for k, each in enumerate(length)]
    strips = _strips(c, titles)
    for row, mode in enumerate(c.uncertain):
        strips.add(row, c.bayes, SIDE, DARK, ghost=True)
        for sign, colour in ((1, ORANGE), (-1, BLUE)):
            moved = c.bayes + sign * MODE_SDS * mode
            strips.add(row, moved, SIDE, colour, path=c.bayes)
    depth = [float(np.sum(mode[..., 0] ** 2) / np.sum(mode**2)) for mode in c.uncertain]
    figure = strips.figure()
    line_legend(figure, {f"+{MODE_SDS:g} sd": ORANGE, f"-{MODE_SDS:g} sd": BLUE})
    return Drawing(
        "uncertain",
        "What is least certain",
        "Largest posterior standard deviations, rms per marker, seen from the side. Shares of the energy "
        f"along the line of sight: {', '.join(f'{100 * share:.0f} %' for share in depth)}.",
        figure,
    )
