"""Plots as SVG text for self-contained pages, in the colours of the page, light or dark."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from html import escape

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from gait.report.colours import BLUE, DARK, GREY, ORANGE

Painter = Callable[[Axes], None]

_LARGE, _NARROW = 10.4, 3.7  # inches; widths of a screen or paper, and of a phone
_LEFT, _RIGHT, _TOP, _BOTTOM = 0.75, 0.15, 0.35, 0.5  # inches beside the axes of a plot over time
_PANEL = (3.2, 2.2)  # inches; size of one of many panels
_BESIDE_PANEL = (0.62, 0.17, 0.28, 0.46)  # inches left, right, above and below the axes of a panel
_VARIABLES = {BLUE: "left", ORANGE: "right", DARK: "middle", GREY: "faint", "#000000": "ink"}


def panels(painters: Sequence[Painter], label: str) -> str:
    """Draw many small axes, which the page arranges in as many columns as fit."""
    left, right, top, bottom = _BESIDE_PANEL
    width, height = _PANEL
    place = (left / width, bottom / height, 1 - (left + right) / width, 1 - (top + bottom) / height)
    cells = "".join(_drawn(paint, _PANEL, 8.5, label, place) for paint in painters)
    return f'<div class="panels">{cells}</div>'


def for_screen_and_telephone(paint: Painter, height: float, label: str, narrow: float | None = None) -> str:
    """Draw axes once for a screen or paper and once for a phone; heights in inches."""
    large = _drawn(paint, (_LARGE, height), 10, label)
    small = _drawn(paint, (_NARROW, narrow or height), 8.5, label)
    return f'<div class="plot-large">{large}</div><div class="plot-narrow">{small}</div>'


def time_plot(paint: Painter, span: tuple[float, float], height: float, title: str) -> str:
    """Draw axes over `span` seconds across the page, on which the page's script moves a cursor.

    `height`: inches; `title`: shown above the axes.
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


def _drawn(
    paint: Painter,
    size: tuple[float, float],
    font: float,
    label: str,
    place: tuple[float, float, float, float] | None = None,
) -> str:
    """Draw axes on a figure of `size` inches; `place`: left, bottom, width and height as fractions of it."""
    with _settings(font):
        figure = Figure(figsize=size, layout=None if place else "constrained")
        _painted(figure.add_axes(place) if place else figure.add_subplot(), paint, font)
        return _text(figure, label)


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
    """Return the SVG with the page's colours, so that it is also readable on dark pages."""
    file = io.StringIO()
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    engine = figure.get_layout_engine()
    if engine is not None:  # do the layout here, as saving would draw everything twice
        FigureCanvasSVG(figure)
        engine.execute(figure)
        figure.set_layout_engine(None)
    figure.savefig(file, format="svg", metadata=nothing, transparent=True)
    text = file.getvalue()[file.getvalue().index("<svg") :]
    for hexadecimal, name in _VARIABLES.items():
        text = text.replace(f": {hexadecimal}", f": var(--{name})")
    return text.replace("<svg", f'<svg role="img" aria-label="{escape(label)}"', 1)
