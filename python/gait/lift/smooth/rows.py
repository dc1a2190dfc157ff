"""2-D observations as rows of a linear model of the markers' positions: direction . X + noise = value.

Orthographic views are linear in the positions.  Perspective views are too, when multiplied by the depth: with
R, t of the camera and (a, b) the ideal image coordinates of a point X,

    (R_x - a R_z) . X = a t_z - t_x,    (R_y - b R_z) . X = b t_z - t_y,

where only the noise, sd Z / f, depends on the position; it is evaluated at a guess and iterated.  As a and b
also contain the observation's noise, these rows draw bodies towards the camera (by the square of noise over
extent). Near a guess, the derivatives of the projection at the guess are used instead, as in the C core.

If the scale of a parallel view is unknown, the length l of one unit of the picture is another unknown of each
frame: a point observed at (u, v) satisfies right . X - u l = 0 and down . X - v l = 0, with noise sd l.  This
is linearised around a guess.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt

from gait.camera.camera import Camera
from gait.lift.keypoints.observations import Observations
from gait.lift.segment.view import AnyView, Perspective, Several

Floats = npt.NDArray[np.float64]

LEAST_DEPTH_M = 0.1  # metres in front of the lens; least depth for the noise
NEAR_RAY_M = 0.5  # metres from the ray within which a guess is good enough for the projection's derivatives
NOISE_SDS = 5.0  # standard deviations from the ray that noise alone may cause, so that the guess is also good


@dataclass(frozen=True)
class Rows:
    """Two linear measurements of each of n points: direction @ X[frame, marker] + noise = value.

    Attributes
    ----------
    frame, marker : (n,)
    direction : (n, 2, 3)
    value : (n, 2)
    variance : (n, 2)
        Variance of the noise, which is independent; in units of `value` squared.
    """

    frame: npt.NDArray[np.intp]
    marker: npt.NDArray[np.intp]
    direction: Floats
    value: Floats
    variance: Floats

    def shifted(self, places: Floats) -> Rows:
        """Convert to rows that measure displacements from `places` (T, J, 3)."""
        at = places[self.frame, self.marker]
        return replace(self, value=self.value - np.einsum("nai,ni->na", self.direction, at))


def orthographic(observed: Observations, axes: Floats) -> Rows:
    """Make the rows of an orthographic view.

    Parameters
    ----------
    observed : Observations
        Metres along `axes`.
    axes : (2, 3)
        Unit vectors of the picture.
    """
    frame, marker = np.nonzero(observed.visible)
    variance = observed.sd[frame, marker, None] ** 2 * np.ones(2)
    direction = np.broadcast_to(axes, (len(frame), 2, 3))
    return Rows(frame, marker, direction, observed.uv[frame, marker], variance)


def perspective(observed: Observations, camera: Camera, about: Floats, guess: Floats | None = None) -> Rows:
    """Make the rows of a calibrated view, with the noise at the positions `about`.

    Parameters
    ----------
    observed : Observations
        Pixels as captured; lens distortion is corrected here.
    about : (T, J, 3) or (3,)
        Positions at which derivatives are taken, metres, world.
    guess : (T, J, 3), optional
        Positions at which the rows are exact; by default `about`.
    """
    frame, marker = np.nonzero(observed.visible)
    rays = camera.rays(observed.uv[frame, marker]) @ camera.R.T
    ideal = rays[:, :2] / rays[:, 2:]
    places = np.broadcast_to(about, (*observed.sd.shape, 3))[frame, marker]
    depth = np.maximum(camera.depth(places), LEAST_DEPTH_M)
    sd = observed.sd[frame, marker, None] * depth[:, None] / (camera.fx, camera.fy)
    there = places if guess is None else guess[frame, marker]
    guessed, predicted = _ideal(camera, places), _ideal(camera, there)
    miss = (ideal - predicted) * depth[:, None]
    near = np.linalg.norm(miss, axis=1, keepdims=True) < np.maximum(
        NEAR_RAY_M, NOISE_SDS * sd.max(axis=1, keepdims=True)
    )
    direction = camera.R[:2] - np.where(near, guessed, ideal)[:, :, None] * camera.R[2]
    tangent = miss + np.einsum("nai,ni->na", direction, there)
    return Rows(frame, marker, direction, np.where(near, tangent, ideal * camera.t[2] - camera.t[:2]), sd**2)


def _ideal(camera: Camera, places: Floats) -> Floats:
    """Project positions (n, 3) to ideal image coordinates (n, 2)."""
    depth = np.maximum(camera.depth(places), LEAST_DEPTH_M)[:, None]
    return np.asarray((places @ camera.R[:2].T + camera.t[:2]) / depth)


def scale_free(rows: Rows, places: Floats, lengths: Floats) -> tuple[Rows, Floats]:
    """Make the length of a unit of the picture an unknown.

    Parameters
    ----------
    rows : Rows
        Rows of a parallel view with `lengths` (T,).
    places : (T, J, 3)
        Positions around which to linearise; their projection is scaled, not the noisy observations.

    Returns
    -------
    rows : Rows
    factors : (n, 2)
        Factors of the frame's length.
    """
    rows = rows.shifted(places)
    at = np.einsum("nai,ni->na", rows.direction, places[rows.frame, rows.marker])
    return rows, -at / lengths[rows.frame, None]


def rows_of(view: AnyView, observed: Observations, places: Floats, lengths: Floats, guess: Floats) -> Rows:
    """Make the rows of observations in a view.

    Parameters
    ----------
    places, guess : (T, J, 3)
        Positions at which derivatives are taken, and at which the rows are exact; only used for cameras.
    lengths : (T,)
        Metres of a unit of the picture; only used without a camera.
    """
    if isinstance(view, Perspective):
        return perspective(observed, view.camera, places, guess)
    if isinstance(view, Several):
        each = [
            perspective(observed.where(view.of_point == number), camera, places, guess)
            for number, camera in enumerate(view.cameras)
        ]
        return Rows(*(np.concatenate([getattr(one, f.name) for one in each]) for f in fields(Rows)))
    return orthographic(view.metric(observed, lengths), view.axes[:2])
