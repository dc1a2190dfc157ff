"""What is known of the stretches of a person's body (`articulated.STRETCHES`), as Gaussians."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.learn.solve import articulated

Floats = npt.NDArray[np.float64]

STATURE = 1.7  # metres
SD = articulated.STRETCH_SD
GOAL = np.array([np.log(STATURE)] + [0.0] * (len(SD) - 1))  #: generic proportions


@dataclass(frozen=True)
class Information:
    """Gaussian in information form: independent sources add.

    Attributes
    ----------
    matrix : (S, S)
        Inverse of the covariance; singular where nothing is known.
    vector : (S,)
        The matrix times the mean.
    """

    matrix: Floats
    vector: Floats

    def __add__(self, other: Information) -> Information:
        return Information(self.matrix + other.matrix, self.vector + other.vector)

    def mean(self) -> Floats:
        """Give the most probable stretches (S,)."""
        return np.asarray(np.linalg.solve(self.matrix, self.vector), float)


PEOPLE = Information(np.diag(SD**-2), SD**-2 * GOAL)  #: before anything is observed
NOTHING = Information(np.zeros((len(SD), len(SD))), np.zeros(len(SD)))


def odds(one: Information, other: Information) -> float:
    """Logarithm of how much better one body explains two findings than two bodies do (the Bayes factor)."""
    return _evidence(one + other) + _evidence(NOTHING) - _evidence(one) - _evidence(other)


def _evidence(found: Information) -> float:
    """Logarithm of the probability of what was found of somebody, up to what does not depend on the body."""
    known = PEOPLE + found
    return float(known.vector @ known.mean() - np.linalg.slogdet(known.matrix)[1]) / 2
