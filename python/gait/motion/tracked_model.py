"""Which model's people a track is compared with if none is given: those of the model that tracked."""

from __future__ import annotations

import os

from gait.bindings.model import read_cyclic
from gait.bindings.shipped import SHIPPED, WALK
from gait.body.motion_classes import class_names
from gait.errors import UserError
from gait.io.track_file import Track


def model_for(track: Track, path: str | os.PathLike[str], given: str | None) -> str:
    """Return the given model, or the name of the shipped one that has the classes of motion of the track.

    A track without classes names no model, and takes the walk. `path`: of the track, for messages. UserError
    if no model is given and no shipped one has these classes in this order.
    """
    if given is not None:
        return given
    if not track.classes:
        return WALK
    for name in SHIPPED:
        if tuple(class_names(read_cyclic(name))) == track.classes:
            return name
    raise UserError(
        f"{path}: was tracked with the classes {' '.join(track.classes)}, which no model of the package has; "
        "give the model that was tracked with, -m MODEL"
    )
