"""Figures 1 to 6 of Leventon and Freeman (1998), and the volume of the posterior."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gait.learn.arrays import Floats
from gait.learn.segments.corpus import Recorded
from gait.learn.segments.virtual_markers import MARKERS
from gait.lift.report.motion_figures import SIDE, Strips
from gait.lift.segment.explain import share_along, share_rigid
from gait.paper import leventon, verdicts
from gait.paper.entry import Entry, Picture, picture, table
from gait.paper.leventon import Example, Gaussian, HeldOut
from gait.report.colours import BLUE, DARK, GREY, ORANGE
from gait.report.figures import Drawing, grid, line_legend

SHOWN_MOTIONS = 5  # of figure 1
SYNTHESIS = 40  # modes of figure 2
DRAWN_SEGMENTS = UNCERTAIN = 3
MEASURED_DRAWS = 200  # draws whose limbs are measured
MODE_SDS = 2.0  # standard deviations
ROW_HEIGHT_M = 1.75  # metres, of the figures' rows
ACROSS = np.array([0.0, 1.0, 0.0])  # the depth, drawn to the right
VOLUME_MAGNITUDES = 14  # orders of magnitude by which the paper's volume shrinks


@dataclass(frozen=True)
class Segments:
    """What the figures show."""

    motions: list[Recorded]
    everything: Gaussian  #: of all motions
    held: list[HeldOut]
    shown: HeldOut
    example: Example


def study(motions: list[Recorded], held: list[HeldOut]) -> Segments:
    """Choose the sequence to show: the one whose Bayes error is the median."""
    order = sorted(held, key=lambda h: h.scores[1].bayes)
    shown = order[len(order) // 2]
    return Segments(motions, leventon.learn_all(motions), held, shown, leventon.example(shown))


def entries(found: Segments) -> Iterator[Entry]:
    """Yield the entries in the paper's order."""
    yield _training(found)
    yield _synthesis(found)
    yield _spectrum(found)
    yield _draws(found)
    yield _estimates(found)
    yield _uncertain(found)
    yield _volume(found)


def _strips(titles: Sequence[str]) -> Strips:
    return Strips(titles, MARKERS, ROW_HEIGHT_M, leventon.SEGMENT_FPS)


def _across(x: Floats) -> Floats:
    """Return the direction (3,) across the paper in which a motion is seen from its side."""
    left, right = (x[0, MARKERS.index(f"{s}_hip")] for s in "lr")
    ahead = np.array([right[1] - left[1], left[0] - right[0], 0.0]) * -1
    return np.asarray(ahead / max(float(np.linalg.norm(ahead)), 1e-9))


