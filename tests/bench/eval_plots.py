"""Plots of a clip in one arm: error over time, phase, joints, path seen from above; a line for each seed."""

from __future__ import annotations

import io

import matplotlib
import numpy as np
from eval_measures import phase_difference
from eval_run import Result
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gait.body.skeleton import EVAL15
from gait.motion.evaluate import LOST_MM

COLOURS = ("#2a6f97", "#d9722e", "#5b8e3e", "#8a4f9e")
STATUS = {"init": "#c8c8c8", "ambiguous": "#f4d06f", "lost": "#e07a7a"}
_GREY = "#888888"


def draw(results: list[Result]) -> str:
    """Draw four plots as SVG; plots that need a truth which the clip lacks are left out."""
    runs = [r for r in results if not r.failure]
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "gait", "font.size": 8.5}):
        figure = Figure(figsize=(10.5, 5.2), layout="constrained")
        axes = figure.subplots(2, 2, width_ratios=(3, 2))
        _error(axes[0, 0], runs)
        _joints(axes[0, 1], runs)
        _phase(axes[1, 0], runs)
        _path(axes[1, 1], runs)
        for one in axes.flat:
            one.grid(alpha=0.25)
            one.spines[["top", "right"]].set_visible(False)
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    return text.getvalue()[text.getvalue().index("<svg") :]


def _label(result: Result) -> str:
    return f"seed {result.job.seed}"


def _bands(axes: Axes, result: Result) -> None:
    """Tint the frames of the first seed that are not `tracking`."""
    for number, status in zip(result.series["frame"], result.series["status"], strict=True):
        if status in STATUS:
            axes.axvspan(
                number - 0.5, number + 0.5, color=STATUS[status], alpha=0.3 / len(STATUS) + 0.15, lw=0
            )


def _error(axes: Axes, runs: list[Result]) -> None:
    highest = 0.0
    for colour, run in zip(_cycle(len(runs)), runs, strict=True):
        s = run.series
        _bands(axes, run)
        if "root" in s:
            axes.plot(s["frame"], s["root"], color=colour, lw=1.2, label=f"{_label(run)}, root")
            axes.plot(s["frame"], s["abs"], color=colour, lw=0.7, ls=":")
            highest = max(highest, np.nanpercentile(np.append(s["abs"], s["root"]), 98))
        elif "marked_px" in s:
            known = np.isfinite(s["marked_px"])
            axes.plot(s["frame"][known], s["marked_px"][known], "o-", color=colour, ms=3, label=_label(run))
    if highest:
        axes.axhline(LOST_MM, color=_GREY, lw=0.8, ls="--")
        axes.set(ylabel="error, mm (dotted: abs)", ylim=(0, max(1.08 * highest, LOST_MM * 1.05)))
    else:
        axes.set(ylabel="mean distance of the marks, px", ylim=(0, None))
    axes.set(title="Error; background: grey init, yellow ambiguous, red lost", xlabel="frame")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper right", ncols=2, framealpha=0.7, fontsize=7)


def _phase(axes: Axes, runs: list[Result]) -> None:
    for colour, run in zip(_cycle(len(runs)), runs, strict=True):
        s = run.series
        if "true_phase" in s:
            error = phase_difference(s["phase"], s["true_phase"])
            axes.plot(s["frame"], error, ".", ms=2.5, color=colour, label=_label(run))
    axes.axhline(0, color=_GREY, lw=0.8)
    for half in (-0.5, 0.5):
        axes.axhline(half, color=_GREY, lw=0.8, ls="--")
    axes.set(title="Phase: estimate minus truth", xlabel="frame", ylabel="strides", ylim=(-0.52, 0.52))


def _joints(axes: Axes, runs: list[Result]) -> None:
    """Bars of the median error of each joint: mm with the hips aligned, or pixels at the marks."""
    table: dict[str, list[float]] = {}
    for run in runs:
        if "joints" in run.series:
            for name, value in zip(EVAL15, np.nanmedian(run.series["joints"], axis=0), strict=True):
                table.setdefault(name, []).append(float(value))
        for name, value in run.measures.get("joint_px", {}).items():
            table.setdefault(name, []).append(value)
    names = [name for name in table if name != "pelvis"]
    for row, name in enumerate(names):
        colour = "#4a90c2" if name.startswith("l_") else "#e08a3c" if name.startswith("r_") else "#8fae5a"
        axes.barh(row, float(np.median(table[name])), color=colour, height=0.7)
        axes.plot(table[name], [row] * len(table[name]), "k.", ms=2)
    axes.set_yticks(range(len(names)), names, fontsize=7)
    axes.invert_yaxis()
    unit = "px at clear marks" if any("joint_px" in run.measures for run in runs) else "mm, hips aligned"
    axes.set(title="Median error of each joint (dots: seeds)", xlabel=unit)


def _path(axes: Axes, runs: list[Result]) -> None:
    true = next((run.series["true_path"] for run in runs if "true_path" in run.series), None)
    if true is not None:
        axes.plot(*true.T, color="#bbbbbb", lw=4, label="truth", solid_capstyle="round")
    for colour, run in zip(_cycle(len(runs)), runs, strict=True):
        axes.plot(*run.series["path"].T, color=colour, lw=1)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(title="Pelvis from above", xlabel="x, m", ylabel="y, m")
    if true is not None:
        axes.legend(loc="best", fontsize=7)


def _cycle(count: int) -> list[str]:
    return [COLOURS[k % len(COLOURS)] for k in range(count)]
