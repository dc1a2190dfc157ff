"""The figures of `gait learn --report`, one after the other."""

from __future__ import annotations

from collections.abc import Iterator

from gait.learn.prior.fit import Learned
from gait.learn.report import figures_cycle, figures_model, figures_period, figures_subject
from gait.learn.report.figures_base import Drawing

SNR = (
    "For one recording: folded at every whole period, each angle's variance between the phases over that "
    "within them (names left, maxima right), and the sum. White noise stays near 1 whatever the period."
)


def drawings(learned: Learned) -> Iterator[Drawing]:
    """Draw the figures in the order of the page."""
    yield Drawing("snr", "Signal-to-noise ratio against the period", SNR, figures_period.ratios(learned))
    yield Drawing(
        "periods",
        "Periods of all recordings",
        "Ratio summed over the angles, each recording over its largest; grey: the recording is too short.",
        figures_period.periods(learned),
    )
    yield Drawing(
        "alignment",
        "Alignment",
        "Recordings folded at their periods as they start, and after their offsets are found; black: mean.",
        figures_cycle.alignment(learned),
    )
    yield Drawing(
        "cycles",
        "Cycles",
        "What the components are learnt from, on one phase; black: the model's mean.",
        figures_cycle.cycles(learned),
    )
    yield from _model(learned)
    yield Drawing(
        "residuals",
        "Residual by angle",
        "What the components leave of all cycles, rms; blue: left, orange: right, black: trunk and neck.",
        figures_model.residuals(learned),
    )
    subjects = figures_subject.errors(learned)
    if subjects is not None:
        yield Drawing("subjects", "Residual by subject", figures_subject.CAPTION, subjects)
    yield Drawing(
        "missing",
        "Missing data",
        "Cycles of the analysis, blue where observed; the rest is filled from the components.",
        figures_cycle.missing(learned),
    )
    yield Drawing(
        "convergence", "Convergence", "The objectives may never rise.", figures_model.convergence(learned)
    )


def _model(learned: Learned) -> Iterator[Drawing]:
    """Mean, components and their number."""
    yield Drawing("strip-mean", "Mean cycle", "The right side is bold.", figures_model.strip(learned, None))
    if learned.pace_curve.any():
        yield Drawing(
            "strip-rate",
            "Stride rate",
            "The mean cycle at the mean rate, and at those two standard deviations (between people) off it.",
            figures_model.strip(learned, learned.pace_curve),
        )
    for k in range(len(learned.curves) - 1):
        share = 100 * learned.components.spectrum[k] if k < len(learned.components.spectrum) else 0.0
        yield Drawing(
            f"strip-{k + 1}",
            f"Component {k + 1}: {share:.0f} % of the variance",
            "Mean and two standard deviations to either side, feet on the ground.",
            figures_model.strip(learned, learned.curves[k + 1]),
        )
    if len(learned.curves) > 1:
        yield Drawing(
            "components", "Components as curves", "Right side of the body.", figures_model.curves(learned)
        )
    yield Drawing(
        "spectrum",
        "Number of components",
        "Share of the variance that each explains.",
        figures_model.spectrum(learned),
    )
