"""What a clip gets wrong from end to end, and how far that moves the estimate.

Clothes, hair and shoes lie where the stick figure does not, and somebody's build looks nearer or further than
the prior's.  Every frame brings the same error anew, so that no number of frames makes it less.  The estimate
stays as it is; its covariance grows by how far each error, one deviation large, would move it (consider
covariance, Schmidt 1966).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gait.lift.energy import GAIN, Energy
from gait.lift.tridiagonal import Factor

Floats = npt.NDArray[np.float64]

# Nearly most likely on walkers of `gait simulate` and sticks of people left out, none of the published clips.
SHIFT_SD = (0.03, 0.05)  # metres, across and along the picture: where sensors see the figure
SIZE_SD = 0.03  # share by which they see it larger


def moves(chain: Sequence[Energy], factor: Factor, states: Floats, drifted: Floats) -> Floats:
    """How one deviation of each error (two shifts, size, two drifts) moves the states (B, n): (B, n, 5).

    Parameters
    ----------
    chain : sequence of B Energy
    factor : Factor
        Of the chain's information matrix at the states.
    drifted : (B,)
        How far the figure may have drifted in each segment, metres, in one sense: `gait.lift.fit_correlation`.
    """
    pulls = np.stack([_pull(energy, state) for energy, state in zip(chain, states, strict=True)])
    drifts = pulls[..., :2] * drifted[:, None, None] / SHIFT_SD
    return -factor.solve(np.concatenate([pulls, drifts], axis=-1))


def _pull(energy: Energy, state: Floats) -> Floats:
    """Change (n, 3) of half the energy's gradient by one deviation of each error."""
    reading = energy.reading
    if reading is None or not len(reading.value):
        return np.zeros((len(state), 3))
    places, _ = energy.shape.positions(state, energy.weights, energy.sticks.markers)
    uv, _ = energy.view.project(places)
    _, by_uv = energy.sticks.responses(uv, reading.places, reading.blur)
    pixels = np.array([energy.view.scale(body.mean(axis=0)) for body in places])
    from_middle = uv - (uv.min(axis=1, keepdims=True) + uv.max(axis=1, keepdims=True)) / 2
    by_shift = pixels[:, None, None] * SHIFT_SD * by_uv.sum(axis=2)
    by_size = SIZE_SD * (by_uv * from_middle[:, None]).sum(axis=(2, 3))
    by_error = np.exp(state[GAIN]) * np.concatenate([by_shift, by_size[..., None]], axis=-1)
    _, slope = energy.sensor_rows(reading, state)
    return np.asarray(slope.T @ by_error.reshape(len(slope), -1) / reading.sd)
