"""Measurement model of a walk: expected joints in the image, and the probability of camera and walk.

`WalkingBody` computes the joints of the cyclic model, linearised in scores and proportions; `WalkModel`
places it on a path, projects it and compares it with keypoints.  The parameters are one vector: camera (log
focal length, tilt, roll, log height), stature, scores, proportions and leans, offsets of the detector's
joints, and position, heading and phase at knots.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gait.bindings.model import Model
from gait.bindings.state import State
from gait.detect.profile import changing_sd, load, picture_height
from gait.io.keypoints_file import Keypoints
from gait.track.walk_start import RELATIVE_STATURE_SD, CameraPrior, make_camera, swap_sides

Array = NDArray[np.float64]

_KNOTS = 0.5  # seconds between knots
_PIXEL = 0.5  # pixels; noise of any keypoint
#: Errors that repeat with every stride, of the model's curves and of the detector at each phase: fractions of
#: the person's height, measured on rendered walks, and seconds for which they count as one observation.
_REPEATING = {
    "shoulder": 0.006, "elbow": 0.008, "wrist": 0.015, "hip": 0.008, "knee": 0.010, "ankle": 0.007,
    "heel": 0.010,
}  # fmt: skip
_REPEATING_ELSEWHERE = 0.007
_REPEATING_TIME = 0.25
_LEAST_OFFSET_SD = 0.003  # of the stature; least constant offset of a detector's joint from the model's
_LEAN_SD, _SIDE_LEAN_SD, _TRUNK_SD = 0.021, 0.013, 0.040  # radians, between recorded people and walks
_SLIDE_SD = 0.05  # metres per second; sliding of feet on the floor, along the heading
_SIDEWAYS_SD = 0.05  # metres per second; speed across the heading
_STILL_SD = 0.03  # metres per second; speed on a treadmill
_BEND_SD, _WALK_TURN_SD, _HURRY_SD = 0.05, 0.12, 0.02  # changes of slope at a knot: metres, radians, strides
_CURVE_SD = 0.3  # radians per second; average turn rate
_SCORES = 5  # components of the model that are fitted
_SWAPPED = 16.0  # twice the log odds from which left and right of a frame are swapped
_DEGREES = 4.0  # degrees of freedom of Student's t


def _heavy_tailed(residual: Array) -> Array:
    """Convert residuals so that their squares are Student-t costs, which pull unusual cameras less."""
    root = np.sqrt(_DEGREES * np.log1p(residual**2 / _DEGREES))
    return np.asarray(np.sign(residual) * root)


class WalkingBody:
    """Joints over the stride, statures, with the pelvis at (0, 0); linear in scores, proportions, leans."""

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
        # The pelvis sways from side to side, and moves forwards unevenly over the foot on the floor.
        velocity = self._over_foot(table, model.joint_names)
        backwards = velocity[..., 0].mean(axis=1)
        way = np.cumsum(velocity - velocity.mean(axis=1, keepdims=True), axis=1) / self.PHASES
        table[..., :2] += (way - way.mean(axis=1, keepdims=True))[:, :, None]
        # The ankle rolls forward over the foot, so it moves back more slowly than the floor does.
        stride = backwards * model.info.stride_length / backwards[0]
        leans = self._leans(table[0], model.joint_names)
        self.table = np.concatenate([table[:-1], leans, table[-1:]])[:, :, rows]
        self.stride = np.concatenate([stride[:-1], np.zeros(len(leans)), stride[-1:]])
        self.parts = len(self.table) - 2  # scores, proportions, leans
        self.rate, self.rate_sd = model.info.stride_hz, model.info.stride_hz_sd
        self.offsets = 3 * len(self.names)  # offsets of the detector's joints: forward, left, up
        lasting = [load("full").joint(name).lasting_sd for name in self.names]
        self.offset_sd = np.repeat(np.maximum(lasting, _LEAST_OFFSET_SD), 3)  # statures

    def _cycle(self, model: Model, state: State) -> Array:
        out = np.empty((self.PHASES, model.info.joints, 3))
        for k in range(self.PHASES):
            posed = replace(state, phase=k / self.PHASES)
            posed.pelvis[:] = 0.0
            posed.pelvis[2] = model.pelvis_height(posed)
            out[k] = model.pose(posed)[0]
        return out

    def _over_foot(self, table: Array, names: tuple[str, ...]) -> Array:
        """Velocity (rows, PHASES, 2) of the pelvis relative to the foot on the floor, statures per stride.

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

    @staticmethod
    def _leans(cycle: Array, names: tuple[str, ...]) -> Array:
        """Return changes (3, PHASES, joints, 3) of a `cycle` by leans of one standard deviation.

        The body leans forward and sideways about the feet, the trunk forward about the hips.
        """
        up = cycle[..., 2]
        hips = [names.index("l_hip"), names.index("r_hip")]
        trunk = np.maximum(up - up[:, hips].mean(axis=1, keepdims=True), 0.0)
        out = np.zeros((3, *cycle.shape))
        out[0, ..., 0], out[1, ..., 1], out[2, ..., 0] = up * _LEAN_SD, up * _SIDE_LEAN_SD, trunk * _TRUNK_SD
        return out

    def weights(self, parts: Array, rate: Array) -> Array:
        """Weights (..., T, parts + 2) of the table's rows: mean, scores and proportions, stride rate."""
        faster = np.clip((rate - self.rate) / self.rate_sd, -2.0, 2.0)
        return np.concatenate(
            [
                np.ones((*rate.shape, 1)),
                np.broadcast_to(parts[..., None, :], (*rate.shape, self.parts)),
                faster[..., None],
            ],
            axis=-1,
        )

    def joints(self, phase: Array, rate: Array, parts: Array, offsets: Array) -> Array:
        """Compute joints (T, J, 3), statures."""
        place = (phase % 1.0) * self.PHASES
        left = np.floor(place).astype(int) % self.PHASES
        share = (place - np.floor(place))[:, None, None]
        weights = self.weights(parts, rate)
        cycle = np.tensordot(weights[:1, :-1], self.table[:-1], axes=(1, 0))[0]  # parts are constant
        out = cycle[left] * (1 - share) + cycle[(left + 1) % self.PHASES] * share
        out = out + weights[:, -1, None, None] * self.table[-1, left]
        return np.asarray(out + offsets.reshape(-1, 3))

    def strides(self, rate: Array, parts: Array) -> Array:
        """Compute stride lengths (..., T), statures."""
        return np.asarray(self.weights(parts, rate) @ self.stride)


