"""The figures of `gait learn --report`: periods, alignment, cycles, and residuals of each subject."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from gait.body.motion_classes import class_names, class_sections
from gait.body.skeleton import ANGLES, CHANNELS
from gait.io import blob
from gait.learn.arrays import Floats, Indices
from gait.learn.cycles import period
from gait.learn.cycles.sequence import Sequence
from gait.learn.prior.fit import Learned
from gait.learn.prior.people import ADULT_STATURE
from gait.learn.report import figures_model
from gait.learn.report.figures_model import PHASE_AXIS, PHASE_LABEL, SHOWN_ANGLES, mark_unobserved, words
from gait.report.colours import BLUE, DARK, GREY, ORANGE
from gait.report.figures import Drawing, grid, line_legend, plain

MOST_LEGEND = 10  # most entries of a legend
LEAST_SCALE_TOP = 5.0  # least top of a row's scale, so that noise, with a ratio of about 1, looks flat
MOST_NAMED_ROWS = 60  # most rows of the map with names
GRID = np.linspace(0.4, 2.1, 171)  # seconds
ALIGNED = ("r_hip_flexion", "r_knee_flexion", "l_shoulder_flexion")
MOST_SEQUENCES = 40  # most sequences drawn before and after
MOST_DRAWN_CYCLES = 300  # most cycles drawn
MOST_BINS, FEWEST_BINS = 64, 20  # of the mean curve of folded sequences
IN_BIN = 5  # samples that a bin should have
SCATTERED = 0.9  # observed share below which samples are drawn as dots
MOST_TICKS = 20  # most subjects named in the map
LINE = 0.03  # height of a name, as a share of the map
SNR = (
    "One recording folded at every whole period: the variance of each angle between the phases over that "
    "within them (names left, maxima right), and the sum. White noise stays near 1 at all periods."
)
SUBJECTS = (
    "What mean and plain components cannot reproduce of each subject, learnt with that subject and "
    "without it. Left: rms over the angles. Right: mean distance of 14 joints with the pelvis aligned, on "
    f"one body of mean proportions, {ADULT_STATURE[0]:.2f} m tall."
)
OF_CLASS = "The right side is bold. Each figure has its lowest point on the ground, in flight too."


def drawings(learned: Learned) -> Iterator[Drawing]:
    """Draw the figures in the order of the page."""
    yield Drawing("snr", "Signal-to-noise ratio against the period", SNR, ratios(richest(learned)))
    yield Drawing(
        "periods",
        "Periods of all recordings",
        "Ratio summed over the angles, relative to its largest; grey: the recording is too short.",
        periods(learned),
    )
    yield Drawing(
        "alignment",
        "Alignment",
        "Recordings folded at their periods, as they start and after their offsets are found; black: mean.",
        alignment(learned),
    )
    yield Drawing(
        "cycles", "Cycles", "What the components are learnt from; black: mean of the model.", cycles(learned)
    )
    yield from _model(learned)
    yield Drawing(
        "residuals",
        "Residual by angle",
        "Rms of the residuals of all cycles; blue: left, orange: right, black: trunk and neck.",
        figures_model.residuals(learned),
    )
    subjects = errors(learned)
    if subjects is not None:
        yield Drawing("subjects", "Residual by subject", SUBJECTS, subjects)
    yield Drawing(
        "missing",
        "Missing data",
        "Cycles of the analysis, blue where observed; the rest is filled from the components.",
        missing(learned),
    )
    yield Drawing(
        "convergence", "Convergence", "The objectives may never rise.", figures_model.convergence(learned)
    )


def of_classes(learned: Learned, sections: Mapping[str, blob.Array]) -> Iterator[Drawing]:
    """Draw the mean cycle of each class after the first that has its own curves; a posture only once."""
    for k, name in enumerate(class_names(sections)):
        direction, source = sections["CLIN"][k][:2].tolist()
        if k and source == k:
            cycle = np.asarray(class_sections(sections, k)["CURV"][0], float)
            phases = figures_model.STRIP_PHASES if direction else 1
            drawn = figures_model.strip(learned, None, cycle, phases)
            heading = f"Mean {'cycle' if direction else 'posture'} of class {name}"
            yield Drawing(f"strip-class-{k}", heading, OF_CLASS, drawn)


def _model(learned: Learned) -> Iterator[Drawing]:
    """Draw mean, components and their number."""
    yield Drawing("strip-mean", "Mean cycle", "The right side is bold.", figures_model.strip(learned, None))
    if learned.pace_curve.any():
        yield Drawing(
            "strip-rate",
            "Stride rate",
            "The mean cycle at the mean rate and two standard deviations (between people) to either side.",
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


def richest(learned: Learned) -> Sequence:
    """Return the sequence with most cycles, which has the clearest curves."""
    return max(learned.sequences, key=lambda s: s.cycles)


def ratios(s: Sequence, angles: int = len(ANGLES)) -> Figure:
    """Draw the ratio of white noise, of each of the first angles and of their sum over whole periods."""
    noise = np.random.default_rng(0).normal(size=(len(s.channels), 1))
    signals = np.concatenate([noise, s.channels[:, :angles]], axis=1)
    candidates, table = period.curves(signals, s.fps, "literal")
    rows = [k for k in range(table.shape[1]) if np.isfinite(table[:, k]).any()]
    figure = Figure(figsize=(8, 0.27 * len(rows) + 2.4), layout="constrained")
    panels = figure.subplots(
        len(rows) + 1, 1, sharex=True, gridspec_kw={"height_ratios": [1] * len(rows) + [5]}
    )
    for axes, k in zip(panels[:-1], rows, strict=True):
        _row(axes, candidates, table[:, k], words(ANGLES[k - 1]) if k else "white noise")
    _sum(panels[-1], candidates, table[:, [k for k in rows if k]], s)
    figure.suptitle(
        f"{s.name}: {len(s.channels)} frames, {s.cycles:.1f} cycles at {s.fps:g} per second", fontsize=10
    )
    return figure


def _row(axes: Axes, candidates: Floats, ratio: Floats, name: str) -> None:
    """Draw one angle: its curve, its name to the left and its maximum to the right."""
    top = max(float(np.nanmax(ratio)), LEAST_SCALE_TOP)
    axes.plot(candidates, ratio, color=BLUE if name != "white noise" else GREY, lw=1)
    axes.set(ylim=(0, 1.05 * top), yticks=[])
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.spines["bottom"].set_color("#dddddd")
    axes.tick_params(bottom=False)
    axes.set_ylabel(name, rotation=0, ha="right", va="center", fontsize=8)
    axes.text(
        1.01, 0.5, f"{np.nanmax(ratio):.3g}", transform=axes.transAxes, va="center", fontsize=8, color=DARK
    )


def _sum(axes: Axes, candidates: Floats, table: Floats, s: Sequence) -> None:
    """Draw the sum over the angles, the period of its maximum and the one found."""
    valid = np.isfinite(table).any(axis=1)
    total = np.where(valid, np.nansum(table, axis=1), np.nan)
    best = int(np.nanargmax(total))
    plain(axes)
    axes.plot(candidates, total, color=DARK, lw=1.4)
    axes.axvline(s.period.frames, color=ORANGE, lw=1, ls="--", label=f"found: {s.period.frames:.2f} frames")
    axes.plot(
        candidates[best], total[best], "o", ms=5, color=DARK,
        label=f"largest sum: {total[best]:.0f} at {candidates[best]:.0f} frames",
    )  # fmt: skip
    axes.set(xlabel="period, frames", xlim=(candidates[0], candidates[-1]), ylim=(0, 1.12 * total[best]))
    axes.set_ylabel("sum", rotation=0, ha="right", va="center", fontsize=8)
    axes.legend(fontsize=8, frameon=False)


def periods(learned: Learned) -> Figure:
    """Draw the ratio against the period for all sequences, one row each, with the period found."""
    sequences = learned.sequences
    rows = np.array([_resampled(s) for s in sequences])
    named = len(sequences) <= MOST_NAMED_ROWS
    figure, (axes,) = grid(1, 1, 8, float(np.clip(0.14 * len(rows), 1.3, 8)) + 1.2)
    axes.grid(visible=False)
    axes.set_facecolor("#e8e8e8")
    half = (GRID[1] - GRID[0]) / 2
    image = axes.imshow(
        rows, aspect="auto", cmap="Blues", vmin=0, vmax=1, interpolation="nearest",
        extent=(GRID[0] - half, GRID[-1] + half, len(rows) - 0.5, -0.5),
    )  # fmt: skip
    seconds = [s.period.frames / s.fps for s in sequences]
    axes.plot(
        seconds, np.arange(len(rows)), "o", ms=3.5 if named else 1.5, color=ORANGE, label="period found"
    )
    axes.set(xlabel="period, s", ylabel="" if named else "sequence")
    if named:
        axes.set_yticks(np.arange(len(rows)), [s.name for s in sequences], fontsize=6)
    else:
        axes.set_yticks([])
    figure.colorbar(image, ax=axes, label="ratio / its maximum", shrink=min(1.0, 2.5 / (0.14 * len(rows))))
    axes.legend(loc="upper left", fontsize=8)
    return figure


def _resampled(s: Sequence) -> Floats:
    """Return the largest score of each cell of GRID, relative to the best; NaN beyond the candidates."""
    valid = np.isfinite(s.period.scores)
    seconds = s.period.candidates[valid] / s.fps
    share = s.period.scores[valid] / s.period.scores[valid].max()
    row = np.interp(GRID, seconds, share, left=np.nan, right=np.nan)
    cell = np.round((seconds - GRID[0]) / (GRID[1] - GRID[0])).astype(int)
    shown = (cell >= 0) & (cell < len(GRID))
    np.fmax.at(row, cell[shown], share[shown])
    return row


def alignment(learned: Learned) -> Figure:
    """Draw sequences folded at their periods, before and after alignment, with their mean."""
    figure, panels = grid(len(ALIGNED), 2, 8, 6.2, sharex=True, sharey="row")
    picked = evenly(len(learned.sequences), MOST_SEQUENCES)
    visible = learned.cycles.visible
    for row, name in enumerate(ALIGNED):
        pair, k = panels[2 * row : 2 * row + 2], CHANNELS.index(name)
        if visible[k]:
            for axes, after in zip(pair, (False, True), strict=True):
                _folded(axes, learned, picked, k, after)
        else:
            for axes in pair:
                mark_unobserved(axes)
        pair[0].set_ylabel(f"{words(name)}\ndegrees", fontsize=9)
    panels[0].set_title("before", fontsize=10)
    panels[1].set_title("after", fontsize=10)
    for axes in panels[-2:]:
        axes.set(xlim=(0, 1))
    panels[-2].set_xlabel("share of the period since the first frame")
    panels[-1].set_xlabel(PHASE_LABEL)
    subject_legend(figure, learned)
    return figure


def _folded(axes: Axes, learned: Learned, picked: Indices, k: int, after: bool) -> None:
    """Draw one channel of the sequences over their phase, and the mean of what is drawn."""
    shades = colours(len(learned.subjects))
    phases, values = [], []
    for i in picked:
        s = learned.sequences[i]
        start = learned.alignment.offsets[i] if after else 0.0
        phase = np.mod((np.arange(len(s.channels)) - start) / s.period.frames, 1.0)
        curve = np.degrees(s.channels[:, k])
        phases.append(phase)
        values.append(curve)
        wraps = np.flatnonzero(np.diff(phase) < 0) + 1  # so that no line runs back over the panel
        axes.plot(
            np.insert(phase, wraps, np.nan), np.insert(curve, wraps, np.nan),
            color=shades[learned.subject_index[i]], lw=0.5, alpha=0.6, marker=".", ms=_dot(curve), mew=0,
        )  # fmt: skip
    centres, mean = _binned(np.concatenate(phases), np.concatenate(values))
    axes.plot(centres, mean, "k", lw=2)


def _dot(curve: Floats) -> float:
    """Return the size of the dots on a curve, for isolated samples, which make no line."""
    visible = np.isfinite(curve)
    return 2.0 if visible.any() and np.mean(visible) < SCATTERED else 0.0


def _binned(phase: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return the mean of values over bins of the phase, closed to a whole cycle."""
    visible = np.isfinite(values)
    if not visible.any():
        return np.zeros(0), np.zeros(0)
    number = int(np.clip(visible.sum() // IN_BIN, FEWEST_BINS, MOST_BINS))
    bins = np.minimum((phase[visible] * number).astype(int), number - 1)
    count = np.bincount(bins, minlength=number)
    middles, filled = np.arange(number), np.flatnonzero(count)  # empty bins are bridged
    mean = np.interp(
        middles, filled, (np.bincount(bins, values[visible], number)[filled] / count[filled]), period=number
    )
    centres = (np.arange(-1, number + 1) + 0.5) / number
    return centres, np.concatenate([mean[-1:], mean, mean[:1]])


def cycles(learned: Learned) -> Figure:
    """Draw the cycles on the common phase and their mean."""
    figure, panels = grid(2, 3, 10, 5.6, sharex=True)
    picked = evenly(len(learned.cycles.values), MOST_DRAWN_CYCLES)
    mask = learned.cycles.mask[picked]
    values = np.degrees(np.where(mask, learned.cycles.values[picked], np.nan))
    mean, visible = np.degrees(learned.curves[0]), learned.cycles.visible
    shades = colours(len(learned.subjects))
    for axes, name in zip(panels, SHOWN_ANGLES, strict=True):
        k = CHANNELS.index(name)
        axes.set_title(words(name), fontsize=10)
        axes.set(xlim=(0, 1))
        if not visible[k]:
            mark_unobserved(axes)
            continue
        for row, subject in zip(values[:, :, k], learned.row_subject[picked], strict=True):
            axes.plot(PHASE_AXIS, row, color=shades[subject], lw=0.4, alpha=0.6)
        axes.plot(PHASE_AXIS, mean[:, k], "k", lw=2)
    for axes in panels[3:]:
        axes.set_xlabel(PHASE_LABEL)
    for axes in panels[::3]:
        axes.set_ylabel("degrees")
    subject_legend(figure, learned)
    return figure


def missing(learned: Learned) -> Figure:
    """Draw the observed share of the cycles over the phases and over the channels."""
    mask, order = learned.cycles.mask, np.argsort(learned.row_subject, kind="stable")
    figure, (left, right) = grid(1, 2, 10, 5.2, sharey="all")
    _map(left, mask[order].mean(axis=2), 1)
    image = _map(right, mask[order].mean(axis=1), len(CHANNELS))
    left.set(xlabel=PHASE_LABEL, title="share of the channels")
    right.set(title="share of the phases")
    right.set_xticks(np.arange(len(CHANNELS)) + 0.5, [words(n) for n in CHANNELS], rotation=90, fontsize=6.5)
    _name_subjects(left, learned)
    for axes in (left, right):
        axes.grid(visible=False)
        axes.title.set_fontsize(10)
    figure.colorbar(image, ax=[left, right], label="observed", shrink=0.8)
    return figure


def _map(axes: Axes, share: Floats, width: float) -> AxesImage:
    """Draw shares (R, n) from 0 to 1, rows downwards, over `width`."""
    return axes.imshow(
        share, extent=(0, width, len(share), 0), aspect="auto", cmap="Blues", vmin=0, vmax=1,
        interpolation="nearest",
    )  # fmt: skip


def _name_subjects(axes: Axes, learned: Learned) -> None:
    """Name the subjects at the middle of their cycles and separate them by lines."""
    counts = np.bincount(learned.row_subject, minlength=len(learned.subjects))
    ends = np.cumsum(counts)
    if len(counts) > MOST_TICKS:
        axes.set_ylabel("cycle, by subject")
        return
    middles, names = ends - counts / 2, []
    free = -np.inf
    for middle, subject in zip(middles / ends[-1], learned.subjects, strict=True):
        names.append(subject if middle >= free else "")  # names must not overlap
        free = middle + LINE if names[-1] else free
    axes.set_yticks(middles, names)
    axes.set_ylabel("cycles of the subject")
    for each in axes.figure.axes:
        for end in ends[:-1]:
            each.axhline(end, color="w", lw=0.8)


def errors(learned: Learned) -> Figure | None:
    """Draw both residuals per subject; None if there are too few or too many subjects."""
    found = learned.by_subject
    if found is None:
        return None
    count = len(learned.subjects)
    figure, panels = grid(1, 2, 9, 0.3 * count + 1.3, sharey="all")
    rows = np.arange(count)
    units = {"angles, degrees (rms)": found.degrees, "joints, mm (mean)": found.millimetres}
    for axes, (unit, (within, without)) in zip(panels, units.items(), strict=True):
        axes.hlines(rows, within, without, color="#cccccc", lw=2, zorder=1)
        axes.plot(within, rows, "o", color=BLUE, label="learnt from")
        axes.plot(without, rows, "o", color=ORANGE, label="left out")
        axes.set(xlabel=f"residual: {unit}", xlim=(0, None), ylim=(count - 0.5, -0.5))
    panels[0].set_yticks(rows, learned.subjects)
    panels[0].set_ylabel("subject")
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside upper right", ncols=2, fontsize=8, frameon=False
    )
    return figure


def colours(count: int) -> list[str]:
    """Return the colours of the subjects, repeating after ten."""
    return [f"C{i % 10}" for i in range(count)]


def subject_legend(figure: Figure, learned: Learned) -> None:
    """Add a legend of the subjects' colours, if they are few."""
    if 1 < len(learned.subjects) <= MOST_LEGEND:
        shades = colours(len(learned.subjects))
        line_legend(figure, dict(zip(learned.subjects, shades, strict=True)), centred=True, title="subject")


def evenly(count: int, most: int) -> Indices:
    """Return at most `most` of `count` indices, evenly spaced."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))
