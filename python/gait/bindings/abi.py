"""The C interface in ctypes: enumerations, structures and one table of functions.

The loaded library describes the fields of its structures (``gait_field_at``); `define` sets them on the
classes below.  Enumerations and limits are repeated from libgait/include, and tests/python/test_abi.py
compares them.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Iterator
from ctypes import (
    POINTER,
    c_char_p,
    c_double,
    c_float,
    c_int32,
    c_int64,
    c_size_t,
    c_uint32,
    c_uint64,
    c_void_p,
)
from enum import IntEnum, IntFlag
from typing import Any, NamedTuple

ABI = 10
NEWEST_FIELD = (
    "gait_frame",
    "person",
)  # added last; an older library of this ABI lacks it
ALIGN = 64
MAX_JOINTS, MAX_ANGLES, MAX_COMPONENTS, MAX_PROPORTIONS, MAX_CAMERAS = 32, 32, 16, 8, 4
MAX_CLASSES, MAX_PIXELS = 8, 16000
MAX_HYPOTHESES, MAX_PEOPLE = 8, 4  # of a start
SEGMENT_HEADINGS = (
    0,
    2,
    8,
)  # turned copies of training segments; 0: heading unknown when lifting


class Result(IntEnum):
    """Outcome of a call, ``gait_result``."""

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
    """Set of defaults: the product's, or the likelihood and dynamics of the paper."""

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
    """State of a track: how far its estimate can be trusted."""

    INIT = 0
    TRACKING = 1
    AMBIGUOUS = 2
    LOST = 3


class Flag(IntFlag):
    """What happened in a step."""

    RESAMPLED = 1
    NO_IMAGE = 2
    DEGENERATE = 4
    UNSUPPORTED = 8
    OTHERS_FIT = 16


class Projection(IntEnum):
    """Projection of 2-D keypoints, ``GAIT_LIFT_PERSPECTIVE`` and so on."""

    PERSPECTIVE = 0
    ORTHOGRAPHIC = 1


class LiftFlag(IntFlag):
    """Reasons to distrust an estimate of a stream, ``GAIT_LIFT_UNOBSERVED`` and so on."""

    UNOBSERVED = 1
    POOR_FIT = 2


class Error(ctypes.Structure):
    """``gait_error``."""


class ImageView(ctypes.Structure):
    """``gait_image``."""


class CameraC(ctypes.Structure):
    """``gait_camera``."""


class StateC(ctypes.Structure):
    """``gait_state``."""


class PoseC(ctypes.Structure):
    """``gait_pose``."""


class ModelInfoC(ctypes.Structure):
    """``gait_model_info``."""


class Tasks(ctypes.Structure):
    """``gait_tasks``."""


class TrackerConfigC(ctypes.Structure):
    """``gait_tracker_config``."""


class KeypointC(ctypes.Structure):
    """``gait_keypoint``."""


class CameraPoseC(ctypes.Structure):
    """``gait_camera_pose``."""


class FrameC(ctypes.Structure):
    """``gait_frame``."""


class EstimateC(ctypes.Structure):
    """``gait_estimate``."""


class LiftInfoC(ctypes.Structure):
    """``gait_lift_info``."""


class LiftConfigC(ctypes.Structure):
    """``gait_lift_config``."""


class LiftFitC(ctypes.Structure):
    """``gait_lift_fit``."""


class LiftFrameC(ctypes.Structure):
    """``gait_lift_frame``."""


class FieldC(ctypes.Structure):
    """``gait_field``."""

    _fields_ = [
        *((name, c_char_p) for name in ("of", "name", "type", "array", "unit", "text")),
        ("offset", c_uint32),
        ("size", c_uint32),
        ("low", c_double),
        ("high", c_double),
    ]


class Field(NamedTuple):
    """A row of the library's description: a field, or, with an empty name, a struct."""

    of: str
    name: str
    type: str
    array: str
    unit: str
    text: str
    offset: int
    size: int
    low: float
    high: float


