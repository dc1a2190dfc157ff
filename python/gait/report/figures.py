"""Figures of reports: common parts of learning and lifting."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

_DPI = 110
_ARM, _LEG = ("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle", "toe")
#: Chains of joints of a stick figure: centre, left, right.
STICK_CHAINS = {
    "c": [["head_top", "neck", "pelvis"], ["l_shoulder", "neck", "r_shoulder"], ["l_hip", "pelvis", "r_hip"]],
    **{
        s: [[f"{s}_{j}" for j in _ARM], [f"{s}_{j}" for j in _LEG], [f"{s}_ankle", f"{s}_heel", f"{s}_toe"]]
        for s in "lr"
    },
}


@dataclass
class Drawing:
    """A figure of a report."""

    stem: str  #: name of its PNG file, without suffix
    heading: str
    caption: str
    figure: Figure

    def png(self) -> bytes:
        """Return the picture as a PNG file."""
        buffer = io.BytesIO()
        self.figure.savefig(buffer, format="png", dpi=_DPI, metadata={"Software": None})
        return buffer.getvalue()

    def write(self, folder: Path) -> str:
        """Write the PNG file; return the picture as a data URL."""
        data = self.png()
        (folder / f"{self.stem}.png").write_bytes(data)
        return address(data)


def address(png: bytes) -> str:
    """Return a PNG file as a data URL."""
    return "data:image/png;base64," + base64.b64encode(png).decode()


def grid(
    rows: int,
    columns: int,
    width: float,
    height: float,
    sharex: bool = False,
    sharey: Literal["none", "row", "all"] = "none",
) -> tuple[Figure, list[Axes]]:
    """Return a figure of `width` x `height` inches and its axes, row by row."""
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = list(figure.subplots(rows, columns, sharex=sharex, sharey=sharey, squeeze=False).ravel())
    for each in axes:
        plain(each)
    return figure, axes


def plain(axes: Axes) -> None:
    """Style axes with a faint grid and no box."""
    axes.grid(alpha=0.25, lw=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)


def line_legend(
    figure: Figure, entries: dict[str, str], centred: bool = False, title: str | None = None
) -> None:
    """Add a legend above the figure; `entries`: words, to colours of lines."""
    figure.legend(
        [Line2D([], [], color=colour, lw=2) for colour in entries.values()], list(entries),
        loc="outside upper center" if centred else "outside upper right", ncols=len(entries),
        fontsize=8, frameon=False, title=title, title_fontsize=8,
    )  # fmt: skip
