"""Figures of the model: mean and components, as curves and stick figures (Ormoneit 2000, Fig. 6); errors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from gait.body.skeleton import ANGLES, CHANNELS, JOINTS, default_skeleton, points, side_of
from gait.learn.arrays import Floats
from gait.learn.prior.fit import CYCLE_SAMPLES, Learned
from gait.report.colours import BLUE, DARK, GREY, ON_PAPER, ORANGE
from gait.report.figures import STICK_CHAINS, grid, line_legend, plain

SHOWN_ANGLES = (
    *("r_hip_flexion", "r_knee_flexion", "r_ankle_flexion", "r_shoulder_flexion", "r_elbow_flexion"),
    "torso_z",
)
PHASE_AXIS = np.arange(CYCLE_SAMPLES) / CYCLE_SAMPLES
PHASE_LABEL = "phase (0: right heel strike)"
STRIP_PHASES = 8  # of a strip
SD_COLOURS = {"+2 sd": ORANGE, "mean": GREY, "-2 sd": BLUE}
FIGURE_SPACING = 0.75  # statures from one stick figure to the next
MOST_DRAWN_COMPONENTS = 8  # drawn as curves
MOST_SPECTRUM = 20
JOINT_ORDER = ("hip", "knee", "ankle", "shoulder", "elbow", "torso", "neck")


def words(name: str) -> str:
    """Return a readable name of a channel."""
    side = {"l_": "left ", "r_": "right "}.get(name[:2], "")
    return side + name.removeprefix("l_" if side == "left " else "r_" if side else "").replace("_", " ")


def mark_unobserved(axes: Axes) -> None:
    """Mark the panel of a channel that no recording has."""
    axes.set(ylim=(-1, 1), yticks=[])
    axes.text(0.5, 0, "not observed", ha="center", va="center", color=GREY, fontsize=9)


def curves(learned: Learned, shown: Sequence[str] = SHOWN_ANGLES) -> Figure:
    """Draw mean and two standard deviations of the stride rate and of each component, angle by angle."""
    mean_curve, *turns = np.degrees(learned.curves[: 1 + MOST_DRAWN_COMPONENTS])
    names, visible = [f"component {k + 1}" for k in range(len(turns))], learned.cycles.visible
    if learned.pace_curve.any():
        names, turns = ["stride rate", *names], [np.degrees(learned.pace_curve), *turns]
    figure = Figure(figsize=(11, 1.6 * len(names) + 0.7), layout="constrained")
    panels = figure.subplots(len(names), len(shown), sharex=True, sharey="col", squeeze=False)
    for k, row in enumerate(panels):
        for axes, name in zip(row, shown, strict=True):
            plain(axes)
            c = CHANNELS.index(name)
            if not visible[c]:
                mark_unobserved(axes)
            else:
                mean, turn = mean_curve[:, c], 2 * turns[k][:, c]
                axes.fill_between(PHASE_AXIS, mean - turn, mean + turn, color=GREY, alpha=0.2, lw=0)
                axes.plot(PHASE_AXIS, mean + turn, color=ORANGE, lw=1)
                axes.plot(PHASE_AXIS, mean, color=DARK, lw=1)
                axes.plot(PHASE_AXIS, mean - turn, color=BLUE, lw=1)
            axes.set(xlim=(0, 1))
            if k == 0:
                axes.set_title(words(name), fontsize=9)
        row[0].set_ylabel(f"{names[k]}\ndegrees", fontsize=8)
    line_legend(figure, {**SD_COLOURS, "mean": DARK})
    figure.supxlabel(PHASE_LABEL, fontsize=9)
    return figure


def strip(
    learned: Learned, moved: Floats | None, cycle: Floats | None = None, phases: int = STRIP_PHASES
) -> Figure:
    """Draw stick figures over one cycle (T, M), by default the mean, from the side and from the front.

    With `moved` (T, M), the cycle plus and minus twice this change is drawn over it.
    """
    cycle = learned.curves[0] if cycle is None else cycle
    figure, panels = grid(2, 1, 10, 4.6)
    turns = [0.0] if moved is None else [0.0, -2.0, 2.0]
    top = 1.05
    for turn in turns:
        joints = bodies(learned, cycle if moved is None else cycle + turn * moved, phases)
        top = max(top, float(joints[..., 2].max()))
        colour = {0.0: DARK if moved is None else GREY, -2.0: BLUE, 2.0: ORANGE}[turn]
        for axes, across in zip(panels, (0, 1), strict=True):
            _draw(axes, joints, across, colour)
    for axes, name in zip(panels, ("seen from the right", "seen from ahead"), strict=True):
        axes.set_aspect("equal")
        axes.grid(visible=False)
        axes.axhline(0, color="#cccccc", lw=0.8, zorder=0)
        axes.set(
            xlim=(-0.6 * FIGURE_SPACING, (phases - 0.4) * FIGURE_SPACING),
            ylim=(-0.04, top + 0.03),
            yticks=[],
            ylabel=name,
        )
        axes.spines[["left", "bottom"]].set_visible(False)
        axes.set_xticks(FIGURE_SPACING * np.arange(phases), [f"{i / phases:g}" for i in range(phases)])
    panels[1].set_xlabel(PHASE_LABEL)
    if moved is not None:
        line_legend(figure, SD_COLOURS)
    return figure


def bodies(learned: Learned, cycle: Floats, phases: int = STRIP_PHASES) -> Floats:
    """Return joints (phases, P, 3) of a cycle (T, M) in statures, the lowest point on the ground."""
    at = np.arange(phases) * len(cycle) // phases
    joints = points(default_skeleton(learned.proportions).sections(), cycle[at])
    joints[:, :, 2] -= joints[:, :, 2].min(axis=1, keepdims=True)
    return joints


def _draw(axes: Axes, figures: Floats, across: int, colour: str) -> None:
    """Draw stick figures side by side; the side nearer to the viewer (the right) is bolder.

    `across`: coordinate along the paper: 0: forward is to the right; 1: seen from the front, with the
    person's left to the right.
    """
    for i, body in enumerate(figures):
        for side, chains in STICK_CHAINS.items():
            for chain in chains:
                joints = body[[JOINTS.index(name) for name in chain]]
                axes.plot(
                    joints[:, across] + i * FIGURE_SPACING, joints[:, 2], color=colour,
                    lw=0.9 if side == "l" else 1.8, alpha=0.7 if side == "l" else 1,
                    solid_capstyle="round",
                )  # fmt: skip


def spectrum(learned: Learned) -> Figure:
    """Draw the share of the variance that components explain, and the error on held-out data if computed."""
    held = np.degrees(learned.held_out)
    figure, panels = grid(1, 2 if len(held) else 1, 8 if len(held) else 5, 3.4)
    single, kept = 100 * learned.components.spectrum[:MOST_SPECTRUM], len(learned.components.sd)
    numbers = np.arange(1, len(single) + 1)
    panels[0].bar(numbers, single, color=BLUE, alpha=0.6, label="each")
    panels[0].plot(numbers, np.cumsum(single), "o-", ms=3, color=DARK, label="together")
    panels[0].axvline(kept + 0.5, color=ORANGE, lw=1, ls="--", label=f"kept: {kept}")
    panels[0].set(xlabel="component", ylabel="variance explained, %", ylim=(0, 103))
    panels[0].set_xlim(0.3, len(single) + 0.7)
    panels[0].legend(fontsize=8, frameon=False, loc="center right")
    if len(held):
        panels[1].plot(np.arange(len(held)), held, "o-", ms=4, color=BLUE)
        panels[1].plot(kept, held[min(kept, len(held) - 1)], "o", ms=7, color=ORANGE, label=f"chosen: {kept}")
        panels[1].set(xlabel="components", ylabel="error on held-out data, degrees")
        panels[1].legend(fontsize=8, frameon=False)
    for axes in panels:
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    return figure


def residuals(learned: Learned) -> Figure:
    """Draw the rms of each angle's residuals about the components."""
    figure, (axes,) = grid(1, 1, 8, 3.8)
    squares, count = learned.residuals.squares.sum(axis=0), learned.residuals.count.sum(axis=0)
    rest = np.degrees(np.sqrt(squares / np.maximum(count, 1)))[: len(ANGLES)]
    order = sorted(range(len(ANGLES)), key=lambda i: [j in ANGLES[i] for j in JOINT_ORDER].index(True))
    shades = [ON_PAPER[side_of(ANGLES[i])] for i in order]
    axes.bar(np.arange(len(order)), rest[order], color=shades)
    for place in np.flatnonzero(count[order] == 0).tolist():
        axes.text(place, 0, " not observed", rotation=90, ha="center", va="bottom", fontsize=7, color=GREY)
    axes.set_xticks(np.arange(len(order)), [words(ANGLES[i]) for i in order], rotation=90, fontsize=8)
    axes.set(ylabel="residual, degrees (rms)", xlim=(-0.7, len(order) - 0.3))
    axes.grid(visible=False, axis="x")
    return figure


def convergence(learned: Learned) -> Figure:
    """Draw the objectives of the alignment and the filling of gaps, and its error, against their passes."""
    filling = learned.components
    courses: list[tuple[str, str, list[float] | Floats]] = [
        ("alignment", "weighted sum of squares, rad²", learned.alignment.objective),
        ("filling of gaps: objective", "- log-likelihood per entry", filling.objective),
        ("filling of gaps: error", "on observed entries, degrees (rms)", np.degrees(filling.rmse)),
    ]
    if learned.paper:  # the iterated SVD minimises the error itself
        del courses[1]
    figure, panels = grid(1, len(courses), 10, 3.2)
    for axes, (title, unit, values) in zip(panels, courses, strict=True):
        axes.plot(np.arange(1, len(values) + 1), values, "o-", ms=3, color=BLUE)
        axes.set(xlabel="pass", ylabel=unit)
        axes.set_title(title, fontsize=10)
        axes.ticklabel_format(axis="y", useOffset=False)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    return figure
