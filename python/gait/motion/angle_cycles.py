"""Joint angles over the normalised cycle, beside those of the people a model was learned from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.body.model_curves import ModelCurves
from gait.io.track_file import Track
from gait.motion.footfall_draws import Draws
from gait.motion.parameters import Parameters

Array = NDArray[np.float64]

PERCENT = np.linspace(0, 100, 101)
"""Of the stride: right strike to right strike, and left to left for the angles of the left side."""
_SMALL = 0.005  # strides, for slopes


@dataclass(frozen=True)
class AngleCycle:
    """One angle over the cycle, degrees, each array of shape (101,) unless said otherwise.

    Attributes
    ----------
    strides : ndarray of shape (k, 101)
        Of the sure strides.
    mean, sd : ndarray
        Mean of the strides, and its posterior standard deviation (NaN if the track does not tell).
    norm_mean, norm_sd : ndarray
        Of the people the model was learned from, at the stride rate of these strides.
    """

    strides: Array
    mean: Array
    sd: Array
    norm_mean: Array
    norm_sd: Array

    @property
    def z(self) -> Array:
        """Deviation from the norm, in its standard deviations."""
        return np.asarray((self.mean - self.norm_mean) / np.maximum(self.norm_sd, 1e-6))

    def summary(self) -> dict[str, Any]:
        """Range of the mean, root mean square of z, and where z is largest."""
        worst = int(np.argmax(np.abs(self.z)))
        return {
            "least_deg": float(self.mean.min()),
            "most_deg": float(self.mean.max()),
            "strides": len(self.strides),
            "rms_z": float(np.sqrt(np.mean(self.z**2))),
            "worst_z": float(self.z[worst]),
            "worst_at_percent": float(PERCENT[worst]),
        }


def angle_cycles(
    track: Track, parameters: Parameters, curves: ModelCurves, draws: Draws | None = None
) -> dict[str, AngleCycle]:
    """Cycles of every angle that both track and model have.

    Parameters
    ----------
    track : Track
    parameters : Parameters
        Of the track.
    curves : ModelCurves
        The norm; without draws also how scores and phase move the angles.
    draws : Draws, optional
        Motions drawn from the posterior.
    """
    angles = {name[: -len("_deg")]: v for name, v in track.numbers.items() if name.endswith("_deg")}
    out = {}
    for name in (n for n in curves.names if n in angles):
        left = name.startswith("l_")
        when = _times(parameters, "left" if left else "right")
        if not len(when):
            continue
        strides = np.interp(when, track.time, angles[name])
        rate = 1 / float(np.median(when[:, -1] - when[:, 0]))
        norm_mean, norm_sd = curves.norm(name, PERCENT / 100 + (0.5 if left else 0.0), rate)
        sd = (
            _drawn_sd(draws, name, when)
            if draws
            else _linear_sd(track.numbers, track.time, name, curves, when)
        )
        out[name] = AngleCycle(strides, strides.mean(axis=0), sd, np.degrees(norm_mean), np.degrees(norm_sd))
    return out


def _times(parameters: Parameters, side: str) -> Array:
    """Return the times (k, 101) of the sure strides of a foot."""
    s = parameters.strides[side]
    start, end = s.start[s.sure, None], s.end[s.sure, None]
    return np.asarray(start + (end - start) * PERCENT / 100)


def _drawn_sd(draws: Draws, name: str, when: Array) -> Array:
    """Deviation of the mean curve over the draws; their timing is not taken out."""
    values = np.degrees(draws.angles[:, :, draws.angle_names.index(name)].astype(float))
    means = [np.interp(when, draws.time, motion).mean(axis=0) for motion in values]
    return np.asarray(np.std(means, axis=0))


def _linear_sd(
    numbers: Mapping[str, Array], time: Array, name: str, curves: ModelCurves, when: Array
) -> Array:
    """Deviation by linear propagation of phase and scores, an error being the same in every stride."""
    if "phase_sd" not in numbers:
        return np.full(len(PERCENT), np.nan)
    scores = sorted((n for n in numbers if n.startswith("c_") and not n.endswith("_sd")), key=_number)
    scores = scores[: len(curves.samples) - 1]
    phase, coef = numbers["phase"], np.stack([numbers[n] for n in scores], axis=1)
    rate = numbers["stride_hz"]
    here = curves.channel(name, phase, coef, rate)
    late, early = (curves.channel(name, phase + move, coef, rate) for move in (_SMALL, -_SMALL))
    slope = (late - early) / (2 * _SMALL)
    variance = (slope * numbers["phase_sd"]) ** 2
    for k, score in enumerate(scores):
        one = np.eye(len(scores))[k]
        variance += ((curves.channel(name, phase, coef + one, rate) - here) * numbers[f"{score}_sd"]) ** 2
    return np.asarray(np.interp(when, time, np.degrees(np.sqrt(variance))).mean(axis=0))


def _number(score: str) -> int:
    return int(score[len("c_") :])
