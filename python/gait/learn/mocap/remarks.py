"""What readers notice in files besides their motion: no error, but perhaps not what the user meant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

LONG = 5  # frames in a row in which nothing that moves stays at exactly 0
#: So many at 0 together: an angle may be clipped at 0, but no joint stays at the origin.
BONES, JOINTS, ANGLES = 3, 1, 3


@dataclass(frozen=True)
class Remarks:
    """What was noticed in one file.

    Attributes
    ----------
    labels : frozenset of str
        Plain labels of its markers, if there is a mapping of them.
    zeros : str
        What is exactly 0 for a while as if it were missing, and where; empty if nothing is.
    """

    labels: frozenset[str] = frozenset()
    zeros: str = ""


NOTHING = Remarks()


@dataclass
class Noticed:
    """What was noticed in the files of a run: all labels, and each file with zeros."""

    labels: set[str] = field(default_factory=set)
    zeros: list[tuple[Path, str]] = field(default_factory=list)

    def add(self, path: Path, remarks: Remarks) -> None:
        """Add those of a file."""
        self.labels |= remarks.labels
        if remarks.zeros:
            self.zeros.append((path, remarks.zeros))


def zero_run(parts: Mapping[str, Floats], together: int) -> str:
    """Tell of the first of the parts (T, k) that are exactly 0 in LONG rows, `together` of them at once.

    Parts that are 0 throughout are fixed.  Empty if there are none.
    """
    runs = {name: _long_zeros(columns) for name, columns in parts.items()}
    at_once = sum(runs.values(), np.zeros(len(next(iter(runs.values()), ())), int)) >= together
    if not at_once.any():
        return ""
    first = int(np.argmax(at_once))
    name = next(name for name, run in runs.items() if run[first])
    rest = at_once[first:]
    last = first + (len(rest) if rest.all() else int(np.argmin(rest)))
    return f"{name} in frames {first + 1} to {last}"


def _long_zeros(columns: Floats) -> npt.NDArray[np.bool_]:
    """Rows (T,) that belong to a run of LONG or more rows of exact zeros, of a part that moves."""
    zero = (columns == 0).all(axis=1)
    if not (zero < np.isfinite(columns).all(axis=1)).any():
        return np.zeros(len(zero), bool)
    begins = np.convolve(zero, np.ones(LONG), "full")[LONG - 1 :] >= LONG  # LONG rows from here are 0
    return np.convolve(begins, np.ones(LONG), "full")[: len(zero)] > 0
