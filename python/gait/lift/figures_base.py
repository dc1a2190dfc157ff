"""Stick figures of motion for the report of lifting."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gait.draw.colours import GREY
from gait.learn.figures_base import plain
from gait.learn.figures_model import STICKS

Floats = npt.NDArray[np.float64]

SHOWN = 5  # frames of a segment
STEP = 0.75  # statures from one figure of a strip to the next
FAINT = "#c8c8c4"
HALO = 2.5  # points by which what is drawn under something else is wider, so that it shows where both agree
SIDE = np.array([1.0, 0.0, 0.0])  # to the right on the paper: seen from the person's right
AHEAD = np.array([0.0, 1.0, 0.0])  # seen from ahead


def rows(count: int, titles: Sequence[str], height: float = 1.5) -> tuple[Figure, list[Axes]]:
    """Make a figure of `count` strips under each other."""
    figure = Figure(figsize=(8.5, height * count), layout="constrained")
    panels = list(figure.subplots(count, 1, squeeze=False).ravel())
    for axes, title in zip(panels, titles, strict=True):
        plain(axes)
        axes.grid(visible=False)
        axes.set_aspect("equal")
        axes.set(xticks=[], yticks=[])
        axes.spines[["left", "bottom"]].set_visible(False)
        axes.set_ylabel(title, rotation=0, ha="right", va="center", fontsize=9)
    return figure, panels


def strip(
    axes: Axes,
    places: Floats,
    names: Sequence[str],
    across: Floats,
    colour: str,
    ghost: bool = False,
    size: float = 1.0,
    path: Floats | None = None,
) -> None:
    """Draw some frames of places (F, J, 3) side by side; the right side of the body is bolder.

    Parameters
    ----------
    across : (3,)
        What is to the right on the paper; up is z.
    ghost : bool
        Faint and wide, under something else.
    size : float
        Stature, which the distance between figures follows.
    path : (F, J, 3), optional
        Motion whose middle every figure stands at; its own if left out.
    """
    frames = np.linspace(0, len(places) - 1, min(SHOWN, len(places))).round().astype(int)
    index = {name: k for k, name in enumerate(names)}
    middle = (places if path is None else path).mean(axis=1)
    for place, frame in enumerate(frames):
        body = places[frame]
        flat = np.column_stack([(body - middle[frame]) @ across + place * STEP * size, body[:, 2]])
        for side, chains in STICKS.items():
            for chain in chains:
                known = [index[name] for name in chain if name in index]
                width = 0.9 if side == "l" else 1.8
                axes.plot(
                    *flat[known].T,
                    color=FAINT if ghost else colour,
                    lw=width + HALO * ghost,
                    solid_capstyle="round",
                )
    axes.axhline(0, color=GREY, lw=0.5, zorder=0)
    axes.set_xlim(-0.6 * STEP * size, (SHOWN - 0.4) * STEP * size)
