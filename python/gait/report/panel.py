"""Instrument panel of the overlay: a dial of the phase, status, cadence and speed."""

from __future__ import annotations

import cv2
import numpy as np

from gait.bindings.abi import TrackStatus
from gait.bindings.estimate import Estimate
from gait.io.video import Image

_SIZE = (236, 92)  # of the panel, pixels at scale 1
_INK = (240, 240, 240)
_DIM = (170, 170, 170)
_STATUS = {
    TrackStatus.INIT: (200, 200, 200),
    TrackStatus.TRACKING: (120, 210, 110),
    TrackStatus.AMBIGUOUS: (60, 200, 250),
    TrackStatus.LOST: (70, 70, 240),
}
_FONT = cv2.FONT_HERSHEY_DUPLEX


def draw_panel(canvas: Image, estimate: Estimate, frame: int, scale: float) -> None:
    """Draw into the top left corner of a BGR picture, in place; `scale` 1 suits 540 lines."""
    width, height = (round(side * scale) for side in _SIZE)
    edge = round(8 * scale)
    region = canvas[edge : edge + height, edge : edge + width]
    region[:] = np.rint(0.35 * region + 0.65 * np.array([32, 28, 26])).astype(np.uint8)
    _dial(region, estimate, (round(46 * scale), round(46 * scale)), 32 * scale, scale)
    colour = _STATUS[estimate.status]
    left = round(96 * scale)
    strides = estimate.mean.stride_hz
    _write(region, estimate.status.name.lower(), (left, round(22 * scale)), 0.52 * scale, colour)
    _write(region, f"{120 * strides:5.1f} steps/min", (left, round(43 * scale)), 0.4 * scale, _INK)
    _write(region, f"{estimate.speed:5.2f} m/s", (left, round(61 * scale)), 0.4 * scale, _INK)
    words = f"frame {frame}   {estimate.utime / 1e6:.2f} s"
    _write(region, words, (left, round(80 * scale)), 0.34 * scale, _DIM)


def _dial(region: Image, estimate: Estimate, at: tuple[int, int], radius: float, scale: float) -> None:
    """Clock face of one stride: right heel strike at the top, the hand with an arc of two deviations."""
    turn, spread = 360 * estimate.mean.phase, min(2 * 360 * estimate.sd.phase, 180.0)
    thin, r = max(1, round(scale)), round(radius)
    cv2.circle(region, at, r, _DIM, thin, cv2.LINE_AA)
    colour = _STATUS[estimate.status]
    start, end = turn - 90 - spread, turn - 90 + spread
    cv2.ellipse(region, at, (r, r), 0, start, end, colour, round(4 * scale), cv2.LINE_AA)
    angle = np.radians(turn)
    tip = (round(at[0] + 0.78 * radius * np.sin(angle)), round(at[1] - 0.78 * radius * np.cos(angle)))
    cv2.line(region, at, tip, _INK, max(1, round(2 * scale)), cv2.LINE_AA)
    cv2.circle(region, at, max(2, round(3 * scale)), _INK, -1, cv2.LINE_AA)
    for letter, way in (("R", -1), ("L", 1)):
        size, _ = cv2.getTextSize(letter, _FONT, 0.34 * scale, 1)
        place = (at[0] - size[0] // 2, round(at[1] + way * 0.6 * radius + size[1] / 2))
        _write(region, letter, place, 0.34 * scale, _DIM)


def _write(region: Image, words: str, at: tuple[int, int], size: float, colour: tuple[int, int, int]) -> None:
    cv2.putText(region, words, at, _FONT, size, colour, max(1, round(1.4 * size)), cv2.LINE_AA)
