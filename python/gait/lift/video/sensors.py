"""Sensors of the picture: gradient magnitude over local contrast, blurred, read on a grid about the person.

After Leventon & Freeman 1998, eq. 7.  The blurred fields vary slowly, so they are kept at a lower
resolution: a clip of any size takes little memory, and the grid may move while the estimate is found.

How a person is seen: through a calibrated camera, or flat (scaled orthographic) where there is none.

A view maps points to pixels and gives the exact slope of that map.  Points are in the world with a camera;
in a flat view they are in the picture's own axes: x to the right, y away from the viewer, z up, metres.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

from gait.camera.camera import Camera
from gait.io.video import Frame, Image
from gait.lift.segment.view import looking_along

Floats = npt.NDArray[np.float64]
Field = npt.NDArray[np.float32]

ROWS, COLUMNS = 10, 8
REACH = 1.15  # height of the grid, statures
CONTRAST = 0.035  # standard deviation of the window of local contrast, statures: 8 pixels of a person of 230
BLUR = 0.6  # standard deviation of the sensors' blur, steps of the grid
TALL = 240.0  # pixels of a person; larger pictures are made smaller first
GRAIN = 4.0  # grey levels added to the contrast: noise of the camera
FLOOR = 2.0  # medians of the picture's gradients that every place has
SAMPLES = 3.0  # stored per standard deviation of the blur
CHANGE = 6.0  # standard deviations of the difference to the empty scene at which a gradient counts half


def grid(middle: Floats, stature: Floats) -> Floats:
    """Places (T, 80, 2) of the sensors about middles of persons (T, 2) of so many pixels (T,)."""
    step = REACH / ROWS * stature
    rows, columns = np.arange(ROWS) - (ROWS - 1) / 2, np.arange(COLUMNS) - (COLUMNS - 1) / 2
    lattice = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    return np.asarray(middle[:, None] + step[:, None, None] * lattice)


def blur_of(stature: float) -> float:
    """Give the standard deviation of the blur, pixels, for a person of so many pixels."""
    return BLUR * REACH / ROWS * stature


@dataclass(frozen=True)
class Film:
    """Sensor fields of a interval of video.

    Attributes
    ----------
    first : int
        Number of the first frame.
    times : (T,)
        Seconds from the start of the video.
    fields : (T, h, w)
        Blurred normalised gradients.
    step : (2,)
        Columns and rows of the picture from one of their values to the next, pixels.
    blur : float
        Standard deviation of the blur, pixels.
    """

    first: int
    times: Floats
    fields: Field
    step: Floats
    blur: float

    def read(self, frames: npt.NDArray[np.intp], places: Floats) -> Floats:
        """Sensors (T, S) at places (T, S, 2), pixels, of frames (T,), counted from the first of the film.

        Beyond the picture's edge a sensor reads what the edge shows.
        """
        at = ((places + 0.5) / self.step - 0.5).astype(np.float32)
        rows = [
            cv2.remap(self.fields[k], x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[0]
            for k, x, y in zip(frames, at[..., :1].swapaxes(1, 2), at[..., 1:].swapaxes(1, 2), strict=True)
        ]
        return np.asarray(rows, np.float64)

    @staticmethod
    def make(
        frames: Iterable[Frame],
        stature: float,
        plate: Image | None = None,
        update: Callable[[int], None] | None = None,
    ) -> Film:
        """Run the filters over frames.

        Parameters
        ----------
        frames : iterable of Frame
            At least one, consecutive.
        stature : float
            Height of the person in the picture, pixels.
        plate : Image, optional
            The empty scene: gradients where nothing has changed are left out.
        update : callable, optional
            Called with the count of frames done.
        """
        shrink = min(1.0, TALL / stature)
        window, numbers, times, fields = CONTRAST * stature * shrink, [], [], []
        scene = None if plate is None else _grey(plate, shrink)
        for done, frame in enumerate(frames, 1):
            grey = _grey(frame.image, shrink)
            edges = normalised_gradient(grey, window)
            if scene is None:
                edges = above_usual(edges)
            else:
                edges *= changed(grey, scene, 0.5 * window)
            fields.append(_blurred(edges, blur_of(stature * shrink)))
            numbers.append(frame.number)
            times.append(frame.time)
            size = frame.image.shape
            if update is not None:
                update(done)
        height, width = fields[0].shape
        step = np.array([size[1] / width, size[0] / height])
        return Film(numbers[0], np.array(times), np.stack(fields), step, blur_of(stature))


def _grey(image: Image, shrink: float) -> Field:
    grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    if shrink < 1:
        grey = cv2.resize(grey, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    return np.asarray(grey, np.float32)


def normalised_gradient(grey: Field, window: float) -> Field:
    """Magnitude of the gradient over the sd of the grey values in a Gaussian window, (h, w)."""
    smooth = cv2.GaussianBlur(grey, (0, 0), 1.0)
    slope = cv2.magnitude(
        cv2.Sobel(smooth, cv2.CV_32F, 1, 0, scale=1 / 8), cv2.Sobel(smooth, cv2.CV_32F, 0, 1, scale=1 / 8)
    )
    mean, square = (cv2.GaussianBlur(x, (0, 0), window) for x in (grey, grey * grey))
    contrast = np.sqrt(np.maximum(square - mean * mean, 0)) + GRAIN
    return np.asarray(window * slope / contrast, np.float32)


def above_usual(edges: Field) -> Field:
    """Take from gradients (h, w) what noise and texture give everywhere.

    Else the figure looks smaller than it is: next to it contrast is high and normalised noise low.
    """
    return np.asarray(np.maximum(edges - FLOOR * np.median(edges), 0), np.float32)


def changed(grey: Field, plate: Field, window: float) -> Field:
    """How much of each pixel's neighbourhood differs from the empty scene, 0 to 1, (h, w)."""
    difference = np.abs(grey - plate)
    noise = float(np.median(difference)) / 0.6745 + 1.0
    square = cv2.GaussianBlur(difference, (0, 0), max(window, 0.5)) ** 2
    return np.asarray(square / (square + (CHANGE * noise) ** 2), np.float32)


