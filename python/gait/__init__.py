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
    from gait.camera import Camera
    from gait.estimate import Estimate
    from gait.frame import Joints
    from gait.initial import Start
    from gait.lifter import LiftConfig, LiftedFrame, Lifter
    from gait.model import Model, ModelInfo
    from gait.state import State
    from gait.tracker import Tracker
    from gait.trackerconfig import TrackerConfig
    from gait.video import Frame, Video, VideoWriter, background

_HOME = {
    "Camera": "camera",
    "Estimate": "estimate",
    "Flag": "_abi",
    "Frame": "video",
    "Joints": "frame",
    "LiftConfig": "lifter",
    "LiftedFrame": "lifter",
    "Lifter": "lifter",
    "Mode": "_abi",
    "Model": "model",
    "ModelInfo": "model",
    "Start": "initial",
    "State": "state",
    "Term": "_abi",
    "TrackStatus": "_abi",
    "Tracker": "tracker",
    "TrackerConfig": "trackerconfig",
    "Video": "video",
    "VideoWriter": "video",
    "background": "video",
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
