"""The C interface in ctypes: structures, enumerations and one table of functions.

Mirrors the headers of libgait/include; `verify` compares every size and offset with those of the compiled
library.
"""

from __future__ import annotations

import ctypes
from ctypes import (
    POINTER,
    c_char_p,
    c_double,
    c_float,
    c_int32,
    c_int64,
    c_size_t,
    c_uint8,
    c_uint32,
    c_uint64,
    c_void_p,
)
from typing import Any

from gait.bindings import abi_lift as lift
from gait.bindings.abi_lift import LiftConfigC as LiftConfigC
from gait.bindings.abi_lift import LiftFitC as LiftFitC
from gait.bindings.abi_lift import LiftFrameC as LiftFrameC
from gait.bindings.abi_lift import LiftInfoC as LiftInfoC
from gait.bindings.abi_plain import ABI as ABI
from gait.bindings.abi_plain import ALIGN as ALIGN
from gait.bindings.abi_plain import MAX_ANGLES as MAX_ANGLES
from gait.bindings.abi_plain import MAX_CAMERAS as MAX_CAMERAS
from gait.bindings.abi_plain import MAX_COMPONENTS as MAX_COMPONENTS
from gait.bindings.abi_plain import MAX_JOINTS as MAX_JOINTS
from gait.bindings.abi_plain import MAX_MARKERS as MAX_MARKERS
from gait.bindings.abi_plain import MAX_PROPORTIONS as MAX_PROPORTIONS
from gait.bindings.abi_plain import AbiField as AbiField
from gait.bindings.abi_plain import CameraC as CameraC
from gait.bindings.abi_plain import Error as Error
from gait.bindings.abi_plain import Flag as Flag
from gait.bindings.abi_plain import ImageView as ImageView
from gait.bindings.abi_plain import LiftFlag as LiftFlag
from gait.bindings.abi_plain import Mode as Mode
from gait.bindings.abi_plain import PixelFormat as PixelFormat
from gait.bindings.abi_plain import PoseC as PoseC
from gait.bindings.abi_plain import Projection as Projection
from gait.bindings.abi_plain import RunFn as RunFn
from gait.bindings.abi_plain import StateC as StateC
from gait.bindings.abi_plain import Status as Status
from gait.bindings.abi_plain import TaskFn as TaskFn
from gait.bindings.abi_plain import Tasks as Tasks
from gait.bindings.abi_plain import Term as Term
from gait.bindings.abi_plain import TrackStatus as TrackStatus


class ModelInfoC(ctypes.Structure):
    """``gait_model_info``."""

    _fields_ = [
        ("joints", c_int32),
        ("angles", c_int32),
        ("components", c_int32),
        ("phases", c_int32),
        ("limbs", c_int32),
        ("proportions", c_int32),
        ("stride_hz", c_float),
        ("stride_hz_sd", c_float),
        ("stride_length", c_float),
        ("stride_length_sd", c_float),
        ("cyclic", c_int32),
        ("posture_angles", c_uint32),
        ("digest", c_uint64),
    ]


class TrackerConfigC(ctypes.Structure):
    """``gait_tracker_config``."""

    _fields_ = [
        ("struct_size", c_uint64),
        ("seed", c_uint64),
        ("offset_angles", c_int64),
        ("mode", c_int32),
        ("particles", c_int32),
        ("acquisition_particles", c_int32),
        ("components", c_int32),
        ("tasks", c_int32),
        ("cameras", c_int32),
        ("lag", c_int32),
        ("proportions", c_int32),
        ("terms", c_uint32),
        ("term_weight", c_float * 5),
        ("missed_weight", c_float),
        ("girth", c_float),
        ("resample_ess", c_float),
        ("evidence_time", c_float),
        ("rejuvenation_time", c_float),
        ("max_dt", c_float),
        ("phase_noise", c_float),
        ("rate_noise", c_float),
        ("settle_time", c_float),
        ("rate_time", c_float),
        ("forward_noise", c_float),
        ("lateral_noise", c_float),
        ("vertical_noise", c_float),
        ("heading_noise", c_float),
        ("turn_sd", c_float),
        ("turn_time", c_float),
        ("tilt_noise", c_float),
        ("tilt_time", c_float),
        ("coef_noise", c_float),
        ("coef_time", c_float),
        ("stature_noise", c_float),
        ("stature_noise_start", c_float),
        ("offset_noise", c_float),
        ("proportion_noise", c_float),
        ("cpu_mask", c_uint32),
        ("joint_sd_model", c_float),
        ("camera", CameraC * MAX_CAMERAS),
        ("exec", Tasks),
    ]


class KeypointC(ctypes.Structure):
    """``gait_track``."""

    _fields_ = [("u", c_float), ("v", c_float), ("sd", c_float)]


class FrameC(ctypes.Structure):
    """``gait_frame``."""

    _fields_ = [
        ("utime", c_int64),
        ("image", ImageView * MAX_CAMERAS),
        ("keypoints", POINTER(KeypointC) * MAX_CAMERAS),
    ]


class EstimateC(ctypes.Structure):
    """``gait_estimate``."""

    _fields_ = [
        ("utime", c_int64),
        ("frame", c_uint64),
        ("log_evidence", c_double),
        ("mean", StateC),
        ("sd", StateC),
        ("best", StateC),
        ("pose", PoseC),
        ("joint_sd", c_float * 3 * MAX_JOINTS),
        ("ess", c_float),
        ("phase_r", c_float),
        ("hypothesis_weight", c_float),
        ("speed", c_float),
        ("status", c_int32),
        ("flags", c_uint32),
    ]


