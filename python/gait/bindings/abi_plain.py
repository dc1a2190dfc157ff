"""Constants, enumerations and plain data of the C headers in ctypes; see `gait.bindings.abi`."""

from __future__ import annotations

import ctypes
from ctypes import (
    c_char,
    c_float,
    c_int32,
    c_uint32,
    c_void_p,
)
from enum import IntEnum, IntFlag

ABI = 7
ALIGN = 64
MAX_JOINTS, MAX_ANGLES, MAX_COMPONENTS, MAX_PROPORTIONS, MAX_CAMERAS = 32, 32, 16, 8, 4
MAX_MARKERS = 64


class Status(IntEnum):
    """Outcome of a call, ``gait_status``."""

    OK = 0
    ARG = -1
    STRUCT = -2
    MEMORY = -3
    LIMIT = -4
    MAGIC = -5
    VERSION = -6
    CORRUPT = -7
    STATE = -8
    NUMERIC = -9


class PixelFormat(IntEnum):
    """Layout of an image, ``GAIT_GREY8`` and so on."""

    GREY8 = 1
    RGB8 = 2
    BGR8 = 3


class Mode(IntEnum):
    """Set of defaults: the product's, or the paper's own likelihood and dynamics."""

    DEFAULT = 0
    PAPER = 1


class Term(IntFlag):
    """Terms of the likelihood."""

    TEXTURE = 1
    SILHOUETTE = 2
    EDGES = 4
    TEMPLATE = 8
    KEYPOINTS = 16


class TrackStatus(IntEnum):
    """What an estimate is worth."""

    INIT = 0
    TRACKING = 1
    AMBIGUOUS = 2
    LOST = 3


class Flag(IntFlag):
    """What happened in a step."""

    RESAMPLED = 1
    NO_IMAGE = 2
    DEGENERATE = 4


class Projection(IntEnum):
    """View of 2-D tracks, ``GAIT_LIFT_PERSPECTIVE`` and so on."""

    PERSPECTIVE = 0
    ORTHOGRAPHIC = 1


class LiftFlag(IntFlag):
    """What an estimate of a stream is worth, ``GAIT_LIFT_UNOBSERVED`` and so on."""

    UNOBSERVED = 1
    POOR_FIT = 2


class Error(ctypes.Structure):
    """``gait_error``."""

    _fields_ = [("result", c_int32), ("index", c_int32), ("text", c_char * 120)]


class AbiField(ctypes.Structure):
    """``gait_abi_field``."""

    _fields_ = [("type", c_char * 20), ("field", c_char * 24), ("offset", c_uint32), ("size", c_uint32)]


class ImageView(ctypes.Structure):
    """``gait_image``."""

    _fields_ = [
        ("data", c_void_p),
        ("width", c_int32),
        ("height", c_int32),
        ("stride", c_int32),
        ("format", c_int32),
    ]


class CameraC(ctypes.Structure):
    """``gait_camera``."""

    _fields_ = [
        ("width", c_int32),
        ("height", c_int32),
        ("fx", c_float),
        ("fy", c_float),
        ("cx", c_float),
        ("cy", c_float),
        ("R", c_float * 9),
        ("t", c_float * 3),
        ("distortion", c_float * 5),
    ]


class StateC(ctypes.Structure):
    """``gait_state``."""

    _fields_ = [
        ("phase", c_float),
        ("stride_hz", c_float),
        ("stature", c_float),
        ("heading", c_float),
        ("pitch", c_float),
        ("roll", c_float),
        ("turn_rate", c_float),
        ("pelvis", c_float * 3),
        ("coef", c_float * MAX_COMPONENTS),
        ("offset", c_float * MAX_ANGLES),
        ("proportion", c_float * MAX_PROPORTIONS),
    ]


class PoseC(ctypes.Structure):
    """``gait_pose``."""

    _fields_ = [("joint", c_float * 3 * MAX_JOINTS), ("angle", c_float * MAX_ANGLES)]


TaskFn = ctypes.CFUNCTYPE(None, c_void_p, c_int32)
RunFn = ctypes.CFUNCTYPE(None, c_void_p, TaskFn, c_void_p, c_int32)


class Tasks(ctypes.Structure):
    """``gait_tasks``."""

    _fields_ = [("run", RunFn), ("user", c_void_p)]
