"""Draw bodies: an estimate over its frame with a panel of numbers, or a model as a sheet of poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.bindings.abi import TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.model import Model
from gait.bindings.state import State
from gait.body.skeleton import BONES, side_of
from gait.camera.camera import Camera
from gait.io.video import Image
from gait.report.colours import OVER_PICTURES
from gait.report.terms import STATUS_TERMS

_PANEL_SIZE = (236, 92)  # size of the panel, pixels at scale 1
_ROW = 18  # height of its further line for the class of motion
_INK = (240, 240, 240)
_DIM = (170, 170, 170)
_STATUS = {
    TrackStatus.INIT: (200, 200, 200),
    TrackStatus.TRACKING: (120, 210, 110),
    TrackStatus.AMBIGUOUS: (60, 200, 250),
    TrackStatus.LOST: (70, 70, 240),
}
_LEGEND = (  # short enough to fit beside the panel in a picture of 320 columns; side of each part of a line
    (("Dial: phase, top: right heel strike", None),),
    (("Arc: its 95 % interval", None),),
    (("Ellipses: 90 % regions", None),),
    (("Left side", "left"), ("Right side", "right")),
)
LEGEND_SECONDS = 3.0
"""Seconds for which a film explains dial, ellipses and colours."""
_FONT = cv2.FONT_HERSHEY_DUPLEX


def draw_panel(canvas: Image, estimate: Estimate, frame: int, scale: float) -> None:
    """Draw the panel into the top left corner of a BGR picture, in place; `scale` 1 suits 540 lines."""
    lost = estimate.status == TrackStatus.LOST
    words = ("figure: last guess", "") if lost else _figures(estimate)
    region = _panel(canvas, scale, len(words) - 2)
    _dial(region, estimate, (round(46 * scale), round(46 * scale)), 32 * scale, scale)
    time = f"frame {frame}   {estimate.utime / 1e6:.2f} s"
    status, _ = STATUS_TERMS[estimate.status.name.lower()]
    _lines(region, (status, *words, time), _STATUS[estimate.status], scale)


def _figures(estimate: Estimate) -> tuple[str, ...]:
    steps = f"{120 * estimate.mean.stride_hz:5.1f} steps/min" if estimate.takes_strides else "no strides"
    speed = "" if np.isnan(estimate.speed) else f"{estimate.speed:5.2f} m/s"
    of_class = class_words(estimate)
    return (steps, speed, *([of_class] if of_class else []))


def class_words(estimate: Estimate) -> str:
    """Return the most probable class of motion with its probability; '' if the model has only one."""
    several = len(estimate.class_probability) > 1
    return f"{estimate.motion_class} {100 * estimate.class_probability.max():.0f} %" if several else ""


def _panel(canvas: Image, scale: float, further: int = 0) -> Image:
    """Darken the top left corner, with space for further lines; return that part of the picture."""
    width, height = (round(side * scale) for side in (_PANEL_SIZE[0], _PANEL_SIZE[1] + further * _ROW))
    edge = round(8 * scale)
    return _darkened(canvas[edge : edge + height, edge : edge + width])


def _darkened(region: Image) -> Image:
    """Darken a part of a picture, so that words in it are readable on any background."""
    region[:] = np.rint(0.2 * region + 0.8 * np.array([32, 28, 26])).astype(np.uint8)
    return region


def _lines(region: Image, words: tuple[str, ...], colour: tuple[int, int, int], scale: float) -> None:
    """Write the panel's lines, the first in colour, the last dim."""
    left, count = round(96 * scale), len(words) - 2
    rows = [(22.0, 0.52, colour), *((43.0 + _ROW * k, 0.4, _INK) for k in range(count))]
    rows += [(44.0 + _ROW * count, 0.36, _DIM)]
    for line, (row, size, ink) in zip(words, rows, strict=True):
        _write(region, line, (left, round(row * scale)), size * scale, ink)


