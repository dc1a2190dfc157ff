"""Rerun (.rrd): joints and bones over time, and the state's numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gait.body.skeleton import BONES
from gait.export.motion import Motion

_JOINT, _BONE = 0.015, 0.008  # radii, metres
_ID = "libgait"  # application id; a file contains one recording


def write(path: Path, motion: Motion) -> int:
    """Write the motion's frames; return their number."""
    import rerun as rr

    stream = rr.RecordingStream(_ID, recording_id=motion.name)
    stream.save(str(path))
    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    place = {name: i for i, name in enumerate(motion.names)}
    pairs = [(place[a], place[b]) for a, b in BONES]
    rows = np.flatnonzero(motion.present)
    for row, k in enumerate(rows.tolist()):
        stream.set_time("time", duration=float(motion.time[k]))
        stream.set_time("frame", sequence=int(motion.track.frame[row]))
        joints = motion.places[k]
        stream.log(f"{motion.person}/joints", rr.Points3D(joints, radii=_JOINT))
        stream.log(f"{motion.person}/bones", rr.LineStrips3D([joints[[a, b]] for a, b in pairs], radii=_BONE))
        stream.log(f"{motion.person}/status", rr.TextLog(motion.track.status[row]))
        for name, values in motion.track.numbers.items():
            stream.log(f"state/{name}", rr.Scalars(float(values[row])))
    stream.flush()
    stream.disconnect()
    return len(rows)
