"""What segments leave uncertain: the volume of their posterior, and the displacements that are known least.

Leventon and Freeman (1998), fig. 6 and the volume after their eq. 6.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.lift.equations import View
from gait.lift.posterior import Posterior

Floats = npt.NDArray[np.float64]

COUNT = 3  # displacements, as in the paper's fig. 6


@dataclass(frozen=True)
class Uncertain:
    """Medians over segments.

    Attributes
    ----------
    log10_volume : float
        log10 of the posterior's volume over the prior's.
    sd : (COUNT,)
        Deviations of the least certain displacements, rms per marker, metres, largest first.
    along, rigid : (COUNT,)
        Shares of their energy along the line of sight, and that move the whole body as one.
    shares : (COUNT, J)
        Shares of their energy by marker.
    """

    log10_volume: float
    sd: Floats
    along: Floats
    rigid: Floats
    shares: Floats


def of(segments: Sequence[Posterior], view: View) -> Uncertain:
    """Sum up the segments of a sequence, each alone."""
    each = np.median([_least_certain(found, view) for found in segments], axis=0)
    volume = float(np.median([found.log10_volume for found in segments]))
    return Uncertain(volume, each[:, 0], each[:, 1], each[:, 2], each[:, 3:])


def _least_certain(found: Posterior, view: View) -> Floats:
    """Deviation, share along the line of sight, rigid share and shares by marker, (COUNT, 3 + J)."""
    sd, modes = uncertain_modes(found, COUNT)
    sight, size = view.sight(found.points), np.sqrt(modes[0, ..., 0].size)
    rows = zip(sd.tolist(), modes, strict=True)
    return np.array(
        [[s / size, share_along(m, sight), share_rigid(m), *np.sum(m**2, axis=(0, 2))] for s, m in rows]
    )


def uncertain_modes(found: Posterior, count: int) -> tuple[Floats, Floats]:
    """Directions of largest posterior deviation, within the modes.

    Returns
    -------
    sd : (count,)
        Metres, along the unit vectors below, largest first.
    modes : (count, F, J, 3)
        Unit vectors over all coordinates.
    """
    q, r = np.linalg.qr(found.gaussian.modes.reshape(len(found.gaussian.modes), -1).T)
    values, vectors = np.linalg.eigh(r @ found.covariance @ r.T)
    order = np.argsort(values)[::-1][:count]
    modes = (q @ vectors[:, order]).T.reshape(-1, *found.gaussian.mean.shape)
    return np.sqrt(np.maximum(values[order], 0)), modes


def share_along(mode: Floats, axis: Floats) -> float:
    """Share of a mode's energy (F, J, 3) that is along a unit vector (3,)."""
    return float(np.sum((mode @ axis) ** 2) / np.sum(mode**2))


def share_rigid(mode: Floats) -> float:
    """Share of a mode's energy (F, J, 3) that is one displacement of all markers in all frames."""
    points = mode.reshape(-1, 3)
    return float(len(points) * np.sum(points.mean(axis=0) ** 2) / np.sum(points**2))
