"""The energy of a segment in a clip, with the sensors' responses to the stick figure.

A stick is a line of strength 1 per pixel of length, convolved with the sensors' Gaussian blur of standard
deviation s.  Its response at a sensor is  exp(-d^2 / 2 s^2) (Phi((L - u) / s) - Phi(-u / s)),  where u and d
are the coordinates along and across the stick and L is its length: an infinite stick through a sensor gives
1.  Since sticks that cover each other must not count twice, a figure gives 1 - exp(-sum of its sticks).
Derivatives are exact.

The energy is that of Leventon & Freeman 1998, eq. 7, as rows of least squares:

    E = ||R - f(alpha)||^2 + lambda_1 alpha' Lambda^-1 alpha + lambda_2 sum_i ||I_i - P_i x_i(alpha)||^2

R are the sensors, f the stick figure's responses, I the user's corrections.  Here every row is divided by its
standard deviation, so E is minus two log posterior: lambda_1 is the variance of a sensor, lambda_2 the ratio
of that to a correction's variance.  The modes include their standard deviations, so Lambda is 1.

The state of a segment: alpha (k), position (3) of the first frame's pelvis on the ground and above it,
heading (1), and the sensors' log gain and level: R = level + exp(gain) f.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import BONES
from gait.errors import UserError
from gait.lift.video.sensors import View

Floats = npt.NDArray[np.float64]

#: The sticks: bones, and the outlines of the trunk.
STICK_ENDS = (*BONES, *((f"{s}_shoulder", f"{s}_hip") for s in "lr"))
LEAST_STICK_PX = 1e-3  # pixels; a stick that points at the viewer still has a direction
DENSITY_AT_0 = 1 / np.sqrt(2 * np.pi)


@dataclass(frozen=True)
class Sticks:
    """Sticks between markers.

    Attributes
    ----------
    markers : (M,)
        Indices of the markers at the ends of sticks.
    ends : (B, 2)
        Indices into `markers`.
    """

    markers: npt.NDArray[np.intp]
    ends: npt.NDArray[np.intp]

    @staticmethod
    def of(names: Sequence[str]) -> Sticks:
        """Make the sticks of a body from the names of its markers.

        Raises
        ------
        UserError
            If a joint of the stick figure is not among them.
        """
        joints = list(dict.fromkeys(joint for stick in STICK_ENDS for joint in stick))
        missing = [joint for joint in joints if joint not in names]
        if missing:
            raise UserError(
                f"prior: has no marker {' '.join(missing)}; learn it with --segment-markers virtual"
            )
        markers = np.array([list(names).index(joint) for joint in joints], np.intp)
        ends = np.array([[joints.index(a), joints.index(b)] for a, b in STICK_ENDS], np.intp)
        return Sticks(markers, ends)

    def responses(self, uv: Floats, places: Floats, blur: Floats) -> tuple[Floats, Floats]:
        """Compute the responses of sensors to the figure, and their slopes.

        Parameters
        ----------
        uv : (T, M, 2)
            Markers in the picture, pixels.
        places : (T, S, 2)
            Sensors, pixels.
        blur : (T,)
            Standard deviation of their Gaussian blur, pixels.

        Returns
        -------
        value : (T, S)
        slope : (T, S, M, 2)
            Derivatives by the markers' pixels.
        """
        value, by_end = stick_responses(uv[:, self.ends], places, blur)
        join = np.zeros((self.ends.size, len(self.markers)))  # a marker may be an end of several sticks
        join[np.arange(self.ends.size), self.ends.ravel()] = 1.0
        left = np.exp(-value.sum(axis=2))
        return 1 - left, np.swapaxes((by_end * left[:, :, None, None]) @ join, 2, 3)


def stick_responses(ends: Floats, places: Floats, blur: Floats) -> tuple[Floats, Floats]:
    """Compute responses (T, S, B) of sensors (T, S, 2) to sticks (T, B, 2, 2), and slopes (T, S, 2, B * 2).

    Slopes are ordered by column and row, then by sticks and their ends.
    """
    s = blur[:, None, None]
    along = ends[:, :, 1] - ends[:, :, 0]
    length = np.maximum(np.hypot(along[..., 0], along[..., 1]), LEAST_STICK_PX)
    ex, ey = (along[:, None, :, i] / length[:, None] for i in (0, 1))
    x, y = (places[:, :, None, i] - ends[:, None, :, 0, i] for i in (0, 1))
    u, d, long = x * ex + y * ey, y * ex - x * ey, length[:, None]
    across = np.exp(-0.5 * (d / s) ** 2)
    near, far = u / s, (u - long) / s
    value = across * (ndtr(near) - ndtr(far))
    by_l = across * (DENSITY_AT_0 / s * np.exp(-0.5 * far * far))
    by_u = across * (DENSITY_AT_0 / s * np.exp(-0.5 * near * near)) - by_l
    by_d = -d / s**2 * value
    # rotating the stick by an angle n . (step of end 1 - step of end 0) / L moves (u, d) by (d, -u) times it
    turn = (by_u * d - by_d * u) / long
    slope = np.empty((*value.shape[:2], 2, value.shape[2], 2))
    for i, (e, n) in enumerate(((ex, -ey), (ey, ex))):
        slope[:, :, i, :, 1] = by_l * e + turn * n
        slope[:, :, i, :, 0] = -slope[:, :, i, :, 1] - by_u * e - by_d * n
    return value, slope.reshape(*value.shape[:2], 2, -1)


Indices = npt.NDArray[np.intp]

EXTRA = 6  # entries of the state after alpha
PLACE_COLUMNS, HEADING_COLUMN, GAIN_COLUMN, LEVEL_COLUMN = slice(-6, -3), -3, -2, -1


@dataclass(frozen=True)
class Shape:
    """One Gaussian of the prior for a person of known stature, in metres.

    Attributes
    ----------
    mean : (F, J, 3)
    modes : (F, J, 3, k)
    residual : (J,)
        Standard deviation of each coordinate that the modes do not explain, inflated by `gamma`.
    turning : bool
        Whether the heading is part of the state; otherwise segments are in the world's axes.
    """

    mean: Floats
    modes: Floats
    residual: Floats
    turning: bool

    @staticmethod
    def of(prior: SegmentPrior, component: int, stature: float) -> Shape:
        """Make the shape of a component of a prior."""
        return Shape(
            mean=stature * prior.mean[component],
            modes=stature * np.moveaxis(prior.modes[component], 0, -1),
            residual=stature * np.sqrt(prior.gamma * prior.residual[component]),
            turning=prior.headings == 0,
        )

    @property
    def size(self) -> int:
        """Number of entries of the state."""
        return self.modes.shape[-1] + EXTRA

    def positions(self, state: Floats, weights: Floats, markers: Indices | slice) -> tuple[Floats, Floats]:
        """Compute markers at T times and their slopes by the state.

        Parameters
        ----------
        state : (k + 6,)
        weights : (T, F)
            Rows that interpolate the segment's frames.
        markers : indices of M markers

        Returns
        -------
        places : (T, M, 3)
            World, metres.
        slope : (T, M, 3, k + 6)
        """
        modes = np.tensordot(weights, self.modes[:, markers], axes=1)
        body = np.tensordot(weights, self.mean[:, markers], axes=1) + modes @ state[:-EXTRA]
        heading = state[HEADING_COLUMN] if self.turning else 0.0
        c, s = np.cos(heading), np.sin(heading)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        by_turn = np.array([[-s, -c, 0], [c, -s, 0], [0, 0, 0]])
        slope = np.zeros((*body.shape, self.size))
        slope[..., :-EXTRA] = turn @ modes
        slope[..., PLACE_COLUMNS] = np.eye(3)
        if self.turning:
            slope[..., HEADING_COLUMN] = body @ by_turn.T
        return body @ turn.T + state[PLACE_COLUMNS], slope


@dataclass(frozen=True)
class Reading:
    """Sensors of T frames: values (T, S); positions (T, S, 2) and blur (T,) in pixels; sd of a value."""

    value: Floats
    places: Floats
    blur: Floats
    sd: float


@dataclass(frozen=True)
class Corrections:
    """C corrections: indices (C,) among the T times, markers (C,), pixels (C, 2) and their sd (C,)."""

    frame: Indices
    marker: Indices
    uv: Floats
    sd: Floats


@dataclass(frozen=True)
class Anchor:
    """Known positions (A, J, 3) of all markers in A frames of the segment, and their sd (J,), metres."""

    frames: slice
    places: Floats
    sd: Floats


@dataclass(frozen=True)
class Energy:
    """The energy of one segment.

    Attributes
    ----------
    shape : Shape
    view : View
    sticks : Sticks
    weights : (T, F)
        Rows that interpolate the segment's frames at the times of the video.
    mean, sd : (k + 6,)
        Normal prior of the state.
    reading : Reading, optional
    corrections : Corrections, optional
    anchor : Anchor, optional
    """

    shape: Shape
    view: View
    sticks: Sticks
    weights: Floats
    mean: Floats
    sd: Floats
    reading: Reading | None = None
    corrections: Corrections | None = None
    anchor: Anchor | None = None

    def visible(self, state: Floats) -> bool:
        """Whether the whole body is in front of the lens."""
        places, _ = self.shape.positions(state, np.eye(self.weights.shape[1]), slice(None))
        return self.view.visible(places)

    def rows(self, state: Floats) -> tuple[Floats, Floats]:
        """Compute residuals (R,) in standard deviations, and their slopes (R, k + 6) by the state."""
        parts = [((state - self.mean) / self.sd, np.diag(1 / self.sd))]
        if self.reading is not None and len(self.reading.value):
            parts.append(self.sensor_rows(self.reading, state))
        if self.corrections is not None:
            parts.append(self.correction_rows(state))
        if self.anchor is not None:
            parts.append(self._anchor_rows(self.anchor, state))
        return np.concatenate([r for r, _ in parts]), np.concatenate([slope for _, slope in parts])

    def residuals(self, state: Floats) -> Floats:
        """Compute the figure's responses minus the sensors (T * S,); empty without sensors."""
        if self.reading is None:
            return np.zeros(0)
        return self.sensor_rows(self.reading, state)[0] * self.reading.sd

    def sensor_rows(self, reading: Reading, state: Floats) -> tuple[Floats, Floats]:
        """Compute residuals (T * S,) of the sensors over their sd, and slopes (T * S, k + 6) by the state."""
        places, by_state = self.shape.positions(state, self.weights, self.sticks.markers)
        uv, by_place = self.view.project(places)
        response, by_uv = self.sticks.responses(uv, reading.places, reading.blur)
        drawn = (by_place @ by_state).reshape(len(uv), -1, len(state))  # (T, M * 2, n)
        gain = np.exp(state[GAIN_COLUMN])
        slope = gain * (by_uv.reshape(*response.shape, -1) @ drawn)
        slope[..., GAIN_COLUMN], slope[..., LEVEL_COLUMN] = gain * response, 1.0
        residual = state[LEVEL_COLUMN] + gain * response - reading.value
        return residual.ravel() / reading.sd, slope.reshape(-1, len(state)) / reading.sd

    def correction_rows(self, state: Floats) -> tuple[Floats, Floats]:
        """Compute differences (2 C,) of markers and corrections over their sd, and slopes (2 C, k + 6)."""
        corrections = self.corrections
        if corrections is None or not len(corrections.frame):
            return np.zeros(0), np.zeros((0, len(state)))
        places, by_state = self.shape.positions(state, self.weights[corrections.frame], slice(None))
        each = np.arange(len(corrections.frame))
        uv, by_place = self.view.project(places[each, corrections.marker])
        slope = by_place @ by_state[each, corrections.marker]
        residual = (uv - corrections.uv) / corrections.sd[:, None]
        return residual.ravel(), (slope / corrections.sd[:, None, None]).reshape(-1, len(state))

    def _anchor_rows(self, anchor: Anchor, state: Floats) -> tuple[Floats, Floats]:
        first = np.eye(self.weights.shape[1])[anchor.frames]
        places, slope = self.shape.positions(state, first, slice(None))
        sd = anchor.sd[:, None]
        return ((places - anchor.places) / sd).ravel(), (slope / sd[..., None]).reshape(-1, len(state))
