"""Colours of drawings: left sides of bodies are blue, right sides orange, on paper and over pictures."""

from __future__ import annotations

BLUE, ORANGE, GREY, DARK = "#2a6f97", "#d9722e", "#9a9a9a", "#222222"

STATUS_TINTS = {"init": "#c8c8c8", "ambiguous": "#f4d06f", "lost": "#e07a7a"}
"""Background of frames whose status is not tracking."""

ON_PAPER = {"left": BLUE, "right": ORANGE, "middle": DARK}
OVER_PICTURES = {"left": (235, 165, 60), "right": (50, 125, 250), "middle": (190, 215, 120)}
"""BGR; brighter, to be visible on dark clothes, and pale green for the middle."""

PERSON_COLOURS = (
    (110, 200, 90), (200, 110, 220), (60, 210, 240), (210, 210, 110),
    (150, 150, 250), (190, 190, 190), (235, 165, 60), (50, 125, 250),
)  # fmt: skip
"""BGR colours of several people in one picture, last those of sides."""