TaskFn = ctypes.CFUNCTYPE(None, c_void_p, c_int32)
RunFn = ctypes.CFUNCTYPE(None, c_void_p, TaskFn, c_void_p, c_int32)


class StartConfigC(ctypes.Structure):
    """``gait_start_config``."""


class BoxC(ctypes.Structure):
    """``gait_box``."""


class HypothesisC(ctypes.Structure):
    """``gait_hypothesis``."""


STRUCTS: dict[str, type[ctypes.Structure]] = {
    "gait_error": Error,
    "gait_image": ImageView,
    "gait_camera": CameraC,
    "gait_state": StateC,
    "gait_pose": PoseC,
    "gait_model_info": ModelInfoC,
    "gait_tasks": Tasks,
    "gait_tracker_config": TrackerConfigC,
    "gait_keypoint": KeypointC,
    "gait_camera_pose": CameraPoseC,
    "gait_frame": FrameC,
    "gait_estimate": EstimateC,
    "gait_lift_info": LiftInfoC,
    "gait_lift_config": LiftConfigC,
    "gait_lift_fit": LiftFitC,
    "gait_lift_frame": LiftFrameC,
    "gait_start_config": StartConfigC,
    "gait_box": BoxC,
    "gait_hypothesis": HypothesisC,
}

_TYPES: dict[str, Any] = {
    "char": ctypes.c_char,
    "float": c_float,
    "double": c_double,
    "int32_t": c_int32,
    "int64_t": c_int64,
    "uint32_t": c_uint32,
    "uint64_t": c_uint64,
    "void *": c_void_p,
    "const uint8_t *": c_void_p,
    "gait_run_fn *": RunFn,
    "const gait_keypoint *": POINTER(KeypointC),
    "const gait_camera_pose *": POINTER(CameraPoseC),
    **dict.fromkeys(
        ("gait_result", "gait_mode", "gait_pixel_format", "gait_track_status", "gait_projection"), c_int32
    ),
    **STRUCTS,
}


class _ARRAY:
    """Argument type: a contiguous array is passed as a pointer to its numbers, None as a null pointer."""

    @staticmethod
    def from_param(array: Any) -> c_void_p:
        """Convert an argument; ctypes calls this."""
        return c_void_p(None if array is None else array.ctypes.data)


_RESULT, _HANDLE, _ERR = c_int32, c_void_p, POINTER(Error)
_SIZE, _STATE = POINTER(c_size_t), POINTER(StateC)


def _made(kind: str, *arguments: Any) -> Iterator[tuple[str, list[Any], Any]]:
    """Yield the signatures of the two functions that make an object: its size in bytes, and its init."""
    yield f"gait_{kind}_bytes", [*arguments, _SIZE, _ERR], _RESULT
    yield f"gait_{kind}_init", [_ARRAY, c_size_t, *arguments, POINTER(_HANDLE), _ERR], _RESULT


