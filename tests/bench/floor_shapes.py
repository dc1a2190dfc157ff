"""Shapes of particles that learn_floor.py compares: numbers of components, proportions and static offsets."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from floor_fit import OFFSETS

from gait import Model
from gait.body.skeleton import ANGLES
from gait.learn.options import DEFAULT_COMPONENTS
from gait.learn.prior.fit import Learned

MOST = 12  # dimensions of a particle that its shape may use
LENGTHS = MOST - DEFAULT_COMPONENTS
USED = 5  # components that the tracker uses by default
OURS, PLAIN_BODY = "libgait", "libgait, no proportions"
TRACKED, UNMOVED = "libgait, as tracked", "libgait, as tracked without offsets"
ALL_OFFSETS = "+ offsets of all angles"


@dataclass(frozen=True)
class Shape:
    """Numbers of components and of proportions, and which angles have an offset."""

    components: int
    proportions: int
    angles: tuple[str, ...] = ()

    def __str__(self) -> str:
        counts = (self.components, self.proportions, *filter(None, [len(self.angles)]))
        return " + ".join(map(str, counts))

    def sections(self, learned: Learned) -> dict[str, Any]:
        """Curves, proportions and offsets of a learnt model, cut to this shape."""
        columns = [ANGLES.index(name) for name in self.angles]
        return {
            "CURV": learned.curves[: 1 + self.components],
            "PROP": learned.lengths[: self.proportions],
            "SHFT": learned.shifts[: self.proportions],
            OFFSETS: np.diag(learned.static)[columns],
        }


def _tracked(names: Iterable[str] = ANGLES) -> tuple[str, ...]:
    """Names of the angles that have an offset in the tracker by default."""
    wanted = Model().info.posture_angles
    return tuple(name for name in names if wanted >> ANGLES.index(name) & 1)


SIX, TRUNK = _tracked(), _tracked(("torso_x", "torso_y", "torso_z"))
#: MOST dimensions divided in other ways, none of which was chosen by its result.
DIVIDED = {
    "offsets for 2 components": Shape(6, 4, TRUNK),
    "offsets for 2 components, 4 proportions": Shape(6, 0, SIX),
    "offsets for 4 components, 2 proportions": Shape(4, 2, SIX),
    "offsets for 6 components": Shape(2, 4, SIX),
}
SHAPES = {
    OURS: Shape(DEFAULT_COMPONENTS, LENGTHS),
    ALL_OFFSETS: Shape(DEFAULT_COMPONENTS, LENGTHS, tuple(ANGLES)),
    **DIVIDED,
    PLAIN_BODY: Shape(DEFAULT_COMPONENTS, 0),
    UNMOVED: Shape(USED, 0),
    TRACKED: Shape(USED, 0, SIX),
}
