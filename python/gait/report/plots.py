"""Plots as SVG text for pages that need nothing else, in the colours of their style, light or dark."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from html import escape

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gait.report.colours import BLUE, DARK, GREY, ORANGE

Painter = Callable[[Axes], None]

_LARGE, _NARROW = 10.4, 3.7  # inches: of a screen or paper, and of a telephone
_LEFT, _RIGHT, _TOP, _BOTTOM = 0.75, 0.15, 0.35, 0.5  # inches beside the axes of a plot over time
_PANEL = (3.2, 2.2)  # inches of one of many panels
_VARIABLES = {BLUE: "left", ORANGE: "right", DARK: "middle", GREY: "faint", "#000000": "ink"}


def svg_figure(
    rows: Sequence[Sequence[Painter]],
    size: tuple[float, float],
    font: float = 8,
    legend: bool = False,
    label: str = "",
) -> str:
    """Draw rows of axes, each by its painter.

    `size`: width and height, inches; `font`: points; `legend`: show one legend above all axes, that of the
    first; `label`: what the drawing shows, for those who cannot see it.
    """
    with _settings(font):
        figure = Figure(figsize=size, layout="constrained")
        grid = figure.add_gridspec(len(rows), max(len(row) for row in rows))
        for i, row in enumerate(rows):
            for k, paint in enumerate(row):
                _painted(figure.add_subplot(grid[i, k]), paint, font)
        if legend:
            handles, labels = figure.axes[0].get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
        return _text(figure, label)


def panels(painters: Sequence[Painter], label: str) -> str:
    """Draw many small axes, which the page puts into as many columns as fit."""
    cells = "".join(svg_figure([[paint]], _PANEL, 8.5, label=label) for paint in painters)
    return f'<div class="panels">{cells}</div>'


def for_screen_and_telephone(paint: Painter, height: float, label: str, narrow: float | None = None) -> str:
    """Draw axes for a screen or paper and again for a telephone; heights in inches."""
    large = svg_figure([[paint]], (_LARGE, height), 10, label=label)
    small = svg_figure([[paint]], (_NARROW, narrow or height), 8.5, label=label)
    return f'<div class="plot-large">{large}</div><div class="plot-narrow">{small}</div>'


def time_plot(paint: Painter, span: tuple[float, float], height: float, title: str) -> str:
    """Draw axes over `span` seconds across the page, on which its script moves a cursor.

    `height` in inches; `title` stands above the axes.
    """
    parts = []
    for kind, width, font in (("large", _LARGE, 10.0), ("narrow", _NARROW, 8.5)):
        left, right = _LEFT / width, 1 - _RIGHT / width
        with _settings(font):
            figure = Figure(figsize=(width, height))
            axes = figure.add_axes((left, _BOTTOM / height, right - left, 1 - (_TOP + _BOTTOM) / height))
            _painted(axes, paint, font)
            axes.set(xlim=span, xlabel="time, s")
            axes.set_title(title, loc="left", fontsize=font)
            place = f'data-left="{left:.4f}" data-right="{right:.4f}"'
            place += f' style="--top: {100 * _TOP / height:.1f}%; --bottom: {100 * _BOTTOM / height:.1f}%"'
            parts.append(f'<div class="plot-{kind} timed" {place}>{_text(figure, title)}</div>')
    return f'<div class="over-time" data-from="{span[0]:.6f}" data-to="{span[1]:.6f}">{"".join(parts)}</div>'


def _settings(font: float) -> AbstractContextManager[None]:
    return matplotlib.rc_context(
        {"svg.fonttype": "none", "svg.hashsalt": "gait", "font.size": font, "axes.edgecolor": "#000000"}
    )


def _painted(axes: Axes, paint: Painter, font: float) -> None:
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    paint(axes)
    axes.title.set_fontsize(font)
    legend = axes.get_legend()
    if legend is not None:
        legend.get_frame().set(alpha=0, linewidth=0)


def _text(figure: Figure, label: str) -> str:
    """Return the SVG with the page's colours, so that it is readable on dark pages too."""
    file = io.StringIO()
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    figure.savefig(file, format="svg", metadata=nothing, transparent=True)
    text = file.getvalue()[file.getvalue().index("<svg") :]
    for hexadecimal, name in _VARIABLES.items():
        text = text.replace(f": {hexadecimal}", f": var(--{name})")
    return text.replace("<svg", f'<svg role="img" aria-label="{escape(label)}"', 1)
