"""The lifter's part of the C header in ctypes; see `gait.bindings.abi`."""

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
    c_uint32,
    c_uint64,
    c_void_p,
)
from typing import Any

from gait.bindings.abi_plain import MAX_MARKERS, CameraC, Error


class LiftInfoC(ctypes.Structure):
    """``gait_lift_info``."""

    _fields_ = [
        ("markers", c_int32),
        ("frames", c_int32),
        ("hop", c_int32),
        ("headings", c_int32),
        ("components", c_int32),
        ("modes", c_int32),
        ("fps", c_float),
        ("stature", c_float),
        ("digest", c_uint64),
    ]


class LiftConfigC(ctypes.Structure):
    """``gait_lift_config``."""

    _fields_ = [
        ("struct_size", c_uint32),
        ("projection", c_int32),
        ("stature", c_double),
        ("stature_sd", c_double),
        ("sd", c_double),
        ("residual", c_double),
        ("place", c_double * 3),
        ("place_sd", c_double * 3),
        ("heading", c_double),
        ("heading_sd", c_double),
        ("turn_sd", c_double),
        ("tolerance", c_double),
        ("max_iterations", c_int32),
        ("lag", c_int32),
        ("max_rate", c_double),
        ("max_gap", c_double),
        ("fit_threshold", c_double),
        ("report", c_uint64),
        ("axis", c_double * 3 * 2),
        ("camera", CameraC),
        ("cpu_mask", c_uint32),
    ]


class LiftFitC(ctypes.Structure):
    """``gait_lift_fit``."""

    _fields_ = [
        ("log_evidence", c_double),
        ("log10_volume", c_double),
        ("chi2", c_double),
        ("heading", c_double),
        ("heading_sd", c_double),
        ("place", c_double * 3),
        ("share", c_double),
        ("component", c_int32),
        ("observed", c_int32),
        ("iterations", c_int32),
        ("converged", c_int32),
    ]


class LiftFrameC(ctypes.Structure):
    """``gait_lift_frame``."""

    _fields_ = [
        ("utime", c_int64),
        ("frame", c_uint64),
        ("heading", c_double),
        ("chi2_per_observation", c_double),
        ("status", c_int32),
        ("flags", c_uint32),
        ("marker", c_double * 3 * MAX_MARKERS),
        ("sd", c_double * 3 * MAX_MARKERS),
    ]


STRUCTS: dict[str, type[ctypes.Structure]] = {
    "gait_lift_info": LiftInfoC,
    "gait_lift_config": LiftConfigC,
    "gait_lift_fit": LiftFitC,
    "gait_lift_frame": LiftFrameC,
}

_STATUS, _HANDLE, _ERR, _SIZE = c_int32, c_void_p, POINTER(Error), POINTER(c_size_t)

FUNCTIONS: tuple[tuple[str, list[Any], Any], ...] = (
    ("gait_lift_get_info", [_HANDLE, POINTER(LiftInfoC), _ERR], _STATUS),
    ("gait_lift_default", [POINTER(LiftConfigC)], None),
    ("gait_lift_bytes", [_HANDLE, POINTER(LiftConfigC), _SIZE, _ERR], _STATUS),
    (
        "gait_lift_init",
        [c_void_p, c_size_t, _HANDLE, POINTER(LiftConfigC), POINTER(_HANDLE), _ERR],
        _STATUS,
    ),
    ("gait_lift_marker_name", [_HANDLE, c_int32], c_char_p),
    ("gait_lift_segment", [_HANDLE, c_void_p, c_void_p, POINTER(LiftFitC), _ERR], _STATUS),
    ("gait_lift_segment_robust", [_HANDLE, c_void_p, c_void_p, c_void_p, POINTER(LiftFitC), _ERR], _STATUS),
    ("gait_lift_expect", [_HANDLE, c_void_p, c_double, c_double, _ERR], _STATUS),
    ("gait_lift_positions", [_HANDLE, c_void_p, c_void_p, _ERR], _STATUS),
    ("gait_lift_unknowns", [_HANDLE], c_int32),
    ("gait_lift_posterior", [_HANDLE, c_void_p, c_void_p, _ERR], _STATUS),
    ("gait_lift_scale", [_HANDLE, POINTER(c_double), _ERR], _STATUS),
    ("gait_lift_least_squares", [_HANDLE, c_void_p, _ERR], _STATUS),
    ("gait_lift_uncertain", [_HANDLE, c_int32, c_void_p, c_void_p, _ERR], _STATUS),
    ("gait_lift_fix", [_HANDLE, c_void_p, _ERR], _STATUS),
    ("gait_lift_batch", [_HANDLE, c_int32, c_void_p, c_void_p, _ERR], _STATUS),
    ("gait_lift_push", [_HANDLE, c_int64, c_void_p, c_void_p, _ERR], _STATUS),
    ("gait_lift_estimate", [_HANDLE, POINTER(LiftFrameC), _ERR], _STATUS),
    ("gait_lift_reset", [_HANDLE], None),
    ("gait_lift_remove_spikes", [c_int32, c_int32, c_void_p, c_void_p, c_void_p, c_void_p], c_int32),
    ("gait_lift_weight_outliers", [c_int32, c_void_p, c_void_p, c_void_p], c_int32),
)
