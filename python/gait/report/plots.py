"""Plots as SVG text for pages that need nothing else."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

Painter = Callable[[Axes], None]


def svg_figure(
    rows: Sequence[Sequence[Painter]], size: tuple[float, float], font: float = 8, legend: bool = False
) -> str:
    """Draw rows of axes, each by its painter.

    `size`: width and height, inches; `font`: points; `legend`: show one legend above all axes,
    that of the first.
    """
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "gait", "font.size": font}):
        figure = Figure(figsize=size, layout="constrained")
        grid = figure.add_gridspec(len(rows), max(len(row) for row in rows))
        for i, row in enumerate(rows):
            for k, paint in enumerate(row):
                axes = figure.add_subplot(grid[i, k])
                axes.grid(alpha=0.25)
                axes.spines[["top", "right"]].set_visible(False)
                paint(axes)
                axes.title.set_fontsize(font)
        if legend:
            handles, labels = figure.axes[0].get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    return text.getvalue()[text.getvalue().index("<svg") :]