def _blurred(edges: Field, blur: float) -> Field:
    """Blurred field, sampled `SAMPLES` times per standard deviation of the blur."""
    height, width = edges.shape
    step = max(blur / SAMPLES, 1.0)
    count = max(2, round(width / step)), max(2, round(height / step))
    means = cv2.resize(edges, count, interpolation=cv2.INTER_AREA)  # their square adds step^2 / 12
    left = np.sqrt(max(blur**2 - step**2 / 12, 0.01)) / step
    return np.asarray(cv2.GaussianBlur(means, (0, 0), left, borderType=cv2.BORDER_REPLICATE), np.float32)


NEAREST = 0.2  # metres before the lens; nothing that is drawn comes nearer


class View(Protocol):
    """What the estimate from images asks of a view."""

    def project(self, points: Floats) -> tuple[Floats, Floats]:
        """Pixels (..., 2) of points (..., 3), and slopes (..., 2, 3) of pixels by points."""
        ...

    def visible(self, points: Floats) -> bool:
        """Whether all points are before the lens."""
        ...

    def depth(self, points: Floats) -> Floats:
        """Distance (...) along the direction of view, metres."""
        ...

    def scale(self, point: Floats) -> float:
        """Pixels per metre at a point (3,)."""
        ...

    def growth(self, points: Floats) -> Floats:
        """How points (..., 3) move, per share that the person is larger, without moving in the picture."""
        ...

    def away(self, point: Floats) -> Floats:
        """Direction (3,) along which a point moves away without moving in the picture."""
        ...


@dataclass(frozen=True)
class CameraView:
    """View of a calibrated camera, lens distortion included."""

    camera: Camera

    def project(self, points: Floats) -> tuple[Floats, Floats]:
        """Pixels and slopes, see `View`."""
        turn, _ = cv2.Rodrigues(self.camera.R)
        flat = np.ascontiguousarray(points.reshape(-1, 3))
        uv, table = cv2.projectPoints(
            flat, turn, self.camera.t, self.camera.matrix, np.asarray(self.camera.distortion)
        )
        # a step of the point turned into the camera's axes is a step of the translation
        slope = table[:, 3:6].reshape(-1, 2, 3) @ self.camera.R
        return np.asarray(uv, float).reshape(*points.shape[:-1], 2), slope.reshape(*points.shape[:-1], 2, 3)

    def visible(self, points: Floats) -> bool:
        """Whether all points are before the lens."""
        return bool((self.depth(points) > NEAREST).all())

    def depth(self, points: Floats) -> Floats:
        """Distance before the lens along its axis."""
        return self.camera.depth(points)

    def scale(self, point: Floats) -> float:
        """Pixels per metre at a point."""
        return self.camera.fy / max(float(self.camera.depth(point)), NEAREST)

    def growth(self, points: Floats) -> Floats:
        """Away from the lens: a larger person is further away."""
        return np.asarray(points - self.camera.centre)

    def away(self, point: Floats) -> Floats:
        """Direction of the ray through a point."""
        ray = point - self.camera.centre
        return np.asarray(ray / np.linalg.norm(ray))


@dataclass(frozen=True)
class FlatView:
    """Scaled orthographic view (Leventon & Freeman 1998, their P drops the depth).

    Attributes
    ----------
    pixels : float
        Per metre.
    origin : (2,)
        Pixel of the point (0, 0, 0).
    axes : (3, 3)
        Right, down and ahead in the world as rows; level along y if left out.
    """

    pixels: float
    origin: tuple[float, float]
    axes: Floats = field(default_factory=lambda: looking_along("y"))

    def project(self, points: Floats) -> tuple[Floats, Floats]:
        """Pixels and slopes, see `View`."""
        slope = self.pixels * self.axes[:2]
        uv = points @ slope.T + np.asarray(self.origin)
        return uv, np.broadcast_to(slope, (*points.shape[:-1], 2, 3))

    def visible(self, points: Floats) -> bool:
        """Nothing is behind a flat view."""
        return True

    def depth(self, points: Floats) -> Floats:
        """Distance from the point (0, 0, 0) away from the viewer."""
        return np.asarray(points @ self.axes[2])

    def scale(self, point: Floats) -> float:
        """Pixels per metre, the same everywhere."""
        return self.pixels

    def growth(self, points: Floats) -> Floats:
        """Nowhere: the placement's stature is the unit of length."""
        return np.zeros_like(points)

    def away(self, point: Floats) -> Floats:
        """Direction of depth."""
        return self.axes[2]
