"""Stick figures for the report of lifting: rows of motion, and a lifted clip from two sides.

The latter shows the keypoints, and the motion from another direction (Leventon and Freeman, fig. 7).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gait.body.skeleton import side_of
from gait.io.keypoints_file import Keypoints
from gait.lift.segment.view import Perspective, View
from gait.lift.smooth.motion import Motion
from gait.report.colours import DARK, GREY, ON_PAPER
from gait.report.figures import STICK_CHAINS, Drawing, plain

Floats = npt.NDArray[np.float64]

SHOWN_FRAMES = 5  # frames of a segment that are drawn
LEAST_FIGURE_SPACING = 0.75  # statures; least distance between figures of a row
LEAST_FIGURE_GAP = 0.1  # statures; least gap between figures
WIDTH_INCHES, LABEL = 8.5, 1.2  # inches; width of the whole, and of the labels left of the rows
ABOVE = 0.5  # inches; height of legend and times
FAINT = "#c8c8c4"
HALO = 2.5  # points by which lines underneath are wider, so that they show where both agree
BAR = 0.5  # metres; length of the scale bar
BELOW = 0.1  # statures; distance of the bar below the last row
SIDE = np.array([1.0, 0.0, 0.0])  # to the right on the paper: seen from the person's right
VIEWED_FROM_AHEAD = np.array([0.0, 1.0, 0.0])  # seen from ahead


@dataclass(frozen=True)
class _Drawn:
    """Figures of a row: 2-D positions (n, J, 2) relative to their columns, up positive, metres."""

    row: int
    flat: Floats
    colour: str
    ghost: bool


class Strips:
    """Rows of some frames of motion; the right side of the body is bolder.

    Parameters
    ----------
    titles : sequence of str
        One title per row.
    names : sequence of str
        The J markers of all motions.
    size : float
        Stature, metres.
    fps : float
        Frames per second of all motions.
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
        """Add a motion (F, J, 3) to a row.

        Parameters
        ----------
        across : (3,)
            Direction that points right on the paper; z points up.
        ghost : bool
            Draw it faint and wide, under other figures.
        path : (F, J, 3), optional
            Motion at whose middle each figure is placed; by default its own.
        """
        self._frames = np.linspace(0, len(places) - 1, min(SHOWN_FRAMES, len(places))).round().astype(int)
        middle = (places if path is None else path)[self._frames].mean(axis=1, keepdims=True)
        body = places[self._frames]
        flat = np.stack([(body - middle) @ across, body[..., 2]], axis=2)
        self._drawn.append(_Drawn(row, flat, colour, ghost))

    def figure(self) -> Figure:
        """Draw all rows, as large as possible while figures do not overlap."""
        pitch, (left, right), (low, high) = self._extents()
        gap = LEAST_FIGURE_GAP * self._size
        heights = np.full(len(self._titles), high - low + gap)
        heights[-1] += 2 * BELOW * self._size
        scale = (WIDTH_INCHES - LABEL) / (right - left)
        tall = scale * heights.sum() + ABOVE
        figure = Figure(figsize=(WIDTH_INCHES, tall))
        bottoms = scale * (heights.sum() - np.cumsum(heights))
        panels = []
        for title, height, bottom in zip(self._titles, heights, bottoms, strict=True):
            box = (LABEL / WIDTH_INCHES, bottom / tall, 1 - LABEL / WIDTH_INCHES, scale * height / tall)
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
        """Width of a column, and horizontal and vertical extent of all rows, metres."""
        lows = np.full((len(self._titles), len(self._frames), 2), np.inf)
        highs = -lows
        for each in self._drawn:
            lows[each.row] = np.minimum(lows[each.row], each.flat.min(axis=1))
            highs[each.row] = np.maximum(highs[each.row], each.flat.max(axis=1))
        apart = highs[:, :-1, 0] - lows[:, 1:, 0] + LEAST_FIGURE_GAP * self._size
        pitch = float(max(LEAST_FIGURE_SPACING * self._size, apart.max(initial=0.0)))
        at = np.arange(len(self._frames)) * pitch
        across = float((lows[..., 0] + at).min()), float((highs[..., 0] + at).max())
        edge = LEAST_FIGURE_GAP / 2 * self._size
        up = float(min(lows[..., 1].min(), 0.0)), float(highs[..., 1].max())
        return pitch, (across[0] - edge, across[1] + edge), up

    def _draw(self, axes: Axes, each: _Drawn, pitch: float) -> None:
        for column, body in enumerate(each.flat):
            for side, chains in STICK_CHAINS.items():
                for chain in chains:
                    known = [self._index[name] for name in chain if name in self._index]
                    axes.plot(
                        *(body[known] + (column * pitch, 0)).T,
                        color=FAINT if each.ghost else each.colour,
                        lw=(0.9 if side == "l" else 1.8) + HALO * each.ghost,
                        solid_capstyle="round",
                    )


