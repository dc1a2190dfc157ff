"""What ``gait lift`` writes: CSV ``frame,time`` and per marker ``_x,_y,_z,_sx,_sy,_sz``, metres."""

from __future__ import annotations

import csv
import os
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gait.io.files import replacing

Floats = npt.NDArray[np.float64]


def write(
    path: str | os.PathLike[str],
    frame: npt.NDArray[np.integer],
    time: Floats,
    names: Sequence[str],
    places: Floats,
    sd: Floats,
) -> None:
    """Write places and standard deviations (T, J, 3) of markers; the file appears whole or not at all."""
    head = [f"{name}_{axis}" for name in names for axis in ("x", "y", "z", "sx", "sy", "sz")]
    values = np.concatenate([places, sd], axis=2).reshape(len(frame), -1)
    with replacing(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["frame", "time", *head])
        for number, second, row in zip(frame, time, values, strict=True):
            table.writerow([int(number), f"{second:.6f}", *(f"{value:.5f}" for value in row)])
