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
    """

    log10_volume: float
    sd: Floats
    along: Floats
    rigid: Floats


def of(segments: Sequence[Posterior], view: View) -> Uncertain:
    """Sum up the segments of a sequence, each alone."""
    sd, along, rigid = np.median([_least_certain(found, view) for found in segments], axis=0)
    return Uncertain(float(np.median([found.log10_volume for found in segments])), sd, along, rigid)


def _least_certain(found: Posterior, view: View) -> Floats:
    """Deviations, shares along the line of sight and rigid shares of a segment, (3, COUNT)."""
    sd, modes = uncertain_modes(found, COUNT)
    sight = view.sight(found.points)
    shares = [[share_along(mode, sight) for mode in modes], [share_rigid(mode) for mode in modes]]
    return np.array([sd / np.sqrt(modes[0, ..., 0].size), *shares])


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
