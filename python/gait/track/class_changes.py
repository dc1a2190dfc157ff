"""Classes of motion of drawn motions, from the last frame back to the first.

The class before a frame is drawn from the filter's probabilities and the rates of change alone, as in Kim
(1994, J. Econometrics 60:1): P(j | k) is proportional to P(j) P(j to k).  A motion that changes class
continues its position, heading, stature, proportions and, if the person moves in both classes, its phase.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.bindings import abi
from gait.body.model_curves import pace
from gait.body.motion_classes import class_sections

Array = NDArray[np.float64]
Table = NDArray[np.floating[Any]]
Indices = NDArray[np.int64]

_MOST_LEAVING = 0.5  # largest probability of a change within a frame


@dataclass(frozen=True)
class Part:
    """Motions of one class that come from one class."""

    motions: Indices  #: indices of motions
    pairs: Indices  #: indices of the particles, of one class, from which they may come
    #: (columns,) numbers of the state that continue; None: all, as the class stays.
    columns: NDArray[np.bool_] | None = None


class ClassChanges:
    """Changes between the C classes of a model.

    Parameters
    ----------
    sections : mapping of str to ndarray
        Sections of the blob.
    """

    def __init__(self, sections: Mapping[str, Any]) -> None:
        table = np.asarray(sections["CLSW"], float)
        self._rate, self._concentration, self._phase, self._slope = np.moveaxis(table, 2, 0)
        self._moves = np.asarray(sections["CLIN"])[:, 0] != 0
        self._stride_rate = [class_sections(sections, k)["GAIT"][:2] for k in range(len(table))]
        self._continuing = np.zeros(ctypes.sizeof(abi.StateC) // 4, bool)
        for columns in map(_columns, ("phase", "stature", "pelvis", "proportion")):
            self._continuing[columns] = True
        self._continuing[_columns("pelvis").stop - 1] = False  # height, which belongs to the class

    @staticmethod
    def of(states: Table) -> Indices:
        """Classes (N,) of states (N, columns)."""
        return np.ascontiguousarray(states[:, _columns("motion_class")]).view(np.int32)[:, 0].astype(np.int64)

    def parts(
        self, before: Table, after: Table, seconds: float, random: np.random.Generator
    ) -> Iterator[Part]:
        """Draw the class of each motion before a change; `seconds`: time between the frames.

        before : ndarray of shape (N, columns)
            Particles of equal weight at the earlier frame.
        after : ndarray of shape (M, columns)
            States of the motions at the later frame.
        """
        was, now = self.of(before), self.of(after)
        to = self._probability(before, was, seconds)
        for k in np.unique(now):
            motions = np.flatnonzero(now == k)
            odds = np.bincount(was, to[:, k], len(self._moves))
            odds = odds if odds.sum() > 0 else np.bincount(was, minlength=len(self._moves)).astype(float)
            origin = random.choice(len(odds), len(motions), p=odds / odds.sum())
            for j in np.unique(origin):
                columns = None
                if j != k:
                    columns = self._continuing.copy()
                    columns[_columns("phase")] = self._moves[j] and self._moves[k]
                yield Part(motions[origin == j], np.flatnonzero(was == j), columns)

    def _probability(self, states: Table, was: Indices, seconds: float) -> Array:
        """Probability (N, C) that each state is in each class after this time (class_change.c)."""
        phase, stride_hz = (states[:, _columns(name)] for name in ("phase", "stride_hz"))
        faster = np.stack([pace(of, stride_hz[:, 0]) for of in self._stride_rate], axis=1)
        turn = np.cos(4 * np.pi * (phase - self._phase[was])) - 1
        exponent = self._concentration[was] * turn + self._slope[was] * faster[np.arange(len(was)), was, None]
        rates = self._rate[was] * np.where(self._moves[was, None], np.exp(exponent), 1.0)
        out = np.minimum(rates * seconds, _MOST_LEAVING / max(len(self._moves) - 1, 1))
        out[np.arange(len(was)), was] = 0.0
        out[np.arange(len(was)), was] = 1.0 - out.sum(axis=1)
        return np.asarray(out)


def _columns(name: str) -> slice:
    """Columns of a field of ``gait_state``."""
    field = getattr(abi.StateC, name)
    return slice(field.offset // 4, (field.offset + field.size) // 4)
