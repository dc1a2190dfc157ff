"""Start of the fit of camera and walk: the prior of a camera, and initial cameras and walks.

For each of several focal lengths, tilt and height are estimated from hips and ankles as ends of upright
sticks; with that camera the automatic start is fitted to a second of the walk.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gait.bindings.model import Model
from gait.bindings.start_fit import Hypothesis, StartFit
from gait.body.skeleton import other_sides
from gait.camera.camera import Camera
from gait.detect.profile import picture_height
from gait.errors import GaitError
from gait.io.keypoints_file import Keypoints
from gait.track.keypoint_start import keypoint_noise

Array = NDArray[np.float64]

WALK_WINDOW_S = 1.2  # seconds of walking to start with
RELATIVE_STATURE_SD = 0.015  # of the stature, including shoes
_USUAL_FOV = 65.0  # degrees along the longer side of the picture, of a typical phone
_FOV_SD = 0.45  # of the log focal length; with --fov:
GIVEN_FOV_SD = 0.05
_KNOWN_SD = 0.15  # sd of the log focal length below which a fit starts only from the expected one
_CAMERA_HEIGHT_M, _LOG_HEIGHT_SD = 1.3, 0.5  # metres; sd of the logarithm
_TILT_MEAN, _TILT_SD, _ROLL_SD = 0.05, 0.2, 0.02  # radians
_STICK_SD = 0.025  # relative sd of the height of hips above ankles
_FOCAL_STARTS = (
    0.6,
    0.85,
    1.2,
    2.2,
    4.0,
)  # focal lengths to start from, as multiples of the picture's longer side
_LONGEST_WALK_S = 12.0  # most seconds of a walk that are used
_LEVEL_STEPS, _LEAST_COST_CHANGE = (
    30,
    1e-9,
)  # most steps of the fit of sticks; relative change of cost that ends it
_FPS = 10.0  # frames per second that are used


@dataclass(frozen=True)
class CameraPrior:
    """Mean and standard deviation (4,) of log focal length, tilt, roll and log height."""

    mean: Array
    sd: Array

    @staticmethod
    def of(size: tuple[int, int], fov: float | None, fov_sd: float = GIVEN_FOV_SD) -> CameraPrior:
        """Make the prior of a typical camera, or of one with field of view `fov`, as for `calibrate`."""
        side, angle, sd = (max(size), _USUAL_FOV, _FOV_SD) if fov is None else (size[0], fov, fov_sd)
        focal = 0.5 * side / np.tan(np.radians(angle) / 2)
        return CameraPrior(
            np.array([np.log(focal), _TILT_MEAN, 0.0, np.log(_CAMERA_HEIGHT_M)]),
            np.array([sd, _TILT_SD, _ROLL_SD, _LOG_HEIGHT_SD]),
        )


def make_camera(q: Array, size: tuple[int, int]) -> Camera:
    """Make a camera from log focal length [px], tilt, roll [rad] and log height [m]."""
    (focal, tilt, roll, height), (width, tall) = q, size
    ct, st, cr, sr = np.cos(tilt), np.sin(tilt), np.cos(roll), np.sin(roll)
    level = np.array([[1, 0, 0], [0, -st, -ct], [0, ct, -st]])
    R = np.array([[cr, sr, 0], [-sr, cr, 0], [0, 0, 1]]) @ level
    f = float(np.exp(focal))
    return Camera(
        width, tall, f, f, (width - 1) / 2, (tall - 1) / 2, R, -R @ np.array([0, 0, np.exp(height)])
    )


def usual_camera(size: tuple[int, int], fov: float | None = None) -> Camera:
    """Make the camera expected before anything is known, `fov` as in `calibrate`."""
    return make_camera(CameraPrior.of(size, fov).mean, size)


def choose_frames(keypoints: Keypoints) -> Keypoints:
    """Choose frames with hips and ankles from the `_LONGEST_WALK_S` seconds in which size varies most."""
    legs = [keypoints.names.index(name) for name in ("l_hip", "r_hip", "l_ankle", "r_ankle")]
    whole = np.isfinite(keypoints.uv[:, legs]).all(axis=(1, 2))
    time = keypoints.time[whole]
    rows = np.flatnonzero(whole)
    if len(rows) > 1:
        step = max(1, round(1.0 / _FPS / max(float(np.median(np.diff(time))), 1e-6)))
        rows = rows[::step]
        time = keypoints.time[rows]
        if time[-1] - time[0] > _LONGEST_WALK_S:
            size = picture_height(keypoints)[rows]
            begin = max(
                time[time <= time[-1] - _LONGEST_WALK_S],
                key=lambda t: np.ptp(
                    np.log(np.maximum(size[(time >= t) & (time <= t + _LONGEST_WALK_S)], 1.0))
                ),
            )
            rows = rows[(time >= begin) & (time <= begin + _LONGEST_WALK_S)]
    return Keypoints(
        keypoints.frame[rows], keypoints.time[rows], keypoints.names, keypoints.uv[rows],
        keypoints.confidence[rows],
    )  # fmt: skip


def swap_sides(keypoints: Keypoints, rows: NDArray[np.bool_] | None = None) -> Keypoints:
    """Swap left and right, in all frames or in those of `rows` (T,)."""
    columns = other_sides(keypoints.names)
    chosen = np.ones(len(keypoints.time), bool) if rows is None else rows
    return replace(
        keypoints,
        uv=np.where(chosen[:, None, None], keypoints.uv[:, columns], keypoints.uv),
        confidence=np.where(chosen[:, None], keypoints.confidence[:, columns], keypoints.confidence),
    )


@dataclass
class WalkStart:
    """Start of a fit: camera, and the walk around a time."""

    camera: Array
    walk: Hypothesis
    time: float


def find_starts(
    keypoints: Keypoints, size: tuple[int, int], model: Model, height: float, prior: CameraPrior
) -> list[WalkStart]:
    """Fit windows of the clip with cameras of several focal lengths, or of the expected one if known."""
    noise = keypoint_noise(keypoints)
    found = []
    span = keypoints.time[-1] - keypoints.time[0]
    middles = np.unique(np.round(keypoints.time[0] + span * np.array([0.3, 0.5, 0.75]), 3))
    for share in _FOCAL_STARTS:
        q = prior.mean.copy()
        if prior.sd[0] > _KNOWN_SD:
            q[0] = np.log(share * max(size))
        q = _level(q, keypoints, size, height, prior)
        best: WalkStart | None = None
        for middle in middles:
            fit = StartFit(
                model, make_camera(q, size), stature=height, stature_sd=RELATIVE_STATURE_SD * height
            )
            near = np.abs(keypoints.time - middle) <= 0.5 * WALK_WINDOW_S
            for frame, time in zip(keypoints.frame[near], keypoints.time[near], strict=True):
                fit.add(round(1e6 * time), noise[int(frame)])
            try:
                walks = fit.solve(round(1e6 * middle))
            except GaitError:
                continue
            walk = next((one for one in walks if one.mean.motion_class == 0), None)  # as of the fit
            if walk is None:
                continue
            if best is None or walk.chi2_per_observation < best.walk.chi2_per_observation:
                best = WalkStart(q, walk, middle)
        if best is not None:
            found.append(best)
        if prior.sd[0] <= _KNOWN_SD:
            break
    return found


def _level(q: Array, keypoints: Keypoints, size: tuple[int, int], height: float, prior: CameraPrior) -> Array:
    """Estimate tilt and height of a camera of given focal length, from hips and ankles as upright sticks."""
    names = keypoints.names
    hip, ankle = (
        np.mean([keypoints.uv[:, names.index(f"{side}_{joint}")] for side in "lr"], axis=0)
        for joint in ("hip", "ankle")
    )
    q, tall = q.copy(), np.maximum(picture_height(keypoints), 1.0)

    def residuals(p: Array) -> Array:
        camera = make_camera(np.array([q[0], p[0], 0.0, p[1]]), size)
        foot = camera.on_plane(ankle, 0.06 * height)
        top = camera.project(foot + [0.0, 0.0, 0.46 * height])
        off = (top - hip)[:, 1] / tall
        off = np.where(np.isfinite(off), off, 1.5)
        return np.concatenate(
            [off / _STICK_SD / np.sqrt(len(off)) * 3, (p - prior.mean[[1, 3]]) / prior.sd[[1, 3]]]
        )

    starts = [_descent(residuals, np.array([tilt, np.log(_CAMERA_HEIGHT_M)])) for tilt in (0.05, 0.4)]
    q[1], q[3] = min(starts, key=lambda p: float(np.sum(residuals(p) ** 2)))
    return q


def _descent(residuals: Callable[[Array], Array], p: Array) -> Array:
    """Solve least squares from `p` by Levenberg-Marquardt; importing SciPy would take longer than this."""
    cost, damping, h = float(np.sum(residuals(p) ** 2)), 1e-3, 1e-6
    for _ in range(_LEVEL_STEPS):
        here = residuals(p)
        slope = np.stack([(residuals(p + h * axis) - here) / h for axis in np.eye(len(p))], axis=1)
        matrix = slope.T @ slope
        step = np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), -slope.T @ here)
        now = float(np.sum(residuals(p + step) ** 2))
        if abs(cost - now) <= _LEAST_COST_CHANGE * cost:
            break
        p, cost, damping = (p + step, now, 0.2 * damping) if now < cost else (p, cost, 6.0 * damping)
    return p