def _training(found: Segments) -> Entry:
    picked = found.motions[:: max(1, len(found.motions) // SHOWN_MOTIONS)][:SHOWN_MOTIONS]
    strips = _strips([m.name for m in picked])
    for row, motion in enumerate(picked):
        x = leventon.metres(motion)
        x = x[np.isfinite(x).all(axis=(1, 2))]
        strips.add(row, x, _across(x), DARK)
    frames = [len(m.table) for m in found.motions]
    caption = (
        "Some of the training motions, each over its whole length, seen from the side. Right limbs are bold."
    )
    return Entry(
        "Fig. 1: training motions",
        "10 sequences of 37 markers, 120 to 240 frames at about 20 per second; 257 segments of 10 frames, "
        "every 5 frames.",
        f"{len(found.motions)} sequences, {min(frames)} to {max(frames)} frames at 20 per second; "
        f"{found.everything.segments} segments.",
        "The same segments, and segments of artificial people with other postures and limb lengths.",
        verdicts.training(len(found.motions), min(frames), max(frames)),
        (
            "Which motions: up to ten of 120 to 240 frames, other motions before walks; longer recordings "
            "are cut into equal parts. If there are too few, shorter ones, with one walk per person. A "
            "sequence is left out together with the rest of its recording.",
            "The markers: 37 virtual markers on the body fitted to each recording.",
            "The frame rate: exactly 20 per second, resampled after a low-pass filter. A sequence of F "
            "frames has floor((F - 10) / 5) + 1 segments.",
        ),
        (picture(Drawing("", "training", caption, strips.figure())),),
    )


def _synthesis(found: Segments) -> Entry:
    gaussian, truth = found.shown.gaussian, found.example.truth[: leventon.SEGMENT_FRAMES]
    own = found.everything.projected(truth, SYNTHESIS)
    left_out = gaussian.projected(truth, SYNTHESIS)
    share = 100 * found.everything.explained()
    need = int(np.searchsorted(share, 100 * leventon.PAPER_VARIANCE_SHARE)) + 1
    placed, rooted = (_needed(found.motions, absolute) for absolute in (True, False))
    strips = _strips(("from the view", "from the side"))
    for row, across in enumerate((SIDE, ACROSS)):
        strips.add(row, truth, across, DARK, ghost=True)
        strips.add(row, own, across, ORANGE, path=truth)
    figure = strips.figure()
    line_legend(figure, {"original": GREY, f"{SYNTHESIS} modes": ORANGE})
    explained = found.shown.prior.explained()
    far = leventon.apart(found.everything.segment(np.zeros(0)), truth)
    return Entry(
        "Fig. 2: synthesis, and the variance explained",
        "A segment from 40 modes is close to the original; 50 modes explain 91 % of the variance.",
        f"Error with 40 modes: {leventon.apart(own, truth):.0f} mm per marker for a segment of the training "
        f"data (which is {far:.0f} mm from the mean), {leventon.apart(left_out, truth):.0f} mm if its "
        f"sequence was left out. 40 modes explain {share[SYNTHESIS - 1]:.2f} % of the variance, 50 modes "
        f"{share[leventon.PAPER_MODES - 1]:.2f} %; {need} modes explain 91 %.",
        f"{found.shown.prior.size} modes of segments that all face one way explain "
        f"{100 * explained[-1]:.1f} %.",
        verdicts.synthesis(leventon.apart(own, truth) / far, need),
        (
            "Coordinates: in the first frame the pelvis is over the origin; the heading is as recorded. 91 % "
            f"take {need} modes; with positions as recorded {placed}, without turned copies {rooted}. The "
            "paper does not state its choice; its motions differ more.",
            "Lambda = U S, as printed, cannot be the covariance of the scores. Here it is diagonal, with the "
            "squared singular values over N - 1. The mean, missing in eq. 1, is added.",
            "Every segment is also used turned by 90 degrees about the vertical through the origin.",
        ),
        (picture(Drawing("", "synthesis", f"A segment of {found.shown.name} and its 40 modes.", figure)),),
    )


def _needed(motions: Sequence[Recorded], absolute: bool) -> int:
    """Return how many modes explain 91 % without turned copies, with positions as recorded or relative."""
    if not absolute:
        gaussian = leventon.learn_all(motions, turned=False)
    else:
        whole = [leventon.metres(m) for m in motions]
        frames = [
            x[k : k + leventon.SEGMENT_FRAMES]
            for x in whole
            for k in range(0, len(x) - leventon.SEGMENT_FRAMES + 1, leventon.HOP)
        ]
        gaussian = leventon.learn(np.array([x for x in frames if np.isfinite(x).all()]))
    return int(np.searchsorted(gaussian.explained(), leventon.PAPER_VARIANCE_SHARE)) + 1


def _spectrum(found: Segments) -> Entry:
    gaussian, after = found.shown.gaussian, found.example.segment
    variance = np.diag(after.covariance)
    ratio = variance / gaussian.variance
    open_modes = np.argsort(-ratio)[:3] + 1
    figure, (axes,) = grid(1, 1, 7, 3.2)
    number = np.arange(1, len(variance) + 1)
    axes.semilogy(number, gaussian.variance, "o-", ms=3, color=BLUE, label="prior")
    axes.semilogy(number, variance, "o-", ms=3, color=ORANGE, label="posterior")
    axes.set(xlabel="mode", ylabel="variance, m²")
    axes.legend(fontsize=8, frameon=False)
    return Entry(
        "Fig. 3: variances before and after",
        "The diagonals of the prior's and the posterior's covariance: most variances shrink strongly.",
        f"With {1000 * leventon.FIGURE_NOISE_M:.0f} mm of noise, the variances shrink to {ratio.min():.1g} "
        f"to {ratio.max():.2g} of the prior's, least in modes {', '.join(map(str, open_modes))}.",
        "The library uses the same equations, with position, heading and stature as further unknowns.",
        verdicts.spectrum(ratio.tolist()),
        (
            f"The noise: a standard deviation of {1000 * leventon.FIGURE_NOISE_M:.0f} mm of each observed "
            "coordinate. Sigma is a variance in the text, squared in eq. 4, and multiplies the identity in "
            "eq. 5.",
            "Where eqs. 5 and 6 have S, the covariance of the scores is used. Eq. 6 is computed as the "
            "inverse of the sum of both precisions, which is equal.",
        ),
        (
            picture(
                Drawing(
                    "", "spectrum", f"Variances of the scores of a segment of {found.shown.name}.", figure
                )
            ),
        ),
    )


def _draws(found: Segments) -> Entry:
    rng = np.random.default_rng(1)
    gaussian = found.everything
    scores = rng.normal(size=(MEASURED_DRAWS, len(gaussian.variance))) * np.sqrt(gaussian.variance)
    drawn = np.array([gaussian.segment(alpha) for alpha in scores])
    strips = _strips([f"draw {k + 1}" for k in range(DRAWN_SEGMENTS)])
    for row, x in enumerate(drawn[:DRAWN_SEGMENTS]):
        strips.add(row, x, _across(x), BLUE)
    learnt = leventon.limbs(np.concatenate([leventon.cut(m) for m in found.motions]))
    usual = learnt.mean(axis=(0, 1))
    differ = [float(np.sqrt(np.mean((x / usual - 1) ** 2))) for x in (leventon.limbs(drawn), learnt)]
    return Entry(
        "Fig. 4: draws from the prior",
        "Segments drawn at random from the prior.",
        f"{DRAWN_SEGMENTS} draws from the Gaussian. In {MEASURED_DRAWS} draws, limb lengths vary by "
        f"{100 * differ[0]:.0f} % (rms).",
        "The same kind of prior, but all segments face the same way, so that no draw mixes two headings.",
        verdicts.draws(*differ),
        (
            "Scores of all modes that are kept are drawn; the variation outside the modes is left out.",
            "A draw is seen from the side, as its hips are in the first frame.",
        ),
        (picture(Drawing("", "draws", "Segments drawn from the prior, from the side.", strips.figure())),),
    )


def _estimates(found: Segments) -> Entry:
    e, held = found.example, found.held
    rows = {"original": e.truth, "likelihood\nalone": e.likelihood, "Bayes": e.bayes, "ours": e.ours}
    titles = ["the view", *(f"{k}\n{leventon.apart(x, e.truth):.0f} mm" for k, x in rows.items())]
    titles[1] = "original,\nfrom the side"
    strips = _strips(titles)
    strips.add(0, e.truth, SIDE, GREY)
    for row, x in enumerate(rows.values(), 1):
        if row > 1:
            strips.add(row, e.truth, ACROSS, DARK, ghost=True)
        strips.add(row, x, ACROSS, (DARK, BLUE, ORANGE, "#3a7d44")[row - 1], path=e.truth)
    means = [_mean(held, k) for k in range(len(leventon.TRIED))]
    shown = means[leventon.TRIED.index(leventon.FIGURE_NOISE_M)]
    caption = (
        f"20 frames of {found.shown.name}, which was left out: three overlapping segments, blended linearly. "
        "The camera looks along the depth; in the rows below the first, depth is drawn to the right. Grey: "
        "original. The errors are mean distances of all markers, without the common depth, which such a view "
        "cannot show."
    )
    if leventon.apart(e.bayes, e.truth) > leventon.apart(e.likelihood, e.truth):
        caption += (
            " In this part of the sequence, where it moves most, Bayes has a larger error than the "
            "likelihood alone; the table has the means of all segments."
        )
    return Entry(
        "Fig. 5: estimates from one view",
        "20 frames of a sequence left out: original, orthographic view, likelihood alone, and Bayes, "
        "which is far better.",
        f"Mean errors of {len(held)} sequences with {1000 * shown.noise:.0f} mm of noise: likelihood "
        f"{shown.likelihood:.0f} mm, Bayes {shown.bayes:.0f} mm. 90 % intervals of the depth cover "
        f"{100 * shown.covered:.0f} %.",
        f"{shown.ours:.0f} mm, although the heading is unknown; the intervals cover "
        f"{100 * shown.ours_covered:.0f} %.",
        verdicts.estimates([(m.likelihood, m.bayes) for m in means], shown.covered),
        (
            f"Each of {len(held)} sequences is left out in turn. The one with the median error is shown, "
            "where it moves most. The training data include other sequences of the same person.",
            "Likelihood alone: the least-squares solution of minimum norm in the modes.",
            "Eq. 1 is printed without the mean and eq. 3 without the 1/2. Sigma, a variance in the text and "
            "squared in eq. 4, is a standard deviation here.",
            "A segment is placed where its pelvis is observed; in depth it continues the segment before. "
            "Overlapping segments are blended linearly.",
            f"The noise: {', '.join(f'{1000 * n:.0f}' for n in leventon.TRIED)} mm; shown with "
            f"{1000 * leventon.FIGURE_NOISE_M:.0f}. The camera looks along y, level and orthographic.",
        ),
        (picture(Drawing("", "estimates", caption, strips.figure())), _table(means)),
    )


def _table(scores: Sequence[leventon.Score]) -> Picture:
    """Return the mean errors by noise as a table."""
    errors = "noise", "prior's mean", "nearest in the modes", "likelihood alone", "Bayes"
    head = (*errors, "90 % intervals cover", "ours", "90 % intervals cover")
    rows = [
        (
            *(f"{1000 * s.noise:.0f} mm", f"{s.mean:.0f}", f"{s.floor:.0f}", f"{s.likelihood:.0f}"),
            *(f"{s.bayes:.0f}", f"{100 * s.covered:.0f} %", f"{s.ours:.0f}", f"{100 * s.ours_covered:.0f} %"),
        )
        for s in scores
    ]
    caption = "Errors of single segments in mm per marker, mean over all sequences, each left out in turn."
    return table(caption, head, rows)


def _mean(held: Sequence[HeldOut], noise: int) -> leventon.Score:
    """Return the mean scores over the sequences left out, with one of the noises."""
    each = [list(vars(h.scores[noise]).values()) for h in held]
    return leventon.Score(*np.mean(each, axis=0).tolist())


def _uncertain(found: Segments) -> Entry:
    gaussian, after = found.shown.gaussian, found.example.segment
    sd, modes = leventon.least_certain(gaussian, after, UNCERTAIN)
    depth = np.eye(3)[leventon.DEPTH]
    along, rigid = ([share(m) for m in modes] for share in (lambda m: share_along(m, depth), share_rigid))
    centre = gaussian.segment(after.alpha)
    strips = _strips(
        [f"mode {k + 1}\n{1000 * s / np.sqrt(centre[..., 0].size):.0f} mm" for k, s in enumerate(sd)]
    )
    for row, mode in enumerate(modes):
        strips.add(row, centre, ACROSS, DARK, ghost=True)
        for sign, colour in ((1, ORANGE), (-1, BLUE)):
            strips.add(row, centre + sign * MODE_SDS * mode, ACROSS, colour, path=centre)
    figure = strips.figure()
    line_legend(figure, {f"+{MODE_SDS:g} sd": ORANGE, f"-{MODE_SDS:g} sd": BLUE})
    shares = ", ".join(f"{100 * s:.0f} %" for s in along)
    return Entry(
        "Fig. 6: modes of greatest posterior variance",
        "Modes that the view hardly constrains; the second is a translation in depth.",
        f"Shares of their energy along the depth: {shares}; as translation of the whole body: "
        + ", ".join(f"{100 * s:.0f} %" for s in rigid) + ".",
        "gait lift reports them and gait report lift draws them, for any clip.",
        verdicts.uncertain(along, rigid),
        (
            "Here they are eigenvectors of the posterior covariance. The paper compares diagonal elements, "
            "which depend on the choice of modes.",
            "In the first frame the pelvis is over the origin, which leaves little translation.",
        ),
        (
            picture(Drawing("", "modes", "The depth is drawn to the right; sd per marker (rms).", figure)),
        ),
    )  # fmt: skip


def _volume(found: Segments) -> Entry:
    gaussian = found.shown.gaussian
    view = np.zeros((leventon.SEGMENT_FRAMES, len(MARKERS), 2))
    ratios = [gaussian.posterior(view, noise).log10_volume for noise in leventon.NOISES_M]
    same = leventon.noise_of(gaussian, -VOLUME_MAGNITUDES)
    figure, (axes,) = grid(1, 1, 6, 3)
    axes.semilogx([1000 * n for n in leventon.NOISES_M], ratios, "o-", ms=4, color=DARK)
    axes.axhline(
        -VOLUME_MAGNITUDES, color=ORANGE, lw=1, ls="--", label=f"the paper's: 10^-{VOLUME_MAGNITUDES}"
    )
    axes.set(xlabel="noise of what is observed, mm", ylabel="log10 of posterior over prior volume")
    axes.legend(fontsize=8, frameon=False)
    words = ", ".join(
        f"{1000 * n:.0f} mm: 10^{r:.0f}" for n, r in zip(leventon.NOISES_M, ratios, strict=True)
    )
    return Entry(
        "Volume of the posterior",
        "The volume shrinks by a factor of 10^14 in 50 dimensions (printed the other way round).",
        f"{words}. It is 10^-14 with {1000 * same:.0f} mm of noise.",
        "gait report lift prints the volume for any segment.",
        verdicts.volume(ratios, same, leventon.NOISES_M),
        (
            "The paper does not state the noise sigma, which is a standard deviation here.",
            "The ratio is printed as prior over posterior, which could not be small. Here it is the square "
            "root of det Q over det Lambda.",
        ),
        (picture(Drawing("", "volume", "Volume against noise.", figure)),),
    )
