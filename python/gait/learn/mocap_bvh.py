"""Reader of Biovision hierarchies (.bvh)."""

from __future__ import annotations

from pathlib import Path

from gait.learn.recording import Recording


def read(path: Path) -> Recording:
    raise NotImplementedError
