"""Joint angles over the walking cycle: a normative table with a personal style.

The table follows textbook gait curves (clinical signs, degrees, phase 0 = right heel strike) and is
independent of the motion capture from which models are learnt.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gait.bindings.model import read_blob
from gait.body.model_curves import pace, slope_of
from gait.body.motion_classes import class_names, class_sections
from gait.errors import UserError
from gait.io import blob
from gait.simulate.geometry import Array

CURVE_HARMONICS = 5
_KINDS = 1 + 2 * CURVE_HARMONICS

# values of the right side at 0, 10, ... 90 % of the cycle; the left side is half a cycle later
_LIMBS = {
    "hip_flexion": (32, 25, 12, 1, -7, -12, -5, 13, 26, 32),
    "hip_abduction": (-1, -4, -5, -4, -3, 0, 4, 5, 3, 1),
    "hip_rotation": (-2, 1, 2, 3, 3, 2, -2, -4, -4, -3),
    "knee_flexion": (4, 14, 16, 9, 5, 10, 35, 61, 55, 26),
    "shoulder_flexion": (-20, -18, -11, -1, 9, 14, 12, 4, -6, -16),
    "shoulder_abduction": (10, 9, 8, 7, 7, 7, 7, 8, 9, 10),
    "shoulder_rotation": (14, 14, 15, 17, 19, 20, 19, 17, 15, 14),
    "elbow_flexion": (14, 14, 17, 24, 33, 38, 36, 29, 22, 16),
}
# harmonics of the middle of the body: mean, then (cosine, sine) of once and twice per cycle
_MIDDLE = {
    "pelvis_yaw": (0, (4.5, 0.5), (0, 0)),
    "pelvis_pitch": (3, (0, 0), (0.6, 0.8)),
    "pelvis_roll": (0, (-1.2, -3.2), (0, 0)),
    "torso_z": (0, (-8.5, 1.0), (0, 0)),
    "torso_y": (1, (0, 0), (1.0, -0.8)),
    "torso_x": (0, (1.0, 3.6), (0, 0)),
    "neck_z": (0, (3.2, -1.0), (0, 0)),
    "neck_y": (-3, (0, 0), (-0.8, -0.2)),
    "neck_x": (0, (0.4, -1.2), (0, 0)),
}
CURVE_NAMES = tuple(_MIDDLE) + tuple(f"{side}_{name}" for side in "lr" for name in _LIMBS)
_CALM = {"pelvis_yaw": 0.35, "pelvis_pitch": 0.25, "pelvis_roll": 0.25}
_CALM |= {"hip_flexion": 0.6, "knee_flexion": 0.5, "hip_abduction": 0.4, "hip_rotation": 0.6}


def fourier(phase: ArrayLike) -> Array:
    """Return 1, cos 2 pi p, sin 2 pi p, cos 4 pi p ... of phases (T,), shape (T, 1 + 2 harmonics)."""
    turn = 2 * np.pi * np.asarray(phase, np.float64)[..., None] * np.arange(1, CURVE_HARMONICS + 1)
    pairs = np.stack([np.cos(turn), np.sin(turn)], axis=-1).reshape(*turn.shape[:-1], 2 * CURVE_HARMONICS)
    return np.concatenate([np.ones((*turn.shape[:-1], 1)), pairs], axis=-1)


@dataclass(frozen=True)
class Curves:
    """One person's joint angles as Fourier series."""

    mean: Array  #: (channels, 1 + 2 harmonics) radians, rows in the order of `CURVE_NAMES`
    #: (modes, channels, 1 + 2 harmonics) differences between strides, radians per unit score.
    modes: Array

    def angles(self, phase: Array, scores: Array) -> dict[str, Array]:
        """Return radians (T,) per channel at phases (T,) and stride scores (T, modes)."""
        basis = fourier(phase)
        value = basis @ self.mean.T + np.einsum("tk,tm,mck->tc", basis, scores, self.modes)
        return {name: value[:, i] for i, name in enumerate(CURVE_NAMES)}


def normative(rng: np.random.Generator) -> Curves:
    """Return the table's gait in a personal style: offsets and smooth changes of about 2 degrees."""
    middle = {name: _series(*row) for name, row in _MIDDLE.items()}
    limbs = {name: _interpolate(row) for name, row in _LIMBS.items()}
    arm_swing = float(rng.uniform(0.75, 1.25))
    for name in ("shoulder_flexion", "elbow_flexion"):
        limbs[name] = np.concatenate([limbs[name][:1], limbs[name][1:] * arm_swing])
    right = {name: row + _calm(name) * _smooth(rng, (2.0, 1.4, 0.7, 0.3)) for name, row in limbs.items()}
    rows = {name: row + _calm(name) * _smooth(rng, (0.8, 0.8, 0.4, 0.2)) for name, row in middle.items()}
    for name, row in right.items():
        rows[f"r_{name}"] = row
        rows[f"l_{name}"] = shifted(row, 0.5) + _calm(name) * _smooth(rng, (0.8, 0.5, 0.3, 0.1))
    mean = np.radians([rows[name] for name in CURVE_NAMES])
    return Curves(mean, stride_modes(rng))


