"""Calibrate a camera from 2-D keypoints of a person of known stature who walks on a level floor.

Camera and walk are estimated together (after Lv, Zhao and Nevatia 2006, who use only heads and feet): focal
length, tilt, roll and height of the camera, and the person's path, heading and phase at knots, with the
cyclic model's bone lengths and curves.  Since feet do not slide, the speed follows from the length of the
steps, which relates depth to width and so determines the focal length.  The maximum of the posterior is found
by Gauss-Newton steps from several focal lengths; its curvature gives the standard deviations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.bindings.estimate import Estimate
from gait.bindings.model import Model
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.motion.footfalls import moved_by_camera
from gait.reproducible import one_thread
from gait.track.walk_fit import WalkFit
from gait.track.walk_model import WalkingBody, WalkModel
from gait.track.walk_start import (
    GIVEN_FOV_SD,
    WALK_WINDOW_S,
    CameraPrior,
    choose_frames,
    find_starts,
    make_camera,
    swap_sides,
)

Array = NDArray[np.float64]

_WORST = 6.0  # squared robust error per coordinate up to which a result is accepted
_POOR = 1.2  # the same, above which left and right may be swapped
_LEAST_RATE = 0.4  # strides per second; a slower person stands
_POOR_FOCAL_SD = 0.2  # relative sd from which the focal length counts as poorly determined
_REJECTED_FOCAL_SD = 1.0  # relative sd of the focal length from which the camera is rejected


@dataclass(frozen=True)
class Calibration:
    """A camera estimated from a walk.

    Attributes
    ----------
    camera : Camera
        In its world z is up and the floor is z = 0; the origin is on the floor below the camera, which looks
        along y.
    sd : ndarray of shape (4,)
        Standard deviations of the focal length (relative), tilt, roll (radians) and height (relative).
    tilt, roll : float
        Radians, positive downwards and clockwise.
    time : ndarray of shape (K,)
        Times of the path's knots, seconds.
    path : ndarray of shape (K, 3)
        Position of the pelvis on the floor, metres, and heading, radians.
    path_change : ndarray of shape (K, 3, 4)
        Change of `path` per sd of each of four independent errors of the camera.
    in_place : bool
        The person walks in place, as on a treadmill.
    chi2_per_observation : float
        Squared robust error per coordinate, about 1.
    """

    camera: Camera
    sd: Array
    tilt: float
    roll: float
    time: Array
    path: Array
    path_change: Array
    in_place: bool
    chi2_per_observation: float

    def describe(self) -> list[str]:
        """Describe the camera, and what the walk does not determine; one sentence per line."""
        camera, sd = self.camera, self.sd
        f, height = camera.fx, camera.centre[2]
        fov = 2 * np.degrees(np.arctan(0.5 * camera.width / f))
        lines = [
            f"camera from the walk: focal length {f:.0f} +- {f * sd[0]:.0f} px (view {fov:.0f} deg across), "
            f"tilt {np.degrees(self.tilt):.1f} +- {np.degrees(sd[1]):.1f} deg, "
            f"roll {np.degrees(self.roll):.1f} +- {np.degrees(sd[2]):.1f} deg, "
            f"height {height:.2f} +- {height * sd[3]:.2f} m"
        ]
        if sd[0] > _POOR_FOCAL_SD:
            why = "in place" if self.in_place else "with little change of distance"
            lines.append(
                f"a walk {why} determines the focal length poorly: distances are uncertain by "
                f"{100 * sd[0]:.0f} %; give --fov, or film a walk towards or away from the camera"
            )
        return lines

    def figures(self) -> dict[str, Any]:
        """Return the figures of ``--json``."""
        height = float(self.camera.centre[2])
        scale = np.array([self.camera.fx, np.degrees(1.0), np.degrees(1.0), height])
        values = (self.camera.fx, np.degrees(self.tilt), np.degrees(self.roll), height)
        names = ("focal_px", "tilt_deg", "roll_deg", "height_m")
        sds = {f"{name}_sd": float(sd) for name, sd in zip(names, scale * self.sd, strict=True)}
        means = {name: float(value) for name, value in zip(names, values, strict=True)}
        return means | sds | {"in_place": self.in_place, "chi2_per_observation": self.chi2_per_observation}

    def widened(self, time: float, estimate: Estimate) -> Estimate:
        """Add the uncertainty of the camera to the sd of the estimate `time` seconds into the clip."""
        joint_sd = self.joint_sd(np.array([time]), estimate.joints[None], estimate.joint_sd[None])[0]
        x, y, turn = np.linalg.norm(self.change_at(time), axis=1)
        pelvis = np.hypot(estimate.sd.pelvis, [x, y, 0.0])
        sd = replace(estimate.sd, pelvis=pelvis, heading=float(np.hypot(estimate.sd.heading, turn)))
        return replace(estimate, joint_sd=joint_sd, sd=sd)

    def joint_sd(self, time: Array, joints: Array, sd: Array) -> Array:
        """Add the uncertainty of the camera to the standard deviations of joints.

        Parameters
        ----------
        time : ndarray of shape (T,)
            Seconds into the clip.
        joints, sd : ndarray of shape (T, J, 3)
            In the camera's world, metres.

        Returns
        -------
        ndarray of shape (T, J, 3)
            Larger standard deviations, metres.
        """
        here = np.stack([np.interp(time, self.time, column) for column in self.path[:, :2].T], axis=1)
        moved = moved_by_camera(self._path_change(time)[:, None], joints[..., :2] - here[:, None])
        wider = np.linalg.norm(moved, axis=3)
        return np.asarray(np.hypot(sd, np.pad(wider, ((0, 0), (0, 0), (0, 1)))))

    def change_at(self, time: float) -> Array:
        """Return `path_change` at `time` seconds into the clip: shape (3, 4)."""
        return self._path_change(np.array([time]))[0]

    def _path_change(self, time: Array) -> Array:
        """Interpolate `path_change` at times (T,): shape (T, 3, 4)."""
        columns = self.path_change.reshape(len(self.time), -1).T
        at = np.stack([np.interp(time, self.time, column) for column in columns], axis=1)
        return at.reshape(len(time), 3, 4)


def calibrate(
    keypoints: Keypoints,
    size: tuple[int, int],
    model: Model,
    height: float,
    *,
    fov: float | None = None,
    fov_sd: float = GIVEN_FOV_SD,
    near: CameraPrior | None = None,
    where: str = "keypoints",
) -> Calibration:
    """Estimate the camera from the keypoints of a walking person.

    Parameters
    ----------
    keypoints : Keypoints
        Keypoints of one person, pixels, from a camera that does not move.
    size : (int, int)
        Width and height of the picture.
    model : Model
        Its cyclic part is used.
    height : float
        The person's stature, metres.
    fov : float, optional
        Horizontal field of view, degrees, as stated by the camera's maker.
    fov_sd : float
        Standard deviation of the logarithm of the focal length computed from `fov`.
    near : CameraPrior, optional
        Prior of the camera, instead of `fov`.
    where : str
        Name of the input in errors.

    Returns
    -------
    Calibration

    Raises
    ------
    UserError
        If a joint is missing, the whole person is visible for less than a second, no second of the keypoints
        fits a walk, the person stands, or the walk does not determine the focal length.
    """
    needed = {"l_hip", "r_hip", "l_ankle", "r_ankle", "l_shoulder", "r_shoulder"}
    if missing := needed - set(keypoints.names):
        raise UserError(
            f"{where}: a camera needs {sorted(missing)[0]}; give keypoints of shoulders to ankles"
        )
    chosen = choose_frames(keypoints)
    if len(chosen.frame) < 8 or chosen.time[-1] - chosen.time[0] < WALK_WINDOW_S - 0.4:
        raise UserError(
            f"{where}: shows the whole person for less than a second; film a walk in full view or give "
            "--camera"
        )
    with one_thread():
        prior = near or CameraPrior.of(size, fov, fov_sd)
        return _calibrate(chosen, size, model, height, prior, where)


def _calibrate(
    chosen: Keypoints, size: tuple[int, int], model: Model, height: float, prior: CameraPrior, where: str
) -> Calibration:
    body = WalkingBody(model, chosen.names)
    best = _first_fit(chosen, size, model, body, height, prior)
    if best is None or best.chi2_per_observation > _POOR:
        # A detector may mistake a person's back for the front.
        other = _first_fit(swap_sides(chosen), size, model, body, height, prior)
        if best is None or (other is not None and other.cost_per_frame < best.cost_per_frame):
            best = other
    if best is None or best.chi2_per_observation > _WORST:
        raise UserError(
            f"{where}: no second of it fits a person who walks; film a walk in full view, or give --camera"
        )
    best.grow()
    if best.rate < _LEAST_RATE:
        raise UserError(f"{where}: the person stands; film a walk in full view, or give --camera")
    found = _result(best, size)
    if found.sd[0] > _REJECTED_FOCAL_SD:
        raise UserError(
            f"{where}: the walk does not determine the focal length; film a walk towards or away from the "
            "camera, or give --camera"
        )
    return found


def _first_fit(
    chosen: Keypoints,
    size: tuple[int, int],
    model: Model,
    body: WalkingBody,
    height: float,
    prior: CameraPrior,
) -> WalkFit | None:
    """Return the best fit of a part of the clip; None if no start was found."""
    best: WalkFit | None = None
    for start in find_starts(chosen, size, model, height, prior):
        near = start.time - WALK_WINDOW_S / 2, start.time + WALK_WINDOW_S / 2
        expected = WalkModel(chosen, size, body, height, prior, in_place=start.walk.in_place, interval=near)
        fit = WalkFit(expected, start)
        fit.refine(6)
        if best is None or fit.cost_per_frame < best.cost_per_frame:
            best = fit
    return best


def _result(fit: WalkFit, size: tuple[int, int]) -> Calibration:
    """Convert a fit to camera, path, and changes of the path with the camera."""
    covariance, first = fit.covariance(), fit.model.fixed
    camera = covariance[:4, :4]
    root = np.linalg.cholesky(camera)
    # Part of the path's covariance that is due to the camera: S_pc S_cc^-1 S_cp = D D'.
    path_change = np.linalg.solve(root, covariance[:4, first:]).T.reshape(-1, 4, 4)[:, :3]
    return Calibration(
        make_camera(fit.q[:4], size),
        np.sqrt(np.diag(camera)),
        float(fit.q[1]),
        float(fit.q[2]),
        fit.model.knot_time,
        fit.model.knots(fit.q)[:, :3].copy(),
        path_change,
        fit.model.in_place,
        fit.chi2_per_observation,
    )
