"""Pictures of a model: one pose in a plain room, and a sheet of what each principal component does."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.bindings.model import Model
from gait.bindings.state import State
from gait.camera.camera import Camera
from gait.io.video import Image
from gait.report.overlay import Overlay

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
    """Draw the sheet, columns phases.

    Rows are the mean, then at -2, 0 and +2 deviations the stride rate (where the mean follows it) and scores.
    """
    rows = _rows(model)
    left, top = _MARGIN
    width, height = _CELL
    sheet = np.full((top + height * len(rows), left + width * _PHASES, 3), _PAPER, np.uint8)
    camera = Camera.looking((0.0, -20.0, 0.9), (0.0, 0.0, 0.9), _CELL, 20 * 0.84 * height / 2.0)
    overlay = Overlay(model, camera)
    for row, (name, states) in enumerate(rows.items()):
        y = top + row * height
        cv2.putText(sheet, name, (10, y + height // 2), _FONT, 0.45, _TEXT, 1, cv2.LINE_AA)
        for column in range(_PHASES):
            there = [_standing(model, state, column / _PHASES) for state in states]
            x = left + column * width
            sheet[y : y + height, x : x + width] = _cell(overlay, there)
    for column in range(_PHASES):
        place = (left + column * width + width // 2 - 34, 24)
        cv2.putText(sheet, f"phase {column / _PHASES:.3g}", place, _FONT, 0.42, _TEXT, 1, cv2.LINE_AA)
    _legend(sheet)
    return sheet


def _rows(model: Model) -> dict[str, list[State]]:
    """Name of each row: walkers at 0, -2 and +2 deviations, for the mean at 0 alone."""
    info, turns = model.info, (0.0, -2.0, 2.0)
    mean = State(stride_hz=info.stride_hz, coef=np.zeros(info.components))
    rows = {"mean": [mean]}
    rates = [replace(mean, stride_hz=info.stride_hz + turn * info.stride_hz_sd) for turn in turns]
    if not np.array_equal(model.pose(rates[1])[1], model.pose(mean)[1]):
        rows["stride rate"] = rates
    for k, component in enumerate(np.eye(info.components)):
        rows[f"component {k + 1}"] = [replace(mean, coef=turn * component) for turn in turns]
    return rows


def _standing(model: Model, state: State, phase: float) -> State:
    """Walker of average size at a phase over the origin, heading along x."""
    state = replace(state, phase=phase, pelvis=np.zeros(3))
    state.pelvis[2] = model.pelvis_height(state)
    return state


def _cell(overlay: Overlay, states: list[State]) -> Image:
    """Body of a single walker, else sticks of three."""
    camera, model = overlay.camera, overlay.model
    cell = np.full((camera.height, camera.width, 3), _PAPER, np.uint8)
    ground = round(float(camera.project([0.0, 0.0, 0.0])[1]))
    cv2.line(cell, (0, ground), (camera.width, ground), _RULE, 1, cv2.LINE_AA)
    if len(states) == 1:
        return overlay.figure(cell, states[0])
    for state, colour, width in zip(states, (_MEAN, _LESS, _MORE), (6, 3, 3), strict=True):
        overlay.sticks(cell, model.pose(state)[0], width, colour)
    return cell


def _legend(sheet: Image) -> None:
    for line, (words, colour) in enumerate((("-2 sd", _LESS), ("mean", _TEXT), ("+2 sd", _MORE))):
        cv2.putText(sheet, words, (10, 16 + 13 * line), _FONT, 0.38, colour, 1, cv2.LINE_AA)
