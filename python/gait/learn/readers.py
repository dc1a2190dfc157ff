"""Files to bodies: which reader takes which kind of file."""

from __future__ import annotations

from pathlib import Path

from gait.learn import joint_file, mocap_asf, mocap_bvh
from gait.learn.body import Body, body
from gait.learn.reading import DEFAULT, Reading

RECORDINGS = {".amc": mocap_asf.read, ".bvh": mocap_bvh.read}
POSITIONS = {".csv": joint_file.read_csv, ".trc": joint_file.read_trc}
#: Suffixes that are learnt from.
KINDS = (*RECORDINGS, *POSITIONS)


def read(path: Path, reading: Reading = DEFAULT) -> Body:
    """Read a motion file by its suffix.

    Raises
    ------
    UserError
        If the file is malformed or lacks a joint; it names file, place and remedy.
    """
    suffix = path.suffix.lower()
    if suffix in POSITIONS:
        return POSITIONS[suffix](path, reading.fps, reading.zero_runs)
    return body(RECORDINGS[suffix](path, reading.fps, reading.zero_runs))