def _draw_legend(canvas: Image, scale: float) -> None:
    """Explain dial, ellipses and colours in the top right corner, or below the panel if it reaches there."""
    size, edge, row = 0.4 * scale, round(8 * scale), 19 * scale

    def width_of(words: str) -> int:
        return int(cv2.getTextSize(words, _FONT, size, 1)[0][0])

    width = max(width_of("  ".join(words for words, _ in line)) for line in _LEGEND) + 2 * edge
    height = round(row * len(_LEGEND) + 8 * scale)
    left, top = canvas.shape[1] - edge - width, edge
    if left < round(_PANEL_SIZE[0] * scale) + 2 * edge:
        left, top = edge, round(_PANEL_SIZE[1] * scale) + 2 * edge
    region = _darkened(canvas[top : top + height, left : left + width])
    for k, line in enumerate(_LEGEND):
        at = edge
        for words, side in line:
            colour = OVER_PICTURES[side] if side else _INK
            _write(region, words, (at, round(row * (k + 0.8))), size, colour)
            at += width_of(f"{words}  ")


def _dial(region: Image, estimate: Estimate, at: tuple[int, int], radius: float, scale: float) -> None:
    """Draw the stride as a clock face: right heel strike at the top, a hand, and two standard deviations.

    While the person takes no strides there is no hand.
    """
    thin, r = max(1, round(scale)), round(radius)
    cv2.circle(region, at, r, _DIM, thin, cv2.LINE_AA)
    if not estimate.takes_strides:
        return
    turn, spread = 360 * estimate.mean.phase, min(2 * 360 * estimate.sd.phase, 180.0)
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


Array = NDArray[np.float64]
Colour = tuple[int, int, int]

ENDS = ("l_wrist", "r_wrist", "l_ankle", "r_ankle")
_DARK: Colour = (30, 30, 30)
_FILL = 0.28  # opacity of the body
_FADED = 0.45  # opacity of the figure of a lost person
_ELLIPSE = 2.146  # standard deviations of the 90 % ellipse of a normal distribution in the plane
_SUBPIXEL = 4  # fractional bits of OpenCV's drawing coordinates


def side_colour(name: str) -> Colour:
    """Return the colour of a joint or limb, which depends on its side."""
    return OVER_PICTURES[side_of(name)]