def _row(figure: Figure, box: tuple[float, float, float, float], title: str) -> Axes:
    """Make the axes of a row, with its title on the left and a line for the floor."""
    axes = figure.add_axes(box)
    hide_axes(axes)
    axes.set_ylabel(title, rotation=0, ha="right", va="center", fontsize=9)
    axes.axhline(0, color=GREY, lw=0.5, zorder=0)
    return axes


def hide_axes(axes: Axes) -> None:
    """Style axes for figures: equal scales, without ticks."""
    plain(axes)
    axes.grid(visible=False)
    axes.set_aspect("equal")
    axes.set(xticks=[], yticks=[])
    axes.spines[["left", "bottom"]].set_visible(False)


def scale_bar(axes: Axes, x: float, y: float, words: str = "") -> None:
    """Draw a bar of `BAR` metres from x, y to the right, with a label."""
    axes.plot([x, x + BAR], [y, y], color=DARK, lw=1.5, solid_capstyle="butt")
    axes.annotate(
        f"{BAR:g} m{words}", (x + BAR, y), (4, 0), textcoords="offset points", va="center", fontsize=8
    )


def clip(keypoints: Keypoints, motion: Motion, view: View, name: str) -> Drawing:
    """Draw frames of a clip: its points with the estimate, and the estimate rotated by 90 degrees."""
    frames = (
        np.linspace(0, len(keypoints.frame) - 1, min(SHOWN_FRAMES, len(keypoints.frame))).round().astype(int)
    )
    figure = Figure(figsize=(9, 4.8), layout="constrained")
    panels = figure.subplots(2, len(frames), squeeze=False)
    _, down, ahead = view.axes
    index = {marker: k for k, marker in enumerate(motion.names)}
    for column, frame in enumerate(frames):
        body = motion.places[frame] - motion.places[frame].mean(axis=0)
        observed, points = _in_picture(view, motion, frame, keypoints)
        sides = [observed, np.column_stack([body @ ahead, body @ -down])]
        for axes, flat in zip(panels[:, column], sides, strict=True):
            hide_axes(axes)
            for side, chains in STICK_CHAINS.items():
                for chain in chains:
                    known = [index[joint] for joint in chain if joint in index]
                    axes.plot(*flat[known].T, color=ON_PAPER[side_of(f"{side}_")], lw=1.6)
        panels[0, column].plot(*points.T, ".", color=DARK, ms=3, zorder=3)
        depth = body @ ahead
        sd = motion.rooted_sd[frame] @ np.abs(ahead)
        panels[1, column].errorbar(
            depth, sides[1][:, 1], xerr=np.minimum(sd, 1.0), fmt="none", ecolor=GREY, lw=0.8
        )
        panels[0, column].set_title(f"frame {keypoints.frame[frame]}", fontsize=9)
    _one_scale(panels[1])
    panels[0, 0].set_ylabel("as seen", fontsize=9)
    panels[1, 0].set_ylabel("turned by 90°", fontsize=9)
    error = float(np.nanmedian(motion.error))
    caption = (
        f"{name}: the estimate as the view sees it, {error:.1f} px from the keypoints (median), and "
        "turned by 90°, with one standard deviation of the depth about the hips. Dots: the keypoints. Left "
        "limbs blue, right ones orange."
    )
    return Drawing("clip", "A clip", caption, figure)


def _one_scale(panels: Sequence[Axes]) -> None:
    """Make the panels of a row equally high, and put a scale bar below the first."""
    lowest = min(axes.dataLim.y0 for axes in panels)
    highest = max(axes.dataLim.y1 for axes in panels)
    under = lowest - BELOW * (highest - lowest)
    scale_bar(panels[0], panels[0].dataLim.x0, under)
    for axes in panels:
        axes.set_ylim(under - 0.05, highest + 0.05)


def _in_picture(view: View, motion: Motion, frame: int, keypoints: Keypoints) -> tuple[Floats, Floats]:
    """Project the estimate (J, 2) of a frame, and return its visible points (n, 2), pixels, up positive.

    In an orthographic view only the shape is known, so it is shifted and scaled to the points.
    """
    uv, observed = keypoints.uv[frame], keypoints.visible[frame]
    body = motion.places[frame]
    if isinstance(view, Perspective):
        flat = view.camera.project(body)
    else:
        flat = body @ view.axes[:2].T
        own = flat[[motion.names.index(name) for name in keypoints.names]][observed]
        if len(own) > 1:
            middle, target = own.mean(axis=0), uv[observed].mean(axis=0)
            scale = ((own - middle) * (uv[observed] - target)).sum() / max(((own - middle) ** 2).sum(), 1e-12)
            flat = target + scale * (flat - middle)
    return flat * (1, -1), uv[observed] * (1, -1)
