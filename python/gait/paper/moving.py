"""Moving stick figures as SVG that needs no script."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import JOINTS
from gait.report.figures import STICK_CHAINS

Floats = npt.NDArray[np.float64]

FIGURE_WIDTH_PX, FIGURE_HEIGHT_PX = 130, 220  # pixels of a figure
SCALE = 175  # pixels per stature
FLOOR_PX = 200  # pixels from the top
ROW, GAP_PX = 6, 6  # figures side by side, pixels between them


@dataclass(frozen=True)
class Moving:
    """One body over a cycle: flat joints (n, P, 2), statures, up is positive, and its colour."""

    flat: Floats
    colour: str


def strip(cells: Sequence[tuple[str, Sequence[Moving]]], seconds: float) -> str:
    """Return cells side by side, each with a title and the bodies that move in it, a cycle in `seconds`."""
    inside = "".join(_cell(title, bodies, seconds) for title, bodies in cells)
    across = ROW * (FIGURE_WIDTH_PX + GAP_PX)
    return (
        f'<div style="display: flex; flex-wrap: wrap; gap: {GAP_PX}px; max-width: {across}px">{inside}</div>'
    )


def _cell(title: str, bodies: Sequence[Moving], seconds: float) -> str:
    lines = "".join(_body(body, seconds) for body in bodies)
    return (
        f'<svg style="width: {FIGURE_WIDTH_PX}px" '
        f'viewBox="0 0 {FIGURE_WIDTH_PX} {FIGURE_HEIGHT_PX}" fill="none" '
        f'stroke-linecap="round" stroke-linejoin="round"><line x1="0" y1="{FLOOR_PX}" '
        f'x2="{FIGURE_WIDTH_PX}" y2="{FLOOR_PX}" '
        f'stroke="#ccc"/>{lines}<text x="4" y="{FIGURE_HEIGHT_PX - 5}" font-size="11" fill="#444">'
        f"{escape(title)}</text></svg>"
    )


def _body(body: Moving, seconds: float) -> str:
    at = np.rint(body.flat * (SCALE, -SCALE) + (FIGURE_WIDTH_PX / 2, FLOOR_PX)).astype(int)
    at = np.concatenate([at, at[:1]])
    parts = []
    for side, chains in STICK_CHAINS.items():
        for chain in chains:
            index = [JOINTS.index(name) for name in chain]
            places = [" ".join(f"{x},{y}" for x, y in frame[index]) for frame in at]
            width = 1 if side == "l" else 2
            parts.append(
                f'<polyline points="{places[0]}" stroke="{body.colour}" stroke-width="{width}">'
                f'<animate attributeName="points" dur="{seconds:.2f}s" repeatCount="indefinite" '
                f'values="{";".join(places)}"/></polyline>'
            )
    return "".join(parts)
