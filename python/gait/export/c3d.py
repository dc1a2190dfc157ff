"""C3D: joints in millimetres, z up, with heel strikes and toe-offs as events; no analog channels."""

from __future__ import annotations

import errno
import math
import os
import struct
from pathlib import Path

import numpy as np

from gait.export.motion import Motion

_LABELS = (("strike", "Foot Strike"), ("off", "Foot Off"))
_SOFTWARE = "libgait"
_BLOCK = 512  # bytes
_PLACE = 16  # bytes of a point in a frame: x, y, z and residual
_SPACE = 1 << 16  # bytes, more than a disk has on which the last write failed


def write(path: Path, motion: Motion) -> int:
    """Write the joints; return the number of events. In missing frames, points are marked invalid."""
    import ezc3d

    file = ezc3d.c3d()
    points = np.ones((4, len(motion.names), len(motion.places)))
    points[:3] = 1000 * motion.places.transpose(2, 1, 0)
    file["parameters"]["POINT"]["RATE"]["value"] = [motion.rate]
    file["parameters"]["POINT"]["LABELS"]["value"] = list(motion.names)
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["data"]["points"] = points
    file.add_parameter("POINT", "X_SCREEN", ["+X"])
    file.add_parameter("POINT", "Y_SCREEN", ["+Z"])
    file.add_parameter("MANUFACTURER", "SOFTWARE", [_SOFTWARE])
    file.add_parameter("TRIAL", "CAMERA_RATE", [motion.rate])
    found = motion.events()
    events = [
        (time - motion.first, side.capitalize(), label)
        for kind, label in _LABELS
        for side, times in (getattr(found, kind).items() if found else ())
        for time in times.tolist()
    ]
    events.sort()
    file.add_parameter("EVENT", "USED", [len(events)])
    if events:
        seconds = np.array([time for time, _, _ in events])
        file.add_parameter("EVENT", "CONTEXTS", [side for _, side, _ in events])
        file.add_parameter("EVENT", "LABELS", [label for _, _, label in events])
        file.add_parameter("EVENT", "TIMES", np.stack([seconds // 60, seconds % 60]))
        file.add_parameter("EVENT", "SUBJECTS", [motion.name] * len(events))
    file.write(str(path))
    _require_complete(path, points[0].size)
    return len(events)


def _require_complete(path: Path, places: int) -> None:
    """OSError if the file is cut off: ezc3d reports no failure to write, such as that of a full disk."""
    with path.open("r+b") as file:
        header = file.read(_BLOCK)
        data = struct.unpack_from("<H", header, 16)[0] if len(header) == _BLOCK else 0  # first block, from 1
        end = _BLOCK * (data - 1 + math.ceil(places * _PLACE / _BLOCK))
        if data > 1 and file.seek(0, os.SEEK_END) >= end:  # ezc3d writes `data` last
            return
        file.seek(0, os.SEEK_END)
        file.write(bytes(max(end, _SPACE)))  # fails for the reason for which ezc3d could not write
    raise OSError(errno.EIO, os.strerror(errno.EIO), str(path))
