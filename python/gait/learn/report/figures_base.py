"""What the figures of a learnt model share: colours, grids of axes, the words of the axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from gait.body.skeleton import CHANNELS
from gait.report.colours import GREY
from gait.learn.prior.fit import SAMPLES, Learned

Floats = npt.NDArray[np.float64]

SHOWN = (
    "r_hip_flexion",
    "r_knee_flexion",
    "r_ankle_flexion",
    "r_shoulder_flexion",
    "r_elbow_flexion",
    "torso_z",
)
PHASE = np.arange(SAMPLES) / SAMPLES
PHASE_LABEL = "phase (0: right heel strike)"
MOST_LEGEND = 10  # entries


@dataclass
class Drawing:
    """A figure of the report.

    Attributes
    ----------
    stem : str
        Of its PNG file.
    heading, caption : str
    figure : matplotlib.figure.Figure
    """

    stem: str
    heading: str
    caption: str
    figure: Figure


def grid(
    rows: int,
    columns: int,
    width: float,
    height: float,
    sharex: bool = False,
    sharey: Literal["none", "row", "all"] = "none",
) -> tuple[Figure, list[Axes]]:
    """Make a figure of `width` x `height` inches and its axes, row by row."""
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = list(figure.subplots(rows, columns, sharex=sharex, sharey=sharey, squeeze=False).ravel())
    for each in axes:
        plain(each)
    return figure, axes


def plain(axes: Axes) -> None:
    """Style axes: a faint grid and no box."""
    axes.grid(alpha=0.25, lw=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)


def words(name: str) -> str:
    """Readable name of a channel."""
    side = {"l_": "left ", "r_": "right "}.get(name[:2], "")
    return side + name.removeprefix("l_" if side == "left " else "r_" if side else "").replace("_", " ")


def whole_numbers(axes: Axes) -> None:
    """Ticks of the x axis at whole numbers only."""
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def observed(learned: Learned) -> npt.NDArray[np.bool_]:
    """Channels (M,) that any cycle holds."""
    return learned.cycles.seen


def say_unobserved(axes: Axes) -> None:
    """Mark the panel of a channel that no recording holds."""
    axes.set(ylim=(-1, 1), yticks=[])
    axes.text(0.5, 0, "not observed", ha="center", va="center", color=GREY, fontsize=9)


def colours(count: int) -> list[str]:
    """Colours of the subjects, repeating after ten."""
    return [f"C{i % 10}" for i in range(count)]


def line_legend(
    figure: Figure, entries: dict[str, str], centred: bool = False, title: str | None = None
) -> None:
    """Legend above the figure: words to the colours of lines."""
    figure.legend(
        [Line2D([], [], color=colour, lw=2) for colour in entries.values()], list(entries),
        loc="outside upper center" if centred else "outside upper right", ncols=len(entries),
        fontsize=8, frameon=False, title=title, title_fontsize=8,
    )  # fmt: skip


def subject_legend(figure: Figure, learned: Learned) -> None:
    """Legend of the subjects' colours, if they are few."""
    if 1 < len(learned.subjects) <= MOST_LEGEND:
        shades = colours(len(learned.subjects))
        line_legend(figure, dict(zip(learned.subjects, shades, strict=True)), centred=True, title="subject")


def spread_out(count: int, most: int) -> npt.NDArray[np.intp]:
    """At most `most` of `count` indices, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def column(name: str) -> int:
    """Index of a channel."""
    return CHANNELS.index(name)