FUNCTIONS: tuple[tuple[str, list[Any], Any], ...] = (
    *_made("model", _ARRAY, c_size_t),
    *_made("tracker", _HANDLE, POINTER(TrackerConfigC)),
    *_made("pool", c_int32),
    *_made("lift", _HANDLE, POINTER(LiftConfigC)),
    *_made("start", _HANDLE, POINTER(StartConfigC)),
    ("gait_result_name", [_RESULT], c_char_p),
    ("gait_version", [], c_uint32),
    ("gait_cpu_features", [], c_uint32),
    ("gait_cpu_name", [c_uint32], c_char_p),
    ("gait_abi", [], c_uint32),
    ("gait_field_at", [c_uint32, POINTER(FieldC)], _RESULT),
    ("gait_model_get_info", [_HANDLE, POINTER(ModelInfoC), _ERR], _RESULT),
    ("gait_model_joint_name", [_HANDLE, c_int32], c_char_p),
    ("gait_model_angle_name", [_HANDLE, c_int32], c_char_p),
    ("gait_model_limb_name", [_HANDLE, c_int32], c_char_p),
    ("gait_model_class_name", [_HANDLE, c_int32], c_char_p),
    ("gait_model_of_class", [_HANDLE, c_int32], c_void_p),
    ("gait_model_pose", [_HANDLE, _STATE, POINTER(PoseC), _ERR], _RESULT),
    ("gait_model_angle_mask", [_HANDLE, c_char_p, POINTER(c_uint32), _ERR], _RESULT),
    ("gait_model_pelvis_height", [_HANDLE, _STATE, POINTER(c_float), _ERR], _RESULT),
    ("gait_camera_check", [POINTER(CameraC), _ERR], _RESULT),
    ("gait_render", [_HANDLE, POINTER(CameraC), _STATE, _ARRAY, c_int32, _ERR], _RESULT),
    ("gait_tracker_fill", [POINTER(TrackerConfigC), c_size_t, c_int32], None),
    ("gait_tracker_set_background", [_HANDLE, c_int32, POINTER(ImageView), _ERR], _RESULT),
    ("gait_tracker_prior", [_HANDLE, _STATE, _STATE, _ERR], _RESULT),
    ("gait_tracker_start", [_HANDLE, _STATE, _STATE, c_int64, _ERR], _RESULT),
    ("gait_tracker_step", [_HANDLE, POINTER(FrameC), POINTER(EstimateC), _ERR], _RESULT),
    ("gait_tracker_lagged", [_HANDLE, c_int32, POINTER(EstimateC), _ERR], _RESULT),
    ("gait_tracker_set_particles", [_HANDLE, c_int32, _ERR], _RESULT),
    ("gait_tracker_particles", [_HANDLE, _STATE, _ARRAY, c_int32, _ERR], c_int32),
    ("gait_tracker_predict", [_HANDLE, _ARRAY, c_int32, c_double, _ERR], _RESULT),
    ("gait_tracker_digest", [_HANDLE], c_uint64),
    ("gait_tracker_save", [_HANDLE, _ARRAY, c_size_t, _SIZE, _ERR], _RESULT),
    ("gait_tracker_restore", [_HANDLE, _ARRAY, c_size_t, _ERR], _RESULT),
    ("gait_pool_tasks", [_HANDLE], Tasks),
    ("gait_pool_stop", [_HANDLE], None),
    ("gait_lift_get_info", [_HANDLE, POINTER(LiftInfoC), _ERR], _RESULT),
    ("gait_lift_fill", [POINTER(LiftConfigC), c_size_t], None),
    ("gait_lift_marker_name", [_HANDLE, c_int32], c_char_p),
    ("gait_lift_segment", [_HANDLE, _ARRAY, _ARRAY, POINTER(LiftFitC), _ERR], _RESULT),
    ("gait_lift_segment_robust", [_HANDLE, _ARRAY, _ARRAY, _ARRAY, POINTER(LiftFitC), _ERR], _RESULT),
    ("gait_lift_expect", [_HANDLE, _ARRAY, c_double, c_double, _ERR], _RESULT),
    ("gait_lift_positions", [_HANDLE, _ARRAY, _ARRAY, _ERR], _RESULT),
    ("gait_lift_unknowns", [_HANDLE], c_int32),
    ("gait_lift_posterior", [_HANDLE, _ARRAY, _ARRAY, _ERR], _RESULT),
    ("gait_lift_scale", [_HANDLE, POINTER(c_double), _ERR], _RESULT),
    ("gait_lift_least_squares", [_HANDLE, _ARRAY, _ERR], _RESULT),
    ("gait_lift_uncertain", [_HANDLE, c_int32, _ARRAY, _ARRAY, _ERR], _RESULT),
    ("gait_lift_fix", [_HANDLE, _ARRAY, _ERR], _RESULT),
    ("gait_lift_batch", [_HANDLE, c_int32, _ARRAY, _ARRAY, _ERR], _RESULT),
    ("gait_lift_push", [_HANDLE, c_int64, _ARRAY, _ARRAY, _ERR], _RESULT),
    ("gait_lift_estimate", [_HANDLE, POINTER(LiftFrameC), _ERR], _RESULT),
    ("gait_lift_reset", [_HANDLE], None),
    ("gait_start_fill", [POINTER(StartConfigC), c_size_t], None),
    ("gait_start_set_pose", [_HANDLE, POINTER(CameraPoseC), _ERR], _RESULT),
    ("gait_start_add", [_HANDLE, c_int64, POINTER(KeypointC), _ERR], _RESULT),
    ("gait_start_add_boxes", [_HANDLE, c_int64, POINTER(BoxC), c_int32, _ERR], _RESULT),
    (
        "gait_start_find_boxes",
        [_HANDLE, POINTER(ImageView), POINTER(ImageView), POINTER(BoxC), c_int32, POINTER(c_int32), _ERR],
        _RESULT,
    ),
    (
        "gait_start_other_scene",
        [_HANDLE, POINTER(ImageView), POINTER(ImageView), POINTER(c_int32), _ERR],
        _RESULT,
    ),
    ("gait_start_box_stature", [_HANDLE, POINTER(BoxC), POINTER(c_float), _ERR], _RESULT),
    ("gait_start_reset", [_HANDLE], None),
    ("gait_hypothesis_walks", [POINTER(HypothesisC)], c_int32),
    ("gait_tracker_start_hypotheses", [_HANDLE, POINTER(HypothesisC), c_int32, c_int64, _ERR], _RESULT),
    ("gait_start_solve", [_HANDLE, c_int64, POINTER(HypothesisC), c_int32, POINTER(c_int32), _ERR], _RESULT),
    ("gait_lift_remove_spikes", [c_int32, c_int32, _ARRAY, _ARRAY, _ARRAY, _ARRAY], c_int32),
    ("gait_lift_weight_outliers", [c_int32, _ARRAY, _ARRAY, _ARRAY], c_int32),
)
"""Every C function: name, argument types, result type."""