class Overlay:
    """Draws into the frames of one camera, whose lens distortion is applied to the drawing."""

    def __init__(self, model: Model, camera: Camera) -> None:
        self.model, self.camera = model, camera
        self._scale = max(0.6, min(camera.width, camera.height) / 540)
        self._lens = _lens_map(camera) if camera.distortion.any() else None

    def draw(self, image: Image, estimate: Estimate, frame: int, *, legend: bool = False) -> Image:
        """Return a BGR picture: frame, body of the dominant hypothesis, mean joints, 90 % ellipses, panel.

        If the person is lost, the figure is faded and has no body.  `legend`: explain the drawing.
        """
        canvas = self._person(_in_colour(image), estimate)
        draw_panel(canvas, estimate, frame, self._scale)
        if legend:
            _draw_legend(canvas, self._scale)
        return canvas

    def draw_people(
        self, image: Image, people: Mapping[str, Estimate], colours: Mapping[str, Colour] | None = None
    ) -> Image:
        """Return a BGR picture: frame, and several people with their names above their heads, without panel.

        `people`: by name; an empty name is not drawn.  `colours`: of each person, instead of colours of
        sides.
        """
        canvas = _in_colour(image).copy()
        for name, estimate in people.items():
            canvas = self._person(canvas, estimate, None if colours is None else colours[name])
        for name, estimate in people.items():
            if not name:
                continue
            at = self.camera.project(estimate.joint("head_top"))
            if np.isfinite(at).all():
                size = 0.8 * self._scale
                (width, height), _ = cv2.getTextSize(name, _FONT, size, 1)
                left, foot = round(at[0] - width / 2), max(round(at[1] - 0.6 * height), height + 4)
                top = max(0, foot - height - 4)
                _darkened(canvas[top : max(0, foot + 4), max(0, left - 4) : max(0, left + width + 4)])
                _write(canvas, name, (left, foot), size, _STATUS[estimate.status])
        return canvas

    def _person(self, picture: Image, estimate: Estimate, colour: Colour | None = None) -> Image:
        if estimate.status == TrackStatus.LOST:
            canvas = picture.copy()
            self.skeleton(canvas, estimate.joints, colour)
            return np.asarray(cv2.addWeighted(canvas, _FADED, picture, 1 - _FADED, 0), np.uint8)
        posed = np.isfinite(estimate.mean.phase)
        canvas = self.body(picture, estimate.mean, colour) if posed else picture.copy()
        self.skeleton(canvas, estimate.joints, colour)
        self._ellipses(canvas, estimate)
        return canvas

    def draw_absent(self, image: Image, time: float, frame: int, *, legend: bool = False) -> Image:
        """Return a BGR picture of a frame, with the note that it has no estimate; `time` in seconds."""
        canvas = _in_colour(image).copy()
        words = ("no estimate", "person not found", "in this frame", f"frame {frame}   {time:.2f} s")
        _lines(_panel(canvas, self._scale), words, _DIM, self._scale)
        if legend:
            _draw_legend(canvas, self._scale)
        return canvas

    def figure(self, canvas: Image, state: State) -> Image:
        """Return `canvas` with body and skeleton of a state."""
        canvas = self.body(canvas, state)
        self.skeleton(canvas, self.model.pose(state)[0])
        return canvas

    def body(self, canvas: Image, state: State, colour: Colour | None = None) -> Image:
        """Tint the limbs and outline their visible parts, in one colour or the colours of their sides."""
        ids = self.model.render(self.camera, state)
        if self._lens is not None:
            ids = np.asarray(cv2.remap(ids, *self._lens, cv2.INTER_NEAREST), np.uint8)
        width = max(1, round(1.5 * self._size(state.pelvis)))
        return tinted(canvas, ids, self.model.limb_names, width, colour)

    def skeleton(self, canvas: Image, joints: Array, colour: Colour | None = None) -> None:
        """Draw bones and joints (P, 3) in place, except behind the camera."""
        size = self._size(joints[self.model.joint_names.index("pelvis")])
        thick = max(1, round(2 * size))
        self.sticks(
            canvas, joints, thick + max(1, round(size)), _DARK
        )  # with a dark seam, lines are visible on any clothes
        self.sticks(canvas, joints, thick, None if colour is None else _brighter(colour))
        for name, at in zip(self.model.joint_names, self.camera.project(joints), strict=True):
            if np.isfinite(at).all():
                _dot(canvas, at, 3.6 * size, _DARK)
                _dot(canvas, at, 2.4 * size, _brighter(colour or side_colour(name)))

    def sticks(self, canvas: Image, joints: Array, thick: int, colour: Colour | None = None) -> None:
        """Draw bones as lines of `thick` pixels in place, in one colour or the colours of their sides."""
        uv = dict(zip(self.model.joint_names, self.camera.project(joints), strict=True))
        draw_bones(canvas, uv, thick, colour)

    def _ellipses(self, canvas: Image, estimate: Estimate) -> None:
        """Draw the 90 % ellipse of wrists and ankles from the standard deviations along the axes."""
        for name in ENDS:
            index = estimate.joint_names.index(name)
            steps = np.diag(estimate.joint_sd[index])
            around = self.camera.project(estimate.joints[index] + np.stack([steps, -steps]))
            middle = self.camera.project(estimate.joints[index])
            slope = 0.5 * (around[0] - around[1])
            if not np.isfinite(slope).all():
                continue
            values, axes = np.linalg.eigh(slope.T @ slope)
            radii = _ELLIPSE * np.sqrt(np.maximum(values[::-1], 0))
            angle = np.degrees(np.arctan2(axes[1, 1], axes[0, 1]))
            thick = max(1, round(1.2 * self._size(estimate.joints[index])))
            _ellipse(canvas, middle, radii, float(angle), side_colour(name), thick)

    def _size(self, place: Array) -> float:
        """Return the scale of lines for a person at `place`: 1 where 1.7 m are 400 pixels."""
        depth = max(float(self.camera.depth(place)), 0.1)
        return float(np.clip(1.7 * self.camera.fy / depth / 400, 0.3, 4.0))


