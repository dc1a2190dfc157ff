"""Calibrate a camera from 2-D keypoints of a person of known stature who walks on a level floor.

One Bayesian estimate of camera and walk (after Lv, Zhao and Nevatia 2006, who use heads and feet alone):
focal length, tilt, roll and height of the camera, and the person's path, heading and phase at knots, with
the cyclic model's bone lengths and curves.  Feet that do not slide tie the speed to the length of the steps,
which relates depth to width and so determines the focal length.  The maximum of the posterior is found by
Gauss-Newton steps from several focal lengths; its curvature gives the standard deviations.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.bindings.estimate import Estimate
from gait.bindings.model import Model
from gait.bindings.start_fit import Hypothesis, StartFit
from gait.bindings.state import State
from gait.camera.camera import Camera
from gait.errors import GaitError, UserError
from gait.io.keypoints_file import Keypoints
from gait.reproducible import one_thread
from gait.track.keypoint_start import keypoint_noise

Array = NDArray[np.float64]

_USUAL_FOV = 65.0  # degrees along the longer side of the picture, of a usual phone
_FOV_SD = 0.45  # of the focal length's logarithm; of --fov:
_GIVEN_FOV_SD = 0.05
_HEIGHT, _HEIGHT_SD = 1.3, 0.5  # metres; of the logarithm
_TILT, _TILT_SD, _ROLL_SD = 0.05, 0.2, 0.02  # radians
_STATURE_SD = 0.015  # of the stature, with shoes
_STARTS = (0.6, 0.85, 1.2, 2.2, 4.0)  # focal lengths to start from, longer sides of the picture
_WINDOW = 1.2  # seconds of walking to start with
_GROWTH = 1.0  # seconds by which the fitted part grows at either end
_LONGEST = 12.0  # seconds of a walk that are used
_RATE = 10.0  # frames per second that are used
_ERROR_TIME = 0.5  # seconds for which errors of a detector last
_KNOTS = 0.5  # seconds between knots
_MISS = 0.012  # of the person's height, noise of a joint at full confidence
_SHARE = {"elbow": 2.0, "wrist": 4.0, "toe": 2.5, "heel": 2.0}  # noise of these joints, in units of _MISS
_OFFSET_SD = 0.015  # of the stature, constant difference between the detector's joints and the model's
_SLIDE_SD = 0.05  # metres per second, of feet on the floor, along the heading
_SIDEWAYS_SD = 0.05  # metres per second, of the walk across the heading
_STILL_SD = 0.03  # metres per second on a treadmill
_BEND_SD, _TURN_SD, _HURRY_SD = 0.05, 0.12, 0.02  # changes of slope at a knot: metres, radians, strides
_CURVE_SD = 0.3  # radians per second, of the turn on average
_SCORES = 5  # components of the model that are fitted
_DEGREES = 4.0  # of freedom of Student's t
_FITS = 9.0  # squared robust error per coordinate up to which more of the clip fits the walk
_WORST = 6.0  # and up to which the result is accepted
_CONTRADICTS = 0.1  # of the stature, by which a person who appears taller or shorter contradicts a camera
_LEAST_RATE = 0.4  # strides per second of a person who walks
_UNKNOWN = 0.2  # relative standard deviation from which the focal length counts as not determined


@dataclass(frozen=True)
class Calibration:
    """A camera found from a walk.

    Attributes
    ----------
    camera : Camera
        Its world has z up and the floor at z = 0; the origin is on the floor below the camera, which looks
        along y.
    sd : ndarray of shape (4,)
        Standard deviations of the focal length (relative), tilt, roll (radians) and height (relative).
    tilt, roll : float
        Radians, positive downwards and clockwise.
    time : ndarray of shape (K,)
        Seconds, of the knots of the path.
    path : ndarray of shape (K, 3)
        Place of the pelvis on the floor, metres, and heading, radians.
    path_change : ndarray of shape (K, 3, 4)
        Change of `path` with each of the four, if each is in its standard deviations and they are
        independent.
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
        """Describe the camera, and what the walk does not determine, one sentence a line."""
        camera, sd = self.camera, self.sd
        f, height = camera.fx, camera.centre[2]
        fov = 2 * np.degrees(np.arctan(0.5 * camera.width / f))
        lines = [
            f"camera from the walk: focal length {f:.0f} +- {f * sd[0]:.0f} px (view {fov:.0f} deg across), "
            f"tilt {np.degrees(self.tilt):.1f} +- {np.degrees(sd[1]):.1f} deg, "
            f"roll {np.degrees(self.roll):.1f} +- {np.degrees(sd[2]):.1f} deg, "
            f"height {height:.2f} +- {height * sd[3]:.2f} m"
        ]
        if sd[0] > _UNKNOWN:
            why = "in place" if self.in_place else "with little change of distance"
            lines.append(
                f"a walk {why} determines the focal length poorly: distances are uncertain by "
                f"{100 * sd[0]:.0f} %; give --fov, or film a walk towards or away from the camera"
            )
        return lines

    def figures(self) -> dict[str, Any]:
        """Give the figures of ``--json``."""
        height = float(self.camera.centre[2])
        scale = np.array([self.camera.fx, np.degrees(1.0), np.degrees(1.0), height])
        values = (self.camera.fx, np.degrees(self.tilt), np.degrees(self.roll), height)
        names = ("focal_px", "tilt_deg", "roll_deg", "height_m")
        sds = {f"{name}_sd": float(sd) for name, sd in zip(names, scale * self.sd, strict=True)}
        means = {name: float(value) for name, value in zip(names, values, strict=True)}
        return means | sds | {"in_place": self.in_place, "chi2_per_observation": self.chi2_per_observation}

    def widened(self, time: float, estimate: Estimate) -> Estimate:
        """Add the uncertainty of the camera to the sd of an estimate, `time` seconds into the clip."""
        at = [np.interp(time, self.time, column) for column in self.path_change.reshape(len(self.time), -1).T]
        change = np.reshape(at, (3, 4))
        here = [np.interp(time, self.time, column) for column in self.path[:, :2].T]
        off = estimate.joints[:, :2] - here
        x = np.linalg.norm(change[0] - off[:, 1:] * change[2], axis=1)
        y = np.linalg.norm(change[1] + off[:, :1] * change[2], axis=1)
        joint_sd = np.hypot(estimate.joint_sd, np.stack([x, y, np.zeros(len(x))], axis=1))
        x, y, turn = np.linalg.norm(change, axis=1)
        pelvis = np.hypot(estimate.sd.pelvis, [x, y, 0.0])
        sd = replace(estimate.sd, pelvis=pelvis, heading=float(np.hypot(estimate.sd.heading, turn)))
        return replace(estimate, joint_sd=joint_sd, sd=sd)


