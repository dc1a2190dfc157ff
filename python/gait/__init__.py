"""Learn how people walk from motion capture and track them in calibrated video.

The names below load what they need when first used, so ``import gait`` is quick and learning works without
the C library.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gait._version import __version__
from gait.errors import GaitArgumentError, GaitError, GaitLimitError, LibraryError, UserError

if TYPE_CHECKING:
    from gait._abi import Flag, Mode, Term, TrackStatus
    from gait.core.estimate import Estimate
    from gait.core.frame import Joints
    from gait.core.initial import Start
    from gait.core.lifter import LiftConfig, LiftedFrame, Lifter
    from gait.core.model import Model, ModelInfo
    from gait.core.state import State
    from gait.image.camera import Camera
    from gait.image.video import Frame, Video, VideoWriter, background
    from gait.track.tracker import Tracker
    from gait.track.trackerconfig import TrackerConfig

_HOME = {
    "Camera": "image.camera",
    "Estimate": "core.estimate",
    "Flag": "_abi",
    "Frame": "image.video",
    "Joints": "core.frame",
    "LiftConfig": "core.lifter",
    "LiftedFrame": "core.lifter",
    "Lifter": "core.lifter",
    "Mode": "_abi",
    "Model": "core.model",
    "ModelInfo": "core.model",
    "Start": "core.initial",
    "State": "core.state",
    "Term": "_abi",
    "TrackStatus": "_abi",
    "Tracker": "track.tracker",
    "TrackerConfig": "track.trackerconfig",
    "Video": "image.video",
    "VideoWriter": "image.video",
    "background": "image.video",
}

__all__ = [
    "Camera",
    "Estimate",
    "Flag",
    "Frame",
    "GaitArgumentError",
    "GaitError",
    "GaitLimitError",
    "Joints",
    "LibraryError",
    "LiftConfig",
    "LiftedFrame",
    "Lifter",
    "Mode",
    "Model",
    "ModelInfo",
    "Start",
    "State",
    "Term",
    "TrackStatus",
    "Tracker",
    "TrackerConfig",
    "UserError",
    "Video",
    "VideoWriter",
    "__version__",
    "background",
]


def __getattr__(name: str) -> Any:
    """Import a public name from its module on first use."""
    if name not in _HOME:
        raise AttributeError(f"module 'gait' has no attribute {name!r}")
    return getattr(import_module(f"gait.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
