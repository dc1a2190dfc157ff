"""The stick figure as the sensors would see it: blurred line segments, with exact slopes.

A stick is a line of strength 1 per pixel of its length, convolved with the sensors' Gaussian blur of
deviation s.  At a sensor it gives  exp(-d^2 / 2 s^2) (Phi((L - u) / s) - Phi(-u / s))  where u and d are
the coordinates along and across the stick and L is its length: an endless stick through a sensor gives 1.
Sticks that lie upon each other are not seen twice: a figure gives 1 - exp(-sum of its sticks).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from gait.body.skeleton import BONES
from gait.errors import UserError

Floats = npt.NDArray[np.float64]

#: The bones that are drawn of people, and the outlines of the trunk.
STICKS = (*BONES, *((f"{s}_shoulder", f"{s}_hip") for s in "lr"))
SHORTEST = 1e-3  # pixels; a stick that points at the viewer keeps a direction
_ROOT = 1 / np.sqrt(2 * np.pi)


@dataclass(frozen=True)
class Sticks:
    """Sticks between markers.

    Attributes
    ----------
    markers : (M,)
        Indices of the markers at ends of sticks.
    ends : (B, 2)
        Indices into `markers`.
    """

    markers: npt.NDArray[np.intp]
    ends: npt.NDArray[np.intp]

    @staticmethod
    def of(names: Sequence[str]) -> Sticks:
        """Sticks of a body whose markers are named.

        Raises
        ------
        UserError
            If a joint of the stick figure is not among them.
        """
        joints = list(dict.fromkeys(joint for stick in STICKS for joint in stick))
        missing = [joint for joint in joints if joint not in names]
        if missing:
            raise UserError(
                f"prior: has no marker {' '.join(missing)}; learn it with --segment-markers virtual"
            )
        markers = np.array([list(names).index(joint) for joint in joints], np.intp)
        ends = np.array([[joints.index(a), joints.index(b)] for a, b in STICKS], np.intp)
        return Sticks(markers, ends)

    def responses(self, uv: Floats, places: Floats, blur: Floats) -> tuple[Floats, Floats]:
        """Responses of sensors to the figure, and their slopes.

        Parameters
        ----------
        uv : (T, M, 2)
            Markers in the picture, pixels.
        places : (T, S, 2)
            Sensors, pixels.
        blur : (T,)
            Standard deviation of their Gaussian, pixels.

        Returns
        -------
        value : (T, S)
        slope : (T, S, M, 2)
            By the markers' pixels.
        """
        value, by_end = stick_responses(uv[:, self.ends], places, blur)
        join = np.zeros((self.ends.size, len(self.markers)))  # markers are ends of several sticks
        join[np.arange(self.ends.size), self.ends.ravel()] = 1.0
        left = np.exp(-value.sum(axis=2))
        return 1 - left, np.swapaxes((by_end * left[:, :, None, None]) @ join, 2, 3)


def stick_responses(ends: Floats, places: Floats, blur: Floats) -> tuple[Floats, Floats]:
    """Responses (T, S, B) of sensors (T, S, 2) to sticks (T, B, 2, 2), and slopes (T, S, 2, B * 2).

    Slopes are by column and row, then by sticks and their ends.
    """
    s = blur[:, None, None]
    along = ends[:, :, 1] - ends[:, :, 0]
    length = np.maximum(np.hypot(along[..., 0], along[..., 1]), SHORTEST)
    ex, ey = (along[:, None, :, i] / length[:, None] for i in (0, 1))
    x, y = (places[:, :, None, i] - ends[:, None, :, 0, i] for i in (0, 1))
    u, d, long = x * ex + y * ey, y * ex - x * ey, length[:, None]
    across = np.exp(-0.5 * (d / s) ** 2)
    near, far = u / s, (u - long) / s
    value = across * (ndtr(near) - ndtr(far))
    by_l = across * (_ROOT / s * np.exp(-0.5 * far * far))
    by_u = across * (_ROOT / s * np.exp(-0.5 * near * near)) - by_l
    by_d = -d / s**2 * value
    # turning the stick by n . (step of its end 1 - step of its end 0) / L moves (u, d) by (d, -u) of it
    turn = (by_u * d - by_d * u) / long
    slope = np.empty((*value.shape[:2], 2, value.shape[2], 2))
    for i, (e, n) in enumerate(((ex, -ey), (ey, ex))):
        slope[:, :, i, :, 1] = by_l * e + turn * n
        slope[:, :, i, :, 0] = -slope[:, :, i, :, 1] - by_u * e - by_d * n
    return value, slope.reshape(*value.shape[:2], 2, -1)