def calibrate(
    keypoints: Keypoints,
    size: tuple[int, int],
    model: Model,
    height: float,
    *,
    fov: float | None = None,
    where: str = "keypoints",
) -> Calibration:
    """Find the camera from the keypoints of a walking person.

    Parameters
    ----------
    keypoints : Keypoints
        Of one person, pixels; the camera does not move.
    size : (int, int)
        Width and height of the picture.
    model : Model
        Its cyclic part.
    height : float
        The person's stature, metres.
    fov : float, optional
        Horizontal field of view, degrees, as the camera's maker gives it.
    where : str
        Name of the input in errors.

    Returns
    -------
    Calibration

    Raises
    ------
    UserError
        If a joint is missing, the whole person is visible for less than a second, no second of the keypoints
        fits a walk, or the person stands.
    """
    needed = {"l_hip", "r_hip", "l_ankle", "r_ankle", "l_shoulder", "r_shoulder"}
    if missing := needed - set(keypoints.names):
        raise UserError(
            f"{where}: a camera needs {sorted(missing)[0]}; give keypoints of shoulders to ankles"
        )
    chosen = _choose(keypoints)
    if len(chosen.frame) < 8 or chosen.time[-1] - chosen.time[0] < _WINDOW - 0.4:
        raise UserError(
            f"{where}: shows the whole person for less than a second; film a walk in full view or give "
            "--camera"
        )
    with one_thread():
        return _calibrate(chosen, size, model, height, _Prior.of(size, fov), where)


