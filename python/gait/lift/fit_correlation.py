"""How far the sensors and the stick figure are alike, and what that says of the estimate.

Where the figure lies on the person it explains most of what the sensors read.  Where it explains little, they
read edges of the scene, which stand still: the figure is held back, and the longer, the further.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gait.lift.energy import Energy

Floats = npt.NDArray[np.float64]

HELD = 0.9  # likeness of figures that follow a person before a known background
CHANCE = 0.3  # likeness that a figure anywhere in a scene may have
DRIFT_SD = 0.04  # metres a second at twice the noise of `HELD`; the likeliest without a background
DOUBTFUL = 0.5  # below it figures left the person in half of the clips that this was found on


def likeness(chain: Sequence[Energy], states: Floats) -> float:
    """Correlation of what the sensors read and the figure gives at states (B, n); NaN without sensors.

    Over all frames, each about its mean.
    """
    products = np.zeros(3)
    for energy, state in zip(chain, states, strict=True):
        if energy.reading is None:
            continue
        read = energy.reading.value
        given = read + energy.misfit(state).reshape(read.shape)
        read, given = (values - values.mean(axis=1, keepdims=True) for values in (read, given))
        products += (read * given).sum(), (read * read).sum(), (given * given).sum()
    both, one, other = products
    return float(both / np.sqrt(one * other)) if one > 0 and other > 0 else float("nan")


def drift(alike: float) -> float:
    """Deviation in metres a second by which the scene may hold a figure back; 0 where it explains enough."""

    def noise(value: float) -> float:
        return float(np.sqrt(1 / max(value, CHANCE) ** 2 - 1))  # unexplained over explained deviation

    return 0.0 if np.isnan(alike) else DRIFT_SD * max(0.0, noise(alike) / noise(HELD) - 1)
