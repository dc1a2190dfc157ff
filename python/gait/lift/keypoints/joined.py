"""Join the keypoints of one person in several cameras' films in one table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.io.keypoints_file import Keypoints, neighbours

Array = NDArray[np.float64]


def joined(views: Sequence[Keypoints], offsets: Sequence[float]) -> tuple[Keypoints, NDArray[np.intp]]:
    """Interpolate the points of several films at the frames of the first.

    Parameters
    ----------
    views : sequence of Keypoints
        Keypoints of each camera.
    offsets : sequence of float
        Start of each film but the first, seconds after the first.

    Returns
    -------
    keypoints : Keypoints
        The points of the first camera, then of the second and so on, so that names repeat.  Points are
        interpolated linearly between frames of their own film.
    camera : (P,)
        Number of each point's camera.
    """
    first = views[0]
    moved = [first, *(_at(one, first.time - began) for one, began in zip(views[1:], offsets, strict=True))]
    columns: dict[str, Any] = {
        name: _stacked([getattr(one, name) for one in moved], moved) for name in _COLUMNS
    }
    together = replace(
        first,
        names=tuple(name for one in moved for name in one.names),
        uv=np.concatenate([one.uv for one in moved], axis=1),
        confidence=np.hstack([one.confidence for one in moved]),
        repeated=max(one.repeated for one in moved),
        lasting_s=min(one.lasting_s for one in moved),
        **columns,
    )
    return together, np.repeat(np.arange(len(moved)), [len(one.names) for one in moved])


_COLUMNS = ("sd", "lasting_sd", "frame_sd", "by_hand")


def _stacked(columns: Sequence[Array | None], views: Sequence[Keypoints]) -> Array | None:
    if all(one is None for one in columns):
        return None
    return np.hstack(
        [
            np.full(view.confidence.shape, np.nan) if one is None else one
            for one, view in zip(columns, views, strict=True)
        ]
    )


def _at(keypoints: Keypoints, times: Array) -> Keypoints:
    """Interpolate keypoints at other times (T,), seconds of their film."""
    after, share, known = neighbours(keypoints.time, times)

    def between(values: Array) -> Array:
        weight = share.reshape(-1, *[1] * (values.ndim - 1))
        earlier, later = values[after - 1], values[after]
        mixed = earlier + weight * (later - earlier)
        mixed = np.where(weight == 0, earlier, np.where(weight == 1, later, mixed))  # also if one is NaN
        return np.where(known.reshape(weight.shape), mixed, np.nan)

    columns: dict[str, Any] = {}
    for name in _COLUMNS:
        values = getattr(keypoints, name)
        columns[name] = None if values is None else between(values)
    return replace(
        keypoints,
        frame=np.arange(len(times)),
        time=times,
        uv=between(keypoints.uv),
        confidence=np.nan_to_num(between(keypoints.confidence)),
        **columns,
    )