def _calibrate(
    chosen: Keypoints, size: tuple[int, int], model: Model, height: float, prior: _Prior, where: str
) -> Calibration:
    body = _Body(model, chosen.names)
    best: _Fit | None = None
    for start in _starts(chosen, size, model, height, prior):
        fit = _Fit(chosen, size, body, height, prior, start)
        fit.refine(6)
        if best is None or fit.cost_per_frame < best.cost_per_frame:
            best = fit
    if best is None or best.chi2_per_observation > _WORST:
        raise UserError(
            f"{where}: no second of it fits a person who walks; film a walk in full view, or give --camera"
        )
    found = best.grow().result()
    if best.rate < _LEAST_RATE:
        raise UserError(f"{where}: the person stands; film a walk in full view, or give --camera")
    return found


def contradiction(
    given: Camera, appears: float | None, keypoints: Keypoints, model: Model, height: float
) -> str | None:
    """Report how a given camera contradicts a walk, and which camera would fit; None: it does not.

    Parameters
    ----------
    given : Camera
    appears : float or None
        Stature of the person by this camera, metres; None: no walk on the floor fits.
    keypoints, model, height
        As for `calibrate`.
    """
    if appears is not None and abs(appears / height - 1) < _CONTRADICTS:
        return None
    try:
        fits = calibrate(keypoints, given.size, model, height)
    except UserError:
        return None
    what = "no walk fits it" if appears is None else f"the person appears {appears:.2f} m tall by it"
    return (
        f"{what}, --height is {height:g}; check its focal length ({given.fx:.0f} px) and place "
        f"({given.centre[2]:.2f} m high): {fits.describe()[0]}"
    )


def _choose(keypoints: Keypoints) -> Keypoints:
    """Choose frames with hips and ankles, thinned, of the `_LONGEST` seconds whose size changes most."""
    legs = [keypoints.names.index(name) for name in ("l_hip", "r_hip", "l_ankle", "r_ankle")]
    whole = np.isfinite(keypoints.uv[:, legs]).all(axis=(1, 2))
    time = keypoints.time[whole]
    rows = np.flatnonzero(whole)
    if len(rows) > 1:
        step = max(1, round(1.0 / _RATE / max(float(np.median(np.diff(time))), 1e-6)))
        rows = rows[::step]
        time = keypoints.time[rows]
        if time[-1] - time[0] > _LONGEST:
            size = np.ptp(keypoints.uv[rows][:, legs, 1], axis=1)
            begin = max(
                time[time <= time[-1] - _LONGEST],
                key=lambda t: np.ptp(np.log(np.maximum(size[(time >= t) & (time <= t + _LONGEST)], 1.0))),
            )
            rows = rows[(time >= begin) & (time <= begin + _LONGEST)]
    return Keypoints(
        keypoints.frame[rows], keypoints.time[rows], keypoints.names, keypoints.uv[rows],
        keypoints.confidence[rows],
    )  # fmt: skip


def _heavy_tailed(residual: Array) -> Array:
    """Residuals whose squares are Student-t costs: unusual cameras are not pulled to the usual one."""
    root = np.sqrt(_DEGREES * np.log1p(residual**2 / _DEGREES))
    return np.asarray(np.sign(residual) * root)


