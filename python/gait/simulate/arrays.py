"""Array types of the simulator."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Floats = NDArray[np.floating[Any]]
"""Single precision in the renderer's inner loops, where it halves the time."""
Ints = NDArray[np.integer[Any]]
Picture = NDArray[np.uint8]
"""(h, w, 3) BGR."""
