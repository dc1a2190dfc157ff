"""Dynamics of the person's state in numpy, in double precision: checks gait.Tracker.predict.

The states are those of `gait.Tracker.particles` with the pelvis replaced by the path about which it sways.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gait.bindings.abi import Mode
from gait.bindings.config import TrackerConfig
from gait.bindings.state import LEAST_STATURE
from gait.body.model_curves import ModelCurves

Array = NDArray[np.float64]

PHASE, HEADING = 0, 3
RATES = (1 / 2.1, 1 / 0.4)
"""Least and largest stride rate, strides per second."""

DEFAULT_SCORES = 5
"""Scores that the default mode uses unless configured (particles.c)."""

POSTURE_SD = 0.035
"""Of an angle's posture offset where the model was learned from too few people, radians (model.h)."""

SCALARS = ("phase", "stride_hz", "stature", "heading", "pitch", "roll", "turn_rate")
"""Columns of a table of states; then x, y, z of the path, scores, proportions and posture offsets in use."""

TURN, PATH, COEF = 6, 7, 10


@dataclass(frozen=True)
class Step:
    """The interval between two frames.

    Attributes
    ----------
    dt : float
        Seconds.
    settling : bool
        The stride rate and the stature vary fast, until some time after phase, left and right are known.
    turning : bool
        The turn rate may change, as soon as phase, left and right are known.
    start_stature_sd : float
        Standard deviation of the stature at the start, as a fraction of it.
    """

    dt: float
    settling: bool
    turning: bool
    start_stature_sd: float