@dataclass(frozen=True)
class _Prior:
    """Mean and standard deviation of log focal length, tilt, roll and log height."""

    mean: Array
    sd: Array

    @staticmethod
    def of(size: tuple[int, int], fov: float | None) -> _Prior:
        side, angle, sd = (max(size), _USUAL_FOV, _FOV_SD) if fov is None else (size[0], fov, _GIVEN_FOV_SD)
        focal = 0.5 * side / np.tan(np.radians(angle) / 2)
        return _Prior(
            np.array([np.log(focal), _TILT, 0.0, np.log(_HEIGHT)]),
            np.array([sd, _TILT_SD, _ROLL_SD, _HEIGHT_SD]),
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
    return make_camera(_Prior.of(size, fov).mean, size)


class _Body:
    """Joints of the model over the stride, statures, linear in scores and proportions; pelvis at (0, 0)."""

    PHASES = 60

    def __init__(self, model: Model, names: tuple[str, ...]) -> None:
        self.names = [name for name in names if name in model.joint_names]
        self.columns = [names.index(name) for name in self.names]
        rows = [model.joint_names.index(name) for name in self.names]
        base, sd = model.prior()
        base = replace(base, stature=1.0, heading=0.0)
        width = model.info.proportions
        scores = min(_SCORES, model.info.components)
        states = [base]
        for k in range(scores):
            states.append(replace(base, coef=np.eye(model.info.components)[k]))
        for k in range(width):
            states.append(replace(base, proportion=np.eye(len(sd.proportion))[k]))
        states.append(replace(base, stride_hz=base.stride_hz + model.info.stride_hz_sd))
        table = np.array([self._cycle(model, state) for state in states])
        table[1:] -= table[0]
        # The pelvis sways: it moves from side to side and unevenly forwards over the foot on the floor.
        velocity = self._over_foot(table, model.joint_names)
        backwards = velocity[..., 0].mean(axis=1)
        way = np.cumsum(velocity - velocity.mean(axis=1, keepdims=True), axis=1) / self.PHASES
        table[..., :2] += (way - way.mean(axis=1, keepdims=True))[:, :, None]
        self.table = table[:, :, rows]
        self.parts = len(states) - 2  # scores and proportions
        self.rate, self.rate_sd = model.info.stride_hz, model.info.stride_hz_sd
        # The ankle rolls forward over the foot, so it goes back more slowly than the floor.
        self.stride = backwards * model.info.stride_length / backwards[0]
        self.offsets = 3 * len(self.names)  # of the detector's joints: forward, left, up

    def _cycle(self, model: Model, state: State) -> Array:
        out = np.empty((self.PHASES, model.info.joints, 3))
        for k in range(self.PHASES):
            posed = replace(state, phase=k / self.PHASES)
            posed.pelvis[:] = 0.0
            posed.pelvis[2] = model.pelvis_height(posed)
            out[k] = model.pose(posed)[0]
        return out

    def _over_foot(self, table: Array, names: tuple[str, ...]) -> Array:
        """Velocity (rows, PHASES, 2) of the pelvis over the foot on the floor, statures per stride.

        Each foot is flat for a third of the stride; in between the velocity is interpolated.
        """
        phase = np.arange(self.PHASES) / self.PHASES
        flat = [(names.index("r_ankle"), 0.10, 0.40), (names.index("l_ankle"), 0.60, 0.90)]
        speed = -self.PHASES * (np.roll(table, -1, axis=1) - np.roll(table, 1, axis=1))[..., :2] / 2
        known = [(phase >= low) & (phase <= high) for _, low, high in flat]
        at = np.concatenate([phase[rows] for rows in known])
        over = np.concatenate(
            [speed[:, rows, joint] for rows, (joint, _, _) in zip(known, flat, strict=True)], axis=1
        )
        columns = [
            np.interp(phase, at, column, period=1.0) for column in over.swapaxes(1, 2).reshape(-1, len(at))
        ]
        return np.reshape(columns, (len(table), 2, -1)).swapaxes(1, 2)

    def weights(self, parts: Array, rate: Array) -> Array:
        """Weights (T, parts + 2) of the table's rows: mean, scores and proportions, stride rate."""
        faster = np.clip((rate - self.rate) / self.rate_sd, -2.0, 2.0)
        return np.concatenate(
            [np.ones((len(rate), 1)), np.broadcast_to(parts, (len(rate), self.parts)), faster[:, None]],
            axis=1,
        )

    def joints(self, phase: Array, rate: Array, parts: Array, offsets: Array) -> Array:
        """Joints (T, J, 3), statures."""
        place = (phase % 1.0) * self.PHASES
        left = np.floor(place).astype(int) % self.PHASES
        share = (place - np.floor(place))[:, None, None]
        weights = self.weights(parts, rate)
        cycle = np.tensordot(weights[:1, :-1], self.table[:-1], axes=(1, 0))[0]  # parts are constant
        out = cycle[left] * (1 - share) + cycle[(left + 1) % self.PHASES] * share
        out = out + weights[:, -1, None, None] * self.table[-1, left]
        return np.asarray(out + offsets.reshape(-1, 3))

    def strides(self, rate: Array, parts: Array) -> Array:
        """Stride lengths, statures."""
        return np.asarray(self.weights(parts, rate) @ self.stride)


@dataclass
class _Start:
    """Where a fit begins: camera, and the walk about a time."""

    camera: Array
    walk: Hypothesis
    time: float


def _starts(
    keypoints: Keypoints, size: tuple[int, int], model: Model, height: float, prior: _Prior
) -> list[_Start]:
    """Fit windows of the clip with the camera at several focal lengths."""
    noise = keypoint_noise(keypoints)
    found = []
    span = keypoints.time[-1] - keypoints.time[0]
    middles = np.unique(np.round(keypoints.time[0] + span * np.array([0.3, 0.5, 0.75]), 3))
    for share in _STARTS:
        q = prior.mean.copy()
        if prior.sd[0] > _GIVEN_FOV_SD:
            q[0] = np.log(share * max(size))
        q = _level(q, keypoints, size, height, prior)
        best: _Start | None = None
        for middle in middles:
            fit = StartFit(model, make_camera(q, size), stature=height, stature_sd=_STATURE_SD * height)
            near = np.abs(keypoints.time - middle) <= 0.5 * _WINDOW
            for frame, time in zip(keypoints.frame[near], keypoints.time[near], strict=True):
                fit.add(round(1e6 * time), noise[int(frame)])
            try:
                walk = fit.solve(round(1e6 * middle))[0]
            except GaitError:
                continue
            if best is None or walk.chi2_per_observation < best.walk.chi2_per_observation:
                best = _Start(q, walk, middle)
        if best is not None:
            found.append(best)
        if prior.sd[0] <= _GIVEN_FOV_SD:
            break
    return found


def _level(q: Array, keypoints: Keypoints, size: tuple[int, int], height: float, prior: _Prior) -> Array:
    """Tilt and height of the camera, at a given focal length, from hips and ankles as upright sticks."""
    names = keypoints.names
    hip, ankle = (
        np.mean([keypoints.uv[:, names.index(f"{side}_{joint}")] for side in "lr"], axis=0)
        for joint in ("hip", "ankle")
    )
    q = q.copy()

    def residuals(p: Array) -> Array:
        camera = make_camera(np.array([q[0], p[0], 0.0, p[1]]), size)
        foot = camera.on_plane(ankle, 0.06 * height)
        top = camera.project(foot + [0.0, 0.0, 0.46 * height])
        off = (top - hip)[:, 1] / np.median(np.abs(hip - ankle)[:, 1])
        off = np.where(np.isfinite(off), off, 3.0)
        return np.concatenate(
            [off / 0.05 / np.sqrt(len(off)) * 3, (p - prior.mean[[1, 3]]) / prior.sd[[1, 3]]]
        )

    from scipy.optimize import least_squares  # here, as it takes a second to load

    starts = [least_squares(residuals, [tilt, np.log(_HEIGHT)]) for tilt in (0.05, 0.4)]
    q[1], q[3] = min(starts, key=lambda fit: float(fit.cost)).x
    return q


class _Fit:
    """Camera and walk over a part of the clip; parameters q: camera 4, stature, parts, offsets, knots x 4."""

    def __init__(
        self,
        keypoints: Keypoints,
        size: tuple[int, int],
        body: _Body,
        height: float,
        prior: _Prior,
        start: _Start,
    ) -> None:
        self._all, self._size, self._body, self._height, self._prior = keypoints, size, body, height, prior
        self._in_place = start.walk.in_place
        self._fixed = 5 + body.parts + body.offsets
        state = start.walk.mean
        self._use(start.time - _WINDOW / 2, start.time + _WINDOW / 2)
        ahead = self._time - start.time
        speed = 0.0 if self._in_place else start.walk.speed
        knots = np.stack([
            state.pelvis[0] + speed * ahead * np.cos(state.heading),
            state.pelvis[1] + speed * ahead * np.sin(state.heading),
            np.full(len(ahead), state.heading),
            state.phase + state.stride_hz * ahead,
        ], axis=1)  # fmt: skip
        self._q = np.concatenate([start.camera, np.zeros(self._fixed - 4), knots.ravel()])

    def _use(self, low: float, high: float) -> None:
        """Choose the frames of an interval, and its knots."""
        time = self._all.time
        self._rows = np.flatnonzero((time >= low) & (time <= high))
        t = time[self._rows]
        count = max(2, int(np.ceil((t[-1] - t[0]) / _KNOTS)) + 1)
        self._time = np.linspace(t[0], t[-1], count)
        self._t = t
        uv, names = self._all.uv[self._rows][:, self._body.columns], self._body.names
        legs = [self._all.names.index(f"{side}_{joint}") for side in "lr" for joint in ("hip", "ankle")]
        ends = self._all.uv[self._rows][:, legs]
        tall = np.hypot(*(ends[:, 0::2].mean(axis=1) - ends[:, 1::2].mean(axis=1)).T) / 0.45
        tall = np.maximum(tall, 0.5 * np.median(tall))
        share = np.array([_SHARE.get(name.partition("_")[2], 1.0) for name in names])
        sure = np.maximum(self._all.confidence[self._rows][:, self._body.columns], 0.1)
        sd = _MISS * tall[:, None] * share / sure + 0.5
        self._inverse = np.where(np.isfinite(uv).all(axis=2), 1.0 / sd, 0.0)
        self._uv = np.nan_to_num(uv)
        step = float(np.median(np.diff(t)))
        self._thin = min(1.0, step / _ERROR_TIME)  # errors last

    def _knots(self, q: Array) -> Array:
        """Knots (K, 4): x, y, metres; heading, radians; phase."""
        return q[self._fixed :].reshape(-1, 4)

    def _errors(self, q: Array) -> Array:
        """Errors of the keypoints (T, J, 2), in standard deviations."""
        now = np.stack([np.interp(self._t, self._time, column) for column in self._knots(q).T], axis=1)
        rates = np.interp(self._t, self._middles(), self._rates(q))
        joints = self._joints(q, now, rates)
        camera = make_camera(q[:4], self._size)
        x = joints @ camera.R.T + camera.t
        depth = np.maximum(x[..., 2:], 0.05)
        uv = camera.fx * x[..., :2] / depth + [camera.cx, camera.cy]
        return np.asarray((uv - self._uv) * self._inverse[..., None])

    def _joints(self, q: Array, now: Array, rates: Array) -> Array:
        """Joints (T, J, 3) in the world, metres, with the path `now` (T, 4) and the stride rates (T,)."""
        body, stature = self._body, self._height * np.exp(q[4])
        parts, offsets = q[5 : 5 + body.parts], q[5 + body.parts : self._fixed]
        local = stature * body.joints(now[:, 3], rates, parts, offsets)
        c, s = np.cos(now[:, 2])[:, None], np.sin(now[:, 2])[:, None]
        return np.stack([
            now[:, 0, None] + c * local[..., 0] - s * local[..., 1],
            now[:, 1, None] + s * local[..., 0] + c * local[..., 1],
            local[..., 2],
        ], axis=-1)  # fmt: skip

    def _middles(self) -> Array:
        """Return the times midway between knots (K - 1,), seconds."""
        return np.asarray((self._time[1:] + self._time[:-1]) / 2)

    def _rates(self, q: Array) -> Array:
        """Stride rates between knots (K - 1,), hertz."""
        return np.asarray(np.diff(self._knots(q)[:, 3]) / np.diff(self._time))

    def _expected(self, q: Array) -> Array:
        """Residuals of what is expected of camera and walk."""
        body, knots = self._body, self._knots(q)
        step = np.diff(self._time)
        velocity = np.diff(knots[:, :2], axis=0) / step[:, None]
        heading = (knots[1:, 2] + knots[:-1, 2]) / 2
        ahead = velocity[:, 0] * np.cos(heading) + velocity[:, 1] * np.sin(heading)
        aside = velocity[:, 1] * np.cos(heading) - velocity[:, 0] * np.sin(heading)
        rates = self._rates(q)
        parts, offsets = q[5 : 5 + body.parts], q[5 + body.parts : self._fixed]
        if self._in_place:
            speed = [ahead / _STILL_SD, aside / _STILL_SD]
        else:
            usual = body.strides(rates, parts) * self._height * np.exp(q[4]) * rates
            many = np.sqrt(len(step))  # one uncertainty of the whole walk
            speed = [(ahead - usual) / _SLIDE_SD / many, aside / _SIDEWAYS_SD / many]
        faster = np.diff(np.stack([ahead, aside], axis=1), axis=0) * np.diff(self._middles())[:, None]
        bends = np.diff(knots[:, 2:], 2, axis=0) / np.array([_TURN_SD, _HURRY_SD])
        return np.concatenate([
            _heavy_tailed((q[:4] - self._prior.mean) / self._prior.sd),
            [q[4] / _STATURE_SD],
            parts,
            offsets / _OFFSET_SD,
            *speed,
            (rates - body.rate) / (2 * body.rate_sd) / np.sqrt(len(rates)),
            faster.ravel() / _BEND_SD,
            bends.ravel(),
            [(knots[-1, 2] - knots[0, 2]) / (self._time[-1] - self._time[0]) / _CURVE_SD],
        ])  # fmt: skip

    def _cost(self, q: Array) -> float:
        """Minus twice the log posterior, up to a constant."""
        return float(self._thin * self._robust(q).sum() + (self._expected(q) ** 2).sum())

    def _robust(self, q: Array) -> Array:
        """Student-t costs of the keypoints (T, J)."""
        square = (self._errors(q) ** 2).sum(axis=2)
        return np.asarray(_DEGREES * np.log1p(square / _DEGREES))

    @property
    def rate(self) -> float:
        """Strides per second, on average."""
        return float(self._rates(self._q).mean())

    @property
    def chi2_per_observation(self) -> float:
        """Squared robust error per coordinate."""
        return float(np.mean(self._frame_chi2()))

    def _frame_chi2(self) -> Array:
        """Squared robust error per coordinate in each frame (T,)."""
        robust = self._robust(self._q)
        return np.asarray(robust.sum(axis=1) / np.maximum(2 * (self._inverse > 0).sum(axis=1), 1))

    @property
    def cost_per_frame(self) -> float:
        """Cost by which fits of different windows of the clip are compared."""
        return self._cost(self._q) / len(self._rows)

    def _normal(self, q: Array) -> tuple[Array, Array]:
        """Form the normal equations: matrix and gradient."""
        errors, expected = self._errors(q), self._expected(q)
        weight = np.sqrt(self._thin / (1.0 + (errors**2).sum(axis=2, keepdims=True) / _DEGREES))
        data = np.zeros((*errors.shape, len(q)))
        prior = np.empty((len(expected), len(q)))
        h = 1e-5
        for columns, share in self._groups():
            moved = q.copy()
            moved[columns] += h
            change = (self._errors(moved) - errors) * (weight / h)
            data[..., columns] = change[..., None] * share
        own = np.arange(self._fixed - self._body.offsets, self._fixed)  # each offset is expected by itself
        prior[:, own] = 0.0
        prior[own, own] = 1.0 / _OFFSET_SD
        for k in np.delete(np.arange(len(q)), own):
            moved = q.copy()
            moved[k] += h
            prior[:, k] = (self._expected(moved) - expected) / h
        data = data.reshape(-1, len(q))
        gradient = data.T @ (weight * errors).ravel() + prior.T @ expected
        return data.T @ data + prior.T @ prior, gradient

    def _groups(self) -> Iterator[tuple[NDArray[np.int64], Array]]:
        """Give parameters whose effects do not overlap, and which errors (T, J, 2, columns) each changes."""
        plain = self._fixed - self._body.offsets
        for k in range(plain):
            yield np.array([k]), np.ones(1)
        joints = np.eye(len(self._body.names))[:, None]
        for axis in range(3):
            yield np.arange(plain + axis, self._fixed, 3), joints
        knots = np.arange(len(self._time))
        at = np.interp(self._t, self._time, knots)
        for first in range(min(4, len(knots))):  # a knot changes what is less than two knots away
            chosen = knots[first::4]
            near = (np.abs(at[:, None] - chosen) < 2.0)[:, None, None].astype(float)
            for kind in range(4):
                yield self._fixed + 4 * chosen + kind, near

    def refine(self, most: int) -> None:
        """Take steps of Levenberg and Marquardt."""
        cost, damping = self._cost(self._q), 1e-3
        for _ in range(most):
            matrix, gradient = self._normal(self._q)
            before = cost
            for _ in range(5):
                step = np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), -gradient)
                trial = self._q + step
                if np.abs(step[:4]).max() < 2.0 and (now := self._cost(trial)) < cost:
                    self._q, cost = trial, now
                    damping *= 0.2
                    break
                damping *= 6.0
            if before - cost < 1e-3 * (1.0 + cost):
                break

    def grow(self) -> _Fit:
        """Extend the fit by a second at a time at either end, as long as the new frames fit the walk."""
        low, high = self._t[0], self._t[-1]
        open_ = {-1, 1}
        while open_:
            before, ends = (self._q.copy(), self._time), (low, high)
            low = max(self._all.time[0], low - _GROWTH) if -1 in open_ else low
            high = min(self._all.time[-1], high + _GROWTH) if 1 in open_ else high
            self._extend(low, high, *before)
            self.refine(4)
            chi2 = self._frame_chi2()
            early, late = self._t < ends[0] - 1e-9, self._t > ends[1] + 1e-9
            bad = {
                -1: early.any() and chi2[early].mean() > _FITS,
                1: late.any() and chi2[late].mean() > _FITS,
            }
            if bad[-1] or bad[1]:
                low, high = (ends[0] if bad[-1] else low), (ends[1] if bad[1] else high)
                self._extend(low, high, *before)
                self.refine(4)
                open_ -= {side for side, wrong in bad.items() if wrong}
            if low <= self._all.time[0]:
                open_ -= {-1}
            if high >= self._all.time[-1]:
                open_ -= {1}
        self.refine(15)
        return self

    def _extend(self, low: float, high: float, q: Array, time: Array) -> None:
        """Use another interval; beyond the old knots the walk goes straight on."""
        self._use(low, high)
        knots = self._knots(q)
        slopes = (knots[-1] - knots[0]) / (time[-1] - time[0])
        inside = np.stack([np.interp(self._time, time, column) for column in knots.T], axis=1)
        beyond = self._time - np.clip(self._time, time[0], time[-1])
        self._q = np.concatenate([q[: self._fixed], (inside + beyond[:, None] * slopes).ravel()])

    def result(self) -> Calibration:
        """Camera and path, and how the path changes with the camera."""
        matrix, _ = self._normal(self._q)
        covariance = np.linalg.inv(matrix) * max(self.chi2_per_observation, 1.0)
        camera = covariance[:4, :4]
        root = np.linalg.cholesky(camera)
        # Part of the path's covariance that comes from the camera: S_pc S_cc^-1 S_cp = D D'.
        path_change = np.linalg.solve(root, covariance[:4, self._fixed :]).T.reshape(-1, 4, 4)[:, :3]
        return Calibration(
            make_camera(self._q[:4], self._size),
            np.sqrt(np.diag(camera)),
            float(self._q[1]),
            float(self._q[2]),
            self._time,
            self._knots(self._q)[:, :3].copy(),
            path_change,
            self._in_place,
            self.chi2_per_observation,
        )
