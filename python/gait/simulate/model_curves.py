"""Joint angles of a walking model (`.gait`) as a source of motion, on the simulator's own body."""

from __future__ import annotations

import numpy as np

from gait.body.pace import pace, slope_of
from gait.errors import UserError
from gait.io import blob
from gait.simulate.arrays import Array
from gait.simulate.curves import NAMES, Curves, fit_series, stride_modes

_ROOT = {"pelvis_yaw": "root_yaw", "pelvis_pitch": "root_pitch", "pelvis_roll": "root_roll"}
_NEEDED = tuple(f"{side}_{name}" for side in "lr" for name in ("hip_flexion", "knee_flexion"))


def curves_of_model(path: str, rng: np.random.Generator, cadence: float) -> Curves:
    """Return the curves of a person drawn from the model at `path`; strides differ as the model says.

    cadence : strides per second, which the mean cycle follows.

    Raises
    ------
    UserError
        If the file is not a sound model or lacks the legs' angles.
    """
    sections = blob.read(path)
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
    spread = np.asarray(sections["SCST"], np.float64)
    scores = spread[:, 1] * np.clip(rng.standard_normal(len(spread)), -1.5, 1.5)
    mean = curves[0] + np.einsum("q,qtm->tm", scores, curves[1:])
    if (slope := slope_of(sections)) is not None:
        mean += pace(sections["GAIT"], cadence) * slope
    modes = stride_modes(rng)
    for k in range(min(len(modes), len(spread))):
        modes[k] = spread[k, 2] * _rows(names, curves[1 + k])
    return Curves(_rows(names, mean), modes)


def _rows(names: list[str], samples: Array) -> Array:
    """Return series for every channel of the simulator; channels that the model lacks stay at zero."""
    series = fit_series(samples.T)
    at = {name: i for i, name in enumerate(names)}
    out = np.zeros((len(NAMES), series.shape[1]))
    for row, name in enumerate(NAMES):
        source = _ROOT.get(name, name)
        if source in at:
            out[row] = series[at[source]]
    return out