def _in_colour(image: Image) -> Image:
    """Convert a picture to BGR; may return the same array."""
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), np.uint8) if image.ndim == 2 else image


def tinted(
    canvas: Image, ids: NDArray[np.uint8], limbs: Sequence[str], width: int, colour: Colour | None = None
) -> Image:
    """Return `canvas` (h, w, 3) with limbs tinted and outlined; `ids` (h, w): limb index + 1, or 0.

    `colour`: of all limbs, instead of the colours of their sides.
    """
    rows, columns = (np.flatnonzero(ids.any(axis=axis)) for axis in (1, 0))
    out = canvas.copy()
    if not len(rows):
        return out
    y, x = max(rows[0] - width, 0), max(columns[0] - width, 0)  # corner of the part that is drawn into
    part, ids = (one[y : rows[-1] + width + 1, x : columns[-1] + width + 1] for one in (out, ids))
    colours = [colour or side_colour(name) for name in limbs]
    table = np.array([(0, 0, 0), *colours], np.float32)
    inside = ids > 0
    part[inside] = np.rint((1 - _FILL) * part[inside] + _FILL * table[ids[inside]]).astype(np.uint8)
    lines = np.ascontiguousarray(part)
    for limb, ink in enumerate(colours, 1):
        contours, _ = cv2.findContours((ids == limb).view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(lines, contours, -1, ink, width, cv2.LINE_AA)
    part[:] = lines
    return out


def draw_bones(canvas: Image, uv: Mapping[str, Array], thick: int, colour: Colour | None = None) -> None:
    """Draw bones between joints at pixels `uv` in place, in one colour or the colours of their sides."""
    for a, b in BONES:
        if np.isfinite([uv[a], uv[b]]).all():
            _line(canvas, [uv[a], uv[b]], colour or _brighter(side_colour(b)), thick)


def _lens_map(camera: Camera) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Map every pixel of the distorted picture to column and row in the ideal one, each (h, w)."""
    grid = np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=2)
    in_camera = camera.rays(grid) @ camera.R.T
    ideal = in_camera[..., :2] / in_camera[..., 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
    return ideal[..., 0].astype(np.float32), ideal[..., 1].astype(np.float32)


def _brighter(colour: Colour) -> Colour:
    b, g, r = (int(0.45 * 255 + 0.55 * part) for part in colour)
    return b, g, r


def _fixed(point: Array) -> tuple[int, int]:
    """Convert a pixel to OpenCV's fixed-point drawing coordinates, clamped to their range."""
    x, y = np.clip(np.rint(point * (1 << _SUBPIXEL)), -(1 << 28), 1 << 28).astype(int)
    return int(x), int(y)


def _line(canvas: Image, ends: Sequence[Array], colour: Colour, thick: int) -> None:
    cv2.line(canvas, _fixed(ends[0]), _fixed(ends[1]), colour, thick, cv2.LINE_AA, _SUBPIXEL)


def _dot(canvas: Image, at: Array, radius: float, colour: Colour) -> None:
    cv2.circle(canvas, _fixed(at), round(radius * (1 << _SUBPIXEL)), colour, -1, cv2.LINE_AA, _SUBPIXEL)


def _ellipse(canvas: Image, at: Array, radii: Array, angle: float, colour: Colour, thick: int) -> None:
    axes = _fixed(np.maximum(radii, 1.0))
    cv2.ellipse(canvas, _fixed(at), axes, angle, 0, 360, _DARK, thick + 2, cv2.LINE_AA, _SUBPIXEL)
    cv2.ellipse(canvas, _fixed(at), axes, angle, 0, 360, colour, thick, cv2.LINE_AA, _SUBPIXEL)


_PAPER = (246, 247, 248)
_RULE = (214, 216, 218)
_TEXT = (70, 70, 70)
_LESS, _MEAN, _MORE = (190, 110, 40), (205, 205, 205), (40, 90, 230)
_CELL = (176, 300)  # size of a cell of the sheet, pixels
_PHASES = 8
_MARGIN = (120, 44)  # left and top of the sheet, pixels
_SHEET_FONT = cv2.FONT_HERSHEY_DUPLEX


def default_view(state: State) -> Camera:
    """Make a camera that shows a person from the front and left, slightly from above."""
    target = np.array([*state.pelvis[:2], 0.5 * state.stature])
    angle = state.heading + np.radians(50)
    away = np.array([np.cos(angle), np.sin(angle), 0.22]) * 3 * state.stature
    return Camera.looking(target + away, target, (720, 900), 2280.0)


def draw_standing(model: Model, state: State, camera: Camera) -> Image:
    """Draw a person on ground with half-metre squares, (h, w, 3) BGR."""
    canvas = np.full((camera.height, camera.width, 3), _PAPER, np.uint8)
    middle = np.round(2 * np.asarray(state.pelvis[:2])) / 2
    reach = np.arange(-3, 3.5, 0.5)
    for step in reach:
        for ends in ([(step, -3), (step, 3)], [(-3, step), (3, step)]):
            along = np.linspace(ends[0], ends[1], 61) + middle  # short pieces, as lenses bend lines
            uv = camera.project(np.column_stack([along, np.zeros(61)]))
            pieces = uv[np.isfinite(uv).all(axis=1)]
            line = np.clip(np.rint(16 * pieces), -(1 << 28), 1 << 28).astype(np.int32)
            cv2.polylines(canvas, [line], False, _RULE, 1, cv2.LINE_AA, 4)
    return Overlay(model, camera).figure(canvas, state)


def draw_sheet(model: Model, motion_class: int = 0) -> Image:
    """Draw the sheet of one class of a model.

    Columns are phases.  Rows are the mean, then the stride rate (if the mean depends on it) and each score,
    at -2, 0 and +2 standard deviations.
    """
    rows = _rows(model, motion_class)
    left, top = _MARGIN
    width, height = _CELL
    sheet = np.full((top + height * len(rows), left + width * _PHASES, 3), _PAPER, np.uint8)
    camera = Camera.looking((0.0, -20.0, 0.9), (0.0, 0.0, 0.9), _CELL, 20 * 0.84 * height / 2.0)
    overlay = Overlay(model, camera)
    for row, (name, states) in enumerate(rows.items()):
        y = top + row * height
        cv2.putText(sheet, name, (10, y + height // 2), _SHEET_FONT, 0.45, _TEXT, 1, cv2.LINE_AA)
        for column in range(_PHASES):
            there = [_standing(model, state, column / _PHASES) for state in states]
            x = left + column * width
            sheet[y : y + height, x : x + width] = _cell(overlay, there)
    for column in range(_PHASES):
        place = (left + column * width + width // 2 - 34, 24)
        cv2.putText(sheet, f"phase {column / _PHASES:.3g}", place, _SHEET_FONT, 0.42, _TEXT, 1, cv2.LINE_AA)
    _legend(sheet)
    return sheet


def _rows(model: Model, motion_class: int) -> dict[str, list[State]]:
    """Make the states of each row, by name: at 0, -2 and +2 standard deviations, or only the mean."""
    info, turns = model.class_info(motion_class), (0.0, -2.0, 2.0)
    mean = State(stride_hz=info.stride_hz, coef=np.zeros(info.components), motion_class=motion_class)
    rows = {"mean": [mean]}
    rates = [replace(mean, stride_hz=info.stride_hz + turn * info.stride_hz_sd) for turn in turns]
    if not np.array_equal(model.pose(rates[1])[1], model.pose(mean)[1]):
        rows["stride rate"] = rates
    for k, component in enumerate(np.eye(info.components)):
        rows[f"component {k + 1}"] = [replace(mean, coef=turn * component) for turn in turns]
    return rows


def _standing(model: Model, state: State, phase: float) -> State:
    """Place a person of average size at a phase over the origin, heading along x."""
    state = replace(state, phase=phase, pelvis=np.zeros(3))
    state.pelvis[2] = model.pelvis_height(state)
    return state


def _cell(overlay: Overlay, states: list[State]) -> Image:
    """Draw the body of a single state, or the sticks of three."""
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
        cv2.putText(sheet, words, (10, 16 + 13 * line), _SHEET_FONT, 0.38, colour, 1, cv2.LINE_AA)
