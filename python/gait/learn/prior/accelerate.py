"""Fixed-point iterations in fewer passes (Anderson 1965; type II of Fang and Saad 2009)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

MEMORY = 5  # steps that are combined
RIDGE = 1e-10  # of the combination's normal equations, relative to their trace


class Mixer:
    """Combines the last steps x -> g(x) into the next x; the caller checks that it helps."""

    def __init__(self) -> None:
        self._points: list[Floats] = []
        self._images: list[Floats] = []

    def forget(self) -> None:
        """Begin anew after a step that did not help."""
        self._points.clear()
        self._images.clear()

    def step(self, point: Floats, image: Floats, weighed: int) -> Floats:
        """Next point from the latest pair.

        Parameters
        ----------
        point, image : (n,)
            x and g(x).
        weighed : int
            How many leading entries decide the combination; the others follow.
        """
        self._points = [*self._points, point][-MEMORY - 1 :]
        self._images = [*self._images, image][-MEMORY - 1 :]
        if len(self._points) < 2:
            return image
        steps = np.array([(g - x)[:weighed] for x, g in zip(self._points, self._images, strict=True)])
        change = np.diff(steps, axis=0)
        normal = change @ change.T
        normal += (RIDGE * np.trace(normal) + 1e-300) * np.eye(len(normal))
        weight = np.linalg.solve(normal, change @ steps[-1])
        return np.asarray(image - weight @ np.diff(np.array(self._images), axis=0))