def stride_modes(rng: np.random.Generator) -> Array:
    """Return random directions in which strides differ, about 1 degree rms for a unit score."""
    kinds = [name[2:] if name[1] == "_" else name for name in CURVE_NAMES]
    draw = [[_calm(kind) * _smooth(rng, (0.7, 0.8, 0.4, 0.2)) for kind in kinds] for _ in range(2)]
    return np.radians(np.array(draw))


def shifted(row: Array, by: float) -> Array:
    """Return the series of f(p + by) from that of f(p)."""
    out = row.copy()
    for k in range(1, CURVE_HARMONICS + 1):
        c, s = np.cos(2 * np.pi * k * by), np.sin(2 * np.pi * k * by)
        a, b = row[2 * k - 1], row[2 * k]
        out[2 * k - 1], out[2 * k] = a * c + b * s, b * c - a * s
    return out


def fit_series(samples: ArrayLike) -> Array:
    """Return the series (rows, 1 + 2 harmonics) closest to curves (rows, T) sampled at phases j / T."""
    samples = np.asarray(samples, np.float64)
    basis = fourier(np.arange(samples.shape[-1]) / samples.shape[-1])
    return np.linalg.lstsq(basis, samples.T, rcond=None)[0].T


def _interpolate(row: ArrayLike) -> Array:
    """Return the trigonometric interpolation of 10 samples; the 5th harmonic is a cosine only."""
    value = np.fft.rfft(np.asarray(row, np.float64)) / 10
    out = np.zeros(_KINDS)
    out[0] = value[0].real
    out[1::2], out[2::2] = 2 * value[1:].real, -2 * value[1:].imag
    out[2 * CURVE_HARMONICS - 1] = value[5].real
    return out


def _series(mean: float, *pairs: tuple[float, float]) -> Array:
    flat = [mean, *(value for pair in pairs for value in pair)]
    return np.array(flat + [0.0] * (_KINDS - len(flat)))


def _smooth(rng: np.random.Generator, sd: tuple[float, ...]) -> Array:
    """Draw a series whose offset and harmonics have these standard deviations, degrees."""
    out = np.zeros(_KINDS)
    for k, scale in enumerate(sd):
        places = slice(0, 1) if k == 0 else slice(2 * k - 1, 2 * k + 1)
        out[places] = scale * np.clip(rng.standard_normal(out[places].size), -1.8, 1.8)
    return out


def _calm(name: str) -> float:
    """Return a channel's share of the common variation: legs and pelvis vary less than arms."""
    return _CALM.get(name, 1.0)


_ROOT = {"pelvis_yaw": "root_yaw", "pelvis_pitch": "root_pitch", "pelvis_roll": "root_roll"}
_NEEDED = tuple(f"{side}_{name}" for side in "lr" for name in ("hip_flexion", "knee_flexion"))


def curves_of_model(path: str, rng: np.random.Generator, cadence: float, motion_class: str) -> Curves:
    """Return the curves of a person drawn from the model at `path`; strides vary as in the model.

    cadence : strides per second, on which the mean cycle depends.
    motion_class : class of motion whose curves to use, if the model has it, otherwise the model's first.

    UserError if the file is not a valid model or lacks the legs' angles.
    """
    sections = blob.decode(read_blob(path), path)
    if motion_class in (classes := class_names(sections)):
        sections = class_sections(sections, classes.index(motion_class))
    for tag in ("CHNM", "CURV", "SCST"):
        if tag not in sections:
            raise UserError(
                f"{path}: section {tag} is missing, not a cyclic model; learn one with gait learn"
            )
    names = blob.unpack_names(sections["CHNM"])
    lacking = [name for name in _NEEDED if name not in names]
    if lacking:
        raise UserError(f"{path}: has no channel {lacking[0]}; give a model of walking")
    curves = np.asarray(sections["CURV"], np.float64)
    sd = np.asarray(sections["SCST"], np.float64)
    scores = sd[:, 1] * np.clip(rng.standard_normal(len(sd)), -1.5, 1.5)
    mean = curves[0] + np.einsum("q,qtm->tm", scores, curves[1:])
    if (slope := slope_of(sections)) is not None:
        mean += pace(sections["GAIT"], cadence) * slope
    modes = stride_modes(rng)
    for k in range(min(len(modes), len(sd))):
        modes[k] = sd[k, 2] * _rows(names, curves[1 + k])
    return Curves(_rows(names, mean), modes)


def _rows(names: list[str], samples: Array) -> Array:
    """Return series for every channel of the simulator; channels that the model lacks stay at zero."""
    series = fit_series(samples.T)
    at = {name: i for i, name in enumerate(names)}
    out = np.zeros((len(CURVE_NAMES), series.shape[1]))
    for row, name in enumerate(CURVE_NAMES):
        source = _ROOT.get(name, name)
        if source in at:
            out[row] = series[at[source]]
    return out
