"""Stick figures of motion for the report of lifting: rows of one scale, a column for each figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gait.report.colours import DARK, GREY
from gait.learn.report.figures_base import plain
from gait.learn.report.figures_model import STICKS

Floats = npt.NDArray[np.float64]

SHOWN = 5  # frames of a segment
STEP = 0.75  # statures, the least from one figure of a row to the next
GAP = 0.1  # statures at least between figures
WIDTH, LABEL = 8.5, 1.2  # inches, of the whole and of what stands left of the rows
ABOVE = 0.5  # inches, of legend and times
FAINT = "#c8c8c4"
HALO = 2.5  # points by which what is drawn under something else is wider, so that it shows where both agree
BAR = 0.5  # metres
BELOW = 0.1  # statures under the last row, where the bar is
SIDE = np.array([1.0, 0.0, 0.0])  # to the right on the paper: seen from the person's right
AHEAD = np.array([0.0, 1.0, 0.0])  # seen from ahead


@dataclass(frozen=True)
class _Drawn:
    """Figures of a row: flat (n, J, 2) about their columns, up is positive, metres."""

    row: int
    flat: Floats
    colour: str
    ghost: bool


class Strips:
    """Rows of some frames of motion; the right side of the body is bolder.

    Parameters
    ----------
    titles : sequence of str
        One a row.
    names : sequence of str
        The J markers of all motions.
    size : float
        Stature, metres.
    fps : float
        Of all motions.
    """

    def __init__(self, titles: Sequence[str], names: Sequence[str], size: float, fps: float) -> None:
        self._titles, self._size, self._fps = titles, size, fps
        self._index = {name: k for k, name in enumerate(names)}
        self._drawn: list[_Drawn] = []
        self._frames = np.zeros(0, int)

    def add(
        self,
        row: int,
        places: Floats,
        across: Floats,
        colour: str,
        ghost: bool = False,
        path: Floats | None = None,
    ) -> None:
        """Put a motion (F, J, 3) into a row.

        Parameters
        ----------
        across : (3,)
            What is to the right on the paper; up is z.
        ghost : bool
            Faint and wide, under something else.
        path : (F, J, 3), optional
            Motion whose middle every figure stands at; its own if left out.
        """
        self._frames = np.linspace(0, len(places) - 1, min(SHOWN, len(places))).round().astype(int)
        middle = (places if path is None else path)[self._frames].mean(axis=1, keepdims=True)
        body = places[self._frames]
        flat = np.stack([(body - middle) @ across, body[..., 2]], axis=2)
        self._drawn.append(_Drawn(row, flat, colour, ghost))

    def figure(self) -> Figure:
        """Draw all rows, as large as lets every figure have a column of its own."""
        pitch, (left, right), (low, high) = self._extents()
        gap = GAP * self._size
        heights = np.full(len(self._titles), high - low + gap)
        heights[-1] += 2 * BELOW * self._size
        scale = (WIDTH - LABEL) / (right - left)
        tall = scale * heights.sum() + ABOVE
        figure = Figure(figsize=(WIDTH, tall))
        bottoms = scale * (heights.sum() - np.cumsum(heights))
        panels = []
        for title, height, bottom in zip(self._titles, heights, bottoms, strict=True):
            box = (LABEL / WIDTH, bottom / tall, 1 - LABEL / WIDTH, scale * height / tall)
            panels.append(_row(figure, box, title))
            panels[-1].set(xlim=(left, right), ylim=(high + gap / 2 - height, high + gap / 2))
        for each in self._drawn:
            self._draw(panels[each.row], each, pitch)
        for column, frame in enumerate(self._frames.tolist()):
            place, time = (column * pitch, high + gap / 2), f"{frame / self._fps:.2f} s"
            panels[0].text(*place, time, ha="center", va="bottom", fontsize=8)
        scale_bar(panels[-1], left, low - BELOW * self._size, "   bold: right side, thin: left")
        return figure

    def _extents(self) -> tuple[float, tuple[float, float], tuple[float, float]]:
        """Width of a column, and what all rows reach across and up, metres."""
        lows = np.full((len(self._titles), len(self._frames), 2), np.inf)
        highs = -lows
        for each in self._drawn:
            lows[each.row] = np.minimum(lows[each.row], each.flat.min(axis=1))
            highs[each.row] = np.maximum(highs[each.row], each.flat.max(axis=1))
        apart = highs[:, :-1, 0] - lows[:, 1:, 0] + GAP * self._size
        pitch = float(max(STEP * self._size, apart.max(initial=0.0)))
        at = np.arange(len(self._frames)) * pitch
        across = float((lows[..., 0] + at).min()), float((highs[..., 0] + at).max())
        edge = GAP / 2 * self._size
        up = float(min(lows[..., 1].min(), 0.0)), float(highs[..., 1].max())
        return pitch, (across[0] - edge, across[1] + edge), up

    def _draw(self, axes: Axes, each: _Drawn, pitch: float) -> None:
        for column, body in enumerate(each.flat):
            for side, chains in STICKS.items():
                for chain in chains:
                    known = [self._index[name] for name in chain if name in self._index]
                    axes.plot(
                        *(body[known] + (column * pitch, 0)).T,
                        color=FAINT if each.ghost else each.colour,
                        lw=(0.9 if side == "l" else 1.8) + HALO * each.ghost,
                        solid_capstyle="round",
                    )


def _row(figure: Figure, box: tuple[float, float, float, float], title: str) -> Axes:
    """Axes of a row with its title on the left and a line for the floor."""
    axes = figure.add_axes(box)
    bare(axes)
    axes.set_ylabel(title, rotation=0, ha="right", va="center", fontsize=9)
    axes.axhline(0, color=GREY, lw=0.5, zorder=0)
    return axes


def bare(axes: Axes) -> None:
    """Style axes that show figures at a true aspect, without ticks."""
    plain(axes)
    axes.grid(visible=False)
    axes.set_aspect("equal")
    axes.set(xticks=[], yticks=[])
    axes.spines[["left", "bottom"]].set_visible(False)


def scale_bar(axes: Axes, x: float, y: float, words: str = "") -> None:
    """Draw a bar of `BAR` metres from x, y to the right, and say so."""
    axes.plot([x, x + BAR], [y, y], color=DARK, lw=1.5, solid_capstyle="butt")
    axes.annotate(
        f"{BAR:g} m{words}", (x + BAR, y), (4, 0), textcoords="offset points", va="center", fontsize=8
    )
