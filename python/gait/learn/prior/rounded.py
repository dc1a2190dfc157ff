"""Numbers as a blob stores them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

DIGITS = 6
"""Decimals kept: a millionth of a radian or stature is far below what recordings show, and far above the last
bits (1e-12) in which the algebra of two machines differs."""


def rounded(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float32]:
    """Values as stored, without the sign of a zero: a last bit decides it."""
    return (np.round(values, DIGITS) + 0.0).astype(np.float32)
