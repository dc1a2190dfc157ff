"""C3D: joints in millimetres, z up, with heel strikes and toe-offs as events; no analog channels."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gait.export.motion import Motion

_LABELS = (("strike", "Foot Strike"), ("off", "Foot Off"))
_SOFTWARE = "libgait"


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
    return len(events)
