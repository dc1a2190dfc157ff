"""The figures of `gait learn --report`, each a function from a learned model to a matplotlib figure."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from gait.learn.fit import SAMPLES, Learned
from gait.skeleton import ANGLES, CHANNELS

SHOWN = (
    "r_hip_flexion",
    "r_knee_flexion",
    "r_ankle_flexion",
    "r_shoulder_flexion",
    "r_elbow_flexion",
    "torso_z",
)
MOST_CURVES = 12  # sequences drawn in the figure of the ratio
PHASE = np.arange(SAMPLES) / SAMPLES


def _grid(
    rows: int, columns: int, width: float, height: float, share: bool = False
) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, list(np.atleast_1d(figure.subplots(rows, columns, sharex=share)).ravel())


def _title(name: str) -> str:
    return name.replace("r_", "right ", 1).replace("_", " ")


def ratio(learned: Learned) -> Figure:
    """Signal-to-noise ratio against the period (Ormoneit 2000, Fig. 2), each over its best."""
    figure, (axes,) = _grid(1, 1, 8, 4.2)
    step = max(1, len(learned.sequences) // MOST_CURVES)
    for s in learned.sequences[::step]:
        seconds, share = s.period.candidates / s.fps, s.period.scores / np.nanmax(s.period.scores)
        axes.plot(seconds, share, lw=1, label=s.name)
        axes.plot(s.period.frames / s.fps, 1.02, "v", ms=5, color=axes.lines[-1].get_color())
    axes.set(xlabel="period, s", ylabel="signal-to-noise ratio / its maximum", ylim=(0, 1.08))
    axes.legend(ncols=2, fontsize=7, frameon=False)
    return figure


def cycles(learned: Learned) -> Figure:
    """Aligned cycles and their mean (Fig. 4)."""
    figure, panels = _grid(2, 3, 10, 5.4, share=True)
    values = np.where(learned.cycles.mask, learned.cycles.values, np.nan)
    mean = learned.components.mean / learned.scale
    colours = [f"C{i % 10}" for i in learned.row_subject]
    for axes, name in zip(panels, SHOWN, strict=True):
        k = CHANNELS.index(name)
        for row, colour in zip(values[:, :, k], colours, strict=True):
            axes.plot(PHASE, np.degrees(row), color=colour, lw=0.4, alpha=0.6)
        axes.plot(PHASE, np.degrees(mean[:, k]), "k", lw=2)
        axes.set_title(_title(name), fontsize=10)
        axes.set(xlim=(0, 1))
    _label(panels, 3)
    return figure


def _label(panels: list[Axes], columns: int) -> None:
    for axes in panels[-columns:]:
        axes.set_xlabel("phase (0: right heel strike)")
    for axes in panels[::columns]:
        axes.set_ylabel("degrees")


def components(learned: Learned) -> Figure:
    """Mean and two standard deviations along each component (Fig. 6)."""
    curves = learned.curves
    count = min(len(curves) - 1, 5)
    figure = Figure(figsize=(2.1 * len(SHOWN), 1.7 * count + 0.4), layout="constrained")
    panels = np.atleast_2d(figure.subplots(count, len(SHOWN), sharex=True, sharey="col"))
    for k in range(count):
        for axes, name in zip(panels[k], SHOWN, strict=True):
            c = CHANNELS.index(name)
            mean, turn = np.degrees(curves[0, :, c]), np.degrees(curves[k + 1, :, c])
            axes.fill_between(PHASE, mean - 2 * turn, mean + 2 * turn, color="C0", alpha=0.15, lw=0)
            axes.plot(PHASE, mean + 2 * turn, "C3", lw=1, label="+2 sd")
            axes.plot(PHASE, mean - 2 * turn, "C0", lw=1, label="-2 sd")
            axes.plot(PHASE, mean, "k", lw=1)
            axes.set(xlim=(0, 1))
            if k == 0:
                axes.set_title(_title(name), fontsize=9)
        panels[k, 0].set_ylabel(f"component {k + 1}\ndegrees", fontsize=8)
    panels[0, -1].legend(fontsize=7, frameon=False)
    figure.supxlabel("phase (0: right heel strike)", fontsize=9)
    return figure


def spectrum(learned: Learned) -> Figure:
    """Share of the variance that components explain; error on held-out data if it was asked for."""
    figure, panels = _grid(1, 2 if len(learned.held_out) else 1, 8, 3.6)
    share = np.cumsum(learned.components.spectrum)[:12]
    panels[0].plot(np.arange(1, len(share) + 1), 100 * share, "o-")
    panels[0].axvline(len(learned.components.sd), color="k", lw=0.8, ls=":", label="kept")
    panels[0].set(xlabel="components", ylabel="variance explained, %", ylim=(0, 100))
    panels[0].legend(frameon=False)
    if len(learned.held_out):
        panels[1].plot(np.arange(len(learned.held_out)), np.degrees(learned.held_out), "o-")
        panels[1].set(xlabel="components", ylabel="error on held-out data, degrees")
    return figure


def missing(learned: Learned) -> Figure:
    """Which entries of the cycles were observed: rows are cycles, columns phases, share over the channels."""
    figure, (axes,) = _grid(1, 1, 8, 4.6)
    image = axes.imshow(
        learned.cycles.mask.mean(axis=2), aspect="auto", cmap="cividis", vmin=0, vmax=1,
        extent=(0, 1, len(learned.cycles.mask), 0), interpolation="nearest",
    )  # fmt: skip
    axes.set(xlabel="phase", ylabel="cycle")
    figure.colorbar(image, ax=axes, label="share of the channels observed")
    return figure


def convergence(learned: Learned) -> Figure:
    """Objectives of the alignment and of the imputation against their passes."""
    figure, (left, right) = _grid(1, 2, 8, 3.4)
    objective, rmse = np.array(learned.alignment.objective), np.array(learned.components.rmse)
    left.plot(np.arange(1, len(objective) + 1), objective, "o-")
    left.set(xlabel="pass", ylabel="weighted sum of squares", title="alignment")
    right.plot(np.arange(1, len(rmse) + 1), np.degrees(rmse), "o-", ms=3)
    right.set(xlabel="pass", ylabel="error on observed entries, degrees", title="filling of gaps")
    for axes in (left, right):
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    return figure


def residuals(learned: Learned) -> Figure:
    """Residual of each angle after the components."""
    figure, (axes,) = _grid(1, 1, 8, 3.8)
    rest = np.degrees(np.sqrt(np.nanmean(learned.residuals[:, :, : len(ANGLES)] ** 2, axis=(0, 1))))
    axes.bar(np.arange(len(ANGLES)), rest)
    axes.set_xticks(
        np.arange(len(ANGLES)), [name.replace("_", " ") for name in ANGLES], rotation=90, fontsize=7
    )
    axes.set(ylabel="residual, degrees (rms)")
    return figure


#: File stem, caption and function, in the order of the page.
FIGURES: list[tuple[str, str, Callable[[Learned], Figure]]] = [
    ("snr", "Signal-to-noise ratio against the period; triangles mark the periods found.", ratio),
    ("cycles", "Cycles after alignment, one colour per subject, and the mean.", cycles),
    ("components", "Mean and two standard deviations along each component.", components),
    ("spectrum", "Variance explained.", spectrum),
    ("residuals", "What the components leave.", residuals),
    ("missing", "Observed part of the cycles; the rest is filled by the components.", missing),
    ("convergence", "Convergence.", convergence),
]
