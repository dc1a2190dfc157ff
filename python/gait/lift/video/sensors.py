"""Sensors of the picture, and views: a calibrated camera, or flat (scaled orthographic).

Sensors are gradient magnitudes over local contrast, blurred, and read on a grid around the person, after
Leventon & Freeman 1998, eq. 7.  As the blurred fields vary slowly, they are stored at a lower resolution; so
a clip takes little memory, whatever its size, and the grid can move during the estimation.

A view maps points to pixels, with exact derivatives.  With a camera, points are in its world; in a flat view
they are in the picture's own axes: x to the right, y away from the viewer, z up, metres.
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

GRID_ROWS, GRID_COLUMNS = 10, 8
GRID_HEIGHT = 1.15  # height of the grid, statures
CONTRAST = 0.035  # standard deviation of the window of local contrast, statures; 8 pixels for a person of 230
BLUR = 0.6  # standard deviation of the sensors' blur, in steps of the grid
TALL_PX = 240.0  # pixels; pictures of taller people are reduced first
GRAIN = 4.0  # grey levels added to the contrast, for the camera's noise
SUBTRACTED_MEDIANS = 2.0  # multiple of the median gradient that is subtracted everywhere
SAMPLES_PER_SD = 3.0  # samples stored per standard deviation of the blur
CHANGE = 6.0  # standard deviations of the difference to the empty scene at which a gradient counts half


def grid(middle: Floats, stature: Floats) -> Floats:
    """Make positions (T, 80, 2) of the sensors around middles (T, 2) of a person of `stature` (T,) pixels."""
    step = GRID_HEIGHT / GRID_ROWS * stature
    rows, columns = (
        np.arange(GRID_ROWS) - (GRID_ROWS - 1) / 2,
        np.arange(GRID_COLUMNS) - (GRID_COLUMNS - 1) / 2,
    )
    lattice = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    return np.asarray(middle[:, None] + step[:, None, None] * lattice)


def blur_of(stature: float) -> float:
    """Return the standard deviation of the blur, pixels, for a person of `stature` pixels."""
    return BLUR * GRID_HEIGHT / GRID_ROWS * stature


@dataclass(frozen=True)
class Film:
    """Sensor fields of an interval of video.

    Attributes
    ----------
    first : int
        Number of the first frame.
    times : (T,)
        Seconds from the start of the video.
    fields : (T, h, w)
        Blurred normalised gradients.
    step : (2,)
        Distance between their values along columns and rows, pixels of the picture.
    blur : float
        Standard deviation of the blur, pixels.
    """

    first: int
    times: Floats
    fields: Field
    step: Floats
    blur: float

    def read(self, frames: npt.NDArray[np.intp], places: Floats) -> Floats:
        """Read sensors (T, S) at positions (T, S, 2), pixels, in frames (T,), counted from the film's first.

        Beyond the picture's edge a sensor has the value at the edge.
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
            The empty scene; gradients where nothing differs from it are suppressed.
        update : callable, optional
            Called with the number of frames done.
        """
        shrink = min(1.0, TALL_PX / stature)
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
    """Subtract from gradients (h, w) the part that noise and texture cause everywhere.

    Otherwise the figure would look smaller, as near it contrast is high and normalised noise low.
    """
    return np.asarray(np.maximum(edges - SUBTRACTED_MEDIANS * np.median(edges), 0), np.float32)


def changed(grey: Field, plate: Field, window: float) -> Field:
    """Compute how much each pixel's neighbourhood differs from the empty scene, 0 to 1, (h, w)."""
    difference = np.abs(grey - plate)
    noise = float(np.median(difference)) / 0.6745 + 1.0
    square = cv2.GaussianBlur(difference, (0, 0), max(window, 0.5)) ** 2
    return np.asarray(square / (square + (CHANGE * noise) ** 2), np.float32)


def _blurred(edges: Field, blur: float) -> Field:
    """Blur a field, sampled `SAMPLES_PER_SD` times per standard deviation of the blur."""
    height, width = edges.shape
    step = max(blur / SAMPLES_PER_SD, 1.0)
    count = max(2, round(width / step)), max(2, round(height / step))
    means = cv2.resize(edges, count, interpolation=cv2.INTER_AREA)  # adds a variance of step^2 / 12
    left = np.sqrt(max(blur**2 - step**2 / 12, 0.01)) / step
    return np.asarray(cv2.GaussianBlur(means, (0, 0), left, borderType=cv2.BORDER_REPLICATE), np.float32)


NEAREST_DRAWN_M = 0.2  # metres in front of the lens; nothing is drawn nearer


class View(Protocol):
    """Interface of a view for lifting images."""

    def project(self, points: Floats) -> tuple[Floats, Floats]:
        """Project points (..., 3) to pixels (..., 2); also return slopes (..., 2, 3) of pixels by points."""
        ...

    def visible(self, points: Floats) -> bool:
        """Whether all points are in front of the lens."""
        ...

    def depth(self, points: Floats) -> Floats:
        """Distance (...) along the direction of view, metres."""
        ...

    def scale(self, point: Floats) -> float:
        """Pixels per metre at a point (3,)."""
        ...

    def growth(self, points: Floats) -> Floats:
        """How points (..., 3) move per relative growth of the person, without moving in the picture."""
        ...

    def away(self, point: Floats) -> Floats:
        """Direction (3,) along which a point moves away without moving in the picture."""
        ...


@dataclass(frozen=True)
class CameraView:
    """View of a calibrated camera, with lens distortion."""

    camera: Camera

    def project(self, points: Floats) -> tuple[Floats, Floats]:
        """Pixels and slopes, see `View`."""
        return self.camera.linearised(points)

    def visible(self, points: Floats) -> bool:
        """Whether all points are in front of the lens."""
        return bool((self.depth(points) > NEAREST_DRAWN_M).all())

    def depth(self, points: Floats) -> Floats:
        """Distance in front of the lens along its axis."""
        return self.camera.depth(points)

    def scale(self, point: Floats) -> float:
        """Pixels per metre at a point."""
        return self.camera.fy / max(float(self.camera.depth(point)), NEAREST_DRAWN_M)

    def growth(self, points: Floats) -> Floats:
        """Away from the lens, as a larger person is further away."""
        return np.asarray(points - self.camera.centre)

    def away(self, point: Floats) -> Floats:
        """Direction of the ray through a point."""
        ray = point - self.camera.centre
        return np.asarray(ray / np.linalg.norm(ray))


@dataclass(frozen=True)
class FlatView:
    """Scaled orthographic view (Leventon & Freeman 1998, whose P drops the depth).

    Attributes
    ----------
    pixels : float
        Pixels per metre.
    origin : (2,)
        Pixel of the point (0, 0, 0).
    axes : (3, 3)
        Right, down and forward in the world, as rows; by default level along y.
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
        """Return True, as nothing is behind a flat view."""
        return True

    def depth(self, points: Floats) -> Floats:
        """Distance from the point (0, 0, 0) away from the viewer."""
        return np.asarray(points @ self.axes[2])

    def scale(self, point: Floats) -> float:
        """Pixels per metre, the same everywhere."""
        return self.pixels

    def growth(self, points: Floats) -> Floats:
        """Return zeros, as the placement's stature is the unit of length."""
        return np.zeros_like(points)

    def away(self, point: Floats) -> Floats:
        """Direction of depth."""
        return self.axes[2]
