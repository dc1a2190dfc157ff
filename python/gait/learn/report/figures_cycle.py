"""Figures of the cycles: before and after alignment (Ormoneit 2000, Fig. 4), all of them, what is missing."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from gait.body.skeleton import CHANNELS
from gait.learn.prior.fit import Learned
from gait.learn.report.figures_base import (
    PHASE,
    PHASE_LABEL,
    SHOWN,
    Floats,
    colours,
    column,
    grid,
    observed,
    say_unobserved,
    spread_out,
    subject_legend,
    words,
)

ALIGNED = ("r_hip_flexion", "r_knee_flexion", "l_shoulder_flexion")
MOST_SEQUENCES = 40  # drawn before and after
MOST_CYCLES = 300  # drawn
BINS, FEWEST_BINS = 64, 20  # of the mean curve of what is folded
IN_BIN = 5  # samples that a bin should have
SCATTERED = 0.9  # observed share below which samples are dotted
MOST_TICKS = 20  # subjects named in the map
LINE = 0.03  # share of the map that a name takes


def alignment(learned: Learned) -> Figure:
    """Sequences folded at their periods, before and after the offsets are taken off, with their mean."""
    figure, panels = grid(len(ALIGNED), 2, 8, 6.2, sharex=True, sharey="row")
    picked = spread_out(len(learned.sequences), MOST_SEQUENCES)
    seen = observed(learned)
    for row, name in enumerate(ALIGNED):
        pair, k = panels[2 * row : 2 * row + 2], column(name)
        if seen[k]:
            for axes, after in zip(pair, (False, True), strict=True):
                _folded(axes, learned, picked, k, after)
        else:
            for axes in pair:
                say_unobserved(axes)
        pair[0].set_ylabel(f"{words(name)}\ndegrees", fontsize=9)
    panels[0].set_title("before", fontsize=10)
    panels[1].set_title("after", fontsize=10)
    for axes in panels[-2:]:
        axes.set(xlim=(0, 1))
    panels[-2].set_xlabel("share of the period since the first frame")
    panels[-1].set_xlabel(PHASE_LABEL)
    subject_legend(figure, learned)
    return figure


def _folded(axes: Axes, learned: Learned, picked: object, k: int, after: bool) -> None:
    """One channel of the sequences over their phase, and the mean of all that is drawn."""
    shades = colours(len(learned.subjects))
    phases, values = [], []
    for i in np.asarray(picked):
        s = learned.sequences[i]
        start = learned.alignment.offsets[i] if after else 0.0
        phase = np.mod((np.arange(len(s.channels)) - start) / s.period.frames, 1.0)
        curve = np.degrees(s.channels[:, k])
        phases.append(phase)
        values.append(curve)
        wraps = np.flatnonzero(np.diff(phase) < 0) + 1  # a line must not run back over the panel
        axes.plot(
            np.insert(phase, wraps, np.nan), np.insert(curve, wraps, np.nan),
            color=shades[learned.subject_index[i]], lw=0.5, alpha=0.6, marker=".", ms=_dot(curve), mew=0,
        )  # fmt: skip
    centres, mean = _binned(np.concatenate(phases), np.concatenate(values))
    axes.plot(centres, mean, "k", lw=2)


def _dot(curve: Floats) -> float:
    """Size of the dots on a curve: samples without neighbours make no line; 0 where there are none."""
    seen = np.isfinite(curve)
    return 2.0 if seen.any() and np.mean(seen) < SCATTERED else 0.0


def _binned(phase: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Mean of values over bins of the phase, closed to a whole cycle."""
    seen = np.isfinite(values)
    if not seen.any():
        return np.zeros(0), np.zeros(0)
    number = int(np.clip(seen.sum() // IN_BIN, FEWEST_BINS, BINS))
    bins = np.minimum((phase[seen] * number).astype(int), number - 1)
    count = np.bincount(bins, minlength=number)
    middles, filled = np.arange(number), np.flatnonzero(count)  # empty bins are bridged
    mean = np.interp(
        middles, filled, (np.bincount(bins, values[seen], number)[filled] / count[filled]), period=number
    )
    centres = (np.arange(-1, number + 1) + 0.5) / number
    return centres, np.concatenate([mean[-1:], mean, mean[:1]])


def cycles(learned: Learned) -> Figure:
    """Cycles on the common phase, their mean, and the band of two standard deviations."""
    figure, panels = grid(2, 3, 10, 5.6, sharex=True)
    picked = spread_out(len(learned.cycles.values), MOST_CYCLES)
    mask = learned.cycles.mask[picked]
    values = np.degrees(np.where(mask, learned.cycles.values[picked], np.nan))
    mean, seen = np.degrees(learned.curves[0]), observed(learned)
    shades = colours(len(learned.subjects))
    for axes, name in zip(panels, SHOWN, strict=True):
        k = column(name)
        axes.set_title(words(name), fontsize=10)
        axes.set(xlim=(0, 1))
        if not seen[k]:
            say_unobserved(axes)
            continue
        for row, subject in zip(values[:, :, k], learned.row_subject[picked], strict=True):
            axes.plot(PHASE, row, color=shades[subject], lw=0.4, alpha=0.6)
        axes.plot(PHASE, mean[:, k], "k", lw=2)
    for axes in panels[3:]:
        axes.set_xlabel(PHASE_LABEL)
    for axes in panels[::3]:
        axes.set_ylabel("degrees")
    subject_legend(figure, learned)
    return figure


def missing(learned: Learned) -> Figure:
    """Observed share of the cycles: over the phases, and over the channels."""
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
    """Name the subjects at the middle of their cycles and part them by lines."""
    counts = np.bincount(learned.row_subject, minlength=len(learned.subjects))
    ends = np.cumsum(counts)
    if len(counts) > MOST_TICKS:
        axes.set_ylabel("cycle, by subject")
        return
    middles, names = ends - counts / 2, []
    free = -np.inf
    for middle, subject in zip(middles / ends[-1], learned.subjects, strict=True):
        names.append(subject if middle >= free else "")  # names must not lie over each other
        free = middle + LINE if names[-1] else free
    axes.set_yticks(middles, names)
    axes.set_ylabel("cycles of the subject")
    for each in axes.figure.axes:
        for end in ends[:-1]:
            each.axhline(end, color="w", lw=0.8)
