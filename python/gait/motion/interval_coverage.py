"""How honest a normal posterior is: coverage, probability integral transform, score, width."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr
from scipy.stats import chisquare

Array = NDArray[np.float64]

APART = 15  # frames between two that count as independent
_BINS = 10
_HALF = {"50": 0.6744898, "90": 1.6448536}  # half-widths of normal intervals, standard deviations
_TINY = 1e-9  # metres; a deviation of 0 is a claim to be exact


def coverage(found: Array, sd: Array, true: Array) -> dict[str, float]:
    """Share of the coordinates inside the normal 50 % and 90 % intervals.

    Parameters
    ----------
    found, sd, true : ndarray of the same shape
        Estimate, its standard deviation, truth.
    """
    off = np.abs(found - true)
    return {level: float((off <= half * sd).mean()) for level, half in _HALF.items()}


def calibration(found: Array, sd: Array, true: Array) -> dict[str, Any]:
    """Measures of the intervals beyond their coverage.

    Parameters
    ----------
    found, sd, true : ndarray of shape (n, 15, 3)
        EVAL15 in metres, frame by frame.

    Returns
    -------
    dict
        ``pit``: shares of 10 equal bins of the probability integral transform over frames `APART` apart,
        ``pit_chi2`` their chi-square statistic against flat and ``pit_p`` its p-value as if coordinates were
        independent (they are not: read it as a ranking); ``z2``: mean squared error in variances, 1 where the
        deviations are right; ``crps_mm``: continuous ranked probability score of a normal (Gneiting and
        Raftery 2007), lower is better; ``width_mm``: mean width of the 90 % intervals.
    """
    z = (true - found) / np.maximum(sd, _TINY)
    counts, _ = np.histogram(ndtr(z[::APART]), _BINS, (0.0, 1.0))
    flat = chisquare(counts)
    return {
        "pit": (counts / counts.sum()).tolist(),
        "pit_chi2": float(flat.statistic),
        "pit_p": float(flat.pvalue),
        "z2": float(np.mean(z**2)),
        "crps_mm": 1000 * float(crps(z, sd).mean()),
        "width_mm": 1000 * float(2 * _HALF["90"] * sd.mean()),
    }


def crps(z: Array, sd: Array) -> Array:
    """Continuous ranked probability score of normals of deviation `sd`, missed by `z` deviations."""
    density = np.exp(-0.5 * z**2) / np.sqrt(2 * np.pi)
    return np.asarray(sd * (z * (2 * ndtr(z) - 1) + 2 * density - 1 / np.sqrt(np.pi)))
