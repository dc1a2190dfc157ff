"""Defaults of the C library, as the help texts name them."""

from __future__ import annotations

from gait.bindings.abi import Mode
from gait.errors import LibraryError
from gait.track.config import TrackerConfig


def particles(mode: Mode = Mode.DEFAULT) -> str:
    """Write the default number of particles; without a library the help must still be readable."""
    try:
        return str(TrackerConfig.default(mode).particles)
    except LibraryError:
        return "the library's default"
