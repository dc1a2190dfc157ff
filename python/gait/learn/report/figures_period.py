"""Figures of the cycle's length: signal-to-noise ratio against the period (Ormoneit 2000, Fig. 2)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gait.body.skeleton import ANGLES
from gait.report.colours import BLUE, DARK, GREY, ORANGE
from gait.learn.cycles import period
from gait.learn.cycles.sequence import Sequence
from gait.learn.prior.fit import Learned
from gait.learn.report.figures_base import Floats, grid, plain, words

FLAT = 5.0  # least top of a row's scale, so that the ratio of noise, about 1, looks as flat as it is
MOST_NAMES = 60  # rows of the map that are named
GRID = np.linspace(0.4, 2.1, 171)  # seconds


def richest(learned: Learned) -> Sequence:
    """Pick the sequence of most cycles, which has the clearest curves."""
    return max(learned.sequences, key=lambda s: s.cycles)


def ratios(learned: Learned) -> Figure:
    """Ratio of white noise, of each angle and of their sum over whole periods, for one sequence."""
    s = richest(learned)
    noise = np.random.default_rng(0).normal(size=(len(s.channels), 1))
    signals = np.concatenate([noise, s.channels[:, : len(ANGLES)]], axis=1)
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
    """One angle: its curve, its name to the left and its maximum to the right."""
    top = max(float(np.nanmax(ratio)), FLAT)
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
    """Sum over the angles with the period of its maximum and the one found."""
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
    """Ratio against the period for all sequences, one row each, with the period found."""
    sequences = learned.sequences
    rows = np.array([_resampled(s) for s in sequences])
    named = len(sequences) <= MOST_NAMES
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
    """Scores over their largest on GRID; NaN beyond the candidates that the recording allows.

    Peaks may be narrower than a cell: it shows the largest score in it.
    """
    valid = np.isfinite(s.period.scores)
    seconds = s.period.candidates[valid] / s.fps
    share = s.period.scores[valid] / s.period.scores[valid].max()
    row = np.interp(GRID, seconds, share, left=np.nan, right=np.nan)
    cell = np.round((seconds - GRID[0]) / (GRID[1] - GRID[0])).astype(int)
    shown = (cell >= 0) & (cell < len(GRID))
    np.fmax.at(row, cell[shown], share[shown])
    return row
