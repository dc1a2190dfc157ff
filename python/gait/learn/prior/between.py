"""How people differ in one number, such as their stride rate."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

RATE_SD, LENGTH_SD = 0.07, 0.06  # of stride rate and length among people who walk as they like: share of mean
ADULT_STATURE = (1.70, 0.095)  # metres, mean and sd of adults of both sexes: a prior, not a training set's
ENOUGH = 3  # subjects that tell for themselves how people differ
LEAST_SD = 0.01  # share of the mean: even recordings that are all alike leave a doubt


def by_subject(values: Floats, group: npt.NDArray[np.intp], usual: float) -> tuple[float, float]:
    """Mean and sd of the subjects' means; sequences of NaN do not count.

    Fewer than `ENOUGH` subjects cannot tell how people differ: the variance is then drawn towards that of
    people in general, whose sd is `usual` of the mean, and never below what the sequences show.
    """
    group, values = group[np.isfinite(values)], values[np.isfinite(values)]
    if not len(values):
        return 0.0, 0.0
    means = np.array([values[group == g].mean() for g in np.unique(group)])
    middle, spread = float(means.mean()), means if len(means) > 1 else values
    seen = float(spread.std(ddof=1)) if len(spread) > 1 else 0.0
    told = min((len(means) - 1) / (ENOUGH - 1), 1.0)
    variance = told * seen**2 + (1 - told) * max(seen, usual * middle) ** 2
    return middle, max(float(np.sqrt(variance)), LEAST_SD * middle)
