"""Pictures of a model: one pose in a plain room, and a sheet of what each principal component does."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.camera import Camera
from gait.model import Model
from gait.overlay import Overlay
from gait.state import State
from gait.video import Image

Array = NDArray[np.float64]

_PAPER = (246, 247, 248)
_RULE = (214, 216, 218)
_TEXT = (70, 70, 70)
_LESS, _MEAN, _MORE = (190, 110, 40), (205, 205, 205), (40, 90, 230)
_CELL = (176, 300)  # of the sheet, pixels
_PHASES = 8
_MARGIN = (120, 44)  # left and top of the sheet, pixels
_FONT = cv2.FONT_HERSHEY_DUPLEX


def room_camera(state: State) -> Camera:
    """Camera that shows a walker from in front and the left, slightly from above."""
    target = np.array([*state.pelvis[:2], 0.5 * state.stature])
    angle = state.heading + np.radians(50)
    away = np.array([np.cos(angle), np.sin(angle), 0.22]) * 3 * state.stature
    return Camera.looking(target + away, target, (720, 900), 2280.0)


def draw_room(model: Model, state: State, camera: Camera) -> Image:
    """Draw a walker on a ground of half-metre squares, (h, w, 3) BGR."""
    canvas = np.full((camera.height, camera.width, 3), _PAPER, np.uint8)
    middle = np.round(2 * np.asarray(state.pelvis[:2])) / 2
    reach = np.arange(-3, 3.5, 0.5)
    for step in reach:
        for ends in ([(step, -3), (step, 3)], [(-3, step), (3, step)]):
            along = np.linspace(ends[0], ends[1], 61) + middle  # short pieces: the lens may bend them
            uv = camera.project(np.column_stack([along, np.zeros(61)]))
            pieces = uv[np.isfinite(uv).all(axis=1)]
            line = np.clip(np.rint(16 * pieces), -(1 << 28), 1 << 28).astype(np.int32)
            cv2.polylines(canvas, [line], False, _RULE, 1, cv2.LINE_AA, 4)
    return Overlay(model, camera).figure(canvas, state)


def draw_strip(model: Model) -> Image:
    """Draw the sheet: rows are the mean and each component at -2, 0 and +2 deviations, columns phases."""
    names = ["mean", *(f"component {k + 1}" for k in range(model.info.components))]
    left, top = _MARGIN
    width, height = _CELL
    sheet = np.full((top + height * len(names), left + width * _PHASES, 3), _PAPER, np.uint8)
    camera = Camera.looking((0.0, -20.0, 0.9), (0.0, 0.0, 0.9), _CELL, 20 * 0.84 * height / 2.0)
    overlay = Overlay(model, camera)
    for row, name in enumerate(names):
        y = top + row * height
        cv2.putText(sheet, name, (10, y + height // 2), _FONT, 0.45, _TEXT, 1, cv2.LINE_AA)
        for column in range(_PHASES):
            state = _standing(model, column / _PHASES, np.zeros(model.info.components))
            x = left + column * width
            sheet[y : y + height, x : x + width] = _cell(overlay, state, row - 1)
    for column in range(_PHASES):
        place = (left + column * width + width // 2 - 34, 24)
        cv2.putText(sheet, f"phase {column / _PHASES:.3g}", place, _FONT, 0.42, _TEXT, 1, cv2.LINE_AA)
    _legend(sheet)
    return sheet


def _standing(model: Model, phase: float, coef: Array) -> State:
    """Walker over the origin, heading along x, of average size."""
    state = State(phase=phase, coef=coef)
    state.pelvis[2] = model.pelvis_height(state)
    return state


def _cell(overlay: Overlay, state: State, component: int) -> Image:
    """Body of the mean for component -1, else sticks at -2, 0 and +2 deviations of that component."""
    camera, model = overlay.camera, overlay.model
    cell = np.full((camera.height, camera.width, 3), _PAPER, np.uint8)
    ground = round(float(camera.project([0.0, 0.0, 0.0])[1]))
    cv2.line(cell, (0, ground), (camera.width, ground), _RULE, 1, cv2.LINE_AA)
    if component < 0:
        return overlay.figure(cell, state)
    for score, colour in ((0.0, _MEAN), (-2.0, _LESS), (2.0, _MORE)):
        coef = state.coef.copy()
        coef[component] = score
        moved = _standing(model, state.phase, coef)
        overlay.sticks(cell, model.pose(moved)[0], 3 if score else 6, colour)
    return cell


def _legend(sheet: Image) -> None:
    for line, (words, colour) in enumerate((("-2 sd", _LESS), ("mean", _TEXT), ("+2 sd", _MORE))):
        cv2.putText(sheet, words, (10, 16 + 13 * line), _FONT, 0.38, colour, 1, cv2.LINE_AA)