class WalkModel:
    """Keypoints of an interval, and the prior of camera and walk.

    Attributes
    ----------
    body : WalkingBody
    in_place : bool
        The person walks in place, as on a treadmill.
    time : ndarray of shape (T,)
        Times of the keypoints, seconds.
    knot_time : ndarray of shape (K,)
        Times of the knots, seconds.
    clip : tuple of float
        Times of the first and last keypoint, also outside the interval, seconds.
    fixed : int
        Number of parameters before those of the knots.
    """

    def __init__(
        self,
        keypoints: Keypoints,
        size: tuple[int, int],
        body: WalkingBody,
        height: float,
        prior: CameraPrior,
        *,
        in_place: bool,
        interval: tuple[float, float],
    ) -> None:
        self._all, self._size, self.body, self._height, self._prior = keypoints, size, body, height, prior
        self.in_place = in_place
        self.fixed = 5 + body.parts + body.offsets
        low, high = interval
        time = keypoints.time
        self.clip = time[0], time[-1]
        rows = np.flatnonzero((time >= low) & (time <= high))
        t = time[rows]
        count = max(2, int(np.ceil((t[-1] - t[0]) / _KNOTS)) + 1)
        self.knot_time = np.linspace(t[0], t[-1], count)
        self.time = t
        uv, names = keypoints.uv[rows][:, self.body.columns], self.body.names
        jitter, lasts = changing_sd(keypoints)
        tall = np.maximum(picture_height(keypoints), 1.0)[rows, None]
        kinds = [name.partition("_")[2] for name in names]
        repeats = tall * [_REPEATING.get(kind, _REPEATING_ELSEWHERE) for kind in kinds]
        jitter = np.hypot(jitter[rows][:, self.body.columns], _PIXEL)
        self._inverse = np.where(np.isfinite(uv).all(axis=2), 1.0 / np.hypot(jitter, repeats), 0.0)
        self._uv = np.nan_to_num(uv)
        # More strides contain the same repeating errors, so frames count less the more strides there are.
        strides = max(1.0, body.rate * (t[-1] - t[0]))
        lasting = jitter**2 * lasts[self.body.columns] + repeats**2 * _REPEATING_TIME * strides
        single = lasting * self._inverse**2  # seconds for which they count as one observation
        self._thin = np.minimum(1.0, float(np.median(np.diff(t))) / np.maximum(single, 1e-9))

    def over(self, low: float, high: float, keypoints: Keypoints | None = None) -> WalkModel:
        """Make the same model for another interval, seconds, and optionally for other `keypoints`."""
        return WalkModel(
            self._all if keypoints is None else keypoints, self._size, self.body, self._height, self._prior,
            in_place=self.in_place, interval=(low, high),
        )  # fmt: skip

    def swapped(self, q: Array) -> WalkModel | None:
        """Make the model with sides swapped in frames that then fit much better; None if there are none."""
        swapped = self.over(self.time[0], self.time[-1], swap_sides(self._all))
        better = self.robust(q).sum(axis=1) > swapped.robust(q).sum(axis=1) + _SWAPPED
        if not better.any():
            return None
        rows = np.isin(self._all.time, self.time[better])
        return self.over(self.time[0], self.time[-1], swap_sides(self._all, rows))

    def knots(self, q: Array) -> Array:
        """Return the knots (..., K, 4): x, y, metres; heading, radians; phase."""
        return q[..., self.fixed :].reshape(*q.shape[:-1], -1, 4)

    def errors(self, q: Array) -> Array:
        """Compute the errors of the keypoints (T, J, 2), in standard deviations."""
        now = np.stack([np.interp(self.time, self.knot_time, column) for column in self.knots(q).T], axis=1)
        rates = np.interp(self.time, self._middles(), self.rates(q))
        joints = self._joints(q, now, rates)
        camera = make_camera(q[:4], self._size)
        x = joints @ camera.R.T + camera.t
        depth = np.maximum(x[..., 2:], 0.05)
        uv = camera.fx * x[..., :2] / depth + [camera.cx, camera.cy]
        return np.asarray((uv - self._uv) * self._inverse[..., None])

    def _joints(self, q: Array, now: Array, rates: Array) -> Array:
        """Compute joints (T, J, 3) in the world, metres, for the path `now` (T, 4) and stride rates (T,)."""
        body, stature = self.body, self._height * np.exp(q[4])
        parts, offsets = q[5 : 5 + body.parts], q[5 + body.parts : self.fixed]
        local = stature * body.joints(now[:, 3], rates, parts, offsets)
        c, s = np.cos(now[:, 2])[:, None], np.sin(now[:, 2])[:, None]
        return np.stack([
            now[:, 0, None] + c * local[..., 0] - s * local[..., 1],
            now[:, 1, None] + s * local[..., 0] + c * local[..., 1],
            local[..., 2],
        ], axis=-1)  # fmt: skip

    def _middles(self) -> Array:
        """Return the times midway between knots (K - 1,), seconds."""
        return np.asarray((self.knot_time[1:] + self.knot_time[:-1]) / 2)

    def rates(self, q: Array) -> Array:
        """Return the stride rates between knots (..., K - 1), hertz."""
        return np.asarray(np.diff(self.knots(q)[..., 3]) / np.diff(self.knot_time))

    def expected(self, q: Array) -> Array:
        """Compute the residuals (..., R) of the prior of camera and walk; `q` (..., P)."""
        body, knots, flat = self.body, self.knots(q), (*q.shape[:-1], -1)
        step, heading = np.diff(self.knot_time), knots[..., 2]
        velocity = np.diff(knots[..., :2], axis=-2) / step[:, None]
        x, y, between = velocity[..., 0], velocity[..., 1], (heading[..., 1:] + heading[..., :-1]) / 2
        ahead, aside = x * np.cos(between) + y * np.sin(between), y * np.cos(between) - x * np.sin(between)
        rates = self.rates(q)
        parts, offsets = q[..., 5 : 5 + body.parts], q[..., 5 + body.parts : self.fixed]
        if self.in_place:
            speed = [ahead / _STILL_SD, aside / _STILL_SD]
        else:
            usual = body.strides(rates, parts) * self._height * np.exp(q[..., 4:5]) * rates
            many = np.sqrt(len(step))  # as one uncertainty of the whole walk
            speed = [(ahead - usual) / _SLIDE_SD / many, aside / _SIDEWAYS_SD / many]
        faster = np.diff(np.stack([ahead, aside], axis=-1), axis=-2) * np.diff(self._middles())[:, None]
        bends = np.diff(knots[..., 2:], 2, axis=-2) / np.array([_WALK_TURN_SD, _HURRY_SD])
        turn = (heading[..., -1:] - heading[..., :1]) / (self.knot_time[-1] - self.knot_time[0])
        return np.concatenate([
            _heavy_tailed((q[..., :4] - self._prior.mean) / self._prior.sd),
            q[..., 4:5] / RELATIVE_STATURE_SD,
            parts,
            offsets / self.body.offset_sd,
            *speed,
            (rates - body.rate) / (2 * body.rate_sd) / np.sqrt(len(step)),
            faster.reshape(flat) / _BEND_SD,
            bends.reshape(flat),
            turn / _CURVE_SD,
        ], axis=-1)  # fmt: skip

    def cost(self, q: Array) -> float:
        """Minus twice the log posterior, up to a constant."""
        return float((self._thin * self.robust(q)).sum() + (self.expected(q) ** 2).sum())

    def robust(self, q: Array) -> Array:
        """Compute the Student-t costs of the keypoints (T, J)."""
        square = (self.errors(q) ** 2).sum(axis=2)
        return np.asarray(_DEGREES * np.log1p(square / _DEGREES))

    def groups(self) -> Iterator[tuple[NDArray[np.int64], Array]]:
        """Group parameters with separate effects, with the errors (T, J, 2, columns) that each changes."""
        plain = self.fixed - self.body.offsets
        for k in range(plain):
            yield np.array([k]), np.ones(1)
        joints = np.eye(len(self.body.names))[:, None]  # each offset moves its own joint
        for axis in range(3):
            yield np.arange(plain + axis, self.fixed, 3), joints
        knots = np.arange(len(self.knot_time))
        at = np.interp(self.time, self.knot_time, knots)
        for first in range(min(4, len(knots))):  # a knot affects times less than two knots away
            chosen = knots[first::4]
            near = (np.abs(at[:, None] - chosen) < 2.0)[:, None, None].astype(float)
            for kind in range(4):
                yield self.fixed + 4 * chosen + kind, near

    def frame_chi2(self, q: Array) -> Array:
        """Squared robust error per coordinate in each frame (T,)."""
        robust = self.robust(q)
        return np.asarray(robust.sum(axis=1) / np.maximum(2 * (self._inverse > 0).sum(axis=1), 1))

    def normal(self, q: Array) -> tuple[Array, Array]:
        """Form the normal equations; return matrix and gradient."""
        errors, expected = self.errors(q), self.expected(q)
        weight = np.sqrt(self._thin[..., None] / (1.0 + (errors**2).sum(axis=2, keepdims=True) / _DEGREES))
        data = np.zeros((*errors.shape, len(q)))
        prior = np.empty((len(expected), len(q)))
        h = 1e-5
        for columns, share in self.groups():
            moved = q.copy()
            moved[columns] += h
            change = (self.errors(moved) - errors) * (weight / h)
            data[..., columns] = change[..., None] * share
        own = np.arange(self.fixed - self.body.offsets, self.fixed)  # each offset has its own prior
        prior[:, own] = 0.0
        prior[own, own] = 1.0 / self.body.offset_sd
        others = np.delete(np.arange(len(q)), own)
        prior[:, others] = (self.expected(q + h * np.eye(len(q))[others]) - expected).T / h
        data = data.reshape(-1, len(q))
        gradient = data.T @ (weight * errors).ravel() + prior.T @ expected
        return data.T @ data + prior.T @ prior, gradient