STRUCTS: dict[str, type[ctypes.Structure]] = {
    "gait_error": Error,
    "gait_image": ImageView,
    "gait_camera": CameraC,
    "gait_state": StateC,
    "gait_pose": PoseC,
    "gait_tasks": Tasks,
    "gait_model_info": ModelInfoC,
    "gait_tracker_config": TrackerConfigC,
    "gait_keypoint": KeypointC,
    "gait_frame": FrameC,
    "gait_estimate": EstimateC,
    **lift.STRUCTS,
}

_STATUS, _HANDLE, _ERR = c_int32, c_void_p, POINTER(Error)
_SIZE, _STATE = POINTER(c_size_t), POINTER(StateC)

FUNCTIONS: tuple[tuple[str, list[Any], Any], ...] = (
    ("gait_result_name", [_STATUS], c_char_p),
    ("gait_version", [], c_uint32),
    ("gait_cpu_features", [], c_uint32),
    ("gait_cpu_name", [c_uint32], c_char_p),
    ("gait_abi", [], c_uint32),
    ("gait_abi_fields", [POINTER(c_uint32)], POINTER(AbiField)),
    ("gait_model_bytes", [c_void_p, c_size_t, _SIZE, _ERR], _STATUS),
    ("gait_model_init", [c_void_p, c_size_t, c_void_p, c_size_t, POINTER(_HANDLE), _ERR], _STATUS),
    ("gait_model_get_info", [_HANDLE, POINTER(ModelInfoC), _ERR], _STATUS),
    ("gait_model_joint_name", [_HANDLE, c_int32], c_char_p),
    ("gait_model_angle_name", [_HANDLE, c_int32], c_char_p),
    ("gait_model_limb_name", [_HANDLE, c_int32], c_char_p),
    ("gait_model_pose", [_HANDLE, _STATE, POINTER(PoseC), _ERR], _STATUS),
    ("gait_model_angle_mask", [_HANDLE, c_char_p, POINTER(c_uint32), _ERR], _STATUS),
    ("gait_model_pelvis_height", [_HANDLE, _STATE, POINTER(c_float), _ERR], _STATUS),
    ("gait_render", [_HANDLE, POINTER(CameraC), _STATE, POINTER(c_uint8), c_int32, _ERR], _STATUS),
    ("gait_tracker_default", [POINTER(TrackerConfigC), c_int32], None),
    ("gait_tracker_bytes", [_HANDLE, POINTER(TrackerConfigC), _SIZE, _ERR], _STATUS),
    (
        "gait_tracker_init",
        [c_void_p, c_size_t, _HANDLE, POINTER(TrackerConfigC), POINTER(_HANDLE), _ERR],
        _STATUS,
    ),
    ("gait_tracker_set_background", [_HANDLE, c_int32, POINTER(ImageView), _ERR], _STATUS),
    ("gait_tracker_prior", [_HANDLE, _STATE, _STATE, _ERR], _STATUS),
    ("gait_tracker_start", [_HANDLE, _STATE, _STATE, c_int64, _ERR], _STATUS),
    ("gait_tracker_step", [_HANDLE, POINTER(FrameC), POINTER(EstimateC), _ERR], _STATUS),
    ("gait_tracker_lagged", [_HANDLE, c_int32, POINTER(EstimateC), _ERR], _STATUS),
    ("gait_tracker_set_particles", [_HANDLE, c_int32, _ERR], _STATUS),
    ("gait_tracker_particles", [_HANDLE, _STATE, POINTER(c_float), c_int32, _ERR], c_int32),
    ("gait_tracker_digest", [_HANDLE], c_uint64),
    ("gait_tracker_save", [_HANDLE, c_void_p, c_size_t, _SIZE, _ERR], _STATUS),
    ("gait_tracker_restore", [_HANDLE, c_void_p, c_size_t, _ERR], _STATUS),
    ("gait_pool_bytes", [c_int32, _SIZE, _ERR], _STATUS),
    ("gait_pool_init", [c_void_p, c_size_t, c_int32, POINTER(_HANDLE), _ERR], _STATUS),
    ("gait_pool_tasks", [_HANDLE], Tasks),
    ("gait_pool_stop", [_HANDLE], None),
    *lift.FUNCTIONS,
)
"""Every C function: name, argument types, result type."""


def declare(library: ctypes.CDLL) -> None:
    """Give every function its types.

    Raises
    ------
    AttributeError
        If the library lacks one.
    """
    for name, arguments, result in FUNCTIONS:
        function = getattr(library, name)
        function.argtypes, function.restype = arguments, result


def layout() -> dict[tuple[str, str], tuple[int, int]]:
    """Offset and size in bytes by (struct, field); the field "" is the struct itself."""
    rows = {}
    for name, struct in STRUCTS.items():
        rows[name, ""] = (0, ctypes.sizeof(struct))
        for field, *_ in struct._fields_:
            at = getattr(struct, field)
            rows[name, field] = (at.offset, at.size)
    return rows


def verify(library: ctypes.CDLL) -> list[str]:
    """Compare the layout compiled into the library with `layout`; return one line per difference."""
    count = c_uint32()
    rows = library.gait_abi_fields(ctypes.byref(count))
    theirs = {(row.type.decode(), row.field.decode()): (row.offset, row.size) for row in rows[: count.value]}
    ours = layout()
    faults = []
    for key in sorted(ours.keys() | theirs.keys()):
        if ours.get(key) != theirs.get(key):
            here, there = ours.get(key, "nothing"), theirs.get(key, "nothing")
            faults.append(
                f"{'.'.join(filter(None, key))}: (offset, size) {here} here, {there} in the library"
            )
    return faults