class Transitions:
    """How the states of one tracker move from frame to frame.

    Parameters
    ----------
    curves : ModelCurves
    config : TrackerConfig
        Of the tracker (`gait.Tracker.config`): `offset_angles` is a mask, not -1.
    """

    def __init__(self, curves: ModelCurves, config: TrackerConfig) -> None:
        self.curves, self.config = curves, config
        self._plain = config.mode == Mode.PAPER  # no root motion within the stride
        every = len(curves.samples) - 1
        usual = every if self._plain else min(every, DEFAULT_SCORES)
        self._scores = usual if config.components < 0 else config.components
        every = len(curves.height_change)
        self._proportions = every if config.proportions < 0 else config.proportions
        angles = len(curves.names) - 6
        self._offsets = [a for a in range(angles) if config.offset_angles >> a & 1]
        learnt = curves.static[self._offsets]
        self._posture_sd = np.where(learnt > 0, learnt, POSTURE_SD)
        self._height = float(curves.samples[0, :, curves.names.index("root_height")].mean())

    @property
    def _build(self) -> int:
        """First column of the proportions."""
        return COEF + self._scores

    @property
    def _posture(self) -> int:
        """First column of the posture offsets."""
        return self._build + self._proportions

    @property
    def columns(self) -> int:
        """Of a table of states."""
        return self._posture + len(self._offsets)

    def table(self, particles: NDArray[np.void]) -> Array:
        """States (N, columns) of the structured array of `gait.Tracker.particles`."""
        scalars = np.stack([particles[name] for name in SCALARS], axis=1).astype(float)
        coef = particles["coef"][:, : self._scores].astype(float)
        build = particles["proportion"][:, : self._proportions].astype(float)
        path = particles["pelvis"].astype(float) - self._about(scalars, coef, build)
        return np.hstack([scalars, path, coef, build, particles["offset"][:, self._offsets].astype(float)])

    def _coef(self, table: Array) -> Array:
        return table[..., COEF : COEF + self._scores]

    def _about(self, scalars: Array, coef: Array, build: Array) -> Array:
        """Pelvis relative to its path, (N, 3): sway to the left and height, by phase."""
        phase, rate, stature, heading = scalars[:, :4].T
        sway, height = np.zeros(len(phase)), np.full(len(phase), self._height)
        if not self._plain:
            sway = self.curves.channel("root_sway", phase, coef, rate)
            height = self.curves.channel("root_height", phase, coef, rate)
        height = height * (1 + build @ self.curves.height_change[: self._proportions])
        return (stature * np.stack([-sway * np.sin(heading), sway * np.cos(heading), height])).T

    def move(self, before: Array, step: Step, random: np.random.Generator) -> Array:
        """Draw the state after a step for each state, shape (N, columns), as ``dynamics_move`` in dynamics.c.

        Parameters
        ----------
        before : ndarray of shape (N, columns)
        step : Step
        random : numpy.random.Generator
        """
        c, dt, b = self.config, step.dt, before
        noise = random.standard_normal(before.shape)
        root, after = np.sqrt(dt), before.copy()
        along = -dt if c.reverse > 0 else dt  # frames in reverse order: noise as ever, motion the other way
        turn = b[:, 1] * along + c.phase_noise * root * noise[:, 0]
        after[:, 0] = (b[:, 0] + turn) % 1.0
        rate = c.rate_noise * self.curves.stride_hz
        away = _relax(b[:, 1] - self.curves.stride_hz, dt, c.rate_time, rate, noise[:, 1])
        after[:, 1] = _reflect(self.curves.stride_hz + away)
        grown = (c.stature_noise_start if step.settling else c.stature_noise) * step.start_stature_sd
        after[:, 2] = np.maximum(b[:, 2] * (1 + grown * root * noise[:, 2]), LEAST_STATURE)
        curve = b[:, TURN] * along
        after[:, 3] = wrap(b[:, 3] + curve + c.heading_noise * root * noise[:, 3], 2 * np.pi)
        after[:, 4:6] = _relax(b[:, 4:6], dt, c.tilt_time, c.tilt_noise, noise[:, 4:6])
        after[:, TURN] = self._turn_rates(b[:, TURN], step, noise[:, TURN], random)
        ahead = self._ahead(b, turn, along) + c.forward_noise * root * noise[:, PATH]
        aside = c.lateral_noise * root * noise[:, PATH + 1]
        cos, sin = np.cos(b[:, 3] + curve / 2), np.sin(b[:, 3] + curve / 2)
        after[:, PATH] += ahead * cos - aside * sin
        after[:, PATH + 1] += ahead * sin + aside * cos
        height = PATH + 2
        after[:, height] = _relax(b[:, height], dt, c.tilt_time, c.vertical_noise, noise[:, height])
        for first, last, tau, sd in (
            (COEF, self._build, c.coef_time, c.coef_noise),
            (self._build, self._posture, _time(c.proportion_noise), c.proportion_noise),
            (self._posture, self.columns, _time(c.offset_noise), c.offset_noise * self._posture_sd),
        ):
            after[:, first:last] = _relax(b[:, first:last], dt, tau, sd, noise[:, first:last])
        return after

    def _turn_rates(self, before: Array, step: Step, noise: Array, random: np.random.Generator) -> Array:
        """Keep the turn rates, or sometimes draw new ones, half of which are 0."""
        c = self.config
        if not (step.turning and c.turn_time > 0):
            return before
        other = random.random(len(before)) < 1 - np.exp(-step.dt / c.turn_time)
        return np.where(other, np.where(random.random(len(before)) < 0.5, c.turn_sd * noise, 0), before)

    def _ahead(self, before: Array, turn: Array, dt: float) -> Array:
        """Metres along the heading while the phase advances by `turn` (eq. 8)."""
        travel = 1.0 - self.config.belt
        if self._plain:
            return np.asarray(before[:, 2] * self.curves.stride_length * before[:, 1] * dt * travel)
        middle = before[:, 0] + 0.5 * turn
        speed = self.curves.channel("root_forward", middle, self._coef(before), before[:, 1])
        return np.asarray(before[:, 2] * speed * turn * travel)

    def difference(self, a: Array, b: Array) -> Array:
        """Return a - b with phase and heading the short way round."""
        out = np.asarray(a - b)
        out[..., PHASE] = wrap(out[..., PHASE], 1.0)
        out[..., HEADING] = wrap(out[..., HEADING], 2 * np.pi)
        return out


def wrap(x: Array, turn: float) -> Array:
    """Fold into half a turn in either direction."""
    return np.asarray((x + turn / 2) % turn - turn / 2)


def _time(noise: float) -> float:
    """Return the time constant at which this noise keeps a standard deviation of 1."""
    return 2 / noise**2 if noise > 0 else 0.0


def _reflect(rate: Array) -> Array:
    """Reflect stride rates back into their range, as in eq. 7."""
    low, high = RATES
    folded = np.where(rate < low, 2 * low - rate, np.where(rate > high, 2 * high - rate, rate))
    return np.clip(folded, low, high)


def _relax(x: Array, dt: float, tau: float, noise: float | Array, normal: Array) -> Array:
    """Return to zero with time constant `tau` (never if 0) plus noise per square root of a second."""
    if tau <= 0:
        return x + noise * np.sqrt(dt) * normal
    keep = np.exp(-dt / tau)
    return np.asarray(keep * x + noise * np.sqrt(tau / 2 * (1 - keep**2)) * normal)
