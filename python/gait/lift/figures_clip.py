"""Figure of a lifted clip: what was seen, and the motion from another side (Leventon and Freeman, fig. 7)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gait.report.colours import DARK, GREY, ON_PAPER, side_of
from gait.learn.report.figures_base import Drawing
from gait.learn.report.figures_model import STICKS
from gait.lift.equations import Perspective, View
from gait.lift.figures_base import BELOW, SHOWN, bare, scale_bar
from gait.lift.result import Motion
from gait.io.keypoints_file import Tracks

Floats = npt.NDArray[np.float64]


def clip(tracks: Tracks, motion: Motion, view: View, name: str) -> Drawing:
    """Frames of a clip: its points with the estimate over them, and the estimate turned by 90 degrees."""
    frames = np.linspace(0, len(tracks.frame) - 1, min(SHOWN, len(tracks.frame))).round().astype(int)
    figure = Figure(figsize=(9, 4.8), layout="constrained")
    panels = figure.subplots(2, len(frames), squeeze=False)
    _, down, ahead = view.axes
    index = {marker: k for k, marker in enumerate(motion.names)}
    for column, frame in enumerate(frames):
        body = motion.places[frame] - motion.places[frame].mean(axis=0)
        seen, points = _in_picture(view, motion, frame, tracks)
        sides = [seen, np.column_stack([body @ ahead, body @ -down])]
        for axes, flat in zip(panels[:, column], sides, strict=True):
            bare(axes)
            for side, chains in STICKS.items():
                for chain in chains:
                    known = [index[joint] for joint in chain if joint in index]
                    axes.plot(*flat[known].T, color=ON_PAPER[side_of(f"{side}_")], lw=1.6)
        panels[0, column].plot(*points.T, ".", color=DARK, ms=3, zorder=3)
        depth = body @ ahead
        sd = motion.rooted_sd[frame] @ np.abs(ahead)
        panels[1, column].errorbar(
            depth, sides[1][:, 1], xerr=np.minimum(sd, 1.0), fmt="none", ecolor=GREY, lw=0.8
        )
        panels[0, column].set_title(f"frame {tracks.frame[frame]}", fontsize=9)
    _one_scale(panels[1])
    panels[0, 0].set_ylabel("as seen", fontsize=9)
    panels[1, 0].set_ylabel("turned by 90°", fontsize=9)
    error = float(np.nanmedian(motion.error))
    caption = (
        f"{name}: the estimate as the view sees it, {error:.1f} px from the tracks (median), and turned by "
        "90°, with one deviation of the depth about the hips. Dots: the tracks. Left limbs blue, right ones "
        "orange."
    )
    return Drawing("clip", "A clip", caption, figure)


def _one_scale(panels: Sequence[Axes]) -> None:
    """Give panels of one row the same height, and the first a bar under it."""
    lowest = min(axes.dataLim.y0 for axes in panels)
    highest = max(axes.dataLim.y1 for axes in panels)
    under = lowest - BELOW * (highest - lowest)
    scale_bar(panels[0], panels[0].dataLim.x0, under)
    for axes in panels:
        axes.set_ylim(under - 0.05, highest + 0.05)


def _in_picture(view: View, motion: Motion, frame: int, tracks: Tracks) -> tuple[Floats, Floats]:
    """Estimate (J, 2) and points seen (n, 2) of a frame of the tracks, pixels, up is positive.

    Of a view from far away only the shape is known: it is shifted and scaled to the points.
    """
    uv, seen = tracks.uv[frame], tracks.seen[frame]
    body = motion.places[frame]
    if isinstance(view, Perspective):
        flat = view.camera.project(body)
    else:
        flat = body @ view.axes[:2].T
        own = flat[[motion.names.index(name) for name in tracks.names]][seen]
        if len(own) > 1:
            middle, target = own.mean(axis=0), uv[seen].mean(axis=0)
            scale = ((own - middle) * (uv[seen] - target)).sum() / max(((own - middle) ** 2).sum(), 1e-12)
            flat = target + scale * (flat - middle)
    return flat * (1, -1), uv[seen] * (1, -1)
