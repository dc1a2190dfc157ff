"""Learn how people walk from motion capture, and track them in video.

Each name below is imported when it is first used, so ``import gait`` is quick and learning works without the
C library.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gait import extras
from gait._version import __version__
from gait.errors import GaitArgumentError, GaitError, GaitLimitError, LibraryError, UserError

if TYPE_CHECKING:
    from gait.bindings.abi import Flag, Mode, Term, TrackStatus
    from gait.bindings.config import TrackerConfig
    from gait.bindings.estimate import Estimate
    from gait.bindings.frame import FrameKeypoints
    from gait.bindings.initial import Start
    from gait.bindings.lifter import LiftConfig, LiftedFrame, Lifter
    from gait.bindings.model import Model, ModelInfo
    from gait.bindings.state import State
    from gait.camera.camera import Camera
    from gait.camera.path import CameraPath, CameraPose
    from gait.detect.people import PeopleDetector
    from gait.io.keypoints_file import Keypoints
    from gait.io.video import Frame, Video, VideoWriter, background
    from gait.track.tracker import Tracker

_HOME = {
    "Camera": "camera.camera",
    "CameraPath": "camera.path",
    "CameraPose": "camera.path",
    "Estimate": "bindings.estimate",
    "Flag": "bindings.abi",
    "Frame": "io.video",
    "FrameKeypoints": "bindings.frame",
    "Keypoints": "io.keypoints_file",
    "LiftConfig": "bindings.config",
    "LiftedFrame": "bindings.lifter",
    "Lifter": "bindings.lifter",
    "Mode": "bindings.abi",
    "Model": "bindings.model",
    "ModelInfo": "bindings.model",
    "PeopleDetector": "detect.people",
    "Start": "bindings.initial",
    "State": "bindings.state",
    "Term": "bindings.abi",
    "TrackStatus": "bindings.abi",
    "Tracker": "track.tracker",
    "TrackerConfig": "bindings.config",
    "Video": "io.video",
    "VideoWriter": "io.video",
    "background": "io.video",
}

_OF_VIDEO = ("PeopleDetector", "Video", "VideoWriter", "background")

__all__ = [
    "Camera",
    "CameraPath",
    "CameraPose",
    "Estimate",
    "Flag",
    "Frame",
    "FrameKeypoints",
    "GaitArgumentError",
    "GaitError",
    "GaitLimitError",
    "Keypoints",
    "LibraryError",
    "LiftConfig",
    "LiftedFrame",
    "Lifter",
    "Mode",
    "Model",
    "ModelInfo",
    "PeopleDetector",
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
    if name in _OF_VIDEO and (lacking := extras.remedy(f"gait.{name}", ["video"])):
        raise ImportError(lacking)
    return getattr(import_module(f"gait.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
