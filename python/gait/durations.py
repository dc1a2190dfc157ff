"""How long things took, in three figures."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def spread(values: ArrayLike) -> dict[str, float]:
    """Median, 99th percentile and maximum of at least one value."""
    median, p99, longest = np.percentile(np.asarray(values, float), [50, 99, 100])
    return {"median": float(median), "p99": float(p99), "max": float(longest)}
