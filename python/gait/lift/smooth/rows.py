"""2-D observations of markers, and the rows of the linear model that they are: direction . X + noise = value.

Orthographic views are linear in the markers' places.  A perspective one is too when it is multiplied by the
depth: with R, t of the camera and (a, b) the ideal image coordinates of a point X,

    (R_x - a R_z) . X = a t_z - t_x,    (R_y - b R_z) . X = b t_z - t_y,

and only the noise, sd Z / f, depends on where the point is: it is taken at a guess and iterated.  These rows
hold the observation's own noise, which draws bodies towards the camera (by the square of noise over extent);
so near a guess the derivatives of the projection there are taken instead, as the C core does.

Views whose scale may be unknown, as rows that are linear in the markers and in the scale.

A calibrated camera and a parallel view of known scale give the rows of `gait.lift.observe`.  Where the scale
is unknown, the length l of one unit of the picture is one more number per frame: a point seen at (u, v) obeys
right . X - u l = 0 and down . X - v l = 0, with the noise sd l.  Near a guess this is linearised there.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt

from gait.camera.camera import Camera
from gait.lift.keypoints.observations import Observations
from gait.lift.segment.view import AnyView, Perspective, Several

Floats = npt.NDArray[np.float64]

NEAREST = 0.1  # metres before the lens: noise is not taken nearer
NEAR = 0.5  # metres beside the ray: a guess is good enough to take the projection's derivatives there
NOISE = 5.0  # standard deviations that noise alone puts a point off: no guess is bad for that


@dataclass(frozen=True)
class Rows:
    """Two linear measurements of each of n points: direction @ X[frame, marker] + noise = value.

    Attributes
    ----------
    frame, marker : (n,)
    direction : (n, 2, 3)
    value : (n, 2)
    variance : (n, 2)
        Of the noise, which is independent; in units of `value` squared.
    """

    frame: npt.NDArray[np.intp]
    marker: npt.NDArray[np.intp]
    direction: Floats
    value: Floats
    variance: Floats

    def shifted(self, places: Floats) -> Rows:
        """Rows that measure displacements from `places` (T, J, 3)."""
        at = places[self.frame, self.marker]
        return replace(self, value=self.value - np.einsum("nai,ni->na", self.direction, at))


def orthographic(observed: Observations, axes: Floats) -> Rows:
    """Rows of a view that leaves depth out.

    Parameters
    ----------
    visible : Observations
        Metres along `axes`.
    axes : (2, 3)
        Unit vectors of the picture.
    """
    frame, marker = np.nonzero(observed.visible)
    variance = observed.sd[frame, marker, None] ** 2 * np.ones(2)
    direction = np.broadcast_to(axes, (len(frame), 2, 3))
    return Rows(frame, marker, direction, observed.uv[frame, marker], variance)


def perspective(observed: Observations, camera: Camera, about: Floats, guess: Floats | None = None) -> Rows:
    """Rows of a calibrated view, the noise being that at the places `about`.

    Parameters
    ----------
    visible : Observations
        Pixels; the lens distortion is taken out of them here.
    about : (T, J, 3) or (3,)
        Where derivatives are taken, metres, world.
    guess : (T, J, 3), optional
        Where the rows hold exactly; by default `about`.
    """
    frame, marker = np.nonzero(observed.visible)
    rays = camera.rays(observed.uv[frame, marker]) @ camera.R.T
    ideal = rays[:, :2] / rays[:, 2:]
    places = np.broadcast_to(about, (*observed.sd.shape, 3))[frame, marker]
    depth = np.maximum(camera.depth(places), NEAREST)
    sd = observed.sd[frame, marker, None] * depth[:, None] / (camera.fx, camera.fy)
    there = places if guess is None else guess[frame, marker]
    guessed, predicted = _ideal(camera, places), _ideal(camera, there)
    miss = (ideal - predicted) * depth[:, None]
    near = np.linalg.norm(miss, axis=1, keepdims=True) < np.maximum(
        NEAR, NOISE * sd.max(axis=1, keepdims=True)
    )
    direction = camera.R[:2] - np.where(near, guessed, ideal)[:, :, None] * camera.R[2]
    tangent = miss + np.einsum("nai,ni->na", direction, there)
    return Rows(frame, marker, direction, np.where(near, tangent, ideal * camera.t[2] - camera.t[:2]), sd**2)


def _ideal(camera: Camera, places: Floats) -> Floats:
    """Ideal image coordinates (n, 2) of places (n, 3)."""
    depth = np.maximum(camera.depth(places), NEAREST)[:, None]
    return np.asarray((places @ camera.R[:2].T + camera.t[:2]) / depth)


def scale_free(rows: Rows, places: Floats, lengths: Floats) -> tuple[Rows, Floats]:
    """Let the length of a unit of the picture be unknown.

    Parameters
    ----------
    rows : Rows
        From `Parallel.rows` with `lengths` (T,).
    places : (T, J, 3)
        What the rows are linearised at: the picture of these, and not the noisy one, is scaled.

    Returns
    -------
    rows : Rows
    factors : (n, 2)
        Of the frame's length.
    """
    rows = rows.shifted(places)
    at = np.einsum("nai,ni->na", rows.direction, places[rows.frame, rows.marker])
    return rows, -at / lengths[rows.frame, None]


def rows_of(view: AnyView, observed: Observations, places: Floats, lengths: Floats, guess: Floats) -> Rows:
    """Rows of observations in a view.

    Parameters
    ----------
    places, guess : (T, J, 3)
        Where derivatives are taken, and where the rows hold exactly; both only matter for a camera.
    lengths : (T,)
        Metres of a unit of the picture; only matter without a camera.
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