def fields(library: ctypes.CDLL) -> list[Field]:
    """Read the library's description of its structs."""
    row = FieldC()
    rows: list[Field] = []
    while library.gait_field_at(len(rows), ctypes.byref(row)) == Result.OK:
        words = [getattr(row, name).decode() for name in ("of", "name", "type", "array", "unit", "text")]
        rows.append(Field._make([*words, row.offset, row.size, row.low, row.high]))
    return rows


def define(rows: list[Field]) -> None:
    """Give every structure its fields, if that has not been done.

    Raises
    ------
    KeyError
        If a field has a type that this package does not know.
    """
    for name, struct in STRUCTS.items():
        if not hasattr(struct, "_fields_"):
            struct._fields_ = [(row.name, _ctype(row)) for row in rows if row.of == name and row.name]


def _ctype(row: Field) -> Any:
    """Make the type of a field, such as float[32][3]."""
    kind = _TYPES[row.type]
    for length in reversed(re.findall(r"\d+", row.array)):
        kind = kind * int(length)
    return kind


def declare(library: ctypes.CDLL) -> None:
    """Declare argument and result types of every function.

    Raises
    ------
    AttributeError
        If the library lacks a function.
    """
    for name, arguments, result in FUNCTIONS:
        function = getattr(library, name)
        function.argtypes, function.restype = arguments, result


def verify(rows: list[Field]) -> list[str]:
    """Compare the library's description with the structures here; return one line per difference."""
    theirs = {(row.of, row.name): (row.offset, row.size) for row in rows}
    ours = {(name, ""): (0, ctypes.sizeof(struct)) for name, struct in STRUCTS.items()}
    for name, struct in STRUCTS.items():
        for field, *_ in struct._fields_:
            at = getattr(struct, field)
            ours[name, field] = (at.offset, at.size)
    faults = []
    for key in sorted(ours.keys() | theirs.keys()):
        if ours.get(key) != theirs.get(key):
            here, there = ours.get(key, "nothing"), theirs.get(key, "nothing")
            faults.append(
                f"{'.'.join(filter(None, key))}: (offset, size) {here} here, {there} in the library"
            )
    return faults
