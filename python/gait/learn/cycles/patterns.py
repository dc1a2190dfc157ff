"""Columns that miss the same rows, so that one design serves all of them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def same_columns(seen: npt.NDArray[np.bool_]) -> list[list[int]]:
    """Columns of (T, M) grouped by which of their rows are observed, in the order of their first."""
    groups: dict[bytes, list[int]] = {}
    for k, column in enumerate(seen.T):
        groups.setdefault(column.tobytes(), []).append(k)
    return list(groups.values())
